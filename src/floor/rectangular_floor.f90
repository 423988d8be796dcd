!> A floor of rectangular plates with the source on the upper plate: supports, floating plate, covering, modes and mobility.
module thud_rectangular_floor
   use thud_constants, only: pi
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type, list_type, name_length, new_field, only_with
   use thud_floor_model, only: floor_model_type, floor_state_type, third_bands
   use thud_floor_modes, only: get_floor_modes, mode_limit, new_floor_receiver
   use thud_kinds, only: wp
   use thud_plate, only: get_resistance, get_thin_limit
   use thud_plate_stack, only: edge_type, get_spaced_positions, layer_type, new_orthotropic, orthotropic_type, &
      plate_stack_type, rigid_support
   use thud_receiver, only: receiver_type
   use thud_screed, only: get_screed_fields, get_screed_plate, screed_type
   use thud_subceiling, only: get_subceiling_fields, get_subceiling_plate, subceiling_type
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: rectangular_floor_type

   !> Edges of which nothing is known, see `floor_state_type`.
   character(len=*), parameter :: unknown_support = 'unknown'

   !> Supports of the edges.
   character(len=*), parameter :: supports(*) = [character(len=7) :: unknown_support, 'simple', 'clamped', 'free', 'elastic']

   !> Minimum distance of the source from a rigid line, m: the radius of the contact.
   real(wp), parameter :: min_distance = 0.05_wp

   !> Minimum distance of two rigid lines, m: less than any wall or beam is thick. Closer ones would support the floor once,
   !> but count twice.
   real(wp), parameter :: min_line_distance = 0.01_wp

   !> Thickness of the thinnest floating plate or subceiling, m: a metal sheet.
   real(wp), parameter :: min_sheet = 0.0005_wp

   !> Number of octaves of a rating.
   integer, parameter :: octave_bands = 4

   !> The floor; all plates have the same length and width.
   type, abstract, extends(floor_model_type) :: rectangular_floor_type
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
      procedure :: get_build_up_fields
      procedure :: check
      procedure :: prepare
      procedure(get_bearing), deferred :: get_bearing
   end type rectangular_floor_type

   abstract interface
      !> The plate that bears, without supports: its group, the plate with homogeneous stiffness, up to which frequency and
      !> why the model of the plate is valid, and the source, if it is moved.
      subroutine get_bearing(self, state, bearing)
         import :: floor_state_type, orthotropic_type, rectangular_floor_type
         implicit none (type, external)
         class(rectangular_floor_type), intent(in) :: self
         !> With the source as stated.
         type(floor_state_type), intent(inout) :: state
         !> Stiffnesses, masses and ribs.
         type(orthotropic_type), intent(out) :: bearing
      end subroutine get_bearing
   end interface

contains

   !> Fields of supports, floating plate, subceiling and covering.
   function get_build_up_fields(self, on_joists) result(fields)
      class(rectangular_floor_type), intent(in), target :: self
      !> The subceiling hangs on joists, not on the plate.
      logical, intent(in) :: on_joists
      type(field_type), allocatable :: fields(:)

      fields = [ &
         new_field('support', self%support, '', 'support of the edges', choices=supports), &
         only_with('support', [ &
         new_field('support_stiffness', self%support_stiffness, 'N/m2', 'stiffness of elastic edges against ' &
         //'deflection per length: 1 value, or 4 (x at 0 and length, y at 0 and width)', '[0, 1e14]'), &
         new_field('support_rotation', self%support_rotation, 'N', &
         'stiffness of elastic edges against rotation per length: 1 or 4 values', '[0, 1e14]')], ['elastic']), &
         new_field('line_x', self%line_x, 'm', 'positions along the length of walls or beams on which the floor rests', &
         '(0, 100)'), &
         new_field('line_y', self%line_y, 'm', 'positions along the width of walls or beams on which the floor rests', &
         '(0, 100)'), &
         get_screed_fields(self%screed), &
         get_subceiling_fields(self%subceiling, on_joists), &
         new_field('covering_stiffness', self%covering_stiffness, 'N/m', &
         'stiffness of a covering under the source; 0: none', '[0, 1e12]'), &
         only_with('covering_stiffness', [new_field('covering_loss_factor', self%covering_loss_factor, '', &
         'loss factor of the covering at 50 Hz', '[0.01, 2]')]), &
         new_field('covering_improvement', self%covering_improvement, 'dB', 'measured reduction of heavy impact sound ' &
         //'by a covering, in octaves 63 to 500 Hz or one-third octaves 50 to 630 Hz', '[-30, 60]')]
   end function get_build_up_fields

   !> Checks plate, supports, positions and covering.
   subroutine check(self, has_room, error)
      class(rectangular_floor_type), intent(in) :: self
      logical, intent(in) :: has_room
      type(error_type), allocatable, intent(out) :: error
      type(floor_state_type) :: state
      type(orthotropic_type) :: bearing
      type(edge_type) :: edge(4)
      character(len=:), allocatable :: group

      state%source = [self%source_x, self%source_y]
      call self%get_bearing(state, bearing)
      group = trim(state%group)
      edge = get_edges(self)
      if (.not. min(bearing%along, bearing%across) > 0.0_wp) then
         error = input_error('= 0 Pa leaves a single layer without stiffness across it; allowed: a modulus above 0, or ' &
            //'more layers', group, 'cross_modulus')
         return
      end if
      call check_springs(self%support_stiffness, 'support_stiffness')
      call check_springs(self%support_rotation, 'support_rotation')
      associate (plate => state%plate, source => state%source)
         call check_lines(self%line_x, 'line_x', plate%length, source(1)*plate%length)
         call check_lines(self%line_y, 'line_y', plate%width, source(2)*plate%width)
      end associate
      if (allocated(error)) return
      if (all(self%covering_improvement%count /= [0, octave_bands, third_bands])) then
         error = input_error('has '//to_text(self%covering_improvement%count)//' values; allowed: 4, one for each octave ' &
            //'from 63 to 500 Hz, or 12, one for each one-third-octave band', group, 'covering_improvement')
      else if (self%covering_improvement%count > 0 .and. self%covering_stiffness > 0.0_wp) then
         error = input_error('and covering_improvement describe the same covering twice; allowed: one of them', group, &
            'covering_stiffness')
      else if ((self%support == 'elastic') .neqv. (self%support_stiffness%count + self%support_rotation%count > 0)) then
         error = input_error('= '//trim(self%support)//' with '//to_text(self%support_stiffness%count)//' values of ' &
            //'support_stiffness and '//to_text(self%support_rotation%count)//' of support_rotation; allowed: some with ' &
            //'support = elastic, none with others', group, 'support')
      else if (all(edge%deflection <= 0.0_wp) .and. self%line_x%count + self%line_y%count == 0) then
         error = input_error('= '//trim(self%support)//' without any stiffness needs supports at line_x or line_y; ' &
            //'allowed: at least one', group, 'support')
      end if
      call check_sheet(self%screed%thickness, 'screed_thickness', '0.5')
      call check_sheet(self%subceiling%thickness, 'subceiling_thickness', '0.2')
      if (.not. allocated(error)) call self%check_points(trim(state%group), [state%plate%length, state%plate%width], error)
   contains

      !> Checks the number of values of an elastic edge.
      subroutine check_springs(list, key)
         type(list_type), intent(in) :: list
         character(len=*), intent(in) :: key

         if (allocated(error) .or. any(list%count == [0, 1, 4])) return
         error = input_error('has '//to_text(list%count)//' values; allowed: 1 or 4', group, key)
      end subroutine check_springs

      !> Checks that lines lie between two edges, apart from each other and from the source.
      subroutine check_lines(list, key, side, source)
         type(list_type), intent(in) :: list
         character(len=*), intent(in) :: key
         !> Distance of the edges, and position of the source across the lines, m.
         real(wp), intent(in) :: side, source
         integer :: i

         do i = 1, list%count
            if (allocated(error)) return
            associate (line => list%values(i))
               if (line >= side) then
                  error = input_error('= '//to_text(line)//' m lies outside the floor; allowed: below '//to_text(side) &
                     //' m', group, key)
               else if (any(abs(list%values(:i - 1) - line) < min_line_distance)) then
                  error = input_error('= '//to_text(line)//' m is stated twice, or within ' &
                     //to_text(1000*min_line_distance)//' mm of another value; allowed: each line once', group, key)
               else if (abs(line - source) < min_distance) then
                  error = input_error('the source, at '//to_text(source)//' m, lies on a support of '//key//'; allowed: ' &
                     //'sources at least '//to_text(min_distance)//' m from it', group)
               end if
            end associate
         end do
      end subroutine check_lines

      !> Checks that a plate above or below the floor is no thinner than a sheet.
      subroutine check_sheet(thickness, key, highest)
         !> Thickness, m.
         real(wp), intent(in) :: thickness
         !> Its key, and the upper end of its range.
         character(len=*), intent(in) :: key, highest

         if (allocated(error) .or. .not. thickness > 0.0_wp .or. thickness >= min_sheet) return
         error = input_error('= '//to_text(thickness)//' m; allowed: 0, or 0.0005 to '//highest//' m', group, key)
      end subroutine check_sheet
   end subroutine check

   !> Modes of the floor as it is supported, and its mobility at the source.
   subroutine prepare(self, state, error)
      class(rectangular_floor_type), intent(in) :: self
      type(floor_state_type), intent(out) :: state
      type(error_type), allocatable, intent(out) :: error
      type(orthotropic_type) :: bearing
      type(plate_stack_type) :: stack
      integer :: i

      state%source = [self%source_x, self%source_y]
      call self%get_bearing(state, bearing)
      stack = get_stack(self, state, bearing)
      state%air = self%air
      state%edges_are_known = self%support /= unknown_support
      state%resistance = get_resistance(state%plate)
      if (self%screed%thickness > 0.0_wp) then
         state%resistance = get_resistance(get_screed_plate(self%screed, state%plate))
         if (.not. state%has_modal_conductance) state%screed = self%screed
      end if
      associate (stated => self%covering_improvement)
         if (stated%count > 0) state%improvement = &
            [(stated%values(1 + (i - 1)*stated%count/third_bands), i=1, third_bands)]
      end associate
      call get_floor_modes(trim(state%group), stack, state%plate, self%air, state%modes, error)
      if (allocated(error)) return
      call add_validity(self, state)
      call new_floor_receiver(trim(state%group), state%modes, state%resistance, state%source, &
         state%source, state%receiver, error)
      if (.not. allocated(error) .and. self%covering_stiffness > 0.0_wp) call add_covering(self, state%receiver)
   end subroutine prepare

   !> Adds the mobility s/(k + c s) of a covering in series; its dashpot c has the loss factor at 50 Hz.
   subroutine add_covering(self, receiver)
      class(rectangular_floor_type), intent(in) :: self
      type(receiver_type), intent(inout) :: receiver
      real(wp), parameter :: omega = 100*pi

      associate (k => self%covering_stiffness, c => self%covering_stiffness*self%covering_loss_factor/omega)
         receiver%direct = receiver%direct + 1/c
         receiver%pole = [receiver%pole, cmplx(-k/c, 0.0_wp, wp)]
         receiver%residue = [receiver%residue, cmplx(-k/c**2, 0.0_wp, wp)]
      end associate
   end subroutine add_covering

   !> The plates above each other.
   function get_stack(self, state, bearing) result(stack)
      class(rectangular_floor_type), intent(in) :: self
      type(floor_state_type), intent(in) :: state
      !> The bearing plate without supports.
      type(orthotropic_type), intent(in) :: bearing
      type(plate_stack_type) :: stack
      type(orthotropic_type) :: lower
      type(layer_type) :: cavity

      lower = bearing
      lower%edge = get_edges(self)
      lower%line_x = self%line_x%values(:self%line_x%count)
      lower%line_y = self%line_y%values(:self%line_y%count)
      associate (plate => state%plate, screed => self%screed, subceiling => self%subceiling, air => self%air)
         stack%length = plate%length
         stack%width = plate%width
         if (screed%thickness > 0.0_wp) then
            stack%plate = [new_orthotropic(get_screed_plate(screed, plate)), lower]
            stack%layer = [layer_type(screed%layer_stiffness, screed%layer_loss_factor)]
         else
            stack%plate = [lower]
            allocate (stack%layer(0))
         end if
         stack%bearing = size(stack%plate)
         if (subceiling%thickness > 0.0_wp) then
            stack%plate = [stack%plate, new_orthotropic(get_subceiling_plate(subceiling, plate))]
            ! The stiffness of the air, which does not move sideways, and of the joists or lines that hold the subceiling.
            cavity = layer_type(air%density*air%sound_speed**2/subceiling%cavity_depth, subceiling%cavity_loss_factor)
            if (subceiling%channel_stiffness > 0.0_wp) then
               cavity%line_y = get_spaced_positions(plate%width, subceiling%channel_spacing, 0.0_wp)
               if (allocated(bearing%ribs)) cavity%line_y = bearing%ribs%position
               cavity%line_stiffness = subceiling%channel_stiffness
               cavity%line_loss_factor = subceiling%channel_loss_factor
            end if
            stack%layer = [stack%layer, cavity]
         end if
         stack%radiator = size(stack%plate)
      end associate
   end function get_stack

   !> Supports of the edges: [4].
   pure function get_edges(self) result(edge)
      class(rectangular_floor_type), intent(in) :: self
      type(edge_type) :: edge(4)
      integer, parameter :: number(4) = [1, 2, 3, 4]

      select case (self%support)
       case (unknown_support, 'simple')
         edge = edge_type(rigid_support, 0.0_wp)
       case ('clamped')
         edge = edge_type(rigid_support, rigid_support)
       case ('free')
         edge = edge_type(0.0_wp, 0.0_wp)
       case default
         associate (deflection => self%support_stiffness, rotation => self%support_rotation)
            edge%deflection = merge(deflection%values(min(number, max(deflection%count, 1))), rigid_support, &
               deflection%count > 0)
            edge%rotation = merge(rotation%values(min(number, max(rotation%count, 1))), 0.0_wp, rotation%count > 0)
         end associate
      end select
   end function get_edges

   !> Adds the frequency up to which the model is valid: that of the plate, the modes, the subceiling or its cavity.
   subroutine add_validity(self, state)
      class(rectangular_floor_type), intent(in) :: self
      !> The state with its modes.
      type(floor_state_type), intent(inout) :: state

      if (state%modes%limit < 0.99_wp*2*pi*mode_limit) call limit(state%modes%limit/(2*pi), 'the modes of the floor are ' &
         //'not resolved, and the mean mobility of the construction takes their place')
      if (.not. self%subceiling%thickness > 0.0_wp) return
      call limit(self%air%sound_speed/(4*self%subceiling%cavity_depth), 'the cavity above the subceiling is deeper than a ' &
         //'quarter of a wavelength, and no mere stiffness')
      call limit(get_thin_limit(get_subceiling_plate(self%subceiling, state%plate)), &
         'bending waves are shorter than six thicknesses of the subceiling, and it is not thin')
   contains

      !> Lowers the limit.
      subroutine limit(frequency, reason)
         !> Frequency, Hz.
         real(wp), intent(in) :: frequency
         !> The reason, as the end of a message.
         character(len=*), intent(in) :: reason

         if (frequency >= state%highest_frequency) return
         state%highest_frequency = frequency
         state%validity_reason = reason
      end subroutine limit
   end subroutine add_validity

end module thud_rectangular_floor
