!> Progress of long work as a line on the screen, if there is a terminal.
module thud_progress_line
   use, intrinsic :: iso_fortran_env, only: int64
   use thud_kinds, only: wp
   use thud_progress, only: show_progress
   use thud_system, only: is_terminal, standard_error, write_text
   use thud_text, only: fixed, screen_width
   implicit none (type, external)
   private

   public :: begin_progress, end_progress

   !> Time before the first line and between two lines, s.
   real(wp), parameter :: min_interval = 0.5_wp

   !> Clock at the latest line, and clock ticks per second.
   integer(int64) :: latest = 0, rate = 1

   !> A line is on the screen.
   logical :: shown = .false.

   !> Length of a line: of a full one, some terminals begin a new line.
   integer, parameter :: line_length = screen_width - 1

contains

   !> Shows progress from now on.
   subroutine begin_progress()
      if (.not. is_terminal(standard_error)) return
      call system_clock(latest, rate)
      show_progress => print_line
   end subroutine begin_progress

   !> Stops showing progress, and clears the line.
   subroutine end_progress()
      integer :: status

      if (shown) call write_text(standard_error, achar(13)//repeat(' ', line_length)//achar(13), status)
      show_progress => null()
      shown = .false.
   end subroutine end_progress

   !> Prints the line.
   subroutine print_line(done, whole, unit)
      !> Amount of work done.
      real(wp), intent(in) :: done
      !> Upper bound of the total amount; 0 if unknown.
      real(wp), intent(in) :: whole
      character(len=*), intent(in) :: unit
      character(len=line_length) :: line
      integer(int64) :: now
      integer :: status

      call system_clock(now)
      if (real(now - latest, wp) < min_interval*real(rate, wp)) return
      latest = now
      line = 'thud: '//fixed(done, 0)//' '//unit//' computed'
      if (whole > 0.0_wp) line = 'thud: '//fixed(done, 1)//' of at most '//fixed(whole, 1)//' '//unit//' computed'
      call write_text(standard_error, achar(13)//line, status)
      shown = .true.
   end subroutine print_line

end module thud_progress_line
