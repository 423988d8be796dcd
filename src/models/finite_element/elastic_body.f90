!> The deforming ball: nodes, masses, material and gas, and the forces on its nodes.
module thud_elastic_body
   use thud_ball, only: ball_type
   use thud_cavity, only: add_gas_forces, cavity_type, get_gas_energy, get_gas_pressure, get_volume, new_cavity
   use thud_element_block, only: add_nodal_forces, element_block_type, get_gradients, n_component, n_lane, &
      n_symmetric, new_element_blocks
   use thud_kinds, only: wp
   use thud_material, only: material_type
   use thud_maxwell_branches, only: add_branch_stress, branch_step_type, new_branch_step
   use thud_mesh, only: mesh_type
   use thud_rubber, only: add_viscous_stress, get_elastic_stress, get_isochoric, get_jacobians, &
      get_mean_stress, get_nominal_stress
   implicit none (type, external)
   private

   public :: body_state_type, cavity_closed, elastic_body_type, element_inverted, get_internal_forces, new_elastic_body, &
      no_failure

   !> Reasons why forces cannot be computed.
   integer, parameter :: no_failure = 0, element_inverted = 1, cavity_closed = 2

   !> The ball; arrays over nodes are [0:n_polar, 0:n_radial], components r and z last.
   type :: elastic_body_type
      !> Mesh, undeformed, around the origin.
      type(mesh_type) :: mesh
      !> The elements of the mesh: [n_block].
      type(element_block_type), allocatable :: blocks(:)
      type(material_type) :: material
      type(cavity_type) :: cavity
      !> Masses of the nodes, kg.
      real(wp), allocatable :: mass(:, :)
      !> Viscous tensor of each Maxwell branch: [n_lane, symmetric, branch, n_block].
      real(wp), allocatable :: viscous(:, :, :, :)
   end type elastic_body_type

   !> Energies and status that come with the forces.
   type :: body_state_type
      !> Strain energy, including that of the Maxwell branches, J.
      real(wp) :: strain_energy = 0.0_wp
      !> Power dissipated by viscosity, W.
      real(wp) :: dissipation = 0.0_wp
      !> Work done on the gas, J.
      real(wp) :: gas_energy = 0.0_wp
      !> Overpressure of the gas, Pa.
      real(wp) :: gas_pressure = 0.0_wp
      !> Minimum of the local volume ratio J.
      real(wp) :: min_jacobian = 1.0_wp
      !> `no_failure`, or why there are no forces.
      integer :: failure = no_failure
   end type body_state_type

contains

   !> The ball at rest.
   pure function new_elastic_body(ball, mesh, material) result(body)
      type(ball_type), intent(in) :: ball
      !> The mesh.
      type(mesh_type), intent(in) :: mesh
      type(material_type), intent(in) :: material
      type(elastic_body_type) :: body
      integer :: k, n

      n = mesh%n_polar
      body%mesh = mesh
      body%material = material
      body%cavity = new_cavity(ball, mesh%r(:, 0), mesh%z(:, 0))
      body%blocks = new_element_blocks(mesh)
      allocate (body%mass(0:n, 0:mesh%n_radial), source=0.0_wp)
      do k = 1, size(body%blocks)
         associate (block => body%blocks(k), mass => body%mass)
            associate (i => block%ring, first => block%before, last => block%after, &
               volume => block%nodal_volume(:block%n, :))
               mass(first:last - 1, i - 1) = mass(first:last - 1, i - 1) + volume(:, 1)
               mass(first:last - 1, i) = mass(first:last - 1, i) + volume(:, 2)
               mass(first + 1:last, i - 1) = mass(first + 1:last, i - 1) + volume(:, 3)
               mass(first + 1:last, i) = mass(first + 1:last, i) + volume(:, 4)
            end associate
         end associate
      end do
      ! The mesh is a little smaller than the sphere; the mass is that of the ball.
      body%mass = body%mass*(ball%mass/sum(body%mass))
      allocate (body%viscous(n_lane, n_symmetric, size(material%branch_time), size(body%blocks)), source=0.0_wp)
      body%viscous(:, 1:3, :, :) = 1.0_wp
   end function new_elastic_body

   !> Nodal forces of stress and gas.
   pure subroutine get_internal_forces(body, position, velocity, interval, force, state)
      !> The body; its viscous tensors advance to the end of the step.
      type(elastic_body_type), intent(inout) :: body
      !> Positions of the nodes, m: [0:n_polar, 0:n_radial, 2].
      real(wp), intent(in), contiguous :: position(0:, 0:, :)
      !> Velocities of the nodes, m/s: the same shape.
      real(wp), intent(in), contiguous :: velocity(0:, 0:, :)
      !> Length of the step, s.
      real(wp), intent(in) :: interval
      !> Forces, N: the same shape as the positions.
      real(wp), intent(out), contiguous :: force(0:, 0:, :)
      !> Energies and power.
      type(body_state_type), intent(out) :: state
      real(wp), dimension(n_lane, n_component) :: f, rate, stress
      real(wp), dimension(n_lane, n_symmetric) :: c, inverse, isochoric
      real(wp), dimension(n_lane) :: jacobian, root, mean_stress, density, power, energy, loss, lowest
      type(branch_step_type) :: step(size(body%material%branch_time))
      real(wp) :: volume
      integer :: b, k, last

      last = body%mesh%n_polar
      force = 0.0_wp
      energy = 0.0_wp
      loss = 0.0_wp
      lowest = 1.0_wp
      ! Lanes without an element stay undeformed.
      f = spread([1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 1.0_wp], 1, n_lane)
      rate = 0.0_wp
      associate (material => body%material)
         step = new_branch_step(material%branch_modulus, material%branch_time, interval)
         do k = 1, size(body%blocks)
            associate (block => body%blocks(k), i => body%blocks(k)%ring)
               call get_gradients(block, last, position(:, i - 1:i, 1), position(:, i - 1:i, 2), f)
               if (material%viscosity > 0.0_wp) call get_gradients(block, last, velocity(:, i - 1:i, 1), &
                  velocity(:, i - 1:i, 2), rate)
               call get_jacobians(f, jacobian)
               call get_mean_stress(block, material%bulk_modulus, jacobian, mean_stress, density)
               call get_isochoric(f, jacobian, root, c, inverse)
               call get_elastic_stress(material%shear_modulus, material%mooney_share, c, inverse, isochoric, density)
               power = 0.0_wp
               do b = 1, size(step)
                  call add_branch_stress(step(b), c, inverse, body%viscous(:, :, b, k), isochoric, density, power)
               end do
               call get_nominal_stress(block%weight, f, root, c, isochoric, mean_stress, stress)
               if (material%viscosity > 0.0_wp) call add_viscous_stress(material%viscosity, block%weight, f, rate, root, &
                  stress, power)
               call add_nodal_forces(block, last, stress, force(:, i - 1:i, 1), force(:, i - 1:i, 2))
               energy = energy + block%weight*density
               loss = loss + block%weight*power
               lowest = merge(jacobian, lowest, jacobian < lowest)
            end associate
         end do
      end associate
      state%min_jacobian = minval(lowest)
      if (.not. state%min_jacobian > 0.0_wp) then
         state%failure = element_inverted
         return
      end if
      state%strain_energy = sum(energy)
      state%dissipation = sum(loss)
      volume = get_volume(position(:, 0, 1), position(:, 0, 2))
      if (.not. volume > 0.0_wp) then
         state%failure = cavity_closed
         return
      end if
      state%gas_pressure = get_gas_pressure(body%cavity, volume)
      state%gas_energy = get_gas_energy(body%cavity, volume)
      call add_gas_forces(state%gas_pressure, position(:, 0, 1), position(:, 0, 2), force(:, 0, 1), force(:, 0, 2))
      ! Nodes on the axis stay there.
      force(0, :, 1) = 0.0_wp
      force(last, :, 1) = 0.0_wp
   end subroutine get_internal_forces

end module thud_elastic_body
