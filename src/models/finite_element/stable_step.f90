!> The stability limit of the central differences, from the equations of motion themselves.
!>
!> With velocities half a step behind, the step dt is stable while dt**2 K + 2 dt C <= 4 M for the tangents K and C of
!> elasticity and viscosity. The stability ratio is the maximum eigenvalue of the left side relative to M; it may reach 4.
!> Power iteration finds it, with one evaluation of the forces per iteration. The estimate of the fastest mode is kept
!> between calls, so that a few iterations follow the deforming ball.
module thud_stable_step
   use thud_elastic_body, only: body_state_type, elastic_body_type, get_internal_forces, no_failure
   use thud_floor_contact, only: floor_contact_type, get_contact_stiffness
   use thud_interrupt, only: is_interrupted
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: find_stability_ratio, get_first_direction, max_stability_ratio

   !> Stability ratio at the limit.
   real(wp), parameter :: max_stability_ratio = 4.0_wp

   !> Maximum displacement for which the forces are evaluated, as a fraction of the thickness of an element.
   real(wp), parameter :: trial = 1.0e-6_wp

contains

   !> First estimate of the fastest mode: a mixture of all modes, mainly of the fastest ones: [0:n_polar, 0:n_radial, 2].
   pure function get_first_direction(body) result(direction)
      type(elastic_body_type), intent(in) :: body
      real(wp), allocatable :: direction(:, :, :)
      integer :: i, j, k

      allocate (direction(0:body%mesh%n_polar, 0:body%mesh%n_radial, 2))
      do k = 1, 2
         do i = 0, body%mesh%n_radial
            do j = 0, body%mesh%n_polar
               direction(j, i, k) = (-1)**(i + j)*(1 + 0.5_wp*modulo(0.618_wp*real(j + 7*i + 3*k, wp), 1.0_wp))
            end do
         end do
      end do
      direction(0, :, 1) = 0.0_wp
      direction(body%mesh%n_polar, :, 1) = 0.0_wp
   end function get_first_direction

   !> Stability ratio of a step after some power iterations.
   subroutine find_stability_ratio(body, contact, position, velocity, interval, n_iteration, direction, stability_ratio)
      !> The body; unchanged on return.
      type(elastic_body_type), intent(inout) :: body
      type(floor_contact_type), intent(in) :: contact
      !> Positions of the nodes, m: [0:n_polar, 0:n_radial, 2].
      real(wp), intent(in), contiguous :: position(0:, 0:, :)
      !> Velocities of the nodes, m/s: the same shape.
      real(wp), intent(in), contiguous :: velocity(0:, 0:, :)
      !> Length of the step, s.
      real(wp), intent(in) :: interval
      integer, intent(in) :: n_iteration
      !> Estimate of the fastest mode, improved by each call: the same shape.
      real(wp), intent(inout), contiguous :: direction(0:, 0:, :)
      !> The ratio. The part of the body is a lower bound, close after tens of iterations; the part of the floor is an upper
      !> bound. Huge if there are no forces, or after an interrupt.
      real(wp), intent(out) :: stability_ratio
      real(wp), dimension(0:body%mesh%n_polar, 0:body%mesh%n_radial, 2) :: here, there, product
      real(wp) :: step, thickness
      real(wp) :: mass(0:body%mesh%n_polar, 0:body%mesh%n_radial, 2)
      type(body_state_type) :: state
      integer :: last, iteration

      last = body%mesh%n_radial
      mass = spread(body%mass, 3, 2)
      thickness = body%mesh%z(0, 0) - body%mesh%z(0, 1)
      stability_ratio = huge(stability_ratio)
      call get_internal_forces(body, position, velocity, interval, .false., here, state)
      if (state%failure /= no_failure) return
      do iteration = 1, n_iteration
         direction = direction/sqrt(sum(mass*direction**2))
         ! Amplitude of the trial displacements.
         step = trial*thickness/maxval(abs(direction))
         call get_internal_forces(body, position + step*direction, velocity + 2*step/interval*direction, interval, .false., &
            there, state)
         if (state%failure /= no_failure .or. is_interrupted()) then
            stability_ratio = huge(stability_ratio)
            return
         end if
         product = (here - there)*(interval**2/step)
         stability_ratio = sum(direction*product)
         direction = product/mass
      end do
      ! The maximum over the nodes: any of them may touch the floor at any time.
      stability_ratio = stability_ratio + interval**2*maxval(get_contact_stiffness(contact, position(:, last, &
         1))/body%mass(:, last))
   end subroutine find_stability_ratio

end module thud_stable_step
