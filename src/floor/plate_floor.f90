!> A homogeneous rectangular plate over the room below, simply supported.
module thud_plate_floor
   use thud_error, only: error_type
   use thud_field, only: field_type
   use thud_floor_model, only: floor_model_type, reason_length
   use thud_kinds, only: wp
   use thud_new_field, only: real_field
   use thud_plate, only: get_plate_fields, get_resistance, get_thin_limit, plate_type
   use thud_plate_modes, only: check_inside, check_mode_count, new_plate_receiver
   use thud_receiver, only: receiver_type
   implicit none (type, external)
   private

   public :: plate_floor_type

   !> The floor.
   type, extends(floor_model_type) :: plate_floor_type
      type(plate_type) :: plate
      !> Place of the source, over length and width.
      real(wp) :: source_x = 0.5_wp, source_y = 0.5_wp
   contains
      procedure, pass(options) :: get_fields
      procedure, pass(options) :: check
      procedure, pass(options) :: get_receiver
      procedure, pass(options) :: get_transfer
      procedure, pass(options) :: get_radiator
      procedure, pass(options) :: get_validity
   end type plate_floor_type

contains

   !> Keys and allowed ranges of the group `&plate`.
   function get_fields(options) result(fields)
      class(plate_floor_type), intent(in), target :: options
      !> Those of the plate, the place of the source, and the points: [12].
      type(field_type), allocatable :: fields(:)

      fields = [get_plate_fields(options%plate), &
         real_field('source_x', options%source_x, '', 'relative source position along the length', '(0, 1)'), &
         real_field('source_y', options%source_y, '', 'relative source position along the width', '(0, 1)'), &
         options%get_point_fields()]
   end function get_fields

   !> Refuses plates with too many modes.
   subroutine check(options, error)
      class(plate_floor_type), intent(in) :: options
      !> Names the size.
      type(error_type), allocatable, intent(out) :: error

      call check_mode_count('plate', options%plate, error)
   end subroutine check

   !> What a source feels.
   subroutine get_receiver(options, receiver, error)
      class(plate_floor_type), intent(in) :: options
      type(receiver_type), intent(out) :: receiver
      !> The losses are too high.
      type(error_type), allocatable, intent(out) :: error

      associate (source => [options%source_x, options%source_y])
         call new_plate_receiver('plate', options%plate, source, source, receiver, error)
      end associate
   end subroutine get_receiver

   !> Velocity of another point.
   subroutine get_transfer(options, x, y, transfer, error)
      class(plate_floor_type), intent(in) :: options
      !> Place of the point, m.
      real(wp), intent(in) :: x, y
      type(receiver_type), intent(out) :: transfer
      !> The point lies outside, or the losses are too high.
      type(error_type), allocatable, intent(out) :: error

      associate (plate => options%plate)
         call check_inside('plate', plate%length, plate%width, x, y, error)
         if (.not. allocated(error)) call new_plate_receiver('plate', plate, [options%source_x, options%source_y], &
            [x/plate%length, y/plate%width], transfer, error)
      end associate
   end subroutine get_transfer

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

   !> Band in which the plate is thin.
   subroutine get_validity(options, lowest, highest, reason)
      class(plate_floor_type), intent(in) :: options
      !> Ends of the band, Hz.
      real(wp), intent(out) :: lowest, highest
      !> What ends it.
      character(len=reason_length), intent(out) :: reason

      lowest = 0.0_wp
      highest = get_thin_limit(options%plate)
      reason = 'bending waves are shorter than six thicknesses, and the plate is not thin'
   end subroutine get_validity

end module thud_plate_floor
