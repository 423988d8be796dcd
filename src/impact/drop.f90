!> The drop: its height, and gravity.
module thud_drop
   use thud_field, only: field_type, new_field
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: drop_type, get_drop_fields, get_impact_velocity

   !> A free fall onto the floor; the default is the drop of the standards.
   type :: drop_type
      !> Height of the ball's lowest point above the floor, m.
      real(wp) :: height = 1.0_wp
      !> Acceleration of free fall, m/s2.
      real(wp) :: gravity = 9.81_wp
   end type drop_type

contains

   !> Keys, units and allowed ranges of the group `&drop`.
   function get_drop_fields(drop) result(fields)
      !> The drop that the fields read and set.
      type(drop_type), intent(in), target :: drop
      !> One field per component: [2].
      type(field_type) :: fields(2)

      fields = [ &
         new_field('height', drop%height, 'm', "height of the ball's lowest point above the floor", '[1e-12, 1000000]'), &
         new_field('gravity', drop%gravity, 'm/s2', 'acceleration of free fall', '[1e-12, 1000]')]
   end function get_drop_fields

   !> Velocity at first touch, m/s (paper eq. 4).
   pure function get_impact_velocity(drop) result(velocity)
      type(drop_type), intent(in) :: drop
      !> Velocity towards the floor, m/s.
      real(wp) :: velocity

      velocity = sqrt(2.0_wp*drop%gravity*drop%height)
   end function get_impact_velocity

end module thud_drop
