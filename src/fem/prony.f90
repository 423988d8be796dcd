!> Prony series: a long-term modulus of 1 and Maxwell branches beside it, each with its modulus
!> over the long-term modulus and its relaxation time.
module thud_prony
   use thud_constants, only: pi
   use thud_error, only: error_type, input_error
   use thud_kinds, only: wp
   use thud_lapack, only: dgels
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: fit_constant_loss, get_loss_factor, get_storage_ratio

   !> Band over which the loss factor is to be constant, Hz.
   real(wp), parameter :: lowest = 10.0_wp, highest = 1000.0_wp

   !> Branches of the fit, two a decade; the outer ones stand half a decade outside the band. They keep
   !> a loss factor up to 0.5 constant within 0.3 %.
   integer, parameter :: n_branch = 7

   !> Frequencies of the fit.
   integer, parameter :: n_frequency = 100

contains

   !> Storage modulus over the long-term modulus.
   pure function get_storage_ratio(share, time, omega) result(ratio)
      !> Moduli of the branches over the long-term modulus: [n_branch].
      real(wp), intent(in) :: share(:)
      !> Their relaxation times, s: [n_branch].
      real(wp), intent(in) :: time(:)
      !> Angular frequency, rad/s.
      real(wp), intent(in) :: omega
      real(wp) :: ratio

      ratio = 1 + sum(share*(omega*time)**2/(1 + (omega*time)**2))
   end function get_storage_ratio

   !> Loss modulus over storage modulus.
   pure function get_loss_factor(share, time, omega) result(loss_factor)
      !> Moduli of the branches over the long-term modulus: [n_branch].
      real(wp), intent(in) :: share(:)
      !> Their relaxation times, s: [n_branch].
      real(wp), intent(in) :: time(:)
      !> Angular frequency, rad/s.
      real(wp), intent(in) :: omega
      real(wp) :: loss_factor

      loss_factor = sum(share*omega*time/(1 + (omega*time)**2))/get_storage_ratio(share, time, omega)
   end function get_loss_factor

   !> Series whose loss factor is constant from 10 to 1000 Hz.
   !>
   !> Loss modulus = loss factor times storage modulus is linear in the moduli of the branches: least
   !> squares over frequencies at equal steps of their logarithm.
   subroutine fit_constant_loss(loss_factor, share, time, error)
      real(wp), intent(in) :: loss_factor
      !> Moduli of the branches over the long-term modulus: [n_branch].
      real(wp), allocatable, intent(out) :: share(:)
      !> Their relaxation times, s: [n_branch].
      real(wp), allocatable, intent(out) :: time(:)
      !> A modulus would have to be negative.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: omega
      real(wp) :: matrix(n_frequency, n_branch), right(n_frequency), work(64*n_branch), turn(n_branch)
      integer :: i, info

      allocate (share(n_branch))
      allocate (time, source=[(1/(2*pi*lowest*(highest/lowest)**((i - 2)/real(n_branch - 3, wp))), i=1, n_branch)])
      do i = 1, n_frequency
         omega = 2*pi*lowest*(highest/lowest)**((i - 1)/real(n_frequency - 1, wp))
         turn = omega*time
         ! Each line over the storage modulus that a constant loss factor has, so that all weigh the same.
         matrix(i, :) = (turn - loss_factor*turn**2)/(1 + turn**2)
         right(i) = loss_factor
         matrix(i, :) = matrix(i, :)*omega**(-2/pi*atan(loss_factor))
         right(i) = right(i)*omega**(-2/pi*atan(loss_factor))
      end do
      call dgels('N', n_frequency, n_branch, 1, matrix, n_frequency, right, n_frequency, work, size(work), info)
      share = right(:n_branch)
      if (info /= 0 .or. minval(share) < 0.0_wp) error = input_error('&material: no Prony series with ' &
         //to_text(n_branch)//' terms has loss_factor = '//to_text(loss_factor)//' from '//to_text(lowest)//' to ' &
         //to_text(highest)//' Hz; allowed: up to about 0.9')
   end subroutine fit_constant_loss

end module thud_prony
