!> Impacts of a batch of balls: the same time integration as in `thud_lumped`. The steps are the same, and the ends of
!> compression (the turning point) and of restitution (the release) are located within a step.
!>
!> All balls take their steps in parallel, so that sample i of all forces is written together. A ball that has reached its
!> turning point waits until all others have reached theirs or failed; then the turning points are located together, and
!> each ball continues at its own time. A ball fails if a step leaves the reach of its series.
module thud_shell_impacts
   use thud_constants, only: not_a_number
   use thud_interrupt, only: is_interrupted
   use thud_kinds, only: wp
   use thud_shell_series, only: batch_size, expand_series, series_batch_type, series_steps, shell_batch_type, &
      state_batch_type, take_step
   implicit none (type, external)
   private

   public :: impact_batch_type, solve_impacts

   !> Step that never comes.
   real(wp), parameter :: never = huge(1.0_wp)

   !> A series is kept as long as its ball will stay within this fraction of the reach until the next check.
   real(wp), parameter :: inner = 0.6_wp

   !> Maximum number of trials for the end of a phase; within a step the motion is nearly linear.
   integer, parameter :: max_trials = 30

   !> Impacts, in the units of `thud_shell_series` unless stated otherwise. Fastest if it lies at the beginning of a
   !> cache line, see `thud_cache_line`; interoperable, so that it may lie in a buffer.
   type, bind(c) :: impact_batch_type
      !> Series of the equations.
      type(series_batch_type) :: series
      !> Velocity at first touch: [batch_size].
      real(wp) :: impact_velocity(batch_size)
      !> The present state and the state at the end of the current step. After the impact the first is the state at release.
      type(state_batch_type) :: state, next
      !> Ones, the length of whole steps: [batch_size].
      real(wp) :: whole_step(batch_size)
      !> Maximum deflection: [batch_size].
      real(wp) :: max_deflection(batch_size)
      !> Maximum elastic force, at samples and turning point, N: [batch_size].
      real(wp) :: peak_elastic_force(batch_size)
      !> Maximum force on the floor, at the same instants, N: [batch_size].
      real(wp) :: peak_force(batch_size)
      !> Steps from first touch to release; NaN for a ball without release: [batch_size].
      real(wp) :: contact_steps(batch_size)
      type(shell_batch_type) :: shell
      !> Factor s of the flux term in restitution.
      real(wp) :: restitution_weight
   end type impact_batch_type

contains

   !> Impacts from first touch to release, and the forces.
   subroutine solve_impacts(impacts, n_sample, substeps, force, n_written)
      !> The impacts; velocity at first touch, equation and factors of the flux are set.
      type(impact_batch_type), intent(inout) :: impacts
      !> Number of samples of the record; steps per sampling interval.
      integer, intent(in) :: n_sample, substeps
      !> Elastic forces, then floor forces, N; the first `n_written` samples are set: [2*batch_size, n_sample].
      real(wp), intent(inout) :: force(2*batch_size, n_sample)
      !> Number of samples up to the latest release.
      integer, intent(out) :: n_written
      real(wp), dimension(batch_size) :: first_step, end_step, length
      logical :: turns(batch_size)
      integer :: last_step

      last_step = 0
      impacts%state%deflection = 0.0_wp
      impacts%state%velocity = impacts%impact_velocity
      impacts%whole_step = 1.0_wp
      impacts%series%expansion_point = 0.0_wp
      impacts%series%pressure = impacts%shell%gas_pressure
      first_step = 0.0_wp
      call march(impacts, .true., first_step, end_step, n_sample, substeps, force, last_step)
      turns = end_step < never
      call find_end(impacts, .true., turns, length)
      impacts%state%velocity = 0.0_wp
      impacts%max_deflection = impacts%state%deflection
      impacts%shell%weight = impacts%restitution_weight
      ! The rest of the step in which a ball turns; the forces at its beginning are those at the turning point.
      call advance(impacts, turns, 1 - length, impacts%peak_elastic_force, impacts%peak_force)
      impacts%state = impacts%next
      first_step = merge(end_step + 1, never, turns)
      call march(impacts, .false., first_step, end_step, n_sample, substeps, force, last_step)
      call find_end(impacts, .false., end_step < never, length)
      impacts%contact_steps = merge(end_step + length, not_a_number, end_step < never)
      n_written = last_step/substeps + 1
      call update_peaks(force(:, :n_written), impacts%peak_elastic_force, impacts%peak_force)
      ! A component may jump at first touch: the first sample is the mean of both sides.
      force(:, 1) = force(:, 1)/2
   end subroutine solve_impacts

   !> Integrates in time until every ball has reached the end of the phase, failed, or reached the end of the record.
   subroutine march(impacts, compressing, first_step, end_step, n_sample, substeps, force, last_step)
      type(impact_batch_type), intent(inout) :: impacts
      !> Whether the phase is compression, which ends at zero velocity.
      logical, intent(in) :: compressing
      !> First step of each ball; `never` for balls that have failed: [batch_size].
      real(wp), intent(inout) :: first_step(batch_size)
      !> Step in which the phase of each ball ends; `never` if it does not: [batch_size].
      real(wp), intent(out) :: end_step(batch_size)
      !> Number of samples; steps per sampling interval.
      integer, intent(in) :: n_sample, substeps
      !> Forces, N: [2*batch_size, n_sample].
      real(wp), intent(inout) :: force(2*batch_size, n_sample)
      !> Last step of any ball; unchanged if no ball took one.
      integer, intent(inout) :: last_step
      real(wp), dimension(batch_size) :: elastic_force, floor_force
      real(wp) :: latest_start
      integer :: n, sample
      logical :: moving(batch_size)
      logical :: all_moving

      all_moving = .false.
      latest_start = maxval(first_step, mask=first_step < never)
      end_step = never
      do n = int(min(minval(first_step), real(n_sample - 1, wp)*substeps)), (n_sample - 1)*substeps - 1
         if (n <= latest_start .or. mod(n, series_steps) == 0) call renew_series(impacts, first_step, n)
         if (.not. all_moving) moving = n >= first_step .and. end_step >= never
         sample = n/substeps + 1
         if (all_moving .and. mod(n, substeps) == 0) then
            call advance(impacts, moving, impacts%whole_step, force(:batch_size, sample), force(batch_size + 1:, sample))
         else
            call advance(impacts, moving, impacts%whole_step, elastic_force, floor_force)
            ! No force after the end of a phase; before its beginning, the forces of the previous phase remain.
            if (mod(n, substeps) == 0) then
               where ([first_step, first_step] <= n) force(:, sample) = merge([elastic_force, floor_force], 0.0_wp, &
                  [end_step, end_step] >= n)
            end if
         end if
         last_step = n
         if (n == nint(latest_start)) all_moving = all(first_step < never .and. end_step >= never)
         if (all_moving) all_moving = all_positive(get_watched(impacts%next, compressing))
         if (all_moving) then
            impacts%state = impacts%next
         else
            call commit_step(impacts, compressing, moving, real(n, wp), first_step, end_step)
            if (all(first_step >= never .or. end_step < never)) exit
         end if
         if (mod(n, series_steps) == 0 .and. is_interrupted()) exit
      end do
   end subroutine march

   !> Takes a whole or shortened step from the present state, if need be with new series.
   subroutine advance(impacts, active, length, elastic_force, floor_force)
      !> The impacts; `next` is set, NaN where a stage is out of reach.
      type(impact_batch_type), intent(inout) :: impacts
      !> Whether the result for the ball is needed: [batch_size].
      logical, intent(in) :: active(batch_size)
      !> Length of the step: [batch_size].
      real(wp), intent(in) :: length(batch_size)
      !> Elastic force and force on the floor at the beginning, N: [batch_size].
      real(wp), intent(out) :: elastic_force(batch_size), floor_force(batch_size)
      logical :: missed(batch_size)

      call take_step(impacts%shell, impacts%series, impacts%state, length, impacts%next, elastic_force, floor_force)
      if (all_positive(1 + 0*impacts%next%velocity)) return
      missed = active .and. .not. abs(impacts%next%velocity) <= huge(1.0_wp)
      if (.not. any(missed)) return
      call expand_series(impacts%shell, impacts%state, missed, impacts%series)
      call take_step(impacts%shell, impacts%series, impacts%state, length, impacts%next, elastic_force, floor_force)
   end subroutine advance

   !> Expands a new series for balls that begin, and at fixed steps also for balls whose series will not last until the next
   !> of these steps. The condition for a ball does not depend on other balls.
   pure subroutine renew_series(impacts, first_step, n)
      type(impact_batch_type), intent(inout) :: impacts
      real(wp), intent(in) :: first_step(batch_size)
      !> Index of the step.
      integer, intent(in) :: n
      logical :: wanted(batch_size)

      wanted = abs(first_step - n) < 0.5_wp
      associate (y => impacts%state%deflection, z => impacts%state%velocity, series => impacts%series)
         if (mod(n, series_steps) == 0) wanted = wanted .or. .not. max(abs(y - series%expansion_point), &
            abs(y + series_steps*z - series%expansion_point)) <= inner*series%reach
      end associate
      if (any(wanted)) call expand_series(impacts%shell, impacts%state, wanted, impacts%series)
   end subroutine renew_series

   !> Accepts the step of each ball that stays inside the phase; the other balls stop at the beginning of the step.
   pure subroutine commit_step(impacts, compressing, moving, n, first_step, end_step)
      type(impact_batch_type), intent(inout) :: impacts
      logical, intent(in) :: compressing
      !> Whether the ball takes the step: [batch_size].
      logical, intent(in) :: moving(batch_size)
      !> Index of the step.
      real(wp), intent(in) :: n
      !> First step of each ball; becomes `never` for balls that fail: [batch_size].
      real(wp), intent(inout) :: first_step(batch_size)
      !> Step in which the phase ends: [batch_size].
      real(wp), intent(inout) :: end_step(batch_size)
      real(wp) :: watched(batch_size)

      watched = get_watched(impacts%next, compressing)
      where (moving .and. watched > 0.0_wp)
         impacts%state%deflection = impacts%next%deflection
         impacts%state%velocity = impacts%next%velocity
      else where (moving .and. watched <= 0.0_wp)
         end_step = n
      else where (moving)
         first_step = never
      end where
   end subroutine commit_step

   !> Moves balls to the end of their phase in the present step, which the secant method locates to rounding.
   subroutine find_end(impacts, compressing, ends, length)
      type(impact_batch_type), intent(inout) :: impacts
      !> Whether the phase is compression, which ends at zero velocity.
      logical, intent(in) :: compressing
      !> Whether the phase of the ball ends in this step; other balls do not move: [batch_size].
      logical, intent(in) :: ends(batch_size)
      !> Fraction of the step at the end of the phase: [batch_size].
      real(wp), intent(out) :: length(batch_size)
      real(wp), dimension(batch_size) :: before, value, value_before, change, elastic_force, floor_force
      logical :: searching(batch_size)
      integer :: trial

      before = 0.0_wp
      length = 1.0_wp
      value_before = get_watched(impacts%state, compressing)
      searching = ends
      do trial = 1, max_trials
         call advance(impacts, ends, length, elastic_force, floor_force)
         value = get_watched(impacts%next, compressing)
         change = value*(length - before)/(value_before - value)
         ! Balls at their end stay there, so that their bits do not depend on others. Equal values give no better estimate.
         searching = searching .and. abs(change) > 2*epsilon(1.0_wp)*length .and. abs(change) <= huge(1.0_wp)
         if (.not. any(searching)) exit
         where (searching)
            before = length
            value_before = value
            length = min(1.0_wp, max(0.0_wp, length + change))
         end where
      end do
      where (ends)
         impacts%state%deflection = impacts%next%deflection
         impacts%state%velocity = impacts%next%velocity
      end where
   end subroutine find_end

   !> Quantity that is zero at the end of the phase, and NaN out of reach: velocity or deflection: [batch_size].
   pure function get_watched(state, compressing) result(watched)
      type(state_batch_type), intent(in) :: state
      !> Whether the phase is compression.
      logical, intent(in) :: compressing
      real(wp) :: watched(batch_size)

      watched = state%deflection
      if (compressing) watched = state%velocity
   end function get_watched

   !> Whether all values are positive numbers.
   pure function all_positive(value) result(yes)
      real(wp), intent(in) :: value(batch_size)
      logical :: yes
      real(wp) :: n_other
      integer :: i

      ! Compilers vectorize sums, not logical operations.
      n_other = 0.0_wp
      !$omp simd reduction(+: n_other)
      do i = 1, batch_size
         n_other = n_other + merge(0.0_wp, 1.0_wp, value(i) > 0.0_wp)
      end do
      yes = n_other <= 0.0_wp
   end function all_positive

   !> Updates the maxima by the forces of all samples; before, they are the forces at the turning point.
   pure subroutine update_peaks(force, peak_elastic_force, peak_force)
      !> Elastic forces, then floor forces, N: [2*batch_size, n_sample].
      real(wp), intent(in) :: force(:, :)
      !> Maximum elastic force, N: [batch_size].
      real(wp), intent(inout) :: peak_elastic_force(batch_size)
      !> Maximum force on the floor, N: [batch_size].
      real(wp), intent(inout) :: peak_force(batch_size)
      integer :: i, n

      do n = 1, size(force, 2)
         !$omp simd
         do i = 1, batch_size
            peak_elastic_force(i) = max(peak_elastic_force(i), force(i, n))
            peak_force(i) = max(peak_force(i), force(batch_size + i, n))
         end do
      end do
   end subroutine update_peaks

end module thud_shell_impacts
