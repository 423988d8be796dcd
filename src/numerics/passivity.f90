!> Passivity of a rational mobility or admittance: its real part must not be negative at any frequency.
module thud_passivity
   use thud_ascending, only: get_ascending_order
   use thud_interrupt, only: is_interrupted
   use thud_kinds, only: wp
   use thud_lapack, only: dposv, zgeev
   use thud_vector_fit, only: get_basis, get_residues, get_response
   implicit none (type, external)
   private

   public :: find_violations, make_passive, solve_dual

   !> Maximum number of rounds of the correction; each round adds the worst frequencies of the previous one.
   integer, parameter :: n_round = 30

   !> Maximum number of sweeps of Hildreth's method.
   integer, parameter :: max_sweeps = 2000

   !> Minimum of the corrected real part, divided by the mean magnitude: above rounding.
   real(wp), parameter :: margin = 1.0e-9_wp

   !> Ridge added to the unit diagonal of the normal equations, which close poles make singular.
   real(wp), parameter :: ridge = 1.0e-12_wp

   !> Number of golden sections in the search for a minimum; each leaves 0.618 of the interval.
   integer, parameter :: n_section = 60

contains

   !> Frequencies of the negative minima of the real part, one for each interval in which it is negative.
   !>
   !> In the state space A, b, c, d, here with the poles on a diagonal A, the squares of the frequencies at which the real
   !> part vanishes are eigenvalues of A (b c/d - A) (half-size test; Gustavsen and Semlyen, IEEE Trans. Power Delivery 24,
   !> 2009). Between two such frequencies the sign of the real part does not change.
   subroutine find_violations(pole, residue, direct, omega, failed)
      !> Poles, 1/s, and residues, doubled for pairs: [n].
      complex(wp), intent(in) :: pole(:), residue(:)
      !> Constant part, above 0.
      real(wp), intent(in) :: direct
      !> The angular frequencies, rad/s: [n_violation].
      real(wp), allocatable, intent(out) :: omega(:)
      !> True if LAPACK finds no eigenvalues.
      logical, intent(out) :: failed
      complex(wp), dimension(size(pole) + count(aimag(pole) > 0.0_wp)) :: a, c, square
      complex(wp) :: half(size(pole)), left(1, 1), right(1, 1)
      complex(wp), allocatable :: matrix(:, :), work(:)
      real(wp), allocatable :: border(:), real_work(:)
      real(wp) :: scale
      integer :: info, j, n

      scale = maxval(abs(pole))
      a = [pole, pack(conjg(pole), pole%im > 0.0_wp)]/scale
      half = merge(residue/2, residue, pole%im > 0.0_wp)
      c = [half, pack(conjg(half), pole%im > 0.0_wp)]/scale
      n = size(a)
      matrix = spread(a, 2, n)*spread(c/direct, 1, n)
      do j = 1, n
         matrix(j, j) = matrix(j, j) - a(j)**2
      end do
      allocate (omega(0), work(33*n), real_work(2*n))
      failed = .not. all(abs(matrix) <= huge(1.0_wp))
      if (failed) return
      call zgeev('N', 'N', n, matrix, n, square, left, 1, right, 1, work, size(work), real_work, info)
      failed = info /= 0
      if (failed) return
      ! Candidates that are no zeros do no harm; zeros that rounding has moved off the real axis must not be missed.
      border = pack(sqrt(abs(square)), square%re > 0.0_wp)
      border = scale*[0.0_wp, border(get_ascending_order(border))]
      border = [border, 2*max(border(size(border)), scale)]
      do j = 1, size(border) - 1
         associate (middle => get_minimum(pole, residue, direct, border(j), border(j + 1)))
            if (real(get_response(pole, residue, direct, middle)) < 0.0_wp) omega = [omega, middle]
         end associate
      end do
   end subroutine find_violations

   !> Changes residues and constant part as little as possible, in weighted squares at given frequencies, so that the real
   !> part is nowhere negative.
   subroutine make_passive(frequency, weight, pole, residue, direct, failed)
      !> Angular frequencies, rad/s, and weights of the change there: [n_frequency].
      real(wp), intent(in) :: frequency(:), weight(:)
      !> Poles, 1/s: [n].
      complex(wp), intent(in) :: pole(:)
      !> Residues, doubled for pairs: [n].
      complex(wp), intent(inout) :: residue(:)
      !> Constant part.
      real(wp), intent(inout) :: direct
      !> True if LAPACK finds no eigenvalues, violations remain, or an interrupt came.
      logical, intent(out) :: failed
      real(wp), allocatable :: normal(:, :), omega(:), constrained(:), x(:), length(:)
      complex(wp), allocatable :: basis(:, :)
      real(wp) :: minimum
      integer :: i, j, n

      call get_basis(pole, cmplx(0.0_wp, frequency, wp), basis)
      n = size(basis, 2)
      allocate (length(n))
      do i = 1, n
         length(i) = norm2(weight*abs(basis(:, i)))
         basis(:, i) = weight*basis(:, i)/length(i)
      end do
      normal = real(matmul(conjg(transpose(basis)), basis))
      do i = 1, n
         normal(i, i) = normal(i, i) + ridge
      end do
      minimum = margin*sum(abs([(get_response(pole, residue, direct, frequency(i)), i=1, size(frequency))]))/size(frequency)
      allocate (constrained(0), x(n))
      do i = 1, 2*n_round
         direct = max(direct, minimum)
         call find_violations(pole, residue, direct, omega, failed)
         failed = failed .or. is_interrupted()
         if (failed .or. size(omega) == 0) return
         if (i <= n_round) then
            constrained = [constrained, omega]
            x = get_correction(pole, residue, direct, constrained, normal, length, minimum)
            residue = residue + get_residues(pole, x(:n - 1))
            direct = direct + x(n)
         else
            ! The remaining violations are within the rounding of the corrections; a larger constant part ends them.
            direct = direct + minimum - minval([(real(get_response(pole, residue, direct, omega(j))), j=1, size(omega))])
         end if
      end do
      failed = .true.
   end subroutine make_passive

   !> Smallest change x of the coefficients, measured by x' N x, that raises the real part to `minimum` at some frequencies.
   function get_correction(pole, residue, direct, omega, normal, length, minimum) result(x)
      !> Poles, 1/s, and residues, doubled for pairs: [n].
      complex(wp), intent(in) :: pole(:), residue(:)
      !> Constant part.
      real(wp), intent(in) :: direct
      !> The angular frequencies, rad/s: [n_constrained].
      real(wp), intent(in) :: omega(:)
      !> N for basis functions scaled to unit length: [n_x, n_x]; their weighted lengths before scaling: [n_x].
      real(wp), intent(in) :: normal(:, :), length(:)
      !> Minimum of the real part.
      real(wp), intent(in) :: minimum
      !> Changes of the coefficients and of the constant part: [n_x].
      real(wp) :: x(size(length))
      complex(wp), allocatable :: basis(:, :)
      real(wp) :: factor(size(length), size(length)), rows(size(length), size(omega)), solved(size(length), size(omega))
      real(wp) :: gram(size(omega), size(omega)), deficit(size(omega)), multiplier(size(omega))
      integer :: i, n_sweep, info

      call get_basis(pole, cmplx(0.0_wp, omega, wp), basis)
      do i = 1, size(omega)
         rows(:, i) = real(basis(i, :))/length
         deficit(i) = minimum - real(get_response(pole, residue, direct, omega(i)))
      end do
      factor = normal
      solved = rows
      call dposv('U', size(length), size(omega), factor, size(length), solved, size(length), info)
      x = 0.0_wp
      if (info /= 0) return
      gram = matmul(transpose(rows), solved)
      call solve_dual(gram, deficit, multiplier, n_sweep)
      x = matmul(solved, multiplier)/length
   end function get_correction

   !> Multipliers of constraints, none of them negative, that raise every constraint by at least its deficit, and by exactly
   !> that if its multiplier is positive: Hildreth's method.
   subroutine solve_dual(gram, deficit, multiplier, n_sweep)
      !> gram(i, j): change of constraint i by a unit multiplier of constraint j; symmetric: [n, n].
      real(wp), intent(in), contiguous :: gram(:, :)
      !> Deficits of the constraints: [n].
      real(wp), intent(in) :: deficit(:)
      !> The multipliers: [n].
      real(wp), intent(out) :: multiplier(:)
      !> Number of sweeps. The last sweep changed nothing, unless it is `max_sweeps` or an interrupt came.
      integer, intent(out) :: n_sweep
      real(wp) :: before(size(multiplier))
      integer :: i

      multiplier = 0.0_wp
      do n_sweep = 1, max_sweeps
         before = multiplier
         do i = 1, size(multiplier)
            multiplier(i) = max(0.0_wp, multiplier(i) + (deficit(i) - dot_product(gram(:, i), multiplier))/gram(i, i))
         end do
         if (is_interrupted() .or. maxval(abs(multiplier - before)) <= 0.0_wp) return
      end do
      n_sweep = max_sweeps
   end subroutine solve_dual

   !> Angular frequency of the minimum of the real part in an interval, by golden sections.
   pure function get_minimum(pole, residue, direct, lower, upper) result(omega)
      complex(wp), intent(in) :: pole(:), residue(:)
      !> Constant part; ends of the interval, rad/s.
      real(wp), intent(in) :: direct, lower, upper
      real(wp) :: omega
      real(wp), parameter :: golden = (sqrt(5.0_wp) - 1)/2
      real(wp) :: low, high, lower_trial, upper_trial
      integer :: i

      low = lower
      high = upper
      do i = 1, n_section
         lower_trial = high - golden*(high - low)
         upper_trial = low + golden*(high - low)
         if (real(get_response(pole, residue, direct, lower_trial)) &
            < real(get_response(pole, residue, direct, upper_trial))) then
            high = upper_trial
         else
            low = lower_trial
         end if
      end do
      omega = (low + high)/2
   end function get_minimum

end module thud_passivity
