!> Sets of files: which files of a directory belong together, and how a new set replaces them.
!>
!> A manifest lists the files that thud has written, each with the checksum of its content and, if the file does not belong
!> to the set, the command that wrote it. All other files, and listed files that have changed since, are the user's and
!> stay. A workspace is a directory with the new set and its manifest.
module thud_file_set
   use, intrinsic :: iso_fortran_env, only: int32, int64
   use thud_error, only: error_type, input_error
   use thud_interrupt, only: check_interrupt
   use thud_system, only: close_descriptor, exchange_directories, get_file_checksum, get_file_size, get_system_message, &
      is_missing, is_regular_file, link_file, list_directory, name_length, open_end, remove_file, rename_file, write_text
   use thud_text, only: newline, tab
   implicit none (type, external)
   private

   public :: add_entries, clear_workspace, entry_type, get_kept, is_listed, is_workspace, manifest, new_entries
   public :: read_manifest, replace_set

   !> Name and first line of the manifest.
   character(len=*), parameter :: manifest = '.thud'
   character(len=*), parameter :: head = '# files that thud has written, with checksums (CRC-32)'

   !> Name of a file while the driver writes it. If the file system has no locks, a period and the name of the writer follow.
   character(len=*), parameter :: temporary = manifest//'.new'

   !> Prefix of the names of old files that are set aside in the workspace.
   character(len=*), parameter :: aside = manifest//'~'

   !> A line of a manifest: name, checksum and command, separated by tabs.
   type :: entry_type
      !> Name of the file.
      character(len=name_length) :: name = ''
      !> Checksum of the content, hexadecimal; blank before the file is written.
      character(len=8) :: sum = ''
      !> The command that has written the file; blank for results of a case and their figures.
      character(len=32) :: command = ''
   end type entry_type

contains

   !> Whether a directory is a workspace: it is empty, or holds a file whose name begins with `manifest`.
   pure function is_workspace(names) result(yes)
      !> Names in the directory: [n_name].
      character(len=*), intent(in) :: names(:)
      logical :: yes

      yes = size(names) == 0 .or. any(index(names, manifest) == 1)
   end function is_workspace

   !> Manifest entries of files: [n_file].
   pure function new_entries(names, sums) result(entries)
      !> The names: [n_file].
      character(len=*), intent(in) :: names(:)
      !> Checksums of their contents: [n_file].
      integer(int32), intent(in) :: sums(:)
      type(entry_type) :: entries(size(names))
      integer :: i

      do i = 1, size(names)
         entries(i)%name = names(i)
         write (entries(i)%sum, '(z8.8)') sums(i)
      end do
   end function new_entries

   !> Whether a file is one that the driver has not finished.
   elemental function is_temporary(name) result(yes)
      character(len=*), intent(in) :: name
      logical :: yes

      yes = name == temporary .or. index(name, temporary//'.') == 1
   end function is_temporary

   !> Whether a manifest lists a file that has not changed since.
   function is_listed(target, name, entries) result(yes)
      !> The directory.
      character(len=*), intent(in) :: target
      character(len=*), intent(in) :: name
      !> The manifest: [n_entry].
      type(entry_type), intent(in) :: entries(:)
      logical :: yes
      integer(int64) :: checksum
      character(len=8) :: digits

      yes = any(entries%name == name)
      if (.not. yes) return
      call get_file_checksum(target//'/'//trim(name), checksum)
      write (digits, '(z8.8)') checksum
      yes = checksum >= 0 .and. any(entries%name == name .and. entries%sum == digits)
   end function is_listed

   !> Finds the listed and unchanged old files that are not in the new set: results of other commands and figures of the
   !> same input stay, the others go.
   subroutine get_kept(target, names, same, kept, gone)
      !> The directory, under its lock.
      character(len=*), intent(in) :: target
      !> Names in the new set: [n_file].
      character(len=*), intent(in) :: names(:)
      !> Whether the old set has the same input.
      logical, intent(in) :: same
      !> Manifest entries of the files that stay: [n_kept].
      type(entry_type), allocatable, intent(out) :: kept(:)
      !> Names of the files that go: [n_gone].
      character(len=name_length), allocatable, intent(out) :: gone(:)
      type(entry_type), allocatable :: entries(:)
      logical, allocatable :: stays(:)
      logical :: is_manifest
      integer :: i

      call read_manifest(target, entries, is_manifest)
      entries = pack(entries, [(.not. any(names == entries(i)%name) .and. is_listed(target, entries(i)%name, entries), &
         i=1, size(entries))])
      stays = same .or. entries%command /= ''
      kept = pack(entries, stays)
      gone = pack(entries%name, .not. stays)
   end subroutine get_kept

   !> Replaces the set of a directory by the set in a workspace.
   subroutine replace_set(workspace, target, entries, gone, exchangeable, error)
      !> The workspace; the caller has to clear it afterwards.
      character(len=*), intent(in) :: workspace
      !> The directory, under its lock.
      character(len=*), intent(in) :: target
      !> The new files; the last one is the marker, which identifies the case: [n_file].
      type(entry_type), intent(in) :: entries(:)
      !> Names of other old files to remove: [n_gone].
      character(len=*), intent(in) :: gone(:)
      !> Whether the two directories may be exchanged.
      logical, intent(in) :: exchangeable
      !> Set if a file cannot be written or moved; the directory is unchanged then.
      type(error_type), allocatable, intent(out) :: error
      character(len=name_length) :: replaced(size(entries) + size(gone))
      logical :: done

      replaced = [character(len=name_length) :: entries%name, gone]
      done = exchangeable
      if (done) call exchange(workspace, target, replaced, done)
      if (.not. done) call move_files(workspace, target, replaced, entries, error)
   end subroutine replace_set

   !> Exchanges workspace and directory; changes nothing if that is impossible.
   subroutine exchange(workspace, target, replaced, done)
      character(len=*), intent(in) :: workspace, target
      !> Names of old files that are not carried over: [n_replaced].
      character(len=*), intent(in) :: replaced(:)
      !> Whether the directories have been exchanged.
      logical, intent(out) :: done
      character(len=name_length), allocatable :: names(:)
      logical :: changed
      integer :: i

      done = .true.
      call list_directory(target, names)
      do i = 1, size(names)
         if (is_temporary(names(i)) .or. any(names(i) == [character(len=name_length) :: manifest, replaced])) cycle
         call link_file(target//'/'//trim(names(i)), workspace//'/'//trim(names(i)), done)
         if (.not. done) return
      end do
      call exchange_directories(workspace, target, done)
      if (.not. done) return
      ! Move files that the user has replaced after they were linked. All others are links to the same file in both
      ! directories, for which renaming does nothing.
      call list_directory(workspace, names)
      do i = 1, size(names)
         if (is_temporary(names(i)) .or. any(names(i) == [character(len=name_length) :: manifest, replaced])) cycle
         call rename_file(workspace//'/'//trim(names(i)), target//'/'//trim(names(i)), changed)
      end do
   end subroutine exchange

   !> Moves files one by one. Old files are first set aside in the workspace, so that results of two inputs never mix.
   subroutine move_files(workspace, target, replaced, entries, error)
      character(len=*), intent(in) :: workspace, target
      !> Names of old files to replace or remove: [n_replaced].
      character(len=*), intent(in) :: replaced(:)
      !> The new files; the last one is the marker, which identifies the case: [n_file].
      type(entry_type), intent(in) :: entries(:)
      !> Set if a file cannot be moved; the directory is unchanged then.
      type(error_type), allocatable, intent(out) :: error
      type(entry_type), allocatable :: listed(:)
      character(len=name_length), allocatable :: old_names(:)
      character(len=name_length) :: marker
      integer :: n, i
      logical :: done, is_manifest

      marker = entries(size(entries))%name
      call list_directory(target, old_names)
      call read_manifest(target, listed, is_manifest)
      old_names = [pack(old_names, old_names == marker), pack(old_names, [(old_names(i) /= marker &
         .and. any(replaced == old_names(i)), i=1, size(old_names))])]
      ! If the process is killed from here on, the directory holds listed files but no marker.
      if (is_manifest) call add_entries(target, entries, error)
      if (allocated(error)) return
      n = size(old_names)
      block
         character(len=len(workspace) + name_length + 8), dimension(n + size(entries)) :: from, to

         do i = 1, n
            from(i) = target//'/'//old_names(i)
            to(i) = workspace//'/'//aside//old_names(i)
         end do
         do i = 1, size(entries)
            from(n + i) = workspace//'/'//entries(i)%name
            to(n + i) = target//'/'//entries(i)%name
         end do
         do i = 1, size(from)
            call rename_file(trim(from(i)), trim(to(i)), done)
            if (.not. done) exit
         end do
         if (done) call rename_file(workspace//'/'//manifest, target//'/'//manifest, done)
         if (done) return
         error = input_error('--output '//target//': files cannot be replaced; allowed: a directory that you may write to')
         do i = i - 1, 1, -1
            call rename_file(trim(to(i)), trim(from(i)), done)
         end do
      end block
   end subroutine move_files

   !> Empties a workspace. Files that its manifest does not list are the user's and return to the directory; a killed
   !> process has left them.
   subroutine clear_workspace(workspace, target)
      !> The workspace, under its lock; the directory.
      character(len=*), intent(in) :: workspace, target
      character(len=name_length), allocatable :: names(:)
      type(entry_type), allocatable :: listed(:)
      logical :: done, is_manifest
      integer :: i

      call read_manifest(workspace, listed, is_manifest)
      call list_directory(workspace, names)
      do i = 1, size(names)
         if (names(i) == manifest) cycle
         if (.not. any([listed%name == names(i), index(names(i), aside) == 1, is_temporary(names(i))])) then
            call link_file(workspace//'/'//trim(names(i)), target//'/'//trim(names(i)), done)
         end if
         call remove_file(workspace//'/'//trim(names(i)))
      end do
      ! Remove the manifest last: it lists the files that the next process may remove.
      call list_directory(workspace, names)
      if (all(names == manifest)) call remove_file(workspace//'/'//manifest)
   end subroutine clear_workspace

   !> The manifest of a directory.
   subroutine read_manifest(path, entries, is_manifest)
      character(len=*), intent(in) :: path
      !> Entries; none without a manifest: [n_entry].
      type(entry_type), allocatable, intent(out) :: entries(:)
      !> False if the name of the manifest belongs to something else; true if nothing has this name.
      logical, intent(out) :: is_manifest
      character(len=name_length + 64) :: line
      character(len=256) :: message
      integer :: unit, status, n, i

      allocate (entries(64))
      n = 0
      is_manifest = is_missing(path//'/'//manifest)
      status = -1
      if (is_regular_file(path//'/'//manifest)) open (newunit=unit, file=path//'/'//manifest, status='old', action='read', &
         iostat=status, iomsg=message)
      if (status == 0) then
         read (unit, '(a)', iostat=status, iomsg=message) line
         is_manifest = status == 0 .and. line == head
         do while (is_manifest)
            read (unit, '(a)', iostat=status, iomsg=message) line
            if (status /= 0) exit
            if (n == size(entries)) entries = [entries, entries]
            n = n + 1
            i = index(line//tab, tab)
            entries(n) = entry_type(name=line(:i - 1))
            line = line(i + 1:)
            i = index(line//tab, tab)
            entries(n)%sum = line(:i - 1)
            entries(n)%command = line(i + 1:)
         end do
         close (unit)
      end if
      entries = entries(:n)
   end subroutine read_manifest

   !> Adds entries to the manifest of a directory.
   subroutine add_entries(path, entries, error)
      character(len=*), intent(in) :: path
      !> The entries: [n_entry].
      type(entry_type), intent(in) :: entries(:)
      !> Set if they cannot be written.
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: text
      integer(int64) :: bytes
      integer :: descriptor, status, closed, i

      text = ''
      call get_file_size(path//'/'//manifest, bytes)
      if (bytes <= 0) text = head//newline
      do i = 1, size(entries)
         text = text//trim(entries(i)%name)
         if (entries(i)%sum /= '') text = text//tab//entries(i)%sum
         if (entries(i)%command /= '') text = text//tab//trim(entries(i)%command)
         text = text//newline
      end do
      call open_end(path//'/'//manifest, descriptor, status)
      if (status == 0) call write_text(descriptor, text, status)
      call close_descriptor(descriptor, closed)
      if (status == 0) status = closed
      if (status < 0) call check_interrupt(error)
      if (status > 0) error = input_error('--output '//path//': '//manifest//' cannot be written (' &
         //get_system_message(status)//'); allowed: a directory that you may write to, with space on its disk')
   end subroutine add_entries

end module thud_file_set
