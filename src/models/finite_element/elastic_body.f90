!> The deforming ball: nodes, masses, material and gas, and the forces on its nodes. The gas is adiabatic, of uniform
!> pressure, in the volume inside the deformed inner surface.
module thud_elastic_body
   use thud_ball, only: ball_type
   use thud_constants, only: pi
   use thud_element_block, only: add_nodal_forces, element_block_type, get_gradients, n_lane, n_symmetric, new_element_blocks
   use thud_kinds, only: wp
   use thud_material, only: material_type
   use thud_mesh, only: mesh_type
   use thud_rubber, only: add_branch_stress, add_viscous_stress, branch_step_type, new_branch_step, set_elastic_stress, &
      set_nominal_stress, set_strain, strain_type, stress_type
   implicit none (type, external)
   private

   public :: add_gas_forces, body_state_type, cavity_closed, cavity_type, elastic_body_type, element_inverted
   public :: get_gas_energy, get_gas_pressure, get_internal_forces, get_volume, new_elastic_body, no_failure

   !> Reasons why forces cannot be computed.
   integer, parameter :: no_failure = 0, element_inverted = 1, cavity_closed = 2

   !> The gas at first touch.
   type :: cavity_type
      !> Volume, m3.
      real(wp) :: volume = 0.0_wp
      !> Pressure in the undeformed ball, Pa.
      real(wp) :: pressure = 0.0_wp
      !> Pressure of the air around the ball, Pa.
      real(wp) :: ambient = 0.0_wp
      !> Ratio of specific heats.
      real(wp) :: exponent = 1.0_wp
   end type cavity_type

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
      body%cavity = cavity_type(get_volume(mesh%r(:, 0), mesh%z(:, 0)), ball%ambient_pressure + ball%gauge_pressure, &
         ball%ambient_pressure, ball%heat_capacity_ratio)
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
      type(strain_type) :: strain
      type(stress_type) :: stress
      type(branch_step_type) :: step(size(body%material%branch_time))
      real(wp), dimension(n_lane) :: energy, loss, lowest
      real(wp) :: volume
      integer :: b, k, last

      last = body%mesh%n_polar
      force = 0.0_wp
      energy = 0.0_wp
      loss = 0.0_wp
      lowest = 1.0_wp
      ! Lanes without an element stay undeformed.
      strain%f = spread([1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 1.0_wp], 1, n_lane)
      strain%rate = 0.0_wp
      associate (material => body%material)
         step = new_branch_step(material%branch_modulus, material%branch_time, interval)
         do k = 1, size(body%blocks)
            associate (block => body%blocks(k), i => body%blocks(k)%ring)
               call get_gradients(block, last, position(:, i - 1:i, 1), position(:, i - 1:i, 2), strain%f)
               if (material%viscosity > 0.0_wp) call get_gradients(block, last, velocity(:, i - 1:i, 1), &
                  velocity(:, i - 1:i, 2), strain%rate)
               call set_strain(strain)
               call set_elastic_stress(block, material, strain, stress)
               do b = 1, size(step)
                  call add_branch_stress(step(b), strain, body%viscous(:, :, b, k), stress)
               end do
               call set_nominal_stress(block%weight, strain, stress)
               if (material%viscosity > 0.0_wp) call add_viscous_stress(material%viscosity, block%weight, strain, stress)
               call add_nodal_forces(block, last, stress%nominal, force(:, i - 1:i, 1), force(:, i - 1:i, 2))
               energy = energy + block%weight*stress%density
               loss = loss + block%weight*stress%power
               lowest = merge(strain%jacobian, lowest, strain%jacobian < lowest)
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

   !> Volume inside a surface of frustums, m3.
   pure function get_volume(r, z) result(volume)
      !> Distances of the nodes from the axis, m: [0:n].
      real(wp), intent(in) :: r(0:)
      !> Heights of the nodes, from the lowest to the highest pole, m: [0:n].
      real(wp), intent(in) :: z(0:)
      real(wp) :: volume
      integer :: n

      n = ubound(r, 1)
      volume = pi/3*sum((r(:n - 1)**2 + r(:n - 1)*r(1:) + r(1:)**2)*(z(1:) - z(:n - 1)))
   end function get_volume

   !> Overpressure of the gas.
   pure function get_gas_pressure(cavity, volume) result(pressure)
      type(cavity_type), intent(in) :: cavity
      !> Volume, above 0, m3.
      real(wp), intent(in) :: volume
      !> Pressure above that of the air around the ball, Pa.
      real(wp) :: pressure

      pressure = cavity%pressure*(cavity%volume/volume)**cavity%exponent - cavity%ambient
   end function get_gas_pressure

   !> Work that changes the volume from that at first touch, done on the gas and on the air around the ball, J.
   pure function get_gas_energy(cavity, volume) result(energy)
      type(cavity_type), intent(in) :: cavity
      !> Volume, above 0, m3.
      real(wp), intent(in) :: volume
      real(wp) :: energy
      real(wp) :: ratio

      ratio = cavity%volume/volume
      associate (power => cavity%exponent - 1)
         if (power > 1.0e-6_wp) then
            energy = cavity%pressure*cavity%volume*(ratio**power - 1)/power
         else
            energy = cavity%pressure*cavity%volume*log(ratio)
         end if
      end associate
      energy = energy + cavity%ambient*(volume - cavity%volume)
   end function get_gas_energy

   !> Adds the forces of an overpressure: its product with the gradient of the volume.
   pure subroutine add_gas_forces(pressure, r, z, force_r, force_z)
      !> Overpressure, Pa.
      real(wp), intent(in) :: pressure
      !> Distances of the nodes of the inner surface from the axis, m: [0:n].
      real(wp), intent(in) :: r(0:)
      !> Their heights, m: [0:n].
      real(wp), intent(in) :: z(0:)
      !> Forces outwards, N: [0:n].
      real(wp), intent(inout) :: force_r(0:)
      !> Forces upwards, N: [0:n].
      real(wp), intent(inout) :: force_z(0:)
      real(wp) :: scale, area
      integer :: j

      scale = pressure*pi/3
      do j = 1, ubound(r, 1)
         area = r(j - 1)**2 + r(j - 1)*r(j) + r(j)**2
         force_z(j - 1) = force_z(j - 1) - scale*area
         force_z(j) = force_z(j) + scale*area
         force_r(j - 1) = force_r(j - 1) + scale*(2*r(j - 1) + r(j))*(z(j) - z(j - 1))
         force_r(j) = force_r(j) + scale*(2*r(j) + r(j - 1))*(z(j) - z(j - 1))
      end do
   end subroutine add_gas_forces

end module thud_elastic_body
