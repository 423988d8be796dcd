!> Exact time steps of damped modes of unit modal mass, q'' + 2 zeta omega q' + omega^2 q = 0.
module thud_mode_step
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: get_energy, mode_step_type, set_factors

   !> The modes and one step of each: q and v = q' go to (qq q + qv v, vq q + vv v); an impulse p
   !> at the beginning adds -p (qv, vv).
   type :: mode_step_type
      !> Angular frequencies, rad/s: [n_mode].
      real(wp), allocatable :: omega(:)
      !> Harmonic of each mode: [n_mode].
      integer, allocatable :: harmonic(:)
      !> Factors of one step: [n_mode] each.
      real(wp), allocatable :: qq(:), qv(:), vq(:), vv(:)
      !> Fall of each ring's height by unit amplitude: [n_mode, n_ring].
      real(wp), allocatable :: fall(:, :)
   end type mode_step_type

contains

   !> Factors of one step, also of overdamped modes.
   pure subroutine set_factors(step, damping_ratio, interval)
      !> The modes, their frequencies set.
      type(mode_step_type), intent(inout) :: step
      !> Damping ratio of each mode: [n_mode].
      real(wp), intent(in) :: damping_ratio(:)
      !> Length of a step, s.
      real(wp), intent(in) :: interval
      real(wp), dimension(size(step%omega)) :: zeta, decay, root, c, s

      ! Critical damping has no closed form of either kind; a millionth off makes no difference.
      zeta = merge(1 + 1.0e-6_wp, damping_ratio, abs(damping_ratio - 1) < 1.0e-6_wp)
      decay = zeta*step%omega
      root = step%omega*sqrt(abs(1 - zeta**2))
      where (zeta < 1)
         c = exp(-decay*interval)*cos(root*interval)
         s = exp(-decay*interval)*sin(root*interval)/root
      else where
         c = (exp((root - decay)*interval) + exp(-(root + decay)*interval))/2
         s = (exp((root - decay)*interval) - exp(-(root + decay)*interval))/(2*root)
      end where
      step%qq = c + decay*s
      step%qv = s
      step%vq = -step%omega**2*s
      step%vv = c - decay*s
   end subroutine set_factors

   !> Energy of the modes, J.
   pure function get_energy(step, q, v) result(energy)
      type(mode_step_type), intent(in) :: step
      !> Amplitudes, m sqrt(kg): [n_mode].
      real(wp), intent(in) :: q(:)
      !> Their rates: [n_mode].
      real(wp), intent(in) :: v(:)
      !> Kinetic and elastic energy, J.
      real(wp) :: energy

      energy = sum(v**2 + (step%omega*q)**2)/2
   end function get_energy

end module thud_mode_step
