!> A floating floor: a plate on a resilient layer on the plate above the room.
module thud_floating_floor
   use thud_double_plate, only: double_plate_type, get_lower_conductance, new_double_receiver
   use thud_error, only: error_type
   use thud_field, only: field_type, key_length
   use thud_kinds, only: wp
   use thud_new_field, only: real_field
   use thud_plate, only: get_plate_fields, plate_type
   use thud_receiver, only: receiver_type
   use thud_rectangular_floor, only: rectangular_floor_type
   implicit none (type, external)
   private

   public :: floating_floor_type

   !> The floor; the defaults are a cement screed on mineral wool on concrete.
   type, extends(rectangular_floor_type) :: floating_floor_type
      !> The plate above the room.
      type(plate_type) :: plate
      !> Thickness of the floating plate, m; its density, kg/m3; its longitudinal wave speed, m/s; its loss factor.
      real(wp) :: screed_thickness = 0.05_wp, screed_density = 2000.0_wp, screed_wave_speed = 3500.0_wp
      real(wp) :: screed_loss_factor = 0.03_wp
      !> Dynamic stiffness of the layer per unit area, N/m3, and its loss factor.
      real(wp) :: layer_stiffness = 1.0e7_wp, layer_loss_factor = 0.1_wp
   contains
      procedure, pass(options) :: get_fields
      procedure, pass(options) :: get_plates
      procedure, pass(options) :: get_mobility_at
      procedure, pass(options) :: get_radiator
   end type floating_floor_type

contains

   !> Keys and allowed ranges of the group `&floating_floor`.
   function get_fields(options) result(fields)
      class(floating_floor_type), intent(in), target :: options
      type(field_type), allocatable :: fields(:)

      fields = [get_plate_fields(options%plate), &
         real_field('screed_thickness', options%screed_thickness, 'm', 'thickness of the floating plate', '[0.003, 0.5]'), &
         real_field('screed_density', options%screed_density, 'kg/m3', 'density of the floating plate', '[10, 20000]'), &
         real_field('screed_wave_speed', options%screed_wave_speed, 'm/s', &
         'speed of longitudinal waves in the floating plate', '[100, 10000]'), &
         real_field('screed_loss_factor', options%screed_loss_factor, '', 'loss factor of the floating plate', '[0, 1]'), &
         real_field('layer_stiffness', options%layer_stiffness, 'N/m3', &
         'dynamic stiffness of the resilient layer per unit area (ISO 9052-1)', '[1e4, 1e12]'), &
         real_field('layer_loss_factor', options%layer_loss_factor, '', 'loss factor of the resilient layer', '[0, 1]'), &
         options%get_source_fields(), options%get_point_fields()]
   end function get_fields

   !> Both plates and the layer.
   pure function get_double_plate(options) result(floor)
      class(floating_floor_type), intent(in) :: options
      type(double_plate_type) :: floor

      floor%upper = plate_type(length=options%plate%length, width=options%plate%width, thickness=options%screed_thickness, &
         density=options%screed_density, wave_speed=options%screed_wave_speed, loss_factor=options%screed_loss_factor)
      floor%lower = options%plate
      floor%layer_stiffness = options%layer_stiffness
      floor%layer_loss = options%layer_loss_factor
   end function get_double_plate

   !> The floating plate, then the plate above the room.
   pure subroutine get_plates(options, group, plates)
      class(floating_floor_type), intent(in) :: options
      character(len=key_length), intent(out) :: group
      type(plate_type), allocatable, intent(out) :: plates(:)
      type(double_plate_type) :: floor

      group = 'floating_floor'
      floor = get_double_plate(options)
      plates = [floor%upper, floor%lower]
   end subroutine get_plates

   !> Transfer mobility from the source to a point of the floating plate.
   subroutine get_mobility_at(options, source, point, receiver, error)
      class(floating_floor_type), intent(in) :: options
      real(wp), intent(in) :: source(2), point(2)
      type(receiver_type), intent(out) :: receiver
      type(error_type), allocatable, intent(out) :: error

      call new_double_receiver(get_double_plate(options), source, point, receiver, error)
   end subroutine get_mobility_at

   !> The plate above the room, and its conductance with both plates infinite.
   subroutine get_radiator(options, frequency, plate, conductance, error)
      class(floating_floor_type), intent(in) :: options
      real(wp), intent(in) :: frequency(:)
      type(plate_type), intent(out) :: plate
      real(wp), intent(out) :: conductance(:)
      type(error_type), allocatable, intent(out) :: error

      plate = options%plate
      conductance = get_lower_conductance(get_double_plate(options), frequency)
   end subroutine get_radiator

end module thud_floating_floor
