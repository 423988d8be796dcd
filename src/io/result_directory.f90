!> Directories of results, replaced as a whole.
!>
!> A command writes its files into a new directory `.NAME.<number>.new` beside the target NAME, which then takes its place by
!> one exchange of names: a killed process leaves the old or the new results, never a mixture. Where the file system cannot
!> exchange names, two renames take the place of the exchange, and the old results stand in `NAME.old` for that moment. The
!> file `thud.txt` identifies results: the command and its subject in the first line, then the names of all files. A
!> directory is replaced only if thud has made it and the command may remove every file in it, see `check_target`.
module thud_result_directory
   use, intrinsic :: iso_c_binding, only: c_null_char
   use thud_error, only: error_type, input_error
   use thud_interrupt, only: check_interrupt
   use thud_system, only: append_text, get_real_path, get_size, get_system_message, is_directory, is_missing, &
      list_directory, make_directory, name_length, path_length, read_text_file, remove_file, swap_directories
   use thud_text, only: newline, split, to_text
   implicit none (type, external)
   private

   public :: add_text, check_target, close_results, open_results, result_directory_type

   !> Name of the file that identifies results, and the beginning of its first line.
   character(len=*), parameter :: identity = 'thud.txt', signature = 'written by thud '

   !> How often a target is looked at before it is refused.
   integer, parameter :: max_checks = 5

   !> Maximum number of unfinished directories beside a target.
   integer, parameter :: max_folders = 1000

   !> A directory while its results are written.
   type :: result_directory_type
      !> Path as the user gives it.
      character(len=:), allocatable :: path
      !> Command and subject: `run` and the name of a case, for example.
      character(len=:), allocatable :: command, subject
      !> Paths of the files that the results depend on, which are never replaced: [n_input].
      character(len=path_length), allocatable :: inputs(:)
      !> Whether to replace results of another subject.
      logical :: replace = .false.
      !> Path of the new directory.
      character(len=:), allocatable :: folder
   end type result_directory_type

contains

   !> Returns an error if a directory may not be replaced.
   !>
   !> It may be replaced if it is missing or empty, or if thud has made it for the same command and subject, or for others
   !> with `replace`. Every file in it must be one that this command writes: one of `names`, or one that an earlier run of
   !> the same command has listed and that is no page (.html, .pdf), such as a signed report, if names are given.
   subroutine check_target(self, names, error)
      type(result_directory_type), intent(in) :: self
      !> Names of the new files; none if they are not known yet, and pages are then checked later: [n_file].
      character(len=*), intent(in) :: names(:)
      type(error_type), allocatable, intent(out) :: error
      character(len=name_length), allocatable :: old_names(:), listed(:), expected(:)
      character(len=:), allocatable :: path, file, owner, holds
      logical :: exists
      integer :: i, j, status

      path = trim(get_real_path(self%path))
      exists = get_size(path) /= is_missing
      call list_directory(path, old_names, status)
      if (exists .and. status < 0) then
         error = input_error(self%path//' is not a directory that can be read; allowed: a directory')
      else if (exists .and. path == get_real_path('.')) then
         error = input_error(self%path//' is the working directory, which cannot be replaced; allowed: another directory')
      end if
      if (allocated(error) .or. size(old_names) == 0) return
      call read_identity(path, owner, listed)
      if (owner == '' .or. .not. self%replace .and. owner /= trim(self%command//' '//self%subject)) then
         holds = 'results of '//owner
         if (owner == '') holds = 'files of something else'
         error = input_error(self%path//' holds '//holds//'; allowed: a new or empty directory, results of ' &
            //trim(self%command//' '//self%subject)//', or with --replace (replace=True) other results of '//self%command)
         return
      end if
      expected = [character(len=name_length) :: names, identity]
      do i = 1, size(listed)
         if (index(owner//' ', self%command//' ') == 1 .and. (size(names) == 0 .or. index(trim(listed(i))//'|', '.html|') &
            + index(trim(listed(i))//'|', '.pdf|') == 0)) expected = [expected, listed(i)]
      end do
      do i = 1, size(old_names)
         file = '/'//trim(old_names(i))
         exists = get_size(path//file) == is_directory
         if (any([(get_real_path(trim(self%inputs(j))) == path//file, j=1, size(self%inputs))])) then
            error = input_error(self%path//file//' is an input, which is never replaced; allowed: another directory')
         else if (exists .or. all(expected /= old_names(i))) then
            error = input_error(self%path//file//' is in the way: this command does not write it; allowed: another ' &
               //'directory, or remove it first')
         end if
         if (allocated(error)) return
      end do
   end subroutine check_target

   !> Reads whose results a directory holds.
   subroutine read_identity(path, owner, names)
      character(len=*), intent(in) :: path
      !> Command and subject; empty if thud has not made the directory.
      character(len=:), allocatable, intent(out) :: owner
      !> Names of the files, all in the directory itself: [n_file].
      character(len=name_length), allocatable, intent(out) :: names(:)
      type(error_type), allocatable :: error
      character(len=:), allocatable :: text
      integer :: line_end

      owner = ''
      allocate (names(0))
      call read_text_file(path//'/'//identity, text, error)
      if (allocated(error) .or. index(text, signature) /= 1) return
      line_end = index(text//newline, newline)
      owner = text(len(signature) + 1:line_end - 1)
      call split(text(line_end + 1:), newline, names)
      names = pack(names, index(names, '/') == 0)
   end subroutine read_identity

   !> Makes the new directory beside the target, and missing parents.
   subroutine open_results(self, error)
      type(result_directory_type), intent(inout) :: self
      !> Set if the directory cannot be made.
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: target
      integer :: i, status

      target = trim(get_real_path(self%path))
      status = 0
      do i = 2, len(target)
         if (target(i:i) /= '/') cycle
         if (get_size(target(:i - 1)) == is_directory) then
            ! The computer in the path of a share is no directory.
            status = 0
         else if (status <= 0) then
            status = make_directory(target(:i - 1)//c_null_char)
         end if
      end do
      ! The parents may have been missing before.
      target = trim(get_real_path(self%path))
      do i = 1, max_folders
         associate (at => index(target, '/', back=.true.))
            self%folder = target(:at)//'.'//target(at + 1:)//'.'//to_text(i)//'.new'
         end associate
         if (status <= 0) status = make_directory(self%folder//c_null_char)
         if (status >= 0) exit
      end do
      if (status == 0) return
      deallocate (self%folder)
      error = unusable_error(self%path, abs(status))
   end subroutine open_results

   !> Adds text to a file of the new directory.
   subroutine add_text(self, name, text, error)
      type(result_directory_type), intent(in) :: self
      character(len=*), intent(in) :: name, text
      !> Set if an earlier step or this one fails.
      type(error_type), allocatable, intent(inout) :: error
      integer :: status

      if (.not. allocated(error)) call check_interrupt(error)
      if (allocated(error)) return
      call append_text(self%folder//'/'//name, text, status)
      if (status /= 0) error = input_error(self%path//': '//name//' cannot be written ('//trim(get_system_message(status)) &
         //'); allowed: a directory that you may write to, with space on its disk')
   end subroutine add_text

   !> Puts the new directory in the place of the target, or removes it after an error.
   subroutine close_results(self, error)
      type(result_directory_type), intent(in) :: self
      !> Set if an earlier step failed, or the target may not be replaced; the target is unchanged then.
      type(error_type), allocatable, intent(inout) :: error
      character(len=name_length), allocatable :: names(:), old_names(:)
      character(len=:), allocatable :: text, owner
      type(error_type), allocatable :: refusal
      integer :: status, i

      if (.not. allocated(self%folder)) return
      call list_directory(self%folder, names, status)
      text = signature//trim(self%command//' '//self%subject)//newline
      do i = 1, size(names)
         text = text//trim(names(i))//newline
      end do
      call add_text(self, identity, text, error)
      do i = 1, max_checks
         if (allocated(error)) exit
         ! Another process may replace the target between two looks at it.
         call check_target(self, names, refusal)
         if (.not. allocated(refusal)) exit
         if (i == max_checks) call move_alloc(refusal, error)
      end do
      if (.not. allocated(error)) then
         status = swap_directories(self%folder//c_null_char, trim(get_real_path(self%path))//c_null_char)
         if (status < 0) return
         if (status > 0) error = unusable_error(self%path, status)
      end if
      ! The folder now holds the old results, or after an error the new ones. It stays if another program wrote into it.
      call read_identity(self%folder, owner, old_names)
      names = [character(len=name_length) :: names, old_names, identity, '']
      do i = 1, size(names)
         status = remove_file(self%folder//'/'//trim(names(i))//c_null_char)
      end do
   end subroutine close_results

   !> Error for a directory that cannot be made or replaced.
   function unusable_error(path, status) result(error)
      character(len=*), intent(in) :: path
      !> Number of the system's error.
      integer, intent(in) :: status
      type(error_type) :: error

      error = input_error(path//' cannot be used ('//trim(get_system_message(status))//'); allowed: a directory ' &
         //'that no program has open, in a folder that you may write to')
   end function unusable_error

end module thud_result_directory
