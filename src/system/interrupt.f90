!> Interrupts and other states of the process, kept by `system.c`; long loops check for an interrupt.
module thud_interrupt
   use, intrinsic :: iso_c_binding, only: c_int
   use thud_error, only: error_type, signal_base
   implicit none (type, external)
   private

   public :: begin_call, check_interrupt, end_call, interrupt_calls, is_forked, is_interrupted, latest_signal
   public :: prepare_process

   !> Number of the signal that asks to end the work, 0 for none.
   integer(c_int), volatile, bind(c, name='thud_latest_signal') :: latest_signal

   !> 1 in a process forked from one that had called the library, whose threads it lacks, else 0.
   integer(c_int), volatile, bind(c, name='thud_is_forked') :: is_forked

   abstract interface
      subroutine plain_call() bind(c)
         implicit none (type, external)
      end subroutine plain_call
   end interface

   !> Marks the beginning of a call of the library: until its end, SIGINT and SIGTERM also set `latest_signal` if the process
   !> handles them. All calls from Python begin with it except `collect` and `end_calls`.
   procedure(plain_call), bind(c, name='thud_begin_call') :: begin_call
   !> Marks the end of a call.
   procedure(plain_call), bind(c, name='thud_end_call') :: end_call
   !> Interrupts all running calls.
   procedure(plain_call), bind(c, name='thud_interrupt_calls') :: interrupt_calls
   !> Begins a call as long as the process, for the executable: writing to a full or closed output is an error and not a
   !> signal, and the third SIGINT or SIGTERM ends the process.
   procedure(plain_call), bind(c, name='thud_prepare_process') :: prepare_process

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
