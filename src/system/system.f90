!> Operating system calls that Fortran lacks; implemented in `system.c`.
module thud_system
   use, intrinsic :: iso_c_binding, only: c_char, c_int, c_null_char, c_size_t
   implicit none (type, external)
   private

   public :: standard_error, standard_output
   public :: begin_call, close_file, create_file, directory_exists, end_call, end_process, get_system_message
   public :: interrupt_calls, is_forked, is_same_file, is_terminal, list_directory, make_beside, prepare_process
   public :: remove_file, swap_directories, write_text

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

      function number_call(number) bind(c) result(status)
         import :: c_int
         implicit none (type, external)
         integer(c_int), value :: number
         integer(c_int) :: status
      end function number_call
   end interface

   procedure(path_call), bind(c, name='thud_create') :: c_create
   procedure(path_call), bind(c, name='remove') :: c_remove
   procedure(path_text_call), bind(c, name='thud_list') :: c_list
   procedure(path_text_call), bind(c, name='thud_make_beside') :: c_make_beside
   procedure(two_path_call), bind(c, name='thud_is_same_file') :: c_is_same_file
   procedure(two_path_call), bind(c, name='thud_swap') :: c_swap
   !> Closes a file: 0, or the number of the error.
   procedure(number_call), bind(c, name='thud_close') :: close_file
   procedure(number_call), bind(c, name='isatty') :: c_isatty

   !> Turns signals of full and closed outputs into errors; SIGINT and SIGTERM then set `latest_signal`, and the third of
   !> them ends the process.
   procedure(plain_call), bind(c, name='thud_prepare_process') :: prepare_process
   !> Marks the beginning of a call of the library: until its end, SIGINT and SIGTERM also set `latest_signal` if the process
   !> handles them. All calls from Python begin with it except `collect`, `get_progress` and `end_calls`.
   procedure(plain_call), bind(c, name='thud_begin_call') :: begin_call
   !> Marks the end of a call.
   procedure(plain_call), bind(c, name='thud_end_call') :: end_call
   !> Interrupts all running calls.
   procedure(plain_call), bind(c, name='thud_interrupt_calls') :: interrupt_calls

   interface
      !> Ends the process immediately; buffered output would be lost. Threads of OpenBLAS that wait for memory would delay a
      !> usual exit.
      subroutine end_process(code) bind(c, name='_exit')
         import :: c_int
         implicit none (type, external)
         !> Exit code.
         integer(c_int), value :: code
      end subroutine end_process

      subroutine c_get_error_text(number, text, length) bind(c, name='thud_get_error_text')
         import :: c_char, c_int, c_size_t
         implicit none (type, external)
         integer(c_int), value :: number
         character(kind=c_char), intent(out) :: text(*)
         integer(c_size_t), value :: length
      end subroutine c_get_error_text

      function c_write(descriptor, bytes, length) bind(c, name='thud_write') result(status)
         import :: c_char, c_int, c_size_t
         implicit none (type, external)
         integer(c_int), value :: descriptor
         character(kind=c_char), intent(in) :: bytes(*)
         integer(c_size_t), value :: length
         integer(c_int) :: status
      end function c_write
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
      !> 0, or the number of the error.
      integer, intent(out) :: status

      status = int(c_write(int(descriptor, c_int), text, len(text, c_size_t)))
   end subroutine write_text

   !> Whether a directory exists.
   function directory_exists(path) result(exists)
      character(len=*), intent(in) :: path
      logical :: exists

      inquire (file=path//'/.', exist=exists)
   end function directory_exists

   !> Names in a directory.
   subroutine list_directory(path, names)
      character(len=*), intent(in) :: path
      !> The names in order; none if the directory cannot be read: [n_name].
      character(len=name_length), allocatable, intent(out) :: names(:)
      character(len=:), allocatable :: text
      integer :: length, n, at, stop

      text = ' '
      length = int(c_list(path//c_null_char, text, 0_c_size_t))
      ! C ends a text with a zero.
      text = repeat('/', length + 1)
      length = int(c_list(path//c_null_char, text, int(length, c_size_t)))
      allocate (names(count([(text(n:n) == '/', n=1, min(length, len(text) - 1))])))
      at = 1
      do n = 1, size(names)
         stop = at + index(text(at:), '/') - 1
         names(n) = text(at:stop - 1)
         at = stop + 1
      end do
      do n = 1, size(names) - 1
         at = n - 1 + minloc(names(n:), dim=1)
         names([n, at]) = names([at, n])
      end do
   end subroutine list_directory

   !> Makes a new directory beside another one, and missing parents.
   subroutine make_beside(path, made, status)
      !> Path of the other directory, which may be missing; links in it are resolved.
      character(len=*), intent(in) :: path
      !> Path of the new directory.
      character(len=:), allocatable, intent(out) :: made
      !> 0, or the number of the error.
      integer, intent(out) :: status
      character(len=path_length) :: buffer

      status = int(c_make_beside(path(:max(verify(path, '/', back=.true.), 1))//c_null_char, buffer, len(buffer, c_size_t)))
      if (status == 0) made = buffer(:index(buffer, c_null_char) - 1)
   end subroutine make_beside

   !> Puts a directory in the place of another one, which then has the path of the first.
   subroutine swap_directories(path, target, status)
      character(len=*), intent(in) :: path
      !> Path of the other directory; if it is missing or empty, nothing has the first path afterwards.
      character(len=*), intent(in) :: target
      !> 0, or the number of the error.
      integer, intent(out) :: status

      status = int(c_swap(path//c_null_char, target(:max(verify(target, '/', back=.true.), 1))//c_null_char))
   end subroutine swap_directories

   !> Removes a file or an empty directory, if it exists.
   subroutine remove_file(path)
      character(len=*), intent(in) :: path
      integer(c_int) :: ignored

      ignored = c_remove(path//c_null_char)
   end subroutine remove_file

   !> Whether two paths lead to the same file, perhaps by links.
   function is_same_file(path, other) result(yes)
      character(len=*), intent(in) :: path
      !> Path of the other file.
      character(len=*), intent(in) :: other
      logical :: yes

      yes = c_is_same_file(path//c_null_char, other//c_null_char) == 1
   end function is_same_file

end module thud_system
