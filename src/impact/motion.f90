!> Snapshots of the deforming ball, for pictures: positions, velocities and pressures at the nodes.
module thud_motion
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: motion_type, start_motion, take_snapshot

   !> Snapshots; nodes run from the lowest point to the highest and from the inner surface to the outer.
   type :: motion_type
      !> Number of snapshots taken.
      integer :: n_frame = 0
      !> Times since the beginning of the record, s: [capacity].
      real(wp), allocatable :: time(:)
      !> Positions of the nodes before the impact, m: [0:n_polar, 0:n_radial, 2].
      real(wp), allocatable :: start(:, :, :)
      !> Positions, m, relative to a floor at rest at height 0: [0:n_polar, 0:n_radial, 2, capacity].
      real(wp), allocatable :: position(:, :, :, :)
      !> Velocities, m/s: the same shape.
      real(wp), allocatable :: velocity(:, :, :, :)
      !> Pressure on the floor at the nodes of the outer surface, Pa: [0:n_polar, capacity].
      real(wp), allocatable :: contact_pressure(:, :)
      !> Radial stress from the floor on the same nodes, positive outwards, Pa: the same shape.
      real(wp), allocatable :: contact_shear(:, :)
      !> Overpressure of the gas, Pa: [capacity].
      real(wp), allocatable :: cavity_pressure(:)
      !> Displacement of the floor under the ball, downwards, m: [capacity].
      real(wp), allocatable :: floor_displacement(:)
   end type motion_type

contains

   !> Allocates space for snapshots.
   pure subroutine start_motion(start, capacity, motion)
      !> Positions of the nodes before the impact, m: [0:n_polar, 0:n_radial, 2].
      real(wp), intent(in) :: start(0:, 0:, :)
      !> Maximum number of snapshots.
      integer, intent(in) :: capacity
      !> The motion, without a snapshot yet.
      type(motion_type), intent(out) :: motion
      integer :: n_polar, n_radial

      n_polar = ubound(start, 1)
      n_radial = ubound(start, 2)
      allocate (motion%time(capacity), motion%cavity_pressure(capacity), motion%floor_displacement(capacity))
      allocate (motion%contact_pressure(0:n_polar, capacity), motion%contact_shear(0:n_polar, capacity))
      allocate (motion%start(0:n_polar, 0:n_radial, 2), source=start)
      allocate (motion%position(0:n_polar, 0:n_radial, 2, capacity), motion%velocity(0:n_polar, 0:n_radial, 2, capacity))
   end subroutine start_motion

   !> Adds a snapshot if there is space for it.
   pure subroutine take_snapshot(motion, time, position, velocity, contact_stress, cavity_pressure, &
      floor_displacement)
      type(motion_type), intent(inout) :: motion
      !> Time since the beginning of the record, s.
      real(wp), intent(in) :: time
      !> Positions of the nodes, m: [0:n_polar, 0:n_radial, 2].
      real(wp), intent(in) :: position(0:, 0:, :)
      !> Velocities of the nodes, m/s: the same shape.
      real(wp), intent(in) :: velocity(0:, 0:, :)
      !> Stresses from the floor on the nodes of the outer surface, outwards and upwards, Pa: [0:n_polar, 2].
      real(wp), intent(in) :: contact_stress(0:, :)
      !> Overpressure of the gas, Pa.
      real(wp), intent(in) :: cavity_pressure
      !> Displacement of the floor downwards, m.
      real(wp), intent(in) :: floor_displacement

      if (motion%n_frame == size(motion%time)) return
      motion%n_frame = motion%n_frame + 1
      associate (i => motion%n_frame)
         motion%time(i) = time
         motion%position(:, :, :, i) = position
         motion%velocity(:, :, :, i) = velocity
         motion%contact_shear(:, i) = contact_stress(:, 1)
         motion%contact_pressure(:, i) = contact_stress(:, 2)
         motion%cavity_pressure(i) = cavity_pressure
         motion%floor_displacement(i) = floor_displacement
      end associate
   end subroutine take_snapshot

end module thud_motion
