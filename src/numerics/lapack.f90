!> Explicit interfaces of the LAPACK and BLAS procedures in use.
module thud_lapack
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: dgbsv, dgeev, dgels, dgemm, dgesvd, dgetf2, dgetrs, dposv, dpotrf, dpstrf
   public :: dsygvd, dsygvx, dtrsm, zgeev

   interface
      !> Eigenvalues of a general matrix.
      pure subroutine dgeev(jobvl, jobvr, n, a, lda, wr, wi, vl, ldvl, vr, ldvr, work, lwork, info)
         import :: wp
         implicit none (type, external)
         character(len=1), intent(in) :: jobvl, jobvr
         integer, intent(in) :: n, lda, ldvl, ldvr, lwork
         real(wp), intent(inout) :: a(lda, *)
         real(wp), intent(out) :: wr(*), wi(*), vl(ldvl, *), vr(ldvr, *), work(*)
         integer, intent(out) :: info
      end subroutine dgeev

      !> Generalized symmetric eigenproblem, by divide and conquer.
      pure subroutine dsygvd(itype, jobz, uplo, n, a, lda, b, ldb, w, work, lwork, iwork, liwork, info)
         import :: wp
         implicit none (type, external)
         integer, intent(in) :: itype, n, lda, ldb, lwork, liwork
         character(len=1), intent(in) :: jobz, uplo
         real(wp), intent(inout) :: a(lda, *), b(ldb, *)
         real(wp), intent(out) :: w(*), work(*)
         integer, intent(out) :: iwork(*)
         integer, intent(out) :: info
      end subroutine dsygvd

      !> Eigenvalues in a range and their vectors, of the generalized symmetric eigenproblem.
      pure subroutine dsygvx(itype, jobz, range, uplo, n, a, lda, b, ldb, vl, vu, il, iu, abstol, m, w, z, ldz, work, &
                             lwork, iwork, ifail, info)
         import :: wp
         implicit none (type, external)
         integer, intent(in) :: itype, n, lda, ldb, il, iu, ldz, lwork
         character(len=1), intent(in) :: jobz, range, uplo
         real(wp), intent(inout) :: a(lda, *), b(ldb, *)
         real(wp), intent(in) :: vl, vu, abstol
         integer, intent(out) :: m, info
         integer, intent(out) :: iwork(*), ifail(*)
         real(wp), intent(out) :: w(*), z(ldz, *), work(*)
      end subroutine dsygvx

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

      !> Cholesky factor of a positive semidefinite matrix, with complete pivoting.
      pure subroutine dpstrf(uplo, n, a, lda, piv, rank, tol, work, info)
         import :: wp
         implicit none (type, external)
         character(len=1), intent(in) :: uplo
         integer, intent(in) :: n, lda
         real(wp), intent(in) :: tol
         real(wp), intent(inout) :: a(lda, *)
         integer, intent(out) :: piv(*)
         integer, intent(out) :: rank, info
         real(wp), intent(out) :: work(*)
      end subroutine dpstrf

      !> Matrix times matrix.
      pure subroutine dgemm(transa, transb, m, n, k, alpha, a, lda, b, ldb, beta, c, ldc)
         import :: wp
         implicit none (type, external)
         character(len=1), intent(in) :: transa, transb
         integer, intent(in) :: m, n, k, lda, ldb, ldc
         real(wp), intent(in) :: alpha, beta
         real(wp), intent(in) :: a(lda, *), b(ldb, *)
         real(wp), intent(inout) :: c(ldc, *)
      end subroutine dgemm

      !> Singular value decomposition.
      pure subroutine dgesvd(jobu, jobvt, m, n, a, lda, s, u, ldu, vt, ldvt, work, lwork, info)
         import :: wp
         implicit none (type, external)
         character(len=1), intent(in) :: jobu, jobvt
         integer, intent(in) :: m, n, lda, ldu, ldvt, lwork
         real(wp), intent(inout) :: a(lda, *)
         real(wp), intent(out) :: s(*), u(ldu, *), vt(ldvt, *), work(*)
         integer, intent(out) :: info
      end subroutine dgesvd

      !> Least squares.
      pure subroutine dgels(trans, m, n, nrhs, a, lda, b, ldb, work, lwork, info)
         import :: wp
         implicit none (type, external)
         character(len=1), intent(in) :: trans
         integer, intent(in) :: m, n, nrhs, lda, ldb, lwork
         real(wp), intent(inout) :: a(lda, *), b(ldb, *)
         real(wp), intent(out) :: work(*)
         integer, intent(out) :: info
      end subroutine dgels

      !> Solution with a general banded matrix.
      pure subroutine dgbsv(n, kl, ku, nrhs, ab, ldab, ipiv, b, ldb, info)
         import :: wp
         implicit none (type, external)
         integer, intent(in) :: n, kl, ku, nrhs, ldab, ldb
         integer, intent(out) :: ipiv(*)
         integer, intent(out) :: info
         real(wp), intent(inout) :: ab(ldab, *), b(ldb, *)
      end subroutine dgbsv

      !> LU factors of a small matrix, with partial pivoting.
      pure subroutine dgetf2(m, n, a, lda, ipiv, info)
         import :: wp
         implicit none (type, external)
         integer, intent(in) :: m, n, lda
         real(wp), intent(inout) :: a(lda, *)
         integer, intent(out) :: ipiv(*)
         integer, intent(out) :: info
      end subroutine dgetf2

      !> Solution with the factors of `dgetf2`.
      pure subroutine dgetrs(trans, n, nrhs, a, lda, ipiv, b, ldb, info)
         import :: wp
         implicit none (type, external)
         character(len=1), intent(in) :: trans
         integer, intent(in) :: n, nrhs, lda, ldb
         real(wp), intent(in) :: a(lda, *)
         integer, intent(in) :: ipiv(*)
         real(wp), intent(inout) :: b(ldb, *)
         integer, intent(out) :: info
      end subroutine dgetrs

      !> Solutions with a triangular matrix.
      pure subroutine dtrsm(side, uplo, transa, diag, m, n, alpha, a, lda, b, ldb)
         import :: wp
         implicit none (type, external)
         character(len=1), intent(in) :: side, uplo, transa, diag
         integer, intent(in) :: m, n, lda, ldb
         real(wp), intent(in) :: alpha
         real(wp), intent(in) :: a(lda, *)
         real(wp), intent(inout) :: b(ldb, *)
      end subroutine dtrsm

      !> Eigenvalues and vectors of a complex matrix.
      pure subroutine zgeev(jobvl, jobvr, n, a, lda, w, vl, ldvl, vr, ldvr, work, lwork, rwork, info)
         import :: wp
         implicit none (type, external)
         character(len=1), intent(in) :: jobvl, jobvr
         integer, intent(in) :: n, lda, ldvl, ldvr, lwork
         complex(wp), intent(inout) :: a(lda, *)
         complex(wp), intent(out) :: w(*), vl(ldvl, *), vr(ldvr, *), work(*)
         real(wp), intent(out) :: rwork(*)
         integer, intent(out) :: info
      end subroutine zgeev
   end interface

end module thud_lapack
