!> Impacts of a batch of balls: the same time integration as in `thud_lumped`. The steps are the same, and the ends of
!> compression (the turning point) and of restitution (the release) are located within a step.
!>
!> All balls take their steps in parallel, so that sample i of all forces is written together. A ball that has reached its
!> turning point waits until all others have reached theirs or collapsed; then the turning points are located together, and
!> each ball continues at its own time.
module thud_shell_impacts
   use thud_impact_batch, only: add_end, advance, finish_step, get_watched, impact_batch_type, is_finite, locate
   use thud_interrupt, only: is_interrupted
   use thud_kinds, only: wp
   use thud_shell_batch, only: batch_size, state_batch_type
   use thud_shell_series, only: expand_series, series_steps, will_last
   implicit none (type, external)
   private

   public :: solve_impacts

   !> Step that never comes.
   real(wp), parameter :: never = huge(1.0_wp)

contains

   !> Impacts from first touch to release, and the forces.
   subroutine solve_impacts(impacts, n_sample, substeps, force, n_written)
      type(impact_batch_type), intent(inout) :: impacts
      !> Number of samples of the record; steps per sampling interval.
      integer, intent(in) :: n_sample, substeps
      !> Elastic forces, then floor forces, N; the first `n_written` samples are set: [2*batch_size, n_sample].
      real(wp), intent(inout) :: force(2*batch_size, n_sample)
      !> Number of samples up to the latest release.
      integer, intent(out) :: n_written
      real(wp), dimension(batch_size) :: first_step, end_step, length, elastic_force, floor_force
      logical :: turning(batch_size), released(batch_size)
      integer :: n_step, last_step

      n_step = (n_sample - 1)*substeps
      last_step = 0
      impacts%now = 1
      impacts%states(1)%deflection = 0.0_wp
      impacts%states(1)%velocity = impacts%impact_velocity
      impacts%states(1)%impulse = 0.0_wp
      impacts%states(1)%loss = 0.0_wp
      impacts%out_of_domain = .false.
      impacts%whole_step = 1.0_wp

      first_step = 0.0_wp
      call march(impacts, .true., first_step, end_step, n_step, substeps, n_sample, force, last_step)
      turning = end_step < never .and. .not. impacts%out_of_domain
      call pass_turning_point(impacts, turning)
      first_step = merge(end_step + 1, never, turning)
      call march(impacts, .false., first_step, end_step, n_step, substeps, n_sample, force, last_step)
      released = end_step < never .and. .not. impacts%out_of_domain
      impacts%released = released
      call locate(impacts, .false., released, length)
      call finish_step(impacts, released, length, elastic_force, floor_force)
      impacts%contact_steps = end_step + length
      n_written = last_step/substeps + 1
      call get_peaks(force(:, :n_written), impacts%peak_elastic_force, impacts%peak_force)
      ! A component may jump at first touch: the first sample is the mean of both sides.
      force(:, 1) = force(:, 1)/2
   end subroutine solve_impacts

   !> Integrates in time until every ball has reached the end of the phase or of the record.
   subroutine march(impacts, compressing, first_step, end_step, n_step, substeps, n_sample, force, last_step)
      type(impact_batch_type), intent(inout) :: impacts
      !> Whether the phase is compression, which ends at zero velocity.
      logical, intent(in) :: compressing
      !> First step of each ball: [batch_size].
      real(wp), intent(in) :: first_step(batch_size)
      !> Step in which the phase of each ball ends or the ball fails; `never` if neither: [batch_size].
      real(wp), intent(out) :: end_step(batch_size)
      !> Number of steps of the record; steps per sampling interval; number of samples.
      integer, intent(in) :: n_step, substeps, n_sample
      !> Forces, N: [2*batch_size, n_sample].
      real(wp), intent(inout) :: force(2*batch_size, n_sample)
      !> Last step of any ball; unchanged if no ball took one.
      integer, intent(inout) :: last_step
      real(wp), dimension(batch_size) :: elastic_force, floor_force
      real(wp) :: latest_start
      integer :: n, begin, sample
      logical :: done, all_moving, any_out_of_range
      logical :: active(batch_size)

      all_moving = .false.
      any_out_of_range = .false.
      impacts%out_of_range = .false.
      ! Balls with first_step = never take no part in this phase.
      latest_start = maxval(first_step, mask=first_step < never)
      end_step = merge(never, -1.0_wp, first_step < never)
      begin = int(min(minval(first_step), real(n_step, wp)))
      call expand_series(impacts%shell, impacts%states(impacts%now), first_step < never, impacts%series)
      call add_end(impacts, first_step < never, -0.5_wp*impacts%whole_step, impacts%whole_step/12)
      do n = begin, n_step - 1
         if (n <= latest_start .or. mod(n, series_steps) == 0 .or. any_out_of_range) then
            call renew_series(impacts, first_step, n)
         end if
         if (.not. all_moving) active = first_step <= n .and. end_step > n
         sample = n/substeps + 1
         if (all_moving .and. mod(n, substeps) == 0) then
            call advance(impacts, active, impacts%whole_step, force(:batch_size, sample), force(batch_size + 1:, sample), &
               any_out_of_range)
         else
            call advance(impacts, active, impacts%whole_step, elastic_force, floor_force, any_out_of_range)
            if (mod(n, substeps) == 0) call record(elastic_force, floor_force, real(n, wp), first_step, end_step, &
               force(:, sample))
         end if
         if (n == nint(latest_start)) all_moving = all(first_step < never .and. end_step >= never)
         call commit_step(impacts, compressing, real(n, wp), first_step, end_step, all_moving, done)
         last_step = n
         if (mod(n, series_steps) == 0) done = done .or. is_interrupted()
         if (done) exit
      end do
      call expand_series(impacts%shell, impacts%states(impacts%now), first_step < never, impacts%series)
      call add_end(impacts, first_step < never, 0.5_wp*impacts%whole_step, -impacts%whole_step/12)
      where (.not. first_step < never) end_step = never
   end subroutine march

   !> Expands a new series for balls that begin or went out of range, and at fixed steps also for balls whose series will not
   !> last until the next of these steps. The condition for a ball does not depend on other balls.
   pure subroutine renew_series(impacts, first_step, n)
      type(impact_batch_type), intent(inout) :: impacts
      real(wp), intent(in) :: first_step(batch_size)
      !> Index of the step.
      integer, intent(in) :: n
      logical :: wanted(batch_size)

      wanted = abs(first_step - n) < 0.5_wp .or. impacts%out_of_range
      associate (state => impacts%states(impacts%now), series => impacts%series)
         if (mod(n, series_steps) == 0) wanted = wanted &
            .or. .not. will_last(series%expansion_point, series%reach, state%deflection, state%velocity)
         if (any(wanted)) call expand_series(impacts%shell, state, wanted, series)
      end associate
      impacts%out_of_range = .false.
   end subroutine renew_series

   !> Writes the forces of one sample. They are zero for balls whose phase has ended. For balls whose phase has not begun,
   !> the forces of the previous phase remain.
   pure subroutine record(elastic_force, floor_force, n, first_step, end_step, force)
      !> Elastic forces, N: [batch_size].
      real(wp), intent(in) :: elastic_force(batch_size)
      !> Forces on the floor, N: [batch_size].
      real(wp), intent(in) :: floor_force(batch_size)
      !> Index of the step.
      real(wp), intent(in) :: n
      real(wp), intent(in) :: first_step(batch_size)
      !> Step in which the phase has ended: [batch_size].
      real(wp), intent(in) :: end_step(batch_size)
      !> The sample, N: [2*batch_size].
      real(wp), intent(inout) :: force(2*batch_size)

      where ([first_step, first_step] <= n) force = merge([elastic_force, floor_force], 0.0_wp, [end_step, end_step] >= n)
   end subroutine record

   !> Accepts the step of each ball that stays inside the phase; the other balls stop at the beginning of the step.
   pure subroutine commit_step(impacts, compressing, n, first_step, end_step, all_moving, done)
      type(impact_batch_type), intent(inout) :: impacts
      logical, intent(in) :: compressing
      real(wp), intent(in) :: n
      real(wp), intent(in) :: first_step(batch_size)
      !> Step in which the phase ends: [batch_size].
      real(wp), intent(inout) :: end_step(batch_size)
      !> Whether all balls are moving; false from the first stop on.
      logical, intent(inout) :: all_moving
      !> Whether all balls have stopped.
      logical, intent(out) :: done
      logical, dimension(batch_size) :: moving, continues

      associate (state => impacts%states(impacts%now), next => impacts%states(3 - impacts%now))
         done = .false.
         if (all_moving) all_moving = all_stay(next, compressing)
         if (.not. all_moving) then
            moving = n >= first_step .and. n < end_step
            continues = moving .and. is_finite(next%velocity) .and. get_watched(next, compressing) > 0.0_wp
            impacts%out_of_domain = impacts%out_of_domain .or. (moving .and. .not. is_finite(next%velocity))
            where (moving .and. .not. continues) end_step = n
            where (.not. continues)
               next%deflection = state%deflection
               next%velocity = state%velocity
               next%impulse = state%impulse
               next%loss = state%loss
            end where
            done = .not. any(end_step > n)
         end if
      end associate
      impacts%now = 3 - impacts%now
   end subroutine commit_step

   !> Whether all balls stay inside the phase.
   pure function all_stay(state, compressing) result(all_continue)
      type(state_batch_type), intent(in) :: state
      logical, intent(in) :: compressing
      logical :: all_continue
      real(wp) :: ended
      integer :: i

      ! Compilers vectorize sums, not logical operations. If a stage has left the domain, velocity and sum are NaN.
      ended = 0.0_wp
      if (compressing) then
         !$omp simd reduction(+: ended)
         do i = 1, batch_size
            ended = ended + merge(0.0_wp, 1.0_wp, state%velocity(i) > 0.0_wp)
         end do
      else
         !$omp simd reduction(+: ended)
         do i = 1, batch_size
            ended = ended + merge(0.0_wp, 1.0_wp, state%deflection(i) > 0.0_wp) + 0*state%velocity(i)
         end do
      end if
      all_continue = ended <= 0.0_wp
   end function all_stay

   !> Continues to the turning point and, with the flux term of restitution, to the end of the same step.
   subroutine pass_turning_point(impacts, turning)
      type(impact_batch_type), intent(inout) :: impacts
      !> Whether the ball has a turning point: [batch_size].
      logical, intent(in) :: turning(batch_size)
      real(wp), dimension(batch_size) :: length, elastic_force, floor_force

      call locate(impacts, .true., turning, length)
      call finish_step(impacts, turning, length, elastic_force, floor_force)
      where (turning) impacts%states(impacts%now)%velocity = 0.0_wp
      impacts%shell%weight = impacts%restitution_weight
      impacts%max_deflection = impacts%states(impacts%now)%deflection
      call finish_step(impacts, turning, 1 - length, elastic_force, floor_force)
      ! Forces at the turning point.
      impacts%peak_elastic_force = elastic_force
      impacts%peak_force = floor_force
   end subroutine pass_turning_point

   !> Updates the maxima by the forces of all samples; before, they are the forces at the turning point.
   pure subroutine get_peaks(force, peak_elastic_force, peak_force)
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
   end subroutine get_peaks

end module thud_shell_impacts
