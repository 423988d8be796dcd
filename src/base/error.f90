!> Errors as values: a procedure that can fail has an allocatable argument `error`, unallocated on success.
module thud_error
   use thud_text, only: is_utf8
   implicit none (type, external)
   private

   public :: error_type, bad_input, signal_base, numerical_failure, input_error, numerical_error

   !> Code of invalid input; also the exit code of the executable.
   integer, parameter :: bad_input = 1

   !> Code of a failed computation; also the exit code of the executable.
   integer, parameter :: numerical_failure = 2

   !> An interrupt has the code `signal_base` plus the signal's number; also the exit code of the executable.
   integer, parameter :: signal_base = 128

   !> An error, with its message for the user.
   type :: error_type
      !> `bad_input`, `numerical_failure`, or `signal_base` plus the signal's number.
      integer :: code = numerical_failure
      !> Message that names key or position, value and allowed range.
      character(len=:), allocatable :: message
      !> Whether the time steps are too long; shorter ones may succeed.
      logical :: has_coarse_steps = .false.
      !> Whether the record is clearly shorter than the contact, which may have no end, at any resolution.
      logical :: has_short_record = .false.
   end type error_type

contains

   !> Error of the user's input.
   pure function input_error(message) result(error)
      !> The message for the user.
      character(len=*), intent(in) :: message
      type(error_type) :: error
      character(len=len(message)) :: text
      integer :: i, max_code

      text = message
      ! Replace bytes of the input that cannot be shown: control characters, the zero byte, which would end the message,
      ! and invalid UTF-8, which also arises when a shortened value ends within a character.
      max_code = merge(255, 126, is_utf8(text))
      do i = 1, len(text)
         if (iachar(text(i:i)) < 32 .or. iachar(text(i:i)) == 127 .or. iachar(text(i:i)) > max_code) text(i:i) = '?'
      end do
      error = error_type(code=bad_input, message=text)
   end function input_error

   !> Error of a failed computation.
   pure function numerical_error(message) result(error)
      !> The message for the user.
      character(len=*), intent(in) :: message
      type(error_type) :: error

      error = error_type(code=numerical_failure, message=message)
   end function numerical_error

end module thud_error
