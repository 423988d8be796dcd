!> Arrays that begin at a cache line. The processor takes twice as long for a vector that lies across two lines (the time
!> integration of an ensemble takes 1.3 times as long), and `allocate` does not guarantee this alignment.
module thud_cache_line
   use, intrinsic :: iso_c_binding, only: c_intptr_t, c_loc
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: get_aligned_start, line_length

   !> Real numbers in a cache line.
   integer, parameter :: line_length = 8

contains

   !> Index of the first element of a buffer that lies at the beginning of a cache line, at most `line_length`.
   function get_aligned_start(buffer) result(first)
      !> The beginning of the buffer: [line_length].
      real(wp), intent(in), target :: buffer(line_length)
      !> Index of the element.
      integer :: first
      integer(c_intptr_t) :: address

      address = transfer(c_loc(buffer), address)
      first = 1 + int(modulo(-address, int(8*line_length, c_intptr_t))/8)
   end function get_aligned_start

end module thud_cache_line
