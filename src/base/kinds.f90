!> The one kind of all real numbers.
module thud_kinds
   use, intrinsic :: iso_fortran_env, only: real64
   implicit none (type, external)
   private

   public :: wp

   !> Working precision: IEEE double.
   integer, parameter :: wp = real64

end module thud_kinds
