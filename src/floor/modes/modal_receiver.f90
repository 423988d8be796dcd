!> Receivers made of modes and residual modes.
module thud_modal_receiver
   use thud_constants, only: pi
   use thud_error, only: error_type, input_error
   use thud_kinds, only: wp
   use thud_receiver, only: receiver_type
   use thud_text, only: fixed, to_text
   implicit none (type, external)
   private

   public :: new_modal_receiver

contains

   !> Sum of modes, gain s/(s**2 + eta omega s + omega**2), and residual modes.
   !>
   !> Modes have viscous damping, with the given loss factor at their frequency. Residual modes have a compliance C at low
   !> frequencies and, above a corner frequency w, the conductance G = sqrt(2) C w:
   !> G (s**2 + w s/sqrt(2))/(s**2 + sqrt(2) w s + w**2). This is passive and absorbs hardly any power below the corner: with
   !> x = omega/w its real part is G x**4/(1 + x**4), its imaginary part omega C (1 + x**2)/(1 + x**4).
   subroutine new_modal_receiver(group, gain, omega, loss_factor, residual, receiver, error)
      !> Namelist group, for messages.
      character(len=*), intent(in) :: group
      !> Product of the mode shapes at source and point, divided by the modal mass, 1/kg: [n].
      real(wp), intent(in) :: gain(:)
      !> Angular frequencies, rad/s, and loss factors: [n].
      real(wp), intent(in) :: omega(:), loss_factor(:)
      !> Compliance, m/N, and corner frequency, rad/s, of the residual modes: [2].
      real(wp), intent(in) :: residual(2)
      type(receiver_type), intent(out) :: receiver
      !> Set if a mode is overdamped: its loss factor is 2 or more.
      type(error_type), allocatable, intent(out) :: error
      complex(wp) :: pole
      integer :: i, n

      i = maxloc(loss_factor, dim=1)
      if (i > 0) then
         if (.not. loss_factor(i) < 2.0_wp) then
            error = input_error('&'//group//': the total loss factor is '//to_text(loss_factor(i))//' at ' &
               //fixed(omega(i)/(2*pi), 1)//' Hz; allowed: below 2')
            return
         end if
      end if
      n = size(gain)
      allocate (receiver%pole(n + 1), receiver%residue(n + 1))
      do i = 1, n
         if (.not. omega(i) > 0.0_wp) then
            ! A rigid body that nothing holds.
            receiver%pole(i) = 0.0_wp
            receiver%residue(i) = gain(i)
            cycle
         end if
         pole = omega(i)*cmplx(-loss_factor(i)/2, sqrt(1 - (loss_factor(i)/2)**2), wp)
         receiver%pole(i) = pole
         receiver%residue(i) = gain(i)*cmplx(1.0_wp, -pole%re/pole%im, wp)
      end do
      ! Without its direct part G, the quotient is -G (w s/sqrt(2) + w**2)/(s**2 + ...). Its doubled residue at the pole
      ! w (i - 1)/sqrt(2) is -G w (1 - i)/sqrt(2).
      associate (compliance => residual(1), corner => residual(2))
         receiver%direct = sqrt(2.0_wp)*compliance*corner
         receiver%pole(n + 1) = corner*cmplx(-1.0_wp, 1.0_wp, wp)/sqrt(2.0_wp)
         receiver%residue(n + 1) = -receiver%direct*corner*cmplx(1.0_wp, -1.0_wp, wp)/sqrt(2.0_wp)
      end associate
   end subroutine new_modal_receiver

end module thud_modal_receiver
