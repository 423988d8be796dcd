!> Motion of the modal ball and of the floor under it, step by step.
module thud_ball_motion
   use thud_error, only: error_type
   use thud_kinds, only: wp
   use thud_lapack, only: dgemv
   use thud_mode_step, only: advance, get_energies, mode_step_type, place_v
   use thud_receiver, only: add_impulse, advance_receiver, is_rigid, new_receiver_motion, new_receiver_step, &
      receiver_motion_type, receiver_step_type, receiver_type
   use thud_ring_contact, only: follow_sliding, ring_contact_type, solve_contact
   use thud_surface_rings, only: surface_rings_type
   implicit none (type, external)
   private

   public :: ball_motion_type, new_ball_motion, take_step

   !> Motion of the ball.
   type :: ball_motion_type
      !> Amplitudes of the modes, m sqrt(kg), their rates and strains of their branches: [n_mode, 2 + n_branch].
      real(wp), allocatable :: motion(:, :)
      !> Height of the centre of mass, m.
      real(wp) :: height
      !> Its velocity upwards, m/s.
      real(wp) :: speed
      !> Its acceleration downwards without contact, m/s2.
      real(wp) :: gravity = 0.0_wp
      !> Energy that damping has taken, J.
      real(wp) :: loss = 0.0_wp
      !> Energy that went to the floor, and energy lost where an impulse closes a gap within a step, J.
      real(wp) :: floor_work = 0.0_wp, contact_loss = 0.0_wp
      !> The floor moves.
      logical :: floor_moves = .false.
      !> The floor, its steps, and its motion.
      type(receiver_type) :: floor
      type(receiver_step_type) :: floor_step
      type(receiver_motion_type) :: floor_motion
      !> Workspace of a step: motion at its beginning; push of the floor on the modes: [n_mode].
      real(wp), allocatable :: before(:, :), push(:)
      !> Gaps between rings and floor, and of rings that stick to where they touched first, m: [n_gap].
      real(wp), allocatable :: gap(:)
      !> Gaps of the undeformed ball with its centre on the resting floor, m: [n_gap].
      real(wp), allocatable :: start(:)
   end type ball_motion_type

contains

   !> The ball at first touch.
   pure function new_ball_motion(step, interval, rings, floor, outer_radius, impact_velocity, gravity) result(state)
      type(mode_step_type), intent(in) :: step
      !> Length of a step, s.
      real(wp), intent(in) :: interval
      type(surface_rings_type), intent(in) :: rings
      !> What the ball drops on.
      type(receiver_type), intent(in) :: floor
      !> Outer radius, m; velocity at first touch, m/s; gravity during the contact, m/s2.
      real(wp), intent(in) :: outer_radius, impact_velocity, gravity
      type(ball_motion_type) :: state

      allocate (state%motion, state%before, source=0*step%factor(:, :, place_v))
      allocate (state%push, source=0*step%omega)
      allocate (state%gap(size(step%fall, 2)), state%start(size(step%fall, 2)), source=0.0_wp)
      state%start(::rings%n_way) = -outer_radius*rings%height
      state%height = outer_radius
      state%speed = -impact_velocity
      state%gravity = gravity
      state%floor_moves = .not. is_rigid(floor)
      state%floor = floor
      state%floor_step = new_receiver_step(floor, interval)
      state%floor_motion = new_receiver_motion(floor)
   end function new_ball_motion

   !> One step of the modes and of the floor, and the impulses between them at its beginning.
   subroutine take_step(step, interval, mass, state, contact, impulse, error)
      type(mode_step_type), intent(in) :: step
      !> Length of the step, s; mass of the ball, kg.
      real(wp), intent(in) :: interval, mass
      !> Motion of the ball.
      type(ball_motion_type), intent(inout) :: state
      !> The rings; get their impulses.
      type(ring_contact_type), intent(inout) :: contact
      !> Impulse of all rings, N s.
      real(wp), intent(out) :: impulse
      !> The contact cannot be solved.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: speed, sunk
      integer :: i, n_mode, n_gap

      n_mode = size(step%omega)
      associate (motion => state%motion, before => state%before, push => state%push, gap => state%gap, way => contact%n_way)
         before = motion
         call advance(step, before, motion)
         push = 0.0_wp
         impulse = 0.0_wp
         speed = state%speed
         state%height = state%height + interval*(state%speed - interval*state%gravity/2)
         state%speed = state%speed - interval*state%gravity
         gap = state%start
         gap(::way) = gap(::way) + state%height
         sunk = state%floor_motion%displacement
         if (state%floor_moves) then
            call advance_receiver(state%floor, state%floor_step, 0.0_wp, state%floor_motion)
            gap(::way) = gap(::way) + state%floor_motion%displacement
         end if
         if (n_mode > 0) call dgemv('T', n_mode, size(gap), -1.0_wp, step%fall, n_mode, motion, 1, 1.0_wp, gap, 1)
         call solve_contact(contact, gap, error)
         if (allocated(error)) return
         call follow_sliding(contact, state%start)
         n_gap = contact%last_gap
         if (n_gap > 0) then
            impulse = sum(contact%impulse(:n_gap:way))
            if (n_mode > 0) call dgemv('N', n_mode, n_gap, 1.0_wp, step%fall, n_mode, contact%impulse, 1, &
               0.0_wp, push, 1)
            do i = 1, size(motion, 2)
               motion(:, i) = motion(:, i) - step%factor(:, i, place_v)*push
            end do
            state%speed = state%speed + impulse/mass
            state%height = state%height + interval*impulse/mass
            ! What the impulses take from the ball at once.
            state%contact_loss = state%contact_loss - impulse*(speed + impulse/(2*mass)) &
               + dot_product(push, before(:, place_v) - push/2)
         end if
         ! The loss by damping lies between the impulse at the beginning and the end of the step.
         before(:, place_v) = before(:, place_v) - push
         state%loss = state%loss + sum(get_energies(step, before) - get_energies(step, motion))
         if (.not. state%floor_moves) return
         call add_impulse(state%floor, state%floor_step, impulse, state%floor_motion)
         ! Of that the floor has what the mean force does along its way.
         sunk = impulse*(state%floor_motion%displacement - sunk)/interval
         state%floor_work = state%floor_work + sunk
         state%contact_loss = state%contact_loss - sunk
      end associate
   end subroutine take_step

end module thud_ball_motion
