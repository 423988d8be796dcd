!> Fourier transforms of sampled records, on FFTW.
!>
!> Making a plan takes longer than transforming the record of a contact, so plans are kept by length.
module thud_transform
   use, intrinsic :: iso_c_binding
   use thud_kinds, only: wp
   implicit none (type)
   private

   public :: get_autocorrelation, get_low_pass, get_signal

   include 'fftw3.f03'

   !> Maximum number of plans that are kept.
   integer, parameter :: kept_count = 16

   !> Maximum length of a transform whose plans are kept: longer plans take much memory.
   integer, parameter :: max_kept_length = 2**18

   !> Plans for one length. They fit all allocated arrays, because these are aligned to 16 bytes, as FFTW needs.
   type :: plans_type
      !> Number of samples.
      integer :: length = 0
      !> Plans from a record to its transform, and back to the record multiplied by its length.
      type(c_ptr) :: forward = c_null_ptr, back = c_null_ptr
   end type plans_type

   !> Plans that are not in use, in the order of their last use; accessed only in the critical section `thud_fftw_planner`.
   type(plans_type), allocatable :: kept(:)

contains

   !> Autocorrelation sums r(k) = sum over n of x(n) x(n + k).
   subroutine get_autocorrelation(record, autocorrelation)
      !> Samples: [n].
      real(wp), intent(in) :: record(:)
      !> The sums for the lags 0 to n - 1, in squared units of the record: [n].
      real(wp), intent(out) :: autocorrelation(:)
      real(wp), allocatable :: signal(:)
      complex(wp), allocatable :: spectrum(:)
      type(plans_type) :: plans
      integer :: length

      ! Twice the length, so that the circular correlation does not wrap around.
      length = 2
      do while (length < 2*size(record))
         length = 2*length
      end do
      call transform_padded(record, length, signal, spectrum, plans)
      spectrum = cmplx(real(spectrum)**2 + aimag(spectrum)**2, 0.0_wp, wp)
      call transform_back(spectrum, signal, plans)
      autocorrelation = signal(:size(record))/length
   end subroutine get_autocorrelation

   !> Low-pass filtered record.
   subroutine get_low_pass(record, sample_rate, edge, low)
      !> Samples: [n].
      real(wp), intent(in) :: record(:)
      !> Samples per second, Hz; highest frequency that passes, Hz.
      real(wp), intent(in) :: sample_rate, edge
      !> The filtered samples: [n].
      real(wp), intent(out) :: low(:)
      real(wp), allocatable :: signal(:)
      complex(wp), allocatable :: spectrum(:)
      type(plans_type) :: plans
      integer :: length

      if (size(record) == 0) return
      ! Zeros after the record, so that oscillations before it do not wrap around to its end.
      length = 2*size(record)
      call transform_padded(record, length, signal, spectrum, plans)
      spectrum(int(min(length*(edge/sample_rate), length/2.0_wp)) + 2:) = (0.0_wp, 0.0_wp)
      call transform_back(spectrum, signal, plans)
      low = signal(:size(record))/length
   end subroutine get_low_pass

   !> Real signal of a spectrum: the sum of c_k exp(2 pi i k n/length) over all k, negative ones included, over the length.
   subroutine get_signal(spectrum, signal)
      !> c_0, c_1, ...: [at most length/2 + 1]; the others are 0.
      complex(wp), intent(in) :: spectrum(:)
      !> The signal; its length is even: [length].
      real(wp), intent(out) :: signal(:)
      real(wp), allocatable :: buffer(:)
      complex(wp), allocatable :: half(:)
      type(plans_type) :: plans

      ! The plans fit allocated arrays only.
      allocate (buffer(size(signal)), half(size(signal)/2 + 1))
      call take_plans(buffer, half, plans)
      half = 0.0_wp
      half(:size(spectrum)) = spectrum
      call transform_back(half, buffer, plans)
      signal = buffer/size(signal)
   end subroutine get_signal

   !> Transform of a zero-padded record.
   subroutine transform_padded(record, length, signal, spectrum, plans)
      real(wp), intent(in) :: record(:)
      integer, intent(in) :: length
      !> The padded record: [length].
      real(wp), allocatable, intent(out) :: signal(:)
      !> Its transform: [length/2 + 1].
      complex(wp), allocatable, intent(out) :: spectrum(:)
      !> Plans in use, to be released.
      type(plans_type), intent(out) :: plans

      allocate (signal(length), spectrum(length/2 + 1))
      signal(:size(record)) = record
      signal(size(record) + 1:) = 0.0_wp
      call take_plans(signal, spectrum, plans)
      call fftw_execute_dft_r2c(plans%forward, signal, spectrum)
   end subroutine transform_padded

   !> Record from its transform, multiplied by its length.
   subroutine transform_back(spectrum, signal, plans)
      !> The transform; overwritten: [n/2 + 1].
      complex(wp), intent(inout) :: spectrum(:)
      !> The record: [n].
      real(wp), intent(inout) :: signal(:)
      !> Plans from `transform_padded`; released here.
      type(plans_type), intent(inout) :: plans

      call fftw_execute_dft_c2r(plans%back, spectrum, signal)
      call release(plans)
   end subroutine transform_back

   !> Takes plans for arrays, kept or new ones. FFTW's planner is not thread-safe.
   subroutine take_plans(signal, spectrum, plans)
      !> Array of the record: [n].
      real(wp), intent(inout) :: signal(:)
      !> Array of its transform: [n/2 + 1].
      complex(wp), intent(inout) :: spectrum(:)
      type(plans_type), intent(out) :: plans
      integer :: at

      !$omp critical (thud_fftw_planner)
      if (.not. allocated(kept)) allocate (kept(0))
      at = findloc(kept%length, size(signal), dim=1)
      if (at > 0) then
         plans = kept(at)
         kept = [kept(:at - 1), kept(at + 1:)]
      else
         plans%length = size(signal)
         plans%forward = fftw_plan_dft_r2c_1d(size(signal, kind=c_int), signal, spectrum, FFTW_ESTIMATE)
         plans%back = fftw_plan_dft_c2r_1d(size(signal, kind=c_int), spectrum, signal, FFTW_ESTIMATE)
      end if
      !$omp end critical (thud_fftw_planner)
   end subroutine take_plans

   !> Keeps plans after their use, and destroys those that are too long or too many.
   subroutine release(plans)
      type(plans_type), intent(in) :: plans
      integer :: at

      !$omp critical (thud_fftw_planner)
      kept = [kept, plans]
      if (plans%length > max_kept_length .or. size(kept) > kept_count) then
         at = merge(size(kept), 1, plans%length > max_kept_length)
         call fftw_destroy_plan(kept(at)%forward)
         call fftw_destroy_plan(kept(at)%back)
         kept = [kept(:at - 1), kept(at + 1:)]
      end if
      !$omp end critical (thud_fftw_planner)
   end subroutine release

end module thud_transform
