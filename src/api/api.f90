!> The flat API for Python: plain arguments, explicit shapes, a status. f2py wraps these procedures and nothing
!> else; they pass on and decide nothing.
!>
!> Results are self-describing bundles: a procedure leaves one and returns its handle and its sizes; `collect` hands
!> it over and frees it. `status` is 0, or the code of the error whose sentence is the text `message` of the bundle.
!> Procedures marked `threadsafe` let other Python threads run meanwhile.
module thud_api
   use thud_bundle, only: bundle_type, leave, take
   use thud_case, only: case_type, get_model_number
   use thud_case_text, only: get_case_text, read_case
   use thud_compression, only: compression_type
   use thud_compute, only: compress_case, compute_case, results_type
   use thud_constants, only: get_compiler, version
   use thud_error, only: error_type
   use thud_kinds, only: int64, int8, wp
   use thud_progress, only: latest_progress
   use thud_progress_line, only: begin_progress, end_progress
   use thud_result_bundle, only: add_compression, add_results
   use thud_run, only: load_case, outcome_type, run_case
   use thud_system, only: begin_call, end_call, end_all_calls => end_calls
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: check_text, collect, compress, describe_library, effective_case, end_calls, free_modes, get_progress
   public :: loss_factors, run, solve

contains

   !> Hands a bundle over and frees it.
   subroutine collect(handle, n_byte, n_value, bytes, values)
      !f2py threadsafe
      !> Handle of the bundle; it can be used once.
      integer(int64), intent(in) :: handle
      !> Size of its header and its texts; number of its numbers, at least 1.
      integer, intent(in) :: n_byte, n_value
      !> Header, a zero, and texts: [n_byte].
      integer(int8), intent(out) :: bytes(n_byte)
      !> The numbers, in the order of the header: [n_value].
      real(wp), intent(out) :: values(n_value)
      type(bundle_type), pointer :: bundle

      call take(handle, bundle)
      bytes = transfer(bundle%header//achar(0)//bundle%text, bytes)
      call bundle%copy_values(values)
      deallocate (bundle)
   end subroutine collect

   !> Ends the calls that are running in other threads, as an interrupt does.
   subroutine end_calls()

      call end_all_calls()
   end subroutine end_calls

   !> How far the latest long work of this process is.
   subroutine get_progress(done)
      !> Part that is done, 0 to 1.
      real(wp), intent(out) :: done

      done = latest_progress
   end subroutine get_progress

   !> Version and compiler of the library.
   subroutine describe_library(status, handle, n_byte, n_value)
      !f2py threadsafe
      !> Status, handle and sizes as in `leave`.
      integer, intent(out) :: status, n_byte, n_value
      integer(int64), intent(out) :: handle
      type(bundle_type), pointer :: bundle
      type(error_type), allocatable :: error

      call begin_call()
      allocate (bundle)
      call bundle%add_text('version', version)
      call bundle%add_text('compiler', trim(get_compiler()))
      call leave(bundle, error, status, handle, n_byte, n_value)
      call end_call()
   end subroutine describe_library

   !> The full input of a namelist file.
   subroutine effective_case(path, status, handle, n_byte, n_value)
      ! Not threadsafe: functions with deferred-length texts keep the length in static memory.
      character(len=*), intent(in) :: path
      !> Status, handle and sizes as in `leave`.
      integer, intent(out) :: status, n_byte, n_value
      integer(int64), intent(out) :: handle
      type(bundle_type), pointer :: bundle
      type(case_type), target :: case
      type(error_type), allocatable :: error
      character(len=:), allocatable :: text

      call begin_call()
      allocate (bundle)
      call load_case(path, case, error)
      if (.not. allocated(error)) then
         call get_case_text(case, text)
         call bundle%add_text('case', text)
      end if
      call leave(bundle, error, status, handle, n_byte, n_value)
      call end_call()
   end subroutine effective_case

   !> Whether the text of a namelist file is a case.
   subroutine check_text(text, status, handle, n_byte, n_value)
      !f2py threadsafe
      character(len=*), intent(in) :: text
      !> Status, handle and sizes as in `leave`.
      integer, intent(out) :: status, n_byte, n_value
      integer(int64), intent(out) :: handle
      type(bundle_type), pointer :: bundle
      type(case_type), target :: case
      type(error_type), allocatable :: error

      call begin_call()
      allocate (bundle)
      call read_case(text, 'python', case, error)
      call leave(bundle, error, status, handle, n_byte, n_value)
      call end_call()
   end subroutine check_text

   !> The impact of a case.
   subroutine solve(text, status, handle, n_byte, n_value)
      !f2py threadsafe
      !> Text of a namelist file.
      character(len=*), intent(in) :: text
      !> Status, handle and sizes as in `leave`.
      integer, intent(out) :: status, n_byte, n_value
      integer(int64), intent(out) :: handle
      type(bundle_type), pointer :: bundle
      type(case_type), target :: case
      type(results_type) :: results
      type(error_type), allocatable :: error

      call begin_call()
      allocate (bundle)
      call read_case(text, 'python', case, error)
      if (.not. allocated(error)) call compute_case(case, results, error)
      if (.not. allocated(error)) call add_results(bundle, case, results)
      call leave(bundle, error, status, handle, n_byte, n_value)
      call end_call()
   end subroutine solve

   !> Free modes of the ball of a case.
   subroutine free_modes(text, status, handle, n_byte, n_value)
      ! Not threadsafe: ARPACK keeps its state in static memory.
      !> Text of a namelist file with the group `&modes`.
      character(len=*), intent(in) :: text
      !> Status, handle and sizes as in `leave`.
      integer, intent(out) :: status, n_byte, n_value
      integer(int64), intent(out) :: handle
      type(bundle_type), pointer :: bundle
      type(case_type), target :: case
      type(results_type) :: results
      type(error_type), allocatable :: error

      call begin_call()
      allocate (bundle)
      call read_case(text, 'python', case, error)
      case%has_impact = .false.
      if (.not. allocated(error)) call compute_case(case, results, error)
      if (.not. allocated(error)) call add_results(bundle, case, results)
      call leave(bundle, error, status, handle, n_byte, n_value)
      call end_call()
   end subroutine free_modes

   !> Slow compression of the ball of a case.
   subroutine compress(text, status, handle, n_byte, n_value)
      !f2py threadsafe
      !> Text of a namelist file with the group `&compression`.
      character(len=*), intent(in) :: text
      !> Status, handle and sizes as in `leave`.
      integer, intent(out) :: status, n_byte, n_value
      integer(int64), intent(out) :: handle
      type(bundle_type), pointer :: bundle
      type(case_type), target :: case
      type(compression_type) :: compression
      type(error_type), allocatable :: error

      call begin_call()
      allocate (bundle)
      call read_case(text, 'python', case, error)
      if (.not. allocated(error)) call compress_case(case, compression, error)
      if (.not. allocated(error)) call add_compression(bundle, compression)
      call leave(bundle, error, status, handle, n_byte, n_value)
      call end_call()
   end subroutine compress

   !> Loss factor of the material of a case against frequency.
   subroutine loss_factors(text, frequency, n, status, handle, n_byte, n_value)
      !f2py threadsafe
      !f2py integer, intent(hide), depend(frequency) :: n = len(frequency)
      !> Text of a namelist file.
      character(len=*), intent(in) :: text
      !> Number of frequencies.
      integer, intent(in) :: n
      !> Frequencies, Hz: [n].
      real(wp), intent(in) :: frequency(n)
      !> Status, handle and sizes as in `leave`.
      integer, intent(out) :: status, n_byte, n_value
      integer(int64), intent(out) :: handle
      type(bundle_type), pointer :: bundle
      type(case_type), target :: case
      type(error_type), allocatable :: error
      real(wp) :: loss_factor(n)

      call begin_call()
      allocate (bundle)
      call read_case(text, 'python', case, error)
      if (.not. allocated(error)) then
         associate (model => case%models(get_model_number(case))%model)
            call model%get_loss_factors(case%ball, frequency, loss_factor, error)
         end associate
      end if
      if (.not. allocated(error)) call bundle%add_array('loss_factors', [n], loss_factor)
      call leave(bundle, error, status, handle, n_byte, n_value)
      call end_call()
   end subroutine loss_factors

   !> Runs a namelist file as the executable does, and keeps what it has computed.
   subroutine run(path, output, replace, channels, progress, status, handle, n_byte, n_value)
      ! Not threadsafe: functions with deferred-length texts keep the length in static memory.
      !> Path of the file; output directory, empty for the default.
      character(len=*), intent(in) :: path, output
      !> 1 to replace files that thud has not written, too.
      integer, intent(in) :: replace
      !> 1 to write the channels of the histories, too.
      integer, intent(in) :: channels
      !> 1 to show progress on a terminal.
      integer, intent(in) :: progress
      !> Status, handle and sizes as in `leave`.
      integer, intent(out) :: status, n_byte, n_value
      integer(int64), intent(out) :: handle
      type(bundle_type), pointer :: bundle
      type(case_type), target :: case
      type(results_type) :: results
      type(outcome_type) :: outcome
      type(error_type), allocatable :: error
      character(len=:), allocatable :: text
      integer :: i

      call begin_call()
      allocate (bundle)
      if (progress == 1) call begin_progress()
      call run_case(path, output, replace == 1, channels == 1, case, results, outcome, error)
      call end_progress()
      if (.not. allocated(error)) then
         call get_case_text(case, text)
         call bundle%add_text('case', text)
         call bundle%add_text('directory', outcome%directory)
         call bundle%add_text('table', outcome%table)
         do i = 1, outcome%n_remark
            call bundle%add_text('run_remarks.'//to_text(i), outcome%remarks(i)%text)
         end do
         call bundle%add_number('conforms', merge(1.0_wp, 0.0_wp, outcome%conforms))
         call add_results(bundle, case, results)
      end if
      call leave(bundle, error, status, handle, n_byte, n_value)
      call end_call()
   end subroutine run

end module thud_api
