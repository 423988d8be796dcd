!> The executable `thud`: passes arguments to the library, and returns its exit code.
program thud
   use, intrinsic :: iso_c_binding, only: c_int
   use thud_command_line, only: execute
   implicit none (type, external)
   interface
      ! Threads of OpenBLAS that wait for memory would delay a usual exit.
      subroutine end_process(code) bind(c, name='_exit')
         import :: c_int
         implicit none (type, external)
         integer(c_int), value :: code
      end subroutine end_process
   end interface
   integer :: exit_code

   call execute(exit_code)
   call end_process(int(exit_code, c_int))
end program thud
