!> The executable `thud`: arguments to library to exit code.
program thud
   use thud_command_line, only: execute
   implicit none (type, external)
   integer :: exit_code

   call execute(exit_code)
   if (exit_code /= 0) stop exit_code, quiet=.true.
end program thud
