!> Impacts of many balls side by side: the march of `thud_lumped`, with the same steps and the same
!> change of phase at the turning point and at release, located on the step itself.
!>
!> Lanes run in step, so that sample i of all forces is written at once. A lane that has come to its
!> turning point waits until all others have, or closed; then the turning points are located
!> together, and each lane goes on at its own time.
module thud_shell_impacts
   use thud_impact_lanes, only: finish_step, impact_lanes_type, locate
   use thud_kinds, only: wp
   use thud_power, only: not_a_number
   use thud_shell_lanes, only: get_forces, get_pressures, lane_count, set_anchors, take_step
   implicit none (type, external)
   private

   public :: solve_impacts

   !> Steps after which anchors are moved in any case. At the default step a ball from 1 m changes its
   !> volume by 2e-3 in as many, so that the series mostly holds between; see `thud_shell_lanes`.
   integer, parameter :: anchor_interval = 8

   !> A step that never comes.
   real(wp), parameter :: never = huge(1.0_wp)

contains

   !> Impacts from first touch to release, and their forces.
   subroutine solve_impacts(impacts, n_sample, substeps, force, last_sample)
      !> The impacts.
      type(impact_lanes_type), intent(inout) :: impacts
      !> Samples of the record.
      integer, intent(in) :: n_sample
      !> Steps per sampling interval.
      integer, intent(in) :: substeps
      !> Elastic forces, then floor forces, N, up to the last contact: [2 lane_count, n_sample].
      real(wp), intent(inout) :: force(2*lane_count, n_sample)
      !> Number of the last sample that was written.
      integer, intent(out) :: last_sample
      real(wp), dimension(lane_count) :: start, last, length
      integer :: n_step, last_step

      n_step = (n_sample - 1)*substeps
      last_step = 0
      impacts%state%deflection = 0.0_wp
      impacts%state%velocity = impacts%impact_velocity
      impacts%state%impulse = 0.0_wp
      impacts%state%loss = 0.0_wp
      impacts%peak_force = 0.0_wp
      impacts%peak_floor_force = 0.0_wp
      impacts%left = .false.
      impacts%anchor%inverse = 1.0_wp
      impacts%anchor%pressure = impacts%shell%gas_pressure
      impacts%shell%weight = impacts%compression_weight

      start = 0.0_wp
      call march(impacts, .true., start, last, n_step, substeps, n_sample, force, last_step)
      call locate(impacts, .true., last < never .and. .not. impacts%left, length)
      start = merge(last + 1, never, last < never .and. .not. impacts%left)
      call turn(impacts, start < never, length)
      call march(impacts, .false., start, last, n_step, substeps, n_sample, force, last_step)
      impacts%released = last < never .and. .not. impacts%left
      call locate(impacts, .false., impacts%released, length)
      call finish_step(impacts, impacts%released, length)
      impacts%contact = last + length
      last_sample = last_step/substeps + 1
      impacts%peak_floor_force = max(impacts%peak_force, impacts%peak_floor_force)
      ! A part that sets in with a jump at first touch: a sample of a jump is the mean of its two sides.
      force(:, 1) = force(:, 1)/2
   end subroutine solve_impacts

   !> Marches until every lane has come to the end of its phase, or to that of the record.
   subroutine march(impacts, compressing, start, last, n_step, substeps, n_sample, force, last_step)
      !> The impacts.
      type(impact_lanes_type), intent(inout) :: impacts
      !> The phase ends with the velocity, not with the deflection.
      logical, intent(in) :: compressing
      !> Step with which each lane begins: [lane_count].
      real(wp), intent(in) :: start(lane_count)
      !> Step in which its phase ends, or in which it fails; `never` if neither: [lane_count].
      real(wp), intent(out) :: last(lane_count)
      !> Steps of the record.
      integer, intent(in) :: n_step
      !> Steps per sampling interval.
      integer, intent(in) :: substeps
      !> Samples of the record.
      integer, intent(in) :: n_sample
      !> Forces, N: [2 lane_count, n_sample].
      real(wp), intent(inout) :: force(2*lane_count, n_sample)
      !> Last step of any lane; unchanged where none began.
      integer, intent(inout) :: last_step
      real(wp) :: latest
      integer :: n, first
      logical :: done, undisturbed

      undisturbed = .false.
      impacts%length = 1.0_wp
      latest = maxval(start, mask=start < never)
      last = merge(never, -1.0_wp, start < never)
      first = int(min(minval(start), real(n_step, wp)))
      do n = first, n_step - 1
         call get_pressures(impacts%shell, impacts%state%deflection, impacts%anchor, impacts%pressure)
         ! A lane has new anchors where it begins and at fixed times: nothing that depends on others.
         if (n <= latest .or. mod(n, anchor_interval) == 0) then
            where (abs(start - n) < 0.5_wp .or. mod(n, anchor_interval) == 0) impacts%pressure = not_a_number
            call set_anchors(impacts%shell, impacts%state%deflection, impacts%pressure, impacts%anchor)
         end if
         if (mod(n, substeps) == 0) call record(impacts, real(n, wp), start, last, force(:, n/substeps + 1))
         call take_step(impacts%shell, impacts%state, impacts%length, impacts%pressure, impacts%anchor, impacts%next)
         if (n == nint(latest)) undisturbed = all(start < never .and. last >= never)
         if (compressing) then
            call settle(impacts, impacts%next%velocity, real(n, wp), start, last, undisturbed, done)
         else
            call settle(impacts, impacts%next%deflection, real(n, wp), start, last, undisturbed, done)
         end if
         last_step = n
         if (done) exit
      end do
      where (.not. start < never) last = never
   end subroutine march

   !> Forces of one sample: those of moving lanes, none after the contact; lanes whose turn is still to
   !> come keep what they have.
   pure subroutine record(impacts, n, start, last, force)
      !> The impacts.
      type(impact_lanes_type), intent(inout) :: impacts
      !> Number of the step.
      real(wp), intent(in) :: n
      !> Step with which each lane begins: [lane_count].
      real(wp), intent(in) :: start(lane_count)
      !> Step in which it has ended: [lane_count].
      real(wp), intent(in) :: last(lane_count)
      !> The sample, N: [2 lane_count].
      real(wp), intent(inout) :: force(2*lane_count)
      integer :: i

      call get_forces(impacts%shell, impacts%state, impacts%pressure, impacts%force_unit, impacts%elastic_force, &
         impacts%floor_force)
      !$omp simd
      do i = 1, lane_count
         associate (elastic => impacts%elastic_force, whole => impacts%floor_force)
            if (n > last(i)) then
               elastic(i) = 0.0_wp
               whole(i) = 0.0_wp
            end if
            if (n < start(i)) then
               elastic(i) = force(i)
               whole(i) = force(lane_count + i)
            end if
            force(i) = elastic(i)
            force(lane_count + i) = whole(i)
            impacts%peak_force(i) = max(impacts%peak_force(i), elastic(i))
            impacts%peak_floor_force(i) = max(impacts%peak_floor_force(i), whole(i))
         end associate
      end do
   end subroutine record

   !> Takes over a step where it stays inside the phase; other lanes stop in front of it.
   pure subroutine settle(impacts, watched, n, start, last, undisturbed, done)
      !> The impacts.
      type(impact_lanes_type), intent(inout) :: impacts
      !> What the end of the phase brings to zero: [lane_count].
      real(wp), intent(in) :: watched(lane_count)
      !> Number of the step.
      real(wp), intent(in) :: n
      !> Step with which each lane begins: [lane_count].
      real(wp), intent(in) :: start(lane_count)
      !> Step in which it ends: [lane_count].
      real(wp), intent(inout) :: last(lane_count)
      !> All lanes are under way; false from the first that stops on.
      logical, intent(inout) :: undisturbed
      !> All lanes have stopped.
      logical, intent(out) :: done
      real(wp) :: on, finite, stays, moving, lost
      integer :: i

      done = .false.
      if (undisturbed) then
         ! Nothing but zeros while every lane stays inside.
         lost = 0.0_wp
         !$omp simd private(finite) reduction(+: lost)
         do i = 1, lane_count
            finite = merge(0.0_wp, 1.0_wp, abs(impacts%next%velocity(i)) <= huge(1.0_wp))
            lost = lost + finite + merge(0.0_wp, 1.0_wp, watched(i) > 0.0_wp)
         end do
         if (.not. lost > 0.0_wp) then
            !$omp simd
            do i = 1, lane_count
               impacts%state%deflection(i) = impacts%next%deflection(i)
               impacts%state%velocity(i) = impacts%next%velocity(i)
               impacts%state%impulse(i) = impacts%next%impulse(i)
               impacts%state%loss(i) = impacts%next%loss(i)
            end do
            return
         end if
      end if
      undisturbed = .false.
      moving = 0.0_wp
      lost = 0.0_wp
      ! Products of ones and zeros, because compilers do not vectorise conditions joined by `.and.`.
      !$omp simd private(on, finite, stays) reduction(max: moving, lost)
      do i = 1, lane_count
         on = merge(1.0_wp, 0.0_wp, n >= start(i))*merge(1.0_wp, 0.0_wp, n < last(i))
         finite = merge(1.0_wp, 0.0_wp, abs(impacts%next%velocity(i)) <= huge(1.0_wp))
         stays = on*finite*merge(1.0_wp, 0.0_wp, watched(i) > 0.0_wp)
         if (stays > 0.0_wp) then
            impacts%state%deflection(i) = impacts%next%deflection(i)
            impacts%state%velocity(i) = impacts%next%velocity(i)
            impacts%state%impulse(i) = impacts%next%impulse(i)
            impacts%state%loss(i) = impacts%next%loss(i)
         end if
         if (on > stays) last(i) = n
         moving = max(moving, merge(1.0_wp, 0.0_wp, last(i) > n))
         lost = max(lost, on*(1 - finite))
      end do
      done = .not. moving > 0.0_wp
      if (lost > 0.0_wp) impacts%left = impacts%left &
         .or. (abs(last - n) < 0.5_wp .and. .not. abs(impacts%next%velocity) <= huge(1.0_wp))
   end subroutine settle

   !> From the turning point to the end of its step, with the flux term of restitution.
   subroutine turn(impacts, turns, length)
      !> The impacts.
      type(impact_lanes_type), intent(inout) :: impacts
      !> The lane has a turning point: [lane_count].
      logical, intent(in) :: turns(lane_count)
      !> Part of the step before the turning point: [lane_count].
      real(wp), intent(in) :: length(lane_count)

      call finish_step(impacts, turns, length)
      where (turns) impacts%state%velocity = 0.0_wp
      impacts%max_deflection = impacts%state%deflection
      impacts%pressure = not_a_number
      call set_anchors(impacts%shell, impacts%state%deflection, impacts%pressure, impacts%anchor)
      call get_forces(impacts%shell, impacts%state, impacts%pressure, impacts%force_unit, impacts%elastic_force, &
         impacts%floor_force)
      where (turns)
         impacts%peak_force = max(impacts%peak_force, impacts%elastic_force)
         impacts%shell%weight = impacts%restitution_weight
      end where
      call finish_step(impacts, turns, 1 - length)
   end subroutine turn

end module thud_shell_impacts
