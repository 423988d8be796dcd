!> The abstract floor: options from a namelist group, and what is prepared once from them: the mobility at the source, the
!> modes, and the plate that radiates into the room.
!>
!> A floor `<name>` is a type that extends this one, in the module `thud_<name>_floor` (a name that ends with `_floor` gets
!> no second suffix), and stands in src/case/registry.f90. Its options form the namelist group `&<name>`. The descriptions of
!> arguments in this file hold for every floor.
module thud_floor_model
   use thud_band, only: band_type
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type, key_length, list_type, new_field
   use thud_floor_modes, only: floor_modes_type, new_floor_receiver
   use thud_injected_energy, only: get_mean_conductances
   use thud_kinds, only: wp
   use thud_plate, only: air_type, get_resistance, plate_type
   use thud_receiver, only: receiver_type
   use thud_screed, only: get_lower_conductance, screed_type
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: check_radiator, floor_model_type, floor_state_type, get_plate_conductance, get_transfer, has_own_modes

   !> Length of the text that says what limits the validity of a floor.
   integer, parameter :: reason_length = 112

   !> Number of one-third-octave bands of a rating.
   integer, parameter, public :: third_bands = 12

   !> What is computed once of a floor, and handed on.
   type :: floor_state_type
      !> Namelist group, for messages.
      character(len=key_length) :: group = ''
      !> Mobility under the source.
      type(receiver_type) :: receiver
      !> Relative position of the source along length and width.
      real(wp) :: source(2) = 0.5_wp
      !> Resistance of the infinite floor there, N s/m.
      real(wp) :: resistance = 0.0_wp
      !> Air around the floor.
      type(air_type) :: air
      !> The bearing plate with homogeneous stiffness, of which losses and radiation above the modes are; the ribs of joists
      !> and the layers are in the stack of `modes`, of which force, energy and radiation in the modal range are. No
      !> thickness: nothing radiates into a room.
      type(plate_type) :: plate = plate_type(thickness=0.0_wp)
      !> The floating plate through whose layer the mean power reaches this plate; no thickness: none.
      type(screed_type) :: screed
      !> Modes as the floor is supported; a floor without modes has no frequencies.
      type(floor_modes_type) :: modes
      !> The mean power into the floor follows from its modes, because no homogeneous plate represents it.
      logical :: has_modal_conductance = .false.
      !> The mobility is measured at one point; the modes are those of the plate alone.
      logical :: is_measured = .false.
      !> Otherwise the force under the source is that of simply supported edges, the level in the room a mean with that of
      !> clamped ones.
      logical :: edges_are_known = .true.
      !> Reduction of the levels in the room by a covering whose improvement is stated, dB.
      real(wp) :: improvement(third_bands) = 0.0_wp
      !> Frequency band in which the model of the floor is valid, Hz, and the reason for it, as the end of a message.
      real(wp) :: lowest_frequency = 0.0_wp, highest_frequency = huge(1.0_wp)
      character(len=reason_length) :: validity_reason = ''
   end type floor_state_type

   !> The floor, whose components are its options.
   type, abstract :: floor_model_type
      !> Relative position of the source along length and width (floors with sides).
      real(wp) :: source_x = 0.5_wp, source_y = 0.5_wp
      !> Coordinates along length and width of further points whose velocity is output (floors with sides), m.
      type(list_type) :: point_x, point_y
      !> Air around the floor: that of the room below (`set_floor_air`).
      type(air_type) :: air
   contains
      procedure(get_fields), deferred :: get_fields
      procedure(prepare), deferred :: prepare
      procedure :: get_source_fields
      procedure :: get_point_fields
      procedure :: check
      procedure :: check_points
   end type floor_model_type

   abstract interface
      !> Fields of the options: each connects a namelist key to a component.
      function get_fields(self) result(fields)
         import :: field_type, floor_model_type
         implicit none (type, external)
         !> The options that the fields read and set.
         class(floor_model_type), intent(in), target :: self
         !> The fields: [n_field].
         type(field_type), allocatable :: fields(:)
      end function get_fields

      !> Computes what is handed on.
      subroutine prepare(self, state, error)
         import :: error_type, floor_model_type, floor_state_type
         implicit none (type, external)
         !> The options, checked.
         class(floor_model_type), intent(in) :: self
         type(floor_state_type), intent(out) :: state
         !> Set if mobility or modes cannot be computed.
         type(error_type), allocatable, intent(out) :: error
      end subroutine prepare
   end interface

contains

   !> Fields of the position of the source: [2].
   function get_source_fields(self) result(fields)
      class(floor_model_type), intent(in), target :: self
      type(field_type) :: fields(2)

      fields = [ &
         new_field('source_x', self%source_x, '', 'relative source position along the length; ' &
         //'levels in the room are means over positions', '(0, 1)'), &
         new_field('source_y', self%source_y, '', 'relative source position along the width', '(0, 1)')]
   end function get_source_fields

   !> Fields of the points: [2].
   function get_point_fields(self) result(fields)
      class(floor_model_type), intent(in), target :: self
      type(field_type) :: fields(2)

      fields = [ &
         new_field('point_x', self%point_x, 'm', &
         'positions along the length of points whose velocity is computed', '[0, 1000]'), &
         new_field('point_y', self%point_y, 'm', 'positions of these points along the width', '[0, 1000]')]
   end function get_point_fields

   !> Checks options that depend on each other; by default, none do.
   subroutine check(self, has_room, error)
      !> The options, each inside its own range.
      class(floor_model_type), intent(in) :: self
      !> The floor must radiate into a room.
      logical, intent(in) :: has_room
      !> Set if they contradict each other; the message names group, key, value and allowed range.
      type(error_type), allocatable, intent(out) :: error

   end subroutine check

   !> Checks that the points lie on the floor.
   subroutine check_points(self, group, sides, error)
      class(floor_model_type), intent(in) :: self
      !> Namelist group, for messages.
      character(len=*), intent(in) :: group
      !> Length and width of the floor, m: [2].
      real(wp), intent(in) :: sides(2)
      !> Set if a point lacks a coordinate or does not lie on the floor.
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      if (self%point_x%count /= self%point_y%count) error = input_error('has '//to_text(self%point_x%count)//' values and ' &
         //'point_y '//to_text(self%point_y%count)//'; allowed: the same number of both', group, 'point_x')
      do i = 1, self%point_x%count
         if (.not. allocated(error)) call check_point(group, sides, self%point_x%values(i), self%point_y%values(i), error)
      end do
   end subroutine check_points

   !> Checks that a point lies on a floor.
   subroutine check_point(group, sides, x, y, error)
      !> Namelist group, for messages.
      character(len=*), intent(in) :: group
      !> Length and width of the floor, m: [2].
      real(wp), intent(in) :: sides(2)
      !> Coordinates of the point along length and width, m.
      real(wp), intent(in) :: x, y
      !> Set if it lies outside.
      type(error_type), allocatable, intent(out) :: error

      if (min(x, y) >= 0.0_wp .and. x <= sides(1) .and. y <= sides(2)) return
      error = input_error('the point ('//to_text(x)//', '//to_text(y)//') m lies outside; allowed: 0 to ' &
         //to_text(sides(1))//' m and 0 to '//to_text(sides(2))//' m', group)
   end subroutine check_point

   !> Whether the floor has modes that describe its motion under the source.
   pure function has_own_modes(state) result(yes)
      type(floor_state_type), intent(in) :: state
      logical :: yes

      yes = allocated(state%modes%omega) .and. .not. state%is_measured
   end function has_own_modes

   !> Transfer mobility from the source to another point, without a covering under the source.
   subroutine get_transfer(state, x, y, transfer, error)
      type(floor_state_type), intent(in) :: state
      !> Coordinates of the point along length and width, m.
      real(wp), intent(in) :: x, y
      !> The transfer mobility, as poles and residues.
      type(receiver_type), intent(out) :: transfer
      !> Set if the floor has no such point.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: sides(2)

      if (.not. has_own_modes(state)) then
         error = input_error('this floor has no point except the one under the source; allowed: a rectangular floor', &
            'floor')
         return
      end if
      sides = [state%modes%stack%length, state%modes%stack%width]
      call check_point(trim(state%group), sides, x, y, error)
      if (.not. allocated(error)) call new_floor_receiver(trim(state%group), state%modes, state%resistance, state%source, &
         [x, y]/sides, transfer, error)
   end subroutine get_transfer

   !> Checks that a plate radiates into a room.
   subroutine check_radiator(state, error)
      type(floor_state_type), intent(in) :: state
      !> Set if the floor has no such plate.
      type(error_type), allocatable, intent(out) :: error

      if (.not. state%plate%thickness > 0.0_wp) error = input_error('this floor has no plate that radiates into a room; ' &
         //'allowed: one that has', 'floor')
   end subroutine check_radiator

   !> Conductance of the plate that radiates, the power into it per mean-square force: that of the infinite plate, or the
   !> power through the layer of a floating plate if both are infinite, as means over positions; or, within a measurement,
   !> the mean real part of the mobility in one-third octaves around the frequencies.
   pure function get_plate_conductance(state, frequency) result(conductance)
      type(floor_state_type), intent(in) :: state
      !> Frequencies, Hz: [n].
      real(wp), intent(in) :: frequency(:)
      !> The conductance, m/(N s): [n].
      real(wp) :: conductance(size(frequency))
      integer :: i

      conductance = 1/get_resistance(state%plate)
      if (state%screed%thickness > 0.0_wp) conductance = get_lower_conductance(state%screed, state%plate, state%air, &
         frequency)
      if (state%is_measured) conductance = merge(conductance, get_mean_conductances(state%receiver, &
         [(band_type(lower=frequency(i)*10**(-0.05_wp), upper=frequency(i)*10**0.05_wp), i=1, size(frequency))]), &
         frequency < state%lowest_frequency .or. frequency > state%highest_frequency)
   end function get_plate_conductance

end module thud_floor_model
