!> The exponential of a small matrix: exact steps of linear equations with constant coefficients.
module thud_matrix_exponential
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: get_exponential

   !> Maximum norm of a matrix whose series is summed.
   real(wp), parameter :: summed_norm = 0.5_wp
   !> Number of terms of the series: 0.5**17/17! is below 1e-19.
   integer, parameter :: n_term = 16

contains

   !> exp(A) by scaling, Taylor's series and squaring.
   pure function get_exponential(matrix) result(exponential)
      !> A: [n, n].
      real(wp), intent(in) :: matrix(:, :)
      !> exp(A): [n, n].
      real(wp) :: exponential(size(matrix, 1), size(matrix, 1))
      real(wp) :: scaled(size(matrix, 1), size(matrix, 1)), term(size(matrix, 1), size(matrix, 1))
      real(wp) :: norm
      integer :: i, halvings

      norm = maxval(sum(abs(matrix), dim=1))
      halvings = 0
      if (norm > summed_norm) halvings = ceiling(log(norm/summed_norm)/log(2.0_wp))
      scaled = matrix/2.0_wp**halvings
      exponential = 0.0_wp
      do i = 1, size(matrix, 1)
         exponential(i, i) = 1.0_wp
      end do
      term = exponential
      do i = 1, n_term
         term = matmul(term, scaled)/i
         exponential = exponential + term
      end do
      do i = 1, halvings
         exponential = matmul(exponential, exponential)
      end do
   end function get_exponential

end module thud_matrix_exponential
