!> Allowed ranges as intervals: `(0, 10]`, or `(0, outer_radius)` if an end is the value of another key of the same group.
module thud_interval
   use thud_kinds, only: wp
   use thud_text, only: is_number, to_text
   implicit none (type, external)
   private

   public :: get_range_text, interval_type, key_length, new_interval

   !> Length of the name of a key or a group.
   integer, parameter :: key_length = 24

   !> An interval of real numbers.
   type :: interval_type
      !> The ends.
      real(wp) :: lower = -huge(1.0_wp), upper = huge(1.0_wp)
      !> The end is excluded.
      logical :: lower_open = .false., upper_open = .false.
      !> Keys whose values are the ends; blank for a number.
      character(len=key_length) :: lower_key = '', upper_key = ''
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
      call read_end(text(2:comma - 1), interval%lower, interval%lower_key)
      call read_end(text(comma + 1:last - 1), interval%upper, interval%upper_key)
   end function new_interval

   !> Reads one end of an interval.
   pure subroutine read_end(text, number, key)
      character(len=*), intent(in) :: text
      !> Value of the end; unchanged if it is the value of a key, or left out.
      real(wp), intent(inout) :: number
      !> The key; unchanged for a number.
      character(len=key_length), intent(inout) :: key

      if (is_number(adjustl(text))) then
         read (text, *) number
      else
         key = adjustl(text)
      end if
   end subroutine read_end

   !> Gives the ends that depend on other keys their values.
   pure subroutine resolve(self, keys, values)
      class(interval_type), intent(inout) :: self
      !> Names of the keys of the group, each once: [n_key].
      character(len=*), intent(in) :: keys(:)
      !> Their values: [n_key].
      real(wp), intent(in) :: values(:)

      if (self%lower_key /= '') self%lower = sum(values, mask=keys == self%lower_key)
      if (self%upper_key /= '') self%upper = sum(values, mask=keys == self%upper_key)
   end subroutine resolve

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

      call get_end_text(interval%lower, interval%lower_key, lower)
      call get_end_text(interval%upper, interval%upper_key, upper)
      text = lower//' '//trim(merge('< ', '<=', interval%lower_open))//' '//name//' ' &
         //trim(merge('< ', '<=', interval%upper_open))//' '//upper
   end subroutine get_range_text

   !> One end as text; a key with its value if that is known.
   subroutine get_end_text(number, key, text)
      real(wp), intent(in) :: number
      !> The key; blank for a number.
      character(len=*), intent(in) :: key
      character(len=:), allocatable, intent(out) :: text

      text = to_text(number)
      ! Whole numbers need no decimals.
      if (index(text, '.0', back=.true.) == len(text) - 1) text = text(:len(text) - 2)
      if (key == '') return
      text = trim(key)//' = '//text
      if (.not. abs(number) < huge(number)) text = trim(key)
   end subroutine get_end_text

end module thud_interval
