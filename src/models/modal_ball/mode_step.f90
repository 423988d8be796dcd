!> Exact time steps of damped modes of unit modal mass.
!>
!> For a linear viscoelastic material, with a spring g, Maxwell branches g_k and a viscosity:
!> q'' + 2 zeta omega q' + omega**2 [g q + sum of g_k (q - x_k)] = 0 and x_k' = (q - x_k)/tau_k.
module thud_mode_step
   use thud_kinds, only: wp
   use thud_matrix_exponential, only: get_exponential
   implicit none (type, external)
   private

   public :: advance, get_energies, mode_step_type, set_factors

   !> Indices of amplitude q and rate v in the motion of a mode; the strains x of the branches follow.
   integer, parameter, public :: place_q = 1, place_v = 2

   !> The modes and their steps: the factors multiply the motion of a mode; an impulse p at the beginning adds -p times the
   !> factors of the rate.
   type :: mode_step_type
      !> Angular frequencies for the storage modulus, rad/s: [n_mode].
      real(wp), allocatable :: omega(:)
      !> Harmonic of each mode: [n_mode].
      integer, allocatable :: harmonic(:)
      !> Long-term modulus divided by storage modulus.
      real(wp) :: equilibrium_ratio = 1.0_wp
      !> Moduli of the branches divided by the storage modulus, and their relaxation times, s: [n_branch].
      real(wp), allocatable :: relative_modulus(:), time(:)
      !> Factors of one step: [n_mode, 2 + n_branch, 2 + n_branch].
      real(wp), allocatable :: factor(:, :, :)
      !> Mode shapes at the rings, downwards, per unit amplitude: [n_mode, n_gap].
      real(wp), allocatable :: shape_at_ring(:, :)
   end type mode_step_type

contains

   !> Factors of one step.
   pure subroutine set_factors(step, damping_ratio, interval)
      !> The modes; frequencies and branches are set.
      type(mode_step_type), intent(inout) :: step
      !> Damping ratio of each mode from the viscosity: [n_mode].
      real(wp), intent(in) :: damping_ratio(:)
      !> Length of a step, s.
      real(wp), intent(in) :: interval
      real(wp) :: rates(2 + size(step%time), 2 + size(step%time))
      integer :: i, k, n

      n = size(rates, 1)
      allocate (step%factor(size(step%omega), n, n))
      do i = 1, size(step%omega)
         ! The rate divided by the frequency makes the elements similar.
         associate (omega => step%omega(i))
            rates = 0.0_wp
            rates(place_q, place_v) = omega
            rates(place_v, place_q) = -omega*(step%equilibrium_ratio + sum(step%relative_modulus))
            rates(place_v, place_v) = -2*damping_ratio(i)*omega
            rates(place_v, 3:) = omega*step%relative_modulus
            do k = 3, n
               rates(k, [place_q, k]) = [1, -1]/step%time(k - 2)
            end do
            rates = get_exponential(interval*rates)
            rates(:, place_v) = rates(:, place_v)/omega
            rates(place_v, :) = rates(place_v, :)*omega
         end associate
         step%factor(i, :, :) = rates
      end do
   end subroutine set_factors

   !> Advances the motion of the modes by one step.
   pure subroutine advance(step, before, after)
      type(mode_step_type), intent(in) :: step
      !> Motion at the beginning and at the end of the step: [n_mode, 2 + n_branch].
      real(wp), intent(in) :: before(:, :)
      real(wp), intent(out) :: after(:, :)
      integer :: i, k

      do i = 1, size(after, 2)
         after(:, i) = step%factor(:, i, 1)*before(:, 1)
         do k = 2, size(before, 2)
            after(:, i) = after(:, i) + step%factor(:, i, k)*before(:, k)
         end do
      end do
   end subroutine advance

   !> Kinetic and elastic energy of each mode, J: [n_mode].
   pure function get_energies(step, motion) result(energy)
      type(mode_step_type), intent(in) :: step
      !> The motion: [n_mode, 2 + n_branch].
      real(wp), intent(in) :: motion(:, :)
      real(wp) :: energy(size(step%omega))
      integer :: k

      energy = step%equilibrium_ratio*motion(:, place_q)**2
      do k = 1, size(step%relative_modulus)
         energy = energy + step%relative_modulus(k)*(motion(:, place_q) - motion(:, 2 + k))**2
      end do
      energy = (motion(:, place_v)**2 + step%omega**2*energy)/2
   end function get_energies

end module thud_mode_step
