!> A floor that does not move, like the force plate of the standards.
module thud_rigid_floor
   use thud_error, only: error_type
   use thud_field, only: field_type
   use thud_floor_model, only: floor_model_type
   use thud_receiver, only: receiver_type
   implicit none (type, external)
   private

   public :: rigid_floor_type

   !> The floor, without options.
   type, extends(floor_model_type) :: rigid_floor_type
   contains
      procedure, pass(options) :: get_fields
      procedure, pass(options) :: get_receiver
      procedure, pass(options) :: has_radiator
   end type rigid_floor_type

contains

   !> No keys.
   function get_fields(options) result(fields)
      class(rigid_floor_type), intent(in), target :: options
      type(field_type), allocatable :: fields(:)

      allocate (fields(0))
   end function get_fields

   !> The default receiver, which is rigid.
   subroutine get_receiver(options, receiver, error)
      class(rigid_floor_type), intent(in) :: options
      type(receiver_type), intent(out) :: receiver
      type(error_type), allocatable, intent(out) :: error

   end subroutine get_receiver

   !> No plate radiates into a room.
   pure function has_radiator(options) result(yes)
      class(rigid_floor_type), intent(in) :: options
      logical :: yes

      yes = .false.
   end function has_radiator

end module thud_rigid_floor
