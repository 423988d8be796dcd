!> Axisymmetric modes of a free hollow sphere without twist: displacements U(r) P_n(cos t) along
!> the radius and V(r) dP_n/dt along the meridian, t the angle from the pole; see `thud_sphere_basis`.
module thud_sphere_modes
   use thud_constants, only: pi
   use thud_kinds, only: wp
   use thud_lapack, only: dposv, dsygv
   use thud_sphere_basis, only: basis_type, get_degree, integrate
   implicit none (type, external)
   private

   public :: family_type, get_family, get_static_family

   !> Modes of one harmonic as the contact sees them.
   type :: family_type
      !> Harmonic n.
      integer :: harmonic = 0
      !> Angular frequencies, ascending, without the rigid mode, rad/s: [n_mode].
      real(wp), allocatable :: omega(:)
      !> U and V at the outer surface of modes of unit modal mass, 1/sqrt(kg): [2, n_mode].
      real(wp), allocatable :: surface(:, :)
      !> Static displacements of the surface by what the modes leave out, U and V by unit
      !> generalised forces on U and V, m/N: [2, 2].
      real(wp) :: flexibility(2, 2) = 0.0_wp
   end type family_type

contains

   !> The lowest modes of one harmonic, and the flexibility of all others.
   subroutine get_family(basis, harmonic, max_modes, highest_omega, family, failed)
      !> The basis.
      type(basis_type), intent(in) :: basis
      !> Harmonic n.
      integer, intent(in) :: harmonic
      !> Number of modes to keep; fewer where the basis has fewer.
      integer, intent(in) :: max_modes
      !> Highest angular frequency to keep, rad/s.
      real(wp), intent(in) :: highest_omega
      !> The modes.
      type(family_type), intent(out) :: family
      !> The eigenproblem could not be solved.
      logical, intent(out) :: failed
      real(wp), allocatable :: stiffness(:, :), mass(:, :), surface(:, :), square(:), work(:)
      integer :: n, info, first, last, k

      family%harmonic = harmonic
      call assemble(basis, harmonic, stiffness, mass, surface)
      n = size(stiffness, 1)
      allocate (square(n), work(34*n))
      call dsygv(1, 'V', 'L', n, stiffness, n, mass, n, square, work, size(work), info)
      failed = info /= 0
      if (failed) return
      ! The lowest mode of n = 1 is the rigid one.
      first = merge(2, 1, harmonic == 1)
      failed = .not. all(square(first:) > 0.0_wp)
      if (failed) return
      last = min(first - 1 + min(max_modes, count(square(first:) <= highest_omega**2)), n)
      family%omega = sqrt(square(first:last))
      surface = matmul(surface, stiffness)
      family%surface = surface(:, first:last)
      do k = last + 1, n
         family%flexibility = family%flexibility + outer(surface(:, k))/square(k)
      end do
   end subroutine get_family

   !> Flexibility of a whole harmonic, without its modes.
   subroutine get_static_family(basis, harmonic, family, failed)
      !> The basis.
      type(basis_type), intent(in) :: basis
      !> Harmonic n, at least 2.
      integer, intent(in) :: harmonic
      !> The flexibility; no modes.
      type(family_type), intent(out) :: family
      !> The stiffness is singular.
      logical, intent(out) :: failed
      real(wp), allocatable :: stiffness(:, :), mass(:, :), surface(:, :), solution(:, :)
      integer :: n, info

      family%harmonic = harmonic
      allocate (family%omega(0), family%surface(2, 0))
      call assemble(basis, harmonic, stiffness, mass, surface)
      n = size(stiffness, 1)
      solution = transpose(surface)
      call dposv('L', n, 2, stiffness, n, solution, n, info)
      failed = info /= 0
      family%flexibility = matmul(surface, solution)
   end subroutine get_static_family

   !> Stiffness, mass and surface displacements of one harmonic in the basis.
   subroutine assemble(basis, harmonic, stiffness, mass, surface)
      !> The basis.
      type(basis_type), intent(in) :: basis
      !> Harmonic n.
      integer, intent(in) :: harmonic
      !> Stiffness matrix, N/m: [n, n].
      real(wp), allocatable, intent(out) :: stiffness(:, :)
      !> Mass matrix, kg: [n, n].
      real(wp), allocatable, intent(out) :: mass(:, :)
      !> U and V at the outer surface: [2, n].
      real(wp), allocatable, intent(out) :: surface(:, :)
      real(wp) :: l, area
      integer, allocatable :: used(:)
      integer :: n, i

      ! Integral of P_n^2 over the unit sphere.
      area = 4*pi/(2*harmonic + 1)
      if (harmonic == 0) then
         call assemble_breathing(basis, stiffness, mass, surface)
         return
      end if
      l = real(harmonic*(harmonic + 1), wp)
      n = get_degree(basis, harmonic) + 1
      associate (stride => size(basis%gram, 1)/2)
         allocate (used(merge(n, 2*n, basis%incompressible)))
         used(:n) = [(i, i=1, n)]
         used(n + 1:) = [(stride + i, i=1, size(used) - n)]
      end associate
      stiffness = area*(basis%gram(used, used, 1) + l*basis%gram(used, used, 2) + basis%gram(used, used, 3)/l)
      mass = area*(basis%gram(used, used, 4) + basis%gram(used, used, 5)/l)
      allocate (surface(2, size(used)), source=0.0_wp)
      associate (p => basis%at_end(1, :n, :))
         surface(1, :n) = p(:, 1)
         surface(2, :n) = (basis%outer_radius*p(:, 2) + 2*p(:, 1))/l
         if (.not. basis%incompressible) surface(2, n + 1:) = -p(:, 1)/l
      end associate
   end subroutine assemble

   !> The same for n = 0, where U = S/r^2 with S a polynomial, a constant if incompressible.
   subroutine assemble_breathing(basis, stiffness, mass, surface)
      !> The basis.
      type(basis_type), intent(in) :: basis
      !> Stiffness matrix, N/m: [n, n].
      real(wp), allocatable, intent(out) :: stiffness(:, :)
      !> Mass matrix, kg: [n, n].
      real(wp), allocatable, intent(out) :: mass(:, :)
      !> U at the outer surface, V = 0: [2, n].
      real(wp), allocatable, intent(out) :: surface(:, :)
      real(wp), allocatable :: u(:, :), u_slope(:, :), divergence(:, :), inner(:)
      real(wp) :: scale
      integer :: n, m

      n = 1
      if (.not. basis%incompressible) n = get_degree(basis, 0) + 1
      m = size(basis%radius)
      allocate (u(m, n), u_slope(m, n), divergence(m, n), inner(n))
      scale = basis%outer_radius**2
      associate (r => spread(basis%radius, 2, n), weight => basis%weight)
         u = scale*basis%polynomial(:, :n, 1)/r**2
         divergence = scale*basis%polynomial(:, :n, 2)/r
         u_slope = divergence - 2*u
         stiffness = 4*pi*(2*basis%shear_modulus*(integrate(weight, u_slope, u_slope) + 2*integrate(weight, u, u)) &
            + basis%lame*integrate(weight, divergence, divergence))
         mass = 4*pi*basis%density*integrate(weight, r*u, r*u)
      end associate
      inner = scale*basis%at_end(2, :n, 1)/basis%inner_radius**2*4*pi*basis%inner_radius**2
      stiffness = stiffness + basis%gas_stiffness*outer(inner)
      allocate (surface(2, n), source=0.0_wp)
      surface(1, :) = basis%at_end(1, :n, 1)
   end subroutine assemble_breathing

   !> Vector times its transpose.
   pure function outer(vector) result(matrix)
      !> The vector: [n].
      real(wp), intent(in) :: vector(:)
      !> The matrix: [n, n].
      real(wp) :: matrix(size(vector), size(vector))

      matrix = spread(vector, 2, size(vector))*spread(vector, 1, size(vector))
   end function outer

end module thud_sphere_modes
