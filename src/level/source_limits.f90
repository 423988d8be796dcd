!> Requirements of the standards for heavy/soft impact sources, and the verdict on a force history (JIS A 1418-2:2019 tables
!> A.1 and A.2, ISO 10140-5:2021 table F.1, ISO 16283-2:2020 table A.1).
module thud_source_limits
   use thud_band, only: octave_count
   use thud_constants, only: recorded_band
   use thud_error, only: error_type, input_error
   use thud_kinds, only: wp
   use thud_text, only: join_quoted, quoted
   use thud_transform, only: get_low_pass
   implicit none (type, external)
   private

   public :: combine_verdicts, conforms, criterion_count, criterion_type, get_criteria, get_peak_count, get_verdict
   public :: source_names, verdict_names

   !> Verdicts on a criterion, on a source, or on a room.
   integer, parameter, public :: verdict_conforms = 1, verdict_fails = 2, verdict_undecided = 3

   !> Their names, by verdict: [n_verdict].
   character(len=16), parameter :: verdict_names(*) = [character(len=16) :: 'conforms', 'does not conform', 'undecided']

   !> Number of criteria: octaves, contact time, restitution, peaks, mass, drop height.
   integer, parameter :: criterion_count = octave_count + 5

   !> A peak is a maximum on both sides of which the force falls by more than this fraction of the peak force. The standards
   !> require a single peak without defining one; ripples of a few percent are no second impact.
   real(wp), parameter :: peak_prominence = 0.1_wp

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

   !> Names and units of the criteria: [criterion_count].
   character(len=24), parameter :: names(criterion_count) = [character(len=24) :: 'octave_31_5', 'octave_63', 'octave_125', &
      'octave_250', 'octave_500', 'contact_time', 'restitution', 'peak_count', 'mass', 'drop_height']
   character(len=8), parameter :: units(criterion_count) = [character(len=8) :: 'dB', 'dB', 'dB', 'dB', 'dB', 's', '', '', &
      'kg', 'm']

   !> Minimum and maximum conforming values of one source.
   type :: source_limits_type
      !> Name of the source.
      character(len=24) :: name
      !> Values in the order of the criteria, levels in dB, all others in SI units: [criterion_count].
      real(wp) :: lower(criterion_count), upper(criterion_count)
   end type source_limits_type

   !> Heavy/soft impact sources with limits in the standards.
   type(source_limits_type), parameter :: sources(*) = [ &
      ! Impact force characteristic (2): 39 +- 1, 31 +- 1.5, 23 +- 1.5, 17 +- 2, 12.5 +- 2 dB.
      source_limits_type('rubber_ball', &
         lower=[38.0_wp, 29.5_wp, 21.5_wp, 15.0_wp, 10.5_wp, 18.0e-3_wp, 0.7_wp, 1.0_wp, 2.4_wp, 0.99_wp], &
         upper=[40.0_wp, 32.5_wp, 24.5_wp, 19.0_wp, 14.5_wp, 22.0e-3_wp, 0.9_wp, 1.0_wp, 2.6_wp, 1.01_wp]), &
      ! "Bang machine", characteristic (1): 47 +- 1, 40 +- 1.5, 22 +- 1.5, 11.5 +- 2, 5.5 +- 2 dB.
      ! The standards give its drop height without a tolerance; the ball's 1 cm is used.
      source_limits_type('tyre', &
         lower=[46.0_wp, 38.5_wp, 20.5_wp, 9.5_wp, 3.5_wp, 18.0e-3_wp, 0.7_wp, 1.0_wp, 7.1_wp, 0.84_wp], &
         upper=[48.0_wp, 41.5_wp, 23.5_wp, 13.5_wp, 7.5_wp, 22.0e-3_wp, 0.9_wp, 1.0_wp, 7.5_wp, 0.86_wp])]

   !> Names of the sources: [n_source].
   character(len=24), parameter :: source_names(*) = sources%name

contains

   !> Criteria for a source, with values of 0.
   subroutine get_criteria(source, criteria, error)
      !> One of `source_names`.
      character(len=*), intent(in) :: source
      !> The octave levels, ascending, contact time, coefficient of restitution, number of peaks, mass and drop height.
      type(criterion_type), intent(out) :: criteria(criterion_count)
      !> Set if the source is not known.
      type(error_type), allocatable, intent(out) :: error
      integer :: at, i

      at = findloc(source_names == source, .true., dim=1)
      if (at == 0) then
         error = input_error('the source '//quoted(source)//' is not known; allowed: '//join_quoted(source_names))
      else
         criteria = [(criterion_type(names(i), units(i), lower=sources(at)%lower(i), upper=sources(at)%upper(i)), &
            i=1, criterion_count)]
      end if
   end subroutine get_criteria

   !> Whether a criterion is met; a value that is not a number never conforms.
   elemental function conforms(criterion) result(met)
      type(criterion_type), intent(in) :: criterion
      !> True if the value lies in the range, including its ends.
      logical :: met

      met = criterion%value >= criterion%lower .and. criterion%value <= criterion%upper
   end function conforms

   !> Verdict on a criterion: undecided if the numerical error of the value could change it, or is unknown.
   elemental function get_verdict(criterion) result(verdict)
      type(criterion_type), intent(in) :: criterion
      integer :: verdict

      verdict = verdict_undecided
      if (criterion%error <= minval(abs(criterion%value - [criterion%lower, criterion%upper]))) verdict = merge( &
         verdict_conforms, verdict_fails, conforms(criterion))
   end function get_verdict

   !> Verdict on all of several: it fails if one fails, and is undecided if one is undecided and none fails.
   pure function combine_verdicts(verdicts) result(verdict)
      integer, intent(in) :: verdicts(:)
      integer :: verdict

      verdict = maxval(verdicts)
      if (any(verdicts == verdict_fails)) verdict = verdict_fails
   end function combine_verdicts

   !> Number of peaks of a force after low-pass filtering at `recorded_band`; see `peak_prominence`.
   function get_peak_count(whole_force, sample_rate) result(peak_count)
      !> Force, N, that starts and ends at zero: [n_sample].
      real(wp), intent(in) :: whole_force(:)
      !> Samples per second, Hz.
      real(wp), intent(in) :: sample_rate
      integer :: peak_count
      real(wp) :: force(size(whole_force))
      real(wp) :: extreme, threshold
      ! Whether the force rises (1) or falls (-1) towards the next extreme.
      integer :: direction
      integer :: i

      peak_count = 0
      call get_low_pass(whole_force, sample_rate, recorded_band, force)
      threshold = peak_prominence*maxval(force)
      extreme = 0.0_wp
      direction = 1
      do i = 1, size(force)
         extreme = max(extreme, direction*force(i))
         if (.not. extreme - direction*force(i) > threshold) cycle
         if (direction == 1) peak_count = peak_count + 1
         direction = -direction
         extreme = direction*force(i)
      end do
   end function get_peak_count

end module thud_source_limits
