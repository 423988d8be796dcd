!> A floor of rectangular plates with the source on the upper plate: keys, checks and receivers that such floors share.
module thud_rectangular_floor
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type, key_length
   use thud_floor_model, only: floor_model_type, reason_length
   use thud_kinds, only: wp
   use thud_new_field, only: real_field
   use thud_plate, only: get_thin_limit, plate_type
   use thud_plate_modes, only: check_mode_count
   use thud_receiver, only: receiver_type
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: rectangular_floor_type

   !> The floor; all plates have the same length and width.
   type, abstract, extends(floor_model_type) :: rectangular_floor_type
      !> Relative position of the source along length and width.
      real(wp) :: source_x = 0.5_wp, source_y = 0.5_wp
   contains
      procedure, pass(options) :: get_source_fields
      procedure, pass(options) :: check
      procedure, pass(options) :: get_receiver
      procedure, pass(options) :: get_transfer
      procedure, pass(options) :: get_validity
      procedure(get_plates), deferred, pass(options) :: get_plates
      procedure(get_mobility_at), deferred, pass(options) :: get_mobility_at
   end type rectangular_floor_type

   abstract interface
      !> The plates, the upper one first.
      pure subroutine get_plates(options, group, plates)
         import :: key_length, plate_type, rectangular_floor_type
         implicit none (type, external)
         class(rectangular_floor_type), intent(in) :: options
         !> Namelist group of the plates.
         character(len=key_length), intent(out) :: group
         !> The plates: [n_plate].
         type(plate_type), allocatable, intent(out) :: plates(:)
      end subroutine get_plates

      !> Transfer mobility from a source to a point of the upper plate.
      subroutine get_mobility_at(options, source, point, receiver, error)
         import :: error_type, receiver_type, rectangular_floor_type, wp
         implicit none (type, external)
         class(rectangular_floor_type), intent(in) :: options
         !> Positions of source and point, as fractions of length and width: [2].
         real(wp), intent(in) :: source(2), point(2)
         !> The transfer mobility, as poles and residues.
         type(receiver_type), intent(out) :: receiver
         !> Set if the losses are too high.
         type(error_type), allocatable, intent(out) :: error
      end subroutine get_mobility_at
   end interface

contains

   !> Fields of the position of the source: [2].
   function get_source_fields(options) result(fields)
      class(rectangular_floor_type), intent(in), target :: options
      type(field_type) :: fields(2)

      fields = [ &
         real_field('source_x', options%source_x, '', 'relative source position along the length; ' &
         //'levels in the room are means', '(0, 1)'), &
         real_field('source_y', options%source_y, '', 'relative source position along the width', '(0, 1)')]
   end function get_source_fields

   !> Checks the number of modes of the plates.
   subroutine check(options, error)
      class(rectangular_floor_type), intent(in) :: options
      type(error_type), allocatable, intent(out) :: error
      type(plate_type), allocatable :: plates(:)
      character(len=key_length) :: group
      integer :: i

      call options%get_plates(group, plates)
      do i = 1, size(plates)
         if (.not. allocated(error)) call check_mode_count(trim(group), plates(i), error)
      end do
   end subroutine check

   !> Mobility at the source.
   subroutine get_receiver(options, receiver, error)
      class(rectangular_floor_type), intent(in) :: options
      type(receiver_type), intent(out) :: receiver
      type(error_type), allocatable, intent(out) :: error

      associate (source => [options%source_x, options%source_y])
         call options%get_mobility_at(source, source, receiver, error)
      end associate
   end subroutine get_receiver

   !> Transfer mobility to another point; a point outside the floor is an error.
   subroutine get_transfer(options, x, y, transfer, error)
      class(rectangular_floor_type), intent(in) :: options
      real(wp), intent(in) :: x, y
      type(receiver_type), intent(out) :: transfer
      type(error_type), allocatable, intent(out) :: error
      type(plate_type), allocatable :: plates(:)
      character(len=key_length) :: group

      call options%get_plates(group, plates)
      associate (length => plates(1)%length, width => plates(1)%width)
         if (x >= 0.0_wp .and. x <= length .and. y >= 0.0_wp .and. y <= width) then
            call options%get_mobility_at([options%source_x, options%source_y], [x/length, y/width], transfer, error)
         else
            error = input_error('&'//trim(group)//': the point ('//to_text(x)//', '//to_text(y) &
               //') m lies outside; allowed: 0 to '//to_text(length)//' m and 0 to '//to_text(width)//' m')
         end if
      end associate
   end subroutine get_transfer

   !> Frequency band in which all plates are thin.
   subroutine get_validity(options, lowest, highest, reason)
      class(rectangular_floor_type), intent(in) :: options
      real(wp), intent(out) :: lowest, highest
      character(len=reason_length), intent(out) :: reason
      type(plate_type), allocatable :: plates(:)
      character(len=key_length) :: group

      call options%get_plates(group, plates)
      lowest = 0.0_wp
      highest = minval(get_thin_limit(plates))
      reason = 'bending waves are shorter than six thicknesses, and a plate is not thin'
   end subroutine get_validity

end module thud_rectangular_floor
