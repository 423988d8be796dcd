!> The record of an impact by finite elements: samples, flight after the computation, balances.
module thud_impact_record
   use thud_ball, only: ball_type
   use thud_constants, only: recorded_band
   use thud_error, only: error_type, numerical_error
   use thud_force_history, only: add_model_quantity, continue_to_zero, force_history_type, new_force_history
   use thud_impact_run, only: get_mean_height, get_mean_velocity, impact_run_type
   use thud_kinds, only: wp
   use thud_moving_floor, only: continue_freely
   use thud_receiver, only: is_rigid, receiver_type
   use thud_sampling, only: check_contact_samples, get_sample_count, sampling_type
   use thud_text, only: to_text
   use thud_transform, only: get_low_pass
   implicit none (type, external)
   private

   public :: continue_flight, finish_record, max_energy_residual, new_impact_record, record_sample

   !> Maximum error of the balance of energy, relative to the energy at first touch.
   real(wp), parameter :: max_energy_residual = 0.005_wp

   !> Maximum error of the impulse of the record, relative to the change of momentum.
   real(wp), parameter :: max_impulse_residual = 1.0e-8_wp

   !> Columns of the additional quantities.
   integer, parameter :: at_radius = 1, at_pressure = 2, at_kinetic = 3, at_gravity = 6, at_floor = 11

contains

   !> A record without force.
   pure function new_impact_record(sampling, impact_velocity, receiver) result(history)
      type(sampling_type), intent(in) :: sampling
      !> Velocity towards the floor at first touch, m/s.
      real(wp), intent(in) :: impact_velocity
      !> The floor under the ball (default: rigid).
      type(receiver_type), intent(in), optional :: receiver
      type(force_history_type) :: history

      history = new_force_history(sampling%sample_rate, get_sample_count(sampling), ['contact_force'])
      history%has_means = .true.
      history%impact_velocity = impact_velocity
      history%model_history_name = [character(len=24) :: 'contact_radius_m', 'cavity_pressure_Pa', 'kinetic_energy_J', &
         'strain_energy_J', 'gas_energy_J', 'gravity_energy_J', 'contact_energy_J', 'friction_energy_J', &
         'dissipated_energy_J', 'minimum_volume_ratio']
      if (present(receiver)) then
         if (.not. is_rigid(receiver)) then
            history%model_history_name = [history%model_history_name, [character(len=24) :: 'floor_energy_J']]
            allocate (history%floor_displacement, history%floor_velocity, mold=history%floor_force)
         end if
      end if
      allocate (history%model_history(size(history%floor_force), size(history%model_history_name)), source=0.0_wp)
   end function new_impact_record

   !> Writes all quantities of one sample except the force.
   subroutine record_sample(run, i, touch_height, history)
      !> The ball, between updates of velocity and position.
      type(impact_run_type), intent(in) :: run
      !> Index of the sample.
      integer, intent(in) :: i
      !> Height of the center of mass at first touch, m.
      real(wp), intent(in) :: touch_height
      type(force_history_type), intent(inout) :: history

      history%deflection(i) = touch_height - get_mean_height(run)
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
   pure subroutine continue_flight(run, last, touch_height, history)
      !> The ball at the end of the computation.
      type(impact_run_type), intent(in) :: run
      !> Index of the latest sample.
      integer, intent(in) :: last
      !> Height of the center of mass at first touch, m.
      real(wp), intent(in) :: touch_height
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
         history%model_history(i, at_gravity) = mass*run%gravity*(touch_height + rise)
      end do
      if (run%floor%moves) call continue_freely(run%floor, run%time, history%sample_rate, last + 1, &
         history%floor_displacement, history%floor_velocity)
   end subroutine continue_flight

   !> Sets the peaks of the impact, and checks the balances.
   subroutine finish_record(ball, run, sampling, speed, history, error)
      type(ball_type), intent(in) :: ball
      type(impact_run_type), intent(in) :: run
      type(sampling_type), intent(in) :: sampling
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
      call add_model_quantity(history, 'minimum_step', 's', run%shortest_interval)
      call add_model_quantity(history, 'maximum_penetration', 'm', run%penetration)
      call add_model_quantity(history, 'radial_elements', '', real(run%body%mesh%n_radial, wp))
      call add_model_quantity(history, 'polar_elements', '', real(run%body%mesh%n_polar, wp))
      gain = ball%mass*(get_mean_velocity(run) + speed + run%gravity*run%time)
      history%impulse_residual = abs(sum(history%floor_force)/history%sample_rate - gain)/gain
      call check_contact_samples(sampling, history%contact_time, error)
      if (allocated(error)) return
      if (.not. history%impulse_residual <= max_impulse_residual) then
         error = numerical_error('&finite_element: the balance of momentum misses by ' &
            //to_text(history%impulse_residual)//'; allowed: up to '//to_text(max_impulse_residual))
      else if (.not. history%energy_residual <= max_energy_residual) then
         error = numerical_error('&finite_element: the balance of energy misses by ' &
            //to_text(history%energy_residual)//' of the energy at first touch; allowed: up to ' &
            //to_text(max_energy_residual)//', a smaller step_safety helps')
      end if
   end subroutine finish_record

end module thud_impact_record
