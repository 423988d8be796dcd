!> Files while they are written: they have other names, so that nobody takes half a file for a whole one.
module thud_atomic_write
   use thud_error, only: error_type, input_error
   use thud_posix, only: directory_exists, make_directory, remove_file, rename_file
   implicit none (type, external)
   private

   public :: close_part, name_part, open_part, remove_parts, require_directory, write_part, write_whole_part

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

   !> Writes all of a file.
   subroutine write_whole_part(directory, name, text, error)
      !> The directory.
      character(len=*), intent(in) :: directory
      !> Name of the file.
      character(len=*), intent(in) :: name
      !> All of its text.
      character(len=*), intent(in) :: text
      !> It could not be written completely.
      type(error_type), allocatable, intent(out) :: error
      integer :: unit

      call open_part(directory, name, unit, error)
      if (allocated(error)) return
      call write_part(directory, name, unit, text, error)
      call close_part(directory, name, unit, error)
   end subroutine write_whole_part

   !> Makes a directory where there is none.
   subroutine require_directory(directory, error)
      !> The directory.
      character(len=*), intent(in) :: directory
      !> It cannot be made.
      type(error_type), allocatable, intent(out) :: error
      logical :: done

      call make_directory(directory, done)
      if (.not. done) error = input_error('--output '//directory//' cannot be made; allowed: a directory that you may ' &
         //'write to')
   end subroutine require_directory

   !> Gives a file that is written its name, unless something went wrong before.
   subroutine name_part(directory, name, error)
      !> The directory.
      character(len=*), intent(in) :: directory
      !> Name of the file.
      character(len=*), intent(in) :: name
      !> What went wrong; there may be something else of that name.
      type(error_type), allocatable, intent(inout) :: error
      logical :: done

      if (allocated(error)) return
      call rename_file(get_part(directory, name), directory//'/'//trim(name), done)
      if (.not. done) error = input_error('--output '//directory//': '//trim(name)//' cannot be replaced; allowed: a ' &
         //'directory that you may write to')
   end subroutine name_part

   !> Removes what a process that died while writing has left.
   subroutine remove_parts(directory, names)
      !> The directory.
      character(len=*), intent(in) :: directory
      !> Names of the files: [n_file].
      character(len=*), intent(in) :: names(:)
      integer :: i

      do i = 1, size(names)
         call remove_file(get_part(directory, names(i)))
      end do
   end subroutine remove_parts

   !> Path of a file while it is written.
   pure function get_part(directory, name) result(path)
      !> The directory.
      character(len=*), intent(in) :: directory
      !> Name of the file.
      character(len=*), intent(in) :: name
      !> The path.
      character(len=len(directory) + len_trim(name) + 7) :: path

      path = directory//'/.'//trim(name)//'.part'
   end function get_part

   !> Error of a file that cannot be written.
   pure function writing_error(path, message) result(error)
      !> Path of the file.
      character(len=*), intent(in) :: path
      !> What the run-time library says.
      character(len=*), intent(in) :: message
      !> The error.
      type(error_type) :: error

      error = input_error('--output: '//path//' cannot be written ('//trim(message) &
         //'); allowed: a directory that you may write to, with room on its disk')
   end function writing_error

end module thud_atomic_write
