!> A floating floor: a plate on a resilient layer on the plate over the room below.
module thud_floating_floor
   use thud_double_plate, only: double_plate_type, get_lower_conductance, new_double_receiver
   use thud_error, only: error_type
   use thud_field, only: field_type
   use thud_floor_model, only: floor_model_type, reason_length
   use thud_kinds, only: wp
   use thud_new_field, only: real_field
   use thud_plate, only: get_plate_fields, get_thin_limit, plate_type
   use thud_plate_modes, only: check_inside, check_mode_count
   use thud_receiver, only: receiver_type
   implicit none (type, external)
   private

   public :: floating_floor_type

   !> The floor; the defaults are a cement screed on mineral wool on concrete.
   type, extends(floor_model_type) :: floating_floor_type
      !> The plate over the room.
      type(plate_type) :: plate
      !> Thickness of the floating plate, m; its density, kg/m3; its longitudinal wave speed, m/s; its loss factor.
      real(wp) :: screed_thickness = 0.05_wp, screed_density = 2000.0_wp, screed_wave_speed = 3500.0_wp
      real(wp) :: screed_loss_factor = 0.03_wp
      !> Dynamic stiffness of the layer over area, N/m3, and its loss factor.
      real(wp) :: layer_stiffness = 1.0e7_wp, layer_loss_factor = 0.1_wp
      !> Place of the source, over length and width.
      real(wp) :: source_x = 0.5_wp, source_y = 0.5_wp
   contains
      procedure, pass(options) :: get_fields
      procedure, pass(options) :: check
      procedure, pass(options) :: get_receiver
      procedure, pass(options) :: get_transfer
      procedure, pass(options) :: get_radiator
      procedure, pass(options) :: get_validity
   end type floating_floor_type

contains

   !> Keys and allowed ranges of the group `&floating_floor`.
   function get_fields(options) result(fields)
      !> The options that the fields read and set.
      class(floating_floor_type), intent(in), target :: options
      !> Those of the plate over the room, one per component, and the points: [20].
      type(field_type), allocatable :: fields(:)

      fields = [get_plate_fields(options%plate), &
         real_field('screed_thickness', options%screed_thickness, 'm', 'thickness of the floating plate', '[0.003, 0.5]'), &
         real_field('screed_density', options%screed_density, 'kg/m3', 'density of the floating plate', '[10, 20000]'), &
         real_field('screed_wave_speed', options%screed_wave_speed, 'm/s', &
         'speed of longitudinal waves in the floating plate', '[100, 10000]'), &
         real_field('screed_loss_factor', options%screed_loss_factor, '', 'loss factor of the floating plate', '[0, 1]'), &
         real_field('layer_stiffness', options%layer_stiffness, 'N/m3', &
         'dynamic stiffness of the resilient layer over area (ISO 9052-1)', '[1e4, 1e12]'), &
         real_field('layer_loss_factor', options%layer_loss_factor, '', 'loss factor of the resilient layer', '[0, 1]'), &
         real_field('source_x', options%source_x, '', 'relative source position along the length', '(0, 1)'), &
         real_field('source_y', options%source_y, '', 'relative source position along the width', '(0, 1)'), &
         options%get_point_fields()]
   end function get_fields

   !> Plates and layer.
   pure function get_double_plate(options) result(floor)
      class(floating_floor_type), intent(in) :: options
      type(double_plate_type) :: floor

      floor%upper = plate_type(length=options%plate%length, width=options%plate%width, thickness=options%screed_thickness, &
         density=options%screed_density, wave_speed=options%screed_wave_speed, loss_factor=options%screed_loss_factor)
      floor%lower = options%plate
      floor%layer_stiffness = options%layer_stiffness
      floor%layer_loss = options%layer_loss_factor
   end function get_double_plate

   !> Refuses floors with too many modes.
   subroutine check(options, error)
      class(floating_floor_type), intent(in) :: options
      !> Names the size.
      type(error_type), allocatable, intent(out) :: error
      type(double_plate_type) :: floor

      floor = get_double_plate(options)
      call check_mode_count('floating_floor', floor%upper, error)
      if (.not. allocated(error)) call check_mode_count('floating_floor', floor%lower, error)
   end subroutine check

   !> What a source on the floating plate feels.
   subroutine get_receiver(options, receiver, error)
      class(floating_floor_type), intent(in) :: options
      type(receiver_type), intent(out) :: receiver
      !> The losses are too high.
      type(error_type), allocatable, intent(out) :: error

      call new_double_receiver(get_double_plate(options), [options%source_x, options%source_y], &
         [options%source_x, options%source_y], receiver, error)
   end subroutine get_receiver

   !> Velocity of another point of the floating plate.
   subroutine get_transfer(options, x, y, transfer, error)
      class(floating_floor_type), intent(in) :: options
      !> Place of the point, m.
      real(wp), intent(in) :: x, y
      type(receiver_type), intent(out) :: transfer
      !> The point lies outside, or the losses are too high.
      type(error_type), allocatable, intent(out) :: error

      associate (plate => options%plate)
         call check_inside('floating_floor', plate%length, plate%width, x, y, error)
         if (.not. allocated(error)) call new_double_receiver(get_double_plate(options), &
            [options%source_x, options%source_y], [x/plate%length, y/plate%width], transfer, error)
      end associate
   end subroutine get_transfer

   !> The plate over the room, and what reaches it of infinite plates.
   subroutine get_radiator(options, frequency, plate, conductance, error)
      class(floating_floor_type), intent(in) :: options
      !> Frequencies, Hz: [n].
      real(wp), intent(in) :: frequency(:)
      type(plate_type), intent(out) :: plate
      !> The power over the mean square of the force, m/(N s): [n].
      real(wp), intent(out) :: conductance(:)
      !> Never.
      type(error_type), allocatable, intent(out) :: error

      plate = options%plate
      conductance = get_lower_conductance(get_double_plate(options), frequency)
   end subroutine get_radiator

   !> Band in which both plates are thin.
   subroutine get_validity(options, lowest, highest, reason)
      class(floating_floor_type), intent(in) :: options
      !> Ends of the band, Hz.
      real(wp), intent(out) :: lowest, highest
      !> What ends it.
      character(len=reason_length), intent(out) :: reason
      type(double_plate_type) :: floor

      floor = get_double_plate(options)
      lowest = 0.0_wp
      highest = min(get_thin_limit(floor%upper), get_thin_limit(floor%lower))
      reason = 'bending waves are shorter than six thicknesses, and a plate is not thin'
   end subroutine get_validity

end module thud_floating_floor
