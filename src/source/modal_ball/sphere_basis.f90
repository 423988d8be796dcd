!> Polynomials through the wall of a hollow sphere and the integrals of their products, from which
!> `thud_sphere_modes` puts the modes of every harmonic together.
!>
!> Galerkin's method with Legendre polynomials in r; all integrals over the sphere are exact. With
!> W = r div u the meridional displacement is V = (r U' + 2 U - W)/(n (n + 1)): the unknowns are U
!> and W, incompressible material (nu = 1/2) is W = 0, and nearly incompressible material does not
!> lock. Strain energy and kinetic energy become sums of Gram matrices that do not depend on n.
module thud_sphere_basis
   use thud_ball, only: ball_type, get_density
   use thud_constants, only: pi
   use thud_kinds, only: wp
   use thud_legendre, only: get_gauss_legendre, get_legendre
   implicit none (type, external)
   private

   public :: basis_type, get_degree, integrate, new_basis

   !> Distance of Poisson's ratio from 1/2 within which material is incompressible: beyond it the
   !> compressible energy would drown the others in rounding, and modes differ by as little.
   real(wp), parameter :: incompressible_distance = 1.0e-7_wp

   !> Gram matrices of the basis, the same for every harmonic.
   type :: basis_type
      !> Outer radius, m.
      real(wp) :: outer_radius
      !> Inner radius, m.
      real(wp) :: inner_radius
      !> Density, kg/m3.
      real(wp) :: density
      !> Shear modulus, Pa.
      real(wp) :: shear_modulus
      !> First Lame constant, Pa; not used for incompressible material.
      real(wp) :: lame = 0.0_wp
      !> The material is incompressible: W = 0.
      logical :: incompressible
      !> Stiffness of the enclosed gas against its change of volume, Pa/m3.
      real(wp) :: gas_stiffness
      !> Radii of the quadrature, m: [n_node].
      real(wp), allocatable :: radius(:)
      !> Weights of the quadrature, m: [n_node].
      real(wp), allocatable :: weight(:)
      !> Polynomials and two derivatives at the radii: [n_node, degree + 1, 3].
      real(wp), allocatable :: polynomial(:, :, :)
      !> Polynomials and two derivatives at the outer and at the inner radius: [2, degree + 1, 3].
      real(wp), allocatable :: at_end(:, :, :)
      !> Terms of energies by their power of n (n + 1), see `new_basis`: [n, n, 5] with n up to
      !> 2 (degree + 1).
      real(wp), allocatable :: gram(:, :, :)
   end type basis_type

contains

   !> Basis for all harmonics up to a highest one.
   function new_basis(ball, highest_harmonic, with_gas) result(basis)
      !> The ball.
      type(ball_type), intent(in) :: ball
      !> Highest harmonic that will be asked for.
      integer, intent(in) :: highest_harmonic
      !> The enclosed gas resists changes of its volume.
      logical, intent(in) :: with_gas
      !> The basis.
      type(basis_type) :: basis
      real(wp), allocatable :: node(:)
      integer :: degree, n, i

      basis%outer_radius = ball%outer_radius
      basis%inner_radius = ball%outer_radius - ball%wall_thickness
      basis%density = get_density(ball)
      basis%shear_modulus = ball%youngs_modulus/(2*(1 + ball%poisson_ratio))
      basis%incompressible = 0.5_wp - ball%poisson_ratio < incompressible_distance
      if (.not. basis%incompressible) then
         basis%lame = 2*basis%shear_modulus*ball%poisson_ratio/(1 - 2*ball%poisson_ratio)
      end if
      basis%gas_stiffness = 0.0_wp
      if (with_gas) basis%gas_stiffness = ball%heat_capacity_ratio*(ball%ambient_pressure + ball%gauge_pressure) &
         /(4.0_wp/3.0_wp*pi*basis%inner_radius**3)

      degree = get_degree(basis, highest_harmonic)
      n = degree + 1
      allocate (node(degree + 6), basis%weight(degree + 6))
      call get_gauss_legendre(node, basis%weight)
      basis%radius = (basis%outer_radius + basis%inner_radius + ball%wall_thickness*node)/2
      basis%weight = basis%weight*ball%wall_thickness/2
      allocate (basis%polynomial(size(node), n, 3), basis%at_end(2, n, 3))
      do i = 1, size(node)
         call get_legendre(node(i), basis%polynomial(i, :, 1), basis%polynomial(i, :, 2), basis%polynomial(i, :, 3))
      end do
      call get_legendre(1.0_wp, basis%at_end(1, :, 1), basis%at_end(1, :, 2), basis%at_end(1, :, 3))
      call get_legendre(-1.0_wp, basis%at_end(2, :, 1), basis%at_end(2, :, 2), basis%at_end(2, :, 3))
      do i = 2, 3
         basis%polynomial(:, :, i) = basis%polynomial(:, :, i)*(2/ball%wall_thickness)**(i - 1)
         basis%at_end(:, :, i) = basis%at_end(:, :, i)*(2/ball%wall_thickness)**(i - 1)
      end do

      call set_gram(basis, n)
   end function new_basis

   !> Gram matrices of the strain and kinetic energies.
   subroutine set_gram(basis, n)
      !> The basis, its polynomials set.
      type(basis_type), intent(inout) :: basis
      !> Number of polynomials.
      integer, intent(in) :: n
      real(wp), dimension(size(basis%radius), 2*n) :: u, u_slope, d, e, w
      integer :: power

      ! Columns for U, then for W: U, r U', D = n (n + 1) V, E = n (n + 1) (r V' - V), W.
      associate (r => spread(basis%radius, 2, n), p => basis%polynomial, zero => 0*basis%polynomial(:, :, 1))
         u = reshape([p(:, :, 1), zero], shape(u))
         u_slope = reshape([r*p(:, :, 2), zero], shape(u))
         d = reshape([r*p(:, :, 2) + 2*p(:, :, 1), -p(:, :, 1)], shape(u))
         e = reshape([r*(3*p(:, :, 2) + r*p(:, :, 3)) - r*p(:, :, 2) - 2*p(:, :, 1), &
            p(:, :, 1) - r*p(:, :, 2)], shape(u))
         w = reshape([zero, p(:, :, 1)], shape(u))
      end associate
      ! With L = n (n + 1) the strain energy of r^2 e:e is
      ! (rU')^2 + 2U^2 - 2UD + (1 - 1/L) D^2 + (L U^2 + 2 U E + E^2/L)/2.
      allocate (basis%gram(2*n, 2*n, 5))
      associate (mu2 => 2*basis%shear_modulus, weight => basis%weight)
         basis%gram(:, :, 1) = mu2*(integrate(weight, u_slope, u_slope) + 2*integrate(weight, u, u) - mixed(weight, u, d) &
            + integrate(weight, d, d) + mixed(weight, u, e)/2) + basis%lame*integrate(weight, w, w)
         basis%gram(:, :, 2) = mu2*integrate(weight, u, u)/2
         basis%gram(:, :, 3) = mu2*(integrate(weight, e, e)/2 - integrate(weight, d, d))
      end associate
      associate (r => spread(basis%radius, 2, 2*n), weight => basis%weight)
         basis%gram(:, :, 4) = basis%density*integrate(weight, r*u, r*u)
         basis%gram(:, :, 5) = basis%density*integrate(weight, r*d, r*d)
      end associate
      do power = 1, 5
         basis%gram(:, :, power) = (basis%gram(:, :, power) + transpose(basis%gram(:, :, power)))/2
      end do
   end subroutine set_gram

   !> Integrals of the products of columns.
   pure function integrate(weight, a, b) result(matrix)
      !> Weights of the quadrature, m: [n_node].
      real(wp), intent(in) :: weight(:)
      !> Values at the radii: [n_node, n].
      real(wp), intent(in) :: a(:, :)
      !> Values at the radii: [n_node, n].
      real(wp), intent(in) :: b(:, :)
      !> The integrals: [n, n].
      real(wp) :: matrix(size(a, 2), size(b, 2))

      matrix = matmul(transpose(a), spread(weight, 2, size(b, 2))*b)
   end function integrate

   !> `integrate` both ways.
   pure function mixed(weight, a, b) result(matrix)
      !> Weights of the quadrature, m: [n_node].
      real(wp), intent(in) :: weight(:)
      !> Values at the radii: [n_node, n].
      real(wp), intent(in) :: a(:, :)
      !> Values at the radii: [n_node, n].
      real(wp), intent(in) :: b(:, :)
      !> The integrals: [n, n].
      real(wp) :: matrix(size(a, 2), size(a, 2))

      matrix = integrate(weight, a, b) + integrate(weight, b, a)
   end function mixed

   !> Degree of the polynomials that resolve a harmonic: its modes fall off like r^n, which takes
   !> a degree in proportion to the root of the exponent; the tests hold it against higher ones.
   pure function get_degree(basis, harmonic) result(degree)
      !> The basis, its radii set.
      type(basis_type), intent(in) :: basis
      !> The harmonic.
      integer, intent(in) :: harmonic
      !> Degree.
      integer :: degree

      degree = 10 + ceiling(2.4_wp*sqrt(harmonic*log(basis%outer_radius/basis%inner_radius)))
   end function get_degree

end module thud_sphere_basis
