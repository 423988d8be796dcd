!> A floor of rectangular plates with the source on the upper plate: supports, floating plate, covering, modes and mobility.
module thud_rectangular_floor
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type, key_length, list_type, name_length
   use thud_floor_model, only: check_point, floor_model_type, floor_state_type, reason_length, uncoupled_support, &
      unknown_support
   use thud_floor_modes, only: floor_modes_type, get_floor_modes, get_mode_limit, new_floor_receiver
   use thud_kinds, only: wp
   use thud_new_field, only: choice_field, list_field, real_field
   use thud_plate, only: get_resistance, get_thin_limit, plate_type
   use thud_plate_stack, only: edge_type, get_resolved_part, orthotropic_type, plate_stack_type, rigid_support
   use thud_receiver, only: receiver_type
   use thud_screed, only: get_screed_fields, get_screed_layer, get_screed_plate, new_orthotropic, screed_type
   use thud_subceiling, only: get_cavity_limit, get_spaced_positions, get_subceiling_fields, get_subceiling_layer, &
      get_subceiling_plate, subceiling_type
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: base_floor_type, rectangular_floor_type

   !> Supports of the edges.
   character(len=*), parameter :: supports(*) = [character(len=7) :: unknown_support, 'simple', 'clamped', 'free', 'elastic']

   !> Minimum distance of the source from a rigid line, m: the radius of the contact.
   real(wp), parameter :: min_distance = 0.05_wp

   !> Minimum distance of two rigid lines, m: less than any wall or beam is thick.
   real(wp), parameter :: min_line_distance = 0.01_wp

   !> Thickness of the thinnest floating plate or subceiling, m: a metal sheet.
   real(wp), parameter :: min_sheet = 0.0005_wp

   !> Frequency that uncoupled functions resolve, Hz: above the highest band of a rating.
   real(wp), parameter :: resolved_limit = 800.0_wp

   !> Numbers of octaves and one-third-octave bands of a rating.
   integer, parameter :: octave_bands = 4, third_bands = 12

   !> A floor without supports, floating plate and subceiling.
   type :: base_floor_type
      !> Namelist group of the floor.
      character(len=key_length) :: group = ''
      !> The plate with homogeneous stiffness.
      type(plate_type) :: plate
      !> Stiffnesses, masses and ribs.
      type(orthotropic_type) :: stiffness
      !> Whether the homogeneous plate represents the mean power into the floor.
      logical :: is_homogeneous = .true.
      !> Frequency up to which the model of the plate is valid, Hz, and the reason, as the end of a message.
      real(wp) :: highest_frequency = huge(1.0_wp)
      character(len=reason_length) :: validity_reason = ''
   end type base_floor_type

   !> The floor; all plates have the same length and width.
   type, abstract, extends(floor_model_type) :: rectangular_floor_type
      !> Relative position of the source along length and width.
      real(wp) :: source_x = 0.5_wp, source_y = 0.5_wp
      !> Support of the edges.
      character(len=name_length) :: support = unknown_support
      !> Springs along the edges x = 0, x = length, y = 0 and y = width, or one value for all: stiffness against deflection
      !> per length, N/m2, and against rotation, N.
      type(list_type) :: support_stiffness, support_rotation
      !> Positions of further supports along the length (walls or beams across it) and along the width, m.
      type(list_type) :: line_x, line_y
      !> Floating plate; no thickness: none.
      type(screed_type) :: screed
      !> Subceiling, which radiates into the room; no thickness: none.
      type(subceiling_type) :: subceiling
      !> Stiffness of a covering under the source, N/m (0: none), and its loss factor.
      real(wp) :: covering_stiffness = 0.0_wp, covering_loss_factor = 0.2_wp
      !> Reduction of the heavy impact sound by a covering, dB: one for each octave or one-third-octave band; empty: none.
      type(list_type) :: covering_improvement
   contains
      procedure :: get_source_fields
      procedure :: get_build_up_fields
      procedure :: check
      procedure :: check_build_up
      procedure :: prepare
      procedure :: get_sides
      procedure :: get_transfer
      procedure :: get_source
      procedure :: get_radiator
      procedure :: get_room_modes
      procedure :: get_support
      procedure :: get_improvement
      procedure :: has_subceiling
      procedure(get_base), deferred :: get_base
   end type rectangular_floor_type

   abstract interface
      !> The floor without supports, floating plate and subceiling.
      function get_base(self) result(base)
         import :: base_floor_type, rectangular_floor_type
         implicit none (type, external)
         class(rectangular_floor_type), intent(in) :: self
         type(base_floor_type) :: base
      end function get_base
   end interface

contains

   !> Fields of the position of the source: [2].
   function get_source_fields(self) result(fields)
      class(rectangular_floor_type), intent(in), target :: self
      type(field_type) :: fields(2)

      fields = [ &
         real_field('source_x', self%source_x, '', 'relative source position along the length; ' &
         //'levels in the room are means over positions', '(0, 1)'), &
         real_field('source_y', self%source_y, '', 'relative source position along the width', '(0, 1)')]
   end function get_source_fields

   !> Fields of supports, floating plate, subceiling and covering.
   function get_build_up_fields(self, on_joists) result(fields)
      class(rectangular_floor_type), intent(in), target :: self
      !> The subceiling hangs on joists (default: on the plate).
      logical, intent(in), optional :: on_joists
      type(field_type), allocatable :: fields(:)
      logical :: has_joists

      has_joists = .false.
      if (present(on_joists)) has_joists = on_joists

      fields = [ &
         choice_field('support', self%support, 'support of the edges', supports), &
         list_field('support_stiffness', self%support_stiffness, 'N/m2', 'stiffness of elastic edges against ' &
         //'deflection per length: 1 value, or 4 (x at 0 and length, y at 0 and width)', '[0, 1e14]'), &
         list_field('support_rotation', self%support_rotation, 'N', &
         'stiffness of elastic edges against rotation per length: 1 or 4 values', '[0, 1e14]'), &
         list_field('line_x', self%line_x, 'm', 'positions along the length of walls or beams on which the floor rests', &
         '(0, 100)'), &
         list_field('line_y', self%line_y, 'm', 'positions along the width of walls or beams on which the floor rests', &
         '(0, 100)'), &
         get_screed_fields(self%screed), &
         get_subceiling_fields(self%subceiling, has_joists), &
         real_field('covering_stiffness', self%covering_stiffness, 'N/m', &
         'stiffness of a covering under the source; 0: none', '[0, 1e12]'), &
         real_field('covering_loss_factor', self%covering_loss_factor, '', 'loss factor of the covering at 50 Hz', &
         '[0.01, 2]'), &
         list_field('covering_improvement', self%covering_improvement, 'dB', 'measured reduction of heavy impact sound ' &
         //'by a covering, in octaves 63 to 500 Hz or one-third octaves 50 to 630 Hz', '[-30, 60]')]
   end function get_build_up_fields

   !> Checks supports and positions.
   subroutine check(self, error)
      class(rectangular_floor_type), intent(in) :: self
      type(error_type), allocatable, intent(out) :: error

      call self%check_build_up(error)
   end subroutine check

   !> Checks what all rectangular floors have: supports and positions.
   subroutine check_build_up(self, error)
      class(rectangular_floor_type), intent(in) :: self
      type(error_type), allocatable, intent(out) :: error
      type(base_floor_type) :: base

      base = self%get_base()
      call check_edges(self%support_stiffness, 'support_stiffness')
      call check_edges(self%support_rotation, 'support_rotation')
      call check_positions(self%line_x, 'line_x', base%plate%length)
      call check_positions(self%line_y, 'line_y', base%plate%width)
      call check_distances(self%line_x, 'line_x')
      call check_distances(self%line_y, 'line_y')
      associate (source => self%get_source())
         call check_source(self%line_x, 'line_x', source(1)*base%plate%length)
         call check_source(self%line_y, 'line_y', source(2)*base%plate%width)
      end associate
      if (allocated(error)) return
      if (all(self%covering_improvement%count /= [0, octave_bands, third_bands])) then
         error = input_error('&'//trim(base%group)//': covering_improvement has ' &
            //to_text(self%covering_improvement%count)//' values; allowed: 4, one for each octave from 63 to 500 Hz, ' &
            //'or 12, one for each one-third-octave band')
      else if (self%covering_improvement%count > 0 .and. self%covering_stiffness > 0.0_wp) then
         error = input_error('&'//trim(base%group)//': covering_stiffness and covering_improvement describe the same ' &
            //'covering twice; allowed: one of them')
      else if (self%support == 'elastic' .and. self%support_stiffness%count == 0 &
         .and. self%support_rotation%count == 0) then
         error = input_error('&'//trim(base%group)//': support = elastic without support_stiffness and support_rotation; ' &
            //'allowed: at least one of them')
      else if (self%support /= 'elastic' .and. self%support_stiffness%count + self%support_rotation%count > 0) then
         error = input_error('&'//trim(base%group)//': support_stiffness and support_rotation with support = ' &
            //trim(self%support)//'; allowed: with support = elastic')
      else if (is_loose() .and. self%line_x%count + self%line_y%count == 0) then
         error = input_error('&'//trim(base%group)//': support = '//trim(self%support) &
            //' without any stiffness needs supports at line_x or line_y; allowed: at least one')
      else if (self%screed%thickness > 0.0_wp .and. self%screed%thickness < min_sheet) then
         error = input_error('&'//trim(base%group)//': screed_thickness = '//to_text(self%screed%thickness) &
            //' m; allowed: 0, or 0.0005 to 0.5 m')
      else if (self%has_subceiling() .and. self%subceiling%thickness < min_sheet) then
         error = input_error('&'//trim(base%group)//': subceiling_thickness = '//to_text(self%subceiling%thickness) &
            //' m; allowed: 0, or 0.0005 to 0.2 m')
      end if
   contains

      !> Checks the number of values of an elastic edge.
      subroutine check_edges(list, key)
         type(list_type), intent(in) :: list
         character(len=*), intent(in) :: key

         if (allocated(error) .or. any(list%count == [0, 1, 4])) return
         error = input_error('&'//trim(base%group)//': '//key//' has '//to_text(list%count)//' values; allowed: 1 or 4')
      end subroutine check_edges

      !> Whether no edge is held against deflection.
      function is_loose() result(yes)
         logical :: yes
         type(edge_type) :: edge(4)

         edge = get_edges(self, self%support)
         yes = all(edge%deflection <= 0.0_wp)
      end function is_loose

      !> Checks that no two lines coincide, which would support the floor once, but count twice.
      subroutine check_distances(list, key)
         type(list_type), intent(in) :: list
         character(len=*), intent(in) :: key
         integer :: i

         if (allocated(error)) return
         do i = 2, list%count
            associate (line => list%values(i))
               if (all(abs(list%values(:i - 1) - line) >= min_line_distance)) cycle
               error = input_error('&'//trim(base%group)//': '//key//' = '//to_text(line)//' m is stated twice, or within ' &
                  //to_text(1000*min_line_distance)//' mm of another value; allowed: each line once')
               return
            end associate
         end do
      end subroutine check_distances

      !> Checks that the source does not lie on a rigid line.
      subroutine check_source(list, key, source)
         type(list_type), intent(in) :: list
         character(len=*), intent(in) :: key
         !> Position of the source across the lines, m.
         real(wp), intent(in) :: source

         if (allocated(error) .or. all(abs(list%values(:list%count) - source) >= min_distance)) return
         error = input_error('&'//trim(base%group)//': the source, at '//to_text(source)//' m, lies on a support of '//key &
            //'; allowed: sources at least '//to_text(min_distance)//' m from it')
      end subroutine check_source

      !> Checks that positions lie between two edges.
      subroutine check_positions(list, key, side)
         type(list_type), intent(in) :: list
         character(len=*), intent(in) :: key
         !> Distance of the edges, m.
         real(wp), intent(in) :: side

         if (allocated(error)) return
         if (any(list%values(:list%count) >= side)) error = input_error('&'//trim(base%group)//': '//key//' = ' &
            //to_text(maxval(list%values(:list%count)))//' m lies outside the floor; allowed: below '//to_text(side)//' m')
      end subroutine check_positions
   end subroutine check_build_up

   !> Modes of the floor as it is supported, and its mobility at the source.
   subroutine prepare(self, state, error)
      class(rectangular_floor_type), intent(in) :: self
      type(floor_state_type), intent(out) :: state
      type(error_type), allocatable, intent(out) :: error
      type(base_floor_type) :: base
      type(plate_stack_type) :: stack

      base = self%get_base()
      stack = get_stack(self, base, self%support)
      state%plate = base%plate
      call get_floor_modes(trim(base%group), stack, base%plate, self%air, state%modes, error)
      if (allocated(error)) return
      state%has_modal_conductance = .not. base%is_homogeneous
      call add_validity(self, base, stack, state)
      associate (source => self%get_source())
         call get_mobility_at(self, base, state, source, source, state%receiver, error)
      end associate
      if (.not. allocated(error) .and. self%covering_stiffness > 0.0_wp) call add_covering(self, state%receiver)
   end subroutine prepare

   !> Adds the mobility s/(k + c s) of a covering in series; its dashpot c has the loss factor at 50 Hz.
   subroutine add_covering(self, receiver)
      class(rectangular_floor_type), intent(in) :: self
      type(receiver_type), intent(inout) :: receiver
      real(wp), parameter :: omega = 100*acos(-1.0_wp)

      associate (k => self%covering_stiffness, c => self%covering_stiffness*self%covering_loss_factor/omega)
         receiver%direct = receiver%direct + 1/c
         receiver%pole = [receiver%pole, cmplx(-k/c, 0.0_wp, wp)]
         receiver%residue = [receiver%residue, cmplx(-k/c**2, 0.0_wp, wp)]
      end associate
   end subroutine add_covering

   !> Length and width.
   subroutine get_sides(self, sides, error)
      class(rectangular_floor_type), intent(in) :: self
      real(wp), intent(out) :: sides(2)
      type(error_type), allocatable, intent(out) :: error
      type(base_floor_type) :: base

      base = self%get_base()
      sides = [base%plate%length, base%plate%width]
   end subroutine get_sides

   !> Transfer mobility to another point; a point outside the floor is an error.
   subroutine get_transfer(self, state, x, y, transfer, error)
      class(rectangular_floor_type), intent(in) :: self
      type(floor_state_type), intent(in) :: state
      real(wp), intent(in) :: x, y
      type(receiver_type), intent(out) :: transfer
      type(error_type), allocatable, intent(out) :: error
      type(base_floor_type) :: base

      base = self%get_base()
      associate (sides => [base%plate%length, base%plate%width])
         call check_point(base%group, sides, x, y, error)
         if (.not. allocated(error)) call get_mobility_at(self, base, state, self%get_source(), &
            [x, y]/sides, transfer, error)
      end associate
   end subroutine get_transfer

   !> Transfer mobility from a source to a point of the upper plate, without covering.
   subroutine get_mobility_at(self, base, state, source, point, receiver, error)
      class(rectangular_floor_type), intent(in) :: self
      type(base_floor_type), intent(in) :: base
      !> The floor, with its modes.
      type(floor_state_type), intent(in) :: state
      !> Positions of source and point, as fractions of length and width: [2].
      real(wp), intent(in) :: source(2), point(2)
      !> The transfer mobility, as poles and residues.
      type(receiver_type), intent(out) :: receiver
      !> Set if the losses are too high.
      type(error_type), allocatable, intent(out) :: error
      type(plate_type) :: plate

      plate = base%plate
      if (self%screed%thickness > 0.0_wp) plate = get_screed_plate(self%screed, plate)
      call new_floor_receiver(trim(base%group), state%modes, get_resistance(plate), source, point, receiver, error)
   end subroutine get_mobility_at

   !> Relative position of the source.
   function get_source(self) result(source)
      class(rectangular_floor_type), intent(in) :: self
      real(wp) :: source(2)

      source = [self%source_x, self%source_y]
   end function get_source

   !> The plates above each other.
   function get_stack(self, floor, support) result(stack)
      class(rectangular_floor_type), intent(in) :: self
      !> The floor without supports, floating plate and subceiling.
      type(base_floor_type), intent(in) :: floor
      !> Support of the edges, or `uncoupled_support`.
      character(len=*), intent(in) :: support
      type(plate_stack_type) :: stack
      logical :: is_uncoupled
      type(base_floor_type) :: base

      is_uncoupled = support == uncoupled_support
      base = floor
      associate (lower => base%stiffness)
         lower%edge = get_edges(self, support)
         if (.not. is_uncoupled) then
            lower%line_x = self%line_x%values(:self%line_x%count)
            lower%line_y = self%line_y%values(:self%line_y%count)
         end if
      end associate
      associate (plate => base%plate)
         stack%length = plate%length
         stack%width = plate%width
         if (self%screed%thickness > 0.0_wp) then
            stack%plate = [new_orthotropic(get_screed_plate(self%screed, plate)), base%stiffness]
            stack%layer = [get_screed_layer(self%screed)]
         else
            stack%plate = [base%stiffness]
            allocate (stack%layer(0))
         end if
         stack%bearing = size(stack%plate)
         if (self%has_subceiling()) then
            stack%plate = [stack%plate, new_orthotropic(get_subceiling_plate(self%subceiling, plate))]
            stack%layer = [stack%layer, get_subceiling_layer(self%subceiling, self%air, &
               get_channels(self, base))]
         end if
         stack%radiator = size(stack%plate)
      end associate
      if (is_uncoupled) stack = get_resolved_part(stack, resolved_limit)
   end function get_stack

   !> Whether a subceiling radiates into the room.
   pure function has_subceiling(self) result(yes)
      class(rectangular_floor_type), intent(in) :: self
      logical :: yes

      yes = self%subceiling%thickness > 0.0_wp
   end function has_subceiling

   !> Positions of the lines along the length that hold the subceiling: those of the joists, or as stated, m: [n_line].
   pure function get_channels(self, base) result(position)
      class(rectangular_floor_type), intent(in) :: self
      type(base_floor_type), intent(in) :: base
      real(wp), allocatable :: position(:)

      if (allocated(base%stiffness%ribs)) then
         position = base%stiffness%ribs%position
      else
         position = get_spaced_positions(base%plate%width, self%subceiling%channel_spacing)
      end if
   end function get_channels

   !> Modes of the floor with another support of its edges.
   subroutine get_room_modes(self, state, support, plate, modes, error, max_frequency)
      class(rectangular_floor_type), intent(in) :: self
      type(floor_state_type), intent(in) :: state
      character(len=*), intent(in) :: support
      type(plate_type), intent(out) :: plate
      type(floor_modes_type), intent(out) :: modes
      type(error_type), allocatable, intent(out) :: error
      real(wp), intent(in), optional :: max_frequency
      type(base_floor_type) :: base

      base = self%get_base()
      plate = base%plate
      call get_floor_modes(trim(base%group), get_stack(self, base, support), plate, self%air, modes, error, &
         max_frequency)
   end subroutine get_room_modes

   !> Support of the edges.
   pure function get_support(self) result(support)
      class(rectangular_floor_type), intent(in) :: self
      character(len=name_length) :: support

      support = self%support
   end function get_support

   !> Reduction of the levels in the room by a covering, dB: [n_band].
   pure function get_improvement(self, n_band) result(improvement)
      class(rectangular_floor_type), intent(in) :: self
      integer, intent(in) :: n_band
      real(wp) :: improvement(n_band)
      integer :: i

      improvement = 0.0_wp
      associate (stated => self%covering_improvement)
         if (stated%count > 0) improvement = [(stated%values(1 + (i - 1)*stated%count/n_band), i=1, n_band)]
      end associate
   end function get_improvement

   !> Supports of the edges: [4].
   pure function get_edges(self, support) result(edge)
      class(rectangular_floor_type), intent(in) :: self
      !> One of `supports`, or `uncoupled_support`.
      character(len=*), intent(in) :: support
      type(edge_type) :: edge(4)

      select case (support)
       case (unknown_support, 'simple', uncoupled_support)
         edge = edge_type(rigid_support, 0.0_wp)
       case ('clamped')
         edge = edge_type(rigid_support, rigid_support)
       case ('free')
         edge = edge_type(0.0_wp, 0.0_wp)
       case default
         edge%deflection = get_four(self%support_stiffness, rigid_support)
         edge%rotation = get_four(self%support_rotation, 0.0_wp)
      end select
   end function get_edges

   !> Values of four edges.
   pure function get_four(list, default) result(values)
      !> No, one or four values.
      type(list_type), intent(in) :: list
      !> Value of all edges if the list is empty.
      real(wp), intent(in) :: default
      real(wp) :: values(4)

      values = default
      if (list%count == 1) values = list%values(1)
      if (list%count == 4) values = list%values(:4)
   end function get_four

   !> The plate, and its conductance if it were infinite.
   subroutine get_radiator(self, state, frequency, plate, conductance, error)
      class(rectangular_floor_type), intent(in) :: self
      type(floor_state_type), intent(in) :: state
      real(wp), intent(in) :: frequency(:)
      type(plate_type), intent(out) :: plate
      real(wp), intent(out) :: conductance(:)
      type(error_type), allocatable, intent(out) :: error
      type(base_floor_type) :: base

      base = self%get_base()
      plate = base%plate
      conductance = 1/get_resistance(plate)
   end subroutine get_radiator

   !> Adds the frequency up to which the model is valid: that of the plate, the modes, the subceiling or its cavity.
   subroutine add_validity(self, base, stack, state)
      class(rectangular_floor_type), intent(in) :: self
      type(base_floor_type), intent(in) :: base
      !> The plates above each other.
      type(plate_stack_type), intent(in) :: stack
      type(floor_state_type), intent(inout) :: state

      state%highest_frequency = base%highest_frequency
      state%validity_reason = base%validity_reason
      associate (modes => get_mode_limit(stack))
         if (modes < state%highest_frequency) then
            state%highest_frequency = modes
            state%validity_reason = 'the modes of the floor are not resolved, and the mean mobility of the construction ' &
               //'takes their place'
         end if
      end associate
      if (.not. self%has_subceiling()) return
      associate (cavity => get_cavity_limit(self%subceiling, self%air), &
         thin => get_thin_limit(get_subceiling_plate(self%subceiling, base%plate)))
         if (min(cavity, thin) >= state%highest_frequency) return
         state%highest_frequency = min(cavity, thin)
         state%validity_reason = 'the cavity above the subceiling is deeper than a quarter of a wavelength, and no mere ' &
            //'stiffness'
         if (thin < cavity) state%validity_reason = &
            'bending waves are shorter than six thicknesses of the subceiling, and it is not thin'
      end associate
   end subroutine add_validity

end module thud_rectangular_floor
