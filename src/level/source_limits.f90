!> Requirements of the standards for heavy/soft impact sources, and the verdict on a force history (JIS A 1418-2:2019 tables
!> A.1 and A.2, ISO 10140-5:2021 table F.1, ISO 16283-2:2020 table A.1).
module thud_source_limits
   use thud_band, only: band_type, get_band_name, get_octaves, octave_count
   use thud_constants, only: recorded_band
   use thud_error, only: error_type, input_error
   use thud_kinds, only: wp
   use thud_text, only: join_quoted, quoted, replaced
   use thud_transform, only: get_low_pass
   implicit none (type, external)
   private

   public :: conforms, criterion_type, get_criteria, get_peak_count, get_source_limits, is_undecided
   public :: criterion_count, source_limits_type, source_names

   !> Number of criteria of a verdict: octaves, contact time, restitution, peaks, mass, drop height.
   integer, parameter :: criterion_count = octave_count + 5

   !> A peak is a maximum on both sides of which the force falls by more than this fraction of the peak force. The standards
   !> require a single peak without defining one; ripples of a few percent are no second impact.
   real(wp), parameter :: peak_prominence = 0.1_wp

   !> Minimum and maximum conforming values of one source.
   type :: source_limits_type
      !> Name of the source.
      character(len=24) :: name
      !> Minimum and maximum force exposure levels of the octaves 31.5 to 500 Hz, dB.
      real(wp) :: lower_level(octave_count), upper_level(octave_count)
      !> Contact time, s.
      real(wp) :: contact_time(2) = [18.0e-3_wp, 22.0e-3_wp]
      !> Coefficient of restitution.
      real(wp) :: restitution(2) = [0.7_wp, 0.9_wp]
      !> Mass, kg.
      real(wp) :: mass(2)
      !> Drop height, m.
      real(wp) :: drop_height(2)
   end type source_limits_type

   !> Heavy/soft impact sources with limits in the standards.
   type(source_limits_type), parameter :: sources(*) = [ &
      ! Impact force characteristic (2): 39 +- 1, 31 +- 1.5, 23 +- 1.5, 17 +- 2, 12.5 +- 2 dB.
      source_limits_type('rubber_ball', &
         lower_level=[38.0_wp, 29.5_wp, 21.5_wp, 15.0_wp, 10.5_wp], &
         upper_level=[40.0_wp, 32.5_wp, 24.5_wp, 19.0_wp, 14.5_wp], &
         mass=[2.4_wp, 2.6_wp], drop_height=[0.99_wp, 1.01_wp]), &
      ! "Bang machine", characteristic (1): 47 +- 1, 40 +- 1.5, 22 +- 1.5, 11.5 +- 2, 5.5 +- 2 dB.
      ! The standards give its drop height without a tolerance; the ball's 1 cm is used.
      source_limits_type('tyre', &
         lower_level=[46.0_wp, 38.5_wp, 20.5_wp, 9.5_wp, 3.5_wp], &
         upper_level=[48.0_wp, 41.5_wp, 23.5_wp, 13.5_wp, 7.5_wp], &
         mass=[7.1_wp, 7.5_wp], drop_height=[0.84_wp, 0.86_wp])]

   !> Names of the sources: [n_source].
   character(len=24), parameter :: source_names(*) = sources%name

   !> A quantity and the range in which it must lie.
   type :: criterion_type
      character(len=24) :: name = ''
      !> SI unit or dB; empty for pure numbers.
      character(len=8) :: unit = ''
      !> Value of the source under test.
      real(wp) :: value = 0.0_wp
      !> Minimum and maximum conforming value.
      real(wp) :: lower = 0.0_wp, upper = 0.0_wp
      !> Numerical error of the value; NaN if unknown.
      real(wp) :: error = 0.0_wp
   end type criterion_type

contains

   !> Limits of a source.
   subroutine get_source_limits(source, limits, error)
      !> One of `source_names`.
      character(len=*), intent(in) :: source
      type(source_limits_type), intent(out) :: limits
      !> Set if the source is not known.
      type(error_type), allocatable, intent(out) :: error
      integer :: at

      at = findloc(source_names == source, .true., dim=1)
      if (at == 0) then
         error = input_error('the source '//quoted(source)//' is not known; allowed: '//join_quoted(source_names))
      else
         limits = sources(at)
      end if
   end subroutine get_source_limits

   !> All criteria for a source, in a fixed order: [criterion_count].
   pure function get_criteria(limits, levels, contact_time, restitution, peak_count, mass, drop_height) &
      result(criteria)
      type(source_limits_type), intent(in) :: limits
      !> Force exposure levels of the octaves 31.5 to 500 Hz, dB: [octave_count].
      real(wp), intent(in) :: levels(:)
      !> Contact time, s; coefficient of restitution.
      real(wp), intent(in) :: contact_time, restitution
      integer, intent(in) :: peak_count
      !> Mass of the source, kg; drop height, m.
      real(wp), intent(in) :: mass, drop_height
      type(criterion_type) :: criteria(criterion_count)
      type(band_type) :: octaves(octave_count)
      integer :: i

      octaves = get_octaves()
      associate (n => octave_count)
         do i = 1, n
            criteria(i) = criterion_type(get_level_name(octaves(i)), 'dB', levels(i), limits%lower_level(i), &
               limits%upper_level(i))
         end do
         criteria(n + 1) = between('contact_time', 's', contact_time, limits%contact_time)
         criteria(n + 2) = between('restitution', '', restitution, limits%restitution)
         criteria(n + 3) = between('peak_count', '', real(peak_count, wp), [1.0_wp, 1.0_wp])
         criteria(n + 4) = between('mass', 'kg', mass, limits%mass)
         criteria(n + 5) = between('drop_height', 'm', drop_height, limits%drop_height)
      end associate
   end function get_criteria

   !> Name of the level of a band: `octave_31_5`.
   pure function get_level_name(band) result(name)
      type(band_type), intent(in) :: band
      character(len=24) :: name

      name = replaced(trim(band%set)//'_'//get_band_name(band), '.', '_')
   end function get_level_name

   !> Criterion of a value within a range.
   pure function between(name, unit, value, range) result(criterion)
      character(len=*), intent(in) :: name, unit
      !> Value of the source under test.
      real(wp), intent(in) :: value
      !> Minimum and maximum conforming value: [2].
      real(wp), intent(in) :: range(2)
      type(criterion_type) :: criterion

      criterion = criterion_type(name, unit, value, range(1), range(2))
   end function between

   !> Whether a criterion is met; a value that is not a number never conforms.
   elemental function conforms(criterion) result(met)
      type(criterion_type), intent(in) :: criterion
      !> True if the value lies in the range, including its ends.
      logical :: met

      met = criterion%value >= criterion%lower .and. criterion%value <= criterion%upper
   end function conforms

   !> Whether the numerical error of a value could change whether it meets a criterion, or the error is unknown.
   elemental function is_undecided(criterion) result(yes)
      type(criterion_type), intent(in) :: criterion
      logical :: yes

      yes = .not. criterion%error <= min(abs(criterion%value - criterion%lower), abs(criterion%value - criterion%upper))
   end function is_undecided

   !> Number of peaks of a force after low-pass filtering at `recorded_band`; see `peak_prominence`.
   function get_peak_count(whole_force, sample_rate) result(peak_count)
      !> Force, N, that starts and ends at zero: [n_sample].
      real(wp), intent(in) :: whole_force(:)
      !> Samples per second, Hz.
      real(wp), intent(in) :: sample_rate
      integer :: peak_count
      real(wp) :: extreme, threshold
      real(wp) :: force(size(whole_force))
      logical :: rising
      integer :: i

      peak_count = 0
      call get_low_pass(whole_force, sample_rate, recorded_band, force)
      threshold = peak_prominence*maxval(force)
      extreme = 0.0_wp
      rising = .true.
      do i = 1, size(force)
         if (rising) then
            extreme = max(extreme, force(i))
            if (extreme - force(i) > threshold) then
               peak_count = peak_count + 1
               extreme = force(i)
               rising = .false.
            end if
         else
            extreme = min(extreme, force(i))
            if (force(i) - extreme > threshold) then
               extreme = force(i)
               rising = .true.
            end if
         end if
      end do
   end function get_peak_count

end module thud_source_limits
