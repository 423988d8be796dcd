!> Files, directories and terminals, with the calls of the operating system that Fortran lacks (`system.c`). Status codes are
!> 0 or the number of the system's error.
module thud_system
   use, intrinsic :: iso_c_binding, only: c_char, c_int, c_long_long, c_null_char, c_size_t
   use, intrinsic :: iso_fortran_env, only: int64
   use thud_error, only: error_type, input_error
   use thud_text, only: byte_order_mark, split, to_text
   implicit none (type, external)
   private

   public :: append_text, get_native_path, get_real_path, get_size, get_system_message, is_terminal
   public :: list_directory, make_directory, read_text_file, remove_file, standard_error, standard_output
   public :: swap_directories, write_text

   !> Standard descriptors of the process.
   integer, parameter :: standard_output = 1, standard_error = 2

   !> Maximum length of the name of a file, and of a path.
   integer, parameter, public :: name_length = 255, path_length = 4096

   !> Maximum length of all names in a directory.
   integer, parameter :: list_length = 1048576

   !> Sizes of what is no file.
   integer(int64), parameter, public :: is_missing = -1_int64, is_directory = -2_int64

   !> Maximum size of an input file, bytes.
   integer(int64), parameter :: max_input_size = 65536_int64

   abstract interface
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

      function reading_call(path, text, length) bind(c) result(used)
         import :: c_char, c_int, c_size_t
         implicit none (type, external)
         character(kind=c_char), intent(in) :: path(*)
         character(kind=c_char), intent(out) :: text(*)
         integer(c_size_t), value :: length
         integer(c_int) :: used
      end function reading_call
   end interface

   !> Makes a directory; all paths end with a zero. Negative if the path exists.
   procedure(path_call), bind(c, name='thud_make_directory') :: make_directory
   !> Removes a file or an empty directory.
   procedure(path_call), bind(c, name='thud_remove') :: remove_file
   !> Puts a directory in the place of another one, a path without links, which then has the path of the first. Negative if
   !> the other one was missing or empty: the first path is then free, also for another process.
   procedure(two_path_call), bind(c, name='thud_swap') :: swap_directories
   procedure(reading_call), bind(c, name='thud_list') :: c_list
   procedure(reading_call), bind(c, name='thud_get_real_path') :: c_get_real_path
   procedure(reading_call), bind(c, name='thud_get_native_path') :: c_get_native_path

   interface
      function c_isatty(descriptor) bind(c, name='isatty') result(yes)
         import :: c_int
         implicit none (type, external)
         integer(c_int), value :: descriptor
         integer(c_int) :: yes
      end function c_isatty

      function c_get_size(path) bind(c, name='thud_get_size') result(bytes)
         import :: c_char, c_long_long
         implicit none (type, external)
         character(kind=c_char), intent(in) :: path(*)
         integer(c_long_long) :: bytes
      end function c_get_size

      subroutine c_get_error_text(number, text, length) bind(c, name='thud_get_error_text')
         import :: c_char, c_int, c_size_t
         implicit none (type, external)
         integer(c_int), value :: number
         character(kind=c_char), intent(out) :: text(*)
         integer(c_size_t), value :: length
      end subroutine c_get_error_text

      function c_write(path, descriptor, bytes, length) bind(c, name='thud_write') result(status)
         import :: c_char, c_int, c_size_t
         implicit none (type, external)
         character(kind=c_char), intent(in) :: path(*)
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

      yes = c_isatty(int(descriptor, c_int)) /= 0
   end function is_terminal

   !> Writes a whole text to the screen.
   subroutine write_text(descriptor, text, status)
      !> `standard_output` or `standard_error`.
      integer, intent(in) :: descriptor
      character(len=*), intent(in) :: text
      integer, intent(out) :: status

      status = int(c_write(c_null_char, int(descriptor, c_int), text, len(text, c_size_t)))
   end subroutine write_text

   !> Writes a whole text to the end of a file, which is created if it is missing. Fortran's own output loses the errors of a
   !> full disk.
   subroutine append_text(path, text, status)
      character(len=*), intent(in) :: path, text
      integer, intent(out) :: status

      status = int(c_write(path//c_null_char, -1_c_int, text, len(text, c_size_t)))
   end subroutine append_text

   !> The text of an input file.
   subroutine read_text_file(path, text, error)
      character(len=*), intent(in) :: path
      !> Content, without a byte order mark.
      character(len=:), allocatable, intent(out) :: text
      !> Set if the file is missing, unreadable, empty or too large.
      type(error_type), allocatable, intent(out) :: error
      integer(int64) :: bytes
      character(len=128) :: reason
      integer :: unit, status

      bytes = get_size(path)
      allocate (character(len=min(max(bytes, 0_int64), max_input_size)) :: text)
      status = 1
      if (bytes == is_missing) then
         reason = 'there is no such file'
      else if (bytes == is_directory) then
         reason = 'it is a directory'
      else if (bytes > max_input_size .or. bytes < 1) then
         ! Pipes and devices have no size; opening one could block.
         reason = 'the file is empty, too large or not a regular file'
      else
         ! Threads may read the same file, and none can be open twice.
         !$omp critical (thud_read_text_file)
         open (newunit=unit, file=get_native_path(path), action='read', access='stream', status='old', iostat=status, &
            iomsg=reason)
         if (status == 0) then
            read (unit, iostat=status, iomsg=reason) text
            close (unit)
         end if
         !$omp end critical (thud_read_text_file)
         if (status /= 0) reason = 'the file cannot be read ('//trim(reason)//')'
      end if
      if (status /= 0) error = input_error(trim(reason)//'; allowed: the path of a namelist file of 1 to ' &
         //to_text(int(max_input_size))//' bytes')
      if (index(text, byte_order_mark) == 1) text = text(len(byte_order_mark) + 1:)
   end subroutine read_text_file

   !> Size of a regular file, bytes, 0 of pipes and devices; `is_missing` or `is_directory` of what is none.
   function get_size(path) result(bytes)
      character(len=*), intent(in) :: path
      integer(int64) :: bytes

      bytes = int(c_get_size(path//c_null_char), int64)
   end function get_size

   !> A path as Fortran opens it.
   function get_native_path(path) result(native)
      character(len=*), intent(in) :: path
      character(len=path_length) :: native

      native = path
      if (c_get_native_path(path//c_null_char, native, len(native, c_size_t)) /= 0) return
      native = native(:index(native, c_null_char) - 1)
   end function get_native_path

   !> A path without links; of a missing file or directory the path itself.
   function get_real_path(path) result(real_path)
      character(len=*), intent(in) :: path
      character(len=path_length) :: real_path

      real_path = path(:verify(path, '/', back=.true.))
      if (c_get_real_path(path//c_null_char, real_path, len(real_path, c_size_t)) /= 0) return
      real_path = real_path(:index(real_path, c_null_char) - 1)
   end function get_real_path

   !> Names in a directory.
   subroutine list_directory(path, names, status)
      character(len=*), intent(in) :: path
      !> The names in order: [n_name].
      character(len=name_length), allocatable, intent(out) :: names(:)
      !> Negative if they cannot be read.
      integer, intent(out) :: status
      character(len=:), allocatable :: text
      integer :: n, at

      allocate (character(len=list_length) :: text)
      status = int(c_list(path//c_null_char, text, len(text, c_size_t)))
      call split(text(:max(status - 1, 0)), '/', names)
      do n = 1, size(names) - 1
         at = n - 1 + minloc(names(n:), dim=1)
         names([n, at]) = names([at, n])
      end do
   end subroutine list_directory

end module thud_system
