!> Elements of the transient model: four nodes, four Gauss points, one mean dilatation (Q1P0), which does not lock (Simo,
!> Taylor and Pister 1985, Comput. Methods Appl. Mech. Eng. 51, 177-208).
!>
!> The elements of one ring of the mesh are processed together, one per lane: nothing is gathered or scattered, since
!> neighbors lie side by side in memory. Arithmetic limits the speed, then the first-level cache. General tensors have
!> the components 1 = rr, 2 = rz, 3 = zr, 4 = zz, 5 = hoop; symmetric tensors 1 = rr, 2 = zz, 3 = hoop, 4 = rz.
module thud_element_row
   use thud_constants, only: pi
   use thud_kinds, only: wp
   use thud_mesh, only: mesh_type
   use thud_quadrilateral, only: get_gauss_points, get_shape
   implicit none (type, external)
   private

   public :: add_nodal_forces, element_row_type, get_gradients, new_element_row, n_component, n_point, n_symmetric

   !> Gauss points of an element.
   integer, parameter :: n_point = 4
   !> Components of a deformation gradient.
   integer, parameter :: n_component = 5
   !> Components of a symmetric tensor.
   integer, parameter :: n_symmetric = 4

   !> The elements between two rings of nodes, undeformed.
   type :: element_row_type
      !> Derivatives of the shape functions with respect to r and z, and their values divided by r, 1/m:
      !> [n_element, 3, node 1 to 4, point].
      real(wp), allocatable :: gradient(:, :, :, :)
      !> Volume of each Gauss point, m3: [n_element, point].
      real(wp), allocatable :: weight(:, :)
      !> Volume of each element, m3: [n_element].
      real(wp), allocatable :: volume(:)
      !> Volume that belongs to each node, m3: [n_element, node].
      real(wp), allocatable :: nodal_volume(:, :)
   end type element_row_type

contains

   !> Elements between the rings i and i + 1 of a mesh of order 1. Nodes 1 and 2 lie on the polar
   !> line nearer to the lowest point, 1 and 3 on the inner ring.
   pure function new_element_row(mesh, i) result(row)
      type(mesh_type), intent(in) :: mesh
      !> Index of the inner ring, from 0.
      integer, intent(in) :: i
      type(element_row_type) :: row
      real(wp) :: point(2), weight(2), value(4), slope(4, 2), jacobian(2, 2), inverse(2, 2), r(4), z(4)
      real(wp) :: determinant, radius
      integer :: a, b, g, j

      allocate (row%gradient(mesh%n_polar, 3, 4, n_point), row%weight(mesh%n_polar, n_point))
      allocate (row%volume(mesh%n_polar), row%nodal_volume(mesh%n_polar, 4), source=0.0_wp)
      call get_gauss_points(point, weight)
      do j = 1, mesh%n_polar
         r = reshape(transpose(mesh%r(j - 1:j, i:i + 1)), [4])
         z = reshape(transpose(mesh%z(j - 1:j, i:i + 1)), [4])
         do b = 1, 2
            do a = 1, 2
               g = a + 2*(b - 1)
               call get_shape(1, point(a), point(b), value, slope)
               jacobian(1, :) = matmul(r, slope)
               jacobian(2, :) = matmul(z, slope)
               determinant = jacobian(1, 1)*jacobian(2, 2) - jacobian(1, 2)*jacobian(2, 1)
               inverse = reshape([jacobian(2, 2), -jacobian(2, 1), -jacobian(1, 2), jacobian(1, 1)], [2, 2])/determinant
               radius = dot_product(value, r)
               row%gradient(j, 1:2, :, g) = transpose(matmul(slope, inverse))
               row%gradient(j, 3, :, g) = value/radius
               row%weight(j, g) = 2*pi*radius*abs(determinant)*weight(a)*weight(b)
               row%volume(j) = row%volume(j) + row%weight(j, g)
               row%nodal_volume(j, :) = row%nodal_volume(j, :) + row%weight(j, g)*value
            end do
         end do
      end do
   end function new_element_row

   !> Gradients of a vector field at all Gauss points: F if the field holds positions, the rate of F if it holds velocities.
   pure subroutine get_gradients(row, n, r, z, gradient)
      type(element_row_type), intent(in) :: row
      !> Number of elements.
      integer, intent(in) :: n
      !> First component at the nodes of the inner and the outer ring: [0:n, 2].
      real(wp), intent(in) :: r(0:n, 2)
      !> Second component: [0:n, 2].
      real(wp), intent(in) :: z(0:n, 2)
      !> The gradients: [n, component, point].
      real(wp), intent(out) :: gradient(n, n_component, n_point)
      integer :: g, j

      do g = 1, n_point
         associate (shape => row%gradient(:, :, :, g))
            !$omp simd
            do j = 1, n
               gradient(j, 1, g) = r(j - 1, 1)*shape(j, 1, 1) + r(j - 1, 2)*shape(j, 1, 2) &
                  + r(j, 1)*shape(j, 1, 3) + r(j, 2)*shape(j, 1, 4)
               gradient(j, 2, g) = r(j - 1, 1)*shape(j, 2, 1) + r(j - 1, 2)*shape(j, 2, 2) &
                  + r(j, 1)*shape(j, 2, 3) + r(j, 2)*shape(j, 2, 4)
               gradient(j, 3, g) = z(j - 1, 1)*shape(j, 1, 1) + z(j - 1, 2)*shape(j, 1, 2) &
                  + z(j, 1)*shape(j, 1, 3) + z(j, 2)*shape(j, 1, 4)
               gradient(j, 4, g) = z(j - 1, 1)*shape(j, 2, 1) + z(j - 1, 2)*shape(j, 2, 2) &
                  + z(j, 1)*shape(j, 2, 3) + z(j, 2)*shape(j, 2, 4)
               gradient(j, 5, g) = r(j - 1, 1)*shape(j, 3, 1) + r(j - 1, 2)*shape(j, 3, 2) &
                  + r(j, 1)*shape(j, 3, 3) + r(j, 2)*shape(j, 3, 4)
            end do
         end associate
      end do
   end subroutine get_gradients

   !> Adds the forces of first Piola-Kirchhoff stresses on two rings of nodes: minus the derivatives of the strain energy.
   pure subroutine add_nodal_forces(row, n, stress, force_r, force_z)
      type(element_row_type), intent(in) :: row
      !> Number of elements.
      integer, intent(in) :: n
      !> Stresses, Pa: [n, component, point].
      real(wp), intent(in) :: stress(n, n_component, n_point)
      !> Forces outwards on the nodes of the inner and the outer ring, N: [0:n, 2].
      real(wp), intent(inout) :: force_r(0:n, 2)
      !> Forces upwards, N: [0:n, 2].
      real(wp), intent(inout) :: force_z(0:n, 2)
      real(wp) :: outwards(n), upwards(n)
      integer :: a, g, j, line, ring

      do a = 1, 4
         outwards = 0.0_wp
         upwards = 0.0_wp
         do g = 1, n_point
            associate (shape => row%gradient(:, :, a, g), weight => row%weight(:, g))
               !$omp simd
               do j = 1, n
                  outwards(j) = outwards(j) + weight(j)*(stress(j, 1, g)*shape(j, 1) + stress(j, 2, g)*shape(j, 2) &
                     + stress(j, 5, g)*shape(j, 3))
                  upwards(j) = upwards(j) + weight(j)*(stress(j, 3, g)*shape(j, 1) + stress(j, 4, g)*shape(j, 2))
               end do
            end associate
         end do
         ring = merge(2, 1, mod(a, 2) == 0)
         line = merge(1, 0, a > 2)
         force_r(line:n - 1 + line, ring) = force_r(line:n - 1 + line, ring) - outwards
         force_z(line:n - 1 + line, ring) = force_z(line:n - 1 + line, ring) - upwards
      end do
   end subroutine add_nodal_forces

end module thud_element_row
