!> A floor that does not move, like the force plate of the standards.
module thud_rigid_floor
   use thud_error, only: error_type
   use thud_field, only: field_type
   use thud_floor_model, only: floor_model_type, floor_state_type
   implicit none (type, external)
   private

   public :: rigid_floor_type

   !> The floor, without options.
   type, extends(floor_model_type) :: rigid_floor_type
   contains
      procedure :: get_fields
      procedure :: prepare
      procedure :: has_radiator
   end type rigid_floor_type

contains

   !> No keys.
   function get_fields(self) result(fields)
      class(rigid_floor_type), intent(in), target :: self
      type(field_type), allocatable :: fields(:)

      allocate (fields(0))
   end function get_fields

   !> The default receiver, which is rigid.
   subroutine prepare(self, state, error)
      class(rigid_floor_type), intent(in) :: self
      type(floor_state_type), intent(out) :: state
      type(error_type), allocatable, intent(out) :: error

   end subroutine prepare

   !> No plate radiates into a room.
   pure function has_radiator(self) result(yes)
      class(rigid_floor_type), intent(in) :: self
      logical :: yes

      yes = .false.
   end function has_radiator

end module thud_rigid_floor
