!> The deforming ball: nodes, masses, material and gas, and the forces on its nodes.
module thud_elastic_body
   use thud_ball, only: ball_type
   use thud_cavity, only: add_gas_forces, cavity_type, get_gas_energy, get_gas_pressure, get_volume, new_cavity
   use thud_element_row, only: add_nodal_forces, element_row_type, get_gradients, n_component, n_point, n_symmetric, &
      new_element_row
   use thud_kinds, only: wp
   use thud_material, only: material_type
   use thud_maxwell_branches, only: add_branch_stress
   use thud_mesh, only: mesh_type
   use thud_rubber, only: add_viscous_stress, get_elastic_stress, get_volume_ratios
   implicit none (type, external)
   private

   public :: body_state_type, cavity_closed, elastic_body_type, element_inverted, get_internal_forces, new_elastic_body, &
      no_failure

   !> Reasons why forces cannot be computed.
   integer, parameter :: no_failure = 0, element_inverted = 1, cavity_closed = 2

   !> The ball; arrays over nodes are [0:n_polar, 0:n_radial], components r and z last.
   type :: elastic_body_type
      !> Mesh of order 1, undeformed, around the origin.
      type(mesh_type) :: mesh
      !> Rings of elements of the mesh: [n_radial].
      type(element_row_type), allocatable :: row(:)
      type(material_type) :: material
      type(cavity_type) :: cavity
      !> Masses of the nodes, kg.
      real(wp), allocatable :: mass(:, :)
      !> Viscous tensor of each Maxwell branch: [n_polar, symmetric, point, branch, n_radial].
      real(wp), allocatable :: viscous(:, :, :, :, :)
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
      !> Mesh of order 1.
      type(mesh_type), intent(in) :: mesh
      type(material_type), intent(in) :: material
      type(elastic_body_type) :: body
      integer :: i, n

      n = mesh%n_polar
      body%mesh = mesh
      body%material = material
      body%cavity = new_cavity(ball, mesh%r(:, 0), mesh%z(:, 0))
      allocate (body%row(mesh%n_radial))
      allocate (body%mass(0:n, 0:mesh%n_radial), source=0.0_wp)
      do i = 1, mesh%n_radial
         body%row(i) = new_element_row(mesh, i - 1)
         body%mass(:n - 1, i - 1) = body%mass(:n - 1, i - 1) + body%row(i)%nodal_volume(:, 1)
         body%mass(:n - 1, i) = body%mass(:n - 1, i) + body%row(i)%nodal_volume(:, 2)
         body%mass(1:, i - 1) = body%mass(1:, i - 1) + body%row(i)%nodal_volume(:, 3)
         body%mass(1:, i) = body%mass(1:, i) + body%row(i)%nodal_volume(:, 4)
      end do
      ! The mesh is a little smaller than the sphere; the mass is that of the ball.
      body%mass = body%mass*(ball%mass/sum(body%mass))
      allocate (body%viscous(n, n_symmetric, n_point, size(material%branch_time), mesh%n_radial), source=0.0_wp)
      body%viscous(:, 1:3, :, :, :) = 1.0_wp
   end function new_elastic_body

   !> Nodal forces of stress and gas.
   pure subroutine get_internal_forces(body, position, velocity, interval, commit, force, state)
      !> The body; its viscous tensors are updated on commit.
      type(elastic_body_type), intent(inout) :: body
      !> Positions of the nodes, m: [0:n_polar, 0:n_radial, 2].
      real(wp), intent(in), contiguous :: position(0:, 0:, :)
      !> Velocities of the nodes, m/s: the same shape.
      real(wp), intent(in), contiguous :: velocity(0:, 0:, :)
      !> Length of the step, s.
      real(wp), intent(in) :: interval
      !> Whether the viscous tensors advance to the end of the step.
      logical, intent(in) :: commit
      !> Forces, N: the same shape as the positions.
      real(wp), intent(out), contiguous :: force(0:, 0:, :)
      !> Energies and power.
      type(body_state_type), intent(out) :: state
      real(wp) :: f(body%mesh%n_polar, n_component, n_point), rate(body%mesh%n_polar, n_component, n_point)
      real(wp) :: stress(body%mesh%n_polar, n_component, n_point), cofactor(body%mesh%n_polar, n_component, n_point)
      real(wp) :: volume
      real(wp) :: jacobian(body%mesh%n_polar, n_point)
      integer :: i, n

      n = body%mesh%n_polar
      force = 0.0_wp
      do i = 1, body%mesh%n_radial
         associate (row => body%row(i), material => body%material)
            call get_gradients(row, n, position(:, i - 1:i, 1), position(:, i - 1:i, 2), f)
            call get_volume_ratios(n, f, cofactor, jacobian)
            state%min_jacobian = min(state%min_jacobian, minval(jacobian))
            if (.not. state%min_jacobian > 0.0_wp) then
               state%failure = element_inverted
               return
            end if
            call get_elastic_stress(n, material%shear_modulus, material%mooney_share, material%bulk_modulus, row%weight, &
               row%volume, f, cofactor, jacobian, stress, state%strain_energy)
            if (material%viscosity > 0.0_wp) then
               call get_gradients(row, n, velocity(:, i - 1:i, 1), velocity(:, i - 1:i, 2), rate)
               call add_viscous_stress(n, material%viscosity, row%weight, rate, cofactor, jacobian, stress, &
                  state%dissipation)
            end if
            if (size(material%branch_time) > 0) call add_branch_stress(n, material%branch_modulus, material%branch_time, &
               interval, commit, row%weight, f, cofactor, jacobian, body%viscous(:, :, :, :, i), stress, &
               state%strain_energy, state%dissipation)
            call add_nodal_forces(row, n, stress, force(:, i - 1:i, 1), force(:, i - 1:i, 2))
         end associate
      end do
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
      force(n, :, 1) = 0.0_wp
   end subroutine get_internal_forces

end module thud_elastic_body
