!> Force exposure level: the energy of a force in frequency bands, in dB
!> (JIS A 1418-2, ISO 10140-5 annex F).
module thud_force_exposure
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use thud_band, only: band_type
   use thud_constants, only: pi, reference_force, reference_time
   use thud_error, only: error_type, input_error
   use thud_kinds, only: wp
   use thud_text, only: join_quoted, quoted, to_text
   use thud_transform, only: get_autocorrelation, get_power_spectrum
   implicit none (type, external)
   private

   public :: get_force_exposure_levels, level_methods

   !> `exact`: band energy of the record as it is; `fft`: sum over the 1 Hz bins of a 1 s record.
   character(len=24), parameter :: level_methods(2) = [character(len=24) :: 'exact', 'fft']

   !> Most samples of a record: its transform still fits into memory and its length into an integer.
   integer, parameter :: max_samples = 100000000

   !> Sum of squares below which a record is taken for zero, N^2: its rounding would underflow.
   real(wp), parameter :: min_energy = 1.0e-280_wp

   !> Highest sampling rate, Hz: one second of it still fits into memory.
   real(wp), parameter :: highest_rate = 1.0e7_wp

contains

   !> Levels of a record in the given bands.
   subroutine get_force_exposure_levels(force, sample_rate, bands, method, levels, error)
      !> Force, N, zero before and after the record: [n_sample].
      real(wp), intent(in) :: force(:)
      !> Samples per second, Hz.
      real(wp), intent(in) :: sample_rate
      !> The bands: [n_band].
      type(band_type), intent(in) :: bands(:)
      !> One of `level_methods`.
      character(len=*), intent(in) :: method
      !> 10 lg(band energy/(1 N^2 s)), dB: [n_band].
      real(wp), intent(out) :: levels(:)
      !> The record or the rate cannot be used, or the method is unknown.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: energy(size(bands))
      real(wp) :: resolution
      integer :: first, last

      call check_record(force, sample_rate, bands, error)
      if (allocated(error)) return
      ! Zeros at the ends add nothing to the energy but take time.
      first = findloc(abs(force) > 0.0_wp, .true., dim=1)
      last = findloc(abs(force) > 0.0_wp, .true., dim=1, back=.true.)
      select case (method)
      case ('exact')
         energy = get_exact_energy(force(first:last), sample_rate, bands)
      case ('fft')
         energy = get_bin_energy(force(first:last), sample_rate, bands)
      case default
         error = input_error('the level method '//quoted(method)//' is not known; allowed: '//join_quoted(level_methods))
         return
      end select
      ! Rounding blurs a band by about this part of the whole energy: no less can be told apart.
      resolution = epsilon(1.0_wp)*sum(force(first:last)**2)/sample_rate
      levels = 10*log10(max(energy, resolution)/(reference_force**2*reference_time))
   end subroutine get_force_exposure_levels

   !> Complains about a record that has no levels.
   subroutine check_record(force, sample_rate, bands, error)
      !> Force, N: [n_sample].
      real(wp), intent(in) :: force(:)
      !> Samples per second, Hz.
      real(wp), intent(in) :: sample_rate
      !> The bands: [n_band].
      type(band_type), intent(in) :: bands(:)
      !> What is wrong.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: lowest_rate

      lowest_rate = 2*maxval(bands%upper)
      if (.not. (sample_rate >= lowest_rate .and. sample_rate <= highest_rate)) then
         error = input_error('sample_rate = '//to_text(sample_rate)//' Hz is not allowed; allowed: from ' &
            //to_text(lowest_rate)//' Hz, twice the highest band edge, to '//to_text(highest_rate)//' Hz')
      else if (size(force) == 0 .or. size(force) > max_samples) then
         error = input_error('the force has '//to_text(size(force))//' samples; allowed: 1 to '//to_text(max_samples))
      else if (.not. all(ieee_is_finite(force))) then
         error = input_error('the force holds a value that is not finite, first at sample ' &
            //to_text(findloc(ieee_is_finite(force), .false., dim=1)))
      else if (.not. maxval(abs(force)) < sqrt(huge(1.0_wp)/real(size(force), wp))/sample_rate) then
         error = input_error('the force is too large for its energy to be computed')
      else if (.not. sum(force**2) > min_energy) then
         error = input_error('the force is zero throughout, or next to it, and has no level')
      end if
   end subroutine check_record

   !> Energy of a finite record between the band edges, 2 * integral of |F(f)|^2 df, N^2 s.
   !>
   !> F is the record's own Fourier transform; without padding or window the integral is a sum of
   !> the autocorrelation, weighted with the transform of the band.
   function get_exact_energy(force, sample_rate, bands) result(energy)
      !> Force, N: [n_sample].
      real(wp), intent(in) :: force(:)
      !> Samples per second, Hz.
      real(wp), intent(in) :: sample_rate
      !> The bands: [n_band].
      type(band_type), intent(in) :: bands(:)
      !> Energy of each band, N^2 s: [n_band].
      real(wp) :: energy(size(bands))
      real(wp) :: autocorrelation(size(force))
      real(wp) :: middle, half_width, total
      integer :: i, lag

      call get_autocorrelation(force, autocorrelation)
      do i = 1, size(bands)
         ! Angles that the middle and the half width of the band turn through per sample.
         middle = pi*(bands(i)%upper + bands(i)%lower)/sample_rate
         half_width = pi*(bands(i)%upper - bands(i)%lower)/sample_rate
         total = half_width*autocorrelation(1)
         do lag = 1, size(force) - 1
            total = total + 2*autocorrelation(lag + 1)*cos(middle*lag)*sin(half_width*lag)/lag
         end do
         energy(i) = 2*total/(pi*sample_rate)
      end do
   end function get_exact_energy

   !> Energy in the bins of a zero-padded transform between the band edges, N^2 s.
   !>
   !> The window is 1 s as in the paper (section 3), or the next whole number of seconds that
   !> holds the record.
   function get_bin_energy(force, sample_rate, bands) result(energy)
      !> Force, N: [n_sample].
      real(wp), intent(in) :: force(:)
      !> Samples per second, Hz.
      real(wp), intent(in) :: sample_rate
      !> The bands: [n_band].
      type(band_type), intent(in) :: bands(:)
      !> Energy of each band, N^2 s: [n_band].
      real(wp) :: energy(size(bands))
      real(wp), allocatable :: power(:)
      real(wp) :: spacing_of_bins
      integer :: length, i

      length = nint(sample_rate)*ceiling(real(size(force), wp)/nint(sample_rate))
      spacing_of_bins = sample_rate/length
      call get_power_spectrum(force, length, power)
      do i = 1, size(bands)
         associate (first => ceiling(bands(i)%lower/spacing_of_bins), last => floor(bands(i)%upper/spacing_of_bins))
            energy(i) = 2*sum(power(first + 1:last + 1))*spacing_of_bins/sample_rate**2
         end associate
      end do
   end function get_bin_energy

end module thud_force_exposure
