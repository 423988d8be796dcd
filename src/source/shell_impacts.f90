!> Impacts of many balls side by side: the march of `thud_lumped`, with the same steps and the same
!> change of phase at the turning point and at release, located on the step itself.
!>
!> Lanes run in step, so that sample i of all forces is written at once. A lane that has come to its
!> turning point waits until all others have, or closed; then the turning points are located
!> together, and each lane goes on at its own time.
module thud_shell_impacts
   use thud_kinds, only: wp
   use thud_power, only: not_a_number
   use thud_shell_lanes, only: anchor_lanes_type, get_elastic_force, get_pressures, lane_count, set_anchors, &
      shell_lanes_type, state_lanes_type, take_step
   implicit none (type, external)
   private

   public :: impact_lanes_type, solve_impacts

   !> Steps after which anchors are moved in any case. At the default step a ball from 1 m changes its
   !> volume by 2e-3 in as many, so that the series mostly holds between; see `thud_shell_lanes`.
   integer, parameter :: anchor_interval = 8

   !> Impacts, in the units of `thud_shell_lanes` unless said otherwise.
   type :: impact_lanes_type
      !> The equations.
      type(shell_lanes_type) :: shell
      !> Factor of the flux term in compression: [lane_count].
      real(wp) :: compression_weight(lane_count)
      !> Factor of the flux term in restitution: [lane_count].
      real(wp) :: restitution_weight(lane_count)
      !> Velocity at first touch: [lane_count].
      real(wp) :: impact_velocity(lane_count)
      !> Unit of the forces, 2 R M/h**2, N: [lane_count].
      real(wp) :: force_unit(lane_count)
      !> State at release; where a lane did not get there, at the beginning of its last step.
      type(state_lanes_type) :: state
      !> Largest deflection: [lane_count].
      real(wp) :: max_deflection(lane_count)
      !> Largest elastic force, at samples and turning point, N: [lane_count].
      real(wp) :: peak_force(lane_count)
      !> Largest force on the floor, likewise, N: [lane_count].
      real(wp) :: peak_floor_force(lane_count)
      !> Steps from first touch to release: [lane_count].
      real(wp) :: contact(lane_count)
      !> The ball was released: [lane_count].
      logical :: released(lane_count)
      !> A stage has left the domain of the equation: [lane_count].
      logical :: left(lane_count)
   end type impact_lanes_type

   !> A step that never comes.
   real(wp), parameter :: never = huge(1.0_wp)

contains

   !> Impacts from first touch to release, and their forces.
   subroutine solve_impacts(impacts, n_sample, substeps, force)
      !> The impacts.
      type(impact_lanes_type), intent(inout) :: impacts
      !> Samples of the record.
      integer, intent(in) :: n_sample
      !> Steps per sampling interval.
      integer, intent(in) :: substeps
      !> Elastic forces, then floor forces, N, up to the last contact: [2 lane_count, n_sample].
      real(wp), intent(inout) :: force(2*lane_count, n_sample)
      real(wp), dimension(lane_count) :: start, last, length
      type(anchor_lanes_type) :: anchor
      integer :: n_step

      n_step = (n_sample - 1)*substeps
      impacts%state%deflection = 0.0_wp
      impacts%state%velocity = impacts%impact_velocity
      impacts%state%impulse = 0.0_wp
      impacts%state%loss = 0.0_wp
      impacts%peak_force = 0.0_wp
      impacts%peak_floor_force = 0.0_wp
      impacts%left = .false.
      anchor%inverse = 1.0_wp
      anchor%pressure = impacts%shell%gas_pressure
      impacts%shell%weight = impacts%compression_weight

      start = 0.0_wp
      call march(impacts, anchor, .true., start, last, n_step, substeps, force)
      call locate(impacts, anchor, .true., last < never .and. .not. impacts%left, length)
      start = merge(last + 1, never, last < never .and. .not. impacts%left)
      call turn(impacts, anchor, start < never, length)
      call march(impacts, anchor, .false., start, last, n_step, substeps, force)
      impacts%released = last < never .and. .not. impacts%left
      call locate(impacts, anchor, .false., impacts%released, length)
      call finish_step(impacts, anchor, impacts%released, length)
      impacts%contact = last + length
      impacts%peak_floor_force = max(impacts%peak_force, impacts%peak_floor_force)
      ! A part that sets in with a jump at first touch: a sample of a jump is the mean of its two sides.
      force(:, 1) = force(:, 1)/2
   end subroutine solve_impacts

   !> Marches until every lane has come to the end of its phase, or to that of the record.
   subroutine march(impacts, anchor, compressing, start, last, n_step, substeps, force)
      !> The impacts.
      type(impact_lanes_type), intent(inout) :: impacts
      !> The anchors.
      type(anchor_lanes_type), intent(inout) :: anchor
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
      !> Forces, N: [2 lane_count, n_sample].
      real(wp), intent(inout) :: force(2*lane_count, *)
      type(state_lanes_type) :: new
      real(wp), dimension(lane_count) :: pressure, whole
      integer :: n, first
      logical :: done

      whole = 1.0_wp
      last = merge(never, -1.0_wp, start < never)
      first = int(min(minval(start), real(n_step, wp)))
      do n = first, n_step - 1
         call get_pressures(impacts%shell, impacts%state%deflection, anchor, pressure)
         ! A lane has new anchors where it begins and at fixed times: nothing that depends on others.
         if (mod(n, anchor_interval) == 0) then
            pressure = not_a_number
            call set_anchors(impacts%shell, impacts%state%deflection, pressure, anchor)
         else if (any(abs(start - n) < 0.5_wp)) then
            where (abs(start - n) < 0.5_wp) pressure = not_a_number
            call set_anchors(impacts%shell, impacts%state%deflection, pressure, anchor)
         end if
         if (mod(n, substeps) == 0) call record(impacts, pressure, real(n, wp), start, last, force(:, n/substeps + 1))
         call take_step(impacts%shell, impacts%state, whole, pressure, anchor, new)
         if (compressing) then
            call settle(impacts, new, new%velocity, real(n, wp), start, last, done)
         else
            call settle(impacts, new, new%deflection, real(n, wp), start, last, done)
         end if
         if (done) exit
      end do
      where (.not. start < never) last = never
   end subroutine march

   !> Forces of one sample: those of moving lanes, none after the contact; lanes whose turn is still to
   !> come keep what they have.
   pure subroutine record(impacts, pressure, n, start, last, force)
      !> The impacts.
      type(impact_lanes_type), intent(inout) :: impacts
      !> A x**(-gamma): [lane_count].
      real(wp), intent(in) :: pressure(lane_count)
      !> Number of the step.
      real(wp), intent(in) :: n
      !> Step with which each lane begins: [lane_count].
      real(wp), intent(in) :: start(lane_count)
      !> Step in which it has ended: [lane_count].
      real(wp), intent(in) :: last(lane_count)
      !> The sample, N: [2 lane_count].
      real(wp), intent(inout) :: force(2*lane_count)
      real(wp) :: elastic, floor_force
      integer :: i

      !$omp simd private(elastic, floor_force)
      do i = 1, lane_count
         elastic = get_elastic_force(impacts%state%deflection(i), impacts%shell%stiffness(i), &
            pressure(i) - impacts%shell%air_pressure(i))
         floor_force = elastic + (1 - impacts%shell%weight(i))*impacts%state%velocity(i)**2
         elastic = impacts%force_unit(i)*elastic
         floor_force = impacts%force_unit(i)*floor_force
         if (n > last(i)) then
            elastic = 0.0_wp
            floor_force = 0.0_wp
         end if
         if (n < start(i)) then
            elastic = force(i)
            floor_force = force(lane_count + i)
         end if
         force(i) = elastic
         force(lane_count + i) = floor_force
         impacts%peak_force(i) = max(impacts%peak_force(i), elastic)
         impacts%peak_floor_force(i) = max(impacts%peak_floor_force(i), floor_force)
      end do
   end subroutine record

   !> Takes over a step where it stays inside the phase; other lanes stop in front of it.
   pure subroutine settle(impacts, new, watched, n, start, last, done)
      !> The impacts.
      type(impact_lanes_type), intent(inout) :: impacts
      !> State at the end of the step.
      type(state_lanes_type), intent(in) :: new
      !> What the end of the phase brings to zero: [lane_count].
      real(wp), intent(in) :: watched(lane_count)
      !> Number of the step.
      real(wp), intent(in) :: n
      !> Step with which each lane begins: [lane_count].
      real(wp), intent(in) :: start(lane_count)
      !> Step in which it ends: [lane_count].
      real(wp), intent(inout) :: last(lane_count)
      !> All lanes have stopped.
      logical, intent(out) :: done
      real(wp) :: on, stays, moving, lost
      integer :: i

      moving = 0.0_wp
      lost = 0.0_wp
      !$omp simd private(on, stays) reduction(max: moving, lost)
      do i = 1, lane_count
         associate (state => impacts%state)
            on = merge(1.0_wp, 0.0_wp, n >= start(i) .and. n < last(i))
            lost = max(lost, merge(0.0_wp, on, abs(new%velocity(i)) <= huge(1.0_wp)))
            stays = merge(on, 0.0_wp, watched(i) > 0.0_wp .and. abs(new%velocity(i)) <= huge(1.0_wp))
            last(i) = merge(n, last(i), on > stays)
            if (stays > 0.0_wp) then
               state%deflection(i) = new%deflection(i)
               state%velocity(i) = new%velocity(i)
               state%impulse(i) = new%impulse(i)
               state%loss(i) = new%loss(i)
            end if
            moving = max(moving, merge(1.0_wp, 0.0_wp, last(i) > n))
         end associate
      end do
      done = .not. moving > 0.0_wp
      if (.not. lost > 0.0_wp) return
      where (abs(last - n) < 0.5_wp .and. .not. abs(new%velocity) <= huge(1.0_wp)) impacts%left = .true.
   end subroutine settle

   !> Parts of the step at whose end the phase ends, to rounding: `locate_zero` of `thud_rk4` for all
   !> lanes at once. Lanes without such an end get the whole step.
   subroutine locate(impacts, anchor, compressing, ends, length)
      !> The impacts, at the beginning of the step.
      type(impact_lanes_type), intent(in) :: impacts
      !> The anchors.
      type(anchor_lanes_type), intent(inout) :: anchor
      !> The phase ends with the velocity, not with the deflection.
      logical, intent(in) :: compressing
      !> The phase of the lane ends in this step: [lane_count].
      logical, intent(in) :: ends(lane_count)
      !> The parts: [lane_count].
      real(wp), intent(out) :: length(lane_count)
      integer, parameter :: most_iterations = 200
      real(wp), dimension(lane_count) :: pressure, left, right, left_value, right_value, value
      type(state_lanes_type) :: new
      logical, dimension(lane_count) :: open, left_moved, right_moved
      integer :: iteration

      pressure = not_a_number
      call set_anchors(impacts%shell, impacts%state%deflection, pressure, anchor)
      left = 0.0_wp
      left_value = merge(impacts%state%velocity, impacts%state%deflection, compressing)
      right = 1.0_wp
      length = 1.0_wp
      call take_step(impacts%shell, impacts%state, length, pressure, anchor, new)
      right_value = merge(new%velocity, new%deflection, compressing)
      left_moved = .false.
      right_moved = .false.
      do iteration = 1, most_iterations
         open = ends .and. right - left > 2*epsilon(1.0_wp)*right
         if (.not. any(open)) exit
         length = right - right_value*(right - left)/(right_value - left_value)
         where (mod(iteration, 8) == 0 .or. .not. (length > left .and. length < right)) length = (left + right)/2
         call take_step(impacts%shell, impacts%state, length, pressure, anchor, new)
         value = merge(new%velocity, new%deflection, compressing)
         ! An end that stays twice has its value halved, or regula falsi would creep.
         where (open .and. value > 0.0_wp)
            left = length
            left_value = value
            right_value = merge(right_value/2, right_value, left_moved)
         else where (open)
            right = length
            right_value = value
            left_value = merge(left_value/2, left_value, right_moved)
         end where
         left_moved = value > 0.0_wp
         right_moved = .not. left_moved
      end do
      length = right
   end subroutine locate

   !> From the turning point to the end of its step, with the flux term of restitution.
   subroutine turn(impacts, anchor, turns, length)
      !> The impacts.
      type(impact_lanes_type), intent(inout) :: impacts
      !> The anchors.
      type(anchor_lanes_type), intent(inout) :: anchor
      !> The lane has a turning point: [lane_count].
      logical, intent(in) :: turns(lane_count)
      !> Part of the step before the turning point: [lane_count].
      real(wp), intent(in) :: length(lane_count)
      real(wp) :: pressure(lane_count)

      call finish_step(impacts, anchor, turns, length)
      where (turns) impacts%state%velocity = 0.0_wp
      impacts%max_deflection = impacts%state%deflection
      pressure = not_a_number
      call set_anchors(impacts%shell, impacts%state%deflection, pressure, anchor)
      where (turns) impacts%peak_force = max(impacts%peak_force, impacts%force_unit &
         *get_elastic_force(impacts%state%deflection, impacts%shell%stiffness, pressure - impacts%shell%air_pressure))
      where (turns) impacts%shell%weight = impacts%restitution_weight
      call finish_step(impacts, anchor, turns, 1 - length)
   end subroutine turn

   !> Takes a part of a step in some of the lanes.
   subroutine finish_step(impacts, anchor, goes, length)
      !> The impacts.
      type(impact_lanes_type), intent(inout) :: impacts
      !> The anchors.
      type(anchor_lanes_type), intent(inout) :: anchor
      !> The lane takes the step: [lane_count].
      logical, intent(in) :: goes(lane_count)
      !> Its length: [lane_count].
      real(wp), intent(in) :: length(lane_count)
      type(state_lanes_type) :: new
      real(wp) :: pressure(lane_count)

      pressure = not_a_number
      call set_anchors(impacts%shell, impacts%state%deflection, pressure, anchor)
      call take_step(impacts%shell, impacts%state, length, pressure, anchor, new)
      where (goes)
         impacts%state%deflection = new%deflection
         impacts%state%velocity = new%velocity
         impacts%state%impulse = new%impulse
         impacts%state%loss = new%loss
      end where
   end subroutine finish_step

end module thud_shell_impacts
