!> The flat API for Python to levels and verdicts; see `thud_api`.
module thud_level_api
   use thud_band, only: band_type, get_bands_of => get_bands
   use thud_error, only: error_type, get_status
   use thud_force_exposure, only: get_force_exposure_levels
   use thud_kinds, only: wp
   use thud_source_limits, only: conforms, criterion_count, criterion_type, get_criteria, get_peak_count, &
      get_source_limits, recorded_band, source_limits_type
   use thud_transform, only: get_low_pass
   implicit none (type, external)
   private

   public :: count_peaks, force_exposure, get_bands, judge, record_force

contains

   !> Number of bands, edges and mid frequencies.
   subroutine get_bands(bandwidth, n_band, nominal, centre, lower, upper)
      !f2py threadsafe
      !> `octave` or `third`.
      character(len=*), intent(in) :: bandwidth
      !> Number of bands: 15 entries are always written, the first n_band hold.
      integer, intent(out) :: n_band
      !> Rounded mid frequencies, Hz: [15].
      real(wp), intent(out) :: nominal(15)
      !> Exact mid frequencies, Hz: [15].
      real(wp), intent(out) :: centre(15)
      !> Lower edges, Hz: [15].
      real(wp), intent(out) :: lower(15)
      !> Upper edges, Hz: [15].
      real(wp), intent(out) :: upper(15)
      type(band_type), allocatable :: bands(:)

      bands = get_bands_of(bandwidth)
      n_band = size(bands)
      nominal(:n_band) = bands%nominal
      centre(:n_band) = bands%centre
      lower(:n_band) = bands%lower
      upper(:n_band) = bands%upper
      nominal(n_band + 1:) = 0.0_wp
      centre(n_band + 1:) = 0.0_wp
      lower(n_band + 1:) = 0.0_wp
      upper(n_band + 1:) = 0.0_wp
   end subroutine get_bands

   !> Force exposure levels of any record.
   subroutine force_exposure(force, n_sample, sample_rate, bandwidth, method, n_band, levels, status, message)
      !f2py threadsafe
      !f2py integer, intent(hide), depend(force) :: n_sample = len(force)
      !> Number of samples.
      integer, intent(in) :: n_sample
      !> Force, N: [n_sample].
      real(wp), intent(in) :: force(n_sample)
      !> Samples per second, Hz.
      real(wp), intent(in) :: sample_rate
      !> `octave` or `third`.
      character(len=*), intent(in) :: bandwidth
      !> `exact` or `fft`.
      character(len=*), intent(in) :: method
      !> Number of bands: 5 octaves or 15 thirds.
      integer, intent(in) :: n_band
      !> Levels, dB: [n_band].
      real(wp), intent(out) :: levels(n_band)
      !> Code of the error, or 0.
      integer, intent(out) :: status
      !> Sentence of the error.
      character(len=1024), intent(out) :: message
      type(error_type), allocatable :: error

      levels = 0.0_wp
      call get_force_exposure_levels(force, sample_rate, get_bands_of(bandwidth), method, levels, error)
      call get_status(error, status, message)
   end subroutine force_exposure

   !> Number of peaks of a force.
   subroutine count_peaks(force, n_sample, sample_rate, n_peak)
      !f2py threadsafe
      !f2py integer, intent(hide), depend(force) :: n_sample = len(force)
      !> Number of samples.
      integer, intent(in) :: n_sample
      !> Force, N: [n_sample].
      real(wp), intent(in) :: force(n_sample)
      !> Samples per second, Hz.
      real(wp), intent(in) :: sample_rate
      !> Number of peaks.
      integer, intent(out) :: n_peak

      n_peak = get_peak_count(force, sample_rate)
   end subroutine count_peaks

   !> A force as force plates record it: the part below 1.25 kHz.
   subroutine record_force(force, n_sample, sample_rate, recorded)
      !f2py threadsafe
      !f2py integer, intent(hide), depend(force) :: n_sample = len(force)
      !> Number of samples.
      integer, intent(in) :: n_sample
      !> Force, N: [n_sample].
      real(wp), intent(in) :: force(n_sample)
      !> Samples per second, Hz.
      real(wp), intent(in) :: sample_rate
      !> The part, N: [n_sample].
      real(wp), intent(out) :: recorded(n_sample)

      call get_low_pass(force, sample_rate, recorded_band, recorded)
   end subroutine record_force

   !> Criteria of a source and which of them are met.
   subroutine judge(source, levels, contact_time, restitution, n_peak, mass, drop_height, names, units, value, lower, &
      upper, met, status, message)
      !f2py threadsafe
      !> Source whose limits apply.
      character(len=*), intent(in) :: source
      !> Octave levels 31.5 to 500 Hz, dB: [5].
      real(wp), intent(in) :: levels(5)
      !> Contact time, s.
      real(wp), intent(in) :: contact_time
      !> Coefficient of restitution.
      real(wp), intent(in) :: restitution
      !> Number of peaks of the force.
      integer, intent(in) :: n_peak
      !> Mass, kg.
      real(wp), intent(in) :: mass
      !> Height of drop, m.
      real(wp), intent(in) :: drop_height
      !> Names of the criteria, with commas between.
      character(len=512), intent(out) :: names
      !> Units of the criteria, with commas between.
      character(len=512), intent(out) :: units
      !> Values: [10].
      real(wp), intent(out) :: value(10)
      !> Smallest conforming values: [10].
      real(wp), intent(out) :: lower(10)
      !> Largest conforming values: [10].
      real(wp), intent(out) :: upper(10)
      !> 1 where the criterion is met, else 0: [10].
      integer, intent(out) :: met(10)
      !> Code of the error, or 0.
      integer, intent(out) :: status
      !> Sentence of the error.
      character(len=1024), intent(out) :: message
      type(criterion_type) :: criteria(criterion_count)
      type(source_limits_type) :: limits
      type(error_type), allocatable :: error
      integer :: i

      names = ''
      units = ''
      value = 0.0_wp
      lower = 0.0_wp
      upper = 0.0_wp
      met = 0
      call get_source_limits(source, limits, error)
      call get_status(error, status, message)
      if (status /= 0) return
      criteria = get_criteria(limits, levels, contact_time, restitution, n_peak, mass, drop_height)
      do i = 1, criterion_count
         names = trim(names)//','//criteria(i)%name
         units = trim(units)//','//criteria(i)%unit
      end do
      names = names(2:)
      units = units(2:)
      value = criteria%value
      lower = criteria%lower
      upper = criteria%upper
      met = merge(1, 0, conforms(criteria))
   end subroutine judge

end module thud_level_api
