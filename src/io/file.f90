!> Whole files in, whole sets of files out: a set is either written completely or not at all.
module thud_file
   use, intrinsic :: iso_fortran_env, only: int64
   use thud_error, only: error_type, input_error
   use thud_posix, only: directory_exists, get_process_id, is_empty_directory, make_directory, remove_file, rename_file
   use thud_text, only: newline, to_text
   implicit none (type, external)
   private

   public :: check_owner, get_file_stem, read_text_file, text_file_type, write_files

   !> Size of the largest input file that is read, bytes.
   integer(int64), parameter :: largest_input = 1048576_int64

   !> A file to be written.
   type :: text_file_type
      !> Name without directory.
      character(len=:), allocatable :: name
      !> All of its text.
      character(len=:), allocatable :: content
   end type text_file_type

contains

   !> The text of a file.
   subroutine read_text_file(path, text, error)
      !> Path of the file.
      character(len=*), intent(in) :: path
      !> Its text.
      character(len=:), allocatable, intent(out) :: text
      !> The file is missing, unreadable, empty or too large.
      type(error_type), allocatable, intent(out) :: error
      character(len=256) :: message
      integer :: status, unit
      integer(int64) :: bytes
      logical :: there

      message = ''
      inquire (file=path, exist=there)
      if (path == '' .or. .not. there) then
         error = input_error('there is no such file; allowed: the path of a namelist file')
      else if (directory_exists(path)) then
         error = input_error('this is a directory; allowed: the path of a namelist file')
      else
         open (newunit=unit, file=path, status='old', action='read', access='stream', form='unformatted', &
            iostat=status, iomsg=message)
         if (status /= 0) then
            error = input_error('the file cannot be read ('//trim(message)//'); allowed: a readable namelist file')
            return
         end if
         inquire (unit=unit, size=bytes)
         if (bytes > largest_input .or. bytes < 1) then
            error = input_error('the file is '//trim(merge('empty    ', 'too large', bytes < 1)) &
               //'; allowed: a namelist file of 1 to '//to_text(int(largest_input))//' bytes')
         else
            allocate (character(len=bytes) :: text)
            read (unit, iostat=status, iomsg=message) text
            if (status /= 0) error = input_error('the file cannot be read ('//trim(message) &
               //'); allowed: a readable namelist file')
         end if
         close (unit)
      end if
   end subroutine read_text_file

   !> Name of a file without directory and ending.
   pure function get_file_stem(path) result(stem)
      !> Path of the file.
      character(len=*), intent(in) :: path
      !> Its stem: `inputs/ball.nml` gives `ball`.
      character(len=:), allocatable :: stem
      integer :: dot

      stem = trim(path(index(path, '/', back=.true.) + 1:))
      dot = index(stem, '.', back=.true.)
      if (dot > 1) stem = stem(:dot - 1)
   end function get_file_stem

   !> Complains where a directory holds anything else than an earlier run of the same case.
   subroutine check_owner(directory, marker, content, differs, error)
      !> The directory.
      character(len=*), intent(in) :: directory
      !> Name of the file whose first line tells whose directory it is.
      character(len=*), intent(in) :: marker
      !> What this file will hold.
      character(len=*), intent(in) :: content
      !> The directory holds the same case with another content of this file.
      logical, intent(out) :: differs
      !> The directory belongs to something else.
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: unreadable
      character(len=:), allocatable :: text

      differs = .false.
      if (.not. directory_exists(directory)) return
      if (is_empty_directory(directory)) return
      call read_text_file(directory//'/'//marker, text, unreadable)
      if (.not. allocated(unreadable)) then
         if (index(text, content(:index(content, newline))) == 1) then
            differs = text /= content
            return
         end if
      end if
      error = input_error('--output '//directory//' holds files of something else; allowed: a new or empty directory, ' &
         //'or results of the same case')
   end subroutine check_owner

   !> Writes a set of files into a directory, which is made where it is missing.
   subroutine write_files(directory, files, error)
      !> The directory.
      character(len=*), intent(in) :: directory
      !> The files: [n_file].
      type(text_file_type), intent(in) :: files(:)
      !> A file could not be written; then none of them was, and older ones are as they were.
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: ending
      logical :: done, was_there
      integer :: i

      was_there = directory_exists(directory)
      call make_directory(directory, done)
      if (.not. done) then
         error = input_error('--output '//directory//' cannot be made; allowed: a directory that you may write to')
         return
      end if
      ! Under other names first: after the last one only renaming is left to do.
      ending = '.'//to_text(get_process_id())//'.part'
      do i = 1, size(files)
         call write_text_file(directory//'/.'//files(i)%name//ending, files(i)%content, error)
         if (allocated(error)) exit
      end do
      if (.not. allocated(error)) then
         do i = 1, size(files)
            call rename_file(directory//'/.'//files(i)%name//ending, directory//'/'//files(i)%name, done)
            if (done) cycle
            error = input_error('--output '//directory//': '//files(i)%name//' cannot be replaced; ' &
               //'allowed: a directory that you may write to')
            exit
         end do
      end if
      if (.not. allocated(error)) return
      do i = 1, size(files)
         call remove_file(directory//'/.'//files(i)%name//ending)
      end do
      if (.not. was_there) call remove_file(directory)
   end subroutine write_files

   !> Writes one file.
   subroutine write_text_file(path, content, error)
      !> Path of the file.
      character(len=*), intent(in) :: path
      !> All of its text.
      character(len=*), intent(in) :: content
      !> It could not be written completely.
      type(error_type), allocatable, intent(out) :: error
      character(len=256) :: message, close_message
      integer :: status, close_status, unit

      message = ''
      open (newunit=unit, file=path, status='replace', action='write', access='stream', form='unformatted', &
         iostat=status, iomsg=message)
      if (status == 0) then
         write (unit, iostat=status, iomsg=message) content
         if (status == 0) flush (unit, iostat=status, iomsg=message)
         close (unit, iostat=close_status, iomsg=close_message)
         if (status == 0 .and. close_status /= 0) then
            status = close_status
            message = close_message
         end if
      end if
      if (status /= 0) error = input_error('--output: '//path//' cannot be written ('//trim(message) &
         //'); allowed: a directory that you may write to, with room on its disk')
   end subroutine write_text_file

end module thud_file
