!> Impact of a source of a few masses: integrates in time from first touch until the source has left for good, samples the
!> forces, and checks the balances of impulse and energy.
module thud_lumped
   use thud_contact_source, only: coarse_step_error, contact_source_type, many_events_error, max_events
   use thud_coupled_impact, only: solve_coupled
   use thud_drop, only: drop_type, get_impact_velocity
   use thud_error, only: error_type, input_error
   use thud_force_history, only: add_model_quantity, check_samples, clear_flight, force_history_type, max_residual, &
      new_force_history
   use thud_interrupt, only: check_interrupt
   use thud_kinds, only: wp
   use thud_receiver, only: is_rigid, receiver_type
   use thud_rk4, only: locate_zero, longest_valid, rk4_step
   use thud_sampling, only: check_contact_samples, get_sample_count, sampling_type
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: solve_lumped

   !> Maximum number of times that the steps are halved.
   integer, parameter :: max_halvings = 6

contains

   !> Force history of one drop; the steps are halved until they are not too coarse for the source. Then the history states
   !> their length.
   subroutine solve_lumped(source, drop, sampling, component_name, history, error, receiver, n_step, model_history_name)
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
      !> Steps per sampling interval (default: the substeps).
      integer, intent(in), optional :: n_step
      !> Names, with units, of additional quantities against time: [n_model_history].
      character(len=*), intent(in), optional :: model_history_name(:)
      class(contact_source_type), allocatable :: moving
      real(wp) :: state(source%n_state)
      integer :: steps, halving

      steps = sampling%substeps
      if (present(n_step)) steps = n_step
      do halving = 0, max_halvings
         allocate (moving, source=source)
         call integrate()
         if (.not. allocated(error)) exit
         if (.not. error%has_coarse_steps .or. halving == max_halvings) return
         deallocate (error, moving)
         steps = 2*steps
      end do
      if (halving > 0) call add_model_quantity(history, 'shortened_time_step', 's', 1/(sampling%sample_rate*steps))
      call check_contact_samples(sampling, history%contact_time, error)
      if (.not. allocated(error)) call check_samples(history, error)

   contains

      !> One attempt.
      subroutine integrate()
         history = new_force_history(sampling%sample_rate, get_sample_count(sampling), component_name, model_history_name)
         history%impact_velocity = get_impact_velocity(drop)
         if (is_rigid(receiver)) then
            call march(moving, drop, sampling, steps, history, state, error)
         else
            call solve_coupled(moving, drop, sampling, steps, receiver, history, state, error)
         end if
         if (.not. allocated(error)) call finish(moving, state, history, error)
      end subroutine integrate

   end subroutine solve_lumped

   !> Integrates in time from first touch until the source has left a rigid floor for good.
   subroutine march(source, drop, sampling, n_step, history, state, error)
      class(contact_source_type), intent(inout) :: source
      type(drop_type), intent(in) :: drop
      type(sampling_type), intent(in) :: sampling
      !> Steps per sampling interval.
      integer, intent(in) :: n_step
      !> Gets samples, maxima and contact time.
      type(force_history_type), intent(inout) :: history
      !> State after the last release: [n_state].
      real(wp), intent(out) :: state(:)
      !> Set if the equation fails or the contact outlasts the record.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: step
      integer :: i, j

      step = 1/(sampling%sample_rate*n_step)
      state = 0.0_wp
      state(2:2*source%n_mass:2) = history%impact_velocity
      do i = 1, size(history%floor_force)
         call source%record_sample(state, i, history)
         do j = 0, n_step - 1
            call advance(source, drop, ((i - 1)*real(n_step, wp) + j)*step, step, state, history, error)
            if (allocated(error)) return
            if (.not. source%has_separated(state)) cycle
            call clear_flight(history)
            return
         end do
         call check_interrupt(error)
         if (allocated(error)) return
      end do
      error = input_error('&sampling: duration = '//to_text(sampling%duration) &
         //' s ends while the source is still in contact or may touch the floor again; allowed: longer than the contact')
   end subroutine march

   !> Advances the state by one step, through the events inside the step; stops early if the source has left.
   subroutine advance(source, drop, start_time, step, state, history, error)
      !> The source; changes its phase at events.
      class(contact_source_type), intent(inout) :: source
      type(drop_type), intent(in) :: drop
      !> Time at the beginning of the step since first touch, s; its length, s.
      real(wp), intent(in) :: start_time, step
      !> State: [n_state].
      real(wp), intent(inout) :: state(:)
      !> Gets maxima, and the time of each release.
      type(force_history_type), intent(inout) :: history
      !> Set if the state leaves the domain of the equation, or the step has too many events.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: new_state(size(state))
      real(wp) :: time, length
      integer :: k
      logical :: valid

      time = start_time
      do k = 1, max_events
         length = start_time + step - time
         if (.not. length > 0.0_wp) return
         call rk4_step(source, time, state, length, new_state, valid)
         if (.not. valid) then
            length = longest_valid(source, time, state, length)
            call rk4_step(source, time, state, length, new_state, valid)
            error = source%get_failure(drop, time + length, new_state)
            return
         end if
         if (new_state(source%get_event_component()) > 0.0_wp) then
            state = new_state
            ! The maxima of a single mass are taken at the turning point and at samples.
            if (source%n_mass > 1) call source%record_peaks(state, history)
            return
         end if
         length = locate_zero(source, time, state, length, source%get_event_component())
         call rk4_step(source, time, state, length, new_state, valid)
         time = time + length
         state = new_state
         call source%begin_next_phase(time, state, history)
         if (source%has_separated(state)) return
      end do
      error = many_events_error()
   end subroutine advance

   !> Sets the scalars of the impact from the state after the last release, and checks the balances.
   subroutine finish(source, state, history, error)
      class(contact_source_type), intent(in) :: source
      !> State after the last release: [n_state].
      real(wp), intent(in) :: state(:)
      !> The history; its samples are complete.
      type(force_history_type), intent(inout) :: history
      !> Set if a balance does not close.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: center(2)
      real(wp) :: energy, momentum

      center = source%get_center_motion(state)
      associate (v0 => history%impact_velocity, velocity => center(2), mass => source%mass, last => 2*source%n_mass)
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
