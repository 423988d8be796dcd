!> The few calls of the operating system that Fortran lacks (POSIX.1-2008).
module thud_posix
   use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_int, c_intptr_t, c_long, c_null_char, c_null_ptr, c_ptr, &
      c_size_t
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: directory_exists, get_free_bytes, ignore_interrupts, ignore_signals, is_empty_directory, is_terminal
   public :: close_descriptor, lock_directory, lock_type, make_directory, open_descriptor, print_text, read_bytes
   public :: remove_file, rename_file, standard_error, standard_output, unlock_directory

   !> Descriptors of the process.
   integer, parameter :: standard_output = 1, standard_error = 2

   !> A lock on a directory; the system drops it with the process.
   type :: lock_type
      private
      !> The open directory, null where there is no lock.
      type(c_ptr) :: directory = c_null_ptr
   end type lock_type

   interface
      function c_dirfd(directory) bind(c, name='dirfd') result(descriptor)
         import :: c_int, c_ptr
         implicit none (type, external)
         type(c_ptr), value :: directory
         integer(c_int) :: descriptor
      end function c_dirfd

      function c_flock(descriptor, operation) bind(c, name='flock') result(status)
         import :: c_int
         implicit none (type, external)
         integer(c_int), value :: descriptor
         integer(c_int), value :: operation
         integer(c_int) :: status
      end function c_flock

      function c_statvfs(path, buffer) bind(c, name='statvfs') result(status)
         import :: c_char, c_int, c_long
         implicit none (type, external)
         character(kind=c_char), intent(in) :: path(*)
         integer(c_long), intent(out) :: buffer(*)
         integer(c_int) :: status
      end function c_statvfs

      function c_isatty(descriptor) bind(c, name='isatty') result(yes)
         import :: c_int
         implicit none (type, external)
         integer(c_int), value :: descriptor
         integer(c_int) :: yes
      end function c_isatty

      function c_mkdir(path, mode) bind(c, name='mkdir') result(status)
         import :: c_char, c_int
         implicit none (type, external)
         character(kind=c_char), intent(in) :: path(*)
         integer(c_int), value :: mode
         integer(c_int) :: status
      end function c_mkdir

      function c_rename(old_path, new_path) bind(c, name='rename') result(status)
         import :: c_char, c_int
         implicit none (type, external)
         character(kind=c_char), intent(in) :: old_path(*), new_path(*)
         integer(c_int) :: status
      end function c_rename

      function c_remove(path) bind(c, name='remove') result(status)
         import :: c_char, c_int
         implicit none (type, external)
         character(kind=c_char), intent(in) :: path(*)
         integer(c_int) :: status
      end function c_remove

      function c_opendir(path) bind(c, name='opendir') result(directory)
         import :: c_char, c_ptr
         implicit none (type, external)
         character(kind=c_char), intent(in) :: path(*)
         type(c_ptr) :: directory
      end function c_opendir

      function c_readdir(directory) bind(c, name='readdir') result(entry)
         import :: c_ptr
         implicit none (type, external)
         type(c_ptr), value :: directory
         type(c_ptr) :: entry
      end function c_readdir

      function c_closedir(directory) bind(c, name='closedir') result(status)
         import :: c_int, c_ptr
         implicit none (type, external)
         type(c_ptr), value :: directory
         integer(c_int) :: status
      end function c_closedir

      function c_write(descriptor, buffer, length) bind(c, name='write') result(written)
         import :: c_char, c_int, c_intptr_t, c_long, c_size_t
         implicit none (type, external)
         integer(c_int), value :: descriptor
         character(kind=c_char), intent(in) :: buffer(*)
         integer(c_size_t), value :: length
         integer(c_intptr_t) :: written
      end function c_write

      function c_open(path, flags) bind(c, name='open') result(descriptor)
         import :: c_char, c_int
         implicit none (type, external)
         character(kind=c_char), intent(in) :: path(*)
         integer(c_int), value :: flags
         integer(c_int) :: descriptor
      end function c_open

      function c_read(descriptor, buffer, length) bind(c, name='read') result(count)
         import :: c_char, c_int, c_intptr_t, c_size_t
         implicit none (type, external)
         integer(c_int), value :: descriptor
         character(kind=c_char), intent(out) :: buffer(*)
         integer(c_size_t), value :: length
         integer(c_intptr_t) :: count
      end function c_read

      function c_close(descriptor) bind(c, name='close') result(status)
         import :: c_int
         implicit none (type, external)
         integer(c_int), value :: descriptor
         integer(c_int) :: status
      end function c_close

      function c_signal(number, handler) bind(c, name='signal') result(old_handler)
         import :: c_int, c_intptr_t
         implicit none (type, external)
         integer(c_int), value :: number
         integer(c_intptr_t), value :: handler
         integer(c_intptr_t) :: old_handler
      end function c_signal
   end interface

contains

   !> Writes to the screen; the run-time library would not tell that it is full or closed.
   subroutine print_text(descriptor, text, done)
      !> `standard_output` or `standard_error`.
      integer, intent(in) :: descriptor
      !> The text.
      character(len=*), intent(in) :: text
      !> All of it was written.
      logical, intent(out) :: done
      integer(c_intptr_t) :: written
      integer :: at

      at = 0
      done = .true.
      do while (done .and. at < len(text))
         written = c_write(int(descriptor, c_int), text(at + 1:), int(len(text) - at, c_size_t))
         done = written > 0
         at = at + int(written)
      end do
   end subroutine print_text

   !> Opens a file, pipe or device to be read.
   function open_descriptor(path) result(descriptor)
      !> Path.
      character(len=*), intent(in) :: path
      !> The descriptor; negative where it cannot be opened.
      integer :: descriptor
      integer(c_int), parameter :: read_only = 0

      descriptor = int(c_open(path//c_null_char, read_only))
   end function open_descriptor

   !> Reads what there is, at most as much as there is room for.
   subroutine read_bytes(descriptor, buffer, count)
      !> The descriptor.
      integer, intent(in) :: descriptor
      !> The bytes.
      character(len=*), intent(out) :: buffer
      !> Their number; 0 at the end, negative where they cannot be read.
      integer, intent(out) :: count

      count = int(c_read(int(descriptor, c_int), buffer, int(len(buffer), c_size_t)))
   end subroutine read_bytes

   !> Closes a descriptor.
   subroutine close_descriptor(descriptor)
      !> The descriptor; negative where it is closed.
      integer, intent(inout) :: descriptor
      integer(c_int) :: status

      if (descriptor < 0) return
      status = c_close(int(descriptor, c_int))
      descriptor = -1
      if (status /= 0) return
   end subroutine close_descriptor

   !> Makes two signals errors of the write that causes them and not the end of the process: a file
   !> that grows beyond the limit of the process, and a pipe that nobody reads.
   subroutine ignore_signals()
      integer(c_int), parameter :: sigpipe = 13, sigxfsz = 25
      integer(c_intptr_t), parameter :: ignore = 1
      integer(c_intptr_t) :: old_handler

      old_handler = c_signal(sigxfsz, ignore)
      old_handler = c_signal(sigpipe, ignore)
      if (old_handler < 0) return
   end subroutine ignore_signals

   !> Lets interrupts pass or not, while files are renamed.
   subroutine ignore_interrupts(ignored, before)
      !> They are ignored from now on; otherwise `before` holds again.
      logical, intent(in) :: ignored
      !> What happens on an interrupt at other times.
      integer(c_intptr_t), intent(inout) :: before
      integer(c_int), parameter :: sigint = 2
      integer(c_intptr_t), parameter :: ignore = 1
      integer(c_intptr_t) :: old_handler

      if (ignored) then
         before = c_signal(sigint, ignore)
      else
         old_handler = c_signal(sigint, before)
         if (old_handler < 0) return
      end if
   end subroutine ignore_interrupts

   !> Waits for and takes the lock on a directory. File systems without locks go without.
   subroutine lock_directory(path, lock)
      !> Path of the directory.
      character(len=*), intent(in) :: path
      !> The lock.
      type(lock_type), intent(out) :: lock
      integer(c_int), parameter :: exclusive = 2
      integer(c_int) :: status

      lock%directory = c_opendir(path//c_null_char)
      if (.not. c_associated(lock%directory)) return
      status = c_flock(c_dirfd(lock%directory), exclusive)
      if (status /= 0) call unlock_directory(lock)
   end subroutine lock_directory

   !> Gives a lock back.
   subroutine unlock_directory(lock)
      !> The lock.
      type(lock_type), intent(inout) :: lock
      integer(c_int) :: status

      if (.not. c_associated(lock%directory)) return
      status = c_closedir(lock%directory)
      lock%directory = c_null_ptr
      if (status /= 0) return
   end subroutine unlock_directory

   !> Whether a directory of that name is there.
   function directory_exists(path) result(there)
      !> Path.
      character(len=*), intent(in) :: path
      !> It exists and can be read.
      logical :: there

      there = count_entries(path) >= 0
   end function directory_exists

   !> Whether a directory is there and holds nothing.
   function is_empty_directory(path) result(empty)
      !> Path.
      character(len=*), intent(in) :: path
      !> It holds no more than `.` and `..`.
      logical :: empty
      integer :: entries

      entries = count_entries(path)
      empty = entries >= 0 .and. entries <= 2
   end function is_empty_directory

   !> Entries of a directory, `.` and `..` included; -1 where it cannot be read. Stops at three.
   function count_entries(path) result(entries)
      !> Path.
      character(len=*), intent(in) :: path
      !> Number of entries, up to 3.
      integer :: entries
      type(c_ptr) :: directory
      integer(c_int) :: status

      entries = -1
      directory = c_opendir(path//c_null_char)
      if (.not. c_associated(directory)) return
      entries = 0
      do while (entries < 3)
         if (.not. c_associated(c_readdir(directory))) exit
         entries = entries + 1
      end do
      status = c_closedir(directory)
      if (status /= 0) entries = -1
   end function count_entries

   !> Whether somebody sees what is written.
   function is_terminal(descriptor) result(yes)
      !> `standard_output` or `standard_error`.
      integer, intent(in) :: descriptor
      !> The descriptor is a terminal.
      logical :: yes

      yes = c_isatty(int(descriptor, c_int)) == 1
   end function is_terminal

   !> Makes a directory and those above it.
   subroutine make_directory(path, done)
      !> Path.
      character(len=*), intent(in) :: path
      !> The directory is there now.
      logical, intent(out) :: done
      integer(c_int), parameter :: permissions = int(o'777', c_int)
      integer(c_int) :: status
      integer :: i

      do i = 2, len(path)
         if (path(i:i) /= '/') cycle
         if (directory_exists(path(:i - 1))) cycle
         status = c_mkdir(path(:i - 1)//c_null_char, permissions)
      end do
      status = c_mkdir(path//c_null_char, permissions)
      done = status == 0 .or. directory_exists(path)
   end subroutine make_directory

   !> Gives a file another name; a file that has that name is replaced in the same instant.
   subroutine rename_file(old_path, new_path, done)
      !> Path of the file.
      character(len=*), intent(in) :: old_path
      !> New path in the same file system.
      character(len=*), intent(in) :: new_path
      !> The file has its new name.
      logical, intent(out) :: done

      done = c_rename(old_path//c_null_char, new_path//c_null_char) == 0
   end subroutine rename_file

   !> Removes a file or an empty directory if it is there.
   subroutine remove_file(path, done)
      !> Path.
      character(len=*), intent(in) :: path
      !> There was something, and it is gone.
      logical, intent(out), optional :: done
      integer(c_int) :: status

      status = c_remove(path//c_null_char)
      if (present(done)) done = status == 0
   end subroutine remove_file

   !> Room on the disk of a directory, or of the next one above that is there.
   function get_free_bytes(path) result(bytes)
      !> Path.
      character(len=*), intent(in) :: path
      !> Bytes that this user may write; huge where the system does not tell.
      real(wp) :: bytes
      ! The 64-bit `struct statvfs` of Linux begins with block size, fragment size, blocks, free
      ! blocks, and blocks free for this user.
      integer, parameter :: plenty = 64
      integer(c_long) :: buffer(plenty)
      integer :: i

      bytes = huge(bytes)
      i = len(path)
      do while (i > 0)
         if (directory_exists(path(:i))) exit
         i = index(path(:i - 1), '/', back=.true.)
      end do
      buffer = 0
      if (i > 0) then
         if (c_statvfs(path(:i)//c_null_char, buffer) /= 0) return
      else
         if (c_statvfs('.'//c_null_char, buffer) /= 0) return
      end if
      bytes = real(buffer(2), wp)*real(buffer(5), wp)
   end function get_free_bytes

end module thud_posix
