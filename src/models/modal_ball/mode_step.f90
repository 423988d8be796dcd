!> Exact time steps of damped modes of unit modal mass.
!>
!> For a linear viscoelastic material, with a spring g, Maxwell branches g_k and a viscosity:
!> q'' + 2 zeta omega q' + omega**2 [g q + sum of g_k (q - x_k)] = 0 and x_k' = (q - x_k)/tau_k.
module thud_mode_step
   use thud_kinds, only: wp
   use thud_matrix_exponential, only: get_exponential
   implicit none (type, external)
   private

   public :: advance, get_energies, get_mode_forces, get_surface, mode_step_type, set_factors

   !> Indices of amplitude q and rate v = q' in the motion of a mode; the internal variables x_k of the branches follow.
   integer, parameter, public :: index_amplitude = 1, index_rate = 2

   !> The modes and the factors of their time steps. The factors multiply the motion of a mode; an upward impulse p on the
   !> mode at the beginning adds -p times the factors of the rate v.
   type :: mode_step_type
      !> Angular frequencies for the storage modulus, rad/s: [n_mode].
      real(wp), allocatable :: omega(:)
      !> Harmonic of each mode: [n_mode].
      integer, allocatable :: harmonic(:)
      !> Index of the first mode of each harmonic, and behind the last mode of all: [0:n_harmonic].
      integer, allocatable :: first(:)
      !> Long-term modulus divided by storage modulus.
      real(wp) :: equilibrium_ratio = 1.0_wp
      !> Moduli of the branches divided by the storage modulus, and their relaxation times, s: [n_branch].
      real(wp), allocatable :: relative_modulus(:), time(:)
      !> Viscosity divided by the storage modulus, s; 0 for a loss factor that no material has at all frequencies.
      real(wp) :: retardation_time = 0.0_wp
      !> Factors of one step: [n_mode, 2 + n_branch, 2 + n_branch].
      real(wp), allocatable :: factor(:, :, :)
      !> Motion after one step from rest due to a unit force on the mode, constant in the step: [n_mode, 2 + n_branch].
      real(wp), allocatable :: gain(:, :)
      !> U and V of each mode at the outer surface, per unit amplitude: [n_mode, 2].
      real(wp), allocatable :: surface(:, :)
      !> Displacements of the rings due to unit U and V of each harmonic: [n_gap, 2*n_harmonic].
      real(wp), allocatable :: shape_at_ring(:, :)
      !> The transpose: generalized forces on U and V of each harmonic due to unit forces on the rings.
      real(wp), allocatable :: ring_load(:, :)
   end type mode_step_type

contains

   !> Factors of one step.
   pure subroutine set_factors(modes, damping_ratio, interval)
      !> The modes; frequencies and branches are set.
      type(mode_step_type), intent(inout) :: modes
      !> Damping ratio of each mode from the viscosity: [n_mode].
      real(wp), intent(in) :: damping_ratio(:)
      !> Length of a step, s.
      real(wp), intent(in) :: interval
      real(wp) :: matrix(3 + size(modes%time), 3 + size(modes%time))
      integer :: i, k, n

      n = size(matrix, 1) - 1
      allocate (modes%factor(size(modes%omega), n, n), modes%gain(size(modes%omega), n))
      do i = 1, size(modes%omega)
         ! With the rate divided by the frequency, the elements are of similar size.
         associate (omega => modes%omega(i))
            matrix = 0.0_wp
            matrix(index_amplitude, index_rate) = omega
            matrix(index_rate, index_amplitude) = -omega*(modes%equilibrium_ratio + sum(modes%relative_modulus))
            matrix(index_rate, index_rate) = -2*damping_ratio(i)*omega
            matrix(index_rate, 3:n) = omega*modes%relative_modulus
            do k = 3, n
               matrix(k, [index_amplitude, k]) = [1, -1]/modes%time(k - 2)
            end do
            ! The force, as a further variable that is constant in the step.
            matrix(index_rate, n + 1) = 1/omega
            matrix = get_exponential(interval*matrix)
            matrix(:, index_rate) = matrix(:, index_rate)/omega
            matrix(index_rate, :) = matrix(index_rate, :)*omega
         end associate
         modes%factor(i, :, :) = matrix(:n, :n)
         modes%gain(i, :) = matrix(:n, n + 1)
      end do
   end subroutine set_factors

   !> Advances the motion of the modes by one step.
   pure subroutine advance(modes, before, after)
      type(mode_step_type), intent(in) :: modes
      !> Motion at the beginning and at the end of the step: [n_mode, 2 + n_branch].
      real(wp), intent(in), contiguous :: before(:, :)
      real(wp), intent(out), contiguous :: after(:, :)
      integer :: i, k

      do i = 1, size(after, 2)
         after(:, i) = modes%factor(:, i, 1)*before(:, 1)
         do k = 2, size(before, 2)
            after(:, i) = after(:, i) + modes%factor(:, i, k)*before(:, k)
         end do
      end do
   end subroutine advance

   !> Displacements at the outer surface, U and V of each harmonic, m: [2*n_harmonic].
   pure subroutine get_surface(modes, amplitude, displacement)
      type(mode_step_type), intent(in) :: modes
      !> Amplitudes, m sqrt(kg): [n_mode].
      real(wp), intent(in) :: amplitude(:)
      real(wp), intent(out) :: displacement(:)
      real(wp) :: u, v
      integer :: n, i

      do n = 0, ubound(modes%first, 1) - 1
         u = 0.0_wp
         v = 0.0_wp
         do i = modes%first(n), modes%first(n + 1) - 1
            u = u + modes%surface(i, 1)*amplitude(i)
            v = v + modes%surface(i, 2)*amplitude(i)
         end do
         displacement(2*n + 1) = u
         displacement(2*n + 2) = v
      end do
   end subroutine get_surface

   !> Forces on the modes due to generalized forces on U and V of each harmonic.
   pure subroutine get_mode_forces(modes, load, force)
      type(mode_step_type), intent(in) :: modes
      !> Generalized forces, N: [2*n_harmonic].
      real(wp), intent(in) :: load(:)
      !> Forces on the modes, N/sqrt(kg): [n_mode].
      real(wp), intent(out) :: force(:)
      integer :: i

      do i = 1, size(force)
         associate (k => 2*modes%harmonic(i) + 1)
            force(i) = modes%surface(i, 1)*load(k) + modes%surface(i, 2)*load(k + 1)
         end associate
      end do
   end subroutine get_mode_forces

   !> Kinetic and elastic energy of each mode, J: [n_mode].
   pure function get_energies(modes, motion) result(energy)
      type(mode_step_type), intent(in) :: modes
      !> The motion: [n_mode, 2 + n_branch].
      real(wp), intent(in) :: motion(:, :)
      real(wp) :: energy(size(modes%omega))
      integer :: k

      energy = modes%equilibrium_ratio*motion(:, index_amplitude)**2
      do k = 1, size(modes%relative_modulus)
         energy = energy + modes%relative_modulus(k)*(motion(:, index_amplitude) - motion(:, 2 + k))**2
      end do
      energy = (motion(:, index_rate)**2 + modes%omega**2*energy)/2
   end function get_energies

end module thud_mode_step
