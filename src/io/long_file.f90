!> Files that are too large to be held as one text. They are written as parts; `write_files` gives them their
!> names.
module thud_long_file
   use thud_error, only: error_type, input_error
   use thud_file, only: get_part, writing_error
   use thud_posix, only: directory_exists, remove_file
   implicit none (type, external)
   private

   public :: close_part, open_part, write_part

contains

   !> Begins a file.
   subroutine open_part(directory, name, unit, error)
      !> The directory.
      character(len=*), intent(in) :: directory
      !> Name of the file.
      character(len=*), intent(in) :: name
      !> The unit.
      integer, intent(out) :: unit
      !> The file cannot be made.
      type(error_type), allocatable, intent(out) :: error
      character(len=256) :: message
      integer :: status

      if (directory_exists(directory//'/'//name)) then
         error = input_error('--output '//directory//': '//name//' is a directory; allowed: a file of this name')
         return
      end if
      open (newunit=unit, file=get_part(directory, name), status='replace', action='write', access='stream', &
         form='unformatted', iostat=status, iomsg=message)
      if (status /= 0) error = writing_error(get_part(directory, name), message)
   end subroutine open_part

   !> Adds to a file.
   subroutine write_part(directory, name, unit, text, error)
      !> The directory.
      character(len=*), intent(in) :: directory
      !> Name of the file.
      character(len=*), intent(in) :: name
      !> Its unit.
      integer, intent(in) :: unit
      !> The text.
      character(len=*), intent(in) :: text
      !> It could not be written completely.
      type(error_type), allocatable, intent(out) :: error
      character(len=256) :: message
      integer :: status

      write (unit, iostat=status, iomsg=message) text
      if (status == 0) flush (unit, iostat=status, iomsg=message)
      if (status /= 0) error = writing_error(get_part(directory, name), message)
   end subroutine write_part

   !> Closes a file; after an error it is removed.
   subroutine close_part(directory, name, unit, error)
      !> The directory.
      character(len=*), intent(in) :: directory
      !> Name of the file.
      character(len=*), intent(in) :: name
      !> Its unit.
      integer, intent(in) :: unit
      !> What went wrong before, or now.
      type(error_type), allocatable, intent(inout) :: error
      character(len=256) :: message
      integer :: status

      close (unit, iostat=status, iomsg=message)
      if (status /= 0 .and. .not. allocated(error)) error = writing_error(get_part(directory, name), message)
      if (allocated(error)) call remove_file(get_part(directory, name))
   end subroutine close_part

end module thud_long_file
