!> Elements of the transient model: four nodes, four Gauss points, one mean dilatation (Q1P0), which does not lock (Simo,
!> Taylor and Pister 1985, Comput. Methods Appl. Mech. Eng. 51, 177-208).
!>
!> Elements that lie side by side in one ring of the mesh are processed together in blocks, one Gauss point per lane: nothing
!> is gathered or scattered, and a block stays in the first-level cache. General tensors have the components 1 = rr, 2 = rz,
!> 3 = zr, 4 = zz, 5 = hoop; symmetric tensors 1 = rr, 2 = zz, 3 = hoop, 4 = rz.
!>
!> In the square of an element, x runs through the wall and y from pole to pole. Gauss point g = a + 2 (b - 1) has the
!> coordinates x_a and y_b, so that derivatives along x depend on b only, those along y on a only. Lane j + n_element (g - 1)
!> of a block is point g of element j. Lanes without an element are computed too, with volume 0: loops of constant length are
!> faster.
module thud_element_block
   use thud_constants, only: pi
   use thud_kinds, only: wp
   use thud_mesh, only: mesh_type
   implicit none (type, external)
   private

   public :: add_nodal_forces, element_block_type, get_gradients, n_component, n_element, n_lane, n_point, n_symmetric, &
      new_element_blocks

   !> Gauss points of an element.
   integer, parameter :: n_point = 4
   !> Maximum number of elements in a block, and of its Gauss points.
   integer, parameter :: n_element = 32, n_lane = n_element*n_point
   !> Components of a deformation gradient.
   integer, parameter :: n_component = 5
   !> Components of a symmetric tensor.
   integer, parameter :: n_symmetric = 4

   !> Weights of the nearer and the farther node of an edge at a Gauss point.
   real(wp), parameter :: near = (1 + 1/sqrt(3.0_wp))/2, far = 1 - near
   !> Distances of the Gauss points from the first node of an edge, divided by its length.
   real(wp), parameter :: position(2) = [far, near]

   !> Some elements between two rings of nodes, undeformed.
   type :: element_block_type
      !> Number of elements.
      integer :: n = 0
      !> Index of the outer ring of nodes; indices of the polar lines before the first and after the last element.
      integer :: ring = 0, before = 0, after = 0
      !> Derivatives of x with respect to r, y to r, x to z and y to z, times the derivative of a weight, 1/2, 1/m:
      !> [n_element, 4, point].
      real(wp) :: map(n_element, 4, n_point) = 0.0_wp
      !> Inverse distance of each Gauss point from the axis, 1/m: [n_element, point].
      real(wp) :: curvature(n_element, n_point) = 0.0_wp
      !> Volume of each Gauss point, m3: [n_lane].
      real(wp) :: weight(n_lane) = 0.0_wp
      !> Inverse volume of each element, 1/m3: [n_element].
      real(wp) :: inverse_volume(n_element) = 0.0_wp
      !> Volume that belongs to each node, m3: [n_element, node].
      real(wp) :: nodal_volume(n_element, 4) = 0.0_wp
   end type element_block_type

contains

   !> The elements of a mesh, ring after ring. Nodes 1 and 2 lie on the polar line nearer to the lowest point,
   !> 1 and 3 on the inner ring.
   pure function new_element_blocks(mesh) result(blocks)
      type(mesh_type), intent(in) :: mesh
      type(element_block_type), allocatable :: blocks(:)
      integer :: i, k, n_block

      ! As many blocks per ring as needed, of nearly the same size.
      n_block = (mesh%n_polar + n_element - 1)/n_element
      allocate (blocks(n_block*mesh%n_radial))
      do i = 1, mesh%n_radial
         do k = 1, n_block
            associate (block => blocks(k + n_block*(i - 1)))
               block%ring = i
               block%before = (k - 1)*mesh%n_polar/n_block
               block%after = k*mesh%n_polar/n_block
               block%n = block%after - block%before
               call set_geometry(mesh, block)
            end associate
         end do
      end do
   end function new_element_blocks

   !> Sets volumes and derivatives of the elements of a block.
   pure subroutine set_geometry(mesh, block)
      type(mesh_type), intent(in) :: mesh
      type(element_block_type), intent(inout) :: block
      real(wp) :: point(2), value(4), slope(4, 2), jacobian(2, 2), r(4), z(4)
      real(wp) :: determinant, radius, volume
      integer :: a, b, g, j

      point = [-1, 1]/sqrt(3.0_wp)
      do j = 1, block%n
         associate (line => block%before + j)
            r = reshape(transpose(mesh%r(line - 1:line, block%ring - 1:block%ring)), [4])
            z = reshape(transpose(mesh%z(line - 1:line, block%ring - 1:block%ring)), [4])
         end associate
         do b = 1, 2
            do a = 1, 2
               g = a + 2*(b - 1)
               ! Bilinear shape functions of the nodes, and their derivatives along x and y.
               associate (x => [1 - point(a), 1 + point(a)]/2, y => [1 - point(b), 1 + point(b)]/2)
                  value = [x*y(1), x*y(2)]
                  slope(:, 1) = [-y(1), y(1), -y(2), y(2)]/2
                  slope(:, 2) = [-x, x]/2
               end associate
               jacobian(1, :) = matmul(r, slope)
               jacobian(2, :) = matmul(z, slope)
               determinant = jacobian(1, 1)*jacobian(2, 2) - jacobian(1, 2)*jacobian(2, 1)
               radius = dot_product(value, r)
               volume = 2*pi*radius*abs(determinant)
               block%map(j, :, g) = [jacobian(2, 2), -jacobian(2, 1), -jacobian(1, 2), jacobian(1, 1)]/(2*determinant)
               block%curvature(j, g) = 1/radius
               block%weight(j + n_element*(g - 1)) = volume
               block%nodal_volume(j, :) = block%nodal_volume(j, :) + volume*value
            end do
         end do
         block%inverse_volume(j) = 1/sum(block%nodal_volume(j, :))
      end do
   end subroutine set_geometry

   !> Gradients of a vector field at all Gauss points: F if the field holds positions, the rate of F if it holds velocities.
   pure subroutine get_gradients(block, last, r, z, gradient)
      type(element_block_type), intent(in) :: block
      !> Index of the last polar line.
      integer, intent(in) :: last
      !> First component at the nodes of the inner and the outer ring: [0:n_polar, 2].
      real(wp), intent(in) :: r(0:last, 2)
      !> Second component: [0:n_polar, 2].
      real(wp), intent(in) :: z(0:last, 2)
      !> The gradients; lanes without an element stay unchanged: [n_lane, component].
      real(wp), intent(inout) :: gradient(n_lane, n_component)
      real(wp), dimension(n_element, 2) :: r_along_x, r_along_y, z_along_x, z_along_y
      integer :: a, b, g, j, lane, line

      call differentiate(block%n, r(block%before, 1), r(block%before, 2), r_along_x, r_along_y)
      call differentiate(block%n, z(block%before, 1), z(block%before, 2), z_along_x, z_along_y)
      do b = 1, 2
         do a = 1, 2
            g = a + 2*(b - 1)
            associate (map => block%map(:, :, g), curvature => block%curvature(:, g), x => position(a), y => position(b))
               !$omp simd private(lane, line)
               do j = 1, block%n
                  lane = j + n_element*(g - 1)
                  line = block%before + j - 1
                  gradient(lane, 1) = r_along_x(j, b)*map(j, 1) + r_along_y(j, a)*map(j, 2)
                  gradient(lane, 2) = r_along_x(j, b)*map(j, 3) + r_along_y(j, a)*map(j, 4)
                  gradient(lane, 3) = z_along_x(j, b)*map(j, 1) + z_along_y(j, a)*map(j, 2)
                  gradient(lane, 4) = z_along_x(j, b)*map(j, 3) + z_along_y(j, a)*map(j, 4)
                  ! Along the edge on the line before, then towards the line after.
                  gradient(lane, 5) = curvature(j)*((1 - x)*r(line, 1) + x*r(line, 2) + y*r_along_y(j, a))
               end do
            end associate
         end do
      end do
   end subroutine get_gradients

   !> Differences of a field across the elements of a ring, in the square of an element.
   pure subroutine differentiate(n, inner, outer, along_x, along_y)
      integer, intent(in) :: n
      !> The field at the nodes of the inner and the outer ring: [0:n].
      real(wp), intent(in) :: inner(0:n), outer(0:n)
      !> Differences along x at y_1 and y_2, and along y at x_1 and x_2: [n_element, 2].
      real(wp), intent(out) :: along_x(n_element, 2), along_y(n_element, 2)
      real(wp) :: before, after, inside, outside
      integer :: j

      !$omp simd private(before, after, inside, outside)
      do j = 1, n
         before = outer(j - 1) - inner(j - 1)
         after = outer(j) - inner(j)
         inside = inner(j) - inner(j - 1)
         outside = outer(j) - outer(j - 1)
         along_x(j, 1) = near*before + far*after
         along_x(j, 2) = far*before + near*after
         along_y(j, 1) = near*inside + far*outside
         along_y(j, 2) = far*inside + near*outside
      end do
   end subroutine differentiate

   !> Adds the forces of first Piola-Kirchhoff stresses on two rings of nodes: minus the derivatives of the strain energy.
   pure subroutine add_nodal_forces(block, last, stress, force_r, force_z)
      type(element_block_type), intent(in) :: block
      !> Index of the last polar line.
      integer, intent(in) :: last
      !> Stresses times volumes of the points, N m: [n_lane, component].
      real(wp), intent(in) :: stress(n_lane, n_component)
      !> Forces outwards on the nodes of the inner and the outer ring, N: [0:n_polar, 2].
      real(wp), intent(inout) :: force_r(0:last, 2)
      !> Forces upwards, N: [0:n_polar, 2].
      real(wp), intent(inout) :: force_z(0:last, 2)
      real(wp), dimension(n_element, 2) :: r_along_x, r_along_y, z_along_x, z_along_y
      real(wp) :: hoop(n_element, 2)
      real(wp) :: radial
      integer :: a, b, g, j, lane

      r_along_x = 0.0_wp
      r_along_y = 0.0_wp
      z_along_x = 0.0_wp
      z_along_y = 0.0_wp
      hoop = 0.0_wp
      do b = 1, 2
         do a = 1, 2
            g = a + 2*(b - 1)
            associate (map => block%map(:, :, g), curvature => block%curvature(:, g), x => position(a), y => position(b))
               !$omp simd private(lane, radial)
               do j = 1, block%n
                  lane = j + n_element*(g - 1)
                  radial = curvature(j)*stress(lane, 5)
                  r_along_x(j, b) = r_along_x(j, b) + stress(lane, 1)*map(j, 1) + stress(lane, 2)*map(j, 3)
                  r_along_y(j, a) = r_along_y(j, a) + stress(lane, 1)*map(j, 2) + stress(lane, 2)*map(j, 4) + y*radial
                  z_along_x(j, b) = z_along_x(j, b) + stress(lane, 3)*map(j, 1) + stress(lane, 4)*map(j, 3)
                  z_along_y(j, a) = z_along_y(j, a) + stress(lane, 3)*map(j, 2) + stress(lane, 4)*map(j, 4)
                  hoop(j, 1) = hoop(j, 1) + (1 - x)*radial
                  hoop(j, 2) = hoop(j, 2) + x*radial
               end do
            end associate
         end do
      end do
      call add_differences(block%n, r_along_x, r_along_y, z_along_x, z_along_y, hoop, force_r(block%before, 1), &
         force_r(block%before, 2), force_z(block%before, 1), force_z(block%before, 2))
   end subroutine add_nodal_forces

   !> Transpose of `differentiate`: subtracts the derivatives of an energy with respect to the positions of the nodes.
   pure subroutine add_differences(n, r_along_x, r_along_y, z_along_x, z_along_y, hoop, inner_r, outer_r, inner_z, outer_z)
      integer, intent(in) :: n
      !> Derivatives of the energy with respect to the differences of r and z, and with respect to r at the first nodes of
      !> the inner and the outer ring: [n_element, 2].
      real(wp), intent(in), dimension(n_element, 2) :: r_along_x, r_along_y, z_along_x, z_along_y, hoop
      !> Forces on the nodes of the inner and the outer ring, N: [0:n].
      real(wp), intent(inout), dimension(0:n) :: inner_r, outer_r, inner_z, outer_z
      integer :: j

      ! Two loops, since neighbors add to the same nodes.
      !$omp simd
      do j = 1, n
         inner_r(j - 1) = inner_r(j - 1) + near*(r_along_x(j, 1) + r_along_y(j, 1)) &
            + far*(r_along_x(j, 2) + r_along_y(j, 2)) - hoop(j, 1)
         outer_r(j - 1) = outer_r(j - 1) - near*(r_along_x(j, 1) - r_along_y(j, 2)) &
            - far*(r_along_x(j, 2) - r_along_y(j, 1)) - hoop(j, 2)
         inner_z(j - 1) = inner_z(j - 1) + near*(z_along_x(j, 1) + z_along_y(j, 1)) &
            + far*(z_along_x(j, 2) + z_along_y(j, 2))
         outer_z(j - 1) = outer_z(j - 1) - near*(z_along_x(j, 1) - z_along_y(j, 2)) &
            - far*(z_along_x(j, 2) - z_along_y(j, 1))
      end do
      !$omp simd
      do j = 1, n
         inner_r(j) = inner_r(j) + near*(r_along_x(j, 2) - r_along_y(j, 1)) + far*(r_along_x(j, 1) - r_along_y(j, 2))
         outer_r(j) = outer_r(j) - near*(r_along_x(j, 2) + r_along_y(j, 2)) - far*(r_along_x(j, 1) + r_along_y(j, 1))
         inner_z(j) = inner_z(j) + near*(z_along_x(j, 2) - z_along_y(j, 1)) + far*(z_along_x(j, 1) - z_along_y(j, 2))
         outer_z(j) = outer_z(j) - near*(z_along_x(j, 2) + z_along_y(j, 2)) - far*(z_along_x(j, 1) + z_along_y(j, 1))
      end do
   end subroutine add_differences

end module thud_element_block
