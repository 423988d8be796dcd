!> A floor given by its modes in a file: measured ones, or those of another program.
module thud_modal_floor
   use thud_ascending, only: get_ascending_order
   use thud_constants, only: pi
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type, name_length, new_field
   use thud_floor_model, only: floor_model_type, floor_state_type
   use thud_floor_modes, only: floor_modes_type, new_floor_receiver
   use thud_kinds, only: wp
   use thud_plate, only: get_mode_density, get_plate_fields, get_resistance, get_surface_mass, plate_type
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
      !> Static compliance at the source of the modes above those of the file, m/N; 0: that of the plate.
      real(wp) :: residual_compliance = 0.0_wp
      !> Homogeneous plate of the same mass and mean stiffness; no thickness: none. The file states sides and losses.
      type(plate_type) :: plate = plate_type(thickness=0.0_wp)
   contains
      procedure :: get_fields
      procedure :: check
      procedure :: prepare
   end type modal_floor_type

contains

   !> Keys and allowed ranges of the group `&modal_floor`.
   function get_fields(self) result(fields)
      class(modal_floor_type), intent(in), target :: self
      type(field_type), allocatable :: fields(:)

      fields = get_plate_fields(self%plate, .true.)
      fields = [ &
         new_field('file', self%file, '', 'file of the modes: frequencies, loss factors, shapes on a grid', &
         trait='path'), &
         self%get_source_fields(), &
         new_field('residual_compliance', self%residual_compliance, 'm/N', &
         'static compliance at the source of the modes above those of the file; 0: that of the plate', '[0, 1]'), &
         pack(fields, fields%key == 'thickness' .or. fields%key == 'density' .or. fields%key == 'wave_speed' &
         .or. fields%key == 'stiffness_ratio' .or. fields%key == 'torsion_ratio'), self%get_point_fields()]
   end function get_fields

   !> Checks the file, and that a plate fits its modes and is stated for a room.
   subroutine check(self, has_room, error)
      class(modal_floor_type), intent(in) :: self
      logical, intent(in) :: has_room
      type(error_type), allocatable, intent(out) :: error
      type(floor_modes_type) :: modes
      type(plate_type) :: plate
      real(wp), allocatable :: square(:)
      real(wp) :: mass, expected, highest

      call get_modes(self, modes, plate, error)
      if (.not. allocated(error)) call self%check_points('modal_floor', [plate%length, plate%width], error)
      if (allocated(error)) return
      highest = maxval(modes%omega)/(2*pi)
      if (.not. plate%thickness > 0.0_wp) then
         if (has_room) error = input_error('the level in a room needs the mass of the floor, and a plate in place of the ' &
            //'modes above '//fixed(highest, 0)//' Hz; allowed: thickness (above 0), density and wave_speed of a plate ' &
            //'like the floor', 'modal_floor')
         return
      end if
      ! The integral of m'' w**2 is 1 kg times the squared unit of w: the mass per area follows, exactly where it is uniform.
      square = sum(modes%modes%block(1)%shape(1)%coefficient**2, dim=1)
      square = square(get_ascending_order(square))
      mass = 1/square((size(square) + 1)/2)
      ! Mean number of a simply supported plate; with other supports there are fewer below the same frequency.
      associate (wave => sqrt(4*pi*get_mode_density(plate)*highest/(plate%length*plate%width)))
         expected = get_mode_density(plate)*highest - (plate%length + plate%width)*wave/(2*pi)
      end associate
      if (max(mass/get_surface_mass(plate), get_surface_mass(plate)/mass) > max_mass_ratio) then
         error = input_error('the modes of '//trim(self%file)//' have a mass per area of '//fixed(mass, 1)//' kg/m2, the ' &
            //'plate has '//fixed(get_surface_mass(plate), 1)//' kg/m2; allowed: the same within a factor of ' &
            //fixed(max_mass_ratio, 0)//', with shapes for a modal mass of 1 kg or a row modal_mass', 'modal_floor')
      else if (expected > max_count_ratio*size(modes%omega)) then
         error = input_error(trim(self%file)//' has '//to_text(size(modes%omega))//' modes up to '//fixed(highest, 0) &
            //' Hz, the plate about '//fixed(expected, 0)//'; allowed: all modes of the floor, and the thickness, density ' &
            //'and wave_speed of a plate like it', 'modal_floor')
      end if
   end subroutine check

   !> Modes of the file, and the plate with its sides and losses.
   subroutine get_modes(self, modes, plate, error)
      class(modal_floor_type), intent(in) :: self
      type(floor_modes_type), intent(out) :: modes
      type(plate_type), intent(out) :: plate
      !> Set if the file does not hold them.
      type(error_type), allocatable, intent(out) :: error

      if (self%file == '') then
         error = input_error('is empty; allowed: the path of a table of modes', 'modal_floor', 'file')
         return
      end if
      call read_sampled_modes(trim(self%file), modes, error)
      if (allocated(error)) then
         error = input_error(error%message, 'modal_floor')
         return
      end if
      plate = self%plate
      plate%length = modes%stack%length
      plate%width = modes%stack%width
      plate%loss_factor = 0.0_wp
      plate%known_frequency = modes%omega/(2*pi)
      plate%known_loss = modes%loss_factor
   end subroutine get_modes

   !> Modes of the file, not of a homogeneous plate, and the mobility at the source; valid up to the highest mode.
   subroutine prepare(self, state, error)
      class(modal_floor_type), intent(in) :: self
      type(floor_state_type), intent(out) :: state
      type(error_type), allocatable, intent(out) :: error

      state%group = 'modal_floor'
      call get_modes(self, state%modes, state%plate, error)
      if (allocated(error)) return
      state%source = [self%source_x, self%source_y]
      state%air = self%air
      state%has_modal_conductance = .true.
      state%highest_frequency = maxval(state%modes%omega)/(2*pi)
      if (self%plate%thickness > 0.0_wp) then
         state%resistance = get_resistance(self%plate)
         state%validity_reason = 'the file has no modes, and the infinite plate takes their place'
      else if (self%residual_compliance > 0.0_wp) then
         state%validity_reason = 'the file has no modes, and the stated compliance takes their place'
      else
         ! Nothing moves beside the modes.
         state%resistance = sqrt(huge(1.0_wp))
         state%validity_reason = 'the file has no modes, and the floor has their mobility only: ' &
            //'state a plate or residual_compliance'
      end if
      ! `new_floor_receiver` lets residual modes of the resistance Z have the compliance 2/(pi Z limit).
      if (self%residual_compliance > 0.0_wp) state%resistance = 2/(pi*self%residual_compliance*state%modes%sum_limit)
      call new_floor_receiver('modal_floor', state%modes, state%resistance, state%source, state%source, state%receiver, &
         error)
   end subroutine prepare

end module thud_modal_floor
