!> The modal ball and the floor under it in motion, step by step.
module thud_modal_run
   use thud_ball, only: ball_type
   use thud_constants, only: pi
   use thud_error, only: error_type, input_error, numerical_error
   use thud_force_history, only: add_model_quantity, add_to_means, force_history_type, max_residual, new_force_history
   use thud_interrupt, only: check_interrupt
   use thud_kinds, only: wp
   use thud_mode_step, only: advance, get_energies, get_mode_forces, get_surface, index_amplitude, mode_step_type, &
      static_step_type
   use thud_product, only: add_product
   use thud_receiver, only: advance_receiver, can_strike, is_rigid, new_receiver_motion, receiver_motion_type, &
      receiver_step_type, receiver_type
   use thud_ring_contact, only: ring_contact_type, solve_contact, update_sticking
   use thud_sampling, only: get_sample_count, sampling_type
   use thud_surface_rings, only: surface_rings_type
   use thud_text, only: fixed, significant, to_text
   implicit none (type, external)
   private

   public :: march, modal_run_type, start_run

   !> Number of harmonics whose energies are recorded separately, from n = 0 on.
   integer, parameter :: n_family = 6

   !> A run: what its steps need, and the motion.
   type :: modal_run_type
      type(ball_type) :: ball
      !> Length of a step, s.
      real(wp) :: interval = 0.0_wp
      !> Steps of the modes that oscillate, and of those without inertia.
      type(mode_step_type) :: modes
      type(static_step_type) :: static_modes
      type(surface_rings_type) :: rings
      !> The rings that touch, and their forces.
      type(ring_contact_type) :: contact
      !> Amplitudes of the modes, m sqrt(kg), their rates and the internal variables of their
      !> Maxwell branches: [n_mode, 2 + n_branch].
      real(wp), allocatable :: motion(:, :)
      !> Height of the center of mass, m.
      real(wp) :: height = 0.0_wp
      !> Upward velocity of the center of mass, m/s.
      real(wp) :: velocity = 0.0_wp
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
   end type modal_run_type

contains

   !> Puts the ball at first touch.
   pure subroutine start_run(run, velocity, gravity)
      !> The run; its steps, rings and floor are set.
      type(modal_run_type), intent(inout) :: run
      !> Velocity at first touch, m/s; gravity during the contact, m/s2.
      real(wp), intent(in) :: velocity, gravity

      associate (n_mode => size(run%modes%omega), n_variable => size(run%modes%factor, 2), &
         n_gap => size(run%modes%shape_at_ring, 1), n_load => size(run%modes%shape_at_ring, 2))
         allocate (run%motion(n_mode, n_variable), run%before(n_mode, n_variable), run%mode_force(n_mode), &
            run%static(n_gap, n_variable - 1), run%gap(n_gap), run%last_gap(n_gap), run%yield(n_gap), run%creep(n_gap), &
            run%reference_gap(n_gap), run%surface(n_load), run%load(n_load), source=0.0_wp)
      end associate
      associate (n_dof => run%rings%n_dof, radius => run%ball%outer_radius)
         run%reference_gap(::n_dof) = -radius*run%rings%height
         run%last_gap(::n_dof) = radius*(1 - run%rings%height)
         run%height = radius
      end associate
      run%velocity = -velocity
      run%gravity = gravity
      run%floor_moves = .not. is_rigid(run%floor)
      run%floor_motion = new_receiver_motion(run%floor)
   end subroutine start_run

   !> Integrates in time from first touch until the ball has left for good, or on a mobile floor to the end of the record.
   subroutine march(run, sampling, history, error)
      !> The ball at first touch.
      type(modal_run_type), intent(inout) :: run
      type(sampling_type), intent(in) :: sampling
      type(force_history_type), intent(out) :: history
      !> Set if the contact outlasts the record, or if too much energy is lost in the contact.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: settling_time, before, fraction, clearance, last_clearance
      integer :: i, j, n_step, last_contact, nearest
      logical :: has_separated

      history = new_force_history(sampling%sample_rate, get_sample_count(sampling), ['contact_force'], &
         [character(len=24) :: 'contact_radius_m', ('energy_n'//to_text(i)//'_J', i=0, n_family - 1), 'energy_rest_J'])
      history%has_means = .true.
      history%impact_velocity = -run%velocity
      if (run%floor_moves) allocate (history%floor_displacement, history%floor_velocity, source=history%floor_force)
      ! The surface may touch again while the slowest mode swings back, half a period later.
      settling_time = 0.0_wp
      if (size(run%modes%omega) > 0) settling_time = pi/(sqrt(run%modes%damping%equilibrium_ratio)*minval(run%modes%omega))
      last_contact = 0
      clearance = 0.0_wp
      has_separated = .false.
      samples: do i = 1, size(history%floor_force)
         call record_motion(run, i, history)
         do j = 1, sampling%substeps
            n_step = (i - 1)*sampling%substeps + j
            fraction = min(1.0_wp, max(0.0_wp, j - sampling%substeps/2.0_wp))
            before = run%floor_motion%displacement
            call take_step(run, error)
            call check_interrupt(error)
            if (allocated(error)) return
            last_clearance = clearance
            clearance = minval(run%gap(::run%contact%n_dof))
            if (run%contact%outermost > 0) then
               last_contact = n_step
               history%impulse = history%impulse + run%force*run%interval
               history%step_peak_force = max(history%step_peak_force, run%force)
               call add_to_means(run%force*run%interval, 1/sampling%sample_rate, i, fraction, history%component(:, 1))
               nearest = min(i + nint(fraction), size(history%floor_force))
               history%model_history(nearest, 1) = max(history%model_history(nearest, 1), &
                  run%ball%outer_radius*run%rings%radius(run%contact%outermost))
            else if (n_step == last_contact + 1) then
               ! Forces are means over a step that close the gaps at its end.
               history%exact_contact_time = (n_step - 0.5_wp - clearance/(clearance - last_clearance))*run%interval
            end if
            if (run%contact%outermost == size(run%rings%radius)) then
               error = numerical_error('= '//to_text(run%ball%youngs_modulus)//' Pa is too low for this drop: ' &
                  //significant(1.0e3_wp*n_step*run%interval, 3)//' ms after first touch the ball lies on its outermost ' &
                  //'ring, its center lowered by '//significant(1.0e3_wp*(run%ball%outer_radius - run%height), 3)//' mm; ' &
                  //'allowed: a stiffer ball, or a lower height', 'ball', 'youngs_modulus')
               return
            end if
            if (run%floor_moves) call add_to_means(run%floor_motion%displacement - before, 1/sampling%sample_rate, i, &
               fraction, history%floor_velocity)
            has_separated = run%velocity > 0.0_wp .and. (n_step - last_contact)*run%interval > settling_time
            if (has_separated .and. .not. run%floor_moves) exit samples
         end do
         if (run%contact%outermost == 0 .and. .not. run%floor_moves) then
            ! Without gravity the end is often certain sooner.
            has_separated = stays_clear(run)
            if (has_separated) exit samples
         end if
      end do samples
      if (run%floor_moves) history%velocity = history%velocity - history%floor_velocity
      call check_end(run, sampling, settling_time, has_separated, error)
      if (allocated(error)) return
      history%contact_time = last_contact*run%interval
      call finish(run, n_step*run%interval, history, error)
   end subroutine march

   !> Whether the ball cannot touch a rigid floor again: it rises without gravity, and the energy of its modes, which
   !> decreases without forces, cannot bring any ring down.
   pure function stays_clear(run) result(yes)
      type(modal_run_type), intent(in) :: run
      logical :: yes
      real(wp) :: amplitude(size(run%modes%omega)), surface(size(run%surface)), reach(size(run%static, 1))
      integer :: i

      yes = .false.
      if (run%floor_moves .or. abs(run%gravity) > 0.0_wp .or. .not. run%velocity > 0.0_wp) return
      associate (modes => run%modes)
         amplitude = sqrt(2*get_energies(modes, run%motion)/modes%damping%equilibrium_ratio)/modes%omega
         surface = 0.0_wp
         do i = 1, size(amplitude)
            associate (k => 2*modes%harmonic(i) + 1)
               surface(k:k + 1) = surface(k:k + 1) + abs(modes%surface(i, :))*amplitude(i)
            end associate
         end do
         reach = maxval(abs(run%static), dim=2)
         call add_product(abs(modes%shape_at_ring), surface, reach)
      end associate
      yes = all(run%reference_gap(::run%rings%n_dof) + run%height > reach(::run%rings%n_dof))
   end function stays_clear

   !> Advances ball and floor by one step, with forces between them that are constant in the step.
   subroutine take_step(run, error)
      type(modal_run_type), intent(inout) :: run
      !> Set if the contact cannot be solved.
      type(error_type), allocatable, intent(out) :: error
      type(receiver_motion_type) :: floor_start
      integer :: i, n_gap

      associate (modes => run%modes, static_modes => run%static_modes, contact => run%contact, interval => run%interval, &
         motion => run%motion, before => run%before, mode_force => run%mode_force, gap => run%gap, creep => run%creep, &
         n_dof => run%contact%n_dof)
         ! Motion without contact forces.
         before = motion
         call advance(modes, before, motion)
         run%height = run%height + interval*(run%velocity - interval*run%gravity/2)
         run%velocity = run%velocity - interval*run%gravity
         floor_start = run%floor_motion
         if (run%floor_moves) call advance_receiver(run%floor_step, 0.0_wp, run%floor_motion)
         creep = run%static(:, 1)
         if (size(static_modes%gain) == 1) then
            run%static = static_modes%factor(1, 1)*run%static
         else
            run%static = matmul(run%static, transpose(static_modes%factor))
         end if
         gap = run%reference_gap + run%static(:, 1)
         gap(::n_dof) = gap(::n_dof) + run%height + run%floor_motion%displacement
         call get_surface(modes, motion(:, index_amplitude), run%surface)
         run%surface = -run%surface
         call add_product(modes%shape_at_ring, run%surface, gap)
         call solve_contact(contact, gap, error)
         if (allocated(error)) return
         n_gap = contact%last_closed_gap
         run%force = sum(contact%force(:n_gap:n_dof))
         if (n_gap > 0) then
            ! Effect of the forces, and their work.
            run%velocity = run%velocity + interval*run%force/run%ball%mass
            run%height = run%height + interval**2*run%force/(2*run%ball%mass)
            associate (forces => contact%force(:n_gap))
               run%yield = 0.0_wp
               call add_product(static_modes%flexibility(:, :n_gap), forces, run%yield)
               do i = 1, size(run%static, 2)
                  run%static(:, i) = run%static(:, i) + static_modes%gain(i)*run%yield
               end do
               run%loss = run%loss + dot_product(forces, run%static(:n_gap, 1) - creep(:n_gap))
               if (size(motion, 1) > 0) then
                  run%load = 0.0_wp
                  call add_product(modes%ring_load(:, :n_gap), forces, run%load)
                  call get_mode_forces(modes, run%load, mode_force)
                  do i = 1, size(motion, 2)
                     motion(:, i) = motion(:, i) - modes%gain(:, i)*mode_force
                  end do
                  run%loss = run%loss - dot_product(mode_force, motion(:, index_amplitude) - before(:, index_amplitude))
               end if
               run%contact_loss = run%contact_loss - dot_product(forces, contact%gap(:n_gap) - run%last_gap(:n_gap))
            end associate
            if (run%floor_moves) then
               run%floor_motion = floor_start
               call advance_receiver(run%floor_step, run%force, run%floor_motion)
               run%floor_work = run%floor_work &
                  + run%force*(run%floor_motion%displacement - floor_start%displacement)
            end if
         end if
         call update_sticking(contact, run%reference_gap)
         run%last_gap = contact%gap
      end associate
   end subroutine take_step

   !> Returns an error if the record ends too early.
   subroutine check_end(run, sampling, settling_time, has_separated, error)
      type(modal_run_type), intent(in) :: run
      type(sampling_type), intent(in) :: sampling
      !> Time without contact after which the surface no longer touches, s.
      real(wp), intent(in) :: settling_time
      !> Whether this time has passed and the ball rises.
      logical, intent(in) :: has_separated
      !> Set if the ball touches the floor or may touch it again.
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: cause

      cause = '; allowed: longer than that'
      if (run%floor_moves) cause = ', probably because the floor is so soft that the ball sinks into it instead of ' &
         //'rebounding; allowed: a stiffer floor, covering or floating plate, or a longer duration'
      if (.not. has_separated) then
         error = input_error('= '//to_text(sampling%duration)//' s ends less than '//fixed(1.0e3_wp*settling_time, 1) &
            //' ms after the last contact'//cause, 'sampling', 'duration')
      else if (run%floor_moves) then
         if (can_strike(run%floor, run%floor_motion, minval(run%gap(::run%contact%n_dof)), &
            run%velocity)) error = input_error('= '//to_text(sampling%duration)//' s ends while the floor may strike the ' &
            //'ball again; allowed: longer', 'sampling', 'duration')
      end if
   end subroutine check_end

   !> Sets the scalars of the impact, and checks the balances.
   subroutine finish(run, time, history, error)
      !> The ball after the contact.
      type(modal_run_type), intent(in) :: run
      !> Time since first touch, s.
      real(wp), intent(in) :: time
      !> The history; its samples are complete.
      type(force_history_type), intent(inout) :: history
      !> Set if the balance of energy does not close.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: energy, gain, initial

      history%elastic_force = history%component(:, 1)
      history%floor_force = history%component(:, 1)
      history%peak_force = maxval(history%floor_force)
      history%peak_elastic_force = history%peak_force
      history%max_deflection = maxval(history%deflection, mask=history%floor_force > 0.0_wp)
      ! Extrapolated back to the end of the contact.
      history%restitution = (run%velocity + run%gravity*(time - history%contact_time))/history%impact_velocity
      gain = run%ball%mass*(history%impact_velocity + run%velocity + run%gravity*time)
      history%impulse_residual = abs(history%impulse - gain)/gain
      history%floor_work = run%floor_work
      call add_model_quantity(history, 'contact_loss', 'J', run%contact_loss)
      initial = run%ball%mass/2*history%impact_velocity**2
      energy = run%ball%mass*(run%velocity**2/2 + run%gravity*(run%height - run%ball%outer_radius)) &
         + run%loss + run%contact_loss + run%floor_work
      history%energy_residual = abs(energy - initial)/initial
      ! Written so that NaN fails too.
      if (.not. history%energy_residual <= max_residual) error = numerical_error('is too low: the balance of energy ' &
         //'misses by '//to_text(history%energy_residual)//'; allowed: up to '//to_text(max_residual), 'sampling', &
         'substeps')
   end subroutine finish

   !> Writes motion and energies of one sample into the history.
   pure subroutine record_motion(run, i, history)
      type(modal_run_type), intent(in) :: run
      !> Index of the sample.
      integer, intent(in) :: i
      type(force_history_type), intent(inout) :: history
      real(wp) :: energy(size(run%modes%omega))
      integer :: n

      history%deflection(i) = run%ball%outer_radius - run%height - run%floor_motion%displacement
      history%velocity(i) = -run%velocity
      if (run%floor_moves) history%floor_displacement(i) = run%floor_motion%displacement
      energy = get_energies(run%modes, run%motion)
      associate (n_harmonic => ubound(run%modes%first, 1))
         do n = 0, min(n_family, n_harmonic) - 1
            history%model_history(i, 2 + n) = sum(energy(run%modes%first(n):run%modes%first(n + 1) - 1))
         end do
         history%model_history(i, 2 + n_family) = sum(energy(run%modes%first(min(n_family, n_harmonic)):))
      end associate
   end subroutine record_motion

end module thud_modal_run
