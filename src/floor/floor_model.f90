!> The abstract floor: options from a namelist group, mobility at the source, and the plate that radiates into the room.
!>
!> A floor `<name>` is a type that extends this one, in the module `thud_<name>_floor` (a name that ends with `_floor` gets
!> no second suffix), and stands in src/case/registry.f90. Its options form the namelist group `&<name>`. The descriptions of
!> arguments in this file hold for every floor.
module thud_floor_model
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type, list_type, name_length
   use thud_floor_modes, only: floor_modes_type
   use thud_kinds, only: wp
   use thud_new_field, only: list_field
   use thud_plate, only: air_type, plate_type
   use thud_receiver, only: receiver_type
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: check_point, floor_model_type, floor_state_type, reason_length, uncoupled_support, unknown_support

   !> Length of the text that says what limits the validity of a floor.
   integer, parameter :: reason_length = 112

   !> Simply supported edges without further supports; of large floors the middle, as far as modes reach
   !> the highest frequency of a rating.
   character(len=*), parameter :: uncoupled_support = 'uncoupled'

   !> Edges of which nothing is known: the force under the source is that of simply supported ones, the level in the room a
   !> mean with that of clamped ones.
   character(len=*), parameter :: unknown_support = 'unknown'

   !> What is computed once of a floor, and handed on.
   type :: floor_state_type
      !> Mobility under the source.
      type(receiver_type) :: receiver
      !> The bearing plate with homogeneous stiffness, and the modes of the floor as it is supported; a floor without modes
      !> has no frequencies.
      type(plate_type) :: plate
      type(floor_modes_type) :: modes
      !> Whether the mean power into the floor follows from its modes, because no homogeneous plate represents it.
      logical :: has_modal_conductance = .false.
      !> Frequency band in which the model of the floor is valid, Hz, and the reason for it, as the end of a message.
      real(wp) :: lowest_frequency = 0.0_wp, highest_frequency = huge(1.0_wp)
      character(len=reason_length) :: validity_reason = ''
   end type floor_state_type

   !> The floor, whose components are its options.
   type, abstract :: floor_model_type
      !> Coordinates along length and width of further points whose velocity is output (rectangular floors), m.
      type(list_type) :: point_x, point_y
      !> Air around the floor: that of the room below (`set_floor_air`).
      type(air_type) :: air
   contains
      procedure :: get_point_fields
      procedure :: check_points
      procedure(get_fields), deferred :: get_fields
      procedure(prepare), deferred :: prepare
      procedure :: check
      procedure :: get_sides
      procedure :: get_transfer
      procedure :: has_radiator
      procedure :: check_radiator
      procedure :: get_radiator
      procedure :: get_room_modes
      procedure :: get_radiating_modes
      procedure :: has_room_modes
      procedure :: get_support
      procedure :: get_improvement
      procedure :: has_subceiling
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

   !> Fields of the points, for rectangular floors: [2].
   function get_point_fields(self) result(fields)
      class(floor_model_type), intent(in), target :: self
      type(field_type), allocatable :: fields(:)

      fields = [ &
         list_field('point_x', self%point_x, 'm', &
         'positions along the length of points whose velocity is computed', '[0, 1000]'), &
         list_field('point_y', self%point_y, 'm', 'positions of these points along the width', '[0, 1000]')]
   end function get_point_fields

   !> Checks that the points lie on the floor.
   subroutine check_points(self, group, error)
      class(floor_model_type), intent(in) :: self
      !> Namelist group, for messages.
      character(len=*), intent(in) :: group
      !> Set if a point lacks a coordinate or does not lie on the floor.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: sides(2)
      integer :: i

      if (self%point_x%count /= self%point_y%count) then
         error = input_error('&'//trim(group)//': point_x has '//to_text(self%point_x%count)//' values and point_y ' &
            //to_text(self%point_y%count)//'; allowed: the same number of both')
      else if (self%point_x%count > 0) then
         call self%get_sides(sides, error)
      end if
      do i = 1, self%point_x%count
         if (.not. allocated(error)) call check_point(group, sides, self%point_x%values(i), &
            self%point_y%values(i), error)
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
      error = input_error('&'//trim(group)//': the point ('//to_text(x)//', '//to_text(y)//') m lies outside; ' &
         //'allowed: 0 to '//to_text(sides(1))//' m and 0 to '//to_text(sides(2))//' m')
   end subroutine check_point

   !> Checks options that depend on each other; by default, none do.
   subroutine check(self, error)
      !> The options, each inside its own range.
      class(floor_model_type), intent(in) :: self
      !> Set if they contradict each other; the message names group, key, value and allowed range.
      type(error_type), allocatable, intent(out) :: error

   end subroutine check

   !> Length and width; floors defined only at the source point return an error.
   subroutine get_sides(self, sides, error)
      class(floor_model_type), intent(in) :: self
      !> Length and width, m: [2].
      real(wp), intent(out) :: sides(2)
      !> Set if the floor has none.
      type(error_type), allocatable, intent(out) :: error

      sides = 0.0_wp
      error = input_error('&floor: name: this floor has no point except the one under the source; allowed: a ' &
         //'rectangular floor')
   end subroutine get_sides

   !> Transfer mobility from the source to another point; floors defined only at the source point return an error.
   subroutine get_transfer(self, state, x, y, transfer, error)
      class(floor_model_type), intent(in) :: self
      !> The floor, prepared.
      type(floor_state_type), intent(in) :: state
      !> Coordinates of the point along length and width, m.
      real(wp), intent(in) :: x, y
      !> The transfer mobility, as poles and residues.
      type(receiver_type), intent(out) :: transfer
      !> Set if the floor has no such point.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: sides(2)

      call self%get_sides(sides, error)
   end subroutine get_transfer

   !> Whether the floor has a plate that radiates into a room below; by default it has.
   pure function has_radiator(self) result(yes)
      class(floor_model_type), intent(in) :: self
      logical :: yes

      yes = .true.
   end function has_radiator

   !> Checks that the options of a floor that has a radiator determine it; by default they do.
   subroutine check_radiator(self, error)
      class(floor_model_type), intent(in) :: self
      !> Set if options are missing.
      type(error_type), allocatable, intent(out) :: error

   end subroutine check_radiator

   !> The plate that radiates into the room below, and its conductance: the power into this plate per mean-square force,
   !> averaged over force positions. Floors without such a plate return an error.
   subroutine get_radiator(self, state, frequency, plate, conductance, error)
      class(floor_model_type), intent(in) :: self
      !> The floor, prepared.
      type(floor_state_type), intent(in) :: state
      !> Frequencies, Hz: [n].
      real(wp), intent(in) :: frequency(:)
      type(plate_type), intent(out) :: plate
      !> The conductance, m/(N s): [n].
      real(wp), intent(out) :: conductance(:)
      !> Set if the floor has no such plate.
      type(error_type), allocatable, intent(out) :: error

      conductance = 0.0_wp
      error = input_error('&floor: name: this floor has no plate that radiates into a room; allowed: one that has')
   end subroutine get_radiator

   !> Modes of the floor with another support than its own; floors without modes return an error, those with modes from a
   !> file their own.
   subroutine get_room_modes(self, state, support, plate, modes, error, max_frequency)
      class(floor_model_type), intent(in) :: self
      !> The floor, prepared.
      type(floor_state_type), intent(in) :: state
      !> Support of the edges, or `uncoupled_support`.
      character(len=*), intent(in) :: support
      !> The plate that radiates.
      type(plate_type), intent(out) :: plate
      type(floor_modes_type), intent(out) :: modes
      !> Set if the floor has no modes, or they cannot be computed.
      type(error_type), allocatable, intent(out) :: error
      !> Frequency up to which modes are wanted, Hz.
      real(wp), intent(in), optional :: max_frequency

      error = input_error('&floor: name: this floor has no modes; allowed: a rectangular floor')
   end subroutine get_room_modes

   !> Modes that give the radiation factor; by default those of the floor.
   subroutine get_radiating_modes(self, state, plate, modes, error)
      class(floor_model_type), intent(in) :: self
      !> The floor, prepared.
      type(floor_state_type), intent(in) :: state
      !> The plate that radiates.
      type(plate_type), intent(out) :: plate
      type(floor_modes_type), intent(out) :: modes
      !> Set if there are none, or they cannot be computed.
      type(error_type), allocatable, intent(out) :: error

      if (allocated(state%modes%omega)) then
         plate = state%plate
         modes = state%modes
      else
         error = input_error('&floor: name: this floor has no modes; allowed: a rectangular floor')
      end if
   end subroutine get_radiating_modes

   !> Whether the modes that radiate are those of the floor; by default they are.
   pure function has_room_modes(self) result(yes)
      class(floor_model_type), intent(in) :: self
      logical :: yes

      yes = .true.
   end function has_room_modes

   !> Support of the edges; empty if it cannot be chosen.
   pure function get_support(self) result(support)
      class(floor_model_type), intent(in) :: self
      character(len=name_length) :: support

      support = ''
   end function get_support

   !> Reduction of the levels in the room by a covering whose improvement is stated, dB; by default none.
   pure function get_improvement(self, n_band) result(improvement)
      class(floor_model_type), intent(in) :: self
      !> Number of one-third-octave bands from 50 Hz on.
      integer, intent(in) :: n_band
      real(wp) :: improvement(n_band)

      improvement = 0.0_wp
   end function get_improvement

   !> Whether a subceiling is a part of the floor; by default not.
   pure function has_subceiling(self) result(yes)
      class(floor_model_type), intent(in) :: self
      logical :: yes

      yes = .false.
   end function has_subceiling

end module thud_floor_model
