!> Sets of files: which files of a directory belong together, and how another set replaces them.
!>
!> A manifest lists the files of the set; all others in the directory are the user's and stay. A workspace is a directory
!> with the next set and its manifest.
module thud_file_set
   use thud_error, only: error_type, input_error
   use thud_system, only: exchange_directories, link_file, list_directory, name_length, remove_file, rename_file
   implicit none (type, external)
   private

   public :: add_names, clear_workspace, manifest, read_names, replace_set

   !> Name of the manifest.
   character(len=*), parameter :: manifest = '.thud'

contains

   !> Puts the set of a workspace in the place of the one before.
   subroutine replace_set(workspace, place, names, same, exchangeable, error)
      !> The workspace; its remaining files are to be cleared.
      character(len=*), intent(in) :: workspace
      !> The directory, under its lock.
      character(len=*), intent(in) :: place
      !> Names of the files, the last of which says whose they are: [n_file].
      character(len=*), intent(in) :: names(:)
      !> The one before is of the same input, which figures of it still show.
      logical, intent(in) :: same
      !> The two directories may be exchanged.
      logical, intent(in) :: exchangeable
      !> A file cannot be written or moved.
      type(error_type), allocatable, intent(out) :: error
      character(len=name_length), allocatable :: found(:), listed(:), kept(:)
      integer :: i
      logical :: done

      call read_names(place, listed)
      call list_directory(place, found)
      kept = pack(listed, [(same .and. any(found == listed(i)) .and. .not. any(names == listed(i)), i=1, size(listed))])
      call add_names(workspace, kept, error)
      if (allocated(error)) return
      done = exchangeable
      if (done) call exchange(workspace, place, found, [character(len=name_length) :: names, &
         pack(listed, [(.not. any(kept == listed(i)), i=1, size(listed))])], names, done)
      if (.not. done) call move_files(workspace, place, names, listed, same, error)
   end subroutine replace_set

   !> Exchanges workspace and directory; nothing has changed where that is impossible.
   subroutine exchange(workspace, place, found, replaced, names, done)
      character(len=*), intent(in) :: workspace, place
      !> Names in it: [n_found].
      character(len=*), intent(in) :: found(:)
      !> Names of files that are not carried over: [n_replaced].
      character(len=*), intent(in) :: replaced(:)
      !> Names of the new files: [n_file].
      character(len=*), intent(in) :: names(:)
      !> They are exchanged.
      logical, intent(out) :: done
      character(len=name_length), allocatable :: left(:)
      type(error_type), allocatable :: error
      logical :: changed
      integer :: i

      done = .true.
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

   !> Moves the files of the workspace into the directory, so that those of two inputs are never mixed.
   subroutine move_files(workspace, place, names, listed, same, error)
      character(len=*), intent(in) :: workspace, place
      !> Names of the files, the last of which says whose they are: [n_file].
      character(len=*), intent(in) :: names(:)
      !> Names of the files before: [n_listed].
      character(len=*), intent(in) :: listed(:)
      !> They are of the same input.
      logical, intent(in) :: same
      !> A file cannot be moved.
      type(error_type), allocatable, intent(out) :: error
      character(len=name_length), allocatable :: order(:)
      integer :: i
      logical :: done

      ! A writer killed from here on leaves files that are listed, but no marker.
      call add_names(place, names, error)
      if (allocated(error)) return
      allocate (order, source=[character(len=name_length) :: names(size(names)), listed, names])
      do i = 1, merge(0, size(order), same)
         call remove_file(place//'/'//trim(order(i)))
      end do
      deallocate (order)
      allocate (order, source=[character(len=name_length) :: names, manifest])
      do i = 1, size(order)
         call rename_file(workspace//'/'//trim(order(i)), place//'/'//trim(order(i)), done)
         if (done) cycle
         error = input_error('--output '//place//': '//trim(order(i))//' cannot be replaced; allowed: a directory ' &
            //'that you may write to')
         return
      end do
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
         if (.not. any(listed == found(i))) call link_file(workspace//'/'//trim(found(i)), place//'/'//trim(found(i)), done)
         call remove_file(workspace//'/'//trim(found(i)))
      end do
      call remove_file(workspace//'/'//manifest)
   end subroutine clear_workspace

   !> Names in the manifest of a directory.
   subroutine read_names(path, names)
      character(len=*), intent(in) :: path
      !> The names, none without a manifest: [n_name].
      character(len=name_length), allocatable, intent(out) :: names(:)
      character(len=name_length) :: name
      character(len=256) :: message
      integer :: unit, status, n

      allocate (names(64))
      n = 0
      open (newunit=unit, file=path//'/'//manifest, status='old', action='read', iostat=status, iomsg=message)
      if (status == 0) then
         do
            read (unit, '(a)', iostat=status, iomsg=message) name
            if (status /= 0) exit
            if (n == size(names)) names = [names, names]
            n = n + 1
            names(n) = name
         end do
         close (unit)
      end if
      names = names(:n)
   end subroutine read_names

   !> Adds names to the manifest of a directory.
   subroutine add_names(path, names, error)
      character(len=*), intent(in) :: path
      !> The names: [n_name].
      character(len=*), intent(in) :: names(:)
      !> They cannot be written.
      type(error_type), allocatable, intent(out) :: error
      character(len=256) :: message
      integer :: unit, status, i

      open (newunit=unit, file=path//'/'//manifest, position='append', action='write', iostat=status, iomsg=message)
      do i = 1, size(names)
         if (status == 0) write (unit, '(a)', iostat=status, iomsg=message) trim(names(i))
      end do
      if (status == 0) close (unit, iostat=status, iomsg=message)
      if (status /= 0) error = input_error('--output '//path//': '//manifest//' cannot be written ('//trim(message) &
         //'); allowed: a directory that you may write to, with space on its disk')
   end subroutine add_names

end module thud_file_set
