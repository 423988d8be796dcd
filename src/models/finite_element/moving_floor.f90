!> A mobile floor under the finite elements, in steps of central differences.
!>
!> The force at an instant acts from half a step before to half a step after it; so the displacement of the floor is known at
!> the midpoints between instants, as velocities are. Contact forces depend on the displacement at the instant, and impulses
!> that stop nodes on the displacement at the next instant. Both displacements depend on the force. Since the force does not
!> increase when the floor moves away from the ball, there is exactly one solution.
module thud_moving_floor
   use thud_floor_contact, only: floor_contact_type, get_contact_forces
   use thud_kinds, only: wp
   use thud_receiver, only: advance_receiver, get_real_sum, get_receiver_velocity, is_rigid, new_receiver_motion, &
      new_receiver_step, receiver_motion_type, receiver_step_type, receiver_type
   implicit none (type, external)
   private

   public :: advance_floor, continue_freely, find_floor, moving_floor_type, new_moving_floor, predict

   !> Instants of a step: its own, the midpoint after it, the next.
   integer, parameter :: here = 1, after = 2, next = 3

   !> Relative change of the force that ends the iteration.
   real(wp), parameter :: small_change = 1.0e-11_wp

   !> Maximum number of iterations; Newton's method takes a few.
   integer, parameter :: max_iterations = 60

   !> The floor; displacements are downwards. The default is rigid.
   type :: moving_floor_type
      !> Whether the floor is mobile.
      logical :: moves = .false.
      type(receiver_type) :: receiver
      !> Motion at the midpoint before the instant.
      type(receiver_motion_type) :: motion
      !> Displacement at the instant, m.
      real(wp) :: displacement = 0.0_wp
      !> Displacement at the next instant, where nodes stop, m.
      real(wp) :: stop = 0.0_wp
      !> Twice the travel from the midpoint before to the instant, divided by the time between the midpoints, m/s.
      real(wp) :: velocity_before = 0.0_wp
      !> The same from the instant to the midpoint after, m/s.
      real(wp) :: velocity_after = 0.0_wp
      !> Velocity at the instant without that of the direct mobility, m/s.
      real(wp) :: velocity = 0.0_wp
      !> Energy given to the floor up to the instant, and up to the midpoint after it, J.
      real(wp) :: work = 0.0_wp, work_after = 0.0_wp
      !> Lengths of the previous and the present step for which the steps below hold, s; negative: none.
      real(wp) :: last_interval = -1.0_wp, interval = -1.0_wp
      !> Displacements at the instants without force, m: [3].
      real(wp) :: free(3) = 0.0_wp
      !> Steps from the midpoint before to each instant: [3].
      type(receiver_step_type) :: step(3)
   end type moving_floor_type

contains

   !> A floor at rest.
   pure function new_moving_floor(receiver) result(floor)
      !> The floor under the ball (default: rigid).
      type(receiver_type), intent(in), optional :: receiver
      type(moving_floor_type) :: floor

      if (.not. present(receiver)) return
      floor%moves = .not. is_rigid(receiver)
      floor%receiver = receiver
      floor%motion = new_receiver_motion(receiver)
   end function new_moving_floor

   !> Predicts the displacements in a step without force, and the compliances.
   pure subroutine predict(floor, last_interval, interval)
      type(moving_floor_type), intent(inout) :: floor
      !> Lengths of the previous step, 0 at the start, and of the present one, s.
      real(wp), intent(in) :: last_interval, interval
      real(wp) :: length(3)
      integer :: i

      if (abs(last_interval - floor%last_interval) > 0.0_wp .or. abs(interval - floor%interval) > 0.0_wp) then
         floor%last_interval = last_interval
         floor%interval = interval
         length([here, after, next]) = last_interval/2 + [0.0_wp, interval/2, interval]
         do i = 1, 3
            floor%step(i) = new_receiver_step(floor%receiver, length(i))
         end do
      end if
      do i = 1, 3
         floor%free(i) = floor%motion%displacement + get_real_sum(floor%step(i)%displacement, floor%motion%amplitude)
      end do
   end subroutine predict

   !> Solves for the displacements of a floor at an instant and at the next, by Newton's method within bounds.
   pure subroutine find_floor(floor, contact, mass, position, velocity, guess)
      !> The floor after `predict`; gets both displacements.
      type(moving_floor_type), intent(inout) :: floor
      type(floor_contact_type), intent(in) :: contact
      !> Masses of the nodes of the outer surface, kg: [0:n_polar].
      real(wp), intent(in) :: mass(0:)
      !> Positions of these nodes relative to the undisplaced floor, m: [0:n_polar, 2].
      real(wp), intent(in) :: position(0:, :)
      !> Upward velocities of these nodes half a step later without the floor, m/s: [0:n_polar].
      real(wp), intent(in) :: velocity(0:)
      !> Estimate of the force on the floor, N.
      real(wp), intent(in) :: guess
      real(wp) :: force, reaction, slope, lower, upper, change
      integer :: iteration

      lower = 0.0_wp
      upper = huge(upper)
      force = guess
      do iteration = 1, max_iterations
         floor%displacement = floor%free(here) + floor%step(here)%compliance*force
         floor%stop = floor%free(next) + floor%step(next)%compliance*force
         call get_reaction(reaction, slope)
         ! The reaction falls as the force rises: the solution lies between the two.
         lower = max(lower, min(force, reaction))
         upper = min(upper, max(force, reaction))
         change = (reaction - force)/(1 + slope)
         if (abs(change) <= small_change*max(force, reaction)) return
         force = force + change
         if (force < lower .or. force > upper) force = lower + (upper - lower)/2
      end do

   contains

      !> Reaction of the contact at the displacements of the trial force.
      pure subroutine get_reaction(reaction, slope)
         !> The reaction, N; its negative derivative with respect to the trial force, N/N.
         real(wp), intent(out) :: reaction, slope
         real(wp), dimension(0:ubound(mass, 1)) :: stiffness
         real(wp), dimension(0:ubound(mass, 1), 2) :: relative_position, contact_force
         real(wp) :: energy, span, needed
         integer :: j

         relative_position(:, 1) = position(:, 1)
         relative_position(:, 2) = position(:, 2) + floor%displacement
         call get_contact_forces(contact, relative_position, contact_force, energy, stiffness)
         reaction = 0.0_wp
         slope = 0.0_wp
         span = (floor%last_interval + floor%interval)/2
         do j = 0, ubound(mass, 1)
            needed = -((position(j, 2) + floor%stop)/floor%interval + velocity(j))*mass(j)/span
            if (needed > contact_force(j, 2) .and. .not. contact%layer_stiffness > 0.0_wp) then
               reaction = reaction + needed
               slope = slope + floor%step(next)%compliance*mass(j)/(floor%interval*span)
            else
               reaction = reaction + contact_force(j, 2)
               slope = slope + floor%step(here)%compliance*stiffness(j)
            end if
         end do
      end subroutine get_reaction

   end subroutine find_floor

   !> Advances a floor to the midpoint after an instant.
   pure subroutine advance_floor(floor, force)
      !> The floor after `find_floor`.
      type(moving_floor_type), intent(inout) :: floor
      !> Force downwards, N.
      real(wp), intent(in) :: force
      real(wp) :: before

      before = floor%motion%displacement
      floor%motion%displacement = floor%free(after) + floor%step(after)%compliance*force
      floor%motion%amplitude = floor%step(after)%decay*floor%motion%amplitude + floor%step(after)%gain*force
      associate (span => floor%step(after)%interval, displacement => floor%displacement)
         floor%velocity_before = 2*(displacement - before)/span
         floor%velocity_after = 2*(floor%motion%displacement - displacement)/span
         floor%velocity = (floor%velocity_before + floor%velocity_after)/2 - floor%receiver%direct*force
         floor%work = floor%work_after + force*(displacement - before)
         floor%work_after = floor%work_after + force*(floor%motion%displacement - before)
      end associate
   end subroutine advance_floor

   !> Motion of a floor without contact, at the samples of a record.
   pure subroutine continue_freely(floor, time, sample_rate, first, displacement, velocity)
      type(moving_floor_type), intent(in) :: floor
      !> Time of the midpoint that the floor has reached, s; sampling rate, Hz.
      real(wp), intent(in) :: time, sample_rate
      !> Index of the first sample after this midpoint.
      integer, intent(in) :: first
      !> Displacement, m, and velocity, m/s; those from the first sample on are set: [n_sample].
      real(wp), intent(inout) :: displacement(:), velocity(:)
      type(receiver_motion_type) :: motion
      type(receiver_step_type) :: step
      integer :: i

      motion = floor%motion
      step = new_receiver_step(floor%receiver, (first - 1)/sample_rate - time)
      do i = first, size(displacement)
         call advance_receiver(step, 0.0_wp, motion)
         displacement(i) = motion%displacement
         velocity(i) = get_receiver_velocity(floor%receiver, 0.0_wp, motion)
         if (i == first) step = new_receiver_step(floor%receiver, 1/sample_rate)
      end do
   end subroutine continue_freely

end module thud_moving_floor
