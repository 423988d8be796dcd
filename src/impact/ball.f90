!> The ball, with its geometry, mass, material and gas, and its drop.
module thud_ball
   use thud_constants, only: pi
   use thud_field, only: field_type, new_field
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: ball_type, drop_type, get_ball_fields, get_density, get_drop_fields, get_impact_velocity

   !> A hollow ball; the default is the paper's rubber ball (section 2.3).
   type :: ball_type
      !> Outer radius R, m.
      real(wp) :: outer_radius = 0.089_wp
      !> Wall thickness h, m.
      real(wp) :: wall_thickness = 0.032_wp
      !> Mass M, kg.
      real(wp) :: mass = 2.5_wp
      !> Modulus of elasticity E, Pa; a case that states none has that of its model (`set_standard_modulus`).
      real(wp) :: youngs_modulus = 1.6e6_wp
      real(wp) :: poisson_ratio = 0.5_wp
      !> Overpressure of the gas in the undeformed ball, Pa; 0 for a ball with a hole.
      real(wp) :: gauge_pressure = 0.0_wp
      !> Pressure of the air around the ball, Pa.
      real(wp) :: ambient_pressure = 101325.0_wp
      !> Ratio of specific heats of the enclosed gas.
      real(wp) :: heat_capacity_ratio = 1.4_wp
   end type ball_type

   !> A free fall onto the floor; the default is the drop of the standards.
   type :: drop_type
      !> Height of the ball's lowest point above the floor, m.
      real(wp) :: height = 1.0_wp
      !> Acceleration of free fall, m/s2.
      real(wp) :: gravity = 9.81_wp
   end type drop_type

contains

   !> Keys, units and allowed ranges of the group `&ball`.
   function get_ball_fields(ball) result(fields)
      !> The ball that the fields read and set.
      type(ball_type), intent(in), target :: ball
      !> One field per component: [8].
      type(field_type), allocatable :: fields(:)

      fields = [ &
         new_field('outer_radius', ball%outer_radius, 'm', 'outer radius', '(0, 10]'), &
         new_field('wall_thickness', ball%wall_thickness, 'm', 'wall thickness, less than the outer radius', &
         '(0, outer_radius)'), &
         new_field('mass', ball%mass, 'kg', 'mass', '[1e-12, 1000000]'), &
         new_field('youngs_modulus', ball%youngs_modulus, 'Pa', 'modulus of elasticity', &
         '(0, 1e13]', trait='calibrated'), &
         new_field('poisson_ratio', ball%poisson_ratio, '', "Poisson's ratio", '(-1, 0.5]', trait='calibrated'), &
         new_field('gauge_pressure', ball%gauge_pressure, 'Pa', &
         'overpressure of the gas in the undeformed ball', '[0, 1e8]'), &
         new_field('ambient_pressure', ball%ambient_pressure, 'Pa', 'pressure of the air around the ball', '[0, 1e8]'), &
         new_field('heat_capacity_ratio', ball%heat_capacity_ratio, '', &
         'ratio of specific heats of the enclosed gas', '[1, 2]')]
   end function get_ball_fields

   !> Density of the wall.
   pure function get_density(ball) result(density)
      type(ball_type), intent(in) :: ball
      !> Mass divided by the volume of the wall, kg/m3.
      real(wp) :: density

      density = ball%mass/(4.0_wp/3.0_wp*pi*(ball%outer_radius**3 - (ball%outer_radius - ball%wall_thickness)**3))
   end function get_density

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

end module thud_ball
