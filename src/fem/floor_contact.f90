!> Contact of the ball's surface with the rigid floor at height 0, without friction, at every node of
!> the surface, the pole included.
!>
!> `penalty`: a spring for each node takes its share of the surface; it keeps energy and lets the
!> surface sink in a little. `impulse`: nodes that would pass the floor in a step are stopped at it
!> (forward increments of Lagrange multipliers, Carpenter, Taylor and Katona 1991, Int. J. Numer.
!> Methods Eng. 32, 103-128); nothing sinks in, and the energy of what is stopped is lost.
module thud_floor_contact
   use thud_field, only: field_type, name_length
   use thud_kinds, only: wp
   use thud_material, only: material_type
   use thud_mesh, only: mesh_type
   use thud_new_field, only: choice_field, real_field
   use thud_nodal_areas, only: get_nodal_areas
   implicit none (type, external)
   private

   public :: contact_options_type, floor_contact_type, get_contact_fields, get_penalty_forces, new_floor_contact, &
      stop_at_floor

   !> What the group asks for.
   type :: contact_options_type
      !> `penalty` or `impulse`.
      character(len=name_length) :: treatment = 'impulse'
      !> Stiffness of the penalty over that of the elements above it, both per area.
      real(wp) :: penalty_ratio = 3.0_wp
   end type contact_options_type

   !> The contact.
   type :: floor_contact_type
      !> Nodes are stopped instead of pushed.
      logical :: stops = .false.
      !> Stiffness of each node, N/m: [0:n_polar].
      real(wp), allocatable :: stiffness(:)
   end type floor_contact_type

contains

   !> Keys and allowed ranges of the group `&contact`.
   function get_contact_fields(options) result(fields)
      !> The options that the fields read and set.
      type(contact_options_type), intent(in), target :: options
      !> One field per component: [2].
      type(field_type), allocatable :: fields(:)

      fields = [ &
         choice_field('treatment', options%treatment, 'how the floor holds the ball', &
         [character(len=8) :: 'penalty', 'impulse']), &
         real_field('penalty_ratio', options%penalty_ratio, '', &
         'stiffness of the penalty over that of the elements above it, per area', '[0.01, 100]')]
   end function get_contact_fields

   !> The contact of a ball.
   pure function new_floor_contact(options, mesh, material) result(contact)
      type(contact_options_type), intent(in) :: options
      !> Mesh of order 1, undeformed.
      type(mesh_type), intent(in) :: mesh
      type(material_type), intent(in) :: material
      type(floor_contact_type) :: contact
      real(wp) :: modulus

      associate (last => mesh%n_radial)
         contact%stops = options%treatment == 'impulse'
         modulus = material%bulk_modulus + 4*(material%shear_modulus + sum(material%branch_modulus))/3
         allocate (contact%stiffness(0:mesh%n_polar))
         contact%stiffness = options%penalty_ratio*modulus*get_nodal_areas(mesh%r(:, last), mesh%z(:, last)) &
            /hypot(mesh%r(:, last) - mesh%r(:, last - 1), mesh%z(:, last) - mesh%z(:, last - 1))
      end associate
   end function new_floor_contact

   !> Forces of the penalty.
   pure subroutine get_penalty_forces(contact, height, force, energy)
      type(floor_contact_type), intent(in) :: contact
      !> Heights of the nodes of the outer surface over the floor, m: [0:n_polar].
      real(wp), intent(in) :: height(0:)
      !> Forces of the floor upwards, N: [0:n_polar].
      real(wp), intent(out) :: force(0:)
      !> Energy that the springs hold, J.
      real(wp), intent(out) :: energy

      force = 0.0_wp
      energy = 0.0_wp
      if (contact%stops .or. minval(height) >= 0.0_wp) return
      force = contact%stiffness*max(0.0_wp, -height)
      energy = dot_product(contact%stiffness, min(0.0_wp, height)**2)/2
   end subroutine get_penalty_forces

   !> Stops the nodes that would pass the floor in the next step.
   pure subroutine stop_at_floor(contact, mass, height, interval, velocity, impulse)
      type(floor_contact_type), intent(in) :: contact
      !> Masses of the nodes, kg: [0:n_polar].
      real(wp), intent(in) :: mass(0:)
      !> Heights of the nodes over the floor, m: [0:n_polar].
      real(wp), intent(in) :: height(0:)
      !> Length of the step, s.
      real(wp), intent(in) :: interval
      !> Velocities upwards, m/s: [0:n_polar].
      real(wp), intent(inout) :: velocity(0:)
      !> Impulses of the floor, N s: [0:n_polar].
      real(wp), intent(out) :: impulse(0:)

      impulse = 0.0_wp
      if (.not. contact%stops) return
      impulse = mass*max(0.0_wp, -height/interval - velocity)
      velocity = max(velocity, -height/interval)
   end subroutine stop_at_floor

end module thud_floor_contact
