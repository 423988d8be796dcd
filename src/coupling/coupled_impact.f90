!> Impact of a lumped source on a mobile floor: integrates every contact of the record in time and checks that the source has
!> left for good. Gravity is left out, as on a rigid floor: a return by gravity is another impact.
module thud_coupled_impact
   use thud_contact_source, only: coarse_step_error, contact_source_type, many_events_error, max_events
   use thud_coupled_phases, only: begin_contact, get_event, get_event_function, impact_type, no_event, pass_event, &
      update_maxima
   use thud_coupled_step, only: coupled_state_type, get_relative_state, take_coupled_step
   use thud_drop, only: drop_type
   use thud_error, only: error_type, input_error
   use thud_force_history, only: add_model_quantity, clear_flight, force_history_type
   use thud_interrupt, only: check_interrupt
   use thud_kinds, only: wp
   use thud_receiver, only: can_strike, new_receiver_motion, receiver_type
   use thud_receiver_stages, only: new_receiver_stages
   use thud_sampling, only: sampling_type
   use thud_text, only: to_text
   use thud_zero_search, only: advance_search, is_converged, new_zero_search, update_bracket, zero_search_type
   implicit none (type, external)
   private

   public :: solve_coupled

contains

   !> Force history of one drop; the caller checks contact time and balances.
   subroutine solve_coupled(source, drop, sampling, n_step, receiver, history, state, error)
      !> The source before first touch.
      class(contact_source_type), intent(inout) :: source
      type(drop_type), intent(in) :: drop
      type(sampling_type), intent(in) :: sampling
      !> Steps per sampling interval.
      integer, intent(in) :: n_step
      !> The floor under the source.
      type(receiver_type), intent(in) :: receiver
      !> The history, prepared by the source; samples, maxima, contact time and the motion of the floor are set here.
      type(force_history_type), intent(inout) :: history
      !> State at the end of the record, not relative to the floor: [n_state].
      real(wp), intent(out) :: state(:)
      !> Set if the equations fail or the contact outlasts the record.
      type(error_type), allocatable, intent(out) :: error
      type(impact_type) :: impact
      real(wp) :: step
      integer :: i, j, n

      step = 1/(sampling%sample_rate*n_step)
      n = size(history%floor_force)
      allocate (history%floor_displacement(n), history%floor_velocity(n), source=0.0_wp)
      impact%receiver = receiver
      impact%stages = new_receiver_stages(receiver, step)
      impact%velocity_scale = history%impact_velocity
      impact%motion%receiver_motion = new_receiver_motion(receiver)
      allocate (impact%motion%displacement(source%n_mass), impact%motion%acceleration(source%n_mass), source=0.0_wp)
      allocate (impact%motion%velocity(source%n_mass), source=history%impact_velocity)
      call begin_contact(source, impact, error)
      if (allocated(error)) return
      do i = 1, n
         call record(source, impact, i, history)
         if (i == n) exit
         do j = 1, n_step
            impact%time = ((i - 1)*real(n_step, wp) + j - 1)*step
            call advance(source, drop, step, impact, history, error)
            if (allocated(error)) return
         end do
         call check_interrupt(error)
         if (allocated(error)) return
      end do
      call check_end(source, sampling, impact, error)
      if (allocated(error)) return
      call finish_record(source, impact, history)
      state = get_relative_state(source, impact%motion)
      ! Absolute displacements and velocities of the masses replace the relative ones; the other components of the state do
      ! not depend on the motion of the floor.
      state(1:2*source%n_mass:2) = impact%motion%displacement
      state(2:2*source%n_mass:2) = impact%motion%velocity
   end subroutine solve_coupled

   !> Advances source and floor by one step, through the events inside the step.
   subroutine advance(source, drop, step, impact, history, error)
      class(contact_source_type), intent(inout) :: source
      type(drop_type), intent(in) :: drop
      !> Length of the step, s.
      real(wp), intent(in) :: step
      type(impact_type), intent(inout) :: impact
      !> History, in which maxima and the time of the last release are updated.
      type(force_history_type), intent(inout) :: history
      !> Set if the equations fail.
      type(error_type), allocatable, intent(out) :: error
      type(coupled_state_type) :: end
      real(wp) :: remaining
      integer :: k, event

      remaining = step
      do k = 1, max_events
         call take_step(source, drop, remaining, impact, end, error)
         if (allocated(error)) return
         event = get_event(source, end)
         ! A captured source has no further events.
         if (event == no_event .or. impact%captured) then
            impact%motion = end
            impact%time = impact%time + remaining
            call update_maxima(source, impact, history)
            return
         end if
         call go_to_event(source, drop, event, end, remaining, impact, error)
         if (allocated(error)) return
         call pass_event(source, event, impact, history, error)
         if (allocated(error)) return
         if (.not. remaining > 0.0_wp) return
      end do
      error = many_events_error()
   end subroutine advance

   !> Advances source and floor to an event.
   subroutine go_to_event(source, drop, event, end, remaining, impact, error)
      class(contact_source_type), intent(in) :: source
      type(drop_type), intent(in) :: drop
      !> The event.
      integer, intent(in) :: event
      !> Motion at the end of the step, replaced by the motion at the event.
      type(coupled_state_type), intent(inout) :: end
      !> Time from `impact%time` to the end of the step, s.
      real(wp), intent(inout) :: remaining
      type(impact_type), intent(inout) :: impact
      type(error_type), allocatable, intent(out) :: error
      type(zero_search_type) :: search

      search = new_zero_search(get_event_function(source, event, impact%motion), remaining, &
         get_event_function(source, event, end))
      do while (.not. is_converged(search))
         call advance_search(search)
         call take_step(source, drop, search%trial, impact, end, error)
         if (allocated(error)) return
         call update_bracket(search, get_event_function(source, event, end))
      end do
      call take_step(source, drop, search%right, impact, end, error)
      if (allocated(error)) return
      impact%motion = end
      impact%time = impact%time + search%right
      remaining = remaining - search%right
   end subroutine go_to_event

   !> Motion after a whole or shortened step.
   subroutine take_step(source, drop, length, impact, end, error)
      class(contact_source_type), intent(in) :: source
      type(drop_type), intent(in) :: drop
      !> Length of this step, s.
      real(wp), intent(in) :: length
      type(impact_type), intent(in) :: impact
      type(coupled_state_type), intent(out) :: end
      type(error_type), allocatable, intent(out) :: error
      logical :: valid, converged

      if (length < impact%stages%interval) then
         call take_coupled_step(source, new_receiver_stages(impact%receiver, length), impact%time, impact%velocity_scale, &
            impact%motion, end, valid, converged)
      else
         call take_coupled_step(source, impact%stages, impact%time, impact%velocity_scale, impact%motion, end, valid, &
            converged)
      end if
      if (.not. valid) then
         error = source%get_failure(drop, impact%time, get_relative_state(source, impact%motion))
      else if (.not. converged) then
         error = coarse_step_error('the equations of a step '//to_text(1.0e3_wp*impact%time) &
            //' ms after first touch are not solved')
      end if
   end subroutine take_step

   !> Writes one sample into the history.
   pure subroutine record(source, impact, i, history)
      class(contact_source_type), intent(in) :: source
      type(impact_type), intent(in) :: impact
      !> Index of the sample.
      integer, intent(in) :: i
      type(force_history_type), intent(inout) :: history

      associate (coupled => impact%motion)
         history%floor_displacement(i) = coupled%receiver_motion%displacement
         history%floor_velocity(i) = coupled%floor_velocity
         call source%record_sample(get_relative_state(source, coupled), i, history)
         ! Force and floor velocity may jump at first touch: the first sample is the mean of both sides. `record_sample` has
         ! set the first force.
         if (i > 1) history%floor_force(i) = coupled%force
         if (i == 1) history%floor_velocity(i) = coupled%floor_velocity/2
      end associate
   end subroutine record

   !> Returns an error if the record ends too early.
   subroutine check_end(source, sampling, impact, error)
      class(contact_source_type), intent(in) :: source
      type(sampling_type), intent(in) :: sampling
      type(impact_type), intent(in) :: impact
      !> Set if the source touches the floor, or if the floor can strike it again.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: center(2)
      real(wp) :: gap, speed

      ! The floor has stopped the source for good.
      if (impact%captured) return
      if (source%touching) then
         error = input_error('&sampling: duration = '//to_text(sampling%duration) &
            //' s ends while the source is still in contact; allowed: longer than the contact')
         return
      end if
      associate (coupled => impact%motion)
         associate (state => get_relative_state(source, coupled))
            center = source%get_center_motion(state)
            ! Minimum gap between the first mass, which oscillates about the center of mass, and the floor, m.
            gap = -(center(1) + source%get_amplitude(state))
         end associate
         ! Velocity of the center of mass upwards, m/s, not relative to the floor.
         speed = -center(2) - coupled%floor_velocity
         if (can_strike(impact%receiver, coupled%receiver_motion, gap, speed)) then
            error = input_error('&sampling: duration = '//to_text(sampling%duration) &
               //' s ends while the floor may strike the source again; allowed: longer')
         end if
      end associate
   end subroutine check_end

   !> Sets the motion after the last contact to zero, and writes floor work, peak force and number of contacts.
   pure subroutine finish_record(source, impact, history)
      class(contact_source_type), intent(in) :: source
      type(impact_type), intent(in) :: impact
      type(force_history_type), intent(inout) :: history
      integer :: n

      call clear_flight(history)
      history%floor_work = impact%motion%work
      history%peak_force = impact%peak_force
      call add_model_quantity(history, 'contacts', '', real(impact%n_contact, wp))
      if (.not. source%cap_mass_per_deflection > 0.0_wp) return
      ! Inertia of the cap that lies on the floor.
      n = size(history%component_name)
      history%component_name = [character(len=len(history%component_name)) :: history%component_name, 'cap_force']
      history%component = reshape([history%component, history%floor_force - sum(history%component, dim=2)], &
         [size(history%floor_force), n + 1])
   end subroutine finish_record

end module thud_coupled_impact
