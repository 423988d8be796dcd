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
   use thud_lapack, only: dgemm
   use thud_legendre, only: get_gauss_legendre
   implicit none (type, external)
   private

   public :: get_ring_response, greatest_angle, new_surface_rings, surface_rings_type

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
      real(wp), allocatable :: node(:), weight(:)
      ! Displacements of the rings due to U and V, downwards and inwards: [n_ring, 2, n_dof, 0:highest].
      real(wp), allocatable :: shapes(:, :, :, :)
      real(wp) :: area(n_ring)
      real(wp) :: width
      integer :: i, k, n_node, highest

      ! The wavelength of the highest harmonic is the spacing of the rings.
      highest = nint(2*n_ring*pi/outermost_angle)
      width = outermost_angle/(n_ring - 1)
      rings%radius = sin([((i - 1)*width, i=1, n_ring)])
      rings%n_dof = merge(2, 1, sticks)
      allocate (rings%height(n_ring), shapes(n_ring, 2, rings%n_dof, 0:highest), source=0.0_wp)
      area = 0.0_wp
      ! Enough for all digits of a hat function times the highest harmonic.
      n_node = 4 + ceiling(highest*width/2)
      allocate (node(n_node), weight(n_node))
      call get_gauss_legendre(node, weight)
      do k = 1, n_node
         call add_nodes(width*[(i - 1 + (1 + node(k))/2, i=1, n_ring - 1)], (1 - node(k))*weight(k), &
            (1 + node(k))*weight(k), area, rings%height, shapes)
      end do
      rings%height = rings%height/area
      do i = 1, n_ring
         shapes(i, :, :, :) = shapes(i, :, :, :)/area(i)
      end do
      allocate (rings%shape_at_ring(rings%n_dof*n_ring, 2, 0:highest))
      do i = 1, rings%n_dof
         rings%shape_at_ring(i::rings%n_dof, :, :) = shapes(:, :, i, :)
      end do
   end function new_surface_rings

   !> Adds one node of the quadrature in every interval between two rings.
   pure subroutine add_nodes(angle, inner_weight, outer_weight, area, height, shapes)
      !> Angles from the lowest point, rad: [n_ring - 1].
      real(wp), intent(in) :: angle(:)
      !> Weights of the hat functions of the inner and of the outer ring.
      real(wp), intent(in) :: inner_weight, outer_weight
      !> Integrals over the hat functions, of 1 and of the height: [n_ring].
      real(wp), intent(inout) :: area(:), height(:)
      !> Integrals of the displacements by U and V, downwards and inwards: [n_ring, 2, n_dof, 0:highest].
      real(wp), intent(inout), contiguous :: shapes(:, :, :, 0:)
      real(wp), dimension(size(angle)) :: cosine, sine, value, previous, slope, previous_slope
      real(wp) :: direction(size(angle), 2, 2)
      real(wp) :: next_factor, previous_factor, next, next_slope
      integer :: i, n

      cosine = cos(angle)
      sine = sin(angle)
      ! Downwards: P_n cos t for U and -dP_n/dt sin t for V.
      direction(:, 1, 1) = sine*cosine
      direction(:, 2, 1) = sine**3
      ! Inwards: -P_n sin t for U and -dP_n/dt cos t for V.
      direction(:, 1, 2) = -sine**2
      direction(:, 2, 2) = sine**2*cosine
      n = size(angle)
      area(:n) = area(:n) + inner_weight*sine
      area(2:) = area(2:) + outer_weight*sine
      height(:n) = height(:n) + inner_weight*sine*cosine
      height(2:) = height(2:) + outer_weight*sine*cosine
      previous = 0.0_wp
      value = 1.0_wp
      previous_slope = 0.0_wp
      slope = 0.0_wp
      do n = 0, ubound(shapes, 4)
         do i = 1, size(shapes, 3)
            call add(direction(:, 1, i), value, shapes(:, 1, i, n))
            call add(direction(:, 2, i), slope, shapes(:, 2, i, n))
         end do
         ! Legendre polynomials and derivatives of the next degree.
         next_factor = real(2*n + 1, wp)/(n + 1)
         previous_factor = real(n, wp)/(n + 1)
         do i = 1, size(angle)
            next = next_factor*cosine(i)*value(i) - previous_factor*previous(i)
            next_slope = previous_slope(i) + (2*n + 1)*value(i)
            previous(i) = value(i)
            value(i) = next
            previous_slope(i) = slope(i)
            slope(i) = next_slope
         end do
      end do

   contains

      !> Adds a displacement at the nodes to the integrals of both rings.
      pure subroutine add(direction, values, integral)
         !> Factor of the displacement, and displacement: [n_ring - 1].
         real(wp), intent(in), contiguous :: direction(:), values(:)
         real(wp), intent(inout), contiguous :: integral(:)
         integer :: i

         do i = 1, size(values)
            integral(i) = integral(i) + inner_weight*direction(i)*values(i)
         end do
         do i = 1, size(values)
            integral(i + 1) = integral(i + 1) + outer_weight*direction(i)*values(i)
         end do
      end subroutine add

   end subroutine add_nodes

   !> Displacements of the rings due to unit forces on them.
   function get_ring_response(rings, flexibility) result(response)
      type(surface_rings_type), intent(in) :: rings
      !> U and V of each harmonic at the outer surface due to unit generalized forces on U and V, m/N: [2, 2, 0:highest].
      real(wp), intent(in) :: flexibility(:, :, 0:)
      !> The displacements, m/N: [n_gap, n_gap].
      real(wp), allocatable :: response(:, :)
      real(wp), allocatable :: displacement(:, :, :)
      integer :: j, n

      associate (shapes => rings%shape_at_ring, n_gap => size(rings%shape_at_ring, 1))
         allocate (displacement(n_gap, 2, 0:ubound(flexibility, 3)), response(n_gap, n_gap))
         do n = 0, ubound(flexibility, 3)
            do j = 1, 2
               displacement(:, j, n) = shapes(:, 1, n)*flexibility(1, j, n) + shapes(:, 2, n)*flexibility(2, j, n)
            end do
         end do
         call dgemm('N', 'T', n_gap, n_gap, 2*size(flexibility, 3), 1.0_wp, displacement, n_gap, shapes, n_gap, 0.0_wp, &
            response, n_gap)
      end associate
   end function get_ring_response

end module thud_surface_rings
