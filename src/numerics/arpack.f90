!> Explicit interfaces of the procedures of ARPACK-NG in use.
module thud_arpack
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: dsaupd, dseupd

   interface
      !> One iteration of the implicitly restarted Lanczos method.
      subroutine dsaupd(ido, bmat, n, which, nev, tol, resid, ncv, v, ldv, iparam, ipntr, workd, workl, lworkl, info)
         import :: wp
         implicit none (type, external)
         integer, intent(inout) :: ido, info
         character(len=1), intent(in) :: bmat
         character(len=2), intent(in) :: which
         integer, intent(in) :: n, nev, ncv, ldv, lworkl
         real(wp), intent(in) :: tol
         integer, intent(inout) :: iparam(11), ipntr(11)
         real(wp), intent(inout) :: resid(n), v(ldv, ncv), workd(3*n), workl(lworkl)
      end subroutine dsaupd

      !> Eigenvalues and eigenvectors after the last iteration.
      subroutine dseupd(rvec, howmny, select, d, z, ldz, sigma, bmat, n, which, nev, tol, resid, ncv, v, ldv, iparam, &
         ipntr, workd, workl, lworkl, info)
         import :: wp
         implicit none (type, external)
         logical, intent(in) :: rvec
         character(len=1), intent(in) :: howmny, bmat
         character(len=2), intent(in) :: which
         integer, intent(in) :: n, nev, ncv, ldv, ldz, lworkl
         logical, intent(inout) :: select(ncv)
         real(wp), intent(in) :: sigma, tol
         integer, intent(inout) :: info
         integer, intent(inout) :: iparam(7), ipntr(11)
         real(wp), intent(inout) :: d(nev), z(ldz, nev), resid(n), v(ldv, ncv), workd(2*n), workl(lworkl)
      end subroutine dseupd
   end interface

end module thud_arpack
