!> Impact of a source of a few masses: integrates in time from first touch until the source has left for good, samples the
!> forces, and checks the balances of impulse and energy. A rigid floor is a receiver without states. Gravity is left out: a
!> return by gravity is another impact.
module thud_lumped
   use thud_contact_phases, only: begin_contact, get_event, get_event_function, has_left, impact_type, no_event, &
      pass_event, raise_peaks, update_maxima
   use thud_contact_source, only: coarse_step_error, contact_source_type
   use thud_coupled_step, only: get_relative_state, take_coupled_step
   use thud_drop, only: drop_type, get_impact_velocity
   use thud_error, only: error_type, input_error
   use thud_force_history, only: add_model_quantity, check_samples, clear_flight, force_history_type, max_residual, &
      new_force_history
   use thud_interrupt, only: check_interrupt
   use thud_kinds, only: wp
   use thud_receiver, only: is_rigid, new_receiver_motion, receiver_type
   use thud_receiver_stages, only: new_receiver_stages
   use thud_rk4, only: longest_valid, rk4_step
   use thud_sampling, only: check_contact_samples, get_sample_count, sampling_type
   use thud_text, only: to_text
   use thud_zero_search, only: advance_search, is_converged, new_zero_search, update_bracket, zero_search_type
   implicit none (type, external)
   private

   public :: solve_lumped

   !> Maximum number of times that the steps are halved.
   integer, parameter :: max_halvings = 6

   !> Maximum number of touches, releases and turning points in one step; more than a few mean that steps are too long.
   integer, parameter :: max_events = 100

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
      class(contact_source_type), allocatable :: moving
      type(sampling_type) :: finer
      integer :: halving

      finer = sampling
      do halving = 0, max_halvings
         moving = source
         history = new_force_history(sampling%sample_rate, get_sample_count(sampling), component_name, model_history_name)
         history%impact_velocity = get_impact_velocity(drop)
         call march(moving, drop, finer, history, error, receiver)
         if (.not. allocated(error)) exit
         if (.not. error%has_coarse_steps .or. halving == max_halvings) return
         deallocate (error)
         finer%substeps = 2*finer%substeps
      end do
      if (halving > 0) call add_model_quantity(history, 'shortened_time_step', 's', &
         1/(sampling%sample_rate*finer%substeps))
      call check_contact_samples(sampling, history%contact_time, error)
      if (.not. allocated(error)) call check_samples(history, error)
   end subroutine solve_lumped

   !> Integrates in time from first touch to the end of the record, or until the source has left a rigid floor for good.
   subroutine march(source, drop, sampling, history, error, receiver)
      class(contact_source_type), intent(inout) :: source
      type(drop_type), intent(in) :: drop
      type(sampling_type), intent(in) :: sampling
      !> Gets samples, maxima, scalars and the motion of the floor.
      type(force_history_type), intent(inout) :: history
      !> Set if the equations fail, the contact outlasts the record or a balance does not close.
      type(error_type), allocatable, intent(out) :: error
      !> The floor under the source (default: rigid).
      type(receiver_type), intent(in), optional :: receiver
      type(impact_type) :: impact
      real(wp) :: step
      integer :: i, j, n

      n = size(history%floor_force)
      step = 1/(sampling%sample_rate*sampling%substeps)
      impact%is_mobile = .not. is_rigid(receiver)
      if (impact%is_mobile) then
         impact%receiver = receiver
         impact%stages = new_receiver_stages(receiver, step)
         allocate (history%floor_displacement(n), history%floor_velocity(n), source=0.0_wp)
      end if
      impact%velocity_scale = history%impact_velocity
      impact%motion%receiver_motion = new_receiver_motion(impact%receiver)
      allocate (impact%motion%state(source%n_state), impact%motion%acceleration(source%n_mass), source=0.0_wp)
      impact%motion%state(2:2*source%n_mass:2) = history%impact_velocity
      impact%end = impact%motion
      call begin_contact(source, impact, error)
      if (allocated(error)) return
      samples: do i = 1, n
         call record(source, impact, i, history)
         do j = 0, sampling%substeps - 1
            impact%time = ((i - 1)*real(sampling%substeps, wp) + j)*step
            call advance(source, drop, step, impact, history, error)
            if (allocated(error)) return
            if (.not. impact%is_mobile .and. has_left(source, impact)) exit samples
         end do
         call check_interrupt(error)
         if (allocated(error)) return
      end do samples
      if (source%touching) then
         error = input_error('&sampling: duration = '//to_text(sampling%duration) &
            //' s ends while the source is still in contact; allowed: longer than the contact')
      else if (.not. has_left(source, impact)) then
         error = input_error('&sampling: duration = '//to_text(sampling%duration) &
            //' s ends while the source may touch the floor again; allowed: longer')
      else
         call finish(source, impact, history, error)
      end if
   end subroutine march

   !> Writes one sample into the history. Forces and the velocity of the floor may jump at first touch: their first sample is
   !> the mean of both sides.
   pure subroutine record(source, impact, i, history)
      class(contact_source_type), intent(in) :: source
      type(impact_type), intent(in) :: impact
      !> Index of the sample.
      integer, intent(in) :: i
      type(force_history_type), intent(inout) :: history
      real(wp) :: center(2), state(source%n_state)
      real(wp) :: share

      share = merge(0.5_wp, 1.0_wp, i == 1)
      state = get_relative_state(source, impact%motion)
      center = source%get_center_motion(state)
      history%deflection(i) = center(1)
      history%velocity(i) = center(2)
      if (source%touching) then
         call source%get_components(state, history%component(i, :), history%elastic_force(i))
         call raise_peaks(history%component(i, :), history%elastic_force(i), history)
         history%component(i, :) = share*history%component(i, :)
         history%floor_force(i) = sum(history%component(i, :))
      end if
      associate (motion => impact%motion)
         if (allocated(history%model_history)) history%model_history(i, :) = motion%state(1:2*source%n_mass:2)
         if (.not. impact%is_mobile) return
         history%floor_displacement(i) = motion%receiver_motion%displacement
         history%floor_velocity(i) = share*motion%floor_velocity
         if (i > 1) history%floor_force(i) = motion%force
      end associate
   end subroutine record

   !> Advances source and floor by one step, through the events inside the step; stops early if the source has left a rigid
   !> floor.
   subroutine advance(source, drop, step, impact, history, error)
      class(contact_source_type), intent(inout) :: source
      type(drop_type), intent(in) :: drop
      !> Length of the step, s.
      real(wp), intent(in) :: step
      type(impact_type), intent(inout) :: impact
      !> History, in which maxima and the time of the last release are updated.
      type(force_history_type), intent(inout) :: history
      !> Set if the equations fail or the step has too many events.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: remaining, longest
      integer :: k, event
      logical :: valid

      remaining = step
      do k = 1, max_events
         call take_step(source, drop, remaining, impact, valid, error)
         if (.not. valid) then
            longest = longest_valid(source, impact%time, impact%motion%state, remaining)
            call rk4_step(source, impact%time, impact%motion%state, longest, impact%end%state, valid)
            error = source%get_failure(drop, impact%time + longest, impact%end%state)
         end if
         if (allocated(error)) return
         event = no_event
         ! A captured source has no further events.
         if (.not. impact%captured) event = get_event(source, impact%end)
         if (event == no_event) then
            call accept_step(remaining, impact)
            ! On a rigid floor the maxima of a single mass are those of turning points and samples.
            if (source%n_mass > 1 .or. impact%is_mobile) call update_maxima(source, impact, history)
            return
         end if
         call go_to_event(source, drop, event, remaining, impact, error)
         if (allocated(error)) return
         call pass_event(source, event, impact, history, error)
         if (allocated(error)) return
         if (.not. remaining > 0.0_wp .or. .not. impact%is_mobile .and. has_left(source, impact)) return
      end do
      error = coarse_step_error(to_text(max_events)//' touches, releases and turning points fall into one step')
   end subroutine advance

   !> Advances source and floor to an event.
   subroutine go_to_event(source, drop, event, remaining, impact, error)
      class(contact_source_type), intent(in) :: source
      type(drop_type), intent(in) :: drop
      !> The event, which lies before `impact%end`.
      integer, intent(in) :: event
      !> Time from `impact%time` to the end of the step, s.
      real(wp), intent(inout) :: remaining
      type(impact_type), intent(inout) :: impact
      !> Set if the equations fail.
      type(error_type), allocatable, intent(out) :: error
      type(zero_search_type) :: search
      logical :: valid

      search = new_zero_search(get_event_function(source, event, impact%motion), remaining, &
         get_event_function(source, event, impact%end))
      do while (.not. is_converged(search))
         call advance_search(search)
         call take_step(source, drop, search%trial, impact, valid, error)
         if (allocated(error)) return
         call update_bracket(search, get_event_function(source, event, impact%end))
      end do
      call take_step(source, drop, search%right, impact, valid, error)
      if (allocated(error)) return
      call accept_step(search%right, impact)
      remaining = remaining - search%right
   end subroutine go_to_event

   !> Sets `impact%end`, the motion after a whole or shortened step.
   subroutine take_step(source, drop, length, impact, valid, error)
      class(contact_source_type), intent(in) :: source
      type(drop_type), intent(in) :: drop
      !> Length of this step, s.
      real(wp), intent(in) :: length
      type(impact_type), intent(inout) :: impact
      !> False if the step leaves the domain of the equations on a rigid floor; then the end is the present motion.
      logical, intent(out) :: valid
      !> Set if a step on a mobile floor leaves the domain or cannot be solved.
      type(error_type), allocatable, intent(out) :: error
      logical :: inside, converged

      valid = .true.
      if (.not. impact%is_mobile) then
         call rk4_step(source, impact%time, impact%motion%state, length, impact%end%state, valid)
         return
      end if
      if (length < impact%stages%interval) then
         call take_coupled_step(source, new_receiver_stages(impact%receiver, length), impact%time, impact%velocity_scale, &
            impact%motion, impact%end, inside, converged)
      else
         call take_coupled_step(source, impact%stages, impact%time, impact%velocity_scale, impact%motion, impact%end, &
            inside, converged)
      end if
      if (.not. inside) then
         error = source%get_failure(drop, impact%time, get_relative_state(source, impact%motion))
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

   !> Sets the scalars of the impact from the state at its end, and checks the balances.
   subroutine finish(source, impact, history, error)
      class(contact_source_type), intent(in) :: source
      type(impact_type), intent(in) :: impact
      !> The history; its samples are complete.
      type(force_history_type), intent(inout) :: history
      !> Set if a balance does not close.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: center(2)
      real(wp) :: energy, momentum
      integer :: n

      call clear_flight(history)
      if (impact%is_mobile) then
         history%floor_work = impact%motion%work
         history%peak_force = impact%peak_force
         call add_model_quantity(history, 'contacts', '', real(impact%n_contact, wp))
         n = size(history%component_name)
         if (source%cap_mass_per_deflection > 0.0_wp) then
            ! Inertia of the cap that lies on the floor.
            history%component_name = [character(len=len(history%component_name)) :: history%component_name, 'cap_force']
            history%component = reshape([history%component, history%floor_force - sum(history%component, dim=2)], &
               [size(history%floor_force), n + 1])
         end if
      end if
      center = source%get_center_motion(impact%motion%state)
      associate (v0 => history%impact_velocity, velocity => center(2), mass => source%mass, state => impact%motion%state, &
         last => 2*source%n_mass)
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
