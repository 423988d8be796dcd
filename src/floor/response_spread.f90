!> Scatter of individual positions, floors and rooms about the statistical mean.
module thud_response_spread
   use thud_constants, only: pi
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: get_band_variance, get_level_spread

   !> Fourth moment of a sinusoidal mode divided by the square of its second moment, per dimension.
   real(wp), parameter :: moment_ratio = 1.5_wp

contains

   !> Relative variance of the band-averaged energy of the excitation or response at one point.
   !>
   !> (alpha - 1)/(pi m B**2) (2 B arctan B - ln(1 + B**2)) + ln(1 + B**2)/(pi m B**2) with the modal overlap
   !> m = a n/(2 pi), the decay rate a, the modes per hertz n and B = 2 pi bandwidth/a, for mode spacings of the Gaussian
   !> orthogonal ensemble (Langley and Cotoni 2004); alpha = 1.5**d for sinusoidal modes in d dimensions. With many modes in
   !> the band and little damping, the variance is (alpha - 1)/(number of modes).
   elemental function get_band_variance(dimensions, mode_density, decay, bandwidth) result(variance)
      !> Dimensions of the subsystem: 2 for a plate, 3 for a room.
      integer, intent(in) :: dimensions
      !> Modes per hertz, s; decay rate of the energy, 1/s; bandwidth, Hz.
      real(wp), intent(in) :: mode_density, decay, bandwidth
      real(wp) :: variance

      associate (overlap => decay*mode_density/(2*pi), b => 2*pi*bandwidth/decay)
         variance = ((moment_ratio**dimensions - 1)*(2*b*atan(b) - log(1 + b**2)) + log(1 + b**2))/(pi*overlap*b**2)
      end associate
   end function get_band_variance

   !> Standard deviation of a level whose energy is a product of independent log-normal factors, dB.
   pure function get_level_spread(variances) result(spread)
      !> Relative variances of the factors: [n].
      real(wp), intent(in) :: variances(:)
      real(wp) :: spread

      spread = 10/log(10.0_wp)*sqrt(sum(log(1 + variances)))
   end function get_level_spread

end module thud_response_spread
