!> The fractional law of Kelvin and Voigt: a spring beside a spring-pot, G(i omega) = G0 + c (i omega)**order.
!>
!> Order 1 is the viscosity of Kelvin and Voigt; near 0 the loss factor hardly depends on frequency.
module thud_fractional_loss
   use thud_constants, only: pi
   use thud_error, only: error_type, input_error
   use thud_kinds, only: wp
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: check_fractional_loss, fractional_loss_type, get_modulus, new_fractional_loss

   !> The law; moduli over the storage modulus at the frequency of the loss factor.
   type :: fractional_loss_type
      !> Order of the derivative.
      real(wp) :: order
      !> Modulus of the spring, G0.
      real(wp) :: spring
      !> Absolute modulus of the spring-pot at `omega`.
      real(wp) :: pot
      !> Angular frequency of the loss factor, rad/s.
      real(wp) :: omega
   end type fractional_loss_type

contains

   !> Refuses a loss factor that the spring-pot alone does not reach: the spring would have to be negative.
   subroutine check_fractional_loss(group, order, loss_factor, error)
      !> Group of the keys, for the message.
      character(len=*), intent(in) :: group
      real(wp), intent(in) :: order, loss_factor
      type(error_type), allocatable, intent(out) :: error

      ! The tangent of order 1 is infinite, in floating point too large.
      if (loss_factor >= tan(pi/2*order)) error = input_error('&'//group//': loss_factor = '//to_text(loss_factor) &
         //' is more than a material of fractional_order = '//to_text(order)//' can have; allowed: below ' &
         //to_text(tan(pi/2*order)))
   end subroutine check_fractional_loss

   !> The law that has a loss factor at a frequency.
   pure function new_fractional_loss(order, loss_factor, frequency) result(law)
      real(wp), intent(in) :: order, loss_factor
      !> The frequency, Hz.
      real(wp), intent(in) :: frequency
      type(fractional_loss_type) :: law

      law%order = order
      law%pot = loss_factor/sin(pi/2*order)
      law%spring = 1 - law%pot*cos(pi/2*order)
      law%omega = 2*pi*frequency
   end function new_fractional_loss

   !> Complex modulus over the storage modulus at the frequency of the loss factor.
   pure elemental function get_modulus(law, omega) result(modulus)
      type(fractional_loss_type), intent(in) :: law
      !> Angular frequency, rad/s.
      real(wp), intent(in) :: omega
      complex(wp) :: modulus

      modulus = law%spring + law%pot*(omega/law%omega)**law%order*exp(cmplx(0.0_wp, pi/2*law%order, wp))
   end function get_modulus

end module thud_fractional_loss
