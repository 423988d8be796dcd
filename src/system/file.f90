!> Files as texts.
module thud_file
   use, intrinsic :: iso_fortran_env, only: int64
   use thud_error, only: error_type, input_error
   use thud_system, only: directory_exists
   use thud_text, only: byte_order_mark, to_text
   implicit none (type, external)
   private

   public :: read_text_file

   !> Maximum size of an input file, bytes.
   integer(int64), parameter :: max_input_size = 65536_int64

contains

   !> The text of a file.
   subroutine read_text_file(path, text, error)
      character(len=*), intent(in) :: path
      !> Content, without a byte order mark.
      character(len=:), allocatable, intent(out) :: text
      !> Set if the file is missing, unreadable, empty or too large.
      type(error_type), allocatable, intent(out) :: error
      integer(int64) :: bytes
      character(len=128) :: reason
      integer :: unit, status

      inquire (file=path, size=bytes)
      if (directory_exists(path)) then
         error = input_error('this is a directory; allowed: the path of a namelist file')
      else if (bytes < 0) then
         error = input_error('there is no such file; allowed: the path of a namelist file')
      else if (bytes > max_input_size .or. bytes < 1) then
         ! Pipes and devices have no size; opening one could block.
         error = input_error('the file is '//trim(merge('empty or not a regular file', 'too large                  ', &
            bytes < 1))//'; allowed: a namelist file of 1 to '//to_text(int(max_input_size))//' bytes')
      end if
      if (allocated(error)) return
      allocate (character(len=bytes) :: text)
      ! Threads may read the same file, and none can be open twice.
      !$omp critical (thud_file)
      open (newunit=unit, file=path, action='read', access='stream', status='old', iostat=status, iomsg=reason)
      if (status == 0) then
         read (unit, iostat=status, iomsg=reason) text
         close (unit)
      end if
      !$omp end critical (thud_file)
      if (status /= 0) error = input_error('the file cannot be read ('//trim(reason)//'); allowed: a readable namelist file')
      if (index(text, byte_order_mark) == 1) text = text(len(byte_order_mark) + 1:)
   end subroutine read_text_file

end module thud_file
