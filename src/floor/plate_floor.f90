!> A homogeneous rectangular plate over the room below.
module thud_plate_floor
   use thud_error, only: error_type
   use thud_field, only: field_type
   use thud_floor_model, only: floor_model_type
   use thud_kinds, only: wp
   use thud_plate, only: get_plate_fields, get_resistance, plate_type
   use thud_receiver, only: receiver_type
   implicit none (type, external)
   private

   public :: plate_floor_type

   !> The floor.
   type, extends(floor_model_type) :: plate_floor_type
      type(plate_type) :: plate
   contains
      procedure, pass(options) :: get_fields
      procedure, pass(options) :: get_receiver
      procedure, pass(options) :: get_radiator
   end type plate_floor_type

contains

   !> Keys and allowed ranges of the group `&plate`.
   function get_fields(options) result(fields)
      class(plate_floor_type), intent(in), target :: options
      !> One field per component.
      type(field_type), allocatable :: fields(:)

      fields = get_plate_fields(options%plate)
   end function get_fields

   !> The mobility of the infinite plate, the mean over positions of a finite one.
   subroutine get_receiver(options, receiver, error)
      class(plate_floor_type), intent(in) :: options
      type(receiver_type), intent(out) :: receiver
      !> Never.
      type(error_type), allocatable, intent(out) :: error

      receiver%direct = 1/get_resistance(options%plate)
      allocate (receiver%pole(0), receiver%residue(0))
   end subroutine get_receiver

   !> The plate itself; of a finite one the conductance of the infinite one is the mean over positions.
   subroutine get_radiator(options, frequency, plate, conductance, error)
      class(plate_floor_type), intent(in) :: options
      !> Frequencies, Hz: [n].
      real(wp), intent(in) :: frequency(:)
      type(plate_type), intent(out) :: plate
      !> The power over the mean square of the force, m/(N s): [n].
      real(wp), intent(out) :: conductance(:)
      !> Never.
      type(error_type), allocatable, intent(out) :: error

      plate = options%plate
      conductance = 1/get_resistance(plate)
   end subroutine get_radiator

end module thud_plate_floor
