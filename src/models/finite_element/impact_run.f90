!> The ball in motion: steps of explicit central differences, and the balances of momentum and energy.
module thud_impact_run
   use thud_ball, only: ball_type
   use thud_elastic_body, only: body_state_type, elastic_body_type, get_internal_forces, new_elastic_body, no_failure
   use thud_finite_element_options, only: finite_element_options_type
   use thud_floor_contact, only: floor_contact_type, get_contact_forces, new_floor_contact, slow_by_friction, stop_at_floor
   use thud_kinds, only: wp
   use thud_material, only: material_type
   use thud_mesh, only: new_mesh
   use thud_moving_floor, only: advance_floor, find_floor, moving_floor_type, new_moving_floor, predict
   use thud_receiver, only: receiver_type
   implicit none (type, external)
   private

   public :: get_energy, get_mean_height, get_mean_velocity, impact_run_type, new_impact_run, update_position, &
      update_velocity

   !> State of a run between steps; arrays over nodes are [0:n_polar, 0:n_radial, 2].
   type :: impact_run_type
      type(elastic_body_type) :: body
      type(floor_contact_type) :: contact
      type(moving_floor_type) :: floor
      !> Gravity, m/s2.
      real(wp) :: gravity = 0.0_wp
      !> Positions relative to the undisplaced floor, m.
      real(wp), allocatable :: position(:, :, :)
      !> Velocities half a step before the positions, m/s; at the very start, at the same instant.
      real(wp), allocatable :: velocity(:, :, :)
      !> Masses of the nodes, kg, and their inverses, 1/kg.
      real(wp), allocatable :: mass(:, :, :), inverse_mass(:, :, :)
      !> Mass of the ball, kg.
      real(wp) :: total_mass = 0.0_wp
      !> Forces of stress and gas in the latest step, N.
      real(wp), allocatable :: force(:, :, :)
      !> Forces of the floor on the nodes of the outer surface in the latest step, N: [0:n_polar, 2].
      real(wp), allocatable :: floor_force(:, :)
      !> Impulse of the floor upwards in the latest step, N s.
      real(wp) :: impulse = 0.0_wp
      !> Energies, power and failure of the latest step.
      type(body_state_type) :: state
      !> Kinetic, contact and gravitational energy in the latest step, J.
      real(wp) :: kinetic = 0.0_wp, contact_energy = 0.0_wp, potential = 0.0_wp
      !> Energies lost so far to viscosity, to stopping nodes at the floor, and to friction, J.
      real(wp) :: dissipated = 0.0_wp, contact_loss = 0.0_wp, friction_loss = 0.0_wp
      !> Time up to which the velocities are integrated, s.
      real(wp) :: time = 0.0_wp
      !> Energies lost to stopping nodes and to friction that the next step adds, J.
      real(wp) :: pending_contact_loss = 0.0_wp, pending_friction_loss = 0.0_wp
      !> Impulses of the floor on the nodes of the outer surface since the latest sample, N s: [0:n_polar, 2].
      real(wp), allocatable :: node_impulse(:, :)
      !> Length of the previous step, s; 0 at the start.
      real(wp) :: last_interval = 0.0_wp
      !> Shortest step, s.
      real(wp) :: shortest_interval = huge(1.0_wp)
      !> Maximum penetration of a node into the floor, m.
      real(wp) :: penetration = 0.0_wp
   end type impact_run_type

contains

   !> A ball falling, above the floor.
   pure function new_impact_run(ball, options, material, gravity, gap, speed, receiver) result(run)
      type(ball_type), intent(in) :: ball
      !> Mesh and contact.
      class(finite_element_options_type), intent(in) :: options
      type(material_type), intent(in) :: material
      !> Gravity, m/s2; height of the lowest point, m; velocity downwards, m/s.
      real(wp), intent(in) :: gravity, gap, speed
      !> The floor under the ball (default: rigid).
      type(receiver_type), intent(in), optional :: receiver
      type(impact_run_type) :: run

      run%body = new_elastic_body(ball, new_mesh(ball, options%mesh), material)
      run%contact = new_floor_contact(options%contact, ball, run%body%mesh)
      run%floor = new_moving_floor(receiver)
      run%gravity = gravity
      associate (mesh => run%body%mesh)
         allocate (run%position(0:mesh%n_polar, 0:mesh%n_radial, 2), run%velocity(0:mesh%n_polar, 0:mesh%n_radial, 2))
         run%position(:, :, 1) = mesh%r
         run%position(:, :, 2) = mesh%z + ball%outer_radius + gap
         run%velocity(:, :, 1) = 0.0_wp
         run%velocity(:, :, 2) = -speed
         allocate (run%mass(0:mesh%n_polar, 0:mesh%n_radial, 2), source=spread(run%body%mass, 3, 2))
         allocate (run%inverse_mass, source=1/run%mass)
         allocate (run%force, mold=run%mass)
         run%total_mass = sum(run%body%mass)
         allocate (run%floor_force(0:mesh%n_polar, 2), run%node_impulse(0:mesh%n_polar, 2), source=0.0_wp)
      end associate
   end function new_impact_run

   !> First half of a step: forces and energies at the present positions, and velocities half a step later.
   pure subroutine update_velocity(run, interval)
      type(impact_run_type), intent(inout) :: run
      !> Length of the step, s.
      real(wp), intent(in) :: interval
      real(wp), dimension(0:run%body%mesh%n_polar, 2) :: surface, before, impulse
      real(wp) :: span
      logical :: starts
      integer :: last

      last = run%body%mesh%n_radial
      span = (run%last_interval + interval)/2
      starts = .not. run%last_interval > 0.0_wp
      call get_internal_forces(run%body, run%position, run%velocity, interval, run%force, run%state)
      if (run%state%failure /= no_failure) return
      before = run%velocity(:, last, :)
      surface = run%position(:, last, :)
      associate (force => run%force(:, last, :))
         if (run%floor%moves) then
            call predict(run%floor, run%last_interval, interval)
            call find_floor(run%floor, run%contact, run%mass(:, last, 2), surface, &
               before(:, 2) + span*(force(:, 2)/run%mass(:, last, 2) - run%gravity), sum(run%floor_force(:, 2)))
         end if
         ! Floor displacements are downwards; `stop` is that of the next instant.
         surface(:, 2) = surface(:, 2) + run%floor%displacement
         call get_contact_forces(run%contact, surface, run%floor_force, run%contact_energy)
         force = force + run%floor_force
      end associate
      run%time = run%time + span
      run%kinetic = 0.0_wp
      run%potential = 0.0_wp
      call accelerate(size(run%mass)/2, span, 0.0_wp, run%mass(:, :, 1), run%inverse_mass(:, :, 1), run%force(:, :, 1), &
         run%position(:, :, 1), starts, run%velocity(:, :, 1), run%kinetic, run%potential)
      call accelerate(size(run%mass)/2, span, run%gravity, run%mass(:, :, 2), run%inverse_mass(:, :, 2), &
         run%force(:, :, 2), run%position(:, :, 2), starts, run%velocity(:, :, 2), run%kinetic, run%potential)
      call stop_at_floor(run%contact, run%mass(:, last, 2), run%position(:, last, 2) + run%floor%stop, interval, &
         run%velocity(:, last, 2), impulse(:, 2))
      call slow_by_friction(run%contact, run%mass(:, last, 1), span*run%floor_force(:, 2) + impulse(:, 2), &
         run%velocity(:, last, 1), impulse(:, 1))
      if (.not. starts) run%kinetic = run%kinetic + sum(before*impulse)/2
      run%floor_force = run%floor_force + impulse/span
      run%impulse = span*sum(run%floor_force(:, 2))
      run%node_impulse = run%node_impulse + span*run%floor_force
      if (run%floor%moves) call advance_floor(run%floor, sum(run%floor_force(:, 2)))
      ! A mobile floor takes up part of the energy that a node loses.
      call add_lost_work(impulse(:, 2), before(:, 2) + run%floor%velocity_before, &
         run%velocity(:, last, 2) + run%floor%velocity_after, starts, run%contact_loss, run%pending_contact_loss)
      call add_lost_work(impulse(:, 1), before(:, 1), run%velocity(:, last, 1), starts, run%friction_loss, &
         run%pending_friction_loss)
      run%dissipated = run%dissipated + span*run%state%dissipation
      ! Stopped nodes lie exactly on a rigid floor; a mobile floor moves on with each force.
      if (run%floor%moves .or. run%contact%layer_stiffness > 0.0_wp) run%penetration = max(run%penetration, &
         -minval(surface(:, 2)))
   end subroutine update_velocity

   !> Accelerates the nodes in one direction, and adds their kinetic and potential energies.
   pure subroutine accelerate(n, span, gravity, mass, inverse_mass, force, position, starts, velocity, kinetic, potential)
      !> Number of nodes.
      integer, intent(in) :: n
      !> Time between the velocities before and after, s; gravity against this direction, m/s2.
      real(wp), intent(in) :: span, gravity
      !> Masses, kg; their inverses, 1/kg; forces, N; positions, m: [n].
      real(wp), intent(in) :: mass(n), inverse_mass(n), force(n), position(n)
      !> Whether the velocities before are those of the instant of the forces, not half a step behind.
      logical, intent(in) :: starts
      !> Velocities, m/s: [n].
      real(wp), intent(inout) :: velocity(n)
      !> Sums to which the energies are added, J.
      real(wp), intent(inout) :: kinetic, potential
      real(wp) :: change, moving, height, part
      integer :: j

      moving = 0.0_wp
      height = 0.0_wp
      part = merge(0.0_wp, 1.0_wp, starts)
      !$omp simd private(change) reduction(+:moving, height)
      do j = 1, n
         change = span*(force(j)*inverse_mass(j) - gravity)
         moving = moving + mass(j)*velocity(j)*(velocity(j) + part*change)
         height = height + mass(j)*position(j)
         velocity(j) = velocity(j) + change
      end do
      kinetic = kinetic + moving/2
      potential = potential + gravity*height
   end subroutine accelerate

   !> Adds the work that impulses of the floor take from nodes: half by the velocities before, half by the velocities after.
   !> The second half is added in the next step; in the first step, both halves are.
   pure subroutine add_lost_work(impulse, before, after, starts, lost, waiting)
      !> Impulses, N s; velocities before and after, m/s: [0:n_polar].
      real(wp), intent(in) :: impulse(0:), before(0:), after(0:)
      !> Whether this is the first step.
      logical, intent(in) :: starts
      !> Energy lost so far; energy that the next step adds, J.
      real(wp), intent(inout) :: lost, waiting

      lost = lost + waiting
      waiting = -dot_product(impulse, after)/2
      associate (now => -dot_product(impulse, before)/2)
         if (starts) then
            waiting = waiting + now
         else
            lost = lost + now
         end if
      end associate
   end subroutine add_lost_work

   !> Second half of a step: positions one step later.
   pure subroutine update_position(run, interval)
      type(impact_run_type), intent(inout) :: run
      !> Length of the step, s.
      real(wp), intent(in) :: interval

      run%position = run%position + interval*run%velocity
      run%last_interval = interval
      run%shortest_interval = min(run%shortest_interval, interval)
   end subroutine update_position

   !> Energy of the latest step, including all losses, J; it should stay constant.
   pure function get_energy(run) result(energy)
      type(impact_run_type), intent(in) :: run
      real(wp) :: energy

      energy = run%kinetic + run%state%strain_energy + run%state%gas_energy + run%potential + run%contact_energy + &
         run%dissipated + run%contact_loss + run%friction_loss + run%floor%work
   end function get_energy

   !> Height of the center of mass, m.
   pure function get_mean_height(run) result(height)
      type(impact_run_type), intent(in) :: run
      real(wp) :: height

      height = sum(run%mass(:, :, 2)*run%position(:, :, 2))/run%total_mass
   end function get_mean_height

   !> Upward velocity of the center of mass, m/s.
   pure function get_mean_velocity(run) result(velocity)
      type(impact_run_type), intent(in) :: run
      real(wp) :: velocity

      velocity = sum(run%mass(:, :, 2)*run%velocity(:, :, 2))/run%total_mass
   end function get_mean_velocity

end module thud_impact_run
