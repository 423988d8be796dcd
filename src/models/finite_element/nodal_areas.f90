!> Areas of a surface of revolution that belong to its nodes.
module thud_nodal_areas
   use thud_constants, only: pi
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: get_nodal_areas

contains

   !> Nodal areas of a surface, m2: integrals of the shape functions over the adjacent frustums, as for a pressure: [0:n].
   pure function get_nodal_areas(r, z) result(area)
      !> Distances of the nodes from the axis, m: [0:n].
      real(wp), intent(in) :: r(0:)
      !> Their heights, m: [0:n].
      real(wp), intent(in) :: z(0:)
      real(wp) :: area(0:ubound(r, 1))
      real(wp) :: width
      integer :: j

      area = 0.0_wp
      do j = 1, ubound(r, 1)
         width = hypot(r(j) - r(j - 1), z(j) - z(j - 1))
         area(j - 1) = area(j - 1) + pi*width*(2*r(j - 1) + r(j))/3
         area(j) = area(j) + pi*width*(r(j - 1) + 2*r(j))/3
      end do
   end function get_nodal_areas

end module thud_nodal_areas
