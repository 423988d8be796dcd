!> Whole files in, whole sets of files out: a set is either written completely or not at all.
module thud_file
   use, intrinsic :: iso_c_binding, only: c_intptr_t
   use, intrinsic :: iso_fortran_env, only: int64
   use thud_error, only: error_type, input_error
   use thud_atomic_write, only: name_part, remove_parts, require_directory, write_whole_part
   use thud_posix, only: directory_exists, ignore_interrupts, is_empty_directory, lock_directory, lock_type, &
      remove_file, unlock_directory
   use thud_text, only: newline, to_text
   implicit none (type, external)
   private

   public :: check_owner, get_file_stem, read_text_file, text_file_type, write_files

   !> Size of the largest input file that is read, bytes.
   integer(int64), parameter :: largest_input = 65536_int64

   !> A file to be written.
   type :: text_file_type
      !> Name without directory.
      character(len=32) :: name = ''
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
         inquire (file=path, size=bytes)
         if (bytes > largest_input .or. bytes < 1) then
            ! Pipes and devices have no size; to open one could take for ever.
            error = input_error('the file is '//trim(merge('empty or not a regular file', 'too large                  ', &
               bytes < 1))//'; allowed: a namelist file of 1 to '//to_text(int(largest_input))//' bytes')
            return
         end if
         open (newunit=unit, file=path, status='old', action='read', access='stream', form='unformatted', &
            iostat=status, iomsg=message)
         if (status /= 0) then
            error = input_error('the file cannot be read ('//trim(message)//'); allowed: a readable namelist file')
            return
         end if
         allocate (character(len=bytes) :: text)
         read (unit, iostat=status, iomsg=message) text
         if (status /= 0) error = input_error('the file cannot be read ('//trim(message) &
            //'); allowed: a readable namelist file')
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
   subroutine check_owner(directory, names, marker, content, differs, error, locked)
      !> The directory.
      character(len=*), intent(in) :: directory
      !> Names of all files that a run may write: [n_file].
      character(len=*), intent(in) :: names(:)
      !> Name of the file whose first line tells whose directory it is.
      character(len=*), intent(in) :: marker
      !> What this file will hold.
      character(len=*), intent(in) :: content
      !> The directory holds the same case with another content of this file.
      logical, intent(out) :: differs
      !> The directory belongs to something else.
      type(error_type), allocatable, intent(out) :: error
      !> The caller holds the lock on the directory; otherwise, as without this, it is taken here.
      logical, intent(in), optional :: locked
      type(error_type), allocatable :: unreadable
      type(lock_type) :: lock
      logical :: takes
      character(len=:), allocatable :: text

      differs = .false.
      if (.not. directory_exists(directory)) return
      ! Under the lock, so that nobody is writing the parts.
      takes = .true.
      if (present(locked)) takes = .not. locked
      if (takes) call lock_directory(directory, lock)
      call remove_parts(directory, names)
      call unlock_directory(lock)
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
   !>
   !> The directory is locked meanwhile; a process that dies leaves no lock and nothing but files
   !> named `.<name>.part`, which the next one replaces.
   subroutine write_files(directory, files, error, ready)
      !> The directory.
      character(len=*), intent(in) :: directory
      !> The files: [n_file].
      type(text_file_type), intent(in) :: files(:)
      !> A file could not be written; then none of them was, and older ones are as they were.
      type(error_type), allocatable, intent(out) :: error
      !> Name of one more file, whose part is written already; then the caller holds the lock.
      character(len=*), intent(in), optional :: ready
      type(lock_type) :: lock
      integer(c_intptr_t) :: interrupt
      logical :: was_there
      integer :: i

      was_there = directory_exists(directory)
      call require_directory(directory, error)
      if (allocated(error)) return
      if (.not. present(ready)) call lock_directory(directory, lock)
      do i = 1, size(files)
         call write_whole_part(directory, trim(files(i)%name), files(i)%content, error)
         if (allocated(error)) exit
      end do
      ! Only renaming is left to do.
      if (.not. allocated(error)) then
         call ignore_interrupts(.true., interrupt)
         if (present(ready)) call name_part(directory, ready, error)
         do i = 1, size(files)
            call name_part(directory, files(i)%name, error)
         end do
         call ignore_interrupts(.false., interrupt)
      end if
      if (allocated(error)) call remove_parts(directory, files%name)
      if (allocated(error) .and. present(ready)) call remove_parts(directory, [ready])
      call unlock_directory(lock)
      if (allocated(error) .and. .not. was_there) call remove_file(directory)
   end subroutine write_files

end module thud_file
