!> The screen: lines that fit it, and colors where a terminal shows them.
module thud_screen
   use thud_error, only: bad_input
   use thud_system, only: get_system_message, is_terminal, standard_error, standard_output, write_text
   use thud_text, only: end_mark, get_width, newline, screen_width, to_text
   implicit none (type, external)
   private

   public :: print_message, print_results, wrap_lines, write_screen

   !> Colors of warnings and of errors.
   integer, parameter, public :: yellow = 33, red = 31
   integer, parameter :: green = 32

   !> Colors of verdicts, by their codes.
   integer, parameter :: colors(*) = [green, red, yellow]

contains

   !> Prints results, with colored verdicts, and where they are.
   subroutine print_results(text, directory, exit_code)
      character(len=*), intent(in) :: text
      !> Path, which stays in one piece.
      character(len=*), intent(in) :: directory
      !> Becomes 1 if the text cannot be written.
      integer, intent(inout) :: exit_code
      character(len=:), allocatable :: lines
      integer :: i

      call wrap_lines(text, lines)
      do i = 1, size(colors)
         call replace_marks(lines, achar(i), get_sequence(colors(i)))
      end do
      call replace_marks(lines, end_mark, get_sequence(0))
      call write_screen(standard_output, lines//'  Results: '//directory//newline, exit_code)
   end subroutine print_results

   !> Prints an error or a warning: in a log it stays one line.
   subroutine print_message(text, color, exit_code)
      character(len=*), intent(in) :: text
      !> `red` or `yellow`.
      integer, intent(in) :: color
      !> Becomes 1 if the text cannot be written.
      integer, intent(inout) :: exit_code
      character(len=:), allocatable :: lines

      lines = 'thud: '//text//newline
      if (is_terminal(standard_error)) call wrap_lines('thud: '//text//newline, lines)
      if (has_colors(standard_error)) lines = get_sequence(color)//lines(:5)//get_sequence(0)//lines(6:)
      call write_screen(standard_error, lines, exit_code)
   end subroutine print_message

   !> Text whose lines fit the screen. Long ones are broken at blanks, and their further lines are indented; words and paths
   !> that are wider than the screen stay whole.
   pure subroutine wrap_lines(text, wrapped)
      !> Lines of UTF-8.
      character(len=*), intent(in) :: text
      character(len=:), allocatable, intent(out) :: wrapped
      ! First characters of the line of `text`, and of what is not yet in `wrapped`; last blank; width since `begin`.
      integer :: line, begin, blank, width, i, indentation

      wrapped = ''
      line = 1
      begin = 1
      blank = 0
      width = 0
      do i = 1, len(text)
         width = width + get_width(text(i:i))
         if (text(i:i) == newline) then
            wrapped = wrapped//text(begin:i)
            line = i + 1
            begin = line
            width = 0
         else if (text(i:i) == ' ' .and. verify(text(line:i), ' ') > 0) then
            blank = i
         end if
         if (width <= screen_width .or. blank <= begin) cycle
         ! Further lines of a comment in a namelist are comments, too.
         indentation = verify(text(line:), ' !') - 1
         wrapped = wrapped//trim(text(begin:blank))//newline//text(line:line + indentation - 1)//'  '
         begin = blank + 1
         width = indentation + 2 + get_width(text(begin:i))
      end do
      wrapped = wrapped//text(begin:)
   end subroutine wrap_lines

   !> Writes to the screen; a full disk is an error, a closed pipe is not.
   subroutine write_screen(descriptor, text, exit_code)
      !> `standard_output` or `standard_error`.
      integer, intent(in) :: descriptor
      character(len=*), intent(in) :: text
      !> Becomes 1 if the text cannot be written.
      integer, intent(inout) :: exit_code
      integer :: status

      call write_text(descriptor, text, status)
      if (status == 0) return
      exit_code = bad_input
      if (descriptor == standard_output) call write_text(standard_error, 'thud: standard output cannot be written (' &
         //trim(get_system_message(status))//'); allowed: a screen, a pipe, or a disk with space'//newline, status)
   end subroutine write_screen

   !> Whether a descriptor shows colors, and the user wants them (https://no-color.org).
   function has_colors(descriptor) result(yes)
      !> `standard_output` or `standard_error`.
      integer, intent(in) :: descriptor
      logical :: yes
      character(len=4) :: terminal
      integer :: unwanted

      call get_environment_variable('NO_COLOR', length=unwanted)
      call get_environment_variable('TERM', terminal)
      yes = is_terminal(descriptor) .and. unwanted == 0 .and. terminal /= '' .and. terminal /= 'dumb'
   end function has_colors

   !> Replaces marks in results by what the standard output shows for them.
   subroutine replace_marks(text, mark, sequence)
      character(len=:), allocatable, intent(inout) :: text
      character(len=1), intent(in) :: mark
      !> Control sequence, without effect if there are no colors.
      character(len=*), intent(in) :: sequence
      integer :: at, last

      last = merge(len(sequence), 0, has_colors(standard_output))
      do
         at = index(text, mark)
         if (at == 0) exit
         text = text(:at - 1)//sequence(:last)//text(at + 1:)
      end do
   end subroutine replace_marks

   !> The control sequence of ECMA-48 for a color, 0 for none.
   pure function get_sequence(color) result(sequence)
      integer, intent(in) :: color
      character(len=:), allocatable :: sequence

      sequence = achar(27)//'['//to_text(color)//'m'
   end function get_sequence

end module thud_screen
