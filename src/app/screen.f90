!> The screen: lines that fit it, and colors where a terminal shows them.
module thud_screen
   use thud_error, only: bad_input
   use thud_system, only: get_system_message, is_terminal, standard_error, standard_output, write_text
   use thud_text, only: newline, to_text, wrap_lines
   implicit none (type, external)
   private

   public :: print_message, print_results, write_screen

   !> Colors of warnings and of errors.
   integer, parameter, public :: yellow = 33, red = 31
   integer, parameter :: green = 32

   !> Words of verdicts, and their colors.
   character(len=*), parameter :: words(*) = [character(len=16) :: 'conforms', 'does not conform', 'too low', 'too high', &
      'undecided']
   integer, parameter :: colors(size(words)) = [green, red, red, red, yellow]

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
      if (has_colors(standard_output)) then
         do i = 1, size(words)
            call paint(lines, trim(words(i)), colors(i))
         end do
      end if
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
      if (has_colors(standard_error)) lines = painted(lines(:5), color)//lines(6:)
      call write_screen(standard_error, lines, exit_code)
   end subroutine print_message

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

   !> Colors a word wherever it stands alone.
   subroutine paint(text, word, color)
      character(len=:), allocatable, intent(inout) :: text
      character(len=*), intent(in) :: word
      integer, intent(in) :: color
      character(len=:), allocatable :: rest
      integer :: at

      rest = text
      text = ''
      do
         at = index(rest, word)
         if (at == 0) exit
         text = text//rest(:at - 1)
         rest = rest(at + len(word):)
         if (scan(rest(:1), ' .;'//newline) > 0) then
            text = text//painted(word, color)
         else
            text = text//word
         end if
      end do
      text = text//rest
   end subroutine paint

   !> A text in color, by a control sequence of ECMA-48.
   pure function painted(text, color) result(sequence)
      character(len=*), intent(in) :: text
      integer, intent(in) :: color
      character(len=:), allocatable :: sequence

      sequence = achar(27)//'['//to_text(color)//'m'//text//achar(27)//'[0m'
   end function painted

end module thud_screen
