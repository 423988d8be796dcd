!> Directories of results, replaced as a whole.
!>
!> A command writes its files into a new directory `.NAME.<process>-<number>.new` beside the target NAME, which then takes
!> its place by one exchange of names: a killed process leaves the old or the new results, never a mixture. Where the file
!> system cannot exchange names, two renames take the place of the exchange, and the old results stand in `NAME.old` for
!> that moment. The file `thud.txt` identifies results: the command and its subject in the first line, then the names of all
!> files. A directory is replaced only if thud has made it and the command may remove every file in it, see `check_target`.
module thud_result_directory
   use thud_error, only: error_type, input_error
   use thud_file, only: read_text_file
   use thud_interrupt, only: check_interrupt
   use thud_system, only: close_file, create_file, directory_exists, get_system_message, is_same_file, list_directory, &
      make_beside, name_length, path_length, remove_file, swap_directories, write_text
   use thud_text, only: newline
   implicit none (type, external)
   private

   public :: add_text, begin_file, check_target, close_results, open_results, result_directory_type
   public :: write_file

   !> Name of the file that identifies results, and the beginning of its first line.
   character(len=*), parameter :: identity = 'thud.txt', signature = 'written by thud '

   !> How often a target is looked at before it is refused.
   integer, parameter :: max_checks = 5

   !> A directory while its results are written.
   type :: result_directory_type
      !> Path as the user gives it.
      character(len=:), allocatable :: path
      !> Command and subject: `run` and the name of a case, for example.
      character(len=:), allocatable :: command, subject
      !> Paths of the files that the results depend on, which are never replaced: [n_input].
      character(len=path_length), allocatable :: inputs(:)
      !> Whether to replace results of another subject or command.
      logical :: replace = .false.
      !> Path of the new directory.
      character(len=:), allocatable :: folder
      !> Name and descriptor of the file that is being written; negative if there is none.
      character(len=:), allocatable :: name
      integer :: file = -1
   end type result_directory_type

contains

   !> Returns an error if a directory may not be replaced.
   !>
   !> It may be replaced if it is missing or empty, or if thud has made it for the same command and subject, or for others
   !> with `replace`. Every file in it must be one that this command writes: one of `names`, or one that an earlier run of
   !> the same command has listed and that is no page (.html, .pdf), such as a signed report.
   subroutine check_target(self, names, error)
      type(result_directory_type), intent(in) :: self
      !> Names of the new files; none if they are not known yet, and files are then checked later: [n_file].
      character(len=*), intent(in) :: names(:)
      type(error_type), allocatable, intent(out) :: error
      character(len=name_length), allocatable :: present_names(:), listed(:)
      character(len=:), allocatable :: command, subject, path, holds
      logical :: exists, is_page, may_go
      integer :: i, j

      if (.not. directory_exists(self%path)) then
         inquire (file=self%path, exist=exists)
         if (exists) error = input_error(self%path//' is not a directory that can be read; allowed: a directory')
         return
      end if
      if (is_same_file(self%path, '.')) then
         error = input_error(self%path//' is the working directory, which cannot be replaced; allowed: ' &
            //'another directory')
         return
      end if
      call list_directory(self%path, present_names)
      if (size(present_names) == 0) return
      call read_identity(self%path, command, subject, listed)
      if (.not. self%replace .and. (command /= self%command .or. subject /= self%subject)) then
         holds = 'files of something else'
         if (command /= '') holds = 'results of '//trim(command//' '//subject)
         error = input_error(self%path//' holds '//holds//'; allowed: a new or empty directory, or results of ' &
            //trim(self%command//' '//self%subject))
         ! Other commands write other files, which are never removed.
         if (command == self%command) error%message = error%message//'; with --replace (replace=True) others of '//command
         return
      end if
      if (command /= self%command) listed = listed(:0)
      do i = 1, size(present_names)
         path = self%path//'/'//trim(present_names(i))
         do j = 1, size(self%inputs)
            if (is_same_file(path, trim(self%inputs(j)))) error = input_error(path//' is an input, which is never ' &
               //'replaced; allowed: another directory')
         end do
         if (allocated(error)) return
         associate (name => present_names(i))
            is_page = index(trim(name)//'|', '.html|') + index(trim(name)//'|', '.pdf|') > 0
            ! Only a command that writes a page anew removes it.
            may_go = any(names == name) .or. merge(size(names) == 0, any(listed == name) .or. (size(names) == 0 &
               .and. self%replace), is_page) .or. (name == identity .and. (command /= '' .or. self%replace))
         end associate
         if (may_go .and. .not. directory_exists(path)) cycle
         error = input_error(path//' is in the way: this command does not write it; allowed: another directory, or ' &
            //'remove it first')
         return
      end do
   end subroutine check_target

   !> Reads whose results a directory holds.
   subroutine read_identity(path, command, subject, names)
      character(len=*), intent(in) :: path
      !> Command and subject; empty if thud has not made the directory.
      character(len=:), allocatable, intent(out) :: command, subject
      !> Names of the files: [n_file].
      character(len=name_length), allocatable, intent(out) :: names(:)
      type(error_type), allocatable :: error
      character(len=:), allocatable :: text
      integer :: stop, blank

      command = ''
      subject = ''
      allocate (names(0))
      call read_text_file(path//'/'//identity, text, error)
      if (allocated(error)) return
      if (index(text, signature) /= 1) return
      text = text(len(signature) + 1:)
      do while (text /= '')
         stop = index(text//newline, newline)
         if (command == '') then
            blank = index(text(:stop - 1)//' ', ' ')
            command = text(:blank - 1)
            subject = text(min(blank + 1, stop):stop - 1)
         else
            names = [character(len=name_length) :: names, text(:stop - 1)]
         end if
         text = text(min(stop + 1, len(text) + 1):)
      end do
   end subroutine read_identity

   !> Makes the new directory beside the target.
   subroutine open_results(self, error)
      type(result_directory_type), intent(inout) :: self
      !> Set if the directory cannot be made.
      type(error_type), allocatable, intent(out) :: error
      integer :: status

      call make_beside(self%path, self%folder, status)
      if (status /= 0) error = unusable_error(self%path, status)
   end subroutine open_results

   !> Puts the new directory in the place of the target, or removes it after an error.
   subroutine close_results(self, error)
      type(result_directory_type), intent(inout) :: self
      !> Set if an earlier step failed, or the target may not be replaced; the target is unchanged then.
      type(error_type), allocatable, intent(inout) :: error
      character(len=name_length), allocatable :: names(:), listed(:)
      character(len=:), allocatable :: command, subject
      type(error_type), allocatable :: refusal
      integer :: status, i

      if (.not. allocated(self%folder)) return
      call end_file(self, error)
      call list_directory(self%folder, names)
      call begin_file(self, identity, error)
      call add_text(self, signature//trim(self%command//' '//self%subject)//newline, error)
      do i = 1, size(names)
         call add_text(self, trim(names(i))//newline, error)
      end do
      call end_file(self, error)
      do i = 1, max_checks
         if (allocated(error)) exit
         ! Another process may replace the target between two looks at it.
         call check_target(self, names, refusal)
         if (.not. allocated(refusal)) exit
         if (i == max_checks) call move_alloc(refusal, error)
      end do
      if (.not. allocated(error)) then
         call swap_directories(self%folder, self%path, status)
         if (status /= 0) error = unusable_error(self%path, status)
      end if
      ! The folder now holds the old results, or after an error the new ones.
      if (directory_exists(self%folder)) then
         call read_identity(self%folder, command, subject, listed)
         names = [character(len=name_length) :: names, listed, identity]
         do i = 1, size(names)
            call remove_file(self%folder//'/'//trim(names(i)))
         end do
         ! It stays if another program has written into it meanwhile.
         call remove_file(self%folder)
      end if
   end subroutine close_results

   !> Begins a file.
   subroutine begin_file(self, name, error)
      type(result_directory_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      !> Set if an earlier step or this one fails.
      type(error_type), allocatable, intent(inout) :: error
      integer :: status

      call end_file(self, error)
      if (allocated(error)) return
      self%name = name
      call create_file(self%folder//'/'//trim(name), self%file, status)
      call require_written(self, status, error)
   end subroutine begin_file

   !> Adds text to the current file.
   subroutine add_text(self, text, error)
      type(result_directory_type), intent(inout) :: self
      character(len=*), intent(in) :: text
      !> Set if an earlier step or this one fails.
      type(error_type), allocatable, intent(inout) :: error
      integer :: status

      if (allocated(error)) return
      call check_interrupt(error)
      call write_text(self%file, text, status)
      call require_written(self, status, error)
   end subroutine add_text

   !> Ends the current file.
   subroutine end_file(self, error)
      type(result_directory_type), intent(inout) :: self
      !> Set if an earlier step or this one fails.
      type(error_type), allocatable, intent(inout) :: error
      integer :: status

      if (self%file < 0) return
      status = close_file(self%file)
      self%file = -1
      call require_written(self, status, error)
   end subroutine end_file

   !> Writes a whole file.
   subroutine write_file(self, name, content, error)
      type(result_directory_type), intent(inout) :: self
      character(len=*), intent(in) :: name, content
      !> Set if an earlier step or this one fails.
      type(error_type), allocatable, intent(inout) :: error

      call begin_file(self, name, error)
      call add_text(self, content, error)
      call end_file(self, error)
   end subroutine write_file

   !> Returns an error if a file was not written.
   subroutine require_written(self, status, error)
      type(result_directory_type), intent(in) :: self
      !> 0, or the number of the system's error.
      integer, intent(in) :: status
      !> Set if an earlier step or this one fails.
      type(error_type), allocatable, intent(inout) :: error

      if (status == 0 .or. allocated(error)) return
      error = input_error(self%path//': '//trim(self%name)//' cannot be written ('//trim(get_system_message(status)) &
         //'); allowed: a directory that you may write to, with space on its disk')
   end subroutine require_written

   !> Error for a directory that cannot be made or replaced.
   function unusable_error(path, status) result(error)
      character(len=*), intent(in) :: path
      !> Number of the system's error.
      integer, intent(in) :: status
      type(error_type) :: error

      error = input_error(path//' cannot be used ('//trim(get_system_message(status))//'); allowed: a directory ' &
         //'in a folder that you may write to')
   end function unusable_error

end module thud_result_directory
