!> Prony series: a long-term modulus of 1 in parallel with Maxwell branches, each with its relative modulus (divided by the
!> long-term modulus) and its relaxation time.
module thud_prony
   use thud_constants, only: pi
   use thud_error, only: error_type, input_error
   use thud_kinds, only: wp
   use thud_lapack, only: dgels
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: check_fractional_loss, fit_constant_loss, fit_fractional_loss, get_modulus_ratio

   !> Band in which a series fits a fractional law, Hz.
   real(wp), parameter, public :: series_from = 5.0_wp, series_to = 3000.0_wp

   !> Number of branches for a fractional law. With a spring for longer relaxation times and a viscosity for shorter ones,
   !> they keep the complex modulus within 0.8 % for any order (4 branches: 2.2 %, 6: 0.5 %).
   integer, parameter :: n_fractional = 5
   !> Factor by which the outer branches lie outside the band: the closest spacing that spreads the error evenly.
   real(wp), parameter :: outside = 1.26_wp

   !> Band in which the loss factor is constant, Hz.
   real(wp), parameter :: lowest = 10.0_wp, highest = 1000.0_wp

   !> Number of branches for a constant loss factor, two per decade; the outer ones lie half a decade outside the band. They
   !> keep a loss factor up to 0.5 constant within 0.3 %.
   integer, parameter :: n_branch = 7

   !> Number of frequencies of a fit.
   integer, parameter :: n_frequency = 100

contains

   !> Complex modulus (storage and loss modulus) divided by the long-term modulus.
   pure function get_modulus_ratio(relative_modulus, time, omega) result(ratio)
      !> Relative moduli of the branches, and their relaxation times, s: [n_branch].
      real(wp), intent(in) :: relative_modulus(:), time(:)
      !> Angular frequency, rad/s.
      real(wp), intent(in) :: omega
      complex(wp) :: ratio

      ratio = cmplx(1 + sum(relative_modulus*(omega*time)**2/(1 + (omega*time)**2)), &
         sum(relative_modulus*omega*time/(1 + (omega*time)**2)), wp)
   end function get_modulus_ratio

   !> Series whose loss factor is constant from 10 to 1000 Hz.
   !>
   !> The condition loss modulus = loss factor times storage modulus is linear in the moduli of the branches: least squares
   !> over logarithmically spaced frequencies.
   subroutine fit_constant_loss(loss_factor, relative_modulus, time, failed)
      real(wp), intent(in) :: loss_factor
      !> Relative moduli of the branches: [n_branch].
      real(wp), allocatable, intent(out) :: relative_modulus(:)
      !> Their relaxation times, s: [n_branch].
      real(wp), allocatable, intent(out) :: time(:)
      !> True if a modulus would be negative: the loss factor is above about 0.9.
      logical, intent(out) :: failed
      real(wp) :: omega
      real(wp) :: matrix(n_frequency, n_branch), right(n_frequency), work(64*n_branch), omega_tau(n_branch)
      integer :: i, info

      allocate (relative_modulus(n_branch))
      allocate (time, source=[(1/(2*pi*lowest*(highest/lowest)**((i - 2)/real(n_branch - 3, wp))), i=1, n_branch)])
      do i = 1, n_frequency
         omega = 2*pi*lowest*(highest/lowest)**((i - 1)/real(n_frequency - 1, wp))
         omega_tau = omega*time
         matrix(i, :) = (omega_tau - loss_factor*omega_tau**2)/(1 + omega_tau**2)
         right(i) = loss_factor
         ! Divided by the storage modulus of a constant loss factor, proportional to omega**(2/pi atan(loss_factor)), all
         ! equations have the same weight.
         matrix(i, :) = matrix(i, :)*omega**(-2/pi*atan(loss_factor))
         right(i) = right(i)*omega**(-2/pi*atan(loss_factor))
      end do
      call dgels('N', n_frequency, n_branch, 1, matrix, n_frequency, right, n_frequency, work, size(work), info)
      relative_modulus = right(:n_branch)
      failed = info /= 0 .or. minval(relative_modulus) < 0.0_wp
   end subroutine fit_constant_loss

   !> Checks that a fractional law has a series. It has none if its loss factor is not below that of the spring-pot alone
   !> (the spring would be negative), or if the frequency of the loss factor lies outside the band.
   subroutine check_fractional_loss(group, order, loss_factor, frequency, error)
      !> Namelist group, for the message.
      character(len=*), intent(in) :: group
      real(wp), intent(in) :: order, loss_factor
      !> Frequency of the loss factor, Hz.
      real(wp), intent(in) :: frequency
      type(error_type), allocatable, intent(out) :: error

      if (frequency < series_from .or. frequency > series_to) then
         error = input_error('= '//to_text(frequency)//' Hz is not allowed with a fractional law; allowed: ' &
            //to_text(series_from)//' to '//to_text(series_to), group, 'loss_frequency')
      else if (loss_factor >= tan(pi/2*order)) then
         ! For order 1 the tangent is infinite; in floating point it is very large.
         error = input_error('= '//to_text(loss_factor)//' is more than a material of fractional_order = '//to_text(order) &
            //' can have; allowed: below '//to_text(tan(pi/2*order)), group, 'loss_factor')
      end if
   end subroutine check_fractional_loss

   !> Series of a fractional Kelvin-Voigt law from 5 to 3000 Hz: a spring, branches and a viscosity in parallel.
   !>
   !> The law is a spring parallel to a spring-pot, G(i omega) = G0 + c (i omega)**order. Order 1 is the classical viscosity;
   !> near order 0 the loss factor hardly depends on frequency. Least squares of the complex power law over logarithmically
   !> spaced frequencies, relative to its magnitude. The fit omits the spring of the law, which only reduces the relative
   !> error of the sum.
   subroutine fit_fractional_loss(order, loss_factor, frequency, relative_modulus, time, viscosity)
      !> Order of the derivative; loss factor; its frequency, Hz.
      real(wp), intent(in) :: order, loss_factor, frequency
      !> Relative moduli of the branches: [n_branch].
      real(wp), allocatable, intent(out) :: relative_modulus(:)
      !> Their relaxation times, s: [n_branch].
      real(wp), allocatable, intent(out) :: time(:)
      !> Viscosity divided by the long-term modulus, s.
      real(wp), intent(out) :: viscosity
      integer, parameter :: n_term = n_fractional + 2
      real(wp), parameter :: rounding = 1.0e-12_wp
      real(wp), parameter :: span = series_to/series_from*outside**2
      real(wp) :: omega, omega_max, spring, springpot
      complex(wp) :: term(n_term)
      real(wp) :: matrix(2*n_frequency, n_term), right(2*n_frequency), work(64*n_term)
      integer :: i, info

      allocate (time, source=[(outside/(2*pi*series_from*span**((i - 1)/real(n_fractional - 1, wp))), i=1, n_fractional)])
      omega_max = 2*pi*series_to
      do i = 1, n_frequency
         omega = 2*pi*series_from*(series_to/series_from)**((i - 1)/real(n_frequency - 1, wp))
         term = [cmplx(1.0_wp, 0.0_wp, wp), 1 - 1/cmplx(1.0_wp, omega*time, wp), cmplx(0.0_wp, omega/omega_max, wp)]
         term = term*(omega_max/omega)**order
         matrix(i, :) = real(term)
         matrix(n_frequency + i, :) = aimag(term)
      end do
      right = [spread(cos(pi/2*order), 1, n_frequency), spread(sin(pi/2*order), 1, n_frequency)]
      ! The columns are independent, and the moduli are positive for any order (see the tests).
      call dgels('N', size(right), n_term, 1, matrix, size(right), right, size(right), work, size(work), info)
      ! Of the spring-pot at its frequency, over the storage modulus there.
      springpot = loss_factor/sin(pi/2*order)
      right = max(right, 0.0_wp)*springpot*(omega_max/(2*pi*frequency))**order
      spring = 1 - springpot*cos(pi/2*order) + right(1)
      ! The spring-pot of order 1 is a viscosity: its branches are rounding errors.
      time = pack(time, right(2:n_term - 1) > rounding*sum(right(:n_term)))
      relative_modulus = pack(right(2:n_term - 1), right(2:n_term - 1) > rounding*sum(right(:n_term)))/spring
      viscosity = right(n_term)/(omega_max*spring)
   end subroutine fit_fractional_loss

end module thud_prony
