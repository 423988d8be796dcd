!> Stiffness and mass of an axisymmetric element with nine nodes for the displacement and a linear, discontinuous pressure:
!> stable up to Poisson's ratio 1/2 (Boffi, Brezzi and Fortin, Mixed finite element methods and applications, 2013, section
!> 8.6).
!>
!> The pressure is condensed in each element; its energy is bulk_modulus/2 times the sum of squares of three mean
!> dilatations. At Poisson's ratio 1/2 these vanish; see `thud_mode_matrices`.
module thud_mixed_element
   use thud_constants, only: pi
   use thud_kinds, only: wp
   use thud_lapack, only: dpotrf, dsyrk, dtrsm
   use thud_quadrilateral, only: get_gauss_points, get_shape
   implicit none (type, external)
   private

   public :: get_mixed_element, n_dilatation, n_node

   !> Nodes of the element.
   integer, parameter :: n_node = 9
   !> Mean dilatations: one for each function of the pressure, 1, r and z.
   integer, parameter :: n_dilatation = 3
   !> Gauss points in each direction and in total.
   integer, parameter :: n_line = 3, n_point = n_line**2

contains

   !> Matrices of one element. Displacements are ordered u_r, u_z of the first node, then the next.
   pure subroutine get_mixed_element(r, z, shear_modulus, density, distortion, dilatation, mass)
      !> Distances of the nodes from the axis, m: [9].
      real(wp), intent(in) :: r(n_node)
      !> Heights of the nodes, m: [9].
      real(wp), intent(in) :: z(n_node)
      !> Shear modulus, Pa; density, kg/m3.
      real(wp), intent(in) :: shear_modulus, density
      !> Stiffness against distortion at constant volume, N/m, lower triangle: [18, 18].
      real(wp), intent(out) :: distortion(2*n_node, 2*n_node)
      !> Mean dilatations per displacement, sqrt(m); bulk_modulus*transpose(dilatation)*dilatation is the stiffness against
      !> change of volume: [3, 18].
      real(wp), intent(out) :: dilatation(n_dilatation, 2*n_node)
      !> Mass for pairs of nodes, the same for both directions, kg, lower triangle: [9, 9].
      real(wp), intent(out) :: mass(n_node, n_node)
      real(wp) :: strain(4*n_point, 2*n_node), shape(n_point, n_node), gram(n_dilatation, n_dilatation)
      real(wp) :: point(n_line), weight(n_line), value(n_node), gradient(n_node, 2), jacobian(2, 2)
      real(wp) :: determinant, radius, volume
      real(wp) :: divergence(2*n_node), hoop(n_node), basis(n_dilatation)
      integer :: i, j, k, info

      call get_gauss_points(point, weight)
      dilatation = 0.0_wp
      gram = 0.0_wp
      do j = 1, n_line
         do i = 1, n_line
            k = i + n_line*(j - 1)
            call get_shape(2, point(i), point(j), value, gradient)
            jacobian(1, :) = matmul(r, gradient)
            jacobian(2, :) = matmul(z, gradient)
            determinant = jacobian(1, 1)*jacobian(2, 2) - jacobian(1, 2)*jacobian(2, 1)
            gradient = matmul(gradient, reshape([jacobian(2, 2), -jacobian(1, 2), -jacobian(2, 1), jacobian(1, 1)], &
               [2, 2], order=[2, 1]))/determinant
            radius = dot_product(value, r)
            volume = 2*pi*radius*abs(determinant)*weight(i)*weight(j)
            hoop = value/radius
            divergence(1::2) = gradient(:, 1) + hoop
            divergence(2::2) = gradient(:, 2)
            strain(4*k - 3:4*k, :) = get_distortion(sqrt(2*shear_modulus*volume), gradient, hoop, divergence)
            shape(k, :) = sqrt(density*volume)*value
            ! Coordinates relative to the size of the element keep the functions of the pressure well conditioned.
            basis = [1.0_wp, (radius - r(5))/(maxval(r) - minval(r)), &
               (dot_product(value, z) - z(5))/(maxval(z) - minval(z))]
            gram = gram + volume*spread(basis, 1, 3)*spread(basis, 2, 3)
            dilatation = dilatation + volume*spread(basis, 2, 2*n_node)*spread(divergence, 1, n_dilatation)
         end do
      end do
      call dsyrk('L', 'T', 2*n_node, 4*n_point, 1.0_wp, strain, 4*n_point, 0.0_wp, distortion, 2*n_node)
      call dsyrk('L', 'T', n_node, n_point, 1.0_wp, shape, n_point, 0.0_wp, mass, n_node)
      call dpotrf('L', n_dilatation, gram, n_dilatation, info)
      call dtrsm('L', 'L', 'N', 'N', n_dilatation, 2*n_node, 1.0_wp, gram, n_dilatation, dilatation, n_dilatation)
   end subroutine get_mixed_element

   !> Strains per displacement at one point: three stretches minus their mean, and the shear. Their squares add up to twice
   !> the energy of distortion.
   pure function get_distortion(root, gradient, hoop, divergence) result(strain)
      !> Root of twice the shear modulus times the volume, sqrt(J).
      real(wp), intent(in) :: root
      !> Derivatives of the shape functions with respect to r and z, 1/m: [9, 2].
      real(wp), intent(in) :: gradient(n_node, 2)
      !> Hoop strain per outward displacement, 1/m: [9].
      real(wp), intent(in) :: hoop(n_node)
      !> Dilatation per displacement, 1/m: [18].
      real(wp), intent(in) :: divergence(2*n_node)
      !> Strains times the root, sqrt(J)/m: [4, 18].
      real(wp) :: strain(4, 2*n_node)

      strain(:3, :) = spread(-root/3*divergence, 1, 3)
      strain(1, 1::2) = strain(1, 1::2) + root*gradient(:, 1)
      strain(2, 2::2) = strain(2, 2::2) + root*gradient(:, 2)
      strain(3, 1::2) = strain(3, 1::2) + root*hoop
      strain(4, 1::2) = root/sqrt(2.0_wp)*gradient(:, 2)
      strain(4, 2::2) = root/sqrt(2.0_wp)*gradient(:, 1)
   end function get_distortion

end module thud_mixed_element
