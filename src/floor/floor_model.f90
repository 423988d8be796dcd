!> The abstract floor: options from a namelist group, mobility at the source, and the plate that radiates into the room.
!>
!> A floor `<name>` is a type `<name>_floor_type` that extends this one, in the module `thud_<name>_floor` (a name that ends
!> with `_floor` gets no second suffix). The list `floor_models` in src/CMakeLists.txt registers it. Its options form the
!> namelist group `&<name>`. The descriptions of arguments in this file hold for every floor.
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

   public :: floor_model_type, reason_length, uncoupled_support

   !> Length of the text that says what limits the validity of a floor.
   integer, parameter :: reason_length = 112

   !> Simply supported edges without further supports and rows across ribs; of large floors the middle, as far as modes reach
   !> the highest frequency of a rating.
   character(len=*), parameter :: uncoupled_support = 'uncoupled'

   !> The floor, whose components are its options: procedures name it `options`.
   type, abstract :: floor_model_type
      !> Coordinates along length and width of further points whose velocity is output (rectangular floors), m.
      type(list_type) :: point_x, point_y
      !> Air around the floor: that of the room below (`set_floor_air`).
      type(air_type) :: air
   contains
      procedure, pass(options) :: get_point_fields
      procedure, pass(options) :: check_points
      procedure(get_fields), deferred, pass(options) :: get_fields
      procedure(get_receiver), deferred, pass(options) :: get_receiver
      procedure, pass(options) :: check
      procedure, pass(options) :: get_transfer
      procedure, pass(options) :: has_radiator
      procedure, pass(options) :: get_radiator
      procedure, pass(options) :: get_validity
      procedure, pass(options) :: get_room_modes
      procedure, pass(options) :: get_radiating_modes
      procedure, pass(options) :: has_room_modes
      procedure, pass(options) :: get_support
      procedure, pass(options) :: get_improvement
      procedure, pass(options) :: has_modal_conductance
      procedure, pass(options) :: get_bridge_conductance
      procedure, pass(options) :: has_subceiling
   end type floor_model_type

   abstract interface
      !> Fields of the options: each connects a namelist key to a component.
      function get_fields(options) result(fields)
         import :: field_type, floor_model_type
         implicit none (type, external)
         !> The options that the fields read and set.
         class(floor_model_type), intent(in), target :: options
         !> The fields: [n_field].
         type(field_type), allocatable :: fields(:)
      end function get_fields

      !> Mobility of the floor at the source.
      subroutine get_receiver(options, receiver, error)
         import :: error_type, floor_model_type, receiver_type
         implicit none (type, external)
         !> The options, checked.
         class(floor_model_type), intent(in) :: options
         !> The mobility, as poles and residues.
         type(receiver_type), intent(out) :: receiver
         !> Set if the receiver cannot be made.
         type(error_type), allocatable, intent(out) :: error
      end subroutine get_receiver
   end interface

contains

   !> Fields of the points, for rectangular floors: [2].
   function get_point_fields(options) result(fields)
      class(floor_model_type), intent(in), target :: options
      type(field_type), allocatable :: fields(:)

      fields = [ &
         list_field('point_x', options%point_x, 'm', &
         'positions along the length of points whose velocity is computed', '[0, 1000]'), &
         list_field('point_y', options%point_y, 'm', 'positions of these points along the width', '[0, 1000]')]
   end function get_point_fields

   !> Checks that the points lie on the floor.
   subroutine check_points(options, group, error)
      class(floor_model_type), intent(in) :: options
      !> Namelist group, for messages.
      character(len=*), intent(in) :: group
      !> Set if a point lacks a coordinate or does not lie on the floor.
      type(error_type), allocatable, intent(out) :: error
      type(receiver_type) :: transfer
      integer :: i

      if (options%point_x%count /= options%point_y%count) then
         error = input_error('&'//trim(group)//': point_x has '//to_text(options%point_x%count)//' values and point_y ' &
            //to_text(options%point_y%count)//'; allowed: the same number of both')
         return
      end if
      do i = 1, options%point_x%count
         call options%get_transfer(options%point_x%values(i), options%point_y%values(i), transfer, error)
         if (allocated(error)) return
      end do
   end subroutine check_points

   !> Checks options that depend on each other; by default, none do.
   subroutine check(options, error)
      !> The options, each inside its own range.
      class(floor_model_type), intent(in) :: options
      !> Set if they contradict each other; the message names group, key, value and allowed range.
      type(error_type), allocatable, intent(out) :: error

   end subroutine check

   !> Transfer mobility from the source to another point; floors defined only at the source point return an error.
   subroutine get_transfer(options, x, y, transfer, error)
      class(floor_model_type), intent(in) :: options
      !> Coordinates of the point along length and width, m.
      real(wp), intent(in) :: x, y
      !> The transfer mobility, as poles and residues.
      type(receiver_type), intent(out) :: transfer
      !> Set if the floor has no such point.
      type(error_type), allocatable, intent(out) :: error

      error = input_error('&floor: name: this floor has no point except the one under the source; allowed: a ' &
         //'rectangular floor')
   end subroutine get_transfer

   !> Whether the floor has a plate that radiates into a room below; by default it has.
   pure function has_radiator(options) result(yes)
      class(floor_model_type), intent(in) :: options
      logical :: yes

      yes = .true.
   end function has_radiator

   !> The plate that radiates into the room below, and its conductance: the power into this plate per mean-square force,
   !> averaged over force positions. Floors without such a plate return an error.
   subroutine get_radiator(options, frequency, plate, conductance, error)
      class(floor_model_type), intent(in) :: options
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

   !> Frequency band in which the model of the floor is valid; by default all frequencies.
   subroutine get_validity(options, lowest, highest, reason)
      class(floor_model_type), intent(in) :: options
      !> Lowest and highest valid frequency, Hz.
      real(wp), intent(out) :: lowest, highest
      !> Reason for the limits, as the end of a message.
      character(len=reason_length), intent(out) :: reason

      lowest = 0.0_wp
      highest = huge(highest)
      reason = ''
   end subroutine get_validity

   !> Modes of the floor, with its own support or another one; floors without modes return an error.
   subroutine get_room_modes(options, support, plate, modes, error, max_frequency)
      class(floor_model_type), intent(in) :: options
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
   subroutine get_radiating_modes(options, plate, modes, error)
      class(floor_model_type), intent(in) :: options
      !> The plate that radiates.
      type(plate_type), intent(out) :: plate
      type(floor_modes_type), intent(out) :: modes
      !> Set if there are none, or they cannot be computed.
      type(error_type), allocatable, intent(out) :: error

      call options%get_room_modes(options%get_support(), plate, modes, error)
   end subroutine get_radiating_modes

   !> Whether the sound in the room below can be predicted by the modes of the floor; by default, if it radiates.
   pure function has_room_modes(options) result(yes)
      class(floor_model_type), intent(in) :: options
      logical :: yes

      yes = .true.
   end function has_room_modes

   !> Support of the edges; empty if it cannot be chosen.
   pure function get_support(options) result(support)
      class(floor_model_type), intent(in) :: options
      character(len=name_length) :: support

      support = ''
   end function get_support

   !> Reduction of the levels in the room by a covering whose improvement is stated, dB; by default none.
   pure function get_improvement(options, n_band) result(improvement)
      class(floor_model_type), intent(in) :: options
      !> Number of one-third-octave bands from 50 Hz on.
      integer, intent(in) :: n_band
      real(wp) :: improvement(n_band)

      improvement = 0.0_wp
   end function get_improvement

   !> Whether the mean power into the floor follows from its modes, because no homogeneous plate represents it.
   function has_modal_conductance(options) result(yes)
      class(floor_model_type), intent(in) :: options
      logical :: yes

      yes = .false.
   end function has_modal_conductance

   !> Power into the bearing plate through the bridges of a floating plate per mean-square force, m/(N s): [n]; by default
   !> none.
   function get_bridge_conductance(options, frequency) result(conductance)
      class(floor_model_type), intent(in) :: options
      !> Frequencies, Hz: [n].
      real(wp), intent(in) :: frequency(:)
      real(wp) :: conductance(size(frequency))

      conductance = 0.0_wp
   end function get_bridge_conductance

   !> Whether a subceiling is a part of the floor; by default not.
   pure function has_subceiling(options) result(yes)
      class(floor_model_type), intent(in) :: options
      logical :: yes

      yes = .false.
   end function has_subceiling

end module thud_floor_model
