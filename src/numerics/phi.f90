!> The functions phi_n of exponential integrators: phi_0 = exp z, phi_(n+1) = (phi_n - 1/n!)/z; also
!> phi_n = integral from 0 to 1 of exp((1 - t) z) t**(n-1)/(n-1)! dt (Hochbruck and Ostermann 2010, eq. 2.10).
module thud_phi
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: get_phi

   !> Highest index n.
   integer, parameter :: max_phi = 8

   !> Number of terms of the series of phi_n for |z| < 1: the remainder is about 1/18!.
   integer, parameter :: n_term = 18

   !> Index in the next constant.
   integer :: number
   !> Reciprocal factorials, from 1/0! on.
   real(wp), parameter :: inverse_factorial(0:max_phi + n_term) = &
      [(1/gamma(real(number + 1, wp)), number=0, max_phi + n_term)]

contains

   !> The functions phi_0 to phi_highest: [0:highest].
   pure function get_phi(z, highest) result(phi)
      !> Argument whose real part is not large.
      complex(wp), intent(in) :: z
      !> Index of the last function, up to `max_phi`.
      integer, intent(in) :: highest
      complex(wp) :: phi(0:highest)
      complex(wp) :: reciprocal
      integer :: k, n

      if (real(z, wp)**2 + aimag(z)**2 < 1.0_wp) then
         ! Upwards, the recursion divides by z, which is unstable for small |z|.
         phi(highest) = inverse_factorial(highest + n_term)
         do k = highest + n_term - 1, highest, -1
            phi(highest) = inverse_factorial(k) + phi(highest)*z
         end do
         do n = highest - 1, 0, -1
            phi(n) = inverse_factorial(n) + z*phi(n + 1)
         end do
      else
         reciprocal = 1/z
         phi(0) = exp(z)
         do n = 0, highest - 1
            phi(n + 1) = (phi(n) - inverse_factorial(n))*reciprocal
         end do
      end if
   end function get_phi

end module thud_phi
