!> Motion of the modal ball and of the floor under it, step by step.
module thud_ball_motion
   use thud_error, only: error_type
   use thud_kinds, only: wp
   use thud_mode_step, only: advance, get_energies, get_mode_forces, get_surface, index_amplitude, mode_step_type
   use thud_product, only: add_product
   use thud_receiver, only: advance_receiver, is_rigid, new_receiver_motion, new_receiver_step, &
      receiver_motion_type, receiver_step_type, receiver_type
   use thud_ring_contact, only: ring_contact_type, solve_contact, update_sticking
   use thud_static_step, only: static_step_type
   use thud_surface_rings, only: surface_rings_type
   implicit none (type, external)
   private

   public :: ball_motion_type, new_ball_motion, stays_clear, take_step

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
      !> Force of all rings in the step, N.
      real(wp) :: force = 0.0_wp
      !> Energy given to the modes, most of which damping takes, J.
      real(wp) :: loss = 0.0_wp
      !> Energy given to the floor, and energy lost when gaps close within a step, J.
      real(wp) :: floor_work = 0.0_wp, contact_loss = 0.0_wp
      !> Whether the floor is mobile.
      logical :: floor_moves = .false.
      !> The floor, its steps, and its motion.
      type(receiver_type) :: floor
      type(receiver_step_type) :: floor_step
      type(receiver_motion_type) :: floor_motion
      !> Displacements of the rings by the modes without inertia, and their internal variables, m: [n_gap, 1 + n_branch].
      real(wp), allocatable :: static(:, :)
      !> Gaps at the end of the step, m: [n_gap].
      real(wp), allocatable :: last_gap(:)
      !> Workspace of a step: motion at its beginning; forces of the floor on the modes: [n_mode]; displacements of the outer
      !> surface and forces on it, U and V of each harmonic: [2*n_harmonic]; displacements of the rings by the modes
      !> without inertia, final and at the beginning: [n_gap].
      real(wp), allocatable :: before(:, :), mode_force(:), surface(:), load(:), yield(:), creep(:)
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

      associate (n_mode => size(modes%omega), n_variable => size(modes%factor, 2), n_gap => size(modes%shape_at_ring, 1), &
         n_load => size(modes%shape_at_ring, 2))
         allocate (state%motion(n_mode, n_variable), state%before(n_mode, n_variable), state%mode_force(n_mode), &
            state%static(n_gap, n_variable - 1), state%gap(n_gap), state%last_gap(n_gap), state%yield(n_gap), &
            state%creep(n_gap), state%reference_gap(n_gap), state%surface(n_load), state%load(n_load), source=0.0_wp)
      end associate
      state%reference_gap(::rings%n_dof) = -outer_radius*rings%height
      state%last_gap(::rings%n_dof) = outer_radius*(1 - rings%height)
      state%height = outer_radius
      state%velocity = -impact_velocity
      state%gravity = gravity
      state%floor_moves = .not. is_rigid(floor)
      state%floor = floor
      state%floor_step = new_receiver_step(floor, interval)
      state%floor_motion = new_receiver_motion(floor)
   end function new_ball_motion

   !> Whether the ball cannot touch a rigid floor again: it rises without gravity, and the energy of its modes, which
   !> decreases without forces, cannot bring any ring down.
   pure function stays_clear(modes, n_dof, state) result(yes)
      type(mode_step_type), intent(in) :: modes
      !> Degrees of freedom of a ring.
      integer, intent(in) :: n_dof
      type(ball_motion_type), intent(in) :: state
      logical :: yes
      real(wp) :: amplitude(size(modes%omega)), surface(size(state%surface)), reach(size(state%static, 1))
      integer :: i

      yes = .false.
      if (state%floor_moves .or. abs(state%gravity) > 0.0_wp .or. .not. state%velocity > 0.0_wp) return
      amplitude = sqrt(2*get_energies(modes, state%motion)/modes%equilibrium_ratio)/modes%omega
      surface = 0.0_wp
      do i = 1, size(amplitude)
         associate (k => 2*modes%harmonic(i) + 1)
            surface(k:k + 1) = surface(k:k + 1) + abs(modes%surface(i, :))*amplitude(i)
         end associate
      end do
      reach = maxval(abs(state%static), dim=2)
      call add_product(abs(modes%shape_at_ring), surface, reach)
      yes = all(state%reference_gap(::n_dof) + state%height > reach(::n_dof))
   end function stays_clear

   !> Advances ball and floor by one step, with forces between them that are constant in the step.
   subroutine take_step(modes, static, interval, mass, state, contact, error)
      type(mode_step_type), intent(in) :: modes
      type(static_step_type), intent(in) :: static
      !> Length of the step, s; mass of the ball, kg.
      real(wp), intent(in) :: interval, mass
      !> Motion of the ball.
      type(ball_motion_type), intent(inout) :: state
      !> The rings; their forces are set here.
      type(ring_contact_type), intent(inout) :: contact
      !> Set if the contact cannot be solved.
      type(error_type), allocatable, intent(out) :: error
      type(receiver_motion_type) :: floor_start
      integer :: i, n_mode, n_gap

      n_mode = size(modes%omega)
      associate (motion => state%motion, before => state%before, mode_force => state%mode_force, gap => state%gap, &
         creep => state%creep, &
         n_dof => contact%n_dof)
         ! Motion without contact forces.
         before = motion
         call advance(modes, before, motion)
         state%height = state%height + interval*(state%velocity - interval*state%gravity/2)
         state%velocity = state%velocity - interval*state%gravity
         floor_start = state%floor_motion
         if (state%floor_moves) call advance_receiver(state%floor_step, 0.0_wp, state%floor_motion)
         creep = state%static(:, 1)
         if (size(static%gain) == 1) then
            state%static = static%factor(1, 1)*state%static
         else
            state%static = matmul(state%static, transpose(static%factor))
         end if
         gap = state%reference_gap + state%static(:, 1)
         gap(::n_dof) = gap(::n_dof) + state%height + state%floor_motion%displacement
         call get_surface(modes, motion(:, index_amplitude), state%surface)
         state%surface = -state%surface
         call add_product(modes%shape_at_ring, state%surface, gap)
         call solve_contact(contact, gap, error)
         if (allocated(error)) return
         n_gap = contact%last_closed_gap
         state%force = sum(contact%force(:n_gap:n_dof))
         if (n_gap > 0) then
            ! Effect of the forces, and their work.
            state%velocity = state%velocity + interval*state%force/mass
            state%height = state%height + interval**2*state%force/(2*mass)
            associate (forces => contact%force(:n_gap))
               state%yield = 0.0_wp
               call add_product(static%flexibility(:, :n_gap), forces, state%yield)
               do i = 1, size(state%static, 2)
                  state%static(:, i) = state%static(:, i) + static%gain(i)*state%yield
               end do
               state%loss = state%loss + dot_product(forces, state%static(:n_gap, 1) - creep(:n_gap))
               if (n_mode > 0) then
                  state%load = 0.0_wp
                  call add_product(modes%ring_load(:, :n_gap), forces, state%load)
                  call get_mode_forces(modes, state%load, mode_force)
                  do i = 1, size(motion, 2)
                     motion(:, i) = motion(:, i) - modes%gain(:, i)*mode_force
                  end do
                  state%loss = state%loss - dot_product(mode_force, motion(:, index_amplitude) - before(:, index_amplitude))
               end if
               state%contact_loss = state%contact_loss - dot_product(forces, contact%gap(:n_gap) - state%last_gap(:n_gap))
            end associate
            if (state%floor_moves) then
               state%floor_motion = floor_start
               call advance_receiver(state%floor_step, state%force, state%floor_motion)
               state%floor_work = state%floor_work &
                  + state%force*(state%floor_motion%displacement - floor_start%displacement)
            end if
         end if
         call update_sticking(contact, state%reference_gap)
         state%last_gap = contact%gap
      end associate
   end subroutine take_step

end module thud_ball_motion
