!> Fractional-octave bands of base 10 (IEC 61260-1) in the range of heavy impacts.
module thud_band
   use thud_kinds, only: wp
   use thud_text, only: fixed
   implicit none (type, external)
   private

   public :: band_choices, band_set_names, band_type, get_band_name, get_bands, get_level_bands
   public :: octave_count, octave_set, octaves

   !> Adjacent bands of one width.
   type :: band_set_type
      character(len=24) :: name
      !> Width in tenths of a decade: 3 for octaves, 1 for one-third octaves.
      integer :: width
      !> Mid frequencies of the lowest and highest band, as distances from 1 kHz in tenths of a decade.
      integer :: first, last
   end type band_set_type

   !> All sets; assessments use the first, the octaves from 31.5 to 500 Hz.
   type(band_set_type), parameter :: sets(*) = [ &
      band_set_type('octave', width=3, first=-15, last=-3), &
      band_set_type('third', width=1, first=-16, last=-2)]

   !> Names of all sets: [n_set].
   character(len=24), parameter :: band_set_names(*) = sets%name

   !> The set that assessments use.
   character(len=24), parameter :: octave_set = band_set_names(1)

   !> Choices for a case: one set, or `both`: [n_set + 1].
   character(len=24), parameter :: band_choices(*) = [band_set_names, [character(len=24) :: 'both']]

   !> One band.
   type :: band_type
      !> Name of its set.
      character(len=24) :: set = ''
      !> Nominal mid frequency, Hz, the name of the band.
      real(wp) :: nominal = 0.0_wp
      !> Exact mid frequency, Hz.
      real(wp) :: center = 0.0_wp
      !> Band edges, Hz.
      real(wp) :: lower = 0.0_wp, upper = 0.0_wp
   end type band_type

   !> Nominal mid frequencies in a decade, the series R10 of ISO 3.
   real(wp), parameter :: rounded(*) = [1.0_wp, 1.25_wp, 1.6_wp, 2.0_wp, 2.5_wp, 3.15_wp, 4.0_wp, 5.0_wp, 6.3_wp, 8.0_wp]

   !> Index of a set; distance of a band from 1 kHz in tenths of a decade.
   integer :: i, k

   !> Bands of all sets, with mid frequencies 1000 * 10^(k/10) Hz.
   type(band_type), parameter :: all_bands(*) = [((band_type(sets(i)%name, &
      rounded(1 + modulo(k, 10))*10.0_wp**(3 + (k - modulo(k, 10))/10), 1000*10**(k/10.0_wp), &
      1000*10**((k - sets(i)%width/2.0_wp)/10), 1000*10**((k + sets(i)%width/2.0_wp)/10)), &
      k=sets(i)%first, sets(i)%last, sets(i)%width), i=1, size(sets))]

   !> Number of octaves.
   integer, parameter :: octave_count = count(all_bands%set == octave_set)

   !> The octaves that assessments use, ascending: [octave_count].
   type(band_type), parameter :: octaves(octave_count) = all_bands(:octave_count)

contains

   !> Bands of a set; empty if no set has this name.
   pure function get_bands(name) result(bands)
      character(len=*), intent(in) :: name
      !> The bands, ascending: [n_band].
      type(band_type), allocatable :: bands(:)

      bands = pack(all_bands, all_bands%set == name)
   end function get_bands

   !> Bands of the levels of a case: the octaves, which assessments use, then the other bands of the case.
   pure subroutine get_level_bands(choice, bands, first)
      !> One of `band_choices`.
      character(len=*), intent(in) :: choice
      !> The bands, octaves first: [n_band].
      type(band_type), allocatable, intent(out) :: bands(:)
      !> Index of the first band of the choice.
      integer, intent(out) :: first

      bands = [octaves, pack(all_bands, all_bands%set /= octave_set &
         .and. (all_bands%set == choice .or. choice == 'both'))]
      first = merge(octave_count + 1, 1, any(choice == band_set_names(2:)))
   end subroutine get_level_bands

   !> Nominal frequency of a band as text: `31.5`, `63`.
   pure function get_band_name(band) result(name)
      type(band_type), intent(in) :: band
      character(len=len(fixed(band%nominal, nint(2*band%nominal) - 2*int(band%nominal)))) :: name

      ! Only the half in 31.5 needs a decimal.
      name = fixed(band%nominal, nint(2*band%nominal) - 2*int(band%nominal))
   end function get_band_name

end module thud_band
