!> The ball in motion: steps of explicit central differences, and the balances of momentum and energy.
!>
!> With velocities half a step behind, the step dt is stable while dt**2 k + 2 dt c <= 4 for the largest eigenvalues k and c
!> of stiffness and viscosity over mass. The volume of an element with the edge vectors a and b through its middle resists
!> with at most 4 (M/rho) (a**2 + b**2)/(a x b)**2, the greatest of compression waves along both (Flanagan and Belytschko
!> 1981, Int. J. Numer. Methods Eng. 17, 679-706), for the modulus M of such waves; the largest over the elements bounds the
!> body. The springs of the floor under a node add to it (Weyl).
module thud_impact_run
   use thud_ball, only: ball_type
   use thud_elastic_body, only: body_state_type, elastic_body_type, get_internal_forces, new_elastic_body, no_failure
   use thud_floor_contact, only: contact_options_type, floor_contact_type, get_contact_forces, get_contact_stiffness, &
      new_floor_contact, slow_by_friction, stop_at_floor
   use thud_kinds, only: wp
   use thud_material, only: material_type
   use thud_mesh, only: get_nodal_areas, mesh_type
   use thud_moving_floor, only: advance_floor, find_floor, moving_floor_type, new_moving_floor, predict
   use thud_receiver, only: receiver_type
   implicit none (type, external)
   private

   public :: get_energy, get_mean_height, get_mean_velocity, get_stable_interval, impact_run_type, new_impact_run, &
      update_position, update_velocity

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
      !> Inverse masses of the nodes, 1/kg: [0:n_polar, 0:n_radial].
      real(wp), allocatable :: inverse_mass(:, :)
      !> Mass of the ball, kg; height of its center of mass at first touch, m.
      real(wp) :: total_mass = 0.0_wp, touch_height = 0.0_wp
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
      !> Maximum penetration of a node into the floor, m.
      real(wp) :: penetration = 0.0_wp
   end type impact_run_type

contains

   !> A ball falling, above the floor.
   pure function new_impact_run(ball, mesh, material, contact, gravity, gap, speed, receiver) result(run)
      type(ball_type), intent(in) :: ball
      !> Mesh, undeformed.
      type(mesh_type), intent(in) :: mesh
      type(material_type), intent(in) :: material
      type(contact_options_type), intent(in) :: contact
      !> Gravity, m/s2; height of the lowest point, m; velocity downwards, m/s.
      real(wp), intent(in) :: gravity, gap, speed
      !> The floor under the ball (default: rigid).
      type(receiver_type), intent(in), optional :: receiver
      type(impact_run_type) :: run

      run%body = new_elastic_body(ball, mesh, material)
      run%contact = new_floor_contact(contact, ball, mesh)
      run%floor = new_moving_floor(receiver)
      run%gravity = gravity
      allocate (run%position(0:mesh%n_polar, 0:mesh%n_radial, 2))
      allocate (run%velocity, run%force, mold=run%position)
      run%position(:, :, 1) = mesh%r
      run%position(:, :, 2) = mesh%z + ball%outer_radius + gap
      run%velocity(:, :, 1) = 0.0_wp
      run%velocity(:, :, 2) = -speed
      allocate (run%inverse_mass, source=1/run%body%mass)
      run%total_mass = sum(run%body%mass)
      run%touch_height = get_mean_height(run) - gap
      allocate (run%floor_force(0:mesh%n_polar, 2), run%node_impulse(0:mesh%n_polar, 2), source=0.0_wp)
   end function new_impact_run

   !> Lower bound of the longest stable step, s.
   pure function get_stable_interval(mesh, material, contact) result(interval)
      type(mesh_type), intent(in) :: mesh
      type(material_type), intent(in) :: material
      type(floor_contact_type), intent(in) :: contact
      real(wp) :: interval
      real(wp) :: shape, modulus, springs
      integer :: last

      last = mesh%n_radial
      shape = 4*get_largest_shape(mesh)/material%density
      associate (r => mesh%r, z => mesh%z)
         springs = maxval(2*get_contact_stiffness(contact, r(:, last))/(material%density*get_nodal_areas(r(:, last), &
            z(:, last))*hypot(r(:, last) - r(:, last - 1), z(:, last) - z(:, last - 1))))
      end associate
      modulus = material%bulk_modulus + 4*material%shear_modulus/3
      associate (branches => material%branch_modulus, viscous => 4*material%viscosity/3*shape)
         interval = limit(modulus + 4*sum(branches)/3, viscous)
         ! In the fastest motion, strains and the viscous tensors of fast branches change sign in each step.
         interval = limit(modulus + 4*sum(branches*(1 + tanh(interval/(2*material%branch_time))))/3, viscous)
      end associate

   contains

      !> The step at which dt**2 k + 2 dt c = 4.
      pure function limit(modulus, viscous) result(step)
         !> Modulus of compression waves, Pa; eigenvalue of viscosity, 1/s.
         real(wp), intent(in) :: modulus, viscous
         real(wp) :: step

         step = 4/(viscous + sqrt(viscous**2 + 4*(modulus*shape + springs)))
      end function limit

   end function get_stable_interval

   !> Largest sum of the squared reciprocal edge vectors of an element, 1/m2.
   pure function get_largest_shape(mesh) result(largest)
      type(mesh_type), intent(in) :: mesh
      real(wp) :: largest
      real(wp) :: along(2), through(2)
      integer :: i, j

      largest = 0.0_wp
      associate (r => mesh%r, z => mesh%z)
         do i = 1, mesh%n_radial
            do j = 1, mesh%n_polar
               associate (now => [r(j, i), z(j, i)], before => [r(j - 1, i), z(j - 1, i)], below => [r(j, i - 1), &
                  z(j, i - 1)], diagonal => [r(j - 1, i - 1), z(j - 1, i - 1)])
                  along = (now - before + below - diagonal)/2
                  through = (now - below + before - diagonal)/2
               end associate
               largest = max(largest, (sum(along**2) + sum(through**2))/(along(1)*through(2) - along(2)*through(1))**2)
            end do
         end do
      end associate
   end function get_largest_shape

   !> First half of a step: forces and energies at the present positions, and velocities half a step later.
   subroutine update_velocity(run, interval)
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
      associate (force => run%force(:, last, :), mass => run%body%mass(:, last))
         if (run%floor%moves) then
            call predict(run%floor, run%last_interval, interval)
            call find_floor(run%floor, run%contact, mass, surface, before(:, 2) + span*(force(:, 2)/mass - run%gravity), &
               sum(run%floor_force(:, 2)))
         end if
         ! Floor displacements are downwards; `stop` is that of the next instant.
         surface(:, 2) = surface(:, 2) + run%floor%displacement
         call get_contact_forces(run%contact, surface, run%floor_force, run%contact_energy)
         force = force + run%floor_force
         run%time = run%time + span
         run%kinetic = 0.0_wp
         run%potential = 0.0_wp
         call accelerate(size(run%body%mass), 0.0_wp, run%body%mass, run%inverse_mass, run%force(:, :, 1), &
            run%position(:, :, 1), run%velocity(:, :, 1))
         call accelerate(size(run%body%mass), run%gravity, run%body%mass, run%inverse_mass, run%force(:, :, 2), &
            run%position(:, :, 2), run%velocity(:, :, 2))
         call stop_at_floor(run%contact, mass, run%position(:, last, 2) + run%floor%stop, interval, &
            run%velocity(:, last, 2), impulse(:, 2))
         call slow_by_friction(run%contact, mass, span*run%floor_force(:, 2) + impulse(:, 2), run%velocity(:, last, 1), &
            impulse(:, 1))
      end associate
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

   contains

      !> Accelerates the nodes in one direction, and adds their kinetic and potential energies.
      subroutine accelerate(n, gravity, mass, inverse_mass, force, position, velocity)
         !> Number of nodes.
         integer, intent(in) :: n
         !> Gravity against this direction, m/s2.
         real(wp), intent(in) :: gravity
         !> Masses, kg; their inverses, 1/kg; forces, N; positions, m: [n].
         real(wp), intent(in) :: mass(n), inverse_mass(n), force(n), position(n)
         !> Velocities, m/s, at the start those of the instant of the forces, otherwise half a step behind: [n].
         real(wp), intent(inout) :: velocity(n)
         real(wp) :: change, moving, height, fraction, length
         integer :: j

         moving = 0.0_wp
         height = 0.0_wp
         fraction = merge(0.0_wp, 1.0_wp, starts)
         length = span
         !$omp simd private(change) reduction(+:moving, height)
         do j = 1, n
            change = length*(force(j)*inverse_mass(j) - gravity)
            moving = moving + mass(j)*velocity(j)*(velocity(j) + fraction*change)
            height = height + mass(j)*position(j)
            velocity(j) = velocity(j) + change
         end do
         run%kinetic = run%kinetic + moving/2
         run%potential = run%potential + gravity*height
      end subroutine accelerate

   end subroutine update_velocity

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

      height = sum(run%body%mass*run%position(:, :, 2))/run%total_mass
   end function get_mean_height

   !> Upward velocity of the center of mass, m/s.
   pure function get_mean_velocity(run) result(velocity)
      type(impact_run_type), intent(in) :: run
      real(wp) :: velocity

      velocity = sum(run%body%mass*run%velocity(:, :, 2))/run%total_mass
   end function get_mean_velocity

end module thud_impact_run
