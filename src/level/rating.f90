!> Levels of heavy impacts in the room below: standardization (ISO 16283-2) and single-number ratings
!> (ISO 717-2 annex D, KS F 2863-2).
module thud_rating
   use thud_band, only: band_type, get_bands
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: class_limits, correct_for_background, get_a_weighted_level, get_class, get_inverse_a_rating
   public :: get_rated_bands, get_rounded, get_standardization, rating_names, rating_titles

   !> Nominal mid frequency of the lowest one-third-octave band that is rated, Hz.
   real(wp), parameter :: lowest_rated = 50.0_wp

   !> A-weighting of the one-third-octave bands 50 to 630 Hz as ISO 717-2 annex D rounds it, dB; that of octaves is the same.
   real(wp), parameter :: a_weighting(*) = [-30.3_wp, -26.2_wp, -22.4_wp, -19.1_wp, -16.2_wp, -13.2_wp, -10.8_wp, -8.7_wp, &
      -6.6_wp, -4.8_wp, -3.2_wp, -1.9_wp]

   !> Single-number ratings of a prediction: A-weighted maximum levels of octaves or one-third octaves in the room, and of
   !> standardized one-third octaves.
   character(len=12), parameter :: rating_names(*) = [character(len=12) :: 'octaves', 'thirds', 'standardized']

   !> Symbols, bands and standards of these ratings.
   character(len=60), parameter :: rating_titles(size(rating_names)) = [character(len=60) :: &
      'L_iA,Fmax of octaves (KS F ISO 717-2)', 'L_iA,Fmax of one-third octaves (ISO 717-2)', &
      'standardized L_iA,Fmax of one-third octaves (ISO 16283-2)']

   !> Reference volume, m3, and reverberation time, s (ISO 16283-2).
   real(wp), parameter :: reference_volume = 50.0_wp, reference_reverberation = 0.5_wp

   !> Reverberation time of a decay with the time constant of the Fast detector, s: 0.125 s * 6 ln 10, with
   !> 6 ln 10 rounded to 13.82 as in ISO 16283-2.
   real(wp), parameter :: fast_reverberation = 1.7275_wp

   !> Upper limits of the A-weighted level for the classes 1 to 4, dB (KS F 2863-2).
   real(wp), parameter :: class_limits(*) = [37.0_wp, 41.0_wp, 45.0_wp, 49.0_wp]

   !> Reference curve in the octaves 63 to 500 Hz, dB (KS F 2863-2).
   real(wp), parameter :: inverse_a_curve(*) = [83.0_wp, 73.0_wp, 66.0_wp, 60.0_wp]

   !> Allowed sum of the excesses over the curve, dB.
   real(wp), parameter :: max_excess = 8.0_wp

   !> Limit of levels, dB, from which whole numbers are computed: infinite ones have ratings too.
   real(wp), parameter :: max_finite_level = 1.0e6_wp

   !> Difference to the background below which a level is corrected, dB.
   real(wp), parameter :: clear_difference = 15.0_wp
   !> Difference to the background below which the correction is constant, dB.
   real(wp), parameter :: min_difference = 6.0_wp

contains

   !> Bands that a rating uses: octaves from 63 Hz, one-third-octave bands from 50 Hz. One-third-octave bands are not summed
   !> into octaves first: the maximum of a sum is not the sum of the maxima.
   pure function get_rated_bands(name) result(bands)
      !> One of `band_set_names`.
      character(len=*), intent(in) :: name
      !> The bands, ascending: [n_band].
      type(band_type), allocatable :: bands(:)

      bands = get_bands(name)
      bands = pack(bands, bands%nominal >= lowest_rated)
   end function get_rated_bands

   !> A-weighted maximum level from the bands of a set (ISO 717-2 annex D), not rounded, dB.
   pure function get_a_weighted_level(name, level) result(total)
      !> One of `band_set_names`.
      character(len=*), intent(in) :: name
      !> Levels of its rated bands, dB: [n_band].
      real(wp), intent(in) :: level(:)
      real(wp) :: total

      associate (first => merge(2, 1, name == 'octave'), stride => merge(3, 1, name == 'octave'))
         total = 10*log10(sum(10**((level + a_weighting(first::stride))/10)))
      end associate
   end function get_a_weighted_level

   !> A single number as it is stated: rounded, halves upwards.
   elemental function get_rounded(level) result(rounded)
      !> The level, dB.
      real(wp), intent(in) :: level
      !> The integer level, dB.
      integer :: rounded

      rounded = floor(max(-max_finite_level, min(max_finite_level, level)) + 0.5_wp)
   end function get_rounded

   !> Class of an A-weighted level without standardization (KS F 2863-2).
   pure function get_class(level) result(number)
      !> The level, dB.
      real(wp), intent(in) :: level
      !> 1 to 4; 0 above the limit of class 4.
      integer :: number

      number = findloc(get_rounded(level) <= class_limits, .true., dim=1)
   end function get_class

   !> Rating by the inverse A-weighted reference curve (KS F 2863-2, before the A-weighted level replaced it).
   pure function get_inverse_a_rating(level) result(rating)
      !> Levels of the octaves 63 to 500 Hz, dB: [4].
      real(wp), intent(in) :: level(:)
      !> Level of the shifted curve at 500 Hz, dB.
      integer :: rating
      real(wp) :: excess(size(level))
      integer :: shift

      excess = max(-max_finite_level, min(max_finite_level, level - inverse_a_curve))
      ! Start where the largest excess alone is above the allowed sum: at most that many steps of 1 dB are left.
      shift = floor(maxval(excess) - max_excess) - 1
      do while (sum(max(0.0_wp, excess - shift)) > max_excess)
         shift = shift + 1
      end do
      rating = nint(inverse_a_curve(size(inverse_a_curve))) + shift
   end function get_inverse_a_rating

   !> Standardized level minus measured level: 10 lg(V/V0) - 10 lg(g(C)/g(C0)) (ISO 16283-2).
   !>
   !> g(C) is the maximum of the Fast detector for a decay with the reverberation time T, divided by its value for a steady
   !> sound with the initial energy: C**(-1/(C - 1)) with C = T/1.7275 s; the standard prints the same with more terms.
   elemental function get_standardization(reverberation_time, volume) result(difference)
      !> Reverberation time, s; volume, m3.
      real(wp), intent(in) :: reverberation_time, volume
      !> The difference, dB.
      real(wp) :: difference
      real(wp), dimension(2) :: c, log_gain

      c = [reverberation_time, reference_reverberation]/fast_reverberation
      ! ln g, which tends to -1 at C = 1; near 1 the difference is exact.
      log_gain = -1.0_wp
      where (abs(c - 1) > 0.0_wp) log_gain = -log(c)/(c - 1)
      difference = 10*log10(volume/reference_volume) - 10/log(10.0_wp)*(log_gain(1) - log_gain(2))
   end function get_standardization

   !> Level without the background (ISO 16283-2). From 6 to 15 dB above the background, its energy is subtracted from the
   !> level. Nearer to the background, the correction is that for 6 dB, and the result is an upper bound.
   elemental subroutine correct_for_background(level, background, corrected, is_upper_bound)
      !> Level including the background, and level of the background alone, dB.
      real(wp), intent(in) :: level, background
      !> The level without the background, dB.
      real(wp), intent(out) :: corrected
      !> True if the level is less than 6 dB above the background: the corrected level is an upper bound.
      logical, intent(out) :: is_upper_bound

      is_upper_bound = level - background < min_difference
      corrected = level
      if (level - background < clear_difference) corrected = level &
         + 10*log10(1 - 10**(-max(level - background, min_difference)/10))
   end subroutine correct_for_background

end module thud_rating
