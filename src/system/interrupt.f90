!> Interrupt flag, set by the signal handler in system.c; long loops check it.
module thud_interrupt
   use, intrinsic :: iso_c_binding, only: c_int
   use thud_error, only: error_type, signal_base
   implicit none (type, external)
   private

   public :: check_interrupt, is_interrupted, latest_signal

   !> Number of the signal that asks to end the work, 0 for none; defined in system.c.
   integer(c_int), volatile, bind(c, name='thud_latest_signal') :: latest_signal

contains

   !> Whether the work is to end; threads in a parallel region then skip their remaining work.
   function is_interrupted() result(yes)
      logical :: yes

      yes = latest_signal /= 0_c_int
   end function is_interrupted

   !> Returns an error after an interrupt.
   subroutine check_interrupt(error)
      !> Set after an interrupt, unless it is set already.
      type(error_type), allocatable, intent(inout) :: error

      if (is_interrupted() .and. .not. allocated(error)) error = error_type(signal_base + latest_signal, &
         'interrupted; nothing was written')
   end subroutine check_interrupt

end module thud_interrupt
