!> Products of small matrices and vectors, for which a call of BLAS takes longer than the product.
module thud_product
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: add_product

contains

   !> Adds the product of a matrix and a vector.
   pure subroutine add_product(matrix, vector, total)
      !> Matrix, of which only the first n_row rows are used: [at least n_row, n_column].
      real(wp), intent(in), contiguous :: matrix(:, :)
      !> Vector; only the first n_column values are used: [at least n_column].
      real(wp), intent(in), contiguous :: vector(:)
      !> The product is added to this: [n_row].
      real(wp), intent(inout), contiguous :: total(:)
      integer :: i, j, n_column

      n_column = size(matrix, 2)
      ! Four columns at a time, as loading and storing the total takes most of the time.
      do j = 1, n_column - 3, 4
         do i = 1, size(total)
            total(i) = total(i) + matrix(i, j)*vector(j) + matrix(i, j + 1)*vector(j + 1) &
               + matrix(i, j + 2)*vector(j + 2) + matrix(i, j + 3)*vector(j + 3)
         end do
      end do
      do j = n_column - mod(n_column, 4) + 1, n_column
         do i = 1, size(total)
            total(i) = total(i) + matrix(i, j)*vector(j)
         end do
      end do
   end subroutine add_product

end module thud_product
