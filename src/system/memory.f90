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
      function c_has_memory(bytes, check_available) bind(c, name='thud_has_memory') result(yes)
         import :: c_double, c_int
         implicit none (type, external)
         real(c_double), value :: bytes
         integer(c_int), value :: check_available
         integer(c_int) :: yes
      end function c_has_memory
   end interface

contains

   !> Returns an error if work needs more memory than is available.
   subroutine require_memory(bytes, purpose, allowed, error, mostly_unused)
      !> Memory needed at a time, bytes.
      real(wp), intent(in) :: bytes
      !> What needs the memory, in the plural.
      character(len=*), intent(in) :: purpose
      !> What would need less.
      character(len=*), intent(in) :: allowed
      type(error_type), allocatable, intent(out) :: error
      !> Little of the memory is written to: check only the address space (default: false).
      logical, intent(in), optional :: mostly_unused
      integer(c_int) :: check_available

      check_available = 1
      if (present(mostly_unused)) check_available = merge(0, 1, mostly_unused)
      if (c_has_memory(real(bytes, c_double), check_available) == 0) error = numerical_error(purpose//' need ' &
         //fixed(bytes, 0)//' bytes of memory, more than there is; allowed: '//allowed)
   end subroutine require_memory

end module thud_memory
