!> A floor given by its modes in a file: measured ones, or those of another program.
module thud_modal_floor
   use thud_constants, only: pi
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type, name_length
   use thud_floor_model, only: check_point, floor_model_type, floor_state_type
   use thud_floor_modes, only: floor_modes_type, new_floor_receiver
   use thud_kinds, only: wp
   use thud_new_field, only: real_field, text_field
   use thud_plate, only: get_mode_density, get_plate_fields, get_resistance, get_surface_mass, plate_type
   use thud_receiver, only: receiver_type
   use thud_sampled_modes, only: read_sampled_modes
   use thud_text, only: fixed, to_text
   implicit none (type, external)
   private

   public :: modal_floor_type

   !> Maximum ratio of the mass that the modes show to that of the plate, and the inverse; maximum ratio of the number of
   !> modes of the plate to the number of modes in the file.
   real(wp), parameter :: max_mass_ratio = 3.0_wp, max_count_ratio = 3.0_wp

   !> The floor.
   type, extends(floor_model_type) :: modal_floor_type
      !> Path of the file of modes.
      character(len=name_length) :: file = ''
      !> Relative position of the source along length and width.
      real(wp) :: source_x = 0.5_wp, source_y = 0.5_wp
      !> Static compliance at the source of the modes above those of the file, m/N; 0: that of the plate.
      real(wp) :: residual_compliance = 0.0_wp
      !> Homogeneous plate of the same mass and mean stiffness; no thickness: none. The file states sides and losses.
      type(plate_type) :: plate = plate_type(thickness=0.0_wp)
   contains
      procedure :: get_fields
      procedure :: check
      procedure :: prepare
      procedure :: get_sides
      procedure :: check_radiator
      procedure :: get_transfer
      procedure :: get_radiator
      procedure :: get_room_modes
   end type modal_floor_type

contains

   !> Keys and allowed ranges of the group `&modal_floor`.
   function get_fields(self) result(fields)
      class(modal_floor_type), intent(in), target :: self
      type(field_type), allocatable :: fields(:)

      fields = get_plate_fields(self%plate, optional_plate=.true.)
      fields = [ &
         text_field('file', self%file, 'file of the modes: frequencies, loss factors, shapes on a grid', &
         is_path=.true.), &
         real_field('source_x', self%source_x, '', 'relative source position along the length; ' &
         //'levels in the room are means over positions', '(0, 1)'), &
         real_field('source_y', self%source_y, '', 'relative source position along the width', '(0, 1)'), &
         real_field('residual_compliance', self%residual_compliance, 'm/N', &
         'static compliance at the source of the modes above those of the file; 0: that of the plate', '[0, 1]'), &
         pack(fields, fields%key == 'thickness' .or. fields%key == 'density' .or. fields%key == 'wave_speed' &
         .or. fields%key == 'stiffness_ratio' .or. fields%key == 'torsion_ratio'), self%get_point_fields()]
   end function get_fields

   !> Checks the file, and that a plate fits its modes.
   subroutine check(self, error)
      class(modal_floor_type), intent(in) :: self
      type(error_type), allocatable, intent(out) :: error
      type(floor_modes_type) :: modes
      type(plate_type) :: plate
      real(wp), allocatable :: square(:)
      real(wp) :: mass, expected, highest

      call get_modes(self, modes, error)
      if (allocated(error) .or. .not. self%plate%thickness > 0.0_wp) return
      plate = get_plate(self, modes)
      ! The integral of m'' w**2 is 1 kg times the squared unit of w: the mass per area follows, exactly where it is uniform.
      square = sum(modes%modes%block(1)%shape(1)%coefficient**2, dim=1)
      mass = 1/get_median(square)
      associate (ratio => mass/get_surface_mass(plate))
         if (ratio > max_mass_ratio .or. ratio < 1/max_mass_ratio) then
            error = input_error('&modal_floor: the modes of '//trim(self%file)//' have a mass per area of ' &
               //to_text(real_digits(mass))//' kg/m2, the plate has '//to_text(real_digits(get_surface_mass(plate))) &
               //' kg/m2; allowed: the same within a factor of '//fixed(max_mass_ratio, 0) &
               //', with shapes for a modal mass of 1 kg or a row modal_mass')
            return
         end if
      end associate
      highest = maxval(modes%omega)/(2*pi)
      ! Mean number of a simply supported plate; with other supports there are fewer below the same frequency.
      associate (wave => sqrt(4*pi*get_mode_density(plate)*highest/(plate%length*plate%width)))
         expected = get_mode_density(plate)*highest - (plate%length + plate%width)*wave/(2*pi)
      end associate
      if (expected > max_count_ratio*size(modes%omega)) error = input_error('&modal_floor: '//trim(self%file)//' has ' &
         //to_text(size(modes%omega))//' modes up to '//fixed(highest, 0)//' Hz, the plate about ' &
         //fixed(expected, 0)//'; allowed: all modes of the floor, and the thickness, density and wave_speed of a plate ' &
         //'like it')
   end subroutine check

   !> A number with three digits.
   pure function real_digits(value) result(rounded)
      real(wp), intent(in) :: value
      real(wp) :: rounded
      real(wp) :: scale

      scale = 10.0_wp**(floor(log10(max(value, tiny(value)))) - 2)
      rounded = nint(value/scale)*scale
   end function real_digits

   !> Median of values.
   pure function get_median(values) result(median)
      real(wp), intent(in) :: values(:)
      real(wp) :: median
      integer :: i

      ! The value that as many others exceed as fall below.
      i = minloc([(abs(count(values < values(i)) - count(values > values(i))), i=1, size(values))], dim=1)
      median = values(i)
   end function get_median

   !> Modes of the file.
   subroutine get_modes(self, modes, error)
      class(modal_floor_type), intent(in) :: self
      type(floor_modes_type), intent(out) :: modes
      !> Set if the file does not hold them.
      type(error_type), allocatable, intent(out) :: error

      if (self%file == '') then
         error = input_error('&modal_floor: file is empty; allowed: the path of a table of modes')
         return
      end if
      call read_sampled_modes(trim(self%file), modes, error)
      if (allocated(error)) error = input_error('&modal_floor: '//error%message)
   end subroutine get_modes

   !> The plate, with sides and losses of the file.
   function get_plate(self, modes) result(plate)
      class(modal_floor_type), intent(in) :: self
      type(floor_modes_type), intent(in) :: modes
      type(plate_type) :: plate

      plate = self%plate
      plate%length = modes%stack%length
      plate%width = modes%stack%width
      plate%loss_factor = 0.0_wp
      plate%known_frequency = modes%omega/(2*pi)
      plate%known_loss = modes%loss_factor
   end function get_plate

   !> Modes of the file, not of a homogeneous plate, and the mobility at the source; valid up to the highest mode.
   subroutine prepare(self, state, error)
      class(modal_floor_type), intent(in) :: self
      type(floor_state_type), intent(out) :: state
      type(error_type), allocatable, intent(out) :: error

      call get_modes(self, state%modes, error)
      if (allocated(error)) return
      state%plate = get_plate(self, state%modes)
      state%has_modal_conductance = .true.
      state%highest_frequency = maxval(state%modes%omega)/(2*pi)
      if (self%plate%thickness > 0.0_wp) then
         state%validity_reason = 'the file has no modes, and the infinite plate takes their place'
      else if (self%residual_compliance > 0.0_wp) then
         state%validity_reason = 'the file has no modes, and the stated compliance takes their place'
      else
         state%validity_reason = 'the file has no modes, and the floor has their mobility only: ' &
            //'state a plate or residual_compliance'
      end if
      associate (source => [self%source_x, self%source_y])
         call new_floor_receiver('modal_floor', state%modes, get_residual_resistance(self, state%modes), source, source, &
            state%receiver, error)
      end associate
   end subroutine prepare

   !> Length and width of the grid of the file.
   subroutine get_sides(self, sides, error)
      class(modal_floor_type), intent(in) :: self
      real(wp), intent(out) :: sides(2)
      type(error_type), allocatable, intent(out) :: error
      type(floor_modes_type) :: modes

      sides = 0.0_wp
      call get_modes(self, modes, error)
      if (.not. allocated(error)) sides = [modes%stack%length, modes%stack%width]
   end subroutine get_sides

   !> Resistance at high frequencies of the infinite plate, or of the residual modes with a stated compliance, N s/m.
   pure function get_residual_resistance(self, modes) result(resistance)
      class(modal_floor_type), intent(in) :: self
      type(floor_modes_type), intent(in) :: modes
      real(wp) :: resistance

      ! Without either, nothing moves beside the modes.
      resistance = sqrt(huge(1.0_wp))
      if (self%residual_compliance > 0.0_wp) then
         ! `new_floor_receiver` lets residual modes of the resistance Z have the compliance 2/(pi Z limit).
         resistance = 2/(pi*self%residual_compliance*modes%sum_limit)
      else if (self%plate%thickness > 0.0_wp) then
         resistance = get_resistance(self%plate)
      end if
   end function get_residual_resistance

   !> Transfer mobility to another point; a point outside the floor is an error.
   subroutine get_transfer(self, state, x, y, transfer, error)
      class(modal_floor_type), intent(in) :: self
      type(floor_state_type), intent(in) :: state
      real(wp), intent(in) :: x, y
      type(receiver_type), intent(out) :: transfer
      type(error_type), allocatable, intent(out) :: error

      associate (modes => state%modes, sides => [state%modes%stack%length, state%modes%stack%width])
         call check_point('modal_floor', sides, x, y, error)
         if (.not. allocated(error)) call new_floor_receiver('modal_floor', modes, get_residual_resistance(self, modes), &
            [self%source_x, self%source_y], [x, y]/sides, transfer, error)
      end associate
   end subroutine get_transfer

   !> Checks that a plate is stated, which replaces the modes above the highest one.
   subroutine check_radiator(self, error)
      class(modal_floor_type), intent(in) :: self
      type(error_type), allocatable, intent(out) :: error
      type(floor_modes_type) :: modes

      if (self%plate%thickness > 0.0_wp) return
      call get_modes(self, modes, error)
      if (.not. allocated(error)) error = input_error('&modal_floor: the level in a room needs the mass of the floor, and ' &
         //'a plate in place of the modes above '//fixed(maxval(modes%omega)/(2*pi), 0)//' Hz; allowed: thickness (above ' &
         //'0), density and wave_speed of a plate like the floor')
   end subroutine check_radiator

   !> The plate, which replaces the modes above the highest one.
   subroutine get_radiator(self, state, frequency, plate, conductance, error)
      class(modal_floor_type), intent(in) :: self
      type(floor_state_type), intent(in) :: state
      real(wp), intent(in) :: frequency(:)
      type(plate_type), intent(out) :: plate
      real(wp), intent(out) :: conductance(:)
      type(error_type), allocatable, intent(out) :: error

      conductance = 0.0_wp
      call self%check_radiator(error)
      if (allocated(error)) return
      plate = state%plate
      conductance = 1/get_resistance(plate)
   end subroutine get_radiator

   !> The modes, whose edges are those of the floor.
   subroutine get_room_modes(self, state, support, plate, modes, error, max_frequency)
      class(modal_floor_type), intent(in) :: self
      type(floor_state_type), intent(in) :: state
      character(len=*), intent(in) :: support
      type(plate_type), intent(out) :: plate
      type(floor_modes_type), intent(out) :: modes
      type(error_type), allocatable, intent(out) :: error
      real(wp), intent(in), optional :: max_frequency

      plate = state%plate
      modes = state%modes
   end subroutine get_room_modes

end module thud_modal_floor
