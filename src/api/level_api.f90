!> The flat API for Python to levels and verdicts; see `thud_api`.
module thud_level_api
   use thud_band, only: band_set_names, band_type, find_bands, get_set_bands => get_bands, octave_set
   use thud_constants, only: recorded_band
   use thud_error, only: error_type, get_status
   use thud_force_exposure, only: get_force_exposure_levels
   use thud_kinds, only: wp
   use thud_rating, only: class_limits, correct_for_background, find_rated_bands, get_a_weighted_level, get_grade, &
      get_legacy_rating, get_rounded, get_standardisation
   use thud_source_limits, only: conforms, criterion_count, criterion_type, get_criteria, get_peak_count, &
      get_source_limits, source_limits_type, source_names
   use thud_system, only: begin_call, end_call
   use thud_transform, only: get_low_pass
   implicit none (type, external)
   private

   public :: count_bands, count_names, count_peaks, count_rated, force_exposure, get_bands, get_class_limits, get_names
   public :: get_rated, judge, rate, record_force, remove_background, standardise

contains

   !> Numbers of band sets, of sources and of criteria.
   subroutine count_names(n_set, n_source, n_criterion)
      !f2py threadsafe
      !> Numbers of band sets, of sources with limits, and of criteria of a verdict.
      integer, intent(out) :: n_set, n_source, n_criterion

      call begin_call()
      n_set = size(band_set_names)
      n_source = size(source_names)
      n_criterion = criterion_count
      call end_call()
   end subroutine count_names

   !> Names of band sets and sources.
   subroutine get_names(n_set, n_source, sets, sources)
      !f2py threadsafe
      !> Numbers of band sets and sources, from `count_names`.
      integer, intent(in) :: n_set, n_source
      !> Band sets; verdicts use the first: [n_set].
      character(len=24), intent(out) :: sets(n_set)
      !> Sources with limits: [n_source].
      character(len=24), intent(out) :: sources(n_source)

      call begin_call()
      sets = band_set_names
      sources = source_names
      call end_call()
   end subroutine get_names

   !> Number of bands of a set.
   subroutine count_bands(set, n_band, status, message)
      !f2py threadsafe
      character(len=*), intent(in) :: set
      integer, intent(out) :: n_band
      !> Code of the error, or 0, and its sentence.
      integer, intent(out) :: status
      character(len=1024), intent(out) :: message
      type(band_type), allocatable :: bands(:)
      type(error_type), allocatable :: error

      call begin_call()
      call find_bands(set, bands, error)
      n_band = size(bands)
      call get_status(error, status, message)
      call end_call()
   end subroutine count_bands

   !> Bands of a set.
   subroutine get_bands(set, n_band, nominal, centre, lower, upper)
      !f2py threadsafe
      character(len=*), intent(in) :: set
      !> Number of bands, from `count_bands`.
      integer, intent(in) :: n_band
      !> Rounded and exact mid frequencies, Hz: [n_band].
      real(wp), intent(out) :: nominal(n_band), centre(n_band)
      !> Edges, Hz: [n_band].
      real(wp), intent(out) :: lower(n_band), upper(n_band)
      type(band_type) :: bands(n_band)

      call begin_call()
      bands = get_set_bands(set)
      nominal = bands%nominal
      centre = bands%centre
      lower = bands%lower
      upper = bands%upper
      call end_call()
   end subroutine get_bands

   !> Force exposure levels of any record.
   subroutine force_exposure(force, n_sample, sample_rate, set, method, n_band, levels, status, message)
      !f2py threadsafe
      !f2py integer, intent(hide), depend(force) :: n_sample = len(force)
      integer, intent(in) :: n_sample
      !> Force, N: [n_sample].
      real(wp), intent(in) :: force(n_sample)
      !> Samples per second, Hz.
      real(wp), intent(in) :: sample_rate
      !> Name of the band set; `exact` or `fft`.
      character(len=*), intent(in) :: set, method
      !> Number of bands, from `count_bands`.
      integer, intent(in) :: n_band
      !> Levels, dB: [n_band].
      real(wp), intent(out) :: levels(n_band)
      !> Code of the error, or 0, and its sentence.
      integer, intent(out) :: status
      character(len=1024), intent(out) :: message
      type(band_type), allocatable :: bands(:)
      type(error_type), allocatable :: error

      call begin_call()
      levels = 0.0_wp
      call find_bands(set, bands, error)
      if (.not. allocated(error)) call get_force_exposure_levels(force, sample_rate, bands, method, levels, error)
      call get_status(error, status, message)
      call end_call()
   end subroutine force_exposure

   !> Number of peaks of a force.
   subroutine count_peaks(force, n_sample, sample_rate, n_peak)
      !f2py threadsafe
      !f2py integer, intent(hide), depend(force) :: n_sample = len(force)
      integer, intent(in) :: n_sample
      !> Force, N: [n_sample].
      real(wp), intent(in) :: force(n_sample)
      !> Samples per second, Hz.
      real(wp), intent(in) :: sample_rate
      integer, intent(out) :: n_peak

      call begin_call()
      n_peak = get_peak_count(force, sample_rate)
      call end_call()
   end subroutine count_peaks

   !> A force as force plates record it: the part below 1.25 kHz.
   subroutine record_force(force, n_sample, sample_rate, recorded)
      !f2py threadsafe
      !f2py integer, intent(hide), depend(force) :: n_sample = len(force)
      integer, intent(in) :: n_sample
      !> Force, N: [n_sample].
      real(wp), intent(in) :: force(n_sample)
      !> Samples per second, Hz.
      real(wp), intent(in) :: sample_rate
      !> The part, N: [n_sample].
      real(wp), intent(out) :: recorded(n_sample)

      call begin_call()
      call get_low_pass(force, sample_rate, recorded_band, recorded)
      call end_call()
   end subroutine record_force

   !> Criteria of a source and which of them are met.
   subroutine judge(source, levels, n_octave, contact_time, restitution, n_peak, mass, drop_height, n_criterion, names, &
      units, value, lower, upper, met, status, message)
      !f2py threadsafe
      !f2py integer, intent(hide), depend(levels) :: n_octave = len(levels)
      !> Source whose limits apply.
      character(len=*), intent(in) :: source
      integer, intent(in) :: n_octave
      !> Octave levels, dB: [n_octave].
      real(wp), intent(in) :: levels(n_octave)
      !> Contact time, s, coefficient of restitution, mass, kg, and drop height, m.
      real(wp), intent(in) :: contact_time, restitution, mass, drop_height
      !> Number of peaks of the force; number of criteria, from `count_names`.
      integer, intent(in) :: n_peak, n_criterion
      !> Names and units of the criteria: [n_criterion].
      character(len=24), intent(out) :: names(n_criterion)
      character(len=8), intent(out) :: units(n_criterion)
      !> Values, minimum and maximum conforming ones: [n_criterion].
      real(wp), intent(out) :: value(n_criterion), lower(n_criterion), upper(n_criterion)
      !> 1 where the criterion is met, else 0: [n_criterion].
      integer, intent(out) :: met(n_criterion)
      !> Code of the error, or 0, and its sentence.
      integer, intent(out) :: status
      character(len=1024), intent(out) :: message
      type(criterion_type) :: criteria(criterion_count)
      type(source_limits_type) :: limits
      type(error_type), allocatable :: error

      call begin_call()
      call get_source_limits(source, limits, error)
      if (.not. allocated(error)) criteria = get_criteria(limits, levels, contact_time, restitution, n_peak, mass, &
         drop_height)
      names = criteria%name
      units = criteria%unit
      value = criteria%value
      lower = criteria%lower
      upper = criteria%upper
      met = merge(1, 0, conforms(criteria))
      call get_status(error, status, message)
      call end_call()
   end subroutine judge

   !> Number of bands that a rating is made of.
   subroutine count_rated(set, n_band, status, message)
      !f2py threadsafe
      character(len=*), intent(in) :: set
      integer, intent(out) :: n_band
      !> Code of the error, or 0, and its sentence.
      integer, intent(out) :: status
      character(len=1024), intent(out) :: message
      type(band_type), allocatable :: bands(:)
      type(error_type), allocatable :: error

      call begin_call()
      call find_rated_bands(set, bands, error)
      n_band = size(bands)
      call get_status(error, status, message)
      call end_call()
   end subroutine count_rated

   !> Bands that a rating is made of.
   subroutine get_rated(set, n_band, nominal)
      !f2py threadsafe
      character(len=*), intent(in) :: set
      !> Number of bands, from `count_rated`.
      integer, intent(in) :: n_band
      !> Rounded mid frequencies, Hz: [n_band].
      real(wp), intent(out) :: nominal(n_band)
      type(band_type), allocatable :: bands(:)
      type(error_type), allocatable :: error

      call begin_call()
      call find_rated_bands(set, bands, error)
      nominal = bands%nominal
      call end_call()
   end subroutine get_rated

   !> Maximum A-weighted levels of the classes of KS F 2863-2.
   subroutine get_class_limits(n_class, limits)
      !f2py threadsafe
      !> Number of classes.
      integer, intent(in) :: n_class
      !> The levels, dB: [n_class].
      real(wp), intent(out) :: limits(n_class)

      call begin_call()
      limits = class_limits(:n_class)
      call end_call()
   end subroutine get_class_limits

   !> Levels standardised to the reference room.
   subroutine standardise(level, n_band, reverberation_time, volume, standardised)
      !f2py threadsafe
      !f2py integer, intent(hide), depend(level) :: n_band = len(level)
      integer, intent(in) :: n_band
      !> Levels, dB, and reverberation times, s: [n_band].
      real(wp), intent(in) :: level(n_band), reverberation_time(n_band)
      !> Volume of the room, m3.
      real(wp), intent(in) :: volume
      !> The standardised levels, dB: [n_band].
      real(wp), intent(out) :: standardised(n_band)

      call begin_call()
      standardised = level + get_standardisation(reverberation_time, volume)
      call end_call()
   end subroutine standardise

   !> Levels without the background.
   subroutine remove_background(level, n_band, background, corrected, is_maximum)
      !f2py threadsafe
      !f2py integer, intent(hide), depend(level) :: n_band = len(level)
      integer, intent(in) :: n_band
      !> Levels with and of the background, dB: [n_band].
      real(wp), intent(in) :: level(n_band), background(n_band)
      !> Levels without it, dB: [n_band].
      real(wp), intent(out) :: corrected(n_band)
      !> 1 where the true level is at most that, else 0: [n_band].
      integer, intent(out) :: is_maximum(n_band)
      logical :: less(n_band)

      call begin_call()
      call correct_for_background(level, background, corrected, less)
      is_maximum = merge(1, 0, less)
      call end_call()
   end subroutine remove_background

   !> Single numbers of the levels in a room.
   subroutine rate(set, level, n_band, a_weighted, rounded, grade, legacy, status, message)
      !f2py threadsafe
      !f2py integer, intent(hide), depend(level) :: n_band = len(level)
      character(len=*), intent(in) :: set
      integer, intent(in) :: n_band
      !> Levels of the rated bands, dB: [n_band].
      real(wp), intent(in) :: level(n_band)
      !> A-weighted maximum level, dB.
      real(wp), intent(out) :: a_weighted
      !> The same as it is stated, dB; its class, 0 for none; rating by the reference curve, dB, of octaves only.
      integer, intent(out) :: rounded, grade, legacy
      !> Code of the error, or 0, and its sentence.
      integer, intent(out) :: status
      character(len=1024), intent(out) :: message
      type(band_type), allocatable :: bands(:)
      type(error_type), allocatable :: error

      call begin_call()
      a_weighted = 0.0_wp
      rounded = 0
      grade = 0
      legacy = 0
      call find_rated_bands(set, bands, error)
      call get_status(error, status, message)
      if (status == 0) then
         a_weighted = get_a_weighted_level(set, level)
         rounded = get_rounded(a_weighted)
         grade = get_grade(a_weighted)
         if (set == octave_set) legacy = get_legacy_rating(level)
      end if
      call end_call()
   end subroutine rate

end module thud_level_api
