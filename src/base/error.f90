!> Errors as values: a routine that can fail has an allocatable `error` that stays
!> unallocated when all went well.
module thud_error
   use thud_text, only: is_utf8
   implicit none (type, external)
   private

   public :: error_type, bad_input, signal_base, numerical_failure, input_error, numerical_error

   !> The input cannot be used; also the exit code of the executable.
   integer, parameter :: bad_input = 1

   !> The computation broke down; also the exit code of the executable.
   integer, parameter :: numerical_failure = 2

   !> Codes of interrupts, and exit codes of the executable: this plus the number of the signal.
   integer, parameter :: signal_base = 128

   !> An error, with its message for the user.
   type :: error_type
      !> `bad_input`, `numerical_failure`, or `signal_base` plus the number of the signal.
      integer :: code = numerical_failure
      !> Message that names key or position, value and allowed range.
      character(len=:), allocatable :: message
   end type error_type

contains

   !> Error of the user's input.
   pure function input_error(message) result(error)
      !> The message for the user.
      character(len=*), intent(in) :: message
      type(error_type) :: error
      character(len=len(message)) :: text
      integer :: i, last

      text = message
      ! Control characters do not print, a zero byte would end the message, and bytes that are no characters spoil the
      ! screen; input may hold them, and a character may be cut in two where a value is shortened.
      last = merge(255, 126, is_utf8(text))
      do i = 1, len(text)
         if (iachar(text(i:i)) < 32 .or. iachar(text(i:i)) == 127 .or. iachar(text(i:i)) > last) text(i:i) = '?'
      end do
      error = error_type(code=bad_input, message=text)
   end function input_error

   !> Error of a computation that could not be carried through.
   pure function numerical_error(message) result(error)
      !> The message for the user.
      character(len=*), intent(in) :: message
      type(error_type) :: error

      error = error_type(code=numerical_failure, message=message)
   end function numerical_error

end module thud_error
