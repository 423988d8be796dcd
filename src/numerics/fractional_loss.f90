!> The fractional Kelvin-Voigt law: a spring parallel to a spring-pot, G(i omega) = G0 + c (i omega)**order.
!>
!> Order 1 is the classical Kelvin-Voigt viscosity; near order 0 the loss factor hardly depends on frequency.
module thud_fractional_loss
   use thud_constants, only: pi
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: fractional_loss_type, new_fractional_loss

   !> The damping law; moduli are divided by the storage modulus at the frequency of the loss factor.
   type :: fractional_loss_type
      !> Order of the derivative.
      real(wp) :: order
      !> Modulus of the spring, G0.
      real(wp) :: spring
      !> Magnitude of the modulus of the spring-pot at `omega`.
      real(wp) :: springpot
      !> Angular frequency of the loss factor, rad/s.
      real(wp) :: omega
   end type fractional_loss_type

contains

   !> The damping law with a given loss factor at a given frequency.
   pure function new_fractional_loss(order, loss_factor, frequency) result(law)
      real(wp), intent(in) :: order, loss_factor
      !> The frequency, Hz.
      real(wp), intent(in) :: frequency
      type(fractional_loss_type) :: law

      law%order = order
      law%springpot = loss_factor/sin(pi/2*order)
      law%spring = 1 - law%springpot*cos(pi/2*order)
      law%omega = 2*pi*frequency
   end function new_fractional_loss

end module thud_fractional_loss
