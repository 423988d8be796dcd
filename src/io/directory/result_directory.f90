!> Directories of results: a new set of files replaces the old one as a whole, or not at all.
!>
!> A process writes into a workspace `.<name>.part` beside the directory `<name>`, or inside the directory if the two
!> cannot be exchanged, as with the working directory or a mount. The lock on the workspace makes processes wait for each
!> other; files left there by a killed process are removed. The directory is locked only while it is checked and replaced.
!> The first line of the marker, a file of the set, identifies the case of the results.
module thud_result_directory
   use, intrinsic :: iso_fortran_env, only: int32
   use thud_error, only: error_type, input_error
   use thud_file, only: read_text_file, text_file_type
   use thud_file_set, only: add_entries, clear_workspace, entry_type, get_kept, is_listed, is_workspace, manifest, &
      new_entries, read_manifest, replace_set
   use thud_interrupt, only: check_interrupt
   use thud_system, only: add_to_checksum, can_exchange, close_descriptor, create_file, defer_interrupts, directory_exists, &
      flush_directory, get_system_message, is_missing, is_same_file, list_directory, lock_directory, &
      name_length, pass_interrupts, path_length, remove_file, rename_file, resolve_path, write_text
   use thud_text, only: newline
   implicit none (type, external)
   private

   public :: add_text, begin_file, check_owner, close_results, open_results, result_directory_type, write_results

   !> Name of a workspace inside the directory.
   character(len=*), parameter :: inner_workspace = '.thud.part'

   !> Results that a directory holds: none of this case, or those of this case with the same or with another input.
   integer, parameter :: no_owner = 0, same_input = 1, other_input = 2

   !> A directory while its results are written.
   type :: result_directory_type
      private
      !> Path as the user gives it, absolute path without links, and path of the workspace.
      character(len=:), allocatable :: path, target, workspace
      !> The file that identifies the case.
      type(text_file_type) :: marker
      !> Paths of the files that the results depend on: [n_input].
      character(len=path_length), allocatable :: inputs(:)
      !> Whether to replace even files that thud has not written.
      logical :: replace = .false.
      !> Names of all files of the set: [n_file].
      character(len=name_length), allocatable :: names(:)
      !> Checksums of their contents: [n_file].
      integer(int32), allocatable :: sums(:)
      !> Name of the file that is being written.
      character(len=name_length) :: name = ''
      !> Checksum of the text written to it so far.
      integer(int32) :: sum = 0_int32
      !> Descriptors of that file, of the lock on the workspace, and of the lock on the directory; negative if none.
      integer :: file = -1, workspace_lock = -1, lock = -1
      !> Whether the directory was missing and has been created.
      logical :: is_new = .false.
   end type result_directory_type

contains

   !> Returns an error if a directory holds anything except results of the same case.
   subroutine check_owner(path, marker, replace, has_other_input, error)
      character(len=*), intent(in) :: path
      !> The file that will identify the case.
      type(text_file_type), intent(in) :: marker
      !> Whether to accept a directory with any files.
      logical, intent(in) :: replace
      !> Whether the directory holds results of the same case with another input.
      logical, intent(out) :: has_other_input
      type(error_type), allocatable, intent(out) :: error
      integer :: owner

      call find_owner(path, marker, replace, owner, error)
      has_other_input = owner == other_input
   end subroutine check_owner

   !> Writes a set of files into a directory, completely or not at all.
   subroutine write_results(path, marker, files, inputs, replace, has_other_input, error)
      !> The directory, created if missing.
      character(len=*), intent(in) :: path
      !> The file that identifies the case.
      type(text_file_type), intent(in) :: marker
      !> The other files: [n_file].
      type(text_file_type), intent(in) :: files(:)
      !> Paths of the files that the results depend on, which are never replaced: [n_input].
      character(len=*), intent(in) :: inputs(:)
      !> Whether to replace even files that thud has not written.
      logical, intent(in) :: replace
      !> Whether the files replace results of the same case with another input.
      logical, intent(out) :: has_other_input
      !> Set if the files cannot be written; the directory is unchanged then.
      type(error_type), allocatable, intent(out) :: error
      type(result_directory_type) :: directory
      integer :: i

      call open_results(path, marker, files%name, inputs, replace, directory, error)
      do i = 1, size(files)
         call write_file(directory, files(i), error)
      end do
      call close_results(directory, has_other_input, error)
   end subroutine write_results

   !> Waits until no other process writes into a directory, and begins to write.
   subroutine open_results(path, marker, names, inputs, replace, directory, error)
      !> The directory, created if missing.
      character(len=*), intent(in) :: path
      !> The file that identifies the case.
      type(text_file_type), intent(in) :: marker
      !> Names of the other files: [n_file].
      character(len=*), intent(in) :: names(:)
      !> Paths of the files that the results depend on, which are never replaced: [n_input].
      character(len=*), intent(in) :: inputs(:)
      !> Whether to replace even files that thud has not written.
      logical, intent(in) :: replace
      !> The directory; to be closed even after an error.
      type(result_directory_type), intent(out) :: directory
      !> Set if the directory belongs to something else, or cannot be written.
      type(error_type), allocatable, intent(out) :: error
      type(entry_type) :: unwritten(size(names) + 1)
      integer :: owner

      directory%path = path
      directory%marker = marker
      allocate (directory%inputs(size(inputs)))
      directory%inputs = inputs
      directory%replace = replace
      directory%names = [character(len=name_length) :: names, marker%name]
      allocate (directory%sums(size(directory%names)), source=0_int32)
      call acquire_workspace(directory, error)
      if (.not. allocated(error)) call lock_target(directory, owner, error)
      call close_descriptor(directory%lock)
      if (allocated(error)) return
      call clear_workspace(directory%workspace, directory%target)
      unwritten%name = directory%names
      call add_entries(directory%workspace, unwritten, error)
   end subroutine open_results

   !> Ends the writing: afterwards all files are in the directory, or none.
   subroutine close_results(directory, has_other_input, error)
      type(result_directory_type), intent(inout) :: directory
      !> Whether the files replace results of the same case with another input.
      logical, intent(out) :: has_other_input
      !> Set if an earlier step or this one fails; the directory is unchanged then.
      type(error_type), allocatable, intent(inout) :: error
      logical :: moved

      has_other_input = .false.
      moved = .false.
      call end_file(directory, error)
      call write_file(directory, directory%marker, error)
      if (.not. allocated(error)) call publish(directory, has_other_input, moved, error)
      ! If the workspace has moved, a workspace of the same name belongs to another process.
      if (directory%workspace_lock >= 0 .and. .not. moved) then
         call clear_workspace(directory%workspace, directory%target)
         call remove_file(directory%workspace)
      end if
      if (directory%is_new .and. allocated(error)) call remove_file(directory%target)
      call close_descriptor(directory%lock)
      call close_descriptor(directory%workspace_lock)
      call pass_interrupts(merge(0, 1, allocated(error)))
   end subroutine close_results

   !> Begins a file.
   subroutine begin_file(directory, name, error)
      type(result_directory_type), intent(inout) :: directory
      !> Name of the file, one of the set.
      character(len=*), intent(in) :: name
      !> Set if an earlier step or this one fails.
      type(error_type), allocatable, intent(inout) :: error
      integer :: status

      call end_file(directory, error)
      if (allocated(error)) return
      directory%name = name
      directory%sum = 0_int32
      call create_file(directory%workspace//'/'//trim(name), directory%file, status)
      call require_written(directory, status, error)
   end subroutine begin_file

   !> Adds text to the current file.
   subroutine add_text(directory, text, error)
      type(result_directory_type), intent(inout) :: directory
      character(len=*), intent(in) :: text
      !> Set if an earlier step or this one fails.
      type(error_type), allocatable, intent(inout) :: error
      integer :: status

      if (allocated(error)) return
      call add_to_checksum(text, directory%sum)
      call write_text(directory%file, text, status)
      call require_written(directory, status, error)
   end subroutine add_text

   !> Ends the current file.
   subroutine end_file(directory, error)
      type(result_directory_type), intent(inout) :: directory
      !> Set if an earlier step or this one fails.
      type(error_type), allocatable, intent(inout) :: error
      integer :: status

      if (directory%file < 0) return
      where (directory%names == directory%name) directory%sums = directory%sum
      call close_descriptor(directory%file, status)
      call require_written(directory, status, error)
   end subroutine end_file

   !> Writes a whole file.
   subroutine write_file(directory, file, error)
      type(result_directory_type), intent(inout) :: directory
      type(text_file_type), intent(in) :: file
      !> Set if an earlier step or this one fails.
      type(error_type), allocatable, intent(inout) :: error

      if (allocated(error)) return
      call begin_file(directory, file%name, error)
      call add_text(directory, file%content, error)
      call end_file(directory, error)
   end subroutine write_file

   !> Returns an error if a file was not written.
   subroutine require_written(directory, status, error)
      type(result_directory_type), intent(in) :: directory
      !> 0, the number of the system's error, or negative after an interrupt.
      integer, intent(in) :: status
      !> Set if an earlier step or this one fails.
      type(error_type), allocatable, intent(inout) :: error

      if (status == 0 .or. allocated(error)) return
      if (status < 0) then
         call check_interrupt(error)
      else
         error = input_error('--output '//directory%path//': '//trim(directory%name)//' cannot be written (' &
            //get_system_message(status)//'); allowed: a directory that you may write to, with space on its disk')
      end if
   end subroutine require_written

   !> Finds whose results a directory holds.
   subroutine find_owner(path, marker, replace, owner, error)
      character(len=*), intent(in) :: path
      !> The file that will identify the case.
      type(text_file_type), intent(in) :: marker
      !> Whether to accept a directory with any files.
      logical, intent(in) :: replace
      !> `no_owner`, `same_input` or `other_input`.
      integer, intent(out) :: owner
      !> Set if the directory belongs to something else, or is not a directory.
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: unreadable
      type(entry_type), allocatable :: entries(:)
      character(len=name_length), allocatable :: names(:)
      character(len=:), allocatable :: text
      logical :: exists, is_manifest

      owner = no_owner
      if (.not. directory_exists(path)) then
         inquire (file=path, exist=exists)
         if (exists) error = unusable_error(path)
         return
      end if
      call list_directory(path, names)
      if (all(names == inner_workspace)) return
      call read_manifest(path, entries, is_manifest)
      if (directory_exists(path//'/'//manifest) .or. .not. (is_manifest .or. replace)) then
         error = foreign_error(path, manifest)
      else if (is_listed(path, marker%name, entries)) then
         call read_text_file(path//'/'//trim(marker%name), text, unreadable)
         if (allocated(unreadable)) text = ''
         if (index(text, marker%content(:index(marker%content, newline))) == 1) owner = merge(same_input, other_input, &
            text == marker%content)
      else if (any(names == marker%name)) then
         if (.not. replace) error = foreign_error(path, marker%name)
      else if (any(entries%name == marker%name)) then
         ! A process killed while it moved files one by one has left a manifest without the marker.
         return
      end if
      if (owner /= no_owner .or. allocated(error) .or. replace) return
      error = input_error('--output '//path//' holds files of something else; allowed: a new or empty directory, ' &
         //'results of the same case, or --replace')
   end subroutine find_owner

   !> Returns an error if the set would replace inputs, directories, or files that thud has not written.
   subroutine check_files(directory, error)
      type(result_directory_type), intent(in) :: directory
      type(error_type), allocatable, intent(out) :: error
      type(entry_type), allocatable :: entries(:)
      character(len=:), allocatable :: path
      logical :: is_manifest
      integer :: i

      call check_input(directory, manifest, error)
      if (allocated(error)) return
      call read_manifest(directory%target, entries, is_manifest)
      do i = 1, size(directory%names)
         path = directory%target//'/'//trim(directory%names(i))
         if (is_missing(path)) cycle
         call check_input(directory, directory%names(i), error)
         if (allocated(error)) return
         if (.not. directory_exists(path)) then
            if (directory%replace .or. is_listed(directory%target, directory%names(i), entries)) cycle
         end if
         error = foreign_error(directory%path, directory%names(i))
         return
      end do
   end subroutine check_files

   !> Returns an error if a file would replace an input.
   subroutine check_input(directory, name, error)
      type(result_directory_type), intent(in) :: directory
      !> Name of a file to write.
      character(len=*), intent(in) :: name
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: path, text
      integer :: i

      path = directory%target//'/'//trim(name)
      do i = 1, size(directory%inputs)
         if (.not. is_same_file(path, trim(directory%inputs(i)))) cycle
         ! A run from the marker itself may replace the marker by the same text.
         if (name == directory%marker%name) call read_text_file(path, text, error)
         if (allocated(text)) then
            if (text == directory%marker%content) cycle
         end if
         error = input_error(directory%path//'/'//trim(name)//' is an input, which is never replaced; allowed: another ' &
            //'directory')
         return
      end do
   end subroutine check_input

   !> Error for a file that thud has not written.
   function foreign_error(path, name) result(error)
      !> Path of its directory.
      character(len=*), intent(in) :: path
      character(len=*), intent(in) :: name
      type(error_type) :: error

      if (directory_exists(path//'/'//trim(name))) then
         error = input_error(path//'/'//trim(name)//' is a directory of something else; allowed: another directory')
      else
         error = input_error(path//'/'//trim(name)//' is in the way: thud has not written it, or it has changed since; ' &
            //'allowed: another directory, or --replace (replace=True) to replace it')
      end if
   end function foreign_error

   !> Creates and locks the workspace of a directory, and defers interrupts.
   subroutine acquire_workspace(directory, error)
      type(result_directory_type), intent(inout) :: directory
      !> Set if the workspace cannot be created.
      type(error_type), allocatable, intent(out) :: error
      character(len=name_length), allocatable :: names(:)
      integer :: slash, target_lock
      logical :: done

      call defer_interrupts()
      call resolve_path(directory%path, directory%target, done)
      if (done) then
         slash = index(directory%target, '/', back=.true.)
         directory%workspace = directory%target(:slash)//'.'//directory%target(slash + 1:)//'.part'
         call lock_directory(directory%workspace, .true., directory%workspace_lock)
         if (directory%workspace_lock >= 0) then
            done = can_exchange(directory%workspace, directory%target)
            if (.not. done) call remove_file(directory%workspace)
            if (.not. done) call close_descriptor(directory%workspace_lock)
         end if
         call check_interrupt(error)
         if (allocated(error)) return
         if (directory%workspace_lock < 0) then
            directory%is_new = .not. directory_exists(directory%target)
            call lock_directory(directory%target, .true., target_lock)
            call close_descriptor(target_lock)
            directory%workspace = directory%target//'/'//inner_workspace
            call lock_directory(directory%workspace, .true., directory%workspace_lock)
         end if
      end if
      call check_interrupt(error)
      if (directory%workspace_lock < 0 .and. .not. allocated(error)) error = unusable_error(directory%path)
      if (allocated(error)) return
      call list_directory(directory%workspace, names)
      if (is_workspace(names)) return
      error = input_error('--output '//directory%path//': '//directory%workspace//' is in the way; allowed: another ' &
         //'directory, or remove it first')
      call close_descriptor(directory%workspace_lock)
   end subroutine acquire_workspace

   !> Locks an existing directory, and finds its owner.
   subroutine lock_target(directory, owner, error)
      type(result_directory_type), intent(inout) :: directory
      !> `no_owner`, `same_input` or `other_input`.
      integer, intent(out) :: owner
      !> Set if the directory belongs to something else, or cannot be written.
      type(error_type), allocatable, intent(out) :: error

      call lock_directory(directory%target, .false., directory%lock)
      call find_owner(directory%path, directory%marker, directory%replace, owner, error)
      if (.not. allocated(error)) call check_files(directory, error)
      if (directory%lock < 0) call check_interrupt(error)
      if (allocated(error) .or. directory%lock >= 0) return
      if (directory_exists(directory%target)) error = unusable_error(directory%path)
   end subroutine lock_target

   !> Replaces the files of the directory by those of the workspace.
   subroutine publish(directory, has_other_input, moved, error)
      type(result_directory_type), intent(inout) :: directory
      !> Whether the files replace results of the same case with another input.
      logical, intent(out) :: has_other_input
      !> Whether the workspace itself has become the directory.
      logical, intent(out) :: moved
      !> Set if the directory now belongs to something else, or its files cannot be replaced.
      type(error_type), allocatable, intent(out) :: error
      type(entry_type), allocatable :: kept(:)
      type(entry_type) :: entries(size(directory%names))
      character(len=name_length), allocatable :: gone(:)
      integer :: owner, status

      moved = .false.
      call lock_target(directory, owner, error)
      has_other_input = owner == other_input
      if (allocated(error)) return
      entries = new_entries(directory%names, directory%sums)
      call get_kept(directory%target, directory%names, owner == same_input, kept, gone)
      call add_entries(directory%workspace, [entries, kept], error)
      if (allocated(error)) return
      call flush_directory(directory%workspace, status)
      call require_written(directory, status, error)
      if (allocated(error)) return
      if (directory%lock < 0) then
         call rename_file(directory%workspace, directory%target, moved)
         if (.not. moved) error = unusable_error(directory%path)
      else
         call replace_set(directory%workspace, directory%target, entries, gone, &
            directory%workspace /= directory%target//'/'//inner_workspace, error)
      end if
   end subroutine publish

   !> Error for a directory that cannot be created or written.
   pure function unusable_error(path) result(error)
      character(len=*), intent(in) :: path
      type(error_type) :: error

      error = input_error('--output '//path//' cannot be used; allowed: a directory that you may write to')
   end function unusable_error

end module thud_result_directory
