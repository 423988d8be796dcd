!> The transient impact by finite elements at large strain (paper section 4.2, figure 5).
!>
!> Each sampling interval holds as many equal steps as stability requires. The force of a sample is the mean over one
!> sampling interval around it, so that the record has the impulse of the run.
module thud_finite_element
   use thud_ball, only: ball_type, drop_type, get_density, get_impact_velocity
   use thud_band, only: octave_count
   use thud_constants, only: pi
   use thud_element_block, only: n_element
   use thud_error, only: error_type, input_error, numerical_error, numerical_failure
   use thud_field, only: field_type, in_group, new_field
   use thud_floor_contact, only: contact_options_type, get_contact_fields, new_floor_contact
   use thud_force_history, only: add_model_quantity, add_to_means, force_history_type, snapshot_type
   use thud_impact_record, only: check_interval, check_run, contacts_type, continue_flight, finish_record, follow_contact, &
      get_duration_error, max_energy_residual, new_impact_record, record_sample
   use thud_impact_run, only: get_energy, get_stable_interval, impact_run_type, new_impact_run, update_position, &
      update_velocity
   use thud_kinds, only: wp
   use thud_material, only: check_material, get_material_fields, get_material_loss_factor, material_options_type, &
      material_type, new_material
   use thud_mesh, only: check_mesh, get_element_counts, get_mesh_fields, get_nodal_areas, mesh_options_type, mesh_type, &
      min_radial, new_mesh
   use thud_pressed_ball, only: new_pressed_ball, press, pressed_ball_type
   use thud_progress, only: report_progress
   use thud_receiver, only: receiver_type
   use thud_sampling, only: get_sample_count, sampling_type
   use thud_source_model, only: resolution_type, source_model_type
   use thud_text, only: significant, to_text
   use thud_validity_limit, only: get_wave_limit, validity_limit_type
   implicit none (type, external)
   private

   public :: finite_element_type, get_frame_count

   !> Modulus of elasticity of the standard ball, Pa, calibrated (docs/standard_ball.md).
   real(wp), parameter, public :: finite_element_modulus = 2.06e6_wp

   !> Maximum memory for snapshots, bytes.
   real(wp), parameter :: max_motion_bytes = 4.0e8_wp

   !> Minimum sampling rate, Hz: the mean over an interval then lowers the highest octave by 0.03 dB.
   real(wp), parameter :: min_rate = 16000.0_wp

   !> Ratio of the numbers of elements of a level of resolution to those of the next coarser one, above level 1.
   real(wp), parameter :: refinement_ratio = sqrt(2.0_wp)

   !> Number of elements along a contact radius.
   real(wp), parameter :: contact_elements = 4.5_wp

   !> Maximum ratio of the number of elements for the contact to the number for the wall.
   real(wp), parameter :: max_contact_ratio = 2.0_wp

   !> Highest level of resolution, and maximum number of steps times elements of its drop.
   integer, parameter :: highest_level = 3
   real(wp), parameter :: max_level_work = 5.05e7_wp

   !> Typical simulated duration of a drop, s, for the number of steps.
   real(wp), parameter :: typical_contact = 0.025_wp

   !> Coefficients of friction between which a mesh may be too coarse for the stick and slip of the surface, which then
   !> changes the levels of a finer one only (docs/finite_elements.md): smaller friction is too weak, larger friction sticks.
   !> The viscosity of Kelvin and Voigt prevents it.
   real(wp), parameter :: slip_friction(2) = [0.33_wp, 0.95_wp]

   !> Largest changes by it from the default elements to finer ones among eight balls, dB, at the octaves that the velocity
   !> of shear waves per radius makes those of `slip_ball`; the change is taken as proportional to the element size.
   real(wp), parameter :: slip_error(octave_count) = [0.05_wp, 0.2_wp, 0.4_wp, 2.0_wp, 2.0_wp]
   type(ball_type), parameter :: slip_ball = ball_type(youngs_modulus=2.08e6_wp)

   !> Maximum number of runs of a drop; each next one has half of the step.
   integer, parameter :: max_attempts = 4

   !> Maximum number of steps in a sampling interval.
   integer, parameter :: max_steps = 100000

   !> Maximum number of steps times nodes in a run, which takes about twenty minutes.
   real(wp), parameter :: max_work = 2.0e10_wp

   !> Factor with which a number of three digits is never rounded down.
   real(wp), parameter :: rounded_up = 1.005_wp

   !> The model with its options.
   type, extends(source_model_type) :: finite_element_type
      !> Number of contacts to follow.
      integer :: bounces = 1
      !> Free flight before first touch, s.
      real(wp) :: flight_before = 0.0_wp
      !> Free flight after the last contact, s.
      real(wp) :: flight_after = 0.0_wp
      !> Time step divided by a bound on stable steps.
      real(wp) :: step_safety = 0.85_wp
      !> Time between snapshots of the deformed ball, s; 0 for none.
      real(wp) :: snapshot_interval = 0.0_wp
      type(mesh_options_type) :: mesh
      type(material_options_type) :: material
      type(contact_options_type) :: contact
   contains
      procedure :: get_fields
      procedure :: check
      procedure :: refine
      procedure :: solve
      procedure :: compress
      procedure :: get_validity_limits
      procedure :: get_loss_factors
   end type finite_element_type

contains

   !> Keys and allowed ranges; some belong to groups of their own.
   function get_fields(self) result(fields)
      class(finite_element_type), intent(in), target :: self
      type(field_type), allocatable :: fields(:)

      fields = [ &
         new_field('bounces', self%bounces, '', 'number of contacts to compute', '[1, 100]'), &
         new_field('flight_before', self%flight_before, 's', 'duration of free flight before first touch', '[0, 1]', &
         trait='numerical'), &
         new_field('flight_after', self%flight_after, 's', 'duration of free flight after the last contact', &
         '[0, 10]', trait='numerical'), &
         new_field('step_safety', self%step_safety, '', 'time step divided by a bound on stable steps', &
         '[0.01, 0.98]', trait='numerical'), &
         in_group('mesh', get_mesh_fields(self%mesh)), &
         in_group('material', get_material_fields(self%material)), &
         in_group('contact', get_contact_fields(self%contact)), &
         in_group('output', [new_field('snapshot_interval', self%snapshot_interval, 's', &
         'time between snapshots of the deformed ball; 0: none', '[0, 10]', trait='numerical')])]
   end function get_fields

   !> Returns an error if options do not fit each other, the ball or the memory.
   subroutine check(self, ball, sampling, error)
      class(finite_element_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      type(sampling_type), intent(in) :: sampling
      type(error_type), allocatable, intent(out) :: error
      type(mesh_options_type) :: largest
      real(wp) :: bytes

      call check_material(self%material, ball, error)
      if (allocated(error)) return
      call check_mesh(self%mesh, error)
      if (allocated(error)) return
      if (sampling%sample_rate < min_rate) then
         error = input_error('= '//to_text(sampling%sample_rate)//' Hz is not allowed with finite_element; allowed: from ' &
            //to_text(min_rate)//' Hz', 'sampling', 'sample_rate')
         return
      end if
      largest = get_element_counts(ball, self%mesh)
      if (chooses_resolution(self)) then
         largest%radial_elements = nint(largest%radial_elements*refinement_ratio**(highest_level - 1))
         largest%polar_elements = nint(largest%polar_elements*refinement_ratio**(highest_level - 1)*max_contact_ratio)
      end if
      ! Positions and velocities of each node.
      bytes = 32.0_wp*(largest%radial_elements + 1)*(largest%polar_elements + 1)*get_frame_count(self, sampling)
      if (bytes > max_motion_bytes) error = input_error('= '//to_text(self%snapshot_interval)//' s makes ' &
         //to_text(get_frame_count(self, sampling))//' snapshots, more than the memory is meant to hold; allowed: a ' &
         //'longer interval, or 0 for none', 'output', 'snapshot_interval')
   end subroutine check

   !> The model at a level of resolution: at level 0 elements of twice the size, without snapshots; above level 1 smaller
   !> ones. Automatic elements are short enough for the contact radius of the coarser drop. The error follows from the level
   !> with elements of twice the size, if there is one, for errors proportional to the square of the element size; with
   !> elements of twice the size more, since these are often outside of that order.
   subroutine refine(self, ball, level, coarse, sampling, refined, resolution)
      class(finite_element_type), intent(inout) :: self
      type(ball_type), intent(in) :: ball
      integer, intent(in) :: level
      type(force_history_type), intent(in) :: coarse
      type(sampling_type), intent(inout) :: sampling
      class(source_model_type), allocatable, intent(out) :: refined
      type(resolution_type), intent(out) :: resolution
      class(finite_element_type), allocatable :: finer
      real(wp) :: refinement
      logical :: resolves_contact

      refinement = merge(0.5_wp, refinement_ratio**(level - 1), level == 0)
      resolves_contact = chooses_resolution(self) .and. allocated(coarse%model_history)
      allocate (finer, source=self)
      associate (mesh => finer%mesh)
         mesh = get_element_counts(ball, mesh)
         if (resolves_contact) mesh%polar_elements = nint(mesh%polar_elements*max(1.0_wp, min(max_contact_ratio, &
            contact_elements*pi*ball%outer_radius/mesh%polar_elements/maxval(coarse%model_history(:, 1)))))
         mesh%radial_elements = max(min_radial, nint(mesh%radial_elements*refinement))
         mesh%polar_elements = nint(mesh%polar_elements*refinement)
      end associate
      if (level == 0) finer%snapshot_interval = 0.0_wp
      resolution = resolution_type(reference=merge(level - 2, level - 1, level > 2), &
         ratio=merge(1/(refinement_ratio**2 - 1), 0.5_wp, level == 2), min_error=get_min_error(finer, ball))
      ! Nodes that stick and slip converge more slowly.
      if (self%contact%friction > 0.0_wp) resolution%ratio = 2*resolution%ratio
      if (level > 1) resolution%lowers_error = chooses_resolution(self) .and. level <= highest_level
      if (level > 1 .and. resolution%lowers_error) resolution%lowers_error = &
         count_work(self, ball, sampling)*refinement_ratio**(3*(level - 1)) < max_level_work
      call move_alloc(finer, refined)
   end subroutine refine

   !> Number of steps times elements of a drop at level 1, without the finer elements of the contact.
   function count_work(self, ball, sampling) result(work)
      class(finite_element_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      type(sampling_type), intent(in) :: sampling
      real(wp) :: work
      type(mesh_type) :: mesh
      type(material_type) :: material
      type(error_type), allocatable :: error
      real(wp) :: interval, time

      mesh = new_mesh(ball, self%mesh)
      ! The run reports a material that cannot be.
      call new_material(self%material, ball, material, error)
      interval = 1/sampling%sample_rate
      if (.not. allocated(error)) interval = self%step_safety*get_stable_interval(mesh, material, &
         new_floor_contact(self%contact, ball, mesh))
      time = typical_contact + self%flight_before + self%flight_after
      if (self%bounces > 1) time = sampling%duration
      time = min(time, sampling%duration)
      ! Elements with the lanes that are left empty.
      work = max(time*sampling%sample_rate*sampling%substeps, time/interval) &
         *(mesh%n_radial*n_element*ceiling(mesh%n_polar/real(n_element, wp)))
   end function count_work

   !> Whether the resolution may be chosen: the user's keys do not grow.
   pure function chooses_resolution(self) result(yes)
      class(finite_element_type), intent(in) :: self
      logical :: yes

      yes = self%mesh%radial_elements == 0 .and. self%mesh%polar_elements == 0
   end function chooses_resolution

   !> Minimum error with friction at which a sliding surface may begin to stick and slip on its own (`slip_friction`).
   function get_min_error(self, ball) result(error)
      !> The model with its numbers of elements, none of them automatic.
      class(finite_element_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      real(wp) :: error(octave_count)
      type(mesh_options_type) :: automatic
      real(wp) :: octave, scale
      integer :: i, below
      logical :: slips

      error = 0.0_wp
      slips = self%contact%friction > slip_friction(1) .and. self%contact%friction < slip_friction(2)
      associate (material => self%material)
         slips = slips .and. material%viscosity /= 'kelvin_voigt' &
            .and. (material%viscosity /= 'fractional' .or. material%fractional_order < 1.0_wp)
      end associate
      if (.not. slips) return
      automatic = get_element_counts(ball, mesh_options_type())
      scale = get_shear_rate(ball)/get_shear_rate(slip_ball)
      do i = 1, octave_count
         ! The octave of `slip_ball` that corresponds to this one; octaves are 10**0.3 apart.
         octave = min(real(octave_count, wp), max(1.0_wp, i - log10(scale)/0.3_wp))
         below = min(int(octave), octave_count - 1)
         error(i) = slip_error(below) + (octave - below)*(slip_error(below + 1) - slip_error(below))
      end do
      error = error*automatic%polar_elements/self%mesh%polar_elements
   end function get_min_error

   !> Velocity of shear waves per outer radius, 1/s.
   pure function get_shear_rate(ball) result(rate)
      type(ball_type), intent(in) :: ball
      real(wp) :: rate

      rate = sqrt(ball%youngs_modulus/(2*(1 + ball%poisson_ratio)*get_density(ball)))/ball%outer_radius
   end function get_shear_rate

   !> Maximum number of snapshots of a run.
   pure function get_frame_count(self, sampling) result(n_frame)
      class(finite_element_type), intent(in) :: self
      type(sampling_type), intent(in) :: sampling
      integer :: n_frame

      n_frame = 0
      if (self%snapshot_interval > 0.0_wp) n_frame = 1 + get_sample_count(sampling) &
         /max(1, nint(self%snapshot_interval*sampling%sample_rate))
   end function get_frame_count

   !> The limit of the speed of the ball; the error of the mesh is stated by its numerical error.
   function get_validity_limits(self, ball, drop, history) result(limits)
      class(finite_element_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      type(drop_type), intent(in) :: drop
      type(force_history_type), intent(in) :: history
      type(validity_limit_type), allocatable :: limits(:)

      limits = [get_wave_limit(ball, history, 0.5_wp)]
   end function get_validity_limits

   !> Loss factor of the material in shear as a function of frequency.
   subroutine get_loss_factors(self, ball, frequency, loss_factor, error)
      class(finite_element_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      !> Frequencies, Hz: [n].
      real(wp), intent(in) :: frequency(:)
      !> Loss factors: [n].
      real(wp), intent(out) :: loss_factor(:)
      !> Set if the material cannot be made.
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
      pressed = new_pressed_ball(ball, new_mesh(ball, self%mesh, between_plates=.true.), material)
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
      class(finite_element_type), intent(in) :: self
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
      real(wp) :: impact_velocity, speed, gap

      impact_velocity = get_impact_velocity(drop)
      speed = impact_velocity - drop%gravity*self%flight_before
      gap = speed*self%flight_before + drop%gravity*self%flight_before**2/2
      if (speed < 0.0_wp) then
         error = input_error('= '//to_text(self%flight_before)//' s is longer than the fall; allowed: up to ' &
            //to_text(impact_velocity/drop%gravity)//' s', 'finite_element', 'flight_before')
         return
      end if
      call new_material(self%material, ball, material, error)
      if (allocated(error)) return
      contacts%settling_time = 2*ball%outer_radius/sqrt(material%shear_modulus/material%density)
      if (contacts%settling_time > huge(1.0_wp)) then
         error = input_error('= '//to_text(ball%youngs_modulus)//' Pa is too low to compute with; allowed: a higher one', &
            'ball', 'youngs_modulus')
         return
      end if
      if (sampling%duration <= self%flight_before + contacts%settling_time) then
         error = input_error('= '//to_text(sampling%duration)//' s is too short: a contact is over after ' &
            //significant(contacts%settling_time, 3)//' s without touch, in which shear waves cross the ball; allowed: at ' &
            //'least '//significant(rounded_up*(self%flight_before + contacts%settling_time), 3)//' s', 'sampling', &
            'duration')
         return
      end if
      run = new_impact_run(ball, new_mesh(ball, self%mesh), material, self%contact, drop%gravity, gap, speed, receiver)
      history = new_impact_record(run, sampling, impact_velocity)
      history%touch_time = self%flight_before
      if (self%snapshot_interval > 0.0_wp) then
         allocate (history%motion)
         allocate (history%motion%start, source=run%position)
         allocate (history%motion%snapshot(get_frame_count(self, sampling)))
      end if
      call march(self, run, contacts, sampling, history, error)
      if (.not. allocated(error)) call finish_record(run, speed, history, error)
   end subroutine solve_once

   !> Integrates in time until the ball has left for good.
   subroutine march(self, run, contacts, sampling, history, error)
      !> Number of bounces, times of flight, step.
      class(finite_element_type), intent(in) :: self
      type(impact_run_type), intent(inout) :: run
      type(contacts_type), intent(inout) :: contacts
      type(sampling_type), intent(in) :: sampling
      !> Gets its samples, its snapshots, and contact time and restitution of the first contact.
      type(force_history_type), intent(inout) :: history
      !> Set if the ball cannot be computed or the record is too short.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: interval, step, time, first_energy
      integer :: i, k, n_step, stride, check_stride, last, latest

      last = run%body%mesh%n_radial
      interval = 1/sampling%sample_rate
      step = self%step_safety*get_stable_interval(run%body%mesh, run%body%material, run%contact)
      n_step = max(sampling%substeps, ceiling(min(interval/step, 2.0_wp*max_steps)))
      step = interval/n_step
      associate (n_node => size(run%body%mass), n_sample => size(history%floor_force))
         if (n_step > max_steps .or. real(n_step, wp)*n_sample*n_node > max_work) then
            error = numerical_error('stability asks for steps below '//to_text(step)//' s, too many for ' &
               //to_text(sampling%duration)//' s of '//to_text(n_node)//' nodes; allowed: a shorter duration, fewer ' &
               //'elements, a lower bulk_ratio, less viscosity', 'finite_element')
            return
         end if
      end associate
      check_stride = max(1, nint(check_interval*sampling%sample_rate))
      stride = max(1, nint(self%snapshot_interval*sampling%sample_rate))
      samples: do i = 1, size(history%floor_force)
         if (mod(i - 1, check_stride) == 0) call report_progress(1.0e3_wp*(i - 1)*interval, 1.0e3_wp*sampling%duration, 'ms')
         do k = 0, n_step - 1
            time = (i - 1)*interval + k*step
            ! No further contact is wanted: a node may reach the floor in the next step.
            if (contacts%n_over >= self%bounces) then
               if (minval(run%position(:, last, 2) + step*(run%velocity(:, last, 2) - step*run%gravity) &
                  - run%contact%edge_height) + run%floor%stop + step*run%floor%velocity < 0.0_wp) exit samples
            end if
            call update_velocity(run, step)
            if (i + k == 1) first_energy = get_energy(run)
            call check_run(run, time, first_energy, history, error)
            if (allocated(error)) return
            if (k == 0) then
               call record_sample(run, i, history)
               latest = i
               ! Pressures are means over the sampling interval, as the force is.
               if (allocated(history%motion) .and. mod(i - 1, stride) == 0) then
                  associate (motion => history%motion, r => run%position(:, last, 1), z => run%position(:, last, 2))
                     motion%n_frame = motion%n_frame + 1
                     motion%snapshot(motion%n_frame) = snapshot_type(time, run%position, run%velocity, &
                        run%node_impulse/interval/spread(get_nodal_areas(r, z), 2, 2), run%state%gas_pressure, &
                        run%floor%displacement)
                  end associate
               end if
               run%node_impulse = 0.0_wp
            end if
            call add_to_means(run%impulse, interval, i, min(1.0_wp, max(0.0_wp, k + 0.5_wp - n_step/2.0_wp)), &
               history%floor_force)
            history%impulse = history%impulse + run%impulse
            call follow_contact(run, contacts, time, step, history)
            call update_position(run, step)
         end do
         if (contacts%n_over < self%bounces) cycle samples
         if (time > contacts%latest + max(contacts%settling_time, self%flight_after)) exit samples
      end do samples
      if (run%floor%moves .and. run%impulse > 0.0_wp) then
         error = input_error('= '//to_text(sampling%duration)//' s ends while the ball is on the mobile floor; allowed: ' &
            //'longer than the contact, which never ends on a floor too light for the ball', 'sampling', 'duration')
      else if (contacts%n_over < self%bounces) then
         error = get_duration_error(run, contacts, self%bounces, sampling%duration)
      end if
      if (.not. allocated(error)) call continue_flight(run, latest, history)
   end subroutine march

end module thud_finite_element
