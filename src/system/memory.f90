!> Checks before large work begins that there is enough memory.
module thud_memory
   use, intrinsic :: iso_fortran_env, only: int64, int8
   use thud_error, only: error_type, numerical_error
   use thud_kinds, only: wp
   use thud_text, only: fixed
   implicit none (type, external)
   private

   public :: get_limit, require_memory

contains

   !> Returns an error if work needs more memory than is available.
   subroutine require_memory(bytes, purpose, allowed, error)
      !> Memory needed at a time, bytes.
      real(wp), intent(in) :: bytes
      !> What needs the memory, in the plural.
      character(len=*), intent(in) :: purpose
      !> What would need less.
      character(len=*), intent(in) :: allowed
      type(error_type), allocatable, intent(out) :: error
      ! Volatile, since a compiler may leave out memory that nothing uses.
      integer(int8), allocatable, volatile :: block(:)
      character(len=128) :: message
      real(wp) :: swap
      integer :: status

      ! Linux promises more memory than it has, and ends a process that then writes to it; files of version 2 and 1 of
      ! control groups state the limit of a container.
      !$omp critical (thud_memory)
      swap = get_limit('/proc/meminfo', 'SwapFree:')
      status = merge(0, 1, bytes <= min(get_limit('/sys/fs/cgroup/memory.max', ''), &
         get_limit('/sys/fs/cgroup/memory/memory.limit_in_bytes', ''), &
         1024*(get_limit('/proc/meminfo', 'MemAvailable:') + merge(0.0_wp, swap, swap > 1.0e29_wp))))
      !$omp end critical (thud_memory)
      if (status == 0) allocate (block(int(min(bytes, 1.0e18_wp), int64)), stat=status, errmsg=message)
      if (status /= 0) error = numerical_error(purpose//' need '//fixed(bytes, 0)//' bytes of memory, more than there is; ' &
         //'allowed: '//allowed)
   end subroutine require_memory

   !> The number behind a label at the beginning of a line.
   function get_limit(path, label) result(limit)
      !> Path of a file of the system.
      character(len=*), intent(in) :: path
      character(len=*), intent(in) :: label
      !> The number; more than any memory if there is no such file, line or number.
      real(wp) :: limit
      character(len=128) :: line, message
      real(wp) :: number
      integer :: unit, status

      limit = 1.0e30_wp
      open (newunit=unit, file=path, action='read', status='old', iostat=status, iomsg=message)
      if (status /= 0) return
      do
         read (unit, '(a)', iostat=status, iomsg=message) line
         if (status == 0 .and. index(line, label) /= 1) cycle
         if (status == 0) read (line(len(label) + 1:), *, iostat=status, iomsg=message) number
         if (status == 0) limit = number
         exit
      end do
      close (unit)
   end function get_limit

end module thud_memory
