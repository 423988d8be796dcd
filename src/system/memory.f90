!> Check of the memory that large work needs, before it begins.
module thud_memory
   use, intrinsic :: iso_c_binding, only: c_double, c_int
   use thud_error, only: error_type, numerical_error
   use thud_kinds, only: wp
   use thud_text, only: fixed
   implicit none (type, external)
   private

   public :: require_memory

   interface
      function c_has_memory(bytes, behind) bind(c, name='thud_has_memory') result(yes)
         import :: c_double, c_int
         implicit none (type, external)
         real(c_double), value :: bytes
         integer(c_int), value :: behind
         integer(c_int) :: yes
      end function c_has_memory
   end interface

contains

   !> Refuses work that needs more memory than there is.
   subroutine require_memory(bytes, purpose, allowed, error, mostly_unused)
      !> Required memory, bytes.
      real(wp), intent(in) :: bytes
      !> Its use, in the plural; a remedy.
      character(len=*), intent(in) :: purpose, allowed
      !> Names the bytes.
      type(error_type), allocatable, intent(out) :: error
      !> Little of it will be written to, so that addresses are enough (default: all of it will).
      logical, intent(in), optional :: mostly_unused
      integer(c_int) :: behind

      behind = 1
      if (present(mostly_unused)) behind = merge(0, 1, mostly_unused)
      if (c_has_memory(real(bytes, c_double), behind) == 0) error = numerical_error(purpose//' need '//fixed(bytes, 0) &
         //' bytes of memory, more than there is; allowed: '//allowed)
   end subroutine require_memory

end module thud_memory
