!> Checks before large work begins that there is enough memory.
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

   !> Returns an error if work needs more memory than is available.
   subroutine require_memory(bytes, purpose, allowed, error, mostly_unused)
      !> Memory needed at a time, bytes.
      real(wp), intent(in) :: bytes
      !> What needs the memory, in the plural; what would need less.
      character(len=*), intent(in) :: purpose, allowed
      type(error_type), allocatable, intent(out) :: error
      !> Little of the memory is written to, so that addresses are enough (default: false).
      logical, intent(in), optional :: mostly_unused
      integer(c_int) :: behind

      behind = 1
      if (present(mostly_unused)) behind = merge(0, 1, mostly_unused)
      if (c_has_memory(real(bytes, c_double), behind) == 0) error = numerical_error(purpose//' need '//fixed(bytes, 0) &
         //' bytes of memory, more than there is; allowed: '//allowed)
   end subroutine require_memory

end module thud_memory
