!> Numbers as text and small helpers on character strings.
module thud_text
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_is_nan
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: fixed, join_quoted, lower_case, newline, quoted, replaced, to_text

   !> Line feed, the line end of every file that thud writes.
   character(len=*), parameter :: newline = new_line('a')

   !> Shortest text that reads back as the same value.
   interface to_text
      module procedure :: integer_to_text
      module procedure :: logical_to_text
      module procedure :: real_to_text
   end interface to_text

contains

   !> Integer without blanks.
   pure function integer_to_text(value) result(text)
      !> The number.
      integer, intent(in) :: value
      !> Its digits.
      character(len=:), allocatable :: text
      character(len=16) :: buffer

      write (buffer, '(i0)') value
      text = trim(buffer)
   end function integer_to_text

   !> Logical as a namelist holds it.
   pure function logical_to_text(value) result(text)
      !> The truth value.
      logical, intent(in) :: value
      !> `.true.` or `.false.`.
      character(len=:), allocatable :: text

      text = trim(merge('.true. ', '.false.', value))
   end function logical_to_text

   !> Shortest decimal text that reads back as exactly the same number.
   pure function real_to_text(value) result(text)
      !> The number.
      real(wp), intent(in) :: value
      !> Decimal notation from 1e-4 to 1e7, else with an exponent.
      character(len=:), allocatable :: text
      character(len=32) :: buffer, form
      real(wp) :: read_back
      integer :: digits

      if (ieee_is_nan(value)) then
         text = 'NaN'
      else if (.not. ieee_is_finite(value)) then
         text = trim(merge('-Infinity', 'Infinity ', value < 0.0_wp))
      else
         do digits = 0, 16
            write (form, '(a,i0,a)') '(es32.', digits, 'e3)'
            write (buffer, form) value
            read (buffer, form) read_back
            ! "not different" says what is meant where == on reals is a mistake.
            if (.not. abs(read_back - value) > 0.0_wp) exit
         end do
         text = tidy_exponent(trim(adjustl(buffer)))
      end if
   end function real_to_text

   !> Rewrites `1.25E+001` as `12.5`, and `1.E-010` as `1.0e-10`.
   pure function tidy_exponent(scientific) result(text)
      !> Number in `es` format with three exponent digits.
      character(len=*), intent(in) :: scientific
      !> The same number, readable.
      character(len=:), allocatable :: text
      character(len=:), allocatable :: digits, sign
      integer :: exponent, mark

      mark = scan(scientific, 'E')
      read (scientific(mark + 1:), *) exponent
      sign = ''
      digits = scientific(:mark - 1)
      if (digits(1:1) == '-') then
         sign = '-'
         digits = digits(2:)
      end if
      digits = digits(1:1)//digits(3:)
      if (verify(digits, '0') == 0) exponent = 0

      if (exponent >= 0 .and. exponent < 7) then
         if (len(digits) < exponent + 2) digits = digits//repeat('0', exponent + 2 - len(digits))
         text = sign//digits(:exponent + 1)//'.'//digits(exponent + 2:)
      else if (exponent < 0 .and. exponent >= -4) then
         text = sign//'0.'//repeat('0', -exponent - 1)//digits
      else
         if (len(digits) == 1) digits = digits//'0'
         text = sign//digits(1:1)//'.'//digits(2:)//'e'//integer_to_text(exponent)
      end if
   end function tidy_exponent

   !> Number with a fixed count of decimals, for tables: `fixed(20.4261_wp, 2)` is `20.43`.
   pure function fixed(value, decimals) result(text)
      !> The number.
      real(wp), intent(in) :: value
      !> Digits behind the point.
      integer, intent(in) :: decimals
      !> The rounded number, with a leading zero.
      character(len=:), allocatable :: text
      character(len=40) :: buffer, form

      write (form, '(a,i0,a)') '(f40.', decimals, ')'
      write (buffer, form) value
      text = trim(adjustl(buffer))
      if (decimals == 0) text = text(:len(text) - 1)
   end function fixed

   !> ASCII letters in lower case; everything else unchanged.
   pure function lower_case(text) result(lower)
      !> Any text.
      character(len=*), intent(in) :: text
      !> The text in lower case.
      character(len=len(text)) :: lower
      integer :: i

      do i = 1, len(text)
         lower(i:i) = text(i:i)
         if (text(i:i) >= 'A' .and. text(i:i) <= 'Z') lower(i:i) = achar(iachar(text(i:i)) + 32)
      end do
   end function lower_case

   !> Text as a namelist character constant: quotes inside are doubled.
   pure function quoted(text) result(constant)
      !> Any text; trailing blanks are dropped.
      character(len=*), intent(in) :: text
      !> The text in single quotes.
      character(len=:), allocatable :: constant

      constant = "'"//replaced(trim(text), "'", "''")//"'"
   end function quoted

   !> `'one', 'two', 'three'` from a list of words.
   pure function join_quoted(words) result(text)
      !> The words: [n_word].
      character(len=*), intent(in) :: words(:)
      !> All of them, in quotes, with commas between.
      character(len=:), allocatable :: text
      integer :: i

      text = ''
      do i = 1, size(words)
         if (i > 1) text = text//', '
         text = text//quoted(words(i))
      end do
   end function join_quoted

   !> Text with every occurrence of a single character replaced.
   pure function replaced(text, old, new) result(changed)
      !> Any text.
      character(len=*), intent(in) :: text
      !> Character to be replaced.
      character(len=1), intent(in) :: old
      !> What stands in its place.
      character(len=*), intent(in) :: new
      !> The text after replacement.
      character(len=:), allocatable :: changed
      integer :: i

      changed = ''
      do i = 1, len(text)
         if (text(i:i) == old) then
            changed = changed//new
         else
            changed = changed//text(i:i)
         end if
      end do
   end function replaced

end module thud_text
