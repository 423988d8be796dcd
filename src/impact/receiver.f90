!> The structure under a source: linear and passive, described by the mobility Y of the point under the source.
!>
!> Y(s) = d + sum of r_k/(s - p_k), a direct part and poles with residues. Of a pair of conjugate poles only one is stored,
!> with twice its residue: the velocity is d F + Re sum r_k x_k with x_k' = p_k x_k + F. Time steps are exact for forces
!> that are constant in a step and for impulses at its beginning.
module thud_receiver
   use thud_constants, only: pi
   use thud_kinds, only: wp
   use thud_phi, only: get_phi
   use thud_vector_fit, only: get_response
   use thud_zero_search, only: bisection_type
   implicit none (type, external)
   private

   public :: advance_receiver, can_strike, get_mobility, get_real_sum, get_receiver_velocity, is_rigid
   public :: new_receiver_motion, new_receiver_step, receiver_motion_type, receiver_step_type, receiver_type

   !> A receiver. The default is rigid.
   type :: receiver_type
      !> Direct part of the mobility, m/(N s).
      real(wp) :: direct = 0.0_wp
      !> Poles, 1/s, imaginary parts not negative, real parts not positive: [n_pole].
      complex(wp), allocatable :: pole(:)
      !> Residues, m/(N s2), doubled for conjugate pairs: [n_pole].
      complex(wp), allocatable :: residue(:)
   end type receiver_type

   !> Coefficients of a time step.
   type :: receiver_step_type
      !> Length of the step, s.
      real(wp) :: interval = 0.0_wp
      !> exp(p h), and its integral over the step h (s): [n_pole].
      complex(wp), allocatable :: decay(:), gain(:)
      !> Residues times this integral: displacement by an amplitude, m/(N s): [n_pole].
      complex(wp), allocatable :: displacement(:)
      !> Displacement at the end by a unit force, constant in the step, m/N.
      real(wp) :: compliance = 0.0_wp
   end type receiver_step_type

   !> Motion of a receiver.
   type :: receiver_motion_type
      !> The x_k, N s: [n_pole].
      complex(wp), allocatable :: amplitude(:)
      !> Displacement under the source, downwards, m.
      real(wp) :: displacement = 0.0_wp
   end type receiver_motion_type

contains

   !> Whether a receiver does not move.
   pure function is_rigid(receiver) result(rigid)
      !> The receiver; if absent, a rigid one.
      type(receiver_type), intent(in), optional :: receiver
      logical :: rigid

      rigid = .true.
      if (.not. present(receiver)) return
      rigid = .not. receiver%direct > 0.0_wp
      if (allocated(receiver%residue)) rigid = rigid .and. .not. any(abs(receiver%residue) > 0.0_wp)
   end function is_rigid

   !> Mobility of the point under the source: velocity divided by force.
   pure function get_mobility(receiver, frequency) result(mobility)
      type(receiver_type), intent(in) :: receiver
      !> Frequencies, Hz: [n].
      real(wp), intent(in) :: frequency(:)
      !> The mobility, m/(N s): [n].
      complex(wp) :: mobility(size(frequency))
      integer :: i

      mobility = receiver%direct
      if (.not. allocated(receiver%pole)) return
      mobility = [(get_response(receiver%pole, receiver%residue, receiver%direct, 2*pi*frequency(i)), i=1, size(frequency))]
   end function get_mobility

   !> A receiver at rest.
   pure function new_receiver_motion(receiver) result(motion)
      type(receiver_type), intent(in) :: receiver
      type(receiver_motion_type) :: motion

      allocate (motion%amplitude(0))
      if (allocated(receiver%pole)) motion%amplitude = spread((0.0_wp, 0.0_wp), 1, size(receiver%pole))
   end function new_receiver_motion

   !> Coefficients of steps of one length.
   pure function new_receiver_step(receiver, interval) result(step)
      type(receiver_type), intent(in) :: receiver
      !> Length of the steps, s.
      real(wp), intent(in) :: interval
      type(receiver_step_type) :: step
      complex(wp) :: phi(0:2)
      integer :: k, n

      n = 0
      if (allocated(receiver%pole)) n = size(receiver%pole)
      step%interval = interval
      step%compliance = interval*receiver%direct
      allocate (step%decay(n), step%gain(n), step%displacement(n))
      do k = 1, n
         phi = get_phi(receiver%pole(k)*interval, 2)
         step%decay(k) = phi(0)
         step%gain(k) = interval*phi(1)
         step%displacement(k) = receiver%residue(k)*step%gain(k)
         step%compliance = step%compliance + real(receiver%residue(k)*interval**2*phi(2), wp)
      end do
   end function new_receiver_step

   !> Advances the motion by a step with a constant force.
   pure subroutine advance_receiver(step, force, motion)
      type(receiver_step_type), intent(in) :: step
      !> The force downwards, N.
      real(wp), intent(in) :: force
      type(receiver_motion_type), intent(inout) :: motion

      motion%displacement = motion%displacement + step%compliance*force + get_real_sum(step%displacement, motion%amplitude)
      motion%amplitude = step%decay*motion%amplitude + step%gain*force
   end subroutine advance_receiver

   !> Real part of a sum of products.
   pure function get_real_sum(a, b) result(total)
      !> The factors: [n].
      complex(wp), intent(in), contiguous :: a(:), b(:)
      real(wp) :: total
      integer :: k

      total = 0.0_wp
      !$omp simd reduction(+:total)
      do k = 1, size(a)
         total = total + real(a(k), wp)*real(b(k), wp) - aimag(a(k))*aimag(b(k))
      end do
   end function get_real_sum

   !> Velocity under the source.
   pure function get_receiver_velocity(receiver, force, motion) result(velocity)
      type(receiver_type), intent(in) :: receiver
      !> The force downwards, N.
      real(wp), intent(in) :: force
      type(receiver_motion_type), intent(in) :: motion
      !> Velocity downwards, m/s.
      real(wp) :: velocity

      velocity = receiver%direct*force
      if (size(motion%amplitude) > 0) velocity = velocity + get_real_sum(receiver%residue, motion%amplitude)
   end function get_receiver_velocity

   !> Whether the receiver, in free motion, can reach a line that moves away from it: each pole moves the receiver by at
   !> most |r x| min(t, 2/|p|) in the time t.
   pure function can_strike(receiver, motion, gap, speed) result(yes)
      type(receiver_type), intent(in) :: receiver
      type(receiver_motion_type), intent(in) :: motion
      !> Gap between receiver and line, m; velocity of the line upwards, m/s.
      real(wp), intent(in) :: gap, speed
      logical :: yes
      real(wp), dimension(size(motion%amplitude)) :: rate, time
      type(bisection_type) :: bracket
      real(wp) :: away
      integer :: k

      away = speed
      rate = 0.0_wp
      time = 0.0_wp
      do k = 1, size(rate)
         if (abs(receiver%pole(k)) > 0.0_wp) then
            rate(k) = abs(receiver%residue(k)*motion%amplitude(k))
            time(k) = 2/abs(receiver%pole(k))
         else
            ! A free mass keeps moving downwards.
            away = away + real(receiver%residue(k)*motion%amplitude(k), wp)
         end if
      end do
      yes = gap < 0.0_wp .or. away < 0.0_wp
      if (yes .or. away >= sum(rate)) return
      ! The bound of the remaining gap is convex in time. It decreases as long as the poles whose times have not passed are
      ! faster than the line; its minimum lies at one of the times.
      bracket%right = maxval(time)
      do while (bracket%is_open())
         call bracket%halve(away < sum(rate, mask=time > bracket%get_middle()))
      end do
      yes = gap + away*bracket%right < sum(rate*min(time, bracket%right))
   end function can_strike

end module thud_receiver
