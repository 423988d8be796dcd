!> Relaxed vector fitting (Gustavsen and Semlyen, IEEE Trans. Power Delivery 14, 1999; Gustavsen, 21, 2006): fits a stable
!> rational function of frequency with real coefficients, d + sum of r_k/(s - p_k), to values at frequencies.
!>
!> Of a pair of conjugate poles only the pole with positive imaginary part is stored, with twice its residue.
module thud_vector_fit
   use thud_interrupt, only: is_interrupted
   use thud_kinds, only: wp
   use thud_lapack, only: dgeev, dgels
   implicit none (type, external)
   private

   public :: fit_rational, get_basis, get_residues, get_response

   !> Maximum number of relocations of the poles; good data need about five.
   integer, parameter :: max_relocations = 40

   !> Number of relocations without a gain after which the search ends.
   integer, parameter :: stagnation_limit = 6
   !> Minimum relative decrease of the misfit that is a gain.
   real(wp), parameter :: gain = 1.0e-3_wp

   !> Weighted relative root-mean-square error below which only rounding is left to fit.
   real(wp), parameter :: exact = 1.0e-13_wp

   !> Damping ratio of the initial poles (Gustavsen and Semlyen).
   real(wp), parameter :: first_damping = 0.01_wp

   !> Minimum damping ratio: a pole on the imaginary axis would never decay.
   real(wp), parameter :: min_damping = 1.0e-8_wp

   !> Minimum magnitude of the constant term of the weight function (Gustavsen 2006).
   real(wp), parameter :: min_constant = 1.0e-8_wp

contains

   !> Basis functions of a rational function with real coefficients: 1/(s - p) for a real pole, 1/(s - p) + 1/(s - p*) and
   !> i/(s - p) - i/(s - p*) for a pair, and finally 1.
   pure subroutine get_basis(pole, s, basis)
      !> Poles: [n].
      complex(wp), intent(in) :: pole(:)
      !> Complex frequencies: [n_frequency].
      complex(wp), intent(in) :: s(:)
      !> The functions: [n_frequency, order + 1].
      complex(wp), allocatable, intent(out) :: basis(:, :)
      complex(wp), parameter :: i = (0.0_wp, 1.0_wp)
      integer :: j, k, order

      order = size(pole) + count(pole%im > 0.0_wp)
      allocate (basis(size(s), order + 1))
      j = 0
      do k = 1, size(pole)
         j = j + 1
         basis(:, j) = 1/(s - pole(k))
         if (.not. pole(k)%im > 0.0_wp) cycle
         basis(:, j + 1) = i*basis(:, j) - i/(s - conjg(pole(k)))
         basis(:, j) = basis(:, j) + 1/(s - conjg(pole(k)))
         j = j + 1
      end do
      basis(:, j + 1) = 1.0_wp
   end subroutine get_basis

   !> Residues from the coefficients of the basis, doubled for pairs: [n].
   pure function get_residues(pole, coefficient) result(residue)
      !> Poles: [n].
      complex(wp), intent(in) :: pole(:)
      !> Coefficients of the basis: [order].
      real(wp), intent(in) :: coefficient(:)
      complex(wp) :: residue(size(pole))
      integer :: j, k

      j = 0
      do k = 1, size(pole)
         j = j + 1
         residue(k) = coefficient(j)
         if (.not. pole(k)%im > 0.0_wp) cycle
         residue(k) = 2*cmplx(coefficient(j), coefficient(j + 1), wp)
         j = j + 1
      end do
   end function get_residues

   !> Value of a rational function at an angular frequency. Half of a doubled residue belongs to the conjugate pole; both
   !> halves of a real residue are equal.
   pure function get_response(pole, residue, direct, omega) result(response)
      !> Poles, 1/s, and residues, doubled for pairs: [n].
      complex(wp), intent(in) :: pole(:), residue(:)
      !> Constant part, and the frequency, rad/s.
      real(wp), intent(in) :: direct, omega
      complex(wp) :: response

      associate (s => cmplx(0.0_wp, omega, wp))
         response = direct + sum(residue/(s - pole) + conjg(residue)/(s - conjg(pole)))/2
      end associate
   end function get_response

   !> Fits d + sum of r_k/(s - p_k).
   !>
   !> In each relocation, the zeros of a fitted weight function become the new poles; those in the right half plane are
   !> reflected. The initial poles are spaced evenly in frequency or in its logarithm; the better of both fits is returned.
   subroutine fit_rational(omega, response, weight, order, pole, residue, direct, misfit, failed)
      !> Angular frequencies, rad/s, ascending, above 0: [n_frequency].
      real(wp), intent(in) :: omega(:)
      !> Values to fit: [n_frequency].
      complex(wp), intent(in) :: response(:)
      !> Weights of their errors: [n_frequency].
      real(wp), intent(in) :: weight(:)
      !> Number of poles, at most n_frequency - 1; a conjugate pair has two.
      integer, intent(in) :: order
      !> Poles, 1/s, one of each pair, and residues, doubled for pairs: [n].
      complex(wp), allocatable, intent(out) :: pole(:), residue(:)
      !> Constant part.
      real(wp), intent(out) :: direct
      !> Root-mean-square weighted error, relative to the weighted values.
      real(wp), intent(out) :: misfit
      !> True if LAPACK finds no solution or an interrupt ended the search.
      logical, intent(out) :: failed
      complex(wp), allocatable :: candidate(:)
      real(wp), allocatable :: coefficient(:), best(:)
      complex(wp) :: s(size(omega))
      real(wp) :: scale, candidate_misfit
      integer :: i, kind, stagnation

      scale = omega(size(omega))
      s = cmplx(0.0_wp, omega/scale, wp)
      misfit = huge(misfit)
      failed = .true.
      do kind = 1, 2
         candidate = get_first_poles(omega(1)/scale, order, kind == 1)
         stagnation = 0
         do i = 0, max_relocations
            if (is_interrupted()) return
            if (i > 0) call relocate_poles(s, response, weight, candidate, failed)
            if (i > 0 .and. failed) exit
            call fit_residues(s, response, weight, candidate, coefficient, candidate_misfit)
            stagnation = stagnation + 1
            if (candidate_misfit < (1 - gain)*misfit) stagnation = 0
            if (candidate_misfit < misfit) then
               misfit = candidate_misfit
               pole = candidate
               best = coefficient
            end if
            if (misfit < exact .or. stagnation > stagnation_limit) exit
         end do
         if (misfit < exact) exit
      end do
      failed = .not. misfit < huge(misfit)
      if (failed) return
      residue = get_residues(pole, best(:size(best) - 1))*scale
      direct = best(size(best))
      pole = pole*scale
   end subroutine fit_rational

   !> Lightly damped poles across the band; all frequencies are divided by the highest frequency of the data.
   pure function get_first_poles(lowest, order, logarithmic) result(pole)
      !> Lowest frequency of the data.
      real(wp), intent(in) :: lowest
      integer, intent(in) :: order
      !> True for even spacing of the logarithm.
      logical, intent(in) :: logarithmic
      !> The poles: [n].
      complex(wp), allocatable :: pole(:)
      real(wp) :: fraction, frequency
      integer :: k, pairs

      pairs = order/2
      allocate (pole(pairs + mod(order, 2)))
      do k = 1, pairs
         fraction = (k - 0.5_wp)/pairs
         frequency = lowest + (1 - lowest)*fraction
         if (logarithmic) frequency = lowest**(1 - fraction)
         pole(k) = frequency*cmplx(-first_damping, 1.0_wp, wp)
      end do
      if (mod(order, 2) == 1) pole(pairs + 1) = -sqrt(lowest)
   end function get_first_poles

   !> Relocates poles to the zeros of sigma = c.basis + d. The product sigma f is fitted by a rational function with the
   !> present poles, and the real part of sigma has the mean 1 (relaxed non-triviality, Gustavsen 2006 eq. 8).
   subroutine relocate_poles(s, response, weight, pole, failed)
      !> Complex frequencies, the last scaled to i, and values: [n_frequency].
      complex(wp), intent(in) :: s(:), response(:)
      !> Weights: [n_frequency].
      real(wp), intent(in) :: weight(:)
      !> The poles: [n].
      complex(wp), allocatable, intent(inout) :: pole(:)
      !> True if LAPACK finds no solution.
      logical, intent(out) :: failed
      complex(wp), allocatable :: basis(:, :), zero(:)
      real(wp), allocatable :: matrix(:, :), right(:)
      real(wp) :: norm
      integer :: j, n, n_frequency

      n_frequency = size(s)
      call get_basis(pole, s, basis)
      n = size(basis, 2) - 1
      allocate (matrix(2*n_frequency + 1, 2*n + 2), right(2*n_frequency + 1), zero(n))
      do j = 1, n + 1
         matrix(:2*n_frequency, j) = real_and_imaginary(weight*basis(:, j))
         matrix(:2*n_frequency, n + 1 + j) = real_and_imaginary(-weight*response*basis(:, j))
      end do
      norm = norm2(weight*abs(response))
      matrix(2*n_frequency + 1, :n + 1) = 0.0_wp
      matrix(2*n_frequency + 1, n + 2:) = norm*sum(real(basis), dim=1)/n_frequency
      right = 0.0_wp
      right(2*n_frequency + 1) = norm
      call solve_least_squares(matrix, right, failed)
      if (failed) return
      associate (c => right(n + 2:2*n + 1), d => right(2*n + 2))
         if (abs(d) < min_constant) d = sign(min_constant, d)
         call get_zeros(pole, c/d, zero, failed)
      end associate
      pole = pack(zero, zero%im >= 0.0_wp)
      pole%re = -max(abs(pole%re), min_damping*abs(pole))
   end subroutine relocate_poles

   !> Zeros of c.basis + 1: eigenvalues of A - b c with the real state space x' = A x + b u of the basis.
   pure subroutine get_zeros(pole, c, zero, failed)
      !> Poles: [n].
      complex(wp), intent(in) :: pole(:)
      !> Coefficients: [order].
      real(wp), intent(in) :: c(:)
      !> The zeros: [order].
      complex(wp), intent(out) :: zero(:)
      !> True if the coefficients are not finite or LAPACK does not find the eigenvalues.
      logical, intent(out) :: failed
      real(wp) :: matrix(size(c), size(c)), wr(size(c)), wi(size(c))
      real(wp) :: left_vector(1, 1), right_vector(1, 1), work(16*size(c))
      integer :: info, j, k

      matrix = 0.0_wp
      j = 0
      do k = 1, size(pole)
         j = j + 1
         matrix(j, :) = merge(-2*c, -c, pole(k)%im > 0.0_wp)
         matrix(j, j) = matrix(j, j) + pole(k)%re
         if (.not. pole(k)%im > 0.0_wp) cycle
         matrix(j, j + 1) = matrix(j, j + 1) + pole(k)%im
         matrix(j + 1, j:j + 1) = [-pole(k)%im, pole(k)%re]
         j = j + 1
      end do
      zero = 0.0_wp
      failed = .not. all(abs(matrix) <= huge(1.0_wp))
      if (failed) return
      call dgeev('N', 'N', size(c), matrix, size(c), wr, wi, left_vector, 1, right_vector, 1, work, size(work), info)
      zero = cmplx(wr, wi, wp)
      failed = info /= 0
   end subroutine get_zeros

   !> Fits the coefficients of the basis for given poles.
   subroutine fit_residues(s, response, weight, pole, coefficient, misfit)
      !> Complex frequencies and values: [n_frequency].
      complex(wp), intent(in) :: s(:), response(:)
      real(wp), intent(in) :: weight(:)
      !> The poles: [n].
      complex(wp), intent(in) :: pole(:)
      !> The coefficients, the constant part last: [order + 1].
      real(wp), allocatable, intent(out) :: coefficient(:)
      !> Root-mean-square weighted error, relative to the weighted values; huge if there is no solution.
      real(wp), intent(out) :: misfit
      complex(wp), allocatable :: basis(:, :)
      real(wp), allocatable :: matrix(:, :), right(:)
      logical :: failed
      integer :: j

      call get_basis(pole, s, basis)
      allocate (matrix(2*size(s), size(basis, 2)))
      do j = 1, size(basis, 2)
         matrix(:, j) = real_and_imaginary(weight*basis(:, j))
      end do
      allocate (right, source=real_and_imaginary(weight*response))
      call solve_least_squares(matrix, right, failed)
      coefficient = right(:size(basis, 2))
      misfit = norm2(weight*abs(matmul(basis, coefficient) - response))/norm2(weight*abs(response))
      if (failed) misfit = huge(misfit)
   end subroutine fit_residues

   !> Least-squares solution; the columns are scaled to unit length.
   subroutine solve_least_squares(matrix, right, failed)
      !> The matrix, overwritten: [n_row, n_column].
      real(wp), intent(inout) :: matrix(:, :)
      !> Right-hand side; its first n_column values become the solution: [n_row].
      real(wp), intent(inout) :: right(:)
      !> True if there is no solution.
      logical, intent(out) :: failed
      real(wp) :: length(size(matrix, 2)), work(64*size(matrix, 2) + size(matrix, 1))
      integer :: info, j

      length = norm2(matrix, dim=1)
      do j = 1, size(length)
         matrix(:, j) = matrix(:, j)/length(j)
      end do
      call dgels('N', size(matrix, 1), size(matrix, 2), 1, matrix, size(matrix, 1), right, size(right), work, size(work), &
         info)
      right(:size(length)) = right(:size(length))/length
      failed = info /= 0
   end subroutine solve_least_squares

   !> Real parts, then imaginary parts: [2 n].
   pure function real_and_imaginary(values) result(parts)
      !> Complex values: [n].
      complex(wp), intent(in) :: values(:)
      real(wp) :: parts(2*size(values))

      parts = [real(values), aimag(values)]
   end function real_and_imaginary

end module thud_vector_fit
