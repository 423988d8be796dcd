!> A homogeneous, simply supported rectangular plate above the room.
module thud_plate_floor
   use thud_error, only: error_type
   use thud_field, only: field_type, key_length
   use thud_kinds, only: wp
   use thud_plate, only: get_plate_fields, get_resistance, plate_type
   use thud_plate_modes, only: new_plate_receiver
   use thud_receiver, only: receiver_type
   use thud_rectangular_floor, only: rectangular_floor_type
   implicit none (type, external)
   private

   public :: plate_floor_type

   !> The floor.
   type, extends(rectangular_floor_type) :: plate_floor_type
      type(plate_type) :: plate
   contains
      procedure, pass(options) :: get_fields
      procedure, pass(options) :: get_plates
      procedure, pass(options) :: get_mobility_at
      procedure, pass(options) :: get_radiator
   end type plate_floor_type

contains

   !> Keys and allowed ranges of the group `&plate`.
   function get_fields(options) result(fields)
      class(plate_floor_type), intent(in), target :: options
      type(field_type), allocatable :: fields(:)

      fields = [get_plate_fields(options%plate), options%get_source_fields(), options%get_point_fields()]
   end function get_fields

   !> The plate.
   pure subroutine get_plates(options, group, plates)
      class(plate_floor_type), intent(in) :: options
      character(len=key_length), intent(out) :: group
      type(plate_type), allocatable, intent(out) :: plates(:)

      group = 'plate'
      plates = [options%plate]
   end subroutine get_plates

   !> Transfer mobility from the source to a point, as poles and residues.
   subroutine get_mobility_at(options, source, point, receiver, error)
      class(plate_floor_type), intent(in) :: options
      real(wp), intent(in) :: source(2), point(2)
      type(receiver_type), intent(out) :: receiver
      type(error_type), allocatable, intent(out) :: error

      call new_plate_receiver('plate', options%plate, source, point, receiver, error)
   end subroutine get_mobility_at

   !> The plate itself; its conductance, averaged over positions, is that of the infinite plate.
   subroutine get_radiator(options, frequency, plate, conductance, error)
      class(plate_floor_type), intent(in) :: options
      real(wp), intent(in) :: frequency(:)
      type(plate_type), intent(out) :: plate
      real(wp), intent(out) :: conductance(:)
      type(error_type), allocatable, intent(out) :: error

      plate = options%plate
      conductance = 1/get_resistance(plate)
   end subroutine get_radiator

end module thud_plate_floor
