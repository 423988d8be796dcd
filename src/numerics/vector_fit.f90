!> Relaxed vector fitting (Gustavsen and Semlyen, IEEE Trans. Power Delivery 14, 1999; Gustavsen, 21, 2006): a stable
!> rational function with real coefficients through values at frequencies.
module thud_vector_fit
   use thud_interrupt, only: is_interrupted
   use thud_kinds, only: wp
   use thud_lapack, only: dgels
   use thud_rational, only: get_basis, get_eigenvalues, get_order, get_residues, get_state_input, get_state_matrix
   implicit none (type, external)
   private

   public :: fit_rational

   !> Maximum moves of the poles; with good values some five are needed.
   integer, parameter :: n_move = 40

   !> Moves without a gain after which the poles stay, and the least gain.
   integer, parameter :: patience = 6
   real(wp), parameter :: gain = 1.0e-3_wp

   !> Weighted relative error, root of the mean square, below which only rounding is left to fit.
   real(wp), parameter :: exact = 1.0e-13_wp

   !> Damping ratio of the first poles (Gustavsen and Semlyen).
   real(wp), parameter :: first_damping = 0.01_wp

   !> Minimum damping ratio: a pole on the axis would never decay.
   real(wp), parameter :: min_damping = 1.0e-8_wp

   !> Minimum of the constant of the weight function (Gustavsen 2006).
   real(wp), parameter :: min_constant = 1.0e-8_wp

contains

   !> Fits d + sum of r_k/(s - p_k).
   !>
   !> Each move makes the zeros of a fitted weight function the new poles; those in the right half plane are reflected.
   !> The first poles lie at equal steps of the frequency or of its logarithm; the better of both fits is taken.
   subroutine fit_rational(omega, response, weight, order, pole, residue, direct, misfit, failed)
      !> Angular frequencies, rad/s, rising, above 0: [n_line].
      real(wp), intent(in) :: omega(:)
      !> Values to fit: [n_line].
      complex(wp), intent(in) :: response(:)
      !> Weights of their errors: [n_line].
      real(wp), intent(in) :: weight(:)
      !> Number of poles, both of a pair counted; at most n_line - 1.
      integer, intent(in) :: order
      !> Poles, 1/s, of pairs one, and residues, those of pairs doubled: [n].
      complex(wp), allocatable, intent(out) :: pole(:), residue(:)
      !> Constant part.
      real(wp), intent(out) :: direct
      !> Weighted error over the weighted values, root of the mean square.
      real(wp), intent(out) :: misfit
      !> LAPACK found no solution, or an interrupt ended the search.
      logical, intent(out) :: failed
      complex(wp), allocatable :: found(:)
      real(wp), allocatable :: coefficient(:), best(:)
      complex(wp) :: s(size(omega))
      real(wp) :: scale, here
      integer :: i, kind, idle

      scale = omega(size(omega))
      s = cmplx(0.0_wp, omega/scale, wp)
      misfit = huge(misfit)
      failed = .true.
      do kind = 1, 2
         found = get_first_poles(omega(1)/scale, order, kind == 1)
         idle = 0
         do i = 0, n_move
            if (is_interrupted()) return
            if (i > 0) call move_poles(s, response, weight, found, failed)
            if (i > 0 .and. failed) exit
            call fit_residues(s, response, weight, found, coefficient, here)
            idle = idle + 1
            if (here < (1 - gain)*misfit) idle = 0
            if (here < misfit) then
               misfit = here
               pole = found
               best = coefficient
            end if
            if (misfit < exact .or. idle > patience) exit
         end do
         if (misfit < exact) exit
      end do
      failed = .not. misfit < huge(misfit)
      if (failed) return
      residue = get_residues(pole, best(:size(best) - 1))*scale
      direct = best(size(best))
      pole = pole*scale
   end subroutine fit_rational

   !> Lightly damped poles over the band of the lines, whose last is at 1.
   pure function get_first_poles(lowest, order, logarithmic) result(pole)
      !> The first line over the last.
      real(wp), intent(in) :: lowest
      integer, intent(in) :: order
      !> At equal steps of the logarithm.
      logical, intent(in) :: logarithmic
      !> The poles: [n].
      complex(wp), allocatable :: pole(:)
      real(wp) :: part, place
      integer :: k, pairs

      pairs = order/2
      allocate (pole(pairs + mod(order, 2)))
      do k = 1, pairs
         part = (k - 0.5_wp)/pairs
         place = lowest + (1 - lowest)*part
         if (logarithmic) place = lowest**(1 - part)
         pole(k) = place*cmplx(-first_damping, 1.0_wp, wp)
      end do
      if (mod(order, 2) == 1) pole(pairs + 1) = -sqrt(lowest)
   end function get_first_poles

   !> Moves poles to the zeros of sigma = c.basis + d, where sigma f = rational function with the present poles, and the
   !> real parts of sigma have the mean 1 (relaxed non-triviality, Gustavsen 2006 eq. 8).
   subroutine move_poles(s, response, weight, pole, failed)
      !> Complex frequencies, the last at i, and values: [n_line].
      complex(wp), intent(in) :: s(:), response(:)
      !> Weights: [n_line].
      real(wp), intent(in) :: weight(:)
      !> The poles: [n].
      complex(wp), allocatable, intent(inout) :: pole(:)
      !> LAPACK found no solution.
      logical, intent(out) :: failed
      complex(wp), allocatable :: basis(:, :), zero(:)
      real(wp), allocatable :: matrix(:, :), right(:), column(:)
      real(wp) :: size_of_line
      integer :: j, n, n_line

      n = get_order(pole)
      n_line = size(s)
      call get_basis(pole, s, basis)
      allocate (matrix(2*n_line + 1, 2*n + 2), right(2*n_line + 1), zero(n))
      do j = 1, n + 1
         matrix(:2*n_line, j) = halves(weight*basis(:, j))
         matrix(:2*n_line, n + 1 + j) = halves(-weight*response*basis(:, j))
      end do
      size_of_line = norm2(weight*abs(response))
      matrix(2*n_line + 1, :n + 1) = 0.0_wp
      matrix(2*n_line + 1, n + 2:) = size_of_line*sum(real(basis), dim=1)/n_line
      right = 0.0_wp
      right(2*n_line + 1) = size_of_line
      call solve_least_squares(matrix, right, failed)
      if (failed) return
      associate (c => right(n + 2:2*n + 1), d => right(2*n + 2))
         if (abs(d) < min_constant) d = sign(min_constant, d)
         deallocate (matrix)
         allocate (matrix, source=get_state_matrix(pole))
         allocate (column, source=get_state_input(pole))
         do j = 1, n
            matrix(:, j) = matrix(:, j) - column*c(j)/d
         end do
      end associate
      call get_eigenvalues(matrix, zero, failed)
      pole = pack(zero, zero%im >= 0.0_wp)
      pole%re = -max(abs(pole%re), min_damping*abs(pole))
   end subroutine move_poles

   !> Coefficients of the basis with given poles.
   subroutine fit_residues(s, response, weight, pole, coefficient, misfit)
      !> Complex frequencies and values: [n_line].
      complex(wp), intent(in) :: s(:), response(:)
      !> Weights: [n_line].
      real(wp), intent(in) :: weight(:)
      !> The poles: [n].
      complex(wp), intent(in) :: pole(:)
      !> The coefficients, the constant part last: [order + 1].
      real(wp), allocatable, intent(out) :: coefficient(:)
      !> Weighted error over the weighted values, root of the mean square; huge where there is no solution.
      real(wp), intent(out) :: misfit
      complex(wp), allocatable :: basis(:, :)
      real(wp), allocatable :: matrix(:, :), right(:)
      logical :: failed
      integer :: j

      call get_basis(pole, s, basis)
      allocate (matrix(2*size(s), size(basis, 2)))
      do j = 1, size(basis, 2)
         matrix(:, j) = halves(weight*basis(:, j))
      end do
      allocate (right, source=halves(weight*response))
      call solve_least_squares(matrix, right, failed)
      coefficient = right(:size(basis, 2))
      misfit = norm2(weight*abs(matmul(basis, coefficient) - response))/norm2(weight*abs(response))
      if (failed) misfit = huge(misfit)
   end subroutine fit_residues

   !> Least squares with columns of unit length.
   subroutine solve_least_squares(matrix, right, failed)
      !> The matrix, overwritten: [n_row, n_column].
      real(wp), intent(inout) :: matrix(:, :)
      !> Right-hand side; its first n_column values become the solution: [n_row].
      real(wp), intent(inout) :: right(:)
      !> There is no solution.
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

   !> Real and imaginary parts one after the other.
   pure function halves(values) result(parts)
      !> Complex values: [n].
      complex(wp), intent(in) :: values(:)
      !> Their parts: [2 n].
      real(wp) :: parts(2*size(values))

      parts = [real(values), aimag(values)]
   end function halves

end module thud_vector_fit
