!> Axisymmetric modes of a free hollow sphere without twist: displacements U(r) P_n(cos t) along
!> the radius and V(r) dP_n/dt along the meridian, t the angle from the pole.
!>
!> Galerkin's method with Legendre polynomials in r; all integrals over the sphere are exact. With W = r div u the meridional
!> displacement is V = (r U' + 2 U - W)/(n (n + 1)): the unknowns are U and W, W = 0 is incompressible material (nu = 1/2),
!> and nearly incompressible material does not lock. Strain energy and kinetic energy become sums of Gram matrices that do
!> not depend on n.
module thud_sphere_modes
   use thud_ball, only: ball_type, get_density
   use thud_constants, only: pi
   use thud_error, only: error_type, numerical_error
   use thud_interrupt, only: check_interrupt
   use thud_kinds, only: wp
   use thud_lapack, only: dgemm, dgetf2, dgetrs, dposv, dsygvx
   use thud_legendre, only: get_gauss_legendre, get_legendre
   use thud_text, only: fixed, to_text
   implicit none (type, external)
   private

   public :: basis_type, family_type, get_displacements, get_families, get_family, get_flexibility, get_modes
   public :: limit_family, new_basis

   !> Distance of Poisson's ratio from 1/2 below which the material counts as incompressible. The modes differ from those of
   !> incompressible material by about this distance.
   real(wp), parameter :: incompressible_distance = 1.0e-12_wp

   !> Minimum degree of the polynomials, and the part of the degree that resolves the ends of waves across the wall.
   integer, parameter :: min_degree = 10, end_degree = 4

   !> Maximum wavenumber of shear waves times outer radius: some hundred harmonics, whose modes take minutes.
   real(wp), parameter :: max_waves = 600.0_wp

   !> Bound of the harmonics that have modes: bending waves of a wall of 1e-3 of the radius have 1440 at that wavenumber.
   integer, parameter :: max_harmonic = 4000

   !> Gram matrices of the basis, the same for every harmonic.
   type :: basis_type
      !> Outer and inner radius, m.
      real(wp) :: outer_radius, inner_radius
      !> Density, kg/m3.
      real(wp) :: density
      !> Shear modulus, Pa.
      real(wp) :: shear_modulus
      !> First Lame constant, Pa; not used for incompressible material.
      real(wp) :: lame = 0.0_wp
      !> Whether the material is incompressible: W = 0.
      logical :: incompressible
      !> Stiffness of the enclosed gas against its change of volume, Pa/m3.
      real(wp) :: gas_stiffness = 0.0_wp
      !> Radii and weights of the quadrature, m: [n_node].
      real(wp), allocatable :: radius(:), weight(:)
      !> Polynomials and two derivatives at the radii: [n_node, degree + 1, 3].
      real(wp), allocatable :: polynomial(:, :, :)
      !> Degree beyond that which the contact needs.
      integer :: extra_degree = 0
      !> Wavenumbers of shear and of compression waves at the highest frequency, 1/m.
      real(wp) :: shear_wavenumber = 0.0_wp, compression_wavenumber = 0.0_wp
      !> Terms of the energies by their power of n (n + 1), see `set_gram`: [n_unknown, n_unknown, 5].
      real(wp), allocatable :: gram(:, :, :)
   end type basis_type

   !> Modes of one harmonic, as far as the contact needs them.
   type :: family_type
      !> Angular frequencies, ascending, without the rigid mode, rad/s: [n_mode].
      real(wp), allocatable :: omega(:)
      !> U and V at the outer surface for modes of unit modal mass, 1/sqrt(kg): [2, n_mode].
      real(wp), allocatable :: surface(:, :)
      !> Static flexibility of the modes left out: U and V at the outer surface due to unit generalized forces on U and V,
      !> m/N: [2, 2].
      real(wp) :: flexibility(2, 2) = 0.0_wp
   end type family_type

contains

   !> Basis for all harmonics up to a highest one.
   function new_basis(ball, highest_harmonic, with_gas, highest_omega, extra_degree) result(basis)
      type(ball_type), intent(in) :: ball
      !> Highest harmonic that will be used.
      integer, intent(in) :: highest_harmonic
      !> Whether the enclosed gas resists changes of its volume.
      logical, intent(in) :: with_gas
      !> Highest angular frequency of modes that will be used, rad/s (default: no modes).
      real(wp), intent(in), optional :: highest_omega
      !> Degree beyond that which the contact needs (default: 0).
      integer, intent(in), optional :: extra_degree
      type(basis_type) :: basis
      real(wp), allocatable :: node(:)
      integer :: degree, n, i

      basis%outer_radius = ball%outer_radius
      basis%inner_radius = ball%outer_radius - ball%wall_thickness
      basis%density = get_density(ball)
      basis%shear_modulus = ball%youngs_modulus/(2*(1 + ball%poisson_ratio))
      basis%incompressible = 0.5_wp - ball%poisson_ratio < incompressible_distance
      if (.not. basis%incompressible) basis%lame = 2*basis%shear_modulus*ball%poisson_ratio/(1 - 2*ball%poisson_ratio)
      if (with_gas) basis%gas_stiffness = ball%heat_capacity_ratio*(ball%ambient_pressure + ball%gauge_pressure) &
         /(4.0_wp/3.0_wp*pi*basis%inner_radius**3)
      if (present(extra_degree)) basis%extra_degree = extra_degree
      if (present(highest_omega)) then
         basis%shear_wavenumber = highest_omega*sqrt(basis%density/basis%shear_modulus)
         basis%compression_wavenumber = highest_omega*sqrt(basis%density/(basis%lame + 2*basis%shear_modulus))
      end if
      degree = maxval([(get_degree(basis, i, basis%shear_wavenumber), i=0, highest_harmonic)])
      n = degree + 1
      allocate (node(degree + 6), basis%weight(degree + 6))
      call get_gauss_legendre(node, basis%weight)
      basis%radius = (basis%outer_radius + basis%inner_radius + ball%wall_thickness*node)/2
      basis%weight = basis%weight*ball%wall_thickness/2
      allocate (basis%polynomial(size(node), n, 3))
      do i = 1, size(node)
         call get_legendre(node(i), basis%polynomial(i, :, 1), basis%polynomial(i, :, 2), basis%polynomial(i, :, 3))
      end do
      do i = 2, 3
         basis%polynomial(:, :, i) = basis%polynomial(:, :, i)*(2/ball%wall_thickness)**(i - 1)
      end do
      call set_gram(basis, n)
   end function new_basis

   !> Gram matrices of the strain and kinetic energies.
   subroutine set_gram(basis, n)
      !> The basis; its polynomials are set.
      type(basis_type), intent(inout) :: basis
      !> Number of polynomials.
      integer, intent(in) :: n
      real(wp), dimension(:, :), allocatable :: u, u_slope, d, e, w
      integer :: n_unknown, power

      n_unknown = merge(n, 2*n, basis%incompressible)
      allocate (u(size(basis%radius), n_unknown), source=0.0_wp)
      allocate (u_slope, d, e, w, mold=u)
      u_slope = 0.0_wp
      w = 0.0_wp
      ! Columns for U, then for W: U, r U', D = n (n + 1) V, E = n (n + 1) (r V' - V), W.
      associate (r => spread(basis%radius, 2, n), p => basis%polynomial)
         u(:, :n) = p(:, :, 1)
         u_slope(:, :n) = r*p(:, :, 2)
         d(:, :n) = r*p(:, :, 2) + 2*p(:, :, 1)
         e(:, :n) = r*(3*p(:, :, 2) + r*p(:, :, 3)) - r*p(:, :, 2) - 2*p(:, :, 1)
         if (n_unknown > n) then
            d(:, n + 1:) = -p(:, :, 1)
            e(:, n + 1:) = p(:, :, 1) - r*p(:, :, 2)
            w(:, n + 1:) = p(:, :, 1)
         end if
      end associate
      ! With L = n (n + 1) and the strain tensor e, the integral of r^2 e:e over the unit sphere, divided by that of P_n^2,
      ! is (rU')^2 + 2U^2 - 2UD + (1 - 1/L) D^2 + (L U^2 + 2 U E + E^2/L)/2.
      allocate (basis%gram(n_unknown, n_unknown, 5))
      associate (mu2 => 2*basis%shear_modulus)
         basis%gram(:, :, 1) = mu2*(product_of(u_slope, u_slope) + product_of(u, u) + product_of(u - d, u - d) &
            + product_of(u, e)) + basis%lame*product_of(w, w)
         basis%gram(:, :, 2) = mu2*product_of(u, u)/2
         basis%gram(:, :, 3) = mu2*(product_of(e, e)/2 - product_of(d, d))
      end associate
      associate (r => spread(basis%radius, 2, n_unknown))
         basis%gram(:, :, 4) = basis%density*product_of(r*u, r*u)
         basis%gram(:, :, 5) = basis%density*product_of(r*d, r*d)
      end associate
      do power = 1, 5
         basis%gram(:, :, power) = (basis%gram(:, :, power) + transpose(basis%gram(:, :, power)))/2
      end do

   contains

      !> Integrals over the wall of products of columns: [n_unknown, n_unknown].
      function product_of(a, b) result(matrix)
         !> Values at the radii: [n_node, n_unknown].
         real(wp), intent(in) :: a(:, :), b(:, :)
         real(wp) :: matrix(size(a, 2), size(b, 2))

         associate (n_node => size(a, 1), weighted => spread(basis%weight, 2, size(b, 2))*b)
            call dgemm('T', 'N', n_unknown, n_unknown, n_node, 1.0_wp, a, n_node, weighted, n_node, 0.0_wp, matrix, &
               n_unknown)
         end associate
      end function product_of

   end subroutine set_gram

   !> Degree of the polynomials that resolves a harmonic. Its modes fall off like r^n, which needs a degree proportional to
   !> sqrt(n ln(outer/inner radius)); the tests compare this degree with higher ones.
   !>
   !> Where a wave of the wavenumber k oscillates along the radius, its radial wavenumber is sqrt(k^2 - n (n + 1)/r^2). A
   !> polynomial of degree d oscillates with up to d/sqrt((R - r)(r - R_i)) between the outer and the inner radius.
   pure function get_degree(basis, harmonic, wavenumber) result(degree)
      !> The basis; its radii are set.
      type(basis_type), intent(in) :: basis
      integer, intent(in) :: harmonic
      !> Wavenumber at the highest frequency, 1/m.
      real(wp), intent(in) :: wavenumber
      integer :: degree
      integer, parameter :: n_radius = 16
      real(wp) :: oscillations, r
      integer :: i

      oscillations = 0.0_wp
      associate (outer => basis%outer_radius, inner => basis%inner_radius)
         do i = 1, n_radius - 1
            r = inner + (outer - inner)*i/n_radius
            oscillations = max(oscillations, (wavenumber**2 - harmonic*(harmonic + 1)/r**2)*(outer - r)*(r - inner))
         end do
         degree = basis%extra_degree + max(min_degree, end_degree + ceiling(sqrt(oscillations))) &
            + ceiling(2.4_wp*sqrt(harmonic*log(outer/inner)))
      end associate
   end function get_degree

   !> The modes up to a frequency of all harmonics that have any.
   subroutine get_families(ball, with_gas, highest_omega, families, error)
      type(ball_type), intent(in) :: ball
      !> Whether the enclosed gas resists changes of its volume.
      logical, intent(in) :: with_gas
      !> Highest angular frequency to keep, rad/s.
      real(wp), intent(in) :: highest_omega
      !> The modes, and their flexibilities: [0:highest harmonic].
      type(family_type), allocatable, intent(out) :: families(:)
      !> Set if the modes cannot be computed.
      type(error_type), allocatable, intent(out) :: error
      type(family_type), allocatable :: all(:)
      type(basis_type) :: basis
      real(wp) :: wavenumber
      integer :: n, highest

      wavenumber = highest_omega*sqrt(get_density(ball)*2*(1 + ball%poisson_ratio)/ball%youngs_modulus)
      if (.not. wavenumber*ball%outer_radius <= max_waves) then
         error = numerical_error('the ball has too many modes up to '//fixed(highest_omega/(2*pi), 0)//' Hz; allowed: a ' &
            //'stiffer or smaller ball, or a lower highest_frequency', 'modal_ball')
         return
      end if
      ! Surface waves of this frequency; bending waves of thin walls are slower.
      highest = 4 + ceiling(1.1_wp*wavenumber*ball%outer_radius)
      basis = new_basis(ball, highest, with_gas, highest_omega)
      allocate (all(0:max_harmonic))
      do n = 0, max_harmonic
         call check_interrupt(error)
         if (allocated(error)) return
         if (n > highest) then
            highest = 2*n
            basis = new_basis(ball, highest, with_gas, highest_omega)
         end if
         call get_family(basis, n, highest_omega, all(n), error)
         if (allocated(error)) return
         ! From n = 2 on the lowest frequencies of the harmonics increase.
         if (n >= 2 .and. size(all(n)%omega) == 0) exit
      end do
      n = min(n, max_harmonic)
      allocate (families(0:n), source=all(:n))
   end subroutine get_families

   !> Leaves out the modes above a frequency; their flexibility remains.
   pure subroutine limit_family(highest_omega, family)
      !> Highest angular frequency to keep, rad/s.
      real(wp), intent(in) :: highest_omega
      type(family_type), intent(inout) :: family
      integer :: k, n_mode

      n_mode = count(family%omega <= highest_omega)
      do k = n_mode + 1, size(family%omega)
         family%flexibility = family%flexibility + outer(family%surface(:, k))/family%omega(k)**2
      end do
      family%omega = family%omega(:n_mode)
      family%surface = family%surface(:, :n_mode)
   end subroutine limit_family

   !> The modes of one harmonic up to a frequency, and the flexibility of all other modes.
   subroutine get_family(basis, harmonic, highest_omega, family, error)
      type(basis_type), intent(in) :: basis
      !> Harmonic n.
      integer, intent(in) :: harmonic
      !> Highest angular frequency to keep, rad/s.
      real(wp), intent(in) :: highest_omega
      type(family_type), intent(out) :: family
      !> Set if the modes cannot be computed.
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: coefficient(:, :)
      integer :: k

      call get_flexibility(basis, harmonic, family%flexibility, error)
      if (.not. allocated(error)) call get_modes(basis, harmonic, highest_omega, family%omega, coefficient, error)
      if (allocated(error)) return
      family%surface = matmul(sum(get_displacements(basis, harmonic, [1.0_wp]), dim=2), coefficient)
      do k = 1, size(family%omega)
         family%flexibility = family%flexibility - outer(family%surface(:, k))/family%omega(k)**2
      end do
   end subroutine get_family

   !> The elastic modes of one harmonic up to a frequency. The largest eigenvalues of mass over stiffness lose no digits to
   !> the energies of compression and of thin walls, which are much larger than those of the lowest modes.
   subroutine get_modes(basis, harmonic, highest_omega, omega, coefficient, error)
      type(basis_type), intent(in) :: basis
      !> Harmonic n.
      integer, intent(in) :: harmonic
      !> Highest angular frequency to keep, rad/s.
      real(wp), intent(in) :: highest_omega
      !> Angular frequencies, ascending, rad/s: [n_mode].
      real(wp), allocatable, intent(out) :: omega(:)
      !> Coefficients of the functions for modes of unit modal mass, 1/sqrt(kg): [n, n_mode].
      real(wp), allocatable, intent(out) :: coefficient(:, :)
      !> Set if the eigenproblem cannot be solved.
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: stiffness(:, :), mass(:, :), momentum(:), inverse(:), shape(:, :), work(:)
      integer, allocatable :: iwork(:), unconverged(:)
      integer :: n, n_mode, info

      call assemble(basis, harmonic, stiffness, mass, momentum)
      n = size(stiffness, 1)
      allocate (inverse(n), shape(n, n), work(34*n), iwork(5*n), unconverged(n))
      call dsygvx(1, 'V', 'V', 'L', n, mass, n, stiffness, n, 1/highest_omega**2, huge(1.0_wp), 0, 0, 0.0_wp, n_mode, &
         inverse, shape, n, work, size(work), iwork, unconverged, info)
      if (info /= 0) error = harmonic_error('modes', harmonic)
      if (allocated(error)) return
      omega = 1/sqrt(inverse(n_mode:1:-1))
      shape(:, :n_mode) = shape(:, n_mode:1:-1)*spread(omega, 1, n)
      coefficient = shape(:, :n_mode)
      if (harmonic == 1) coefficient = reshape([-matmul(momentum, coefficient), transpose(coefficient)], [n + 1, n_mode], &
         order=[2, 1])
   end subroutine get_modes

   !> Flexibility of a harmonic, without the rigid mode of n = 1; below n = 2 by the basis, from there in closed form (Lur'e,
   !> Theory of Elasticity, Springer 2005, section 5.1): four solutions of the static equations with U = a r^m, V = b r^m,
   !> and the tractions 2 mu c r^(m-1), 2 mu d r^(m-1).
   subroutine get_flexibility(basis, harmonic, flexibility, error)
      type(basis_type), intent(in) :: basis
      integer, intent(in) :: harmonic
      !> U and V at the outer surface due to unit generalized forces on U and V, m/N: [2, 2].
      real(wp), intent(out) :: flexibility(2, 2)
      !> Set if the stiffness is singular, or the solutions cannot be distinguished.
      type(error_type), allocatable, intent(out) :: error
      real(wp), dimension(4) :: a, b, c, d, inner, at_outer
      real(wp) :: matrix(4, 4), right(4, 2)
      real(wp), allocatable :: stiffness(:, :), mass(:, :), surface(:, :), solution(:, :), momentum(:)
      real(wp) :: n, nu
      integer :: pivot(4)
      integer :: info

      if (harmonic < 2) then
         call assemble(basis, harmonic, stiffness, mass, momentum)
         associate (n_function => size(stiffness, 1))
            surface = sum(get_displacements(basis, harmonic, [1.0_wp]), dim=2)
            if (harmonic == 1) surface = surface(:, 2:) - spread(surface(:, 1), 2, n_function)*spread(momentum, 1, 2)
            solution = transpose(surface)
            call dposv('L', n_function, 2, stiffness, n_function, solution, n_function, info)
         end associate
         if (info /= 0) error = harmonic_error('flexibility', harmonic)
         flexibility = matmul(surface, solution)
         return
      end if
      n = real(harmonic, wp)
      nu = 0.5_wp
      if (.not. basis%incompressible) nu = basis%lame/(2*(basis%lame + basis%shear_modulus))
      ! Solutions with r^(n+1), r^(n-1), r^(-n), r^(-n-2); radii relative to the outer one, the last two to the inner one.
      a = [(n + 1)*(n - 2 + 4*nu), n, n*(n + 3 - 4*nu), -(n + 1)]
      b = [n + 5 - 4*nu, 1.0_wp, 4 - 4*nu - n, 1.0_wp]
      c = [(n + 1)*(n**2 - n - 2 - 2*nu), n*(n - 1), -n*(n**2 + 3*n - 2*nu), (n + 1)*(n + 2)]
      d = [n**2 + 2*n - 1 + 2*nu, n - 1, n**2 - 2 + 2*nu, -(n + 2)]
      associate (ratio => basis%inner_radius/basis%outer_radius)
         ! Values at the inner radius of the first two, at the outer radius of the last two.
         inner = [ratio**(harmonic + 1), ratio**(harmonic - 1), ratio**harmonic, ratio**(harmonic + 2)]
         matrix(1, :) = [c(:2), c(3:)*inner(3:)]
         matrix(2, :) = [d(:2), d(3:)*inner(3:)]
         matrix(3, :) = [c(:2)*inner(:2), c(3:)]/ratio
         matrix(4, :) = [d(:2)*inner(:2), d(3:)]/ratio
      end associate
      ! Unit generalized forces, which belong to the tractions over the sphere.
      right = 0.0_wp
      associate (area => 4*pi/(2*n + 1)*basis%outer_radius**2, scale => 2*basis%shear_modulus/basis%outer_radius)
         right(1, 1) = 1/(area*scale)
         right(2, 2) = 1/(area*n*(n + 1)*scale)
      end associate
      call dgetf2(4, 4, matrix, 4, pivot, info)
      if (info == 0) call dgetrs('N', 4, 2, matrix, 4, pivot, right, 4, info)
      if (info /= 0) error = harmonic_error('flexibility', harmonic)
      at_outer = [1.0_wp, 1.0_wp, inner(3), inner(4)]
      flexibility(1, :) = matmul(a*at_outer, right)
      flexibility(2, :) = matmul(b*at_outer, right)
   end subroutine get_flexibility

   !> Error for a harmonic.
   function harmonic_error(quantity, harmonic) result(error)
      !> What cannot be computed.
      character(len=*), intent(in) :: quantity
      integer, intent(in) :: harmonic
      type(error_type) :: error

      error = numerical_error('the '//quantity//' of harmonic '//to_text(harmonic)//' cannot be computed in double ' &
         //'precision; allowed: less extreme values of wall_thickness and poisson_ratio, fewer modes or rings', 'ball')
   end function harmonic_error

   !> Stiffness and mass of one harmonic in the basis. For n = 1 its first function, U = 1 and W = 0, is the rigid mode; the
   !> others keep their elastic part, without momentum.
   subroutine assemble(basis, harmonic, stiffness, mass, momentum)
      type(basis_type), intent(in) :: basis
      integer, intent(in) :: harmonic
      !> Stiffness matrix, N/m, and mass matrix, kg: [n, n].
      real(wp), allocatable, intent(out) :: stiffness(:, :), mass(:, :)
      !> For n = 1 the rigid motion that was taken from each function, otherwise none: [n].
      real(wp), allocatable, intent(out) :: momentum(:)
      real(wp) :: l, area
      integer, allocatable :: used(:)
      integer :: counts(2)
      integer :: i

      if (harmonic == 0) then
         call assemble_breathing(basis, stiffness, mass)
         return
      end if
      ! Integral of P_n^2 over the unit sphere.
      area = 4*pi/(2*harmonic + 1)
      l = real(harmonic*(harmonic + 1), wp)
      counts = get_counts(basis, harmonic)
      used = [(i, i=1, counts(1)), (size(basis%polynomial, 2) + i, i=1, counts(2))]
      stiffness = area*(basis%gram(used, used, 1) + l*basis%gram(used, used, 2) + basis%gram(used, used, 3)/l)
      mass = area*(basis%gram(used, used, 4) + basis%gram(used, used, 5)/l)
      if (harmonic > 1) return
      momentum = mass(2:, 1)/mass(1, 1)
      mass = mass(2:, 2:) - mass(1, 1)*outer(momentum)
      stiffness = stiffness(2:, 2:)
   end subroutine assemble

   !> Numbers of polynomials of U and of W; W belongs to compression waves, which are longer. For n = 0 that of S alone.
   pure function get_counts(basis, harmonic) result(counts)
      type(basis_type), intent(in) :: basis
      integer, intent(in) :: harmonic
      integer :: counts(2)

      counts = [get_degree(basis, harmonic, basis%shear_wavenumber) + 1, 0]
      if (harmonic == 0) then
         if (basis%incompressible) counts(1) = 1
      else if (.not. basis%incompressible) then
         counts(2) = get_degree(basis, harmonic, basis%compression_wavenumber) + 1
      end if
   end function get_counts

   !> U and V of the functions of one harmonic at positions in the wall.
   pure function get_displacements(basis, harmonic, position) result(displacement)
      type(basis_type), intent(in) :: basis
      integer, intent(in) :: harmonic
      !> Positions from -1 at the inner to 1 at the outer surface: [n_position].
      real(wp), intent(in) :: position(:)
      !> U and V: [2, n_position, n].
      real(wp), allocatable :: displacement(:, :, :)
      real(wp) :: p(size(basis%polynomial, 2), 3)
      real(wp) :: l, thickness, r
      integer :: counts(2)
      integer :: i

      counts = get_counts(basis, harmonic)
      l = real(harmonic*(harmonic + 1), wp)
      thickness = basis%outer_radius - basis%inner_radius
      allocate (displacement(2, size(position), sum(counts)), source=0.0_wp)
      associate (u => displacement(1, :, :counts(1)), v => displacement(2, :, :))
         do i = 1, size(position)
            call get_legendre(position(i), p(:, 1), p(:, 2), p(:, 3))
            r = basis%outer_radius - thickness*(1 - position(i))/2
            if (harmonic == 0) then
               u(i, :) = p(:counts(1), 1)*(basis%outer_radius/r)**2
            else
               u(i, :) = p(:counts(1), 1)
               v(i, :counts(1)) = (r*(p(:counts(1), 2)*(2/thickness)) + 2*p(:counts(1), 1))/l
               v(i, counts(1) + 1:) = -p(:counts(2), 1)/l
            end if
         end do
      end associate
   end function get_displacements

   !> Stiffness and mass of n = 0: U = S/r^2 with a polynomial S, which is constant if incompressible.
   subroutine assemble_breathing(basis, stiffness, mass)
      type(basis_type), intent(in) :: basis
      real(wp), allocatable, intent(out) :: stiffness(:, :)
      real(wp), allocatable, intent(out) :: mass(:, :)
      real(wp), allocatable :: u(:, :), u_slope(:, :), divergence(:, :), volume_change(:)
      real(wp) :: scale
      integer :: n, m, i

      n = sum(get_counts(basis, 0))
      m = size(basis%radius)
      allocate (u(m, n), u_slope(m, n), divergence(m, n), volume_change(n))
      scale = basis%outer_radius**2
      associate (r => spread(basis%radius, 2, n), weight => spread(basis%weight, 2, n))
         u = scale*basis%polynomial(:, :n, 1)/r**2
         divergence = scale*basis%polynomial(:, :n, 2)/r
         u_slope = divergence - 2*u
         stiffness = 4*pi*(2*basis%shear_modulus*(matmul(transpose(u_slope), weight*u_slope) &
            + 2*matmul(transpose(u), weight*u)) + basis%lame*matmul(transpose(divergence), weight*divergence))
         mass = 4*pi*basis%density*matmul(transpose(r*u), weight*r*u)
      end associate
      ! At the inner surface the polynomials are 1 or -1.
      volume_change = scale*[((-1.0_wp)**i, i=0, n - 1)]/basis%inner_radius**2*4*pi*basis%inner_radius**2
      stiffness = stiffness + basis%gas_stiffness*outer(volume_change)
   end subroutine assemble_breathing

   !> Vector times its transpose: [n, n].
   pure function outer(vector) result(matrix)
      !> The vector: [n].
      real(wp), intent(in) :: vector(:)
      real(wp) :: matrix(size(vector), size(vector))

      matrix = spread(vector, 2, size(vector))*spread(vector, 1, size(vector))
   end function outer

end module thud_sphere_modes
