!> Kinds of numbers: one of all real numbers, and the integers that memory is counted in.
module thud_kinds
   use, intrinsic :: iso_fortran_env, only: int8, int64, real64
   implicit none (type, external)
   private

   public :: int8, int64, wp

   !> Working precision: IEEE double.
   integer, parameter :: wp = real64

end module thud_kinds
