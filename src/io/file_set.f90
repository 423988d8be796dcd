!> Sets of files: which files of a directory belong together, and how another set replaces them.
!>
!> A manifest lists the files of the set, those that a run has written with the checksum of their content; all others in
!> the directory are the user's and stay. A workspace is a directory with the next set and its manifest.
module thud_file_set
   use, intrinsic :: iso_fortran_env, only: int32
   use thud_error, only: error_type, input_error
   use thud_interrupt, only: check_interrupt
   use thud_system, only: close_descriptor, exchange_directories, get_system_message, link_file, list_directory, &
      name_length, open_end, remove_file, rename_file, write_text
   use thud_text, only: newline
   implicit none (type, external)
   private

   public :: add_names, clear_workspace, get_kept, is_workspace, read_names, replace_set

   !> Name of the manifest.
   character(len=*), parameter :: manifest = '.thud'

   !> Before the name of a file that is set aside in the workspace.
   character(len=*), parameter :: aside = manifest//'~'

   !> Between a name and its checksum.
   character(len=*), parameter :: tab = achar(9)

contains

   !> Whether the names in a directory are those of a workspace.
   pure function is_workspace(names) result(yes)
      !> The names: [n_name].
      character(len=*), intent(in) :: names(:)
      !> They are, or there are none.
      logical :: yes

      yes = size(names) == 0 .or. any(index(names, manifest) == 1)
   end function is_workspace

   !> Names of the files of a directory that stay beside the next set: figures of the same input.
   subroutine get_kept(place, names, same, kept)
      !> The directory, under its lock.
      character(len=*), intent(in) :: place
      !> Names of the next set: [n_file].
      character(len=*), intent(in) :: names(:)
      !> It is of the same input.
      logical, intent(in) :: same
      !> The names: [n_kept].
      character(len=name_length), allocatable, intent(out) :: kept(:)
      character(len=name_length), allocatable :: found(:), listed(:)
      integer :: i

      call read_names(place, listed)
      call list_directory(place, found)
      kept = pack(listed, [(same .and. any(found == listed(i)) .and. .not. any(names == listed(i)), i=1, size(listed))])
   end subroutine get_kept

   !> Puts the set of a workspace in the place of the one before.
   subroutine replace_set(workspace, place, names, kept, exchangeable, error)
      !> The workspace; its remaining files are to be cleared.
      character(len=*), intent(in) :: workspace
      !> The directory, under its lock.
      character(len=*), intent(in) :: place
      !> Names of the files, the last of which says whose they are: [n_file].
      character(len=*), intent(in) :: names(:)
      !> Names of files that stay beside them: [n_kept].
      character(len=*), intent(in) :: kept(:)
      !> The two directories may be exchanged.
      logical, intent(in) :: exchangeable
      !> A file cannot be written or moved; the directory is as it was.
      type(error_type), allocatable, intent(out) :: error
      character(len=name_length), allocatable :: listed(:), replaced(:)
      integer :: i
      logical :: done

      call read_names(place, listed)
      replaced = [character(len=name_length) :: names, pack(listed, [(.not. any(kept == listed(i)), i=1, size(listed))])]
      done = exchangeable
      if (done) call exchange(workspace, place, replaced, names, done)
      if (.not. done) call move_files(workspace, place, replaced, names, error)
   end subroutine replace_set

   !> Exchanges workspace and directory; nothing has changed where that is impossible.
   subroutine exchange(workspace, place, replaced, names, done)
      character(len=*), intent(in) :: workspace, place
      !> Names of files that are not carried over: [n_replaced].
      character(len=*), intent(in) :: replaced(:)
      !> Names of the new files: [n_file].
      character(len=*), intent(in) :: names(:)
      !> They are exchanged.
      logical, intent(out) :: done
      character(len=name_length), allocatable :: found(:), left(:)
      type(error_type), allocatable :: error
      logical :: changed
      integer :: i

      done = .true.
      call list_directory(place, found)
      do i = 1, size(found)
         if (found(i) == manifest .or. any(replaced == found(i))) cycle
         call link_file(place//'/'//trim(found(i)), workspace//'/'//trim(found(i)), done)
         if (.not. done) return
      end do
      ! Without a manifest the old files would count as the user's.
      if (.not. any(found == manifest)) call add_names(place, names, error)
      done = .not. allocated(error)
      if (done) call exchange_directories(workspace, place, done)
      if (.not. done) return
      ! The user may have changed files meanwhile; those that are the same are left alone.
      call list_directory(workspace, left)
      do i = 1, size(left)
         if (left(i) == manifest .or. any(replaced == left(i))) cycle
         call rename_file(workspace//'/'//trim(left(i)), place//'/'//trim(left(i)), changed)
      end do
   end subroutine exchange

   !> Moves files one by one: those before are set aside in the workspace, so that two inputs are never mixed.
   subroutine move_files(workspace, place, replaced, names, error)
      character(len=*), intent(in) :: workspace, place
      !> Names that the files before may have: [n_replaced].
      character(len=*), intent(in) :: replaced(:)
      !> Names of the new files, the last of which says whose they are: [n_file].
      character(len=*), intent(in) :: names(:)
      !> A file cannot be moved; the directory is as it was.
      type(error_type), allocatable, intent(out) :: error
      character(len=name_length), allocatable :: found(:)
      character(len=name_length) :: marker
      integer :: n, i
      logical :: done

      marker = names(size(names))
      call list_directory(place, found)
      found = [pack(found, found == marker), pack(found, [(found(i) /= marker .and. any(replaced == found(i)), &
         i=1, size(found))])]
      ! A writer killed from here on leaves files that are listed, but no marker.
      call add_names(place, names, error)
      if (allocated(error)) return
      n = size(found)
      block
         character(len=len(workspace) + name_length + 8), dimension(n + size(names)) :: from, to

         do i = 1, n
            from(i) = place//'/'//found(i)
            to(i) = workspace//'/'//aside//found(i)
         end do
         do i = 1, size(names)
            from(n + i) = workspace//'/'//names(i)
            to(n + i) = place//'/'//names(i)
         end do
         do i = 1, size(from)
            call rename_file(trim(from(i)), trim(to(i)), done)
            if (.not. done) exit
         end do
         if (done) call rename_file(workspace//'/'//manifest, place//'/'//manifest, done)
         if (done) return
         error = input_error('--output '//place//': files cannot be replaced; allowed: a directory that you may write to')
         do i = i - 1, 1, -1
            call rename_file(trim(to(i)), trim(from(i)), done)
         end do
      end block
   end subroutine move_files

   !> Empties a workspace. Files that its manifest does not list are the user's, left by a writer that was killed.
   subroutine clear_workspace(workspace, place)
      !> The workspace, under its lock; the directory.
      character(len=*), intent(in) :: workspace, place
      character(len=name_length), allocatable :: found(:), listed(:)
      logical :: done
      integer :: i

      call read_names(workspace, listed)
      call list_directory(workspace, found)
      do i = 1, size(found)
         if (found(i) == manifest) cycle
         if (.not. any([listed == found(i), index(found(i), aside) == 1])) then
            call link_file(workspace//'/'//trim(found(i)), place//'/'//trim(found(i)), done)
         end if
         call remove_file(workspace//'/'//trim(found(i)))
      end do
      ! The manifest tells the next writer what it may remove.
      call list_directory(workspace, found)
      if (all(found == manifest)) call remove_file(workspace//'/'//manifest)
   end subroutine clear_workspace

   !> Names in the manifest of a directory.
   subroutine read_names(path, names)
      character(len=*), intent(in) :: path
      !> The names, none without a manifest: [n_name].
      character(len=name_length), allocatable, intent(out) :: names(:)
      character(len=name_length + 16) :: line
      character(len=256) :: message
      integer :: unit, status, n

      allocate (names(64))
      n = 0
      open (newunit=unit, file=path//'/'//manifest, status='old', action='read', iostat=status, iomsg=message)
      if (status == 0) then
         do
            read (unit, '(a)', iostat=status, iomsg=message) line
            if (status /= 0) exit
            if (n == size(names)) names = [names, names]
            n = n + 1
            names(n) = line(:index(line//tab, tab) - 1)
         end do
         close (unit)
      end if
      names = names(:n)
   end subroutine read_names

   !> Adds names to the manifest of a directory; the last checksum of a name holds.
   subroutine add_names(path, names, error, sums)
      character(len=*), intent(in) :: path
      !> The names: [n_name].
      character(len=*), intent(in) :: names(:)
      !> They cannot be written.
      type(error_type), allocatable, intent(out) :: error
      !> Checksums of the contents (default: not known): [n_name].
      integer(int32), intent(in), optional :: sums(:)
      character(len=:), allocatable :: text
      character(len=8) :: digits
      integer :: descriptor, status, closed, i

      text = ''
      do i = 1, size(names)
         text = text//trim(names(i))
         if (present(sums)) then
            write (digits, '(z8.8)') sums(i)
            text = text//tab//digits
         end if
         text = text//newline
      end do
      call open_end(path//'/'//manifest, descriptor, status)
      if (status == 0) call write_text(descriptor, text, status)
      call close_descriptor(descriptor, closed)
      if (status == 0) status = closed
      if (status < 0) call check_interrupt(error)
      if (status > 0) error = input_error('--output '//path//': '//manifest//' cannot be written (' &
         //get_system_message(status)//'); allowed: a directory that you may write to, with space on its disk')
   end subroutine add_names

end module thud_file_set
