!> Snapshots of the deforming ball, for pictures: positions, velocities and stresses at the nodes, which run from the lowest
!> point to the highest and from the inner surface to the outer.
module thud_motion
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: motion_type, snapshot_type

   !> The ball at one time.
   type :: snapshot_type
      !> Time since the beginning of the record, s.
      real(wp) :: time = 0.0_wp
      !> Positions of the nodes, m, relative to a floor at rest at height 0: [0:n_polar, 0:n_radial, 2].
      real(wp), allocatable :: position(:, :, :)
      !> Velocities, m/s: the same shape.
      real(wp), allocatable :: velocity(:, :, :)
      !> Stresses from the floor on the nodes of the outer surface, outwards and upwards, Pa: [n_polar + 1, 2].
      real(wp), allocatable :: contact_stress(:, :)
      !> Overpressure of the gas, Pa.
      real(wp) :: cavity_pressure = 0.0_wp
      !> Displacement of the floor under the ball, downwards, m.
      real(wp) :: floor_displacement = 0.0_wp
   end type snapshot_type

   !> The snapshots of an impact.
   type :: motion_type
      !> Positions of the nodes before the impact, m: [0:n_polar, 0:n_radial, 2].
      real(wp), allocatable :: start(:, :, :)
      !> Number of snapshots taken.
      integer :: n_frame = 0
      !> The snapshots, and space for more: [capacity].
      type(snapshot_type), allocatable :: snapshot(:)
   end type motion_type

end module thud_motion
