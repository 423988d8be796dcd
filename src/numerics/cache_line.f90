!> Arrays that begin where the lines of the cache do: the processor takes twice as long for a vector
!> that lies across two lines (all of an ensemble's march takes 1.3 times as long), and `allocate`
!> promises less.
module thud_cache_line
   use, intrinsic :: iso_c_binding, only: c_intptr_t, c_loc
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: get_aligned_start, line_length

   !> Numbers in a line of the cache.
   integer, parameter :: line_length = 8

contains

   !> First element of a buffer at the beginning of a line; `line_length` elements may be skipped.
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
