!> Contact of the outer surface of the ball with the floor at height 0, at every node including the pole: normal forces and
!> Coulomb friction.
!>
!> Hard floor: nodes that would pass it in a step are stopped (forward increments of Lagrange multipliers, Carpenter, Taylor
!> and Katona 1991, Int. J. Numer. Methods Eng. 32, 103-128); they do not penetrate, and their energy is lost. With a layer:
!> linear springs on the floor (Winkler), lossless and massless, that push normal to the surface of the ball.
!>
!> The edge of the contact lies between two nodes, and the outer one carries part of the pressure before it touches, by a
!> parabola with the force and the work of Hertz's contact; otherwise the force would jump from ring to ring
!> (docs/finite_elements.md). Force and gap vanish as the mesh is refined.
module thud_floor_contact
   use thud_ball, only: ball_type
   use thud_constants, only: pi
   use thud_field, only: field_type, new_field
   use thud_kinds, only: wp
   use thud_mesh, only: get_nodal_areas, mesh_type
   implicit none (type, external)
   private

   public :: contact_options_type, floor_contact_type, get_contact_fields, get_contact_forces, get_contact_stiffness, &
      new_floor_contact, slow_by_friction, stop_at_floor

   !> Options of the group `&contact`.
   type :: contact_options_type
      !> Coefficient of friction between ball and floor.
      real(wp) :: friction = 0.0_wp
      !> Stiffness of a layer on the floor, N/m3; 0 for none.
      real(wp) :: layer_stiffness = 0.0_wp
   end type contact_options_type

   !> The contact; arrays over the nodes of the outer surface are [0:n_polar].
   type, extends(contact_options_type) :: floor_contact_type
      !> Force on a node at the edge when it reaches the floor, N.
      real(wp), allocatable :: edge_force(:)
      !> Height at which that force begins, m.
      real(wp), allocatable :: edge_height(:)
   end type floor_contact_type

contains

   !> Keys and allowed ranges of the group `&contact`.
   function get_contact_fields(options) result(fields)
      !> The options that the fields read and set.
      type(contact_options_type), intent(in), target :: options
      !> One field per component: [2].
      type(field_type), allocatable :: fields(:)

      fields = [ &
         new_field('friction', options%friction, '', 'coefficient of friction between ball and floor', '[0, 100]', &
         trait='calibrated'), &
         new_field('layer_stiffness', options%layer_stiffness, 'N/m3', &
         'stiffness per area of a thin layer on the floor; 0: hard floor without a layer', '[0, 1e13]')]
   end function get_contact_fields

   !> The contact of a ball.
   pure function new_floor_contact(options, ball, mesh) result(contact)
      type(contact_options_type), intent(in) :: options
      type(ball_type), intent(in) :: ball
      !> Mesh, undeformed.
      type(mesh_type), intent(in) :: mesh
      type(floor_contact_type) :: contact
      !> Work of the exact force-gap relation divided by maximum force and maximum gap: 1.5 B(1.5, 3.5).
      real(wp), parameter :: fullness = 0.1840776945462769_wp
      real(wp) :: area(0:mesh%n_polar)
      real(wp) :: modulus, width, strength
      integer :: j

      contact%contact_options_type = options
      allocate (contact%edge_force(0:mesh%n_polar), contact%edge_height(0:mesh%n_polar), source=0.0_wp)
      modulus = ball%youngs_modulus/(1 - ball%poisson_ratio**2)
      associate (last => mesh%n_radial)
         area = get_nodal_areas(mesh%r(:, last), mesh%z(:, last))
         ! Valid for a straight edge far from the axis: not in the first element.
         do j = 2, mesh%n_polar - 1
            width = hypot(mesh%r(j, last) - mesh%r(j - 1, last), mesh%z(j, last) - mesh%z(j - 1, last))
            strength = 2*modulus*sqrt(mesh%r(j, last) + mesh%r(j - 1, last))/(pi*ball%outer_radius)
            contact%edge_force(j) = 4*strength*sqrt(width)/15*area(j)
            ! The work of a parabola is a third of force times height.
            contact%edge_height(j) = 3*fullness*4*strength*width**1.5_wp/(3*modulus)
            if (.not. options%layer_stiffness > 0.0_wp) cycle
            ! A layer lowers the force, the more the softer it is relative to the element.
            contact%edge_force(j) = contact%edge_force(j)/(1 + modulus/(width*options%layer_stiffness))
         end do
      end associate
   end function new_floor_contact

   !> Forces of the floor that depend on the positions of the nodes: of its layer and at the edge of the contact.
   pure subroutine get_contact_forces(contact, position, force, energy, stiffness)
      type(floor_contact_type), intent(in) :: contact
      !> Positions of the nodes of the outer surface over the floor, m: [0:n_polar, 2].
      real(wp), intent(in) :: position(0:, :)
      !> Forces of the floor on the nodes, N: [0:n_polar, 2].
      real(wp), intent(out) :: force(0:, :)
      !> Energy stored in layer and edge, J.
      real(wp), intent(out) :: energy
      !> Derivatives of the upward forces with respect to the height of the floor, N/m: [0:n_polar].
      real(wp), intent(out), optional :: stiffness(0:)
      real(wp), dimension(0:ubound(position, 1)) :: area, depth
      real(wp) :: relative_depth
      integer :: j, n

      force = 0.0_wp
      energy = 0.0_wp
      if (present(stiffness)) stiffness = 0.0_wp
      if (minval(position(:, 2) - contact%edge_height) >= 0.0_wp) return
      n = ubound(force, 1)
      do j = 0, n - 1
         associate (z => position(j, 2), begin => contact%edge_height(j), edge_force => contact%edge_force(j))
            if (z >= begin) cycle
            relative_depth = 1.0_wp
            if (z > 0.0_wp) relative_depth = 1 - z/begin
            force(j, 2) = edge_force*relative_depth**2
            energy = energy + edge_force*(begin*relative_depth**3/3 + max(-z, 0.0_wp))
            if (present(stiffness) .and. z > 0.0_wp) stiffness(j) = 2*edge_force*relative_depth/begin
         end associate
      end do
      if (.not. contact%layer_stiffness > 0.0_wp) return
      ! Derivatives of half of stiffness times area times squared depth; the areas are those of rings on the floor.
      area = get_nodal_areas(position(:, 1), 0*position(:, 1))
      depth = max(-position(:, 2), 0.0_wp)
      if (present(stiffness)) stiffness = stiffness + merge(contact%layer_stiffness*area, 0.0_wp, depth > 0.0_wp)
      force(:, 2) = force(:, 2) + contact%layer_stiffness*area*depth
      energy = energy + contact%layer_stiffness*dot_product(area, depth**2)/2
      associate (inner => position(:n - 2, 1), here => position(1:n - 1, 1), outer => position(2:, 1))
         force(1:n - 1, 1) = -contact%layer_stiffness*pi/6*(depth(1:n - 1)**2*(outer - inner) &
            + depth(:n - 2)**2*(2*here + inner) - depth(2:)**2*(2*here + outer))
      end associate
   end subroutine get_contact_forces

   !> Upper bound of the stiffness of the floor under each node, N/m: [0:n_polar].
   pure function get_contact_stiffness(contact, r) result(stiffness)
      type(floor_contact_type), intent(in) :: contact
      !> Distances of the nodes of the outer surface from the axis, m: [0:n_polar].
      real(wp), intent(in) :: r(0:)
      real(wp) :: stiffness(0:ubound(r, 1))

      stiffness = contact%layer_stiffness*get_nodal_areas(r, 0*r)
      where (contact%edge_height > 0.0_wp) stiffness = stiffness + 2*contact%edge_force/contact%edge_height
   end function get_contact_stiffness

   !> Stops the nodes that would pass the hard floor in the next step.
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
      !> Impulses of the floor upwards, N s: [0:n_polar].
      real(wp), intent(out) :: impulse(0:)

      impulse = 0.0_wp
      if (contact%layer_stiffness > 0.0_wp) return
      impulse = mass*max(0.0_wp, -height/interval - velocity)
      velocity = max(velocity, -height/interval)
   end subroutine stop_at_floor

   !> Coulomb friction: a node sticks if an impulse of at most the friction coefficient times the normal impulse stops it;
   !> otherwise it slips against the largest such impulse.
   pure subroutine slow_by_friction(contact, mass, normal_impulse, velocity, impulse)
      type(floor_contact_type), intent(in) :: contact
      !> Masses of the nodes, kg: [0:n_polar].
      real(wp), intent(in) :: mass(0:)
      !> Impulses of the floor upwards, N s: [0:n_polar].
      real(wp), intent(in) :: normal_impulse(0:)
      !> Velocities outwards, m/s: [0:n_polar].
      real(wp), intent(inout) :: velocity(0:)
      !> Impulses of the floor outwards, N s: [0:n_polar].
      real(wp), intent(out) :: impulse(0:)

      impulse = -sign(min(mass*abs(velocity), contact%friction*normal_impulse), velocity)
      velocity = velocity + impulse/mass
   end subroutine slow_by_friction

end module thud_floor_contact
