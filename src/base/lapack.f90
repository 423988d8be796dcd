!> Explicit interfaces of the LAPACK and BLAS procedures in use.
module thud_lapack
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: dgemv, dposv, dpotrf, dsygv, dtrsv

   interface
      !> Generalised symmetric eigenproblem.
      pure subroutine dsygv(itype, jobz, uplo, n, a, lda, b, ldb, w, work, lwork, info)
         import :: wp
         implicit none (type, external)
         integer, intent(in) :: itype, n, lda, ldb, lwork
         character(len=1), intent(in) :: jobz, uplo
         real(wp), intent(inout) :: a(lda, *), b(ldb, *)
         real(wp), intent(out) :: w(*), work(*)
         integer, intent(out) :: info
      end subroutine dsygv

      !> Solution with a positive definite matrix.
      pure subroutine dposv(uplo, n, nrhs, a, lda, b, ldb, info)
         import :: wp
         implicit none (type, external)
         character(len=1), intent(in) :: uplo
         integer, intent(in) :: n, nrhs, lda, ldb
         real(wp), intent(inout) :: a(lda, *), b(ldb, *)
         integer, intent(out) :: info
      end subroutine dposv

      !> Cholesky factor.
      pure subroutine dpotrf(uplo, n, a, lda, info)
         import :: wp
         implicit none (type, external)
         character(len=1), intent(in) :: uplo
         integer, intent(in) :: n, lda
         real(wp), intent(inout) :: a(lda, *)
         integer, intent(out) :: info
      end subroutine dpotrf

      !> Solution with a triangular matrix.
      pure subroutine dtrsv(uplo, trans, diag, n, a, lda, x, incx)
         import :: wp
         implicit none (type, external)
         character(len=1), intent(in) :: uplo, trans, diag
         integer, intent(in) :: n, lda, incx
         real(wp), intent(in) :: a(lda, *)
         real(wp), intent(inout) :: x(*)
      end subroutine dtrsv

      !> Matrix times vector.
      pure subroutine dgemv(trans, m, n, alpha, a, lda, x, incx, beta, y, incy)
         import :: wp
         implicit none (type, external)
         character(len=1), intent(in) :: trans
         integer, intent(in) :: m, n, lda, incx, incy
         real(wp), intent(in) :: alpha, beta
         real(wp), intent(in) :: a(lda, *), x(*)
         real(wp), intent(inout) :: y(*)
      end subroutine dgemv
   end interface

end module thud_lapack
