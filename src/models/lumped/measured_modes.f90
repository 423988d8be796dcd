!> Source described by measured modes of the ball standing on the floor (after Park et al. 2010; paper, sections 1 and 4.1):
!> each mode is an oscillator on the floor that starts with the impact velocity, and the contact lasts until the sum of the
!> modal forces first returns to zero.
module thud_measured_modes
   use thud_ball, only: ball_type, drop_type, get_impact_velocity
   use thud_constants, only: pi
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type, list_type, new_field
   use thud_force_history, only: force_history_type, new_force_history
   use thud_interrupt, only: check_interrupt, is_interrupted
   use thud_kinds, only: wp
   use thud_receiver, only: receiver_type
   use thud_sampling, only: get_sample_count, sampling_type
   use thud_source_model, only: source_model_type
   use thud_text, only: fixed, to_text
   use thud_zero_search, only: bisection_type
   implicit none (type, external)
   private

   public :: measured_modes_type

   !> Maximum relative error of the sum of effective masses: published values are rounded.
   real(wp), parameter :: mass_tolerance = 1.0e-3_wp

   !> Evaluations per shortest period in the search for the first zero of the force.
   integer, parameter :: checks_per_period = 16

   !> Options of the model: one entry per mode in each list.
   type, extends(source_model_type) :: measured_modes_type
      !> Natural frequencies, Hz.
      type(list_type) :: frequency
      type(list_type) :: damping_ratio
      !> Effective masses, kg.
      type(list_type) :: effective_mass
      !> Whether the sum of the masses may differ from the mass of the ball.
      logical :: allow_mass_mismatch = .false.
   contains
      procedure :: get_fields
      procedure :: check
      procedure :: solve
   end type measured_modes_type

   !> Motion and force of one mode in closed form.
   type :: mode_type
      !> Effective mass, kg.
      real(wp) :: mass
      !> Angular frequency without damping, rad/s.
      real(wp) :: omega
      !> Damping ratio.
      real(wp) :: zeta
      !> Angular frequency with damping, rad/s.
      real(wp) :: omega_damped
   end type mode_type

contains

   !> Keys and allowed ranges.
   function get_fields(self) result(fields)
      class(measured_modes_type), intent(in), target :: self
      type(field_type), allocatable :: fields(:)

      fields = [ &
         new_field('frequency', self%frequency, 'Hz', 'natural frequencies of the ball on the floor', &
         '[0.001, 1000000]'), new_field('damping_ratio', self%damping_ratio, '', 'damping ratios, one per mode', &
         '[0, 1)'), new_field('effective_mass', self%effective_mass, 'kg', 'effective masses, one per mode', &
         '[1e-12, 1000000]'), new_field('allow_mass_mismatch', self%allow_mass_mismatch, '', &
         'effective masses need not add up to the mass of the ball')]
   end function get_fields

   !> Returns an error if lists do not fit each other or the ball.
   subroutine check(self, ball, sampling, error)
      class(measured_modes_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      type(sampling_type), intent(in) :: sampling
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: total

      associate (n => self%frequency%count)
         if (n == 0) then
            error = input_error('has no value; allowed: one frequency per mode, Hz', 'measured_modes', 'frequency')
         else if (self%damping_ratio%count /= n .or. self%effective_mass%count /= n) then
            error = input_error('has '//to_text(n)//' values, damping_ratio '//to_text(self%damping_ratio%count)//' and ' &
               //'effective_mass '//to_text(self%effective_mass%count)//'; allowed: as many of each', 'measured_modes', &
               'frequency')
         else
            total = sum(self%effective_mass%values(:n))
            if (abs(total - ball%mass) > mass_tolerance*ball%mass .and. .not. self%allow_mass_mismatch) then
               error = input_error('adds up to '//to_text(total)//' kg; allowed: the mass of the ball, ' &
                  //to_text(ball%mass)//' kg, or allow_mass_mismatch = .true.', 'measured_modes', 'effective_mass')
            end if
         end if
      end associate
   end subroutine check

   !> Force history of one drop. Modes of a ball on a rigid floor do not apply to a mobile floor, which is ignored.
   subroutine solve(self, ball, drop, sampling, history, error, receiver)
      class(measured_modes_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      type(drop_type), intent(in) :: drop
      type(sampling_type), intent(in) :: sampling
      type(force_history_type), intent(out) :: history
      type(error_type), allocatable, intent(out) :: error
      type(receiver_type), intent(in), optional :: receiver
      type(mode_type) :: modes(self%frequency%count)
      real(wp) :: step, time, force, deflection, velocity, v0
      type(bisection_type) :: bracket
      integer :: i, j, substeps
      logical :: released

      modes%mass = self%effective_mass%values(:size(modes))
      modes%omega = 2*pi*self%frequency%values(:size(modes))
      modes%zeta = self%damping_ratio%values(:size(modes))
      modes%omega_damped = modes%omega*sqrt(1 - modes%zeta**2)
      v0 = get_impact_velocity(drop)
      step = 1/sampling%sample_rate
      history = new_force_history(sampling%sample_rate, get_sample_count(sampling), ['modal_force'])
      history%impact_velocity = v0
      substeps = ceiling(checks_per_period*maxval(modes%omega)/(2*pi)*step)
      released = .false.
      march: do i = 1, size(history%floor_force)
         call check_interrupt(error)
         if (allocated(error)) return
         call get_motion(modes, v0, (i - 1)*step, history%deflection(i), history%velocity(i), history%component(i, 1))
         do j = 1, substeps
            time = (i - 1 + real(j, wp)/substeps)*step
            call get_motion(modes, v0, time, deflection, velocity, force)
            released = force <= 0.0_wp
            if (released) exit march
         end do
      end do march
      if (.not. released) then
         error = input_error('= '//to_text(sampling%duration)//' s ends after '//fixed(1.0e3_wp*time, 1)//' ms of ' &
            //'contact; allowed: longer than the contact', 'sampling', 'duration')
         return
      end if
      ! Dashpots make the force jump at first touch: the first sample is the mean of both sides.
      history%component(1, 1) = history%component(1, 1)/2
      history%elastic_force = history%component(:, 1)
      history%floor_force = history%component(:, 1)
      bracket = bisection_type(time - step/substeps, time)
      do while (bracket%is_open())
         call get_motion(modes, v0, bracket%get_middle(), deflection, velocity, force)
         call bracket%halve(force > 0.0_wp)
      end do
      call finish(modes, bracket%get_middle(), history, error)
      if (allocated(error)) return
      if (history%restitution < 0.0_wp) error = input_error('and effective_mass let the force end after ' &
         //to_text(history%contact_time)//' s, before the ball turns; allowed: modes that do not', 'measured_modes', &
         'frequency')
   end subroutine solve

   !> Sum of all modes at one time: d_n = (v0/w_d) exp(-zeta w t) sin(w_d t), F = sum M_n (w^2 d_n + 2 zeta w d_n').
   pure subroutine get_motion(modes, impact_velocity, time, deflection, velocity, force)
      !> The modes: [n_mode].
      type(mode_type), intent(in) :: modes(:)
      !> Velocity at first touch, m/s; time since first touch, s.
      real(wp), intent(in) :: impact_velocity, time
      !> Deflection of the center of mass, m; its velocity, m/s; force on the floor, N.
      real(wp), intent(out) :: deflection, velocity, force
      real(wp), dimension(size(modes)) :: d, v, decay, sine

      associate (m => modes%mass, w => modes%omega, zeta => modes%zeta, wd => modes%omega_damped)
         decay = impact_velocity*exp(-zeta*w*time)
         sine = sin(wd*time)
         d = decay*sine/wd
         v = decay*(cos(wd*time) - zeta*w/wd*sine)
         deflection = sum(m*d)/sum(m)
         velocity = sum(m*v)/sum(m)
         force = sum(m*(w**2*d + 2*zeta*w*v))
      end associate
   end subroutine get_motion

   !> Scalars of the impact. By the equations of motion of the modes, the impulse is the change of momentum. The closed form
   !> has no error of integration, so the residuals stay 0.
   subroutine finish(modes, contact_time, history, error)
      type(mode_type), intent(in) :: modes(:)
      !> Time of release, s.
      real(wp), intent(in) :: contact_time
      !> The history; its samples are complete.
      type(force_history_type), intent(inout) :: history
      !> Set after an interrupt.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: deflection, velocity, force
      integer :: i, n_interval

      ! At least 64 instants in the shortest period.
      n_interval = max(4096, 2*ceiling(32*contact_time*maxval(modes%omega)/(2*pi)))
      do i = 0, n_interval
         if (is_interrupted()) exit
         call get_motion(modes, history%impact_velocity, contact_time*i/n_interval, deflection, velocity, force)
         history%peak_force = max(history%peak_force, force)
         history%max_deflection = max(history%max_deflection, deflection)
      end do
      history%peak_force = max(history%peak_force, maxval(history%floor_force))
      history%max_deflection = max(history%max_deflection, maxval(history%deflection))
      history%peak_elastic_force = history%peak_force
      history%contact_time = contact_time
      history%restitution = -velocity/history%impact_velocity
      history%impulse = sum(modes%mass)*(history%impact_velocity - velocity)
      call check_interrupt(error)
   end subroutine finish

end module thud_measured_modes
