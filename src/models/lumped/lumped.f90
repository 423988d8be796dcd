!> Impact of a source of a few masses: integrates in time from first touch until the source has left for good, through the
!> events between compression, restitution and flight, samples the forces, and checks the balances of impulse and energy. A
!> rigid floor is a receiver without states. Gravity is left out: a return by gravity is another impact.
module thud_lumped
   use thud_ball, only: drop_type, get_impact_velocity
   use thud_contact_source, only: coarse_step_error, contact_source_type
   use thud_coupled_step, only: coupled_state_type, get_relative_state, new_receiver_stages, receiver_stages_type, &
      take_coupled_step
   use thud_error, only: error_type, input_error, numerical_error
   use thud_force_history, only: add_model_quantity, force_history_type, max_residual, new_force_history
   use thud_interrupt, only: check_interrupt
   use thud_kinds, only: wp
   use thud_receiver, only: can_strike, get_receiver_velocity, is_rigid, new_receiver_motion, receiver_type
   use thud_rk4, only: rk4_step
   use thud_sampling, only: get_sample_count, sampling_type
   use thud_text, only: fixed, to_text
   use thud_zero_search, only: advance_search, is_converged, new_zero_search, update_bracket, zero_search_type
   implicit none (type, external)
   private

   public :: begin_contact, impact_type, solve_lumped

   !> Maximum number of times that the steps are halved.
   integer, parameter :: max_halvings = 6

   !> Maximum number of touches, releases and turning points in one step; more than a few mean that steps are too long.
   integer, parameter :: max_events = 100

   !> A light floor may stop the source, so that it never leaves. The floor has captured the source, and the contact ends, if
   !> kinetic energy and force times deflection are both below this fraction of the initial energy.
   real(wp), parameter :: capture_tolerance = 1.0e-12_wp

   !> Maximum number of Newton iterations for the first force, and the relative change that ends them.
   integer, parameter :: max_iterations = 50
   real(wp), parameter :: tolerance = 1.0e-12_wp

   !> Events that cut a step: turning point between compression and restitution, release, touch.
   integer, parameter :: no_event = 0, turning_point = 1, release = 2, touch = 3

   !> Impact in progress.
   type :: impact_type
      !> The source in its present phase.
      class(contact_source_type), allocatable :: source
      type(drop_type) :: drop
      !> The receiver, without states if it is rigid, and its response over a whole step.
      type(receiver_type) :: receiver
      type(receiver_stages_type) :: stages
      !> Whether the receiver can move.
      logical :: is_mobile = .false.
      !> Motion of source and floor, now and at the end of the step that is tried.
      type(coupled_state_type) :: motion, end
      !> Time since first touch, s; velocity at first touch, the scale of velocities, m/s.
      real(wp) :: time = 0.0_wp, velocity_scale = 0.0_wp
      !> Maximum force on the floor so far, N.
      real(wp) :: peak_force = 0.0_wp
      !> Number of contacts so far.
      integer :: n_contact = 0
      !> Whether the floor has captured the source, that is, stopped it for good.
      logical :: captured = .false.
   end type impact_type

contains

   !> Force history of one drop; the steps are halved until they are not too coarse for the source. Then the history states
   !> their length.
   subroutine solve_lumped(source, drop, sampling, component_name, history, error, receiver, model_history_name)
      !> The source before first touch.
      class(contact_source_type), intent(in) :: source
      type(drop_type), intent(in) :: drop
      !> Sampling rate, length of the record, substeps.
      type(sampling_type), intent(in) :: sampling
      !> Names of the components of the force: [n_component].
      character(len=*), intent(in) :: component_name(:)
      !> Force and motion from first touch on.
      type(force_history_type), intent(out) :: history
      !> Set if the equation fails, the contact outlasts the record, or the steps are too coarse.
      type(error_type), allocatable, intent(out) :: error
      !> The floor under the source (default: rigid).
      type(receiver_type), intent(in), optional :: receiver
      !> Names, with units, of additional quantities against time: [n_model_history].
      character(len=*), intent(in), optional :: model_history_name(:)
      type(impact_type) :: impact
      type(sampling_type) :: finer
      integer :: halving

      finer = sampling
      do halving = 0, max_halvings
         history = new_force_history(sampling%sample_rate, get_sample_count(sampling), component_name, model_history_name)
         history%impact_velocity = get_impact_velocity(drop)
         impact = new_impact(source, drop, 1/(finer%sample_rate*finer%substeps), receiver)
         call march(impact, finer, history, error)
         if (.not. allocated(error)) exit
         if (.not. error%has_coarse_steps .or. halving == max_halvings) return
         deallocate (error)
         finer%substeps = 2*finer%substeps
      end do
      if (halving > 0) call add_model_quantity(history, 'shortened_time_step', 's', &
         1/(sampling%sample_rate*finer%substeps))
   end subroutine solve_lumped

   !> An impact before its first contact.
   function new_impact(source, drop, step, receiver) result(impact)
      !> The source before first touch.
      class(contact_source_type), intent(in) :: source
      type(drop_type), intent(in) :: drop
      !> Length of the steps, s.
      real(wp), intent(in) :: step
      !> The floor under the source (default: rigid).
      type(receiver_type), intent(in), optional :: receiver
      type(impact_type) :: impact

      allocate (impact%source, source=source)
      impact%drop = drop
      impact%velocity_scale = get_impact_velocity(drop)
      impact%is_mobile = .not. is_rigid(receiver)
      if (impact%is_mobile) then
         impact%receiver = receiver
         impact%stages = new_receiver_stages(receiver, step)
      end if
      impact%motion%receiver_motion = new_receiver_motion(impact%receiver)
      allocate (impact%motion%state(source%n_state), impact%motion%acceleration(source%n_mass), source=0.0_wp)
      impact%motion%state(2:2*source%n_mass:2) = impact%velocity_scale
      impact%end = impact%motion
   end function new_impact

   !> Integrates in time from first touch to the end of the record, or until the source has left a rigid floor for good.
   subroutine march(impact, sampling, history, error)
      type(impact_type), intent(inout) :: impact
      type(sampling_type), intent(in) :: sampling
      !> Gets samples, maxima, scalars and the motion of the floor.
      type(force_history_type), intent(inout) :: history
      !> Set if the equations fail, the contact outlasts the record or a balance does not close.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: step
      integer :: i, j, n

      n = size(history%floor_force)
      step = 1/(sampling%sample_rate*sampling%substeps)
      if (impact%is_mobile) allocate (history%floor_displacement(n), history%floor_velocity(n), source=0.0_wp)
      call begin_contact(impact, error)
      if (allocated(error)) return
      samples: do i = 1, n
         call record(impact, i, history)
         do j = 0, sampling%substeps - 1
            impact%time = ((i - 1)*real(sampling%substeps, wp) + j)*step
            call advance(step, impact, history, error)
            if (allocated(error)) return
            if (.not. impact%is_mobile .and. has_left(impact)) exit samples
         end do
         call check_interrupt(error)
         if (allocated(error)) return
      end do samples
      if (has_left(impact)) then
         call finish(impact, history, error)
      else
         error = input_error('= '//to_text(sampling%duration)//' s ends while the source touches the floor or may touch ' &
            //'it again; allowed: longer', 'sampling', 'duration')
      end if
   end subroutine march

   !> Writes one sample into the history. Forces and the velocity of the floor may jump at first touch: their first sample is
   !> the mean of both sides.
   pure subroutine record(impact, i, history)
      type(impact_type), intent(in) :: impact
      !> Index of the sample.
      integer, intent(in) :: i
      type(force_history_type), intent(inout) :: history
      real(wp) :: center(2), state(impact%source%n_state)
      real(wp) :: share

      share = merge(0.5_wp, 1.0_wp, i == 1)
      state = get_relative_state(impact%source, impact%motion)
      center = impact%source%get_center_motion(state)
      history%deflection(i) = center(1)
      history%velocity(i) = center(2)
      if (impact%source%touching) then
         call impact%source%get_components(state, history%component(i, :), history%elastic_force(i))
         call raise_peaks(history%component(i, :), history%elastic_force(i), history)
         history%component(i, :) = share*history%component(i, :)
         history%floor_force(i) = sum(history%component(i, :))
      end if
      associate (motion => impact%motion)
         if (allocated(history%model_history)) history%model_history(i, :) = motion%state(1:2*impact%source%n_mass:2)
         if (.not. impact%is_mobile) return
         history%floor_displacement(i) = motion%receiver_motion%displacement
         history%floor_velocity(i) = share*motion%floor_velocity
         if (i > 1) history%floor_force(i) = motion%force
      end associate
   end subroutine record

   !> Advances source and floor by one step, through the events inside the step; stops early if the source has left a rigid
   !> floor.
   subroutine advance(step, impact, history, error)
      !> Length of the step, s.
      real(wp), intent(in) :: step
      type(impact_type), intent(inout) :: impact
      !> History, in which maxima and the time of the last release are updated.
      type(force_history_type), intent(inout) :: history
      !> Set if the equations fail or the step has too many events.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: remaining
      integer :: k, event

      remaining = step
      do k = 1, max_events
         call take_step(remaining, impact, error)
         if (allocated(error)) return
         event = get_event(impact)
         if (event == no_event) then
            call accept_step(remaining, impact)
            ! On a rigid floor the maxima of a single mass are those of turning points and samples.
            if (impact%source%n_mass > 1 .or. impact%is_mobile) call update_maxima(impact, history)
            return
         end if
         call go_to_event(event, remaining, impact, error)
         if (allocated(error)) return
         call pass_event(event, impact, history, error)
         if (allocated(error)) return
         if (.not. remaining > 0.0_wp .or. .not. impact%is_mobile .and. has_left(impact)) return
      end do
      error = coarse_step_error(to_text(max_events)//' touches, releases and turning points fall into one step')
   end subroutine advance

   !> Advances source and floor to an event.
   subroutine go_to_event(event, remaining, impact, error)
      !> The event, which lies before `impact%end`.
      integer, intent(in) :: event
      !> Time from `impact%time` to the end of the step, s.
      real(wp), intent(inout) :: remaining
      type(impact_type), intent(inout) :: impact
      !> Set if the equations fail.
      type(error_type), allocatable, intent(out) :: error
      type(zero_search_type) :: search

      search = new_zero_search(get_event_function(impact%source, event, impact%motion), remaining, &
         get_event_function(impact%source, event, impact%end))
      do while (.not. is_converged(search))
         call advance_search(search)
         call take_step(search%trial, impact, error)
         if (allocated(error)) return
         call update_bracket(search, get_event_function(impact%source, event, impact%end))
      end do
      call take_step(search%right, impact, error)
      if (allocated(error)) return
      call accept_step(search%right, impact)
      remaining = remaining - search%right
   end subroutine go_to_event

   !> Sets `impact%end`, the motion after a whole or shortened step.
   subroutine take_step(length, impact, error)
      !> Length of this step, s.
      real(wp), intent(in) :: length
      type(impact_type), intent(inout) :: impact
      !> Set if the step leaves the domain of the equations or cannot be solved.
      type(error_type), allocatable, intent(out) :: error
      logical :: inside, converged

      converged = .true.
      if (.not. impact%is_mobile) then
         call rk4_step(impact%source, impact%motion%state, length, impact%end%state, inside)
      else if (length < impact%stages%interval) then
         call take_coupled_step(impact%source, new_receiver_stages(impact%receiver, length), &
            impact%velocity_scale, impact%motion, impact%end, inside, converged)
      else
         call take_coupled_step(impact%source, impact%stages, impact%velocity_scale, impact%motion, &
            impact%end, inside, converged)
      end if
      if (.not. inside) then
         error = impact%source%get_failure(impact%drop, impact%time, get_relative_state(impact%source, impact%motion))
      else if (.not. converged) then
         error = coarse_step_error('the equations of a step '//to_text(1.0e3_wp*impact%time) &
            //' ms after first touch are not solved')
      end if
   end subroutine take_step

   !> Makes the end of a step the present motion.
   pure subroutine accept_step(length, impact)
      !> Length of the step, s.
      real(wp), intent(in) :: length
      type(impact_type), intent(inout) :: impact

      if (impact%is_mobile) then
         impact%motion = impact%end
      else
         impact%motion%state = impact%end%state
      end if
      impact%time = impact%time + length
   end subroutine accept_step

   !> Sets force and velocity of the floor at touch. The force depends on the velocity, and by the direct mobility of the
   !> receiver the velocity depends on the force. The part of the ball that lies flat on the floor (the cap) has no mass at
   !> first touch.
   pure subroutine begin_contact(impact, error)
      type(impact_type), intent(inout) :: impact
      !> Set if the force does not converge.
      type(error_type), allocatable, intent(out) :: error
      real(wp), dimension(impact%source%n_state) :: state, rate, slower, slower_rate
      real(wp) :: length, change
      integer :: k
      logical :: valid

      impact%n_contact = impact%n_contact + 1
      associate (source => impact%source, coupled => impact%motion, index => 2*impact%source%n_mass + 1)
         source%touching = .true.
         source%compressing = .true.
         coupled%force = 0.0_wp
         length = 1.0e-7_wp*impact%velocity_scale
         ! The force grows at most with the square of the velocity: Newton's method converges from one side.
         do k = 1, max_iterations
            coupled%floor_velocity = get_receiver_velocity(impact%receiver, coupled%force, coupled%receiver_motion)
            state = get_relative_state(source, coupled)
            slower = state
            slower(2) = state(2) - length
            call source%get_derivative(state, rate, valid)
            call source%get_derivative(slower, slower_rate, valid)
            change = (rate(index) - coupled%force) &
               /(1 + impact%receiver%direct*(rate(index) - slower_rate(index))/(state(2) - slower(2)))
            if (abs(change) <= epsilon(change)*abs(coupled%force)) exit
            coupled%force = coupled%force + change
         end do
         ! Written so that NaN fails too.
         if (.not. (valid .and. abs(change) <= tolerance*abs(coupled%force))) then
            error = numerical_error(fixed(1.0e3_wp*impact%time, 3)//' ms after first touch the first force of a contact ' &
               //'does not converge; allowed: a lower height, or a floor of lower mobility', 'drop')
            return
         end if
         coupled%acceleration = rate(2:2*source%n_mass:2)
         impact%peak_force = max(impact%peak_force, coupled%force)
      end associate
   end subroutine begin_contact

   !> Event that lies inside a step. Written so that NaN ends a contact.
   pure function get_event(impact) result(event)
      !> The impact; its `end` is the motion at the end of the step.
      type(impact_type), intent(in) :: impact
      integer :: event
      real(wp) :: state(impact%source%n_state)

      event = no_event
      ! A captured source has no further events.
      if (impact%captured) return
      state = get_relative_state(impact%source, impact%end)
      if (.not. impact%source%touching) then
         if (state(1) >= 0.0_wp) event = touch
      else if (impact%source%compressing) then
         if (.not. state(2) > 0.0_wp) event = turning_point
      else if (.not. state(1) > 0.0_wp) then
         event = release
      else if (state(2) > 0.0_wp) then
         ! The floor approaches again.
         event = turning_point
      end if
   end function get_event

   !> Quantity that falls to zero at an event: gap, deflection or velocity.
   pure function get_event_function(source, event, motion) result(value)
      class(contact_source_type), intent(in) :: source
      !> The event.
      integer, intent(in) :: event
      type(coupled_state_type), intent(in) :: motion
      !> Positive before the event, m or m/s.
      real(wp) :: value
      real(wp) :: state(source%n_state)

      state = get_relative_state(source, motion)
      select case (event)
      case (touch)
         value = -state(1)
      case (release)
         value = state(1)
      case default
         value = merge(state(2), -state(2), source%compressing)
      end select
   end function get_event_function

   !> Changes the phase at an event.
   pure subroutine pass_event(event, impact, history, error)
      !> The event.
      integer, intent(in) :: event
      type(impact_type), intent(inout) :: impact
      !> History, in which maxima and the time of release are set.
      type(force_history_type), intent(inout) :: history
      !> Set if the first force of a contact does not converge.
      type(error_type), allocatable, intent(out) :: error

      associate (coupled => impact%motion)
         select case (event)
         case (turning_point)
            call update_maxima(impact, history)
            impact%source%compressing = .not. impact%source%compressing
         case (release)
            call end_contact(impact, history)
            coupled%state(1) = coupled%receiver_motion%displacement
         case default
            coupled%state(1) = coupled%receiver_motion%displacement
            call begin_contact(impact, error)
         end select
      end associate
   end subroutine pass_event

   !> Ends a contact: the floor is free of force.
   pure subroutine end_contact(impact, history)
      type(impact_type), intent(inout) :: impact
      !> History, in which the contact time is set.
      type(force_history_type), intent(inout) :: history

      impact%source%touching = .false.
      history%contact_time = impact%time
      impact%motion%force = 0.0_wp
      impact%motion%floor_velocity = get_receiver_velocity(impact%receiver, 0.0_wp, impact%motion%receiver_motion)
   end subroutine end_contact

   !> Updates the maxima, and ends the contact if the floor has captured the source.
   pure subroutine update_maxima(impact, history)
      type(impact_type), intent(inout) :: impact
      !> History, in which maxima and contact time are set.
      type(force_history_type), intent(inout) :: history
      real(wp) :: center(2), components(size(history%component, 2)), state(impact%source%n_state)
      real(wp) :: elastic_force

      if (.not. impact%source%touching) return
      state = get_relative_state(impact%source, impact%motion)
      center = impact%source%get_center_motion(state)
      history%max_deflection = max(history%max_deflection, center(1))
      call impact%source%get_components(state, components, elastic_force)
      call raise_peaks(components, elastic_force, history)
      if (.not. impact%is_mobile) return
      associate (source => impact%source, coupled => impact%motion)
         impact%peak_force = max(impact%peak_force, coupled%force)
         impact%captured = max(maxval(coupled%state(2:2*source%n_mass:2)**2), coupled%force*state(1)/source%mass) &
            <= capture_tolerance*impact%velocity_scale**2
      end associate
      if (impact%captured) call end_contact(impact, history)
   end subroutine update_maxima

   !> Raises the maxima of the forces by those of one instant.
   pure subroutine raise_peaks(components, elastic_force, history)
      !> Components of the force on the floor, N: [n_component].
      real(wp), intent(in) :: components(:)
      !> Force without the flux of momentum, N.
      real(wp), intent(in) :: elastic_force
      type(force_history_type), intent(inout) :: history

      history%peak_elastic_force = max(history%peak_elastic_force, elastic_force)
      history%peak_force = max(history%peak_force, history%peak_elastic_force, sum(components))
   end subroutine raise_peaks

   !> Whether the source has left the floor for good, or the floor has captured it.
   pure function has_left(impact) result(left)
      type(impact_type), intent(in) :: impact
      logical :: left
      real(wp) :: center(2)
      real(wp) :: gap

      left = .not. impact%source%touching
      if (.not. left .or. impact%captured) return
      associate (source => impact%source, state => get_relative_state(impact%source, impact%motion))
         center = source%get_center_motion(state)
         ! Minimum gap between the first mass, which oscillates about the center of mass, and the floor, m.
         gap = -(center(1) + source%get_amplitude(state))
      end associate
      left = .not. can_strike(impact%receiver, impact%motion%receiver_motion, gap, -center(2) - impact%motion%floor_velocity)
   end function has_left

   !> Sets the scalars of the impact from the state at its end, and checks the balances.
   subroutine finish(impact, history, error)
      type(impact_type), intent(in) :: impact
      !> The history; its samples are complete.
      type(force_history_type), intent(inout) :: history
      !> Set if a balance does not close.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: center(2)
      real(wp) :: energy, momentum
      integer :: n

      ! After the last contact the samples show no motion.
      associate (first => floor(history%contact_time*history%sample_rate) + 2)
         history%deflection(first:) = 0.0_wp
         history%velocity(first:) = 0.0_wp
         if (allocated(history%model_history)) history%model_history(first:, :) = 0.0_wp
      end associate
      if (impact%is_mobile) then
         history%floor_work = impact%motion%work
         history%peak_force = impact%peak_force
         call add_model_quantity(history, 'contacts', '', real(impact%n_contact, wp))
         n = size(history%component_name)
         if (impact%source%cap_mass_per_deflection > 0.0_wp) then
            ! Inertia of the cap that lies on the floor.
            history%component_name = [character(len=len(history%component_name)) :: history%component_name, 'cap_force']
            history%component = reshape([history%component, history%floor_force - sum(history%component, dim=2)], &
               [size(history%floor_force), n + 1])
         end if
      end if
      center = impact%source%get_center_motion(impact%motion%state)
      associate (source => impact%source, v0 => history%impact_velocity, velocity => center(2), mass => impact%source%mass, &
         state => impact%motion%state, last => 2*impact%source%n_mass)
         history%restitution = -velocity/v0
         momentum = mass*(v0 - velocity)
         energy = mass/2*v0**2
         history%impulse = state(last + 1)
         history%impulse_residual = abs(history%impulse - momentum)/momentum
         history%energy_residual = abs(mass/2*velocity**2 + state(last + 2) + history%floor_work &
            + source%get_inner_energy(state) - energy)/energy
      end associate
      ! Written so that NaN fails too.
      if (.not. max(history%impulse_residual, history%energy_residual) <= max_residual) then
         error = coarse_step_error('the balance of impulse misses by '//to_text(history%impulse_residual) &
            //' and that of energy by '//to_text(history%energy_residual)//', more than '//to_text(max_residual))
      end if
   end subroutine finish

end module thud_lumped
