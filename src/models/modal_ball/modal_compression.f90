!> Static flexibility of the modal ball, and its quasi-static compression: the flexibility of all harmonics, with the
!> long-term modulus, under unilateral contact with two plates.
module thud_modal_compression
   use thud_ball, only: ball_type
   use thud_error, only: error_type, numerical_error
   use thud_interrupt, only: check_interrupt
   use thud_kinds, only: wp
   use thud_ring_contact, only: new_ring_contact, ring_contact_type, solve_contact, update_sticking
   use thud_sphere_modes, only: basis_type, family_type, get_flexibility, new_basis
   use thud_surface_rings, only: get_ring_response, surface_rings_type
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: compress_modal_ball, get_flexibilities, new_press

   !> Maximum approach of the plates in a step with sticking rings, as a fraction of the outer radius.
   real(wp), parameter :: max_step = 1.0e-3_wp

contains

   !> Force on each of two plates as a function of their approach.
   subroutine compress_modal_ball(ball, with_gas, rings, deflection, force, error)
      !> The ball, with the long-term modulus.
      type(ball_type), intent(in) :: ball
      !> Whether the enclosed gas resists changes of its volume.
      logical, intent(in) :: with_gas
      type(surface_rings_type), intent(in) :: rings
      !> Approach of the plates, ascending, m: [n].
      real(wp), intent(in) :: deflection(:)
      !> The force, N: [n].
      real(wp), intent(out) :: force(:)
      !> Set if the rings cannot be distinguished, or if the ball lies on the outermost one.
      type(error_type), allocatable, intent(out) :: error
      type(ring_contact_type) :: contact
      real(wp), allocatable :: reference_gap(:), gap(:)
      real(wp) :: before, now
      integer :: i, k, n_step

      force = 0.0_wp
      call new_press(ball, with_gas, rings, contact, error)
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
            error = numerical_error('is too large: at '//to_text(deflection(i))//' m the ball lies on its outermost ring; ' &
               //'allowed: less', 'compression', 'max_deflection')
            return
         end if
         force(i) = sum(contact%force(::rings%n_dof))
      end do
   end subroutine compress_modal_ball

   !> Contact of the rings.
   subroutine new_press(ball, with_gas, rings, contact, error)
      !> The ball, with the long-term modulus.
      type(ball_type), intent(in) :: ball
      !> Whether the enclosed gas resists changes of its volume.
      logical, intent(in) :: with_gas
      type(surface_rings_type), intent(in) :: rings
      !> The contact.
      type(ring_contact_type), intent(out) :: contact
      !> Set if the rings cannot be distinguished.
      type(error_type), allocatable, intent(out) :: error
      type(family_type) :: no_modes(0)
      real(wp), allocatable :: flexibility(:, :, :)

      call get_flexibilities(ball, with_gas, no_modes, ubound(rings%shape_at_ring, 3), flexibility, error)
      if (allocated(error)) return
      ! Equal forces on both poles double the response of even harmonics and cancel that of odd ones.
      flexibility(:, :, 1::2) = 0.0_wp
      call new_ring_contact(2*get_ring_response(rings, flexibility), rings%n_dof, contact, error)
   end subroutine new_press

   !> Flexibilities of all harmonics up to a highest one, without the modes that oscillate.
   subroutine get_flexibilities(ball, with_gas, families, highest, flexibility, error)
      type(ball_type), intent(in) :: ball
      !> Whether the enclosed gas resists changes of its volume.
      logical, intent(in) :: with_gas
      !> Harmonics that have modes, and their flexibilities: [0:].
      type(family_type), intent(in) :: families(0:)
      !> Highest harmonic.
      integer, intent(in) :: highest
      !> U and V at the outer surface due to unit generalized forces on U and V, m/N: [2, 2, 0:highest].
      real(wp), allocatable, intent(out) :: flexibility(:, :, :)
      !> Set if a flexibility cannot be computed.
      type(error_type), allocatable, intent(out) :: error
      type(basis_type) :: basis
      integer :: n

      ! Higher harmonics have closed forms.
      basis = new_basis(ball, 1, with_gas)
      allocate (flexibility(2, 2, 0:highest))
      do n = 0, highest
         if (n < size(families)) then
            flexibility(:, :, n) = families(n)%flexibility
         else
            call get_flexibility(basis, n, flexibility(:, :, n), error)
            if (allocated(error)) return
         end if
      end do
   end subroutine get_flexibilities

end module thud_modal_compression
