!> Fourier transforms of sampled records, on FFTW.
module thud_transform
   use, intrinsic :: iso_c_binding
   use thud_kinds, only: wp
   implicit none (type)
   private

   public :: get_autocorrelation, get_low_pass, get_power_spectrum

   include 'fftw3.f03'

contains

   !> Autocorrelation sums r(k) = sum over n of x(n) x(n + k).
   subroutine get_autocorrelation(record, autocorrelation)
      !> Samples: [n].
      real(wp), intent(in) :: record(:)
      !> The sums for the lags 0 to n - 1, in squared units of the record: [n].
      real(wp), intent(out) :: autocorrelation(:)
      real(wp), allocatable :: signal(:)
      complex(wp), allocatable :: spectrum(:)
      integer :: length

      ! Twice the length, so that the circular correlation does not fold.
      length = 2
      do while (length < 2*size(record))
         length = 2*length
      end do
      call transform_padded(record, length, signal, spectrum)
      spectrum = cmplx(real(spectrum)**2 + aimag(spectrum)**2, 0.0_wp, wp)
      call transform_back(spectrum, signal)
      autocorrelation = signal(:size(record))
   end subroutine get_autocorrelation

   !> The part of a record below a frequency.
   subroutine get_low_pass(record, sample_rate, edge, low)
      !> Samples: [n].
      real(wp), intent(in) :: record(:)
      !> Samples per second, Hz.
      real(wp), intent(in) :: sample_rate
      !> The frequency, Hz.
      real(wp), intent(in) :: edge
      !> Samples of the part: [n].
      real(wp), intent(out) :: low(:)
      real(wp), allocatable :: signal(:)
      complex(wp), allocatable :: spectrum(:)
      integer :: length

      ! Zeros on both sides, so that what swings before the record does not come back behind it.
      length = 2*size(record)
      call transform_padded(record, length, signal, spectrum)
      spectrum(min(size(spectrum), int(length*(edge/sample_rate)) + 1) + 1:) = (0.0_wp, 0.0_wp)
      call transform_back(spectrum, signal)
      low = signal(:size(record))
   end subroutine get_low_pass

   !> Squared magnitude of the transform of a zero-padded record.
   subroutine get_power_spectrum(record, length, power)
      !> Samples: [n].
      real(wp), intent(in) :: record(:)
      !> Length of the transform, at least n.
      integer, intent(in) :: length
      !> |X(k)|^2 for the bins k = 0 to length/2, in squared units of the record.
      real(wp), allocatable, intent(out) :: power(:)
      real(wp), allocatable :: signal(:)
      complex(wp), allocatable :: spectrum(:)

      call transform_padded(record, length, signal, spectrum)
      power = real(spectrum)**2 + aimag(spectrum)**2
   end subroutine get_power_spectrum

   !> Transform of a record with zeros behind it.
   subroutine transform_padded(record, length, signal, spectrum)
      !> Samples: [n].
      real(wp), intent(in) :: record(:)
      !> Length of the transform, at least n.
      integer, intent(in) :: length
      !> The padded record: [length].
      real(wp), allocatable, intent(out) :: signal(:)
      !> Its transform: [length/2 + 1].
      complex(wp), allocatable, intent(out) :: spectrum(:)
      type(c_ptr) :: plan

      allocate (signal(length), source=0.0_wp)
      allocate (spectrum(length/2 + 1))
      signal(:size(record)) = record
      !$omp critical (thud_fftw_planner)
      plan = fftw_plan_dft_r2c_1d(int(length, c_int), signal, spectrum, FFTW_ESTIMATE)
      !$omp end critical (thud_fftw_planner)
      call fftw_execute_dft_r2c(plan, signal, spectrum)
      !$omp critical (thud_fftw_planner)
      call fftw_destroy_plan(plan)
      !$omp end critical (thud_fftw_planner)
   end subroutine transform_padded

   !> Record of a transform.
   subroutine transform_back(spectrum, signal)
      !> The transform; it is used up: [n/2 + 1].
      complex(wp), intent(inout) :: spectrum(:)
      !> The record: [n].
      real(wp), intent(inout) :: signal(:)
      type(c_ptr) :: plan

      ! Making and freeing plans is the one part of FFTW that threads must not share.
      !$omp critical (thud_fftw_planner)
      plan = fftw_plan_dft_c2r_1d(size(signal, kind=c_int), spectrum, signal, FFTW_ESTIMATE)
      !$omp end critical (thud_fftw_planner)
      call fftw_execute_dft_c2r(plan, spectrum, signal)
      !$omp critical (thud_fftw_planner)
      call fftw_destroy_plan(plan)
      !$omp end critical (thud_fftw_planner)
      signal = signal/size(signal)
   end subroutine transform_back

end module thud_transform
