!> Whole files in, whole sets of files out: a set is either written completely or not at all.
module thud_file
   use, intrinsic :: iso_c_binding, only: c_intptr_t
   use, intrinsic :: iso_fortran_env, only: int64
   use thud_error, only: error_type, input_error
   use thud_posix, only: directory_exists, ignore_interrupts, is_empty_directory, lock_directory, lock_type, &
      make_directory, remove_file, rename_file, unlock_directory
   use thud_text, only: newline, to_text
   implicit none (type, external)
   private

   public :: check_owner, close_part, finish_part, get_file_stem, open_part, read_text_file, remove_parts, text_file_type
   public :: write_files, write_part

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
   subroutine check_owner(directory, names, marker, content, differs, error)
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
      type(error_type), allocatable :: unreadable
      type(lock_type) :: lock
      character(len=:), allocatable :: text

      differs = .false.
      if (.not. directory_exists(directory)) return
      ! Under the lock, so that nobody is writing the parts.
      call lock_directory(directory, lock)
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
   subroutine write_files(directory, files, error)
      !> The directory.
      character(len=*), intent(in) :: directory
      !> The files: [n_file].
      type(text_file_type), intent(in) :: files(:)
      !> A file could not be written; then none of them was, and older ones are as they were.
      type(error_type), allocatable, intent(out) :: error
      type(lock_type) :: lock
      integer(c_intptr_t) :: interrupt
      logical :: done, was_there
      integer :: i

      was_there = directory_exists(directory)
      call make_directory(directory, done)
      if (.not. done) then
         error = input_error('--output '//directory//' cannot be made; allowed: a directory that you may write to')
         return
      end if
      call lock_directory(directory, lock)
      do i = 1, size(files)
         if (directory_exists(directory//'/'//trim(files(i)%name))) then
            error = input_error('--output '//directory//': '//trim(files(i)%name) &
               //' is a directory; allowed: a file of this name')
         else
            call write_text_file(get_part(directory, files(i)%name), files(i)%content, error)
         end if
         if (allocated(error)) exit
      end do
      ! Only renaming is left to do.
      if (.not. allocated(error)) then
         call ignore_interrupts(.true., interrupt)
         do i = 1, size(files)
            call rename_file(get_part(directory, files(i)%name), directory//'/'//trim(files(i)%name), done)
            if (.not. done) error = replacing_error(directory, files(i)%name)
         end do
         call ignore_interrupts(.false., interrupt)
      end if
      if (allocated(error)) call remove_parts(directory, files%name)
      call unlock_directory(lock)
      if (allocated(error) .and. .not. was_there) call remove_file(directory)
   end subroutine write_files

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

   !> Begins a file that is too large to be held as one text; it has its name when it is finished.
   subroutine open_part(directory, name, unit, error)
      !> The directory, which is made where it is missing.
      character(len=*), intent(in) :: directory
      !> Name of the file.
      character(len=*), intent(in) :: name
      !> The unit.
      integer, intent(out) :: unit
      !> The file cannot be made.
      type(error_type), allocatable, intent(out) :: error
      character(len=256) :: message
      logical :: done
      integer :: status

      message = 'the directory cannot be made'
      status = 1
      call make_directory(directory, done)
      if (done) open (newunit=unit, file=get_part(directory, name), status='replace', action='write', access='stream', &
         form='unformatted', iostat=status, iomsg=message)
      if (status /= 0) error = writing_error(get_part(directory, name), message)
   end subroutine open_part

   !> Adds to such a file.
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

   !> Closes such a file; after an error it is removed, and a directory without files with it.
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
      if (.not. allocated(error)) return
      call remove_file(get_part(directory, name))
      if (is_empty_directory(directory)) call remove_file(directory)
   end subroutine close_part

   !> Gives such a file its name.
   subroutine finish_part(directory, name, error)
      !> The directory.
      character(len=*), intent(in) :: directory
      !> Name of the file.
      character(len=*), intent(in) :: name
      !> There is something else of that name.
      type(error_type), allocatable, intent(out) :: error
      logical :: done

      call rename_file(get_part(directory, name), directory//'/'//name, done)
      if (.not. done) error = replacing_error(directory, name)
   end subroutine finish_part

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

   !> Error of a file that cannot have its name.
   pure function replacing_error(directory, name) result(error)
      !> The directory.
      character(len=*), intent(in) :: directory
      !> Name of the file.
      character(len=*), intent(in) :: name
      !> The error.
      type(error_type) :: error

      error = input_error('--output '//directory//': '//trim(name)//' cannot be replaced; allowed: a directory that you ' &
         //'may write to')
   end function replacing_error

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
      if (status /= 0) error = writing_error(path, message)
   end subroutine write_text_file

end module thud_file
