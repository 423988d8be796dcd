!> Allowed ranges as intervals: `(0, 10]`, or `(0, outer_radius)` if an end depends on other keys. Such an
!> end is a product or quotient of numbers and keys of the same group.
module thud_interval
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use thud_kinds, only: wp
   use thud_text, only: is_number, to_text
   implicit none (type, external)
   private

   public :: evaluate, expression_length, get_range_text, interval_type, new_interval, to_end_text

   !> Maximum length of an expression for an end.
   integer, parameter :: expression_length = 32

   !> An interval of real numbers.
   type :: interval_type
      !> The ends.
      real(wp) :: lower = -huge(1.0_wp), upper = huge(1.0_wp)
      !> The end is excluded.
      logical :: lower_open = .false., upper_open = .false.
      !> Ends as expressions of other keys; blank for a number.
      character(len=expression_length) :: lower_expression = '', upper_expression = ''
   contains
      procedure :: contains => contains_value
      procedure :: resolve
   end type interval_type

contains

   !> Interval from a text.
   pure function new_interval(text) result(interval)
      !> The ends between brackets, a round bracket for an excluded end; blank for all numbers.
      character(len=*), intent(in) :: text
      type(interval_type) :: interval
      integer :: comma, last

      last = len_trim(text)
      if (last == 0) return
      comma = index(text, ',')
      interval%lower_open = text(1:1) == '('
      interval%upper_open = text(last:last) == ')'
      call read_end(text(2:comma - 1), interval%lower, interval%lower_expression)
      call read_end(text(comma + 1:last - 1), interval%upper, interval%upper_expression)
   end function new_interval

   !> Reads one end of an interval.
   pure subroutine read_end(text, number, expression)
      character(len=*), intent(in) :: text
      !> Value of the end; unchanged for an expression.
      real(wp), intent(inout) :: number
      !> The expression; blank for a number.
      character(len=expression_length), intent(out) :: expression

      expression = ''
      if (is_number(adjustl(text))) then
         read (text, *) number
      else
         expression = adjustl(text)
      end if
   end subroutine read_end

   !> Evaluates the ends that depend on other keys.
   pure subroutine resolve(self, keys, values)
      class(interval_type), intent(inout) :: self
      !> Names of the keys: [n_key].
      character(len=*), intent(in) :: keys(:)
      !> Values of the keys: [n_key].
      real(wp), intent(in) :: values(:)

      if (self%lower_expression /= '') self%lower = evaluate(self%lower_expression, keys, values)
      if (self%upper_expression /= '') self%upper = evaluate(self%upper_expression, keys, values)
   end subroutine resolve

   !> Value of a product or quotient of numbers and keys; NaN if a key is unknown.
   pure function evaluate(expression, keys, values) result(value)
      !> An expression such as `static_harmonics/2`.
      character(len=*), intent(in) :: expression
      !> Names of the keys: [n_key].
      character(len=*), intent(in) :: keys(:)
      !> Values of the keys: [n_key].
      real(wp), intent(in) :: values(:)
      real(wp) :: value
      real(wp) :: operand
      integer :: start, length, key, status
      character(len=len(expression)) :: word
      character(len=128) :: message
      character(len=1) :: operator

      value = 1.0_wp
      operator = '*'
      start = 1
      do
         length = scan(expression(start:)//'*', '*/') - 1
         word = adjustl(expression(start:start + length - 1))
         key = findloc(keys == word, .true., dim=1)
         if (key > 0) then
            operand = values(key)
         else
            read (word, *, iostat=status, iomsg=message) operand
            if (status /= 0) operand = ieee_value(operand, ieee_quiet_nan)
         end if
         if (operator == '*') value = value*operand
         if (operator == '/') value = value/operand
         start = start + length + 1
         if (start > len(expression)) exit
         operator = expression(start - 1:start - 1)
      end do
   end function evaluate

   !> Whether a value lies in the interval; NaN never does.
   elemental function contains_value(self, value) result(inside)
      !> The interval with resolved ends.
      class(interval_type), intent(in) :: self
      real(wp), intent(in) :: value
      logical :: inside

      inside = (value > self%lower .or. (.not. self%lower_open .and. value >= self%lower)) &
         .and. (value < self%upper .or. (.not. self%upper_open .and. value <= self%upper))
   end function contains_value

   !> The interval as inequalities for a key: `0 < outer_radius <= 10`.
   subroutine get_range_text(interval, name, text)
      type(interval_type), intent(in) :: interval
      character(len=*), intent(in) :: name
      character(len=:), allocatable, intent(out) :: text
      character(len=:), allocatable :: lower, upper

      call to_end_text(interval%lower, interval%lower_expression, lower)
      call to_end_text(interval%upper, interval%upper_expression, upper)
      text = lower//' '//trim(merge('< ', '<=', interval%lower_open))//' '//name//' ' &
         //trim(merge('< ', '<=', interval%upper_open))//' '//upper
   end subroutine get_range_text

   !> One end as text; an expression with its value if known.
   subroutine to_end_text(number, expression, text)
      real(wp), intent(in) :: number
      !> The expression; blank for a number.
      character(len=*), intent(in) :: expression
      character(len=:), allocatable, intent(out) :: text

      text = to_text(number)
      ! Whole numbers need no decimals.
      if (len(text) > 2) then
         if (text(len(text) - 1:) == '.0') text = text(:len(text) - 2)
      end if
      if (expression == '') return
      if (abs(number) < huge(number)) then
         text = trim(expression)//' = '//text
      else
         text = trim(expression)
      end if
   end subroutine to_end_text

end module thud_interval
