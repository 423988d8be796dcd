!> The transient impact by finite elements at large strain (paper section 4.2, figure 5).
!>
!> Each sampling interval holds as many equal steps as stability requires. The force of a sample is the mean over one
!> sampling interval around it, so that the record has the impulse of the run.
module thud_finite_element
   use thud_ball, only: ball_type
   use thud_drop, only: drop_type, get_impact_velocity
   use thud_elastic_body, only: cavity_closed, no_failure
   use thud_error, only: error_type, input_error, numerical_error, numerical_failure
   use thud_finite_element_options, only: finite_element_options_type, get_frame_count, get_stride
   use thud_force_history, only: add_model_quantity, add_to_means, force_history_type
   use thud_impact_record, only: continue_flight, finish_record, max_energy_residual, new_impact_record, record_sample
   use thud_impact_run, only: get_energy, get_mean_height, get_mean_velocity, get_stable_interval, impact_run_type, &
      new_impact_run, update_position, update_velocity
   use thud_interrupt, only: check_interrupt
   use thud_kinds, only: wp
   use thud_material, only: get_material_loss_factor, material_type, new_material
   use thud_mesh, only: get_nodal_areas, new_mesh
   use thud_motion, only: start_motion, take_snapshot
   use thud_pressed_ball, only: new_pressed_ball, press, pressed_ball_type
   use thud_progress, only: report_progress
   use thud_receiver, only: can_strike, get_pole_count, receiver_type
   use thud_sampling, only: sampling_type
   use thud_text, only: fixed, significant, to_text
   use thud_validity_limit, only: get_wave_limit, validity_limit_type
   implicit none (type, external)
   private

   public :: finite_element_type

   !> Energy residual at which a run is stopped as unstable.
   real(wp), parameter :: unstable_residual = 0.05_wp

   !> Maximum number of runs of a drop; each next one has half of the step.
   integer, parameter :: max_attempts = 4

   !> Maximum number of steps in a sampling interval.
   integer, parameter :: max_steps = 100000

   !> Maximum penetration into the layer on the floor, as a fraction of the wall thickness: the layer is thin.
   real(wp), parameter :: max_penetration = 0.1_wp

   !> Maximum number of steps times nodes in a run, which takes about twenty minutes.
   real(wp), parameter :: max_work = 2.0e10_wp

   !> Ratio of the required to the given length of a record from which on it is too short at any resolution.
   real(wp), parameter :: short_record = 1.05_wp

   !> Factor with which a number of three digits is never rounded down.
   real(wp), parameter :: rounded_up = 1.005_wp

   !> Time between two reports of progress, or checks of a mobile floor after a contact, s.
   real(wp), parameter :: check_interval = 0.5e-3_wp

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

   !> The model.
   type, extends(finite_element_options_type) :: finite_element_type
   contains
      procedure :: solve
      procedure :: get_standard_modulus
      procedure :: get_validity_limits
      procedure :: get_loss_factors
      procedure :: compress
   end type finite_element_type

contains

   !> Modulus of elasticity of the standard ball, Pa, calibrated (docs/standard_ball.md).
   function get_standard_modulus(self) result(modulus)
      class(finite_element_type), intent(in) :: self
      real(wp) :: modulus

      modulus = 2.06e6_wp
   end function get_standard_modulus

   !> The limit of the speed of the ball; the error of the mesh is stated by its numerical error.
   function get_validity_limits(self, ball, drop, sampling, history) result(limits)
      class(finite_element_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      type(drop_type), intent(in) :: drop
      type(sampling_type), intent(in) :: sampling
      type(force_history_type), intent(in) :: history
      type(validity_limit_type), allocatable :: limits(:)

      limits = [get_wave_limit(ball, history, 0.5_wp)]
   end function get_validity_limits

   !> Loss factor of the material in shear as a function of frequency.
   subroutine get_loss_factors(self, ball, frequency, loss_factor, error)
      class(finite_element_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      real(wp), intent(in) :: frequency(:)
      real(wp), intent(out) :: loss_factor(:)
      type(error_type), allocatable, intent(out) :: error
      type(material_type) :: material
      integer :: i

      loss_factor = 0.0_wp
      call new_material(self%material, ball, material, error)
      if (allocated(error)) return
      loss_factor = [(get_material_loss_factor(material, frequency(i)), i=1, size(frequency))]
   end subroutine get_loss_factors

   !> Force on each of two plates in a quasi-static compression, with the long-term modulus.
   subroutine compress(self, ball, deflection, force, error)
      class(finite_element_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      real(wp), intent(in) :: deflection(:)
      real(wp), intent(out) :: force(:)
      type(error_type), allocatable, intent(out) :: error
      type(material_type) :: material
      type(pressed_ball_type) :: pressed
      integer :: i

      force = 0.0_wp
      call new_material(self%material, ball, material, error)
      if (allocated(error)) return
      pressed = new_pressed_ball(ball, new_mesh(ball, self%mesh), material)
      do i = 1, size(deflection)
         call press(pressed, deflection(i), error)
         if (allocated(error)) return
         force(i) = pressed%force
      end do
   end subroutine compress

   !> Force history of one drop. A run that turns out to be unstable is repeated with half the step, and the history states
   !> the reduced `step_safety`. One that breaks down may be unstable, too: it is repeated once.
   subroutine solve(self, ball, drop, sampling, history, error, receiver)
      class(finite_element_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      type(drop_type), intent(in) :: drop
      type(sampling_type), intent(in) :: sampling
      type(force_history_type), intent(out) :: history
      type(error_type), allocatable, intent(out) :: error
      type(receiver_type), intent(in), optional :: receiver
      class(finite_element_type), allocatable :: attempted
      integer :: attempt
      logical :: breaks_down, broke_down

      allocate (attempted, source=self)
      broke_down = .false.
      do attempt = 1, max_attempts
         call solve_once(attempted, ball, drop, sampling, history, error, receiver)
         breaks_down = .false.
         if (allocated(error)) breaks_down = error%code == numerical_failure .and. .not. error%has_short_record &
            .and. history%energy_residual > 0.0_wp
         if (history%energy_residual <= max_energy_residual .and. (broke_down .or. .not. breaks_down)) exit
         broke_down = breaks_down .and. history%energy_residual <= max_energy_residual
         attempted%step_safety = attempted%step_safety/2
      end do
      if (attempt > 1 .and. .not. allocated(error)) call add_model_quantity(history, 'reduced_step_safety', '', &
         attempted%step_safety)
   end subroutine solve

   !> Force history of one drop with the step as it is.
   subroutine solve_once(self, ball, drop, sampling, history, error, receiver)
      class(finite_element_options_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      type(drop_type), intent(in) :: drop
      type(sampling_type), intent(in) :: sampling
      type(force_history_type), intent(out) :: history
      !> Set if the drop cannot be computed; if the run is unstable, the residual of energy in `history` is too large.
      type(error_type), allocatable, intent(out) :: error
      type(receiver_type), intent(in), optional :: receiver
      type(impact_run_type) :: run
      type(material_type) :: material
      type(contacts_type) :: contacts
      real(wp) :: speed, gap

      history = new_impact_record(sampling, get_impact_velocity(drop), receiver)
      history%touch_time = self%flight_before
      speed = history%impact_velocity - drop%gravity*self%flight_before
      gap = speed*self%flight_before + drop%gravity*self%flight_before**2/2
      if (speed < 0.0_wp) then
         error = input_error('&finite_element: flight_before = '//to_text(self%flight_before) &
            //' s is longer than the fall; allowed: up to '//to_text(history%impact_velocity/drop%gravity)//' s')
         return
      end if
      call new_material(self%material, ball, material, error)
      if (allocated(error)) return
      contacts%settling_time = 2*ball%outer_radius/sqrt(material%shear_modulus/material%density)
      if (contacts%settling_time > huge(1.0_wp)) then
         error = input_error('&ball: youngs_modulus = '//to_text(ball%youngs_modulus)//' Pa is too low to compute with; ' &
            //'allowed: a higher one')
         return
      end if
      if (sampling%duration <= self%flight_before + contacts%settling_time) then
         error = input_error('&sampling: duration = '//to_text(sampling%duration)//' s is too short: a contact is over ' &
            //'after '//significant(contacts%settling_time, 3)//' s without touch, in which shear waves cross the ball; ' &
            //'allowed: at least '//significant(rounded_up*(self%flight_before + contacts%settling_time), 3)//' s')
         return
      end if
      run = new_impact_run(ball, new_mesh(ball, self%mesh), material, self%contact, drop%gravity, gap, speed, receiver)
      if (self%snapshot_interval > 0.0_wp) then
         allocate (history%motion)
         call start_motion(run%position, get_frame_count(self, sampling), history%motion)
      end if
      call march(self, run, get_mean_height(run) - gap, contacts, sampling, history, error)
      if (.not. allocated(error)) call finish_record(ball, run, sampling, speed, history, error)
   end subroutine solve_once

   !> Integrates in time until the ball has left for good.
   subroutine march(self, run, touch_height, contacts, sampling, history, error)
      !> Number of bounces, times of flight, step.
      class(finite_element_options_type), intent(in) :: self
      type(impact_run_type), intent(inout) :: run
      !> Height of the center of mass at first touch, m.
      real(wp), intent(in) :: touch_height
      type(contacts_type), intent(inout) :: contacts
      type(sampling_type), intent(in) :: sampling
      !> Gets its samples, its snapshots, and contact time and restitution of the first contact.
      type(force_history_type), intent(inout) :: history
      !> Set if the ball cannot be computed or the record is too short.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: interval, time, first_energy
      integer :: i, k, n_step, n_sample, stride, check_stride, latest

      n_sample = size(history%floor_force)
      interval = 1/sampling%sample_rate
      call choose_steps(self, run, sampling, n_sample, n_step, error)
      if (allocated(error)) return
      check_stride = max(1, nint(check_interval*sampling%sample_rate))
      stride = get_stride(self, sampling)
      samples: do i = 1, n_sample
         time = (i - 1)*interval
         if (mod(i - 1, check_stride) == 0) call report_progress(1.0e3_wp*time, 1.0e3_wp*sampling%duration, 'ms')
         do k = 0, n_step - 1
            time = (i - 1)*interval + k*(interval/n_step)
            ! No further contact is wanted.
            if (contacts%n_over >= self%bounces .and. will_touch(run, interval/n_step)) exit samples
            call update_velocity(run, interval/n_step)
            if (i + k == 1) first_energy = get_energy(run)
            call check_run(run, time, first_energy, history, error)
            if (allocated(error)) return
            if (k == 0) then
               call record_sample(run, i, touch_height, history)
               latest = i
               ! Pressures are means over the sampling interval, as the force is.
               if (allocated(history%motion) .and. mod(i - 1, stride) == 0) call take_snapshot(history%motion, time, &
                  run%position, run%velocity, get_contact_stress(run, interval), run%state%gas_pressure, &
                  run%floor%displacement)
               run%node_impulse = 0.0_wp
            end if
            call add_to_means(run%impulse, interval, i, min(1.0_wp, max(0.0_wp, k + 0.5_wp - n_step/2.0_wp)), &
               history%floor_force)
            history%impulse = history%impulse + run%impulse
            call follow_contact(run, contacts, time, interval/n_step, history)
            call update_position(run, interval/n_step)
         end do
         if (contacts%n_over < self%bounces) cycle samples
         if (time > contacts%latest + max(contacts%settling_time, self%flight_after)) exit samples
      end do samples
      if (run%floor%moves .and. run%impulse > 0.0_wp) then
         error = input_error('&sampling: duration = '//to_text(sampling%duration)//' s ends while the ball is on the' &
            //' mobile floor; allowed: longer than the contact, which never ends on a floor too light for the ball')
      else if (contacts%n_over < self%bounces) then
         error = get_duration_error(run, contacts, self%bounces, sampling%duration)
      end if
      if (.not. allocated(error)) call continue_flight(run, latest, touch_height, history)
   end subroutine march

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

      error = input_error('&sampling: duration = '//to_text(duration)//' s ends before contact '//to_text(bounces) &
         //' is over')
      if (run%floor%moves .and. run%time > contacts%latest + contacts%settling_time) then
         error = input_error('&sampling: duration = '//to_text(duration) &
            //' s ends while the floor may strike the ball again; allowed: longer')
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

   !> Number of steps in a sampling interval; returns an error if the run would take too long.
   subroutine choose_steps(self, run, sampling, n_sample, n_step, error)
      !> Options; `step_safety` is the ratio of the step to the bound.
      class(finite_element_options_type), intent(in) :: self
      type(impact_run_type), intent(in) :: run
      type(sampling_type), intent(in) :: sampling
      !> Number of samples of the record.
      integer, intent(in) :: n_sample
      !> The number.
      integer, intent(out) :: n_step
      !> Set if there would be too many steps.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: interval, wanted

      interval = 1/sampling%sample_rate
      wanted = interval/(self%step_safety*get_stable_interval(run%body%mesh, run%body%material, run%contact))
      n_step = max(sampling%substeps, ceiling(min(wanted, 2.0_wp*max_steps)))
      associate (n_node => size(run%position)/2)
         if (n_step <= max_steps .and. real(n_step, wp)*n_sample*n_node <= max_work) return
         error = numerical_error('&finite_element: stability asks for steps below '//to_text(interval/n_step) &
            //' s, too many for '//to_text(sampling%duration)//' s of '//to_text(n_node) &
            //' nodes; allowed: a shorter duration, fewer elements, a lower bulk_ratio, less viscosity')
      end associate
   end subroutine choose_steps

   !> Whether a node may reach the floor in the next step.
   pure function will_touch(run, step) result(touches)
      type(impact_run_type), intent(in) :: run
      !> Length of the step, s.
      real(wp), intent(in) :: step
      logical :: touches

      ! `stop` is the displacement of the floor at the next instant, downwards.
      associate (last => ubound(run%position, 2))
         touches = minval(run%position(:, last, 2) + step*(run%velocity(:, last, 2) - step*run%gravity) &
            - run%contact%edge_height) + run%floor%stop + step*run%floor%velocity < 0.0_wp
      end associate
   end function will_touch

   !> Minimum gap between ball and floor, m.
   pure function get_gap(run) result(gap)
      type(impact_run_type), intent(in) :: run
      real(wp) :: gap

      gap = minval(run%position(:, ubound(run%position, 2), 2) - run%contact%edge_height) + run%floor%displacement
   end function get_gap

   !> Mean stress of the floor on the deformed surface since the latest sample.
   pure function get_contact_stress(run, interval) result(stress)
      type(impact_run_type), intent(in) :: run
      !> Sampling interval, s.
      real(wp), intent(in) :: interval
      !> Outwards and upwards, Pa: [0:n_polar, 2].
      real(wp) :: stress(0:ubound(run%position, 1), 2)

      associate (surface => run%position(:, ubound(run%position, 2), :))
         stress = run%node_impulse/interval/spread(get_nodal_areas(surface(:, 1), surface(:, 2)), 2, 2)
      end associate
   end function get_contact_stress

   !> Beginning of a message with the time of an event.
   function event_prefix(time) result(text)
      real(wp), intent(in) :: time
      character(len=64) :: text

      text = '&finite_element: '//to_text(1.0e3_wp*time)//' ms after the start'
   end function event_prefix

   !> Tracks beginning and end of the contacts, and the restitution of the first.
   subroutine follow_contact(run, contacts, time, step, history)
      type(impact_run_type), intent(in) :: run
      type(contacts_type), intent(inout) :: contacts
      !> Time since the record began, s; length of the step, s.
      real(wp), intent(in) :: time, step
      !> Gets contact time and restitution of the first contact.
      type(force_history_type), intent(inout) :: history
      real(wp) :: speed

      if (run%impulse > 0.0_wp) then
         if (.not. contacts%active) contacts%first = time - step/2
         contacts%active = .true.
         contacts%latest = time + step/2
         contacts%next_check = contacts%latest + contacts%settling_time
      else if (contacts%active .and. time > contacts%next_check) then
         if (run%floor%moves) then
            contacts%next_check = time + check_interval
            if (can_strike(run%floor%receiver, run%floor%motion, get_gap(run), get_mean_velocity(run))) return
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

   !> Returns an error if the ball cannot be computed any further.
   subroutine check_run(run, time, first_energy, history, error)
      type(impact_run_type), intent(in) :: run
      !> Time since the record began, s; energy of the first sample, J.
      real(wp), intent(in) :: time, first_energy
      !> Gets the maximum energy residual, relative to the kinetic energy at first touch.
      type(force_history_type), intent(inout) :: history
      !> States what happened, when and why.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: residual

      call check_interrupt(error)
      if (allocated(error)) return
      if (run%state%failure == cavity_closed) then
         error = numerical_error(trim(event_prefix(time))//' the cavity has no volume left; ' &
            //'allowed: a lower height, a stiffer ball')
      else if (run%state%failure /= no_failure) then
         error = numerical_error(trim(event_prefix(time))//' an element is turned inside out (ratio of volumes ' &
            //to_text(run%state%min_jacobian)//'); allowed: a lower height, a stiffer ball, more polar_elements')
      else if (run%contact%layer_stiffness > 0.0_wp &
         .and. run%penetration > max_penetration*(run%body%mesh%z(0, 0) - run%body%mesh%z(0, run%body%mesh%n_radial))) then
         error = numerical_error('&contact: layer_stiffness = '//to_text(run%contact%layer_stiffness) &
            //' N/m3 lets the surface sink '//to_text(1.0e3_wp*run%penetration)//' mm into the layer; allowed: up to ' &
            //to_text(max_penetration)//' of the wall, by a higher layer_stiffness')
      else if (run%dissipated + run%contact_loss + run%friction_loss &
         > run%total_mass/2*history%impact_velocity**2) then
         error = numerical_error(trim(event_prefix(time))//' the ball has lost the energy of the drop and stays on the ' &
            //'floor; allowed: less viscosity, or a higher drop')
         error%has_short_record = .true.
      else
         residual = abs(get_energy(run) - first_energy)/(run%total_mass/2*history%impact_velocity**2)
         history%energy_residual = max(history%energy_residual, residual)
         if (.not. residual < unstable_residual) then
            history%energy_residual = huge(residual)
            error = numerical_error(trim(event_prefix(time))//' the run is unstable (energy off by '//to_text(residual) &
               //' of that at first touch); allowed: a smaller step_safety')
         end if
      end if
   end subroutine check_run

end module thud_finite_element
