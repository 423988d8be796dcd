!> The order of numbers.
module thud_ascending
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: get_ascending_order

contains

   !> Indices of values in ascending order, by insertion: made for values that are nearly sorted.
   pure function get_ascending_order(value) result(order)
      !> Values: [n].
      real(wp), intent(in) :: value(:)
      integer :: order(size(value))
      integer :: i, k, number

      order = [(i, i=1, size(value))]
      do i = 2, size(value)
         number = order(i)
         do k = i - 1, 1, -1
            if (value(order(k)) <= value(number)) exit
            order(k + 1) = order(k)
         end do
         order(k + 1) = number
      end do
   end function get_ascending_order

end module thud_ascending
