!> Quasi-static compression of the modal ball: the static flexibility of all harmonics, with the long-term modulus, under
!> unilateral contact with two plates.
module thud_modal_compression
   use thud_ball, only: ball_type
   use thud_error, only: error_type, numerical_error
   use thud_interrupt, only: check_interrupt
   use thud_kinds, only: wp
   use thud_modal_ball_options, only: modal_ball_options_type
   use thud_modal_damping, only: set_damping
   use thud_mode_step, only: mode_step_type
   use thud_ring_contact, only: new_ring_contact, ring_contact_type, solve_contact, update_sticking
   use thud_sphere_modes, only: basis_type, family_type, get_static_family, new_basis
   use thud_surface_rings, only: greatest_angle, new_surface_rings, surface_rings_type
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: compress_modal_ball, new_press

   !> Maximum approach of the plates in a step with sticking rings, as a fraction of the outer radius.
   real(wp), parameter :: max_step = 1.0e-3_wp

contains

   !> Force on each of two plates as a function of their approach.
   subroutine compress_modal_ball(ball, options, deflection, force, error)
      type(ball_type), intent(in) :: ball
      !> Harmonics and rings.
      class(modal_ball_options_type), intent(in) :: options
      !> Approach of the plates, ascending, m: [n].
      real(wp), intent(in) :: deflection(:)
      !> The force, N: [n].
      real(wp), intent(out) :: force(:)
      !> Set if the rings cannot be distinguished, or if the ball lies on the outermost one.
      type(error_type), allocatable, intent(out) :: error
      type(surface_rings_type) :: rings
      type(ring_contact_type) :: contact
      real(wp), allocatable :: reference_gap(:), gap(:)
      real(wp) :: before, now
      integer :: i, k, n_step

      force = 0.0_wp
      rings = new_surface_rings(options%get_ring_count(), greatest_angle, options%floor_friction == 'stick')
      call new_press(ball, options, rings, contact, error)
      if (allocated(error)) return
      allocate (reference_gap(size(contact%force)), gap(size(contact%force)), source=0.0_wp)
      reference_gap(::rings%n_dof) = ball%outer_radius*(1 - rings%height)
      before = 0.0_wp
      do i = 1, size(deflection)
         ! With sticking rings the result depends on the path.
         n_step = 1
         if (rings%n_dof == 2) n_step = 1 + int((deflection(i) - before)/(max_step*ball%outer_radius))
         do k = 1, n_step
            call check_interrupt(error)
            if (allocated(error)) return
            now = before + (deflection(i) - before)*k/n_step
            gap = reference_gap
            gap(::rings%n_dof) = gap(::rings%n_dof) - now/2
            call solve_contact(contact, gap, error)
            if (allocated(error)) return
            call update_sticking(contact, reference_gap)
         end do
         before = deflection(i)
         if (contact%outermost == size(rings%radius)) then
            error = numerical_error('&compression: max_deflection: at '//to_text(deflection(i)) &
               //' m the ball lies on its outermost ring; allowed: less')
            return
         end if
         force(i) = sum(contact%force(::rings%n_dof))
      end do
   end subroutine compress_modal_ball

   !> Contact of the rings.
   subroutine new_press(ball, options, rings, contact, error)
      type(ball_type), intent(in) :: ball
      !> Harmonics and rings.
      class(modal_ball_options_type), intent(in) :: options
      type(surface_rings_type), intent(in) :: rings
      !> The contact.
      type(ring_contact_type), intent(out) :: contact
      !> Set if the rings cannot be distinguished.
      type(error_type), allocatable, intent(out) :: error
      type(basis_type) :: basis
      type(family_type) :: family
      real(wp) :: response(size(rings%shape_at_ring, 1), size(rings%shape_at_ring, 1))
      type(ball_type) :: relaxed
      type(mode_step_type) :: no_modes
      real(wp) :: no_damping(0)
      logical :: failed
      integer :: n

      ! Only for the ratio of long-term modulus to storage modulus.
      allocate (no_modes%omega(0))
      call set_damping(options, no_modes, no_damping)
      relaxed = ball
      relaxed%youngs_modulus = no_modes%equilibrium_ratio*ball%youngs_modulus
      basis = new_basis(relaxed, ubound(rings%shape_at_ring, 3), options%cavity_gas)
      response = 0.0_wp
      ! Equal forces on both poles double the response of even harmonics and cancel that of odd ones.
      do n = 0, ubound(rings%shape_at_ring, 3), 2
         call get_static_family(basis, n, family, failed)
         if (failed) exit
         associate (shape_at_ring => rings%shape_at_ring(:, :, n))
            response = response + 2*matmul(shape_at_ring, matmul(family%flexibility, transpose(shape_at_ring)))
         end associate
      end do
      if (.not. failed) call new_ring_contact(response, rings%n_dof, contact, failed)
      if (failed) error = numerical_error('&modal_ball: rings = '//to_text(size(rings%radius)) &
         //' cannot be distinguished; allowed: fewer rings')
   end subroutine new_press

end module thud_modal_compression
