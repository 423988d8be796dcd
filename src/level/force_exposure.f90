!> Force exposure level: the energy of a force in frequency bands, in dB
!> (JIS A 1418-2, ISO 10140-5 annex F).
!>
!> The energy below a frequency, 2 * integral of |F(f)|**2 df from 0, is computed from the autocorrelation r of the record,
!> without padding or window. Let a be the angle by which the frequency advances per sample. Then this energy is 1/(pi f_s) *
!> (a r(0) + 2 sum over the lags k of r(k) g(k) sin(a k)) with g(k) = 1/k. For the sum over the bins of a zero-padded
!> transform of N samples instead of the integral, g(k) = d/sin(d k) with d = pi/N, and the band extends from half a bin
!> below its first bin to half a bin above its last bin. The energy of a band is the difference between those below its
!> edges.
module thud_force_exposure
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use thud_band, only: band_type
   use thud_constants, only: pi
   use thud_error, only: error_type, input_error
   use thud_interrupt, only: check_interrupt, is_interrupted
   use thud_kinds, only: wp
   use thud_text, only: join_quoted, quoted, to_text
   use thud_transform, only: get_autocorrelation
   implicit none (type, external)
   private

   public :: get_force_exposure_levels, level_methods

   !> `exact`: energy of the band by the integral; `fft`: sum over the 1 Hz bins of a 1 s record.
   character(len=24), parameter :: level_methods(2) = [character(len=24) :: 'exact', 'fft']

   !> Maximum number of samples of a record: its transform fits into memory and its length into an integer.
   integer, parameter :: max_samples = 100000000

   !> Sum of squares below which a record is treated as zero, N^2: its rounding errors would underflow.
   real(wp), parameter :: min_energy = 1.0e-280_wp

   !> Maximum sampling rate, Hz: one second of samples fits into memory.
   real(wp), parameter :: max_rate = 1.0e7_wp

   !> Number of samples in a block, whose sines and cosines follow from those of its first sample.
   integer, parameter :: block = 32

contains

   !> Force exposure levels of a record in bands.
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
      !> Set if the record or the rate cannot be used, the method is unknown, or an interrupt came.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: energy(size(bands)), lower(size(bands)), upper(size(bands))
      real(wp) :: spacing
      integer :: first, last

      call check_record(force, sample_rate, bands, error)
      if (allocated(error)) return
      ! Zeros at the ends add no energy but take time.
      first = findloc(abs(force) > 0.0_wp, .true., dim=1)
      last = findloc(abs(force) > 0.0_wp, .true., dim=1, back=.true.)
      lower = bands%lower
      upper = bands%upper
      spacing = 0.0_wp
      if (method == 'fft') then
         ! The window is 1 s as in the paper (section 3), or the next whole number of seconds that holds the record.
         spacing = sample_rate/(nint(sample_rate)*ceiling(real(last - first + 1, wp)/nint(sample_rate)))
         lower = (ceiling(lower/spacing) - 0.5_wp)*spacing
         upper = (floor(upper/spacing) + 0.5_wp)*spacing
      else if (method /= 'exact') then
         error = input_error('the level method '//quoted(method)//' is not known; allowed: '//join_quoted(level_methods))
         return
      end if
      energy = get_energy(force(first:last), sample_rate, lower, upper, spacing)
      call check_interrupt(error)
      if (allocated(error)) return
      ! The rounding errors of a band are about this fraction of the total energy and limit the resolution.
      levels = 10*log10(max(energy, epsilon(1.0_wp)*sum(force(first:last)**2)/sample_rate))
   end subroutine get_force_exposure_levels

   !> Checks that a record has levels.
   subroutine check_record(force, sample_rate, bands, error)
      !> Force, N: [n_sample].
      real(wp), intent(in) :: force(:)
      real(wp), intent(in) :: sample_rate
      type(band_type), intent(in) :: bands(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: min_rate

      min_rate = 2*maxval(bands%upper)
      if (.not. (sample_rate >= min_rate .and. sample_rate <= max_rate)) then
         error = input_error('sample_rate = '//to_text(sample_rate)//' Hz is not allowed; allowed: from ' &
            //to_text(min_rate)//' Hz, twice the highest band edge, to '//to_text(max_rate)//' Hz')
      else if (size(force) == 0 .or. size(force) > max_samples) then
         error = input_error('the force has '//to_text(size(force))//' samples; allowed: 1 to '//to_text(max_samples))
      else if (.not. all(ieee_is_finite(force))) then
         error = input_error('the force holds a value that is not finite, first at sample ' &
            //to_text(findloc(ieee_is_finite(force), .false., dim=1))//'; allowed: finite numbers')
      else if (.not. maxval(abs(force)) < sqrt(huge(1.0_wp)/real(size(force), wp))/sample_rate) then
         error = input_error('the force is too large for its energy to be computed; allowed: forces in N')
      else if (.not. sum(force**2) > min_energy) then
         error = input_error('the force is zero or nearly zero throughout and has no level; allowed: a force with a level')
      end if
   end subroutine check_record

   !> Energies of a record between band edges, N^2 s; see the description of the module.
   function get_energy(force, sample_rate, lower, upper, spacing) result(energy)
      real(wp), intent(in) :: force(:)
      real(wp), intent(in) :: sample_rate
      !> Edges, Hz: [n_band].
      real(wp), intent(in) :: lower(:), upper(:)
      !> Spacing of the bins, Hz; 0 for the integral.
      real(wp), intent(in) :: spacing
      !> Energy of each band, N^2 s: [n_band].
      real(wp) :: energy(size(lower))
      real(wp), allocatable :: correlation(:)
      real(wp) :: step, edge, below, above
      integer :: i, lag

      ! Padded with zeros to whole blocks.
      allocate (correlation(0:block*((size(force) + block - 2)/block)), source=0.0_wp)
      call get_autocorrelation(force, correlation(:size(force) - 1))
      step = pi*spacing/sample_rate
      do lag = 1, size(force) - 1
         if (spacing > 0.0_wp) then
            correlation(lag) = correlation(lag)*step/sin(step*lag)
         else
            correlation(lag) = correlation(lag)/lag
         end if
      end do
      energy = 0.0_wp
      edge = 0.0_wp
      below = 0.0_wp
      do i = 1, size(lower)
         if (is_interrupted()) exit
         ! Adjacent bands share an edge.
         if (abs(lower(i) - edge) > 0.0_wp) below = get_energy_below(correlation, 2*pi*lower(i)/sample_rate)
         edge = upper(i)
         above = get_energy_below(correlation, 2*pi*edge/sample_rate)
         energy(i) = (above - below)/(pi*sample_rate)
         below = above
      end do
   end function get_energy

   !> Energy below a frequency times pi f_s, N^2: a r(0) + 2 sum of r(k) g(k) sin(a k).
   !>
   !> Sines and cosines are computed only for the starts of blocks and within one block; sums of angles give all others.
   pure function get_energy_below(x, a) result(energy)
      !> r(0), then r(k) g(k) for a number of lags that is a multiple of `block`: [0:n].
      real(wp), intent(in), contiguous :: x(0:)
      !> Angle by which the frequency advances per sample.
      real(wp), intent(in) :: a
      real(wp) :: energy
      real(wp) :: with_sine(block), with_cosine(block)
      real(wp) :: angle
      integer :: start, i

      with_sine = 0.0_wp
      with_cosine = 0.0_wp
      do start = 0, ubound(x, 1) - 1, block
         angle = a*start
         with_sine = with_sine + sin(angle)*x(start + 1:start + block)
         with_cosine = with_cosine + cos(angle)*x(start + 1:start + block)
      end do
      energy = a*x(0) + 2*sum([(with_sine(i)*cos(a*i) + with_cosine(i)*sin(a*i), i=1, block)])
   end function get_energy_below

end module thud_force_exposure
