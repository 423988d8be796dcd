!> The executable `thud`: passes arguments to the library, and returns its exit code.
program thud
   use, intrinsic :: iso_c_binding, only: c_int
   use thud_command_line, only: execute
   use thud_system, only: end_process
   implicit none (type, external)
   integer :: exit_code

   call execute(exit_code)
   call end_process(int(exit_code, c_int))
end program thud
