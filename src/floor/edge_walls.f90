!> Walls on which the edges of a floor rest, or between which they are clamped: their keys, and the springs that they are.
module thud_edge_walls
   use thud_constants, only: pi
   use thud_field, only: field_type, name_length
   use thud_kinds, only: wp
   use thud_new_field, only: choice_field, real_field
   use thud_plate_stack, only: edge_type
   implicit none (type, external)
   private

   public :: edge_walls_type, get_edge_wall_fields, get_wall_edge, get_wall_limit

   !> Equal walls at all edges; the defaults are those of masonry below the floor.
   type :: edge_walls_type
      !> Thickness and height, m; density, kg/m3; modulus of elasticity, Pa.
      real(wp) :: thickness = 0.175_wp, height = 2.5_wp, density = 1800.0_wp, modulus = 5.0e9_wp
      !> Walls `below` the floor, or `both` below and above.
      character(len=name_length) :: position = 'below'
      !> Far ends of the walls: `pinned` or `clamped`.
      character(len=name_length) :: far_end = 'pinned'
   end type edge_walls_type

contains

   !> Keys and allowed ranges.
   function get_edge_wall_fields(walls) result(fields)
      !> The walls that the fields read and set.
      type(edge_walls_type), intent(in), target :: walls
      type(field_type), allocatable :: fields(:)

      fields = [ &
         real_field('edge_wall_thickness', walls%thickness, 'm', 'thickness of the walls at the edges, for walls', &
         '[0.01, 2]'), &
         real_field('edge_wall_height', walls%height, 'm', 'height of these walls', '[0.5, 20]'), &
         real_field('edge_wall_density', walls%density, 'kg/m3', 'density of these walls', '[10, 20000]'), &
         real_field('edge_wall_modulus', walls%modulus, 'Pa', 'modulus of elasticity of these walls', '[1e7, 1e12]'), &
         choice_field('edge_wall_position', walls%position, 'walls below the edges, or both below and above', &
         [character(len=5) :: 'below', 'both']), &
         choice_field('edge_wall_far_end', walls%far_end, 'far ends of these walls', &
         [character(len=7) :: 'pinned', 'clamped'])]
   end function get_edge_wall_fields

   !> Springs along an edge: the bending of each wall against rotation, 3 E I/h with a pinned far end and 4 E I/h with a
   !> clamped one, and the compression of the wall below against deflection, E t/h.
   pure function get_wall_edge(walls) result(edge)
      type(edge_walls_type), intent(in) :: walls
      type(edge_type) :: edge

      associate (e => walls%modulus, t => walls%thickness, h => walls%height)
         edge%deflection = e*t/h
         edge%rotation = merge(3, 4, walls%far_end == 'pinned')*merge(2, 1, walls%position == 'both')*e*t**3/12/h
      end associate
   end function get_wall_edge

   !> Frequency of the lowest mode of a wall whose near end does not rotate, Hz; above it, the wall is no mere spring.
   pure function get_wall_limit(walls) result(frequency)
      type(edge_walls_type), intent(in) :: walls
      real(wp) :: frequency
      !> Products of wavenumber and height of a beam that is clamped at one end and pinned, or clamped, at the other.
      real(wp), parameter :: clamped_pinned = 3.926602_wp, clamped_clamped = 4.730041_wp

      frequency = merge(clamped_pinned, clamped_clamped, walls%far_end == 'pinned')**2*walls%thickness &
         *sqrt(walls%modulus/(12*walls%density))/(2*pi*walls%height**2)
   end function get_wall_limit

end module thud_edge_walls
