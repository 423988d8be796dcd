!> The mesh of the ball: its half section in rings from the inner to the outer surface and in
!> sectors from the lowest point, which touches the floor, to the highest.
module thud_mesh
   use thud_ball, only: ball_type
   use thud_constants, only: pi
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type, new_field
   use thud_kinds, only: wp
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: check_mesh, get_element_counts, get_mesh_fields, get_nodal_areas, mesh_options_type, mesh_type, new_mesh

   !> Relative reduction of the element size around the lowest point, where the contact is, at the inner and at the outer
   !> surface. Elements are larger at the outer surface and reduced more there, since the smallest ones limit the step.
   real(wp), parameter :: grading(2) = [0.15_wp, 0.45_wp]

   !> The same around both poles of a ball between plates.
   real(wp), parameter :: press_grading = 0.4_wp

   !> Automatic numbers of elements through and along a wall with this ratio of thickness to outer radius or a larger one.
   integer, parameter :: typical_radial = 8
   real(wp), parameter :: typical_polar = 64, typical_wall = 0.36_wp

   !> Maximum ratio of the automatic number of elements along a thinner wall to that number.
   real(wp), parameter :: max_factor = 8.0_wp

   !> Minimum number of elements through the wall (fewer do not bend as the wall does) and from pole to pole.
   integer, parameter, public :: min_radial = 2
   integer, parameter :: min_polar = 8

   !> Numbers of elements.
   type :: mesh_options_type
      !> Elements through the wall; 0 for automatic.
      integer :: radial_elements = 0
      !> Elements from pole to pole; 0 for automatic.
      integer :: polar_elements = 0
   end type mesh_options_type

   !> Nodes of quadrilaterals. Node (j, i) lies on polar line j, counted from the lowest point, and on ring i, counted from
   !> the inner surface.
   type :: mesh_type
      !> Elements through the wall.
      integer :: n_radial = 0
      !> Elements from pole to pole.
      integer :: n_polar = 0
      !> Distance from the axis, m: [0:n_polar, 0:n_radial].
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
         new_field('radial_elements', options%radial_elements, '', 'number of elements through the wall; 0: automatic', &
         '[0, 64]'), &
         new_field('polar_elements', options%polar_elements, '', 'number of elements from pole to pole, from 8; ' &
         //'0: automatic', '[0, 1024]')]
   end function get_mesh_fields

   !> Returns an error if there are too few elements.
   subroutine check_mesh(options, error)
      type(mesh_options_type), intent(in) :: options
      type(error_type), allocatable, intent(out) :: error

      if (options%polar_elements > 0 .and. options%polar_elements < min_polar) then
         error = input_error('= '//to_text(options%polar_elements)//' is not allowed; allowed: from '//to_text(min_polar) &
            //', or 0 for automatic', 'mesh', 'polar_elements')
      else if (options%radial_elements > 0 .and. options%radial_elements < min_radial) then
         error = input_error('= '//to_text(options%radial_elements)//' is not allowed with finite_element; allowed: from ' &
            //to_text(min_radial)//', or 0 for automatic', 'mesh', 'radial_elements')
      end if
   end subroutine check_mesh

   !> Numbers of elements with those that are automatic: of a thinner wall the elements are shorter, since it bends.
   pure function get_element_counts(ball, options) result(counts)
      type(ball_type), intent(in) :: ball
      type(mesh_options_type), intent(in) :: options
      type(mesh_options_type) :: counts

      counts = options
      if (counts%radial_elements == 0) counts%radial_elements = typical_radial
      if (counts%polar_elements == 0) counts%polar_elements = nint(typical_polar &
         *min(max_factor, sqrt(max(1.0_wp, typical_wall*ball%outer_radius/ball%wall_thickness))))
   end function get_element_counts

   !> Mesh of the undeformed ball around the origin, graded for the contact.
   pure function new_mesh(ball, options, between_plates) result(mesh)
      type(ball_type), intent(in) :: ball
      !> Numbers of elements.
      type(mesh_options_type), intent(in) :: options
      !> Whether contacts are at both poles (default: at the lowest point).
      logical, intent(in), optional :: between_plates
      type(mesh_type) :: mesh
      real(wp) :: radius, angle, depth
      integer :: i, j
      logical :: pressed

      pressed = .false.
      if (present(between_plates)) pressed = between_plates
      associate (counts => get_element_counts(ball, options))
         mesh%n_radial = counts%radial_elements
         mesh%n_polar = counts%polar_elements
      end associate
      allocate (mesh%r(0:mesh%n_polar, 0:mesh%n_radial), mesh%z(0:mesh%n_polar, 0:mesh%n_radial))
      do i = 0, mesh%n_radial
         depth = real(mesh%n_radial - i, wp)/real(mesh%n_radial, wp)
         radius = ball%outer_radius - ball%wall_thickness*depth
         do j = 0, mesh%n_polar
            angle = pi*real(j, wp)/real(mesh%n_polar, wp)
            if (pressed) then
               angle = angle - press_grading*sin(2*angle)/2
            else
               angle = angle - (grading(1)*depth + grading(2)*(1 - depth))*sin(angle)
            end if
            mesh%r(j, i) = radius*sin(angle)
            mesh%z(j, i) = -radius*cos(angle)
         end do
      end do
      ! The sine of pi is not quite zero.
      mesh%r(0, :) = 0.0_wp
      mesh%r(mesh%n_polar, :) = 0.0_wp
   end function new_mesh

   !> Nodal areas of a surface, m2: integrals of the shape functions over the adjacent frustums, as for a pressure: [0:n].
   pure function get_nodal_areas(r, z) result(area)
      !> Distances of the nodes from the axis, m: [0:n].
      real(wp), intent(in) :: r(0:)
      !> Their heights, m: [0:n].
      real(wp), intent(in) :: z(0:)
      real(wp) :: area(0:ubound(r, 1))
      real(wp) :: width
      integer :: j

      area = 0.0_wp
      do j = 1, ubound(r, 1)
         width = hypot(r(j) - r(j - 1), z(j) - z(j - 1))
         area(j - 1) = area(j - 1) + pi*width*(2*r(j - 1) + r(j))/3
         area(j) = area(j) + pi*width*(r(j - 1) + 2*r(j))/3
      end do
   end function get_nodal_areas

end module thud_mesh
