!> Errors as values: a procedure that can fail has an allocatable argument `error`, unallocated on success.
module thud_error
   use thud_constants, only: not_a_number
   use thud_interval, only: interval_type
   use thud_kinds, only: wp
   use thud_text, only: is_utf8
   implicit none (type, external)
   private

   public :: error_type, bad_input, prefix_error, signal_base, numerical_failure, input_error, numerical_error

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
      !> Group and key that the message is about, and what it says of them; unallocated if it is about no group.
      character(len=:), allocatable :: group, key, problem
      !> Value outside its range, in the unit of the key, and the range; unallocated if the message is about no range.
      real(wp) :: value = not_a_number
      type(interval_type), allocatable :: range
      !> Whether the time steps are too long; shorter ones may succeed.
      logical :: has_coarse_steps = .false.
      !> Whether the record is clearly shorter than the contact, which may have no end, at any resolution.
      logical :: has_short_record = .false.
   end type error_type

contains

   !> Error of the user's input.
   pure function input_error(problem, group, key) result(error)
      !> What is wrong; the message for the user if no group is given.
      character(len=*), intent(in) :: problem
      !> Group and key that are wrong, with which the message begins.
      character(len=*), intent(in), optional :: group, key
      type(error_type) :: error

      error%code = bad_input
      error%message = shown(problem)
      if (.not. present(group)) return
      error%problem = error%message
      error%group = shown(trim(group))
      error%key = ''
      if (present(key)) error%key = shown(trim(key))
      error%message = '&'//error%group//': '//trim(adjustl(error%key//' '//error%problem))
   end function input_error

   !> Error of a failed computation, by the same arguments.
   pure function numerical_error(problem, group, key) result(error)
      character(len=*), intent(in) :: problem
      character(len=*), intent(in), optional :: group, key
      type(error_type) :: error

      error = input_error(problem, group, key)
      error%code = numerical_failure
   end function numerical_error

   !> Puts a place, such as a path, in front of the message of an error.
   pure subroutine prefix_error(error, place)
      type(error_type), intent(inout) :: error
      character(len=*), intent(in) :: place

      error%message = shown(place)//': '//error%message
   end subroutine prefix_error

   !> Text without bytes of the input that cannot be shown: control characters, the zero byte, which would end the message,
   !> and invalid UTF-8, which also arises when a shortened value ends within a character.
   pure function shown(text) result(plain)
      character(len=*), intent(in) :: text
      character(len=len(text)) :: plain
      integer :: i, max_code

      plain = text
      max_code = merge(255, 126, is_utf8(text))
      do i = 1, len(text)
         if (iachar(text(i:i)) < 32 .or. iachar(text(i:i)) == 127 .or. iachar(text(i:i)) > max_code) plain(i:i) = '?'
      end do
   end function shown

end module thud_error
