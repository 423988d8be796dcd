!> Impacts of many balls side by side: their state, parts of a step, and where in a step a phase ends.
module thud_impact_lanes
   use thud_kinds, only: wp
   use thud_power, only: not_a_number
   use thud_shell_lanes, only: anchor_lanes_type, lane_count, set_anchors, shell_lanes_type, state_lanes_type, take_step
   implicit none (type, external)
   private

   public :: finish_step, impact_lanes_type, locate

   !> Impacts, in the units of `thud_shell_lanes` unless said otherwise. Fastest where it begins with a
   !> line of the cache, see `thud_aligned`.
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
      !> State at the end of the step under way.
      type(state_lanes_type) :: next
      !> Where pressures are known.
      type(anchor_lanes_type) :: anchor
      !> A x**(-gamma) at the beginning of the step: [lane_count].
      real(wp) :: pressure(lane_count)
      !> Length of the step, 1 for a whole one: [lane_count].
      real(wp) :: length(lane_count)
      !> Elastic force of the sample under way, N: [lane_count].
      real(wp) :: elastic_force(lane_count)
      !> Force on the floor of the sample under way, N: [lane_count].
      real(wp) :: floor_force(lane_count)
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

contains

   !> Parts of the step at whose end the phase ends, to rounding: `locate_zero` of `thud_rk4` for all
   !> lanes at once. Lanes without such an end get the whole step.
   subroutine locate(impacts, compressing, ends, length)
      !> The impacts, at the beginning of the step.
      type(impact_lanes_type), intent(inout) :: impacts
      !> The phase ends with the velocity, not with the deflection.
      logical, intent(in) :: compressing
      !> The phase of the lane ends in this step: [lane_count].
      logical, intent(in) :: ends(lane_count)
      !> The parts: [lane_count].
      real(wp), intent(out) :: length(lane_count)
      integer, parameter :: most_iterations = 200
      real(wp), dimension(lane_count) :: left, right, left_value, right_value, value, rounding
      logical, dimension(lane_count) :: open, left_moved, right_moved
      integer :: iteration

      left = 0.0_wp
      left_value = merge(impacts%state%velocity, impacts%state%deflection, compressing)
      right = 1.0_wp
      length = right
      call try_step(impacts, length)
      right_value = merge(impacts%next%velocity, impacts%next%deflection, compressing)
      rounding = epsilon(1.0_wp)*abs(right_value - left_value)
      left_moved = .false.
      right_moved = .false.
      do iteration = 1, most_iterations
         open = ends .and. right - left > 2*epsilon(1.0_wp)*right
         if (.not. any(open)) exit
         length = right - right_value*(right - left)/(right_value - left_value)
         where (mod(iteration, 8) == 0 .or. .not. (length > left .and. length < right)) length = (left + right)/2
         call try_step(impacts, length)
         value = merge(impacts%next%velocity, impacts%next%deflection, compressing)
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
         ! A value that is rounding only cannot lead any nearer.
         where (open .and. abs(value) <= rounding)
            left = length
            right = length
         end where
         left_moved = value > 0.0_wp
         right_moved = .not. left_moved
      end do
      length = right
   end subroutine locate

   !> Takes a part of a step in some of the lanes.
   subroutine finish_step(impacts, goes, length)
      !> The impacts.
      type(impact_lanes_type), intent(inout) :: impacts
      !> The lane takes the step: [lane_count].
      logical, intent(in) :: goes(lane_count)
      !> Its length: [lane_count].
      real(wp), intent(in) :: length(lane_count)

      call try_step(impacts, length)
      where (goes)
         impacts%state%deflection = impacts%next%deflection
         impacts%state%velocity = impacts%next%velocity
         impacts%state%impulse = impacts%next%impulse
         impacts%state%loss = impacts%next%loss
      end where
   end subroutine finish_step

   !> Where a part of a step would lead.
   subroutine try_step(impacts, length)
      !> The impacts.
      type(impact_lanes_type), intent(inout) :: impacts
      !> Its length: [lane_count].
      real(wp), intent(in) :: length(lane_count)

      impacts%pressure = not_a_number
      call set_anchors(impacts%shell, impacts%state%deflection, impacts%pressure, impacts%anchor)
      call take_step(impacts%shell, impacts%state, length, impacts%pressure, impacts%anchor, impacts%next)
   end subroutine try_step

end module thud_impact_lanes
