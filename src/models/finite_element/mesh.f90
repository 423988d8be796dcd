!> The mesh of the ball: its half section in rings from the inner to the outer surface and in
!> sectors from the lowest point, which touches the floor, to the highest.
module thud_mesh
   use thud_ball, only: ball_type
   use thud_constants, only: pi
   use thud_field, only: field_type
   use thud_kinds, only: wp
   use thud_new_field, only: integer_field
   implicit none (type, external)
   private

   public :: get_mesh_fields, mesh_options_type, mesh_type, new_mesh

   !> Relative reduction of the element size around the lowest point, where the contact is, at the inner and at the outer
   !> surface. Elements are larger at the outer surface and reduced more there, since the smallest ones limit the step.
   real(wp), parameter :: grading(2) = [0.15_wp, 0.45_wp]

   !> Numbers of elements.
   type :: mesh_options_type
      !> Elements through the wall.
      integer :: radial_elements = 8
      !> Elements from pole to pole.
      integer :: polar_elements = 64
   end type mesh_options_type

   !> Nodes of quadrilaterals. Node (j, i) lies on polar line j, counted from the lowest point, and on ring i, counted from
   !> the inner surface; an element of order p spans p intervals of each.
   type :: mesh_type
      !> Order of the elements: 1 (four nodes) or 2 (nine nodes).
      integer :: order = 1
      !> Elements through the wall.
      integer :: n_radial = 0
      !> Elements from pole to pole.
      integer :: n_polar = 0
      !> Distance from the axis, m: [0:order*n_polar, 0:order*n_radial].
      real(wp), allocatable :: r(:, :)
      !> Height over the center, m: the same shape.
      real(wp), allocatable :: z(:, :)
   end type mesh_type

contains

   !> Keys and allowed ranges of the group `&mesh`.
   function get_mesh_fields(options) result(fields)
      !> The options that the fields read and set.
      type(mesh_options_type), intent(in), target :: options
      !> One field per component: [2].
      type(field_type) :: fields(2)

      fields = [ &
         integer_field('radial_elements', options%radial_elements, 'number of elements through the wall', '[1, 64]'), &
         integer_field('polar_elements', options%polar_elements, 'number of elements from pole to pole', '[8, 1024]')]
   end function get_mesh_fields

   !> Mesh of the undeformed ball around the origin. Elements of order 1 are graded, for the contact; those of order 2,
   !> for the free modes, are not.
   pure function new_mesh(ball, options, order) result(mesh)
      type(ball_type), intent(in) :: ball
      !> Numbers of elements.
      type(mesh_options_type), intent(in) :: options
      !> Order of the elements, 1 or 2.
      integer, intent(in) :: order
      type(mesh_type) :: mesh
      real(wp) :: radius, angle, depth
      integer :: i, j, n_ring, n_line

      mesh%order = order
      mesh%n_radial = options%radial_elements
      mesh%n_polar = options%polar_elements
      n_ring = order*mesh%n_radial
      n_line = order*mesh%n_polar
      allocate (mesh%r(0:n_line, 0:n_ring), mesh%z(0:n_line, 0:n_ring))
      do i = 0, n_ring
         depth = real(n_ring - i, wp)/real(n_ring, wp)
         radius = ball%outer_radius - ball%wall_thickness*depth
         do j = 0, n_line
            angle = pi*real(j, wp)/real(n_line, wp)
            if (order == 1) angle = angle - (grading(1)*depth + grading(2)*(1 - depth))*sin(angle)
            mesh%r(j, i) = radius*sin(angle)
            mesh%z(j, i) = -radius*cos(angle)
         end do
      end do
      ! The sine of pi is not quite zero.
      mesh%r(0, :) = 0.0_wp
      mesh%r(n_line, :) = 0.0_wp
   end function new_mesh

end module thud_mesh
