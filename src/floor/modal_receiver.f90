!> Receivers made of modes, and of what the modes in a list leave out.
module thud_modal_receiver
   use thud_kinds, only: wp
   use thud_receiver, only: receiver_type
   implicit none (type, external)
   private

   public :: new_modal_receiver

contains

   !> Sum of modes, gain s/(s**2 + eta omega s + omega**2), and of their rest.
   !>
   !> The loss factor of a mode is that of a dashpot at its frequency. The rest has a compliance C at low frequencies and
   !> the conductance G = sqrt(2) C w at those above a corner w: G (s**2 + w s/sqrt(2))/(s**2 + sqrt(2) w s + w**2). It is
   !> passive and takes hardly any power below the corner: with x = omega/w its real part is G x**4/(1 + x**4), its imaginary
   !> part omega C (1 + x**2)/(1 + x**4).
   pure subroutine new_modal_receiver(gain, omega, loss_factor, compliance, corner, receiver)
      !> Products of the mode's shape at source and point over its modal mass, 1/kg: [n].
      real(wp), intent(in) :: gain(:)
      !> Angular frequencies, rad/s, and loss factors, below 2: [n].
      real(wp), intent(in) :: omega(:), loss_factor(:)
      !> Compliance of the rest, m/N; its corner, rad/s.
      real(wp), intent(in) :: compliance, corner
      type(receiver_type), intent(out) :: receiver
      complex(wp) :: pole
      integer :: i, n

      n = size(gain)
      allocate (receiver%pole(n + 1), receiver%residue(n + 1))
      do i = 1, n
         pole = omega(i)*cmplx(-loss_factor(i)/2, sqrt(1 - (loss_factor(i)/2)**2), wp)
         receiver%pole(i) = pole
         receiver%residue(i) = gain(i)*cmplx(1.0_wp, -pole%re/pole%im, wp)
      end do
      ! Without G the quotient is -G (w s/sqrt(2) + w**2)/(s**2 + ...): at its pole w (i - 1)/sqrt(2), doubled, -G w (1 - i)/
      ! sqrt(2).
      receiver%direct = sqrt(2.0_wp)*compliance*corner
      receiver%pole(n + 1) = corner*cmplx(-1.0_wp, 1.0_wp, wp)/sqrt(2.0_wp)
      receiver%residue(n + 1) = -receiver%direct*corner*cmplx(1.0_wp, -1.0_wp, wp)/sqrt(2.0_wp)
   end subroutine new_modal_receiver

end module thud_modal_receiver
