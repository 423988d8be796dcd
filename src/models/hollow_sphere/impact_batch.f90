!> Impacts of a batch of balls: state, whole and shortened steps, and the search for the end of a phase within a step.
module thud_impact_batch
   use, intrinsic :: iso_c_binding, only: c_bool, c_int
   use thud_constants, only: pi
   use thud_contact_source, only: at_deflection, at_velocity
   use thud_hollow_sphere, only: shell_type
   use thud_kinds, only: wp
   use thud_rk4, only: rk4_step
   use thud_shell_batch, only: batch_size, shell_batch_type, state_batch_type
   use thud_shell_series, only: expand_series, get_flows, series_batch_type, take_step
   implicit none (type, external)
   private

   public :: add_end, advance, finish_step, get_single, get_watched, impact_batch_type, is_finite, locate

   !> Impacts, in the units of `thud_shell_batch` unless stated otherwise. Fastest if it lies at the beginning of a
   !> cache line, see `thud_cache_line`; interoperable, so that it may lie in a buffer.
   type, bind(c) :: impact_batch_type
      !> Series of the equations.
      type(series_batch_type) :: series
      !> Velocity at first touch: [batch_size].
      real(wp) :: impact_velocity(batch_size)
      !> The present state and, in the other slot, the state at the end of the current step.
      type(state_batch_type) :: states(2)
      !> Ones, the length of whole steps: [batch_size].
      real(wp) :: whole_step(batch_size)
      !> Maximum deflection: [batch_size].
      real(wp) :: max_deflection(batch_size)
      !> Maximum elastic force, at samples and turning point, N: [batch_size].
      real(wp) :: peak_elastic_force(batch_size)
      !> Maximum force on the floor, at the same instants, N: [batch_size].
      real(wp) :: peak_force(batch_size)
      !> Steps from first touch to release: [batch_size].
      real(wp) :: contact_steps(batch_size)
      type(shell_batch_type) :: shell
      !> Factor s of the flux term in restitution.
      real(wp) :: restitution_weight
      !> Index in `states` of the present state. After the impact this is the state at release or, for a ball without
      !> release, at the beginning of its last step.
      integer(c_int) :: now
      !> Whether the ball was released: [batch_size].
      logical(c_bool) :: released(batch_size)
      !> Whether a stage has left the domain of the equation: [batch_size].
      logical(c_bool) :: out_of_domain(batch_size)
      !> Whether the last step left the reach of the series: [batch_size].
      logical(c_bool) :: out_of_range(batch_size)
   end type impact_batch_type

contains

   !> Takes a whole or shortened step from the present state to the other slot. If balls leave the reach of their series, the
   !> single solver, which needs no series, takes the step for each of them.
   pure subroutine advance(impacts, active, length, elastic_force, floor_force, missed)
      !> The impacts; the new velocity is NaN if a stage has left the domain of the equation.
      type(impact_batch_type), intent(inout) :: impacts
      !> Whether the result for the ball is needed: [batch_size].
      logical, intent(in) :: active(batch_size)
      !> Length of the step: [batch_size].
      real(wp), intent(in) :: length(batch_size)
      !> Elastic force at the beginning, N: [batch_size].
      real(wp), intent(out) :: elastic_force(batch_size)
      !> Force on the floor at the beginning, N: [batch_size].
      real(wp), intent(out) :: floor_force(batch_size)
      !> Whether a ball left the reach of its series.
      logical, intent(out) :: missed
      integer :: i, other

      other = 3 - impacts%now
      call take_step(impacts%shell, impacts%series, impacts%states(impacts%now), length, impacts%states(other), &
         elastic_force, floor_force, missed)
      if (.not. missed) return
      do i = 1, batch_size
         impacts%out_of_range(i) = active(i) .and. .not. is_finite(impacts%states(other)%velocity(i))
         if (impacts%out_of_range(i)) call take_single_step(impacts, i, length(i))
      end do
   end subroutine advance

   !> The step of one ball by the single solver.
   pure subroutine take_single_step(impacts, i, length)
      !> The impacts; the new velocity stays NaN if a stage leaves the domain of the equation.
      type(impact_batch_type), intent(inout) :: impacts
      !> Index of the ball.
      integer, intent(in) :: i
      real(wp), intent(in) :: length
      real(wp), dimension(4) :: state, new
      logical :: valid

      state = 0.0_wp
      state(at_deflection) = impacts%states(impacts%now)%deflection(i)
      state(at_velocity) = impacts%states(impacts%now)%velocity(i)
      call rk4_step(get_single(impacts%shell, i), 0.0_wp, state, length, new, valid)
      if (.not. valid) return
      impacts%states(3 - impacts%now)%deflection(i) = new(at_deflection)
      impacts%states(3 - impacts%now)%velocity(i) = new(at_velocity)
   end subroutine take_single_step

   !> The equation of one ball for the single solver, in the units of the batch.
   pure function get_single(shell, i) result(single)
      type(shell_batch_type), intent(in) :: shell
      !> Index of the ball.
      integer, intent(in) :: i
      !> A ball of unit diameter and mass in the present phase.
      type(shell_type) :: single

      single%radius = 0.5_wp
      single%mass = 1.0_wp
      single%closing_deflection = shell%closing(i)
      single%stiffness = shell%stiffness(i)
      single%initial_pressure = shell%gas_pressure(i)/pi
      single%ambient_pressure = shell%air_pressure(i)/pi
      single%heat_capacity_ratio = -shell%exponent(i)
      single%compression_weight = shell%weight
      single%restitution_weight = shell%weight
   end function get_single

   !> Whether a value is finite.
   elemental function is_finite(value) result(finite)
      real(wp), intent(in) :: value
      logical :: finite

      finite = abs(value) <= huge(value)
   end function is_finite

   !> Fractions of the step at which the phase ends, to rounding: the search of `thud_lumped` for all balls together; 1 for
   !> balls without such an end.
   subroutine locate(impacts, compressing, ends, length)
      !> The impacts, at the beginning of the step.
      type(impact_batch_type), intent(inout) :: impacts
      !> Whether the phase is compression, which ends at zero velocity.
      logical, intent(in) :: compressing
      !> Whether the phase of the ball ends in this step: [batch_size].
      logical, intent(in) :: ends(batch_size)
      !> The fractions: [batch_size].
      real(wp), intent(out) :: length(batch_size)
      integer, parameter :: max_iterations = 200
      real(wp), dimension(batch_size) :: left, right, left_value, right_value, value, rounding
      logical, dimension(batch_size) :: searching, left_moved, right_moved
      integer :: iteration

      call expand_series(impacts%shell, impacts%states(impacts%now), ends, impacts%series)
      left = 0.0_wp
      left_value = get_watched(impacts%states(impacts%now), compressing)
      right = 1.0_wp
      call try_length(impacts, compressing, ends, right, right_value)
      rounding = epsilon(1.0_wp)*abs(right_value - left_value)
      left_moved = .false.
      right_moved = .false.
      do iteration = 1, max_iterations
         searching = ends .and. right - left > 2*epsilon(1.0_wp)*right
         if (.not. any(searching)) exit
         length = right - right_value*(right - left)/(right_value - left_value)
         where (mod(iteration, 8) == 0 .or. .not. (length > left .and. length < right)) length = (left + right)/2
         call try_length(impacts, compressing, ends, length, value)
         ! Halve the value at an end kept twice (Illinois): regula falsi would converge slowly.
         where (searching .and. value > 0.0_wp)
            left = length
            left_value = value
            right_value = merge(right_value/2, right_value, left_moved)
         else where (searching)
            right = length
            right_value = value
            left_value = merge(left_value/2, left_value, right_moved)
         end where
         ! A value within rounding gives no better estimate.
         where (searching .and. abs(value) <= rounding)
            left = length
            right = length
         end where
         left_moved = value > 0.0_wp
         right_moved = .not. left_moved
      end do
      length = right
   end subroutine locate

   !> Value at the end of a shortened step.
   subroutine try_length(impacts, compressing, active, length, value)
      type(impact_batch_type), intent(inout) :: impacts
      logical, intent(in) :: compressing
      !> Whether the result for the ball is needed: [batch_size].
      logical, intent(in) :: active(batch_size)
      !> Fraction of the step: [batch_size].
      real(wp), intent(in) :: length(batch_size)
      !> Velocity or deflection, zero at the end of the phase: [batch_size].
      real(wp), intent(out) :: value(batch_size)
      real(wp), dimension(batch_size) :: elastic_force, floor_force
      logical :: missed

      call advance(impacts, active, length, elastic_force, floor_force, missed)
      value = get_watched(impacts%states(3 - impacts%now), compressing)
   end subroutine try_length

   !> Quantity that is zero at the end of the phase: velocity or deflection.
   pure function get_watched(state, compressing) result(watched)
      type(state_batch_type), intent(in) :: state
      !> Whether the phase is compression, which ends at zero velocity.
      logical, intent(in) :: compressing
      !> Velocity or deflection: [batch_size].
      real(wp) :: watched(batch_size)

      watched = state%deflection
      if (compressing) watched = state%velocity
   end function get_watched

   !> Takes a shortened step for some of the balls.
   subroutine finish_step(impacts, active, length, elastic_force, floor_force)
      !> The impacts; their series are expanded again at the end of the step.
      type(impact_batch_type), intent(inout) :: impacts
      !> Whether the ball takes the step: [batch_size].
      logical, intent(in) :: active(batch_size)
      !> Length of the step: [batch_size].
      real(wp), intent(in) :: length(batch_size)
      !> Elastic force at the beginning, N: [batch_size].
      real(wp), intent(out) :: elastic_force(batch_size)
      !> Force on the floor at the beginning, N: [batch_size].
      real(wp), intent(out) :: floor_force(batch_size)
      logical :: missed

      associate (state => impacts%states(impacts%now), new => impacts%states(3 - impacts%now))
         call expand_series(impacts%shell, state, active, impacts%series)
         call add_end(impacts, active, length/2, length**2/12)
         call advance(impacts, active, length, elastic_force, floor_force, missed)
         where (active)
            state%deflection = new%deflection
            state%velocity = new%velocity
         end where
         call expand_series(impacts%shell, state, active, impacts%series)
         call add_end(impacts, active, length/2, -length**2/12)
      end associate
   end subroutine finish_step

   !> Adds the terms of one end of an interval to the sums of impulse and loss. The steps add their values at the beginning;
   !> with the terms of both ends, the sums are integrals by the trapezoidal rule with its first correction (Euler and
   !> Maclaurin), of fourth order like the steps.
   pure subroutine add_end(impacts, active, value_factor, rate_factor)
      !> The impacts, within reach of their series.
      type(impact_batch_type), intent(inout) :: impacts
      !> Whether to add for the ball: [batch_size].
      logical, intent(in) :: active(batch_size)
      !> Factor of the values at the end: [batch_size].
      real(wp), intent(in) :: value_factor(batch_size)
      !> Factor of the rates of change at the end: [batch_size].
      real(wp), intent(in) :: rate_factor(batch_size)
      real(wp), dimension(batch_size) :: force, force_rate, power, power_rate

      associate (state => impacts%states(impacts%now))
         call get_flows(impacts%shell, impacts%series, state, force, force_rate, power, power_rate)
         where (active)
            state%impulse = state%impulse + value_factor*force + rate_factor*force_rate
            state%loss = state%loss + value_factor*power + rate_factor*power_rate
         end where
      end associate
   end subroutine add_end

end module thud_impact_batch
