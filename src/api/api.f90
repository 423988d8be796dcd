!> The flat API for Python, the only procedures that f2py wraps: the request for a question and the bundle with its answer
!> hold named texts, numbers and arrays.
!>
!> `ask` stores the bundle in the library and returns its handle and sizes; `collect` hands it over and deallocates it.
!> `status` is 0 or the error code; after an error the bundle holds that, see `store`.
!> Procedures marked `threadsafe` let other Python threads run meanwhile.
module thud_api
   use thud_answer, only: get_answer
   use thud_blas_threads, only: restore_blas_threads, use_one_blas_thread
   use thud_bundle, only: bundle_type, retrieve, store
   use thud_error, only: error_type
   use thud_interrupt, only: begin_call, end_call, interrupt_calls
   use thud_kinds, only: int64, int8, wp
   use thud_memory, only: require_memory
   use thud_request, only: request_type
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: ask, collect, end_calls

   !> Memory for each number of a request, bytes: up to 8.5 copies for levels, low-pass and peaks (measured), twice as many
   !> if the length is padded to the next power of two. Requests with fewer numbers than `few_numbers` are not checked.
   real(wp), parameter :: number_memory = 160.0_wp
   integer, parameter :: few_numbers = 1000000

contains

   !> Answers a question.
   subroutine ask(question, header, text, values, n, status, handle, n_byte, n_value)
      !f2py threadsafe
      !f2py integer, intent(hide), depend(values) :: n = len(values)
      !> Name of the question, see `thud_answer`; header and texts of the request, see `thud_request`.
      character(len=*), intent(in) :: question, header, text
      !> Number of values.
      integer, intent(in) :: n
      !> Values of the request: [n].
      real(wp), intent(in), target :: values(n)
      !> Code of the error, or 0; sizes as in `store`.
      integer, intent(out) :: status, n_byte, n_value
      integer(int64), intent(out) :: handle
      type(bundle_type), pointer :: bundle
      type(error_type), allocatable :: error

      call begin_call()
      call use_one_blas_thread()
      allocate (bundle)
      ! The process would end where an allocation fails.
      if (n > few_numbers) call require_memory(number_memory*n, 'the '//to_text(n)//' numbers of this call', &
         'fewer numbers', error)
      if (.not. allocated(error)) call get_answer(question, request_type(header, text, values), bundle, error)
      call store(bundle, error, status, handle, n_byte, n_value)
      call restore_blas_threads()
      call end_call()
   end subroutine ask

   !> Hands a bundle over and deallocates it.
   subroutine collect(handle, n_byte, n_value, bytes, values)
      !f2py threadsafe
      !> Handle of the bundle; valid once.
      integer(int64), intent(in) :: handle
      !> Sizes of the bundle, from `ask`.
      integer, intent(in) :: n_byte, n_value
      !> Header, a zero, and texts: [n_byte].
      integer(int8), intent(out) :: bytes(n_byte)
      !> The values, in the order of the header: [n_value].
      real(wp), intent(out) :: values(n_value)
      type(bundle_type), pointer :: bundle

      call retrieve(handle, bundle)
      bytes = transfer(bundle%header//achar(0)//bundle%text, bytes)
      call bundle%copy_values(values)
      deallocate (bundle)
   end subroutine collect

   !> Interrupts the calls that are running in other threads.
   subroutine end_calls()

      call interrupt_calls()
   end subroutine end_calls

end module thud_api
