!> A tyre as two masses: the belt on its contact patch, and the rim on the belt. The patch carries inflation pressure
!> times contact area and the carcass, F = (p w d + c d (d/d0)^(n - 1))(1 + a d'), and is never pulled; rim and belt are
!> joined by the sidewall, a linear spring with viscous damping (residual stiffness and rigid ring of tyre dynamics).
module thud_two_mass
   use thud_ball, only: ball_type
   use thud_constants, only: pi
   use thud_contact_source, only: coarse_error, contact_source_type
   use thud_coupled_impact, only: solve_coupled
   use thud_drop, only: drop_type, get_impact_velocity
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type
   use thud_force_history, only: check_samples, force_history_type, max_residual, new_force_history
   use thud_interrupt, only: check_interrupt
   use thud_kinds, only: wp
   use thud_new_field, only: real_field
   use thud_receiver, only: is_rigid, receiver_type
   use thud_rk4, only: locate_zero, rk4_step
   use thud_sampling, only: check_contact_samples, get_sample_count, sampling_type
   use thud_source_model, only: source_model_type
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: two_mass_type

   !> Places in the state: displacement (m) and velocity (m/s) of belt and rim towards the floor since first touch, impulse
   !> given to the floor (N s), energy lost (J), gap between belt and floor (m).
   integer, parameter :: at_belt = 1, at_belt_velocity = 2, at_rim = 3, at_rim_velocity = 4, at_impulse = 5, at_loss = 6, &
      at_gap = 7, n_state = 7

   !> Angle by which the fastest motion advances in a step, rad, on a rigid floor and on one that moves: Runge and
   !> Kutta's steps lose angle**6/72 of its energy each, those of Radau IIA angle**6/3600: 4e-11 and 3e-9 in a radian.
   real(wp), parameter :: step_angle = 0.02_wp, coupled_angle = 0.1_wp

   !> Steps of one record; more would take longer than finite elements, and a tyre needs 1e4.
   real(wp), parameter :: max_steps = 2.0e7_wp

   !> Deflection d0 at which the stiffness of the carcass is given, m.
   real(wp), parameter :: carcass_deflection = 0.02_wp

   !> Options of the model; the defaults are the standards' tyre, see docs/lumped_models.md.
   type, extends(source_model_type) :: two_mass_type
      !> Mass of belt and tread, kg; the rest of the mass is the rim.
      real(wp) :: belt_mass = 2.0_wp
      !> Inflation pressure p, Pa.
      real(wp) :: inflation_pressure = 2.4e5_wp
      !> Contact area over deflection w, m.
      real(wp) :: area_growth = 0.40_wp
      !> Stiffness c of the carcass, force over deflection at `carcass_deflection`, N/m.
      real(wp) :: carcass_stiffness = 9.0e4_wp
      !> Exponent n of the carcass.
      real(wp) :: carcass_exponent = 2.5_wp
      !> Damping a of the contact, s/m.
      real(wp) :: contact_damping = 0.06_wp
      !> Natural frequency of the belt on the sidewall, the rim held, Hz.
      real(wp) :: belt_frequency = 85.0_wp
      !> Damping ratio of the same motion.
      real(wp) :: belt_damping = 0.2_wp
   contains
      procedure, pass(options) :: get_fields
      procedure, pass(options) :: check
      procedure, pass(options) :: solve
   end type two_mass_type

   !> Equations of motion of belt and rim.
   type, extends(contact_source_type) :: tyre_type
      !> Masses of belt and rim, kg.
      real(wp) :: belt_mass, rim_mass
      !> Stiffness of the inflated patch p w, N/m.
      real(wp) :: patch_stiffness
      !> Factor of the carcass, N/m^exponent, and its exponent.
      real(wp) :: carcass_factor, carcass_exponent
      !> Damping of the contact, s/m.
      real(wp) :: contact_damping
      !> Stiffness, N/m, and damping, N s/m, of the sidewall.
      real(wp) :: sidewall_stiffness, sidewall_damping
   contains
      procedure :: get_derivative
      procedure :: record_sample
      procedure :: record_peaks
      procedure :: get_reach
   end type tyre_type

contains

   !> Keys and allowed ranges.
   function get_fields(options) result(fields)
      !> The options that the fields read and set.
      class(two_mass_type), intent(in), target :: options
      !> One field per component: [8].
      type(field_type), allocatable :: fields(:)

      fields = [ &
         real_field('belt_mass', options%belt_mass, 'kg', 'mass of belt and tread, less than the mass of the source', &
         '(0, 1000000)'), &
         real_field('inflation_pressure', options%inflation_pressure, 'Pa', 'inflation pressure', '[0, 1e8]'), &
         real_field('area_growth', options%area_growth, 'm', 'contact area over deflection of the patch', '[0, 100]'), &
         real_field('carcass_stiffness', options%carcass_stiffness, 'N/m', &
         'force of the carcass over its deflection at 20 mm', '[0, 1e12]'), &
         real_field('carcass_exponent', options%carcass_exponent, '', 'exponent of the deflection of the carcass', &
         '[1.5, 5]'), &
         real_field('contact_damping', options%contact_damping, 's/m', &
         'damping of the contact over its elastic force and velocity', '[0, 100]'), &
         real_field('belt_frequency', options%belt_frequency, 'Hz', &
         'natural frequency of the belt on the sidewall, the rim held', '(0, 1000000]'), &
         real_field('belt_damping', options%belt_damping, '', 'damping ratio of the same motion', '[0, 10]')]
   end function get_fields

   !> Refuses a belt that leaves nothing for the rim, and a patch without stiffness.
   subroutine check(ball, options, sampling, error)
      !> The source.
      type(ball_type), intent(in) :: ball
      !> The options, each inside its own range.
      class(two_mass_type), intent(in) :: options
      type(sampling_type), intent(in) :: sampling
      type(error_type), allocatable, intent(out) :: error

      if (.not. options%belt_mass < ball%mass) then
         error = input_error('&two_mass: belt_mass = '//to_text(options%belt_mass)//' kg leaves no rim; allowed: below ' &
            //'&ball mass = '//to_text(ball%mass)//' kg')
      else if (.not. options%inflation_pressure*options%area_growth + options%carcass_stiffness > 0.0_wp) then
         error = input_error('&two_mass: carcass_stiffness = '//to_text(options%carcass_stiffness) &
            //' N/m with inflation_pressure = '//to_text(options%inflation_pressure)//' Pa and area_growth = ' &
            //to_text(options%area_growth)//' m bears no load; allowed: a carcass or an inflated patch')
      end if
   end subroutine check

   !> Force history of one drop.
   subroutine solve(ball, drop, options, sampling, history, error, receiver)
      !> The source, of which only the mass counts.
      type(ball_type), intent(in) :: ball
      type(drop_type), intent(in) :: drop
      class(two_mass_type), intent(in) :: options
      !> Sampling rate, length of the record, substeps.
      type(sampling_type), intent(in) :: sampling
      !> Force and motion from first touch on.
      type(force_history_type), intent(out) :: history
      !> The contact outlasts the record, or the steps are too coarse or too many.
      type(error_type), allocatable, intent(out) :: error
      !> What the source drops on (default: a rigid floor).
      type(receiver_type), intent(in), optional :: receiver
      type(tyre_type) :: tyre
      real(wp) :: state(n_state)
      integer :: n_sample, n_step
      logical :: moves

      tyre = new_tyre(ball%mass, options)
      n_sample = get_sample_count(sampling)
      history = new_force_history(sampling%sample_rate, n_sample, &
         [character(len=14) :: 'pressure_force', 'carcass_force', 'damping_force'])
      history%channel_name = [character(len=19) :: 'belt_displacement_m', 'rim_displacement_m']
      allocate (history%channel(n_sample, 2), source=0.0_wp)
      history%impact_velocity = get_impact_velocity(drop)
      moves = present(receiver)
      if (moves) moves = .not. is_rigid(receiver)
      call choose_steps(tyre, history%impact_velocity, merge(coupled_angle, step_angle, moves), sampling, n_step, error)
      if (allocated(error)) return
      if (moves) then
         call solve_coupled(tyre, drop, sampling, n_step, receiver, history, state, error)
      else
         call march(tyre, sampling, n_step, history, state, error)
      end if
      if (allocated(error)) return
      call check_contact_samples(sampling, history%contact_time, error)
      if (.not. allocated(error)) call finish(tyre, state, history, error)
      if (.not. allocated(error)) call check_samples(history, error)
   end subroutine solve

   !> Marches from first touch until the source has left a rigid floor for good.
   subroutine march(tyre, sampling, n_step, history, state, error)
      type(tyre_type), intent(inout) :: tyre
      type(sampling_type), intent(in) :: sampling
      !> Steps in each sampling interval.
      integer, intent(in) :: n_step
      !> Gets samples, maxima and contact time.
      type(force_history_type), intent(inout) :: history
      !> State after the last release: [7].
      real(wp), intent(out) :: state(:)
      !> The contact outlasts the record.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: step
      integer :: i, j, last
      logical :: left

      step = 1/(sampling%sample_rate*n_step)
      state = 0.0_wp
      state([at_belt_velocity, at_rim_velocity]) = history%impact_velocity
      left = .false.
      samples: do i = 1, size(history%floor_force)
         call tyre%record_sample(state, i, history)
         do j = 0, n_step - 1
            call advance(tyre, ((i - 1)*real(n_step, wp) + j)*step, step, state, history)
            left = has_left(tyre, state)
            if (left) exit samples
         end do
         call check_interrupt(error)
         if (allocated(error)) return
      end do samples
      if (.not. left) then
         error = input_error('&sampling: duration = '//to_text(sampling%duration) &
            //' s ends while the source is still in contact or may touch the floor again; allowed: longer')
         return
      end if
      ! Like every model, the record ends with the last contact.
      last = floor(history%contact_time*history%sample_rate) + 1
      history%deflection(last + 1:) = 0.0_wp
      history%velocity(last + 1:) = 0.0_wp
      history%channel(last + 1:, :) = 0.0_wp
   end subroutine march

   !> The equations of motion in contact.
   pure function new_tyre(mass, options) result(tyre)
      !> Mass of belt and rim together, kg.
      real(wp), intent(in) :: mass
      type(two_mass_type), intent(in) :: options
      type(tyre_type) :: tyre
      real(wp) :: omega

      omega = 2*pi*options%belt_frequency
      tyre = tyre_type(mass=mass, n_mass=2, n_state=n_state, belt_mass=options%belt_mass, &
         rim_mass=mass - options%belt_mass, &
         patch_stiffness=options%inflation_pressure*options%area_growth, &
         carcass_factor=options%carcass_stiffness/carcass_deflection**(options%carcass_exponent - 1), &
         carcass_exponent=options%carcass_exponent, contact_damping=options%contact_damping, &
         sidewall_stiffness=options%belt_mass*omega**2, &
         sidewall_damping=2*options%belt_damping*options%belt_mass*omega)
   end function new_tyre

   !> Chooses the steps in each sampling interval by the fastest motion.
   subroutine choose_steps(tyre, impact_velocity, angle, sampling, n_step, error)
      type(tyre_type), intent(in) :: tyre
      !> Velocity at first touch, m/s.
      real(wp), intent(in) :: impact_velocity
      !> Angle of the fastest motion in a step, rad.
      real(wp), intent(in) :: angle
      type(sampling_type), intent(in) :: sampling
      !> Steps in each sampling interval.
      integer, intent(out) :: n_step
      !> The record would take too many.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: steps, total

      steps = real(sampling%substeps, wp)*ceiling(min(max_steps, &
         get_fastest_rate(tyre, impact_velocity)/(angle*sampling%sample_rate)))
      total = steps*get_sample_count(sampling)
      n_step = nint(min(steps, max_steps))
      if (total > max_steps) error = input_error('&two_mass: belt_mass = '//to_text(tyre%belt_mass) &
         //' kg with the stiffness of patch and sidewall needs '//to_text(total)//' steps; allowed: up to ' &
         //to_text(max_steps))
   end subroutine choose_steps

   !> Bound of the fastest rate of the motion, rad/s: of its frequencies by the trace, and of its decay.
   pure function get_fastest_rate(tyre, impact_velocity) result(rate)
      type(tyre_type), intent(in) :: tyre
      !> Velocity at first touch, m/s.
      real(wp), intent(in) :: impact_velocity
      !> The bound, rad/s.
      real(wp) :: rate
      real(wp) :: energy, deflection, power

      associate (n => tyre%carcass_exponent, c => tyre%carcass_factor, k => tyre%patch_stiffness)
         ! The patch can at most store all of the energy.
         energy = (tyre%belt_mass + tyre%rim_mass)/2*impact_velocity**2
         deflection = huge(1.0_wp)
         if (k > 0.0_wp) deflection = sqrt(2*energy/k)
         if (c > 0.0_wp) deflection = min(deflection, ((n + 1)*energy/c)**(1/(n + 1)))
         power = deflection**(n - 1)
         rate = max(sqrt((k + n*c*power)/tyre%belt_mass + tyre%sidewall_stiffness*(1/tyre%belt_mass + 1/tyre%rim_mass)), &
            tyre%contact_damping*(k + c*power)*deflection/tyre%belt_mass &
            + tyre%sidewall_damping*(1/tyre%belt_mass + 1/tyre%rim_mass))
      end associate
   end function get_fastest_rate

   !> Right-hand side of the equations of motion.
   pure subroutine get_derivative(self, time, state, rate, valid)
      class(tyre_type), intent(in) :: self
      !> Time since first touch, s; the equations do not depend on it.
      real(wp), intent(in) :: time
      !> State: [7].
      real(wp), intent(in) :: state(:)
      !> Derivative of the state: [7].
      real(wp), intent(out) :: rate(:)
      !> Always true.
      logical, intent(out) :: valid
      real(wp) :: parts(3)
      real(wp) :: force, sidewall

      valid = time >= 0.0_wp
      call get_parts(self, state, parts)
      force = sum(parts)
      associate (belt => state(at_belt_velocity), rim => state(at_rim_velocity))
         sidewall = self%sidewall_stiffness*(state(at_rim) - state(at_belt)) + self%sidewall_damping*(rim - belt)
         rate(at_belt) = belt
         rate(at_belt_velocity) = (sidewall - force)/self%belt_mass
         rate(at_rim) = rim
         rate(at_rim_velocity) = -sidewall/self%rim_mass
         rate(at_impulse) = force
         rate(at_loss) = parts(3)*belt + self%sidewall_damping*(rim - belt)**2
         rate(at_gap) = -belt
      end associate
   end subroutine get_derivative

   !> Parts of the force on the floor; they go on smoothly past the end of a contact, where its event is sought.
   pure subroutine get_parts(tyre, state, parts)
      class(tyre_type), intent(in) :: tyre
      !> State: [7].
      real(wp), intent(in) :: state(:)
      !> Pressure times area, carcass, damping, N: [3].
      real(wp), intent(out) :: parts(:)

      parts = 0.0_wp
      if (.not. tyre%touching) return
      associate (d => state(at_belt))
         parts(1) = tyre%patch_stiffness*d
         parts(2) = tyre%carcass_factor*sign(abs(d)**tyre%carcass_exponent, d)
         ! The floor does not pull.
         parts(3) = max(-1.0_wp, tyre%contact_damping*state(at_belt_velocity))*sum(parts(1:2))
      end associate
   end subroutine get_parts

   !> Moves the state on by one step, through touches and releases inside it.
   subroutine advance(tyre, start_time, step, state, history)
      !> The tyre; it changes between contact and flight.
      type(tyre_type), intent(inout) :: tyre
      !> Time at the beginning of the step since first touch, s; its length, s.
      real(wp), intent(in) :: start_time, step
      !> State: [7].
      real(wp), intent(inout) :: state(:)
      !> Gets maxima, and the time of each release.
      type(force_history_type), intent(inout) :: history
      real(wp) :: new_state(n_state)
      real(wp) :: time, length
      integer :: component
      logical :: valid

      time = start_time
      do
         length = start_time + step - time
         if (.not. length > 0.0_wp) return
         call rk4_step(tyre, time, state, length, new_state, valid)
         component = merge(at_belt, at_gap, tyre%touching)
         if (new_state(component) > 0.0_wp) exit
         length = locate_zero(tyre, time, state, length, component)
         call rk4_step(tyre, time, state, length, new_state, valid)
         time = time + length
         state = new_state
         state([at_belt, at_gap]) = 0.0_wp
         if (tyre%touching) history%contact_time = time
         tyre%touching = .not. tyre%touching
      end do
      state = new_state
      call tyre%record_peaks(state, history)
   end subroutine advance

   !> Raises the maxima of force and deflection.
   pure subroutine record_peaks(self, state, history)
      !> The tyre.
      class(tyre_type), intent(in) :: self
      !> State: [7].
      real(wp), intent(in) :: state(:)
      type(force_history_type), intent(inout) :: history
      real(wp) :: parts(3)

      call get_parts(self, state, parts)
      history%peak_force = max(history%peak_force, sum(parts))
      history%max_deflection = max(history%max_deflection, get_mean(self, state, at_belt, at_rim))
   end subroutine record_peaks

   !> Mean of belt and rim by their masses: deflection (m) or velocity (m/s) of the centre of mass.
   pure function get_mean(tyre, state, belt, rim) result(mean)
      class(tyre_type), intent(in) :: tyre
      !> State: [7].
      real(wp), intent(in) :: state(:)
      !> Places of the quantity in the state.
      integer, intent(in) :: belt, rim
      real(wp) :: mean

      mean = (tyre%belt_mass*state(belt) + tyre%rim_mass*state(rim))/(tyre%belt_mass + tyre%rim_mass)
   end function get_mean

   !> Energy of the motion of belt and rim against each other, and of the sidewall, J.
   pure function get_inner_energy(tyre, state) result(energy)
      class(tyre_type), intent(in) :: tyre
      !> State: [7].
      real(wp), intent(in) :: state(:)
      !> The energy, J.
      real(wp) :: energy

      energy = tyre%belt_mass*tyre%rim_mass/(tyre%belt_mass + tyre%rim_mass)/2 &
         *(state(at_rim_velocity) - state(at_belt_velocity))**2 &
         + tyre%sidewall_stiffness/2*(state(at_rim) - state(at_belt))**2
   end function get_inner_energy

   !> Line that no part of the tyre in flight crosses: all of its inner energy lets the belt sink so far.
   pure subroutine get_reach(self, state, displacement, velocity)
      !> The tyre.
      class(tyre_type), intent(in) :: self
      !> State: [7].
      real(wp), intent(in) :: state(:)
      !> Displacement of the line towards the floor, m, and its constant velocity, m/s.
      real(wp), intent(out) :: displacement, velocity

      displacement = get_mean(self, state, at_belt, at_rim) + self%rim_mass/(self%belt_mass + self%rim_mass) &
         *sqrt(2*get_inner_energy(self, state)/self%sidewall_stiffness)
      velocity = get_mean(self, state, at_belt_velocity, at_rim_velocity)
   end subroutine get_reach

   !> The source has left a rigid floor for good.
   pure function has_left(tyre, state) result(left)
      type(tyre_type), intent(in) :: tyre
      !> State: [7].
      real(wp), intent(in) :: state(:)
      logical :: left
      real(wp) :: displacement, velocity

      left = .false.
      if (tyre%touching) return
      call tyre%get_reach(state, displacement, velocity)
      left = displacement < 0.0_wp .and. velocity < 0.0_wp
   end function has_left

   !> Writes motion and forces of one instant into the history.
   pure subroutine record_sample(self, state, i, history)
      !> The tyre in its present phase.
      class(tyre_type), intent(in) :: self
      !> State at the sample: [7].
      real(wp), intent(in) :: state(:)
      !> Number of the sample.
      integer, intent(in) :: i
      type(force_history_type), intent(inout) :: history

      history%deflection(i) = get_mean(self, state, at_belt, at_rim)
      history%velocity(i) = get_mean(self, state, at_belt_velocity, at_rim_velocity)
      history%channel(i, :) = state([at_belt, at_rim])
      if (allocated(history%floor_displacement)) then
         history%channel(i, :) = history%channel(i, :) + history%floor_displacement(i)
      end if
      call get_parts(self, state, history%part(i, :))
      history%elastic_force(i) = sum(history%part(i, :))
      history%floor_force(i) = history%elastic_force(i)
   end subroutine record_sample

   !> Scalars of the impact from the last state, and the check of the balances.
   subroutine finish(tyre, state, history, error)
      type(tyre_type), intent(in) :: tyre
      !> State after the last release: [7].
      real(wp), intent(in) :: state(:)
      !> The history; its samples are complete.
      type(force_history_type), intent(inout) :: history
      !> A balance does not close.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: mass, velocity, energy, momentum

      mass = tyre%belt_mass + tyre%rim_mass
      velocity = get_mean(tyre, state, at_belt_velocity, at_rim_velocity)
      history%peak_elastic_force = history%peak_force
      associate (v0 => history%impact_velocity)
         history%restitution = -velocity/v0
         momentum = mass*(v0 - velocity)
         energy = mass/2*v0**2
         history%impulse = state(at_impulse)
         history%impulse_residual = abs(history%impulse - momentum)/momentum
         history%energy_residual = abs(mass/2*velocity**2 + get_inner_energy(tyre, state) + state(at_loss) &
            + history%floor_work - energy)/energy
      end associate
      ! Written so that NaN fails too.
      if (.not. max(history%impulse_residual, history%energy_residual) <= max_residual) then
         error = coarse_error('the balance of impulse misses by '//to_text(history%impulse_residual) &
            //' and that of energy by '//to_text(history%energy_residual)//', more than '//to_text(max_residual))
      end if
   end subroutine finish

end module thud_two_mass
