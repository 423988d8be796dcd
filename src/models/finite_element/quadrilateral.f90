!> Quadrilaterals with four and nine nodes: shape functions and Gauss points.
module thud_quadrilateral
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: get_gauss_points, get_shape

contains

   !> Points and weights of the Gauss rule with two or three points on -1 <= x <= 1.
   pure subroutine get_gauss_points(point, weight)
      !> Points: [2] or [3].
      real(wp), intent(out) :: point(:)
      !> Their weights, of the same shape.
      real(wp), intent(out) :: weight(:)

      if (size(point) == 2) then
         point = [-1, 1]/sqrt(3.0_wp)
         weight = 1.0_wp
      else
         point = [-1, 0, 1]*sqrt(0.6_wp)
         weight = [5.0_wp, 8.0_wp, 5.0_wp]/9.0_wp
      end if
   end subroutine get_gauss_points

   !> Shape functions and their derivatives, products of Lagrange's polynomials. Node (i, j) of the
   !> square has number 1 + i + (order + 1) j, i along x and j along y.
   pure subroutine get_shape(order, x, y, value, gradient)
      !> Order of the element, 1 or 2.
      integer, intent(in) :: order
      !> Coordinates, -1 to 1.
      real(wp), intent(in) :: x, y
      !> Values: [(order + 1)**2].
      real(wp), intent(out) :: value(:)
      !> Derivatives with respect to x and y: [(order + 1)**2, 2].
      real(wp), intent(out) :: gradient(:, :)
      real(wp) :: at_x(0:order), at_y(0:order), slope_x(0:order), slope_y(0:order)
      integer :: i, j, node

      call get_line(x, at_x, slope_x)
      call get_line(y, at_y, slope_y)
      do j = 0, order
         do i = 0, order
            node = 1 + i + (order + 1)*j
            value(node) = at_x(i)*at_y(j)
            gradient(node, :) = [slope_x(i)*at_y(j), at_x(i)*slope_y(j)]
         end do
      end do
   end subroutine get_shape

   !> Lagrange's polynomials on evenly spaced nodes of a line.
   pure subroutine get_line(x, value, slope)
      !> Coordinate, -1 to 1.
      real(wp), intent(in) :: x
      !> Values: [2] or [3].
      real(wp), intent(out) :: value(:)
      !> Their derivatives, of the same shape.
      real(wp), intent(out) :: slope(:)

      if (size(value) == 2) then
         value = [1 - x, 1 + x]/2
         slope = [-0.5_wp, 0.5_wp]
      else
         value = [x*(x - 1)/2, 1 - x**2, x*(x + 1)/2]
         slope = [x - 0.5_wp, -2*x, x + 0.5_wp]
      end if
   end subroutine get_line

end module thud_quadrilateral
