!> The functions phi_n of exponential integrators: phi_0 = exp z, phi_(n+1) = (phi_n - 1/n!)/z; also
!> phi_n = integral from 0 to 1 of exp((1 - t) z) t**(n-1)/(n-1)! dt (Hochbruck and Ostermann 2010, eq. 2.10).
module thud_phi
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: get_phi

   !> Index of the last function that is offered.
   integer, parameter :: max_phi = 8

   !> Terms of the series of phi_n below |z| = 1: 1/18! is left.
   integer, parameter :: n_term = 18

   !> Runs through the next constant.
   integer :: number
   !> Reciprocals of the factorials, from that of 0 on.
   real(wp), parameter :: inverse_factorial(0:max_phi + n_term) = &
      [(1/gamma(real(number + 1, wp)), number=0, max_phi + n_term)]

contains

   !> The functions from phi_0 on.
   pure function get_phi(z, highest) result(phi)
      !> Argument, its real part not large.
      complex(wp), intent(in) :: z
      !> Index of the last function, up to `max_phi`.
      integer, intent(in) :: highest
      !> Their values: [0:highest].
      complex(wp) :: phi(0:highest)
      complex(wp) :: reciprocal
      integer :: k, n

      if (real(z, wp)**2 + aimag(z)**2 < 1.0_wp) then
         ! The recursion divides by z, which is stable downwards only.
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
