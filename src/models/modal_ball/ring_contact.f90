!> Unilateral contact of surface rings with a plane: forces f >= 0 and gaps g + A f >= 0, one of which is zero for every
!> ring, a linear complementarity problem.
!>
!> Sticking rings have a tangential gap, to the position where the ring began to stick, and a tangential force of any sign.
!> This force closes the tangential gap of the rings that touched in the previous step: this set does not depend on the
!> unknowns, so the solution is unique, and the error of a ring that begins or ceases to stick one step late is proportional
!> to the step.
module thud_ring_contact
   use thud_error, only: error_type, numerical_error
   use thud_kinds, only: wp
   use thud_lapack, only: dposv, dpotrf, dtrsm
   use thud_product, only: add_product
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: new_ring_contact, ring_contact_type, solve_contact, update_sticking

   !> Penetration that counts as none, m: rounding of heights.
   real(wp), parameter :: penetration_tolerance = 1.0e-12_wp

   !> Maximum number of rounds in the search for the touching rings.
   integer, parameter :: max_rounds = 200

   !> Rings, ordered from the lowest point outwards.
   type :: ring_contact_type
      !> Degrees of freedom of a ring: 1, or 2 if it sticks; the gaps of a ring are adjacent, the normal one first.
      integer :: n_dof = 1
      !> Gaps due to unit forces, m/N: [n_gap, n_gap].
      real(wp), allocatable :: response(:, :)
      !> Inverse of the Cholesky factor L of the response, and its transpose: [n_gap, n_gap]. The touching rings are nearly
      !> always the first ones, and the inverse of a leading block of L is the leading block of the inverse.
      real(wp), allocatable :: inverse(:, :), transposed(:, :)
      !> Forces in the last step, N, and gaps after it, m: [n_gap].
      real(wp), allocatable :: force(:), gap(:)
      !> Rings that touched in the last step, and rings that stick: [n_ring].
      logical, allocatable :: touches(:), sticks(:)
      !> Index of the outermost ring that touches, and of the last gap that a force closed; 0 for none.
      integer :: outermost = 0, last_closed_gap = 0
      !> Workspace of a step: gaps that forces close, rings whose state is wrong, and a right-hand side: [n_gap].
      integer, allocatable :: indices(:)
      logical, allocatable :: wrong(:)
      real(wp), allocatable :: right(:)
   end type ring_contact_type

contains

   !> Prepares the contact.
   subroutine new_ring_contact(response, n_dof, contact, error)
      !> Gaps due to unit forces, symmetric, m/N: [n_gap, n_gap].
      real(wp), intent(in) :: response(:, :)
      !> Degrees of freedom of a ring.
      integer, intent(in) :: n_dof
      !> The contact; no ring touches.
      type(ring_contact_type), intent(out) :: contact
      !> Set if the response is not positive definite.
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: factor(:, :)
      integer :: i, n, info

      n = size(response, 1)
      allocate (contact%response, source=response)
      contact%n_dof = n_dof
      allocate (contact%force(n), contact%gap(n), contact%right(n), contact%inverse(n, n), source=0.0_wp)
      allocate (contact%touches(n/n_dof), contact%sticks(n/n_dof), contact%wrong(n/n_dof), source=.false.)
      allocate (contact%indices(n), source=0)
      factor = response
      call dpotrf('L', n, factor, n, info)
      if (info /= 0) then
         error = numerical_error('= '//to_text(n/n_dof)//' cannot be distinguished; allowed: fewer rings, or more ' &
            //'substeps', 'modal_ball', 'rings')
         return
      end if
      do i = 1, n
         contact%inverse(i, i) = 1.0_wp
      end do
      call dtrsm('L', 'L', 'N', 'N', n, n, 1.0_wp, factor, n, contact%inverse, n)
      contact%transposed = transpose(contact%inverse)
   end subroutine new_ring_contact

   !> Forces of one step, by an active set that starts from the previous step.
   subroutine solve_contact(contact, gap, error)
      !> The contact; forces and touching rings of this step are set here.
      type(ring_contact_type), intent(inout) :: contact
      !> Gaps without contact, m: [n_gap].
      real(wp), intent(in), contiguous :: gap(:)
      !> Set if the touching rings were not found.
      type(error_type), allocatable, intent(out) :: error
      integer :: round, first_wrong
      logical :: failed

      if (.not. any(contact%touches)) contact%touches = gap(::contact%n_dof) < 0.0_wp
      do round = 1, max_rounds
         call close_gaps(contact, gap, failed)
         if (failed) exit
         contact%gap = gap
         call add_product(contact%response(:, :contact%last_closed_gap), contact%force, contact%gap)
         contact%wrong = merge(contact%force(::contact%n_dof) < 0.0_wp, &
            contact%gap(::contact%n_dof) < -penetration_tolerance, contact%touches)
         if (.not. any(contact%wrong)) return
         if (round < max_rounds/2) then
            contact%touches = contact%touches .neqv. contact%wrong
         else
            ! Changing one ring at a time cannot cycle (Murty's rule).
            first_wrong = findloc(contact%wrong, .true., dim=1)
            contact%touches(first_wrong) = .not. contact%touches(first_wrong)
         end if
      end do
      error = numerical_error('the rings that touch were not found in '//to_text(max_rounds)//' rounds; allowed: fewer ' &
         //'rings, or more substeps', 'modal_ball')
   end subroutine solve_contact

   !> Makes the rings that touch at the end of a step stick there.
   pure subroutine update_sticking(contact, reference_gap)
      type(ring_contact_type), intent(inout) :: contact
      !> Gaps without motion, m: [n_gap]. For rings that do not stick yet, the tangential gaps are shifted to zero in the
      !> present position.
      real(wp), intent(inout) :: reference_gap(:)

      if (contact%n_dof == 1) return
      where (.not. contact%sticks)
         reference_gap(2::2) = reference_gap(2::2) - contact%gap(2::2)
         contact%gap(2::2) = 0.0_wp
      end where
      contact%sticks = contact%touches
   end subroutine update_sticking

   !> Forces that close the normal gaps of touching rings and the tangential gaps of sticking rings.
   subroutine close_gaps(contact, gap, failed)
      type(ring_contact_type), intent(inout) :: contact
      real(wp), intent(in) :: gap(:)
      !> Whether the response of these gaps is not positive definite.
      logical, intent(out) :: failed
      real(wp), allocatable :: matrix(:, :), solution(:, :)
      integer :: i, n, info

      n = 0
      contact%outermost = 0
      associate (n_dof => contact%n_dof)
         do i = 1, size(contact%touches)
            if (contact%touches(i)) then
               contact%outermost = i
               n = n + 1
               contact%indices(n) = n_dof*(i - 1) + 1
            end if
            if (n_dof == 2 .and. contact%sticks(i)) then
               n = n + 1
               contact%indices(n) = 2*i
            end if
         end do
      end associate
      contact%force = 0.0_wp
      contact%last_closed_gap = 0
      failed = .false.
      if (n == 0) return
      contact%last_closed_gap = contact%indices(n)
      if (contact%last_closed_gap == n) then
         contact%right(:n) = 0.0_wp
         call add_product(contact%inverse(:, :n), gap, contact%right(:n))
         contact%right(:n) = -contact%right(:n)
         call add_product(contact%transposed(:, :n), contact%right, contact%force(:n))
      else
         associate (indices => contact%indices(:n))
            matrix = contact%response(indices, indices)
            allocate (solution(n, 1))
            solution(:, 1) = -gap(indices)
            call dposv('L', n, 1, matrix, n, solution, n, info)
            failed = info /= 0
            if (.not. failed) contact%force(indices) = solution(:, 1)
         end associate
      end if
   end subroutine close_gaps

end module thud_ring_contact
