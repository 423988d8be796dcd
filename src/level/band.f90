!> Fractional-octave bands of base 10 (IEC 61260-1) in the range of heavy impacts.
module thud_band
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: band_type, get_octaves, get_thirds, octave_count, third_count

   !> Octaves from 31.5 to 500 Hz.
   integer, parameter :: octave_count = 5

   !> Third octaves from 25 to 630 Hz.
   integer, parameter :: third_count = 15

   !> One band.
   type :: band_type
      !> Name of the band, its rounded mid frequency, Hz.
      real(wp) :: nominal = 0.0_wp
      !> Exact mid frequency, Hz.
      real(wp) :: centre = 0.0_wp
      !> Lower band edge, Hz.
      real(wp) :: lower = 0.0_wp
      !> Upper band edge, Hz.
      real(wp) :: upper = 0.0_wp
   end type band_type

contains

   !> Octaves: mid frequencies 1000 * 10^(3k/10) Hz.
   pure function get_octaves() result(bands)
      !> Octaves 31.5 to 500 Hz, ascending: [5].
      type(band_type) :: bands(octave_count)
      real(wp), parameter :: nominal(octave_count) = [31.5_wp, 63.0_wp, 125.0_wp, 250.0_wp, 500.0_wp]
      integer :: k

      bands = [(new_band(nominal(k + 6), 3*k, 3), k = -5, -1)]
   end function get_octaves

   !> Third octaves: mid frequencies 1000 * 10^(k/10) Hz.
   pure function get_thirds() result(bands)
      !> Thirds 25 to 630 Hz, ascending: [15].
      type(band_type) :: bands(third_count)
      real(wp), parameter :: nominal(third_count) = [25.0_wp, 31.5_wp, 40.0_wp, 50.0_wp, 63.0_wp, 80.0_wp, &
         100.0_wp, 125.0_wp, 160.0_wp, 200.0_wp, 250.0_wp, 315.0_wp, 400.0_wp, 500.0_wp, 630.0_wp]
      integer :: k

      bands = [(new_band(nominal(k + 17), k, 1), k = -16, -2)]
   end function get_thirds

   !> Band around 1000 * 10^(tenths/10) Hz.
   pure function new_band(nominal, tenths, width) result(band)
      !> Rounded mid frequency, Hz.
      real(wp), intent(in) :: nominal
      !> Distance from 1 kHz in tenths of a decade.
      integer, intent(in) :: tenths
      !> Width in tenths of a decade: 3 for an octave, 1 for a third.
      integer, intent(in) :: width
      !> The band.
      type(band_type) :: band

      band%nominal = nominal
      band%centre = 1000*10**(tenths/10.0_wp)
      band%lower = 1000*10**((tenths - width/2.0_wp)/10)
      band%upper = 1000*10**((tenths + width/2.0_wp)/10)
   end function new_band

end module thud_band
