!> Kinds of numbers: the only real kind, and integers for bytes and sizes of memory.
module thud_kinds
   use, intrinsic :: iso_c_binding, only: c_double
   use, intrinsic :: iso_fortran_env, only: int8, int64
   implicit none (type, external)
   private

   public :: int8, int64, wp

   !> Working precision: IEEE double, the `double` of C.
   integer, parameter :: wp = c_double

end module thud_kinds
