!> Unilateral contact of surface rings with a plane: impulses p >= 0 and gaps g + A p >= 0 of
!> which one is zero for every ring, a linear complementarity problem.
module thud_ring_contact
   use thud_error, only: error_type, numerical_error
   use thud_kinds, only: wp
   use thud_lapack, only: dposv, dpotrf, dtrsv
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: new_ring_contact, ring_contact_type, solve_contact

   !> Gap that counts as closed, m: rounding of heights.
   real(wp), parameter :: closed = 1.0e-12_wp

   !> Rounds of the search for the touching rings.
   integer, parameter :: max_rounds = 200

   !> Rings, ordered from the lowest point outwards.
   type :: ring_contact_type
      !> Gap by unit impulses, m/(N s): [n_ring, n_ring].
      real(wp), allocatable :: response(:, :)
      !> Its Cholesky factor. The touching rings are nearly always the first ones, and the factor of
      !> a leading block is the leading block of the factor: [n_ring, n_ring].
      real(wp), allocatable :: factor(:, :)
      !> Impulse of each ring in the last step, N s: [n_ring].
      real(wp), allocatable :: impulse(:)
      !> Rings that touched in the last step: [n_ring].
      logical, allocatable :: touches(:)
      !> Number of the outermost ring that touches, 0 for none.
      integer :: last = 0
   end type ring_contact_type

contains

   !> Prepares the contact.
   subroutine new_ring_contact(response, contact, failed)
      !> Gap by unit impulses, symmetric, m/(N s): [n_ring, n_ring].
      real(wp), intent(in) :: response(:, :)
      !> The contact, nothing touching.
      type(ring_contact_type), intent(out) :: contact
      !> The response is not positive definite.
      logical, intent(out) :: failed
      integer :: n, info

      n = size(response, 1)
      allocate (contact%response, source=response)
      allocate (contact%factor, source=response)
      allocate (contact%impulse(n), source=0.0_wp)
      allocate (contact%touches(n), source=.false.)
      call dpotrf('L', n, contact%factor, n, info)
      failed = info /= 0
   end subroutine new_ring_contact

   !> Impulses of one step, by the active set of the step before.
   subroutine solve_contact(contact, gap, error)
      !> The contact; impulses and touching rings are those of this step afterwards.
      type(ring_contact_type), intent(inout) :: contact
      !> Gaps without contact, m: [n_ring].
      real(wp), intent(in) :: gap(:)
      !> The touching rings were not found.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: after(size(gap))
      logical :: wrong(size(gap))
      integer :: round, first_wrong
      logical :: failed

      if (.not. any(contact%touches)) contact%touches = gap < 0.0_wp
      do round = 1, max_rounds
         call close_gaps(contact, gap, failed)
         if (failed) exit
         if (contact%last == 0) then
            after = gap
         else
            after = gap + matmul(contact%response(:, :contact%last), contact%impulse(:contact%last))
         end if
         wrong = merge(contact%impulse < 0.0_wp, after < -closed, contact%touches)
         if (.not. any(wrong)) return
         if (round < max_rounds/2) then
            contact%touches = contact%touches .neqv. wrong
         else
            ! One ring at a time cannot cycle (Murty's rule).
            first_wrong = findloc(wrong, .true., dim=1)
            contact%touches(first_wrong) = .not. contact%touches(first_wrong)
         end if
      end do
      error = numerical_error('&modal_ball: rings: the rings that touch were not found in '//to_text(max_rounds) &
         //' rounds; allowed: fewer rings, or more substeps')
   end subroutine solve_contact

   !> Impulses that close the gaps of the touching rings.
   subroutine close_gaps(contact, gap, failed)
      type(ring_contact_type), intent(inout) :: contact
      !> Gaps without contact, m: [n_ring].
      real(wp), intent(in) :: gap(:)
      !> The response of the touching rings is not positive definite.
      logical, intent(out) :: failed
      real(wp), allocatable :: matrix(:, :), solution(:, :)
      integer, allocatable :: touching(:)
      integer :: i, n, info

      n = count(contact%touches)
      contact%last = findloc(contact%touches, .true., dim=1, back=.true.)
      contact%impulse = 0.0_wp
      failed = .false.
      if (n == 0) return
      if (contact%last == n) then
         contact%impulse(:n) = -gap(:n)
         call dtrsv('L', 'N', 'N', n, contact%factor, size(gap), contact%impulse, 1)
         call dtrsv('L', 'T', 'N', n, contact%factor, size(gap), contact%impulse, 1)
      else
         allocate (touching(n), matrix(n, n), solution(n, 1))
         touching = pack([(i, i=1, size(gap))], contact%touches)
         matrix = contact%response(touching, touching)
         solution(:, 1) = -gap(touching)
         call dposv('L', n, 1, matrix, n, solution, n, info)
         failed = info /= 0
         if (.not. failed) contact%impulse(touching) = solution(:, 1)
      end if
   end subroutine close_gaps

end module thud_ring_contact
