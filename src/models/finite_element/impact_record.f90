!> The record of an impact by finite elements: samples, contacts, flight after the computation, balances.
module thud_impact_record
   use thud_constants, only: recorded_band
   use thud_elastic_body, only: cavity_closed, no_failure
   use thud_error, only: error_type, input_error, numerical_error
   use thud_force_history, only: add_model_quantity, force_history_type, new_force_history
   use thud_impact_run, only: get_energy, get_mean_height, get_mean_velocity, impact_run_type
   use thud_interrupt, only: check_interrupt
   use thud_kinds, only: wp
   use thud_moving_floor, only: continue_freely
   use thud_receiver, only: can_strike
   use thud_sampling, only: get_sample_count, sampling_type
   use thud_text, only: fixed, to_text
   use thud_transform, only: get_low_pass
   implicit none (type, external)
   private

   public :: check_run, contacts_type, continue_flight, continue_to_zero, finish_record, follow_contact, get_duration_error
   public :: max_energy_residual, new_impact_record, record_sample

   !> Maximum error of the balance of energy, relative to the energy at first touch.
   real(wp), parameter :: max_energy_residual = 0.005_wp

   !> Maximum error of the impulse of the record, relative to the change of momentum.
   real(wp), parameter :: max_impulse_residual = 1.0e-8_wp

   !> Energy residual at which a run is stopped as unstable.
   real(wp), parameter :: unstable_residual = 0.05_wp

   !> Maximum penetration into the layer on the floor, as a fraction of the wall thickness: the layer is thin.
   real(wp), parameter :: max_penetration = 0.1_wp

   !> Ratio of the required to the given length of a record from which on it is too short at any resolution.
   real(wp), parameter :: short_record = 1.05_wp

   !> Time between two reports of progress, or checks of a mobile floor after a contact, s.
   real(wp), parameter, public :: check_interval = 0.5e-3_wp

   !> Columns of the additional quantities.
   integer, parameter :: at_radius = 1, at_pressure = 2, at_kinetic = 3, at_gravity = 6, at_floor = 11

   !> The contacts of a run.
   type :: contacts_type
      !> Time without touch after which a contact is over, s: shear waves have crossed the ball.
      real(wp) :: settling_time = 0.0_wp
      !> Instant from which on the contact is over if a mobile floor cannot strike again, s.
      real(wp) :: next_check = 0.0_wp
      !> First and latest instant of the present contact, s.
      real(wp) :: first = 0.0_wp, latest = 0.0_wp
      !> Whether there is a contact, or was one that is not over.
      logical :: active = .false.
      !> Number of contacts that are over.
      integer :: n_over = 0
   end type contacts_type

contains

   !> A record without force.
   pure function new_impact_record(run, sampling, impact_velocity) result(history)
      type(impact_run_type), intent(in) :: run
      type(sampling_type), intent(in) :: sampling
      !> Velocity towards the floor at first touch, m/s.
      real(wp), intent(in) :: impact_velocity
      type(force_history_type) :: history
      character(len=24), parameter :: names(at_floor) = [character(len=24) :: 'contact_radius_m', 'cavity_pressure_Pa', &
         'kinetic_energy_J', 'strain_energy_J', 'gas_energy_J', 'gravity_energy_J', 'contact_energy_J', &
         'friction_energy_J', 'dissipated_energy_J', 'minimum_volume_ratio', 'floor_energy_J']

      history = new_force_history(sampling%sample_rate, get_sample_count(sampling), ['contact_force'], &
         names(:merge(at_floor, at_floor - 1, run%floor%moves)))
      history%has_means = .true.
      history%impact_velocity = impact_velocity
      if (run%floor%moves) allocate (history%floor_displacement, history%floor_velocity, mold=history%floor_force)
   end function new_impact_record

   !> Writes all quantities of one sample except the force.
   subroutine record_sample(run, i, history)
      !> The ball, between updates of velocity and position.
      type(impact_run_type), intent(in) :: run
      !> Index of the sample.
      integer, intent(in) :: i
      type(force_history_type), intent(inout) :: history

      history%deflection(i) = run%touch_height - get_mean_height(run)
      history%velocity(i) = -get_mean_velocity(run)
      associate (r => run%position(:, ubound(run%position, 2), 1))
         history%model_history(i, at_radius) = maxval(r, mask=run%floor_force(:, 2) > 0.0_wp)
         if (.not. any(run%floor_force(:, 2) > 0.0_wp)) history%model_history(i, at_radius) = 0.0_wp
      end associate
      history%model_history(i, at_pressure:at_floor - 1) = [run%state%gas_pressure, run%kinetic, run%state%strain_energy, &
         run%state%gas_energy, run%potential, run%contact_energy + run%contact_loss, run%friction_loss, run%dissipated, &
         run%state%min_jacobian]
      if (.not. run%floor%moves) return
      history%model_history(i, at_floor) = run%floor%work
      history%floor_displacement(i) = run%floor%displacement
      ! The velocity of the direct mobility is added later, from the sampled force.
      history%floor_velocity(i) = run%floor%velocity
   end subroutine record_sample

   !> Continues after the computation as free flight without vibration, up to the next touch.
   pure subroutine continue_flight(run, last, history)
      !> The ball at the end of the computation.
      type(impact_run_type), intent(in) :: run
      !> Index of the latest sample.
      integer, intent(in) :: last
      type(force_history_type), intent(inout) :: history
      real(wp) :: mass, speed, rise, time
      integer :: i

      mass = run%total_mass
      do i = last + 1, size(history%deflection)
         associate (initial_rise => -history%deflection(last), upwards => -history%velocity(last))
            ! The flight ends at the height of first touch.
            time = (upwards + sqrt(upwards**2 + 2*run%gravity*max(initial_rise, 0.0_wp)))/run%gravity
            time = min(time, (i - last)/history%sample_rate)
            speed = upwards - run%gravity*time
            rise = initial_rise + (upwards - run%gravity*time/2)*time
            history%model_history(i, :) = history%model_history(last, :)
            history%model_history(i, at_kinetic) = history%model_history(last, at_kinetic) + mass/2*(speed**2 - upwards**2)
         end associate
         history%velocity(i) = -speed
         history%deflection(i) = -rise
         history%model_history(i, at_gravity) = mass*run%gravity*(run%touch_height + rise)
      end do
      if (run%floor%moves) call continue_freely(run%floor, run%time, history%sample_rate, last + 1, &
         history%floor_displacement, history%floor_velocity)
   end subroutine continue_flight

   !> Sets the peaks of the impact, and checks the balances.
   subroutine finish_record(run, speed, history, error)
      type(impact_run_type), intent(in) :: run
      !> Velocity downwards at the start, m/s.
      real(wp), intent(in) :: speed
      !> The history; its samples are complete.
      type(force_history_type), intent(inout) :: history
      !> Set if a balance does not close.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: recorded(size(history%floor_force))
      real(wp) :: gain

      if (run%floor%moves) then
         history%floor_velocity = history%floor_velocity + run%floor%receiver%direct*history%floor_force
         history%floor_work = run%floor%work_after
         history%deflection = history%deflection - history%floor_displacement
         history%velocity = history%velocity - history%floor_velocity
      end if
      history%component(:, 1) = history%floor_force
      history%elastic_force = history%floor_force
      ! Nodes that touch one by one cause spikes, the higher the shorter the steps.
      call get_low_pass(history%floor_force, history%sample_rate, recorded_band, recorded)
      history%peak_force = maxval(recorded)
      history%peak_elastic_force = history%peak_force
      call continue_to_zero(history)
      history%max_deflection = maxval(history%deflection, mask=history%floor_force > 0.0_wp)
      call add_model_quantity(history, 'shear_modulus', 'Pa', run%body%material%shear_modulus)
      call add_model_quantity(history, 'bulk_modulus', 'Pa', run%body%material%bulk_modulus)
      call add_model_quantity(history, 'simulated_time', 's', run%time)
      call add_model_quantity(history, 'minimum_step', 's', run%last_interval)
      call add_model_quantity(history, 'maximum_penetration', 'm', run%penetration)
      call add_model_quantity(history, 'radial_elements', '', real(run%body%mesh%n_radial, wp))
      call add_model_quantity(history, 'polar_elements', '', real(run%body%mesh%n_polar, wp))
      gain = run%total_mass*(get_mean_velocity(run) + speed + run%gravity*run%time)
      history%impulse_residual = abs(sum(history%floor_force)/history%sample_rate - gain)/gain
      if (.not. history%impulse_residual <= max_impulse_residual) then
         error = numerical_error('the balance of momentum misses by '//to_text(history%impulse_residual)//'; allowed: up ' &
            //'to '//to_text(max_impulse_residual), 'finite_element')
      else if (.not. history%energy_residual <= max_energy_residual) then
         error = numerical_error('the balance of energy misses by '//to_text(history%energy_residual)//' of the energy at ' &
            //'first touch; allowed: up to '//to_text(max_energy_residual)//', a smaller step_safety helps', &
            'finite_element')
      end if
   end subroutine finish_record

   !> Tracks beginning and end of the contacts, and the restitution of the first.
   subroutine follow_contact(run, contacts, time, step, history)
      type(impact_run_type), intent(in) :: run
      type(contacts_type), intent(inout) :: contacts
      !> Time since the record began, s; length of the step, s.
      real(wp), intent(in) :: time, step
      !> Gets contact time and restitution of the first contact.
      type(force_history_type), intent(inout) :: history
      real(wp) :: gap, speed

      if (run%impulse > 0.0_wp) then
         if (.not. contacts%active) contacts%first = time - step/2
         contacts%active = .true.
         contacts%latest = time + step/2
         contacts%next_check = contacts%latest + contacts%settling_time
      else if (contacts%active .and. time > contacts%next_check) then
         if (run%floor%moves) then
            contacts%next_check = time + check_interval
            gap = minval(run%position(:, run%body%mesh%n_radial, 2) - run%contact%edge_height) + run%floor%displacement
            if (can_strike(run%floor%receiver, run%floor%motion, gap, get_mean_velocity(run))) return
         end if
         contacts%active = .false.
         contacts%n_over = contacts%n_over + 1
         if (contacts%n_over > 1) return
         history%contact_time = contacts%latest - contacts%first
         ! Extrapolated back to the end of the contact.
         speed = get_mean_velocity(run) + run%gravity*(time + step/2 - contacts%latest)
         history%restitution = speed/history%impact_velocity
      end if
   end subroutine follow_contact

   !> The error of a record that ends before the last wanted contact is over.
   function get_duration_error(run, contacts, bounces, duration) result(error)
      type(impact_run_type), intent(in) :: run
      type(contacts_type), intent(in) :: contacts
      !> Number of wanted contacts.
      integer, intent(in) :: bounces
      !> Length of the record, s.
      real(wp), intent(in) :: duration
      type(error_type) :: error
      real(wp) :: required

      error = input_error('= '//to_text(duration)//' s ends before contact '//to_text(bounces)//' is over', 'sampling', &
         'duration')
      if (run%floor%moves .and. run%time > contacts%latest + contacts%settling_time) then
         error = input_error('= '//to_text(duration)//' s ends while the floor may strike the ball again; allowed: longer', &
            'sampling', 'duration')
         error%has_short_record = .true.
      else if (contacts%active .and. contacts%n_over + 1 == bounces) then
         required = contacts%latest + contacts%settling_time
         ! The end of a contact that lasts is not known.
         if (run%impulse > 0.0_wp) required = required + contacts%latest - contacts%first
         required = ceiling(1.0e3_wp*required)/1.0e3_wp
         error%message = error%message//'; set duration to at least '//fixed(required, 3)//' s'
         error%has_short_record = required > short_record*duration
      else
         error%message = error%message//'; allowed: a longer one'
      end if
   end function get_duration_error

   !> Returns an error if the ball cannot be computed any further.
   subroutine check_run(run, time, first_energy, history, error)
      type(impact_run_type), intent(in) :: run
      !> Time since the record began, s; energy of the first sample, J.
      real(wp), intent(in) :: time, first_energy
      !> Gets the maximum energy residual, relative to the kinetic energy at first touch.
      type(force_history_type), intent(inout) :: history
      !> States what happened, when and why.
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: cause
      real(wp) :: residual, energy
      logical :: rests

      call check_interrupt(error)
      if (allocated(error)) return
      energy = run%total_mass/2*history%impact_velocity**2
      rests = .false.
      if (run%state%failure == cavity_closed) then
         cause = 'the cavity has no volume left; allowed: a lower height, a stiffer ball'
      else if (run%state%failure /= no_failure) then
         cause = 'an element is turned inside out (ratio of volumes '//to_text(run%state%min_jacobian) &
            //'); allowed: a lower height, a stiffer ball, more polar_elements'
      else if (run%contact%layer_stiffness > 0.0_wp &
         .and. run%penetration > max_penetration*(run%body%mesh%z(0, 0) - run%body%mesh%z(0, run%body%mesh%n_radial))) then
         error = numerical_error('= '//to_text(run%contact%layer_stiffness)//' N/m3 lets the surface sink ' &
            //to_text(1.0e3_wp*run%penetration)//' mm into the layer; allowed: up to '//to_text(max_penetration)//' of ' &
            //'the wall, by a higher layer_stiffness', 'contact', 'layer_stiffness')
      else if (run%dissipated + run%contact_loss + run%friction_loss > energy) then
         rests = .true.
         cause = 'the ball has lost the energy of the drop and stays on the floor; allowed: less viscosity, or a higher drop'
      else
         residual = abs(get_energy(run) - first_energy)/energy
         history%energy_residual = max(history%energy_residual, residual)
         if (residual < unstable_residual) return
         history%energy_residual = huge(residual)
         cause = 'the run is unstable (energy off by '//to_text(residual) &
            //' of that at first touch); allowed: a smaller step_safety'
      end if
      if (.not. allocated(cause)) return
      error = numerical_error(to_text(1.0e3_wp*time)//' ms after the start '//cause, 'finite_element')
      error%has_short_record = rests
   end subroutine check_run

   !> Estimates the contact time between samples, which are means: a force that falls linearly to zero has the last two.
   pure subroutine continue_to_zero(history)
      !> The history, with its contact time; `exact_contact_time` is set.
      type(force_history_type), intent(inout) :: history
      real(wp) :: fraction
      integer :: last

      last = min(size(history%floor_force), ceiling((history%touch_time + history%contact_time)*history%sample_rate) + 2)
      last = findloc(abs(history%floor_force(:last)) > 0.0_wp, .true., dim=1, back=.true.)
      if (last < 2) return
      ! The force ends at the fraction x of the last interval: end/before = x**2/(2 x + 1).
      fraction = max(0.0_wp, history%floor_force(last))/maxval(history%floor_force(last - 1:last))
      fraction = min(1.0_wp, fraction + sqrt(fraction**2 + fraction))
      history%exact_contact_time = (last - 1.5_wp + fraction)/history%sample_rate - history%touch_time
   end subroutine continue_to_zero

end module thud_impact_record
