!> Motion of the modal ball and of the floor under it, step by step.
module thud_ball_motion
   use thud_error, only: error_type
   use thud_kinds, only: wp
   use thud_lapack, only: dgemv
   use thud_mode_step, only: advance, get_energies, mode_step_type, index_rate
   use thud_receiver, only: add_impulse, advance_receiver, is_rigid, new_receiver_motion, new_receiver_step, &
      receiver_motion_type, receiver_step_type, receiver_type
   use thud_ring_contact, only: ring_contact_type, solve_contact, update_sticking
   use thud_surface_rings, only: surface_rings_type
   implicit none (type, external)
   private

   public :: ball_motion_type, new_ball_motion, take_step

   !> Motion of the ball.
   type :: ball_motion_type
      !> Amplitudes of the modes, m sqrt(kg), their rates and the internal variables of their
      !> Maxwell branches: [n_mode, 2 + n_branch].
      real(wp), allocatable :: motion(:, :)
      !> Height of the center of mass, m.
      real(wp) :: height
      !> Upward velocity of the center of mass, m/s.
      real(wp) :: velocity
      !> Downward acceleration of the center of mass without contact, m/s2.
      real(wp) :: gravity = 0.0_wp
      !> Energy lost to damping, J.
      real(wp) :: loss = 0.0_wp
      !> Energy given to the floor, and energy that the contact impulses take from the ball in addition, J.
      real(wp) :: floor_work = 0.0_wp, contact_loss = 0.0_wp
      !> Whether the floor is mobile.
      logical :: floor_moves = .false.
      !> The floor, its steps, and its motion.
      type(receiver_type) :: floor
      type(receiver_step_type) :: floor_step
      type(receiver_motion_type) :: floor_motion
      !> Workspace of a step: motion at its beginning; impulses of the floor on the modes: [n_mode].
      real(wp), allocatable :: before(:, :), mode_impulse(:)
      !> Gaps between rings and floor; for sticking rings also the tangential displacements from the positions where they
      !> began to stick, m: [n_gap].
      real(wp), allocatable :: gap(:)
      !> Gaps of the undeformed ball with its center at the height of the resting floor; for sticking rings also the offsets
      !> that make the tangential gaps zero where they began to stick, m: [n_gap].
      real(wp), allocatable :: reference_gap(:)
   end type ball_motion_type

contains

   !> The ball at first touch.
   pure function new_ball_motion(modes, interval, rings, floor, outer_radius, impact_velocity, gravity) result(state)
      type(mode_step_type), intent(in) :: modes
      !> Length of a step, s.
      real(wp), intent(in) :: interval
      type(surface_rings_type), intent(in) :: rings
      !> The floor under the ball.
      type(receiver_type), intent(in) :: floor
      !> Outer radius, m; velocity at first touch, m/s; gravity during the contact, m/s2.
      real(wp), intent(in) :: outer_radius, impact_velocity, gravity
      type(ball_motion_type) :: state

      associate (n_mode => size(modes%omega), n_variable => size(modes%factor, 2), n_gap => size(modes%shape_at_ring, 2))
         allocate (state%motion(n_mode, n_variable), state%before(n_mode, n_variable), state%mode_impulse(n_mode), &
            state%gap(n_gap), state%reference_gap(n_gap), source=0.0_wp)
      end associate
      state%reference_gap(::rings%n_dof) = -outer_radius*rings%height
      state%height = outer_radius
      state%velocity = -impact_velocity
      state%gravity = gravity
      state%floor_moves = .not. is_rigid(floor)
      state%floor = floor
      state%floor_step = new_receiver_step(floor, interval)
      state%floor_motion = new_receiver_motion(floor)
   end function new_ball_motion

   !> Advances modes and floor by one step, with the impulses between ball and floor at its beginning.
   subroutine take_step(modes, interval, mass, state, contact, impulse, error)
      type(mode_step_type), intent(in) :: modes
      !> Length of the step, s; mass of the ball, kg.
      real(wp), intent(in) :: interval, mass
      !> Motion of the ball.
      type(ball_motion_type), intent(inout) :: state
      !> The rings; their impulses are set here.
      type(ring_contact_type), intent(inout) :: contact
      !> Sum of the impulses of all rings, N s.
      real(wp), intent(out) :: impulse
      !> Set if the contact cannot be solved.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: start_velocity, floor_start, work
      integer :: i, n_mode, n_gap

      n_mode = size(modes%omega)
      associate (motion => state%motion, before => state%before, mode_impulse => state%mode_impulse, gap => state%gap, &
         n_dof => contact%n_dof)
         before = motion
         call advance(modes, before, motion)
         mode_impulse = 0.0_wp
         impulse = 0.0_wp
         start_velocity = state%velocity
         state%height = state%height + interval*(state%velocity - interval*state%gravity/2)
         state%velocity = state%velocity - interval*state%gravity
         gap = state%reference_gap
         gap(::n_dof) = gap(::n_dof) + state%height
         floor_start = state%floor_motion%displacement
         if (state%floor_moves) then
            call advance_receiver(state%floor, state%floor_step, 0.0_wp, state%floor_motion)
            gap(::n_dof) = gap(::n_dof) + state%floor_motion%displacement
         end if
         if (n_mode > 0) call dgemv('T', n_mode, size(gap), -1.0_wp, modes%shape_at_ring, n_mode, motion, 1, 1.0_wp, gap, 1)
         call solve_contact(contact, gap, error)
         if (allocated(error)) return
         call update_sticking(contact, state%reference_gap)
         n_gap = contact%last_closed_gap
         if (n_gap > 0) then
            impulse = sum(contact%impulse(:n_gap:n_dof))
            if (n_mode > 0) call dgemv('N', n_mode, n_gap, 1.0_wp, modes%shape_at_ring, n_mode, contact%impulse, 1, &
               0.0_wp, mode_impulse, 1)
            do i = 1, size(motion, 2)
               motion(:, i) = motion(:, i) - modes%factor(:, i, index_rate)*mode_impulse
            end do
            state%velocity = state%velocity + impulse/mass
            state%height = state%height + interval*impulse/mass
            ! Energy that the impulses take from the ball instantaneously.
            state%contact_loss = state%contact_loss - impulse*(start_velocity + impulse/(2*mass)) &
               + dot_product(mode_impulse, before(:, index_rate) - mode_impulse/2)
         end if
         ! Damping acts after the impulse at the beginning of the step.
         before(:, index_rate) = before(:, index_rate) - mode_impulse
         state%loss = state%loss + sum(get_energies(modes, before) - get_energies(modes, motion))
         if (.not. state%floor_moves) return
         call add_impulse(state%floor, state%floor_step, impulse, state%floor_motion)
         ! The work on the floor is that of the mean force.
         work = impulse*(state%floor_motion%displacement - floor_start)/interval
         state%floor_work = state%floor_work + work
         state%contact_loss = state%contact_loss - work
      end associate
   end subroutine take_step

end module thud_ball_motion
