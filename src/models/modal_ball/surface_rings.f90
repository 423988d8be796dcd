!> Rings around the lowest point of the sphere that carry the pressure of the floor.
!>
!> The pressure is linear between neighboring rings: ring i stands for the hat function that is 1 at its angle and 0 at the
!> neighboring ones. The height of a ring is the mean over its hat function, so that force times displacement is work. Line
!> loads would converge only with the first power of the spacing, and need many more harmonics.
!>
!> Sticking rings have two degrees of freedom, downwards and inwards, each with a row of the mode shapes, downwards first.
module thud_surface_rings
   use thud_constants, only: pi
   use thud_kinds, only: wp
   use thud_legendre, only: get_gauss_legendre, get_legendre
   implicit none (type, external)
   private

   public :: greatest_angle, new_surface_rings, surface_rings_type

   !> Greatest angle of the outermost ring from the lowest point, rad.
   real(wp), parameter :: greatest_angle = pi/3

   !> The rings of a sphere of radius 1.
   type :: surface_rings_type
      !> Distance of each ring from the axis: [n_ring].
      real(wp), allocatable :: radius(:)
      !> Mean height of each hat function below the center: [n_ring].
      real(wp), allocatable :: height(:)
      !> Mean displacement over each hat function due to unit U and unit V of each harmonic: [n_dof*n_ring, 2, 0:highest].
      real(wp), allocatable :: shape_at_ring(:, :, :)
      !> Degrees of freedom of a ring: 1, or 2 if it sticks.
      integer :: n_dof = 1
   end type surface_rings_type

contains

   !> Rings with equal spacing.
   pure function new_surface_rings(n_ring, outermost_angle, sticks) result(rings)
      !> Number of rings, at least 2.
      integer, intent(in) :: n_ring
      !> Angle of the outermost ring from the lowest point, rad.
      real(wp), intent(in) :: outermost_angle
      !> Whether the rings stick.
      logical, intent(in) :: sticks
      type(surface_rings_type) :: rings
      real(wp), allocatable :: value(:), first(:), second(:), node(:), weight(:)
      real(wp) :: area(n_ring)
      real(wp) :: width, angle, area_fraction
      integer :: i, j, k, n_node, row, highest

      ! The wavelength of the highest harmonic is the spacing of the rings.
      highest = nint(2*n_ring*pi/outermost_angle)
      allocate (value(0:highest), first(0:highest), second(0:highest))
      width = outermost_angle/(n_ring - 1)
      rings%radius = sin([((i - 1)*width, i=1, n_ring)])
      rings%n_dof = merge(2, 1, sticks)
      allocate (rings%height(n_ring), rings%shape_at_ring(rings%n_dof*n_ring, 2, 0:highest), source=0.0_wp)
      area = 0.0_wp
      ! Enough for all digits of a hat function times the highest harmonic.
      n_node = 4 + ceiling(highest*width/2)
      allocate (node(n_node), weight(n_node))
      call get_gauss_legendre(node, weight)
      do i = 1, n_ring - 1
         do k = 1, n_node
            angle = (i - 1 + (1 + node(k))/2)*width
            call get_legendre(cos(angle), value, first, second)
            do j = 0, 1
               area_fraction = weight(k)*merge(1 + node(k), 1 - node(k), j == 1)*sin(angle)
               area(i + j) = area(i + j) + area_fraction
               rings%height(i + j) = rings%height(i + j) + area_fraction*cos(angle)
               ! Downwards: P_n cos t for U and -dP_n/dt sin t for V.
               row = rings%n_dof*(i + j - 1) + 1
               rings%shape_at_ring(row, 1, :) = rings%shape_at_ring(row, 1, :) + area_fraction*cos(angle)*value
               rings%shape_at_ring(row, 2, :) = rings%shape_at_ring(row, 2, :) + area_fraction*sin(angle)**2*first
               if (.not. sticks) cycle
               ! Inwards: -P_n sin t for U and -dP_n/dt cos t for V.
               rings%shape_at_ring(row + 1, 1, :) = rings%shape_at_ring(row + 1, 1, :) - area_fraction*sin(angle)*value
               rings%shape_at_ring(row + 1, 2, :) = rings%shape_at_ring(row + 1, 2, :) + &
                  area_fraction*sin(angle)*cos(angle)*first
            end do
         end do
      end do
      rings%height = rings%height/area
      do i = 1, size(rings%shape_at_ring, 1)
         rings%shape_at_ring(i, :, :) = rings%shape_at_ring(i, :, :)/area(1 + (i - 1)/rings%n_dof)
      end do
   end function new_surface_rings

end module thud_surface_rings
