!> The functions phi_n of exponential integrators: phi_0 = exp z, phi_(n+1) = (phi_n - 1/n!)/z; also
!> phi_n = integral from 0 to 1 of exp((1 - t) z) t**(n-1)/(n-1)! dt (Hochbruck and Ostermann 2010, eq. 2.10).
module thud_phi
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: get_phi

contains

   !> The functions from phi_0 on.
   pure function get_phi(z, highest) result(phi)
      !> Argument, its real part not large.
      complex(wp), intent(in) :: z
      !> Number of the last function.
      integer, intent(in) :: highest
      !> Their values: [0:highest].
      complex(wp) :: phi(0:highest)
      ! Terms of the series of phi_n below |z| = 1: 1/20! is left.
      integer, parameter :: n_term = 20
      real(wp) :: factorial
      integer :: k, n

      if (abs(z) < 1.0_wp) then
         ! The recursion divides by z, which is stable downwards only.
         phi(highest) = 1.0_wp
         do k = n_term, 1, -1
            phi(highest) = 1 + phi(highest)*z/(highest + k)
         end do
         phi(highest) = phi(highest)/gamma(real(highest + 1, wp))
         do n = highest - 1, 0, -1
            phi(n) = z*phi(n + 1) + 1/gamma(real(n + 1, wp))
         end do
      else
         phi(0) = exp(z)
         factorial = 1.0_wp
         do n = 0, highest - 1
            phi(n + 1) = (phi(n) - 1/factorial)/z
            factorial = factorial*(n + 1)
         end do
      end if
   end function get_phi

end module thud_phi
