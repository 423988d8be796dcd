!> Operating system calls that Fortran lacks; implemented in `system.c`.
module thud_system
   use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_int, c_int64_t, c_intptr_t, &
      c_null_char, c_ptr, c_size_t
   use, intrinsic :: iso_fortran_env, only: int64
   implicit none (type, external)
   private

   public :: standard_error, standard_output
   public :: begin_call, close_descriptor, create_file, defer_interrupts, directory_exists, end_call, end_process
   public :: get_file_size, get_system_message, interrupt_calls, is_forked, is_same_file
   public :: is_terminal, list_directory, make_beside, open_descriptor, pass_interrupts, prepare_process, read_bytes
   public :: remove_file, rename_file, resolve_path, swap_directories, write_text

   !> Standard descriptors of the process.
   integer, parameter :: standard_output = 1, standard_error = 2

   !> Maximum length of the name of a file, and of a path.
   integer, parameter, public :: name_length = 255, path_length = 4096

   !> 1 in a process forked from one that had called the library, whose threads it lacks, else 0; defined in system.c.
   integer(c_int), volatile, bind(c, name='thud_is_forked') :: is_forked

   abstract interface
      subroutine plain_call() bind(c)
         implicit none (type, external)
      end subroutine plain_call

      function path_call(path) bind(c) result(status)
         import :: c_char, c_int
         implicit none (type, external)
         character(kind=c_char), intent(in) :: path(*)
         integer(c_int) :: status
      end function path_call

      function two_path_call(path, other) bind(c) result(status)
         import :: c_char, c_int
         implicit none (type, external)
         character(kind=c_char), intent(in) :: path(*), other(*)
         integer(c_int) :: status
      end function two_path_call

      function path_text_call(path, text, length) bind(c) result(status)
         import :: c_char, c_int, c_size_t
         implicit none (type, external)
         character(kind=c_char), intent(in) :: path(*)
         character(kind=c_char), intent(out) :: text(*)
         integer(c_size_t), value :: length
         integer(c_int) :: status
      end function path_text_call

      function path_number_call(path) bind(c) result(number)
         import :: c_char, c_int64_t
         implicit none (type, external)
         character(kind=c_char), intent(in) :: path(*)
         integer(c_int64_t) :: number
      end function path_number_call

      function number_call(number) bind(c) result(status)
         import :: c_int
         implicit none (type, external)
         integer(c_int), value :: number
         integer(c_int) :: status
      end function number_call
   end interface

   procedure(path_call), bind(c, name='thud_open') :: c_open
   procedure(path_call), bind(c, name='thud_create') :: c_create
   procedure(path_call), bind(c, name='remove') :: c_remove
   procedure(path_text_call), bind(c, name='thud_resolve') :: c_resolve
   procedure(path_text_call), bind(c, name='thud_make_beside') :: c_make_beside
   procedure(path_number_call), bind(c, name='thud_get_file_size') :: c_get_file_size
   procedure(two_path_call), bind(c, name='rename') :: c_rename
   procedure(two_path_call), bind(c, name='thud_is_same_file') :: c_is_same_file
   procedure(two_path_call), bind(c, name='thud_swap') :: c_swap
   procedure(number_call), bind(c, name='thud_close') :: c_close
   procedure(number_call), bind(c, name='isatty') :: c_isatty

   !> Turns signals of full and closed outputs into errors; SIGINT and SIGTERM then end the process with a message.
   procedure(plain_call), bind(c, name='thud_prepare_process') :: prepare_process
   !> From now on an interrupt does not end the process; it stops `write_text`.
   procedure(plain_call), bind(c, name='thud_defer_interrupts') :: defer_interrupts
   !> Marks the beginning of a call of the library: until its end, SIGINT and SIGTERM also set `latest_signal` if the process
   !> handles them, and forks wait. All calls from Python begin with it except `collect`, `get_progress` and `end_calls`.
   procedure(plain_call), bind(c, name='thud_begin_call') :: begin_call
   !> Marks the end of a call.
   procedure(plain_call), bind(c, name='thud_end_call') :: end_call
   !> Interrupts all running calls.
   procedure(plain_call), bind(c, name='thud_interrupt_calls') :: interrupt_calls

   interface
      !> Ends the process immediately; buffered output would be lost.
      subroutine end_process(code) bind(c, name='thud_end_process')
         import :: c_int
         implicit none (type, external)
         !> Exit code.
         integer(c_int), value :: code
      end subroutine end_process

      !> From now on an interrupt ends the process.
      subroutine pass_interrupts(written) bind(c, name='thud_pass_interrupts')
         import :: c_int
         implicit none (type, external)
         !> 1 if the results have been written, else 0.
         integer(c_int), value :: written
      end subroutine pass_interrupts

      subroutine c_get_error_text(number, text, length) bind(c, name='thud_get_error_text')
         import :: c_char, c_int, c_size_t
         implicit none (type, external)
         integer(c_int), value :: number
         character(kind=c_char), intent(out) :: text(*)
         integer(c_size_t), value :: length
      end subroutine c_get_error_text

      function c_read(descriptor, bytes, length) bind(c, name='thud_read') result(count)
         import :: c_char, c_int, c_intptr_t, c_size_t
         implicit none (type, external)
         integer(c_int), value :: descriptor
         character(kind=c_char), intent(out) :: bytes(*)
         integer(c_size_t), value :: length
         integer(c_intptr_t) :: count
      end function c_read

      function c_write(descriptor, bytes, length) bind(c, name='thud_write') result(status)
         import :: c_char, c_int, c_size_t
         implicit none (type, external)
         integer(c_int), value :: descriptor
         character(kind=c_char), intent(in) :: bytes(*)
         integer(c_size_t), value :: length
         integer(c_int) :: status
      end function c_write

      function c_opendir(path) bind(c, name='opendir') result(directory)
         import :: c_char, c_ptr
         implicit none (type, external)
         character(kind=c_char), intent(in) :: path(*)
         type(c_ptr) :: directory
      end function c_opendir

      function c_next_name(directory, name, length) bind(c, name='thud_next_name') result(used)
         import :: c_char, c_ptr, c_size_t
         implicit none (type, external)
         type(c_ptr), value :: directory
         character(kind=c_char), intent(out) :: name(*)
         integer(c_size_t), value :: length
         integer(c_size_t) :: used
      end function c_next_name

      function c_closedir(directory) bind(c, name='closedir') result(status)
         import :: c_int, c_ptr
         implicit none (type, external)
         type(c_ptr), value :: directory
         integer(c_int) :: status
      end function c_closedir
   end interface

contains

   !> The system's message for an error number.
   function get_system_message(status) result(text)
      integer, intent(in) :: status
      character(len=128) :: text

      call c_get_error_text(int(status, c_int), text, len(text, c_size_t))
      text = text(:index(text, c_null_char) - 1)
   end function get_system_message

   !> Whether a descriptor is a terminal.
   function is_terminal(descriptor) result(yes)
      !> `standard_output` or `standard_error`.
      integer, intent(in) :: descriptor
      logical :: yes

      yes = c_isatty(int(descriptor, c_int)) == 1
   end function is_terminal

   !> Opens a file, pipe or device for reading.
   function open_descriptor(path) result(descriptor)
      character(len=*), intent(in) :: path
      !> The descriptor; negative if the file cannot be opened.
      integer :: descriptor

      descriptor = int(c_open(path//c_null_char))
   end function open_descriptor

   !> Reads the available bytes, up to the length of the buffer.
   subroutine read_bytes(descriptor, buffer, count)
      integer, intent(in) :: descriptor
      character(len=*), intent(out) :: buffer
      !> Number of bytes read; 0 at the end, negative after an error.
      integer, intent(out) :: count

      count = int(c_read(int(descriptor, c_int), buffer, len(buffer, c_size_t)))
   end subroutine read_bytes

   !> Closes a descriptor.
   subroutine close_descriptor(descriptor, status)
      !> The descriptor; negative if closed, as it is afterwards.
      integer, intent(inout) :: descriptor
      !> 0, or the number of the error.
      integer, intent(out), optional :: status
      integer :: result_status

      result_status = 0
      if (descriptor >= 0) result_status = int(c_close(int(descriptor, c_int)))
      descriptor = -1
      if (present(status)) status = result_status
   end subroutine close_descriptor

   !> Creates a file.
   subroutine create_file(path, descriptor, status)
      character(len=*), intent(in) :: path
      integer, intent(out) :: descriptor
      !> 0, or the number of the error.
      integer, intent(out) :: status

      descriptor = int(c_create(path//c_null_char))
      status = max(-descriptor, 0)
   end subroutine create_file

   !> Writes a whole text to a file or to the screen.
   subroutine write_text(descriptor, text, status)
      integer, intent(in) :: descriptor
      character(len=*), intent(in) :: text
      !> 0, the number of the error, or negative after an interrupt.
      integer, intent(out) :: status

      status = int(c_write(int(descriptor, c_int), text, len(text, c_size_t)))
   end subroutine write_text

   !> Whether a directory exists.
   function directory_exists(path) result(exists)
      character(len=*), intent(in) :: path
      !> It exists and can be read.
      logical :: exists
      type(c_ptr) :: directory

      directory = c_opendir(path//c_null_char)
      exists = c_associated(directory)
      if (exists) exists = c_closedir(directory) == 0
   end function directory_exists

   !> Names in a directory.
   subroutine list_directory(path, names)
      character(len=*), intent(in) :: path
      !> The names in order; none if the directory cannot be read: [n_name].
      character(len=name_length), allocatable, intent(out) :: names(:)
      character(len=name_length + 1) :: name
      type(c_ptr) :: directory
      integer :: n, length, first

      allocate (names(64))
      n = 0
      directory = c_opendir(path//c_null_char)
      if (c_associated(directory)) then
         do
            length = int(c_next_name(directory, name, len(name, c_size_t)))
            if (length == 0) exit
            if (n == size(names)) names = [names, names]
            n = n + 1
            names(n) = name(:length)
            ! A zero byte keeps `trim` from removing a blank at the end of the name.
            if (name(length:length) == ' ') names(n)(min(length + 1, name_length):) = c_null_char
         end do
         if (c_closedir(directory) /= 0) n = 0
      end if
      names = names(:n)
      do n = 1, size(names) - 1
         first = n - 1 + minloc(names(n:), dim=1)
         names([n, first]) = names([first, n])
      end do
   end subroutine list_directory

   !> Resolves links in a path; creates missing parent directories.
   subroutine resolve_path(path, resolved, status)
      !> Path of a directory, which may be missing.
      character(len=*), intent(in) :: path
      !> Absolute path without links.
      character(len=:), allocatable, intent(out) :: resolved
      !> 0, or the number of the error.
      integer, intent(out) :: status
      character(len=path_length) :: buffer
      integer :: stop

      stop = max(verify(path, '/', back=.true.), 1)
      status = int(c_resolve(path(:stop)//c_null_char, buffer, len(buffer, c_size_t)))
      if (status == 0) resolved = buffer(:index(buffer, c_null_char) - 1)
   end subroutine resolve_path

   !> Makes a new directory beside another one.
   subroutine make_beside(path, made, status)
      !> Absolute path of the other directory, which may be missing.
      character(len=*), intent(in) :: path
      !> Path of the new directory.
      character(len=:), allocatable, intent(out) :: made
      !> 0, or the number of the error.
      integer, intent(out) :: status
      character(len=path_length) :: buffer

      status = int(c_make_beside(path//c_null_char, buffer, len(buffer, c_size_t)))
      if (status == 0) made = buffer(:index(buffer, c_null_char) - 1)
   end subroutine make_beside

   !> Puts a directory in the place of another one, which then has the path of the first.
   subroutine swap_directories(path, target, status)
      character(len=*), intent(in) :: path
      !> Path of the other directory; if it is missing or empty, nothing has the first path afterwards.
      character(len=*), intent(in) :: target
      !> 0, or the number of the error.
      integer, intent(out) :: status

      status = int(c_swap(path//c_null_char, target//c_null_char))
   end subroutine swap_directories

   !> Renames a file; an existing file of the new name is replaced in the same step.
   subroutine rename_file(old_path, new_path, done)
      character(len=*), intent(in) :: old_path
      !> New path in the same file system.
      character(len=*), intent(in) :: new_path
      !> The file has its new name.
      logical, intent(out) :: done

      done = c_rename(old_path//c_null_char, new_path//c_null_char) == 0
   end subroutine rename_file

   !> Removes a file or an empty directory, if it exists.
   subroutine remove_file(path, done)
      character(len=*), intent(in) :: path
      !> Something has been removed.
      logical, intent(out), optional :: done
      integer(c_int) :: status

      status = c_remove(path//c_null_char)
      if (present(done)) done = status == 0
   end subroutine remove_file

   !> Size of a file.
   subroutine get_file_size(path, bytes)
      character(len=*), intent(in) :: path
      !> Size, bytes: 0 if the file is not regular, negative if there is none.
      integer(int64), intent(out) :: bytes

      bytes = int(c_get_file_size(path//c_null_char), int64)
   end subroutine get_file_size

   !> Whether two paths lead to the same file, perhaps by links.
   function is_same_file(path, other) result(yes)
      character(len=*), intent(in) :: path
      !> Path of the other file.
      character(len=*), intent(in) :: other
      logical :: yes

      yes = c_is_same_file(path//c_null_char, other//c_null_char) == 1
   end function is_same_file

end module thud_system
