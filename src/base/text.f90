!> Numbers as text, and helpers for character strings.
!>
!> Results have an explicit, not a deferred length: gfortran keeps the length of a deferred-length result in static
!> memory, which threads would share.
module thud_text
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_is_nan
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: byte_order_mark, fixed, flush_right, get_suggestion, get_width, is_number, is_utf8, join, join_quoted
   public :: lower_case, marked, newline, padded, quoted, replaced, shortened, significant, split, tab, to_text

   !> Width of the screen, characters.
   integer, parameter, public :: screen_width = 80

   !> Maximum length of a value in a message.
   integer, parameter :: longest_shown = 80

   !> Maximum number of zeros before or behind the digits of a number in a table.
   integer, parameter :: max_decimals = 6

   !> Line feed, the line end in all files that thud writes.
   character(len=*), parameter :: newline = new_line('a')

   !> UTF-8 byte order mark, with which some editors begin a text.
   character(len=*), parameter :: byte_order_mark = char(239)//char(187)//char(191)

   !> End of a marked text, see `marked`.
   character(len=*), parameter, public :: end_mark = achar(4)

   !> Horizontal tab.
   character(len=*), parameter :: tab = achar(9)

   !> Length sufficient for any number.
   integer, parameter :: number_length = 40

   !> Shortest text from which the same value is read.
   interface to_text
      module procedure :: integer_to_text
      module procedure :: real_to_text
   end interface to_text

   !> Texts or numbers separated by commas.
   interface join
      module procedure :: join_words
      module procedure :: join_numbers
   end interface join

contains

   !> Integer without blanks.
   pure function integer_to_text(value) result(text)
      integer, intent(in) :: value
      character(len=len_trim(format_fixed(real(value, wp), 0))) :: text

      text = format_fixed(real(value, wp), 0)
   end function integer_to_text

   !> Shortest decimal text from which exactly the same number is read.
   pure function real_to_text(value) result(text)
      real(wp), intent(in) :: value
      !> Decimal notation from 1e-4 to 1e7, else with an exponent.
      character(len=len_trim(format_real(value))) :: text

      text = format_real(value)
   end function real_to_text

   !> Number with fixed decimals, for tables: `fixed(20.4261_wp, 2)` is `20.43`.
   pure function fixed(value, decimals) result(text)
      real(wp), intent(in) :: value
      integer, intent(in) :: decimals
      !> The rounded number, with a leading zero; without the sign of a negative one that is rounded to zero.
      character(len=len_trim(format_fixed(value, decimals))) :: text

      text = format_fixed(value, decimals)
   end function fixed

   !> Number with significant digits, for tables: `significant(0.0123_wp, 2)` is `0.012`, and 0 is `0`.
   pure function significant(value, digits) result(text)
      real(wp), intent(in) :: value
      integer, intent(in) :: digits
      !> The rounded number; with decimals unless they would be zeros before the digits of a tiny one.
      character(len=len_trim(format_significant(value, digits))) :: text

      text = format_significant(value, digits)
   end function significant

   !> Number with fixed decimals, padded with blanks.
   pure function format_fixed(value, decimals) result(buffer)
      real(wp), intent(in) :: value
      integer, intent(in) :: decimals
      character(len=number_length) :: buffer
      character(len=12) :: form

      ! Not a number, infinite, or wider than the buffer.
      if (.not. abs(value) < 1.0e20_wp) buffer = format_real(value)
      if (.not. abs(value) < 1.0e20_wp) return
      write (form, '(a,i0,a)') '(f40.', decimals, ')'
      write (buffer, form) value
      buffer = adjustl(buffer)
      if (decimals == 0) buffer(len_trim(buffer):) = ''
      ! No negative zero.
      if (verify(trim(buffer), '-0.') == 0) buffer = adjustl(merge(' ', buffer(:1), buffer(:1) == '-')//buffer(2:))
   end function format_fixed

   !> Number with significant digits, padded with blanks.
   pure function format_significant(value, digits) result(buffer)
      real(wp), intent(in) :: value
      integer, intent(in) :: digits
      character(len=number_length) :: buffer
      character(len=12) :: form
      integer :: exponent

      buffer = format_fixed(value, 0)
      if (.not. (abs(value) > 0.0_wp .and. ieee_is_finite(value))) return
      ! The exponent of the rounded number.
      write (form, '(a,i0,a)') '(es40.', digits - 1, 'e3)'
      write (buffer, form) value
      read (buffer(len(buffer) - 3:), *) exponent
      if (abs(exponent) <= max_decimals) then
         buffer = format_fixed(value, max(digits - 1 - exponent, 0))
      else
         buffer = adjustl(buffer)
      end if
   end function format_significant

   !> Shortest decimal text of a number, padded with blanks.
   elemental function format_real(value) result(buffer)
      real(wp), intent(in) :: value
      character(len=number_length) :: buffer
      character(len=12) :: form
      real(wp) :: read_back
      integer :: digits, exponent

      if (.not. ieee_is_finite(value)) then
         buffer = merge('-Infinity', 'Infinity ', value < 0.0_wp)
         if (ieee_is_nan(value)) buffer = 'NaN'
         return
      end if
      ! Digits behind the first.
      do digits = 0, 16
         write (form, '(a,i0,a)') '(es40.', digits, 'e3)'
         write (buffer, form) value
         read (buffer, form) read_back
         ! Compilers warn of == between reals.
         if (.not. abs(read_back - value) > 0.0_wp) exit
      end do
      read (buffer(number_length - 3:), *) exponent
      if (exponent >= -4 .and. exponent < 7) then
         write (form, '(a,i0,a)') '(f40.', max(digits - exponent, 1), ')'
         write (buffer, form) value
      else
         write (form, '(a,i0)') trim(merge('0e', 'e ', digits == 0)), exponent
         buffer = adjustl(buffer(:number_length - 5)//form)
      end if
      buffer = adjustl(buffer)
   end function format_real

   !> ASCII letters in lower case; everything else unchanged.
   pure function lower_case(text) result(lower)
      character(len=*), intent(in) :: text
      character(len=len(text)) :: lower
      integer :: i

      do i = 1, len(text)
         lower(i:i) = text(i:i)
         if (text(i:i) >= 'A' .and. text(i:i) <= 'Z') lower(i:i) = achar(iachar(text(i:i)) + 32)
      end do
   end function lower_case

   !> Whether the bytes of a text are UTF-8.
   pure function is_utf8(text) result(valid)
      character(len=*), intent(in) :: text
      !> False also for characters encoded in more bytes than needed.
      logical :: valid
      integer :: code(len(text) + 3)
      ! Number of bytes that continue the current character.
      integer :: n
      integer :: i

      code = [(iachar(text(i:i)), i=1, len(text)), 0, 0, 0]
      valid = .true.
      i = 1
      do while (valid .and. i <= len(text))
         associate (first => code(i), next => code(i + 1))
            n = count(first >= [194, 224, 240])
            ! Invalid: longer forms than needed, surrogates, and code points beyond the last character.
            valid = (first < 128 .or. n > 0) .and. first < 245 .and. all(iand(code(i + 1:i + n), 192) == 128) &
               .and. .not. any([first == 224 .and. next < 160, first == 237 .and. next > 159, &
               first == 240 .and. next < 144, first == 244 .and. next > 143])
         end associate
         i = i + n + 1
      end do
   end function is_utf8

   !> Whether a text is one number. List-directed `read` alone would also accept repeat counts, names, exponents without a
   !> letter (`1-5`), and a single sign or point.
   pure function is_number(text) result(yes)
      !> The text, without blanks around it.
      character(len=*), intent(in) :: text
      !> It is a number, `nan`, `inf` or `infinity`.
      logical :: yes
      character(len=len(text)) :: word
      integer :: sign

      word = lower_case(text)
      if (scan(word, '+-') == 1) word = word(2:)
      sign = scan(word, '+-', back=.true.)
      yes = verify(word, '0123456789+-.ed ') == 0 .and. scan(word, '0123456789') > 0 .and. index(trim(word), ' ') == 0
      if (sign > 0) yes = yes .and. scan(word(max(sign - 1, 1):sign - 1), 'ed') == 1
      yes = yes .or. any(word == [character(len=8) :: 'nan', 'inf', 'infinity'])
   end function is_number

   !> A text in which a character replaces all characters of a set.
   pure function replaced(text, set, new) result(changed)
      !> The text; the characters to replace.
      character(len=*), intent(in) :: text, set
      !> The replacement.
      character(len=1), intent(in) :: new
      character(len=len(text)) :: changed
      integer :: i

      changed = text
      do i = 1, len(text)
         if (scan(text(i:i), set) > 0) changed(i:i) = new
      end do
   end function replaced

   !> A text for a message; cut texts end in dots.
   pure function shortened(text) result(short)
      !> Any text.
      character(len=*), intent(in) :: text
      character(len=min(len(text), longest_shown)) :: short

      short = text
      if (len(text) > longest_shown) short(longest_shown - 2:) = '...'
   end function shortened

   !> Pieces of a text between marks; none of an empty text.
   pure subroutine split(text, mark, pieces)
      character(len=*), intent(in) :: text
      character(len=1), intent(in) :: mark
      !> The pieces: [n_piece].
      character(len=*), allocatable, intent(out) :: pieces(:)
      integer :: i, at, length

      allocate (pieces(count([(text(i:i) == mark, i=1, len(text))]) + merge(1, 0, len(text) > 0)))
      at = 1
      do i = 1, size(pieces)
         length = index(text(at:)//mark, mark) - 1
         pieces(i) = text(at:at + length - 1)
         at = at + length + 1
      end do
   end subroutine split

   !> Text as a namelist character constant, with quotes inside doubled.
   pure function quoted(text) result(constant)
      !> Any text; trailing blanks are dropped.
      character(len=*), intent(in) :: text
      character(len=quoted_length(text)) :: constant
      integer :: i, at

      constant = "''"
      at = 1
      do i = 1, len_trim(text)
         associate (n => merge(2, 1, text(i:i) == "'"))
            constant(at + 1:) = repeat(text(i:i), n)//"'"
            at = at + n
         end associate
      end do
   end function quoted

   !> Length of a text as a namelist character constant.
   elemental function quoted_length(text) result(length)
      character(len=*), intent(in) :: text
      !> Length including the quotes, with quotes inside doubled.
      integer :: length
      integer :: i

      length = len_trim(text) + count([(text(i:i) == "'", i=1, len_trim(text))]) + 2
   end function quoted_length

   !> `'one', 'two', 'three'` from a list of words.
   pure function join_quoted(words) result(text)
      !> The words: [n_word].
      character(len=*), intent(in) :: words(:)
      !> The words in quotes, separated by commas.
      character(len=sum(quoted_length(words)) + 2*max(size(words) - 1, 0)) :: text
      integer :: i, at

      at = 1
      do i = 1, size(words)
         text(at:) = quoted(words(i))//','
         at = at + quoted_length(words(i)) + 2
      end do
   end function join_quoted

   !> Texts separated by commas: `one, two, three`.
   pure function join_words(words) result(text)
      !> The texts, whose trailing blanks are dropped: [n_word].
      character(len=*), intent(in) :: words(:)
      character(len=sum(len_trim(words)) + 2*max(size(words) - 1, 0)) :: text
      integer :: i, at

      at = 1
      do i = 1, size(words)
         text(at:) = trim(words(i))//','
         at = at + len_trim(words(i)) + 2
      end do
   end function join_words

   !> Numbers separated by commas.
   pure function join_numbers(values) result(text)
      !> The numbers: [n].
      real(wp), intent(in) :: values(:)
      character(len=sum(len_trim(format_real(values))) + 2*max(size(values) - 1, 0)) :: text

      text = join_words(format_real(values))
   end function join_numbers

   !> The known word that a misspelled one probably means, by the number of insertions, deletions and replacements of letters
   !> that turn one into the other (Levenshtein distance).
   pure subroutine get_suggestion(word, known, suggestion)
      !> The misspelled word.
      character(len=*), intent(in) :: word
      !> The known words: [n_known].
      character(len=*), intent(in) :: known(:)
      !> ` (did you mean 'height'?)`; empty if no word is close.
      character(len=:), allocatable, intent(out) :: suggestion
      ! Distance between the first j letters of the word and the first i letters of a known one; that for i - 1.
      integer :: row(0:len(word)), before(0:len(word))
      integer :: distance(size(known))
      integer :: i, j, k

      suggestion = ''
      if (size(known) == 0 .or. len(word) > longest_shown) return
      do k = 1, size(known)
         row = [(j, j=0, len(word))]
         do i = 1, len_trim(known(k))
            before = row
            row(0) = i
            do j = 1, len(word)
               row(j) = min(row(j - 1) + 1, before(j) + 1, &
                  before(j - 1) + merge(0, 1, lower_case(word(j:j)) == lower_case(known(k)(i:i))))
            end do
         end do
         distance(k) = row(len(word))
      end do
      k = minloc(distance, dim=1)
      ! A third of the letters may be wrong.
      if (3*distance(k) <= max(len(word), len_trim(known(k)))) suggestion = ' (did you mean '//quoted(known(k))//'?)'
   end subroutine get_suggestion

   !> A text padded with blanks on the right.
   pure function padded(text, width) result(cell)
      character(len=*), intent(in) :: text
      !> Width of the cell; longer text keeps its length.
      integer, intent(in) :: width
      character(len=max(width, len_trim(text))) :: cell

      cell = text
   end function padded

   !> A text padded with blanks on the left.
   pure function flush_right(text, width) result(cell)
      character(len=*), intent(in) :: text
      !> Width of the cell; longer text keeps its length.
      integer, intent(in) :: width
      character(len=max(width, len(text))) :: cell

      cell = repeat(' ', len(cell) - len(text))//text
   end function flush_right

   !> Text between marks without width, for which the screen shows a color or nothing.
   pure function marked(text, kind) result(between)
      !> The text; trailing blanks are dropped.
      character(len=*), intent(in) :: text
      !> Kind of the text, 1 to 3.
      integer, intent(in) :: kind
      character(len=len_trim(text) + 2) :: between

      between = achar(kind)//trim(text)//end_mark
   end function marked

   !> Number of characters of a text.
   pure function get_width(text) result(width)
      !> UTF-8: bytes that continue a character, and marks, have no width.
      character(len=*), intent(in) :: text
      integer :: width
      integer :: i

      width = count([(iand(iachar(text(i:i)), 192) /= 128 .and. iachar(text(i:i)) > 4, i=1, len(text))])
   end function get_width

end module thud_text
