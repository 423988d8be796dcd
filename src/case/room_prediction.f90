!> The level in the room below a floor: by the modes of floor and room as far as these are apart, statistical above.
!>
!> Where the support of the edges is unknown, it is the energy mean of the levels with simply supported and with clamped
!> edges: the mean over many dwellings whose edges lie between the two deviates from it by less than 0.5 dB.
module thud_room_prediction
   use thud_band, only: band_type
   use thud_case, only: case_type
   use thud_constants, only: pi
   use thud_error, only: error_type
   use thud_floor_model, only: check_radiator, floor_state_type, get_plate_conductance
   use thud_floor_modes, only: floor_modes_type, get_floor_modes
   use thud_force_exposure, only: get_force_exposure_levels
   use thud_kinds, only: wp
   use thud_modal_radiation, only: get_modal_radiation, get_strike_points, modal_radiation_type
   use thud_modal_room, only: box_type, get_crossover, get_highest_frequency, get_modal_room, modal_room_type, place_standard
   use thud_plate, only: get_plate_radiation, plate_type
   use thud_plate_stack, only: get_simplified, with_clamped_edges
   use thud_room, only: add_ratings, check_below, get_completed_room, get_rating_index, get_reverberation_times, &
      get_room_bands, get_room_level, modal_radiation, positions_of_rating, room_level_type, room_type, &
      use_standard_positions
   use thud_room_uncertainty, only: add_uncertainty, get_probability
   implicit none (type, external)
   private

   public :: get_area, get_box, place, predict_room

   !> Number of even positions of ball and of microphone, and their distance from the walls, m (ISO 16283-2).
   integer, parameter :: n_even = 16
   real(wp), parameter :: even_distance = 0.5_wp

   !> The force on a floor, whatever the support of the edges.
   type :: excitation_type
      !> Force, N: [n_sample], and samples per second, Hz.
      real(wp), allocatable :: force(:)
      real(wp) :: sample_rate = 0.0_wp
      !> Bands from `get_room_bands`: [n_band].
      type(band_type), allocatable :: bands(:)
      !> Force exposure levels, dB: [n_band].
      real(wp), allocatable :: level(:)
   end type excitation_type

contains

   !> Level in the room below, from a force history.
   subroutine predict_room(case, state, force, sample_rate, prediction, error)
      !> The case, with floor and room.
      type(case_type), intent(in) :: case
      !> The floor, prepared.
      type(floor_state_type), intent(in) :: state
      !> Force on the floor, N: [n_sample].
      real(wp), intent(in) :: force(:)
      !> Samples per second, Hz.
      real(wp), intent(in) :: sample_rate
      type(room_level_type), intent(out) :: prediction
      !> Set if a level cannot be computed, or the floor cannot radiate into the room.
      type(error_type), allocatable, intent(out) :: error
      type(floor_modes_type) :: clamped_modes
      type(modal_radiation_type) :: radiation, clamped_radiation
      type(room_level_type) :: clamped
      type(excitation_type) :: excitation
      type(band_type), allocatable :: bands(:)
      integer :: shown

      associate (room => case%room, plate => state%plate)
         call check_radiator(state, error)
         if (.not. allocated(error)) call check_below(plate, room, error)
         if (.not. allocated(error)) call get_room_bands(bands, error)
         if (.not. allocated(error)) call get_radiation(case, state, state%modes, bands, radiation, error)
         if (.not. allocated(error)) call get_excitation(case, bands, force, sample_rate, excitation, error)
         if (allocated(error)) return
         call predict_supported(case, state, excitation, state%modes, radiation, prediction)
         shown = min(get_rating_index(room), 2)
         prediction%edge_level = spread(prediction%rated_level(:, shown), 2, 2)
         if (.not. state%edges_are_known .and. prediction%n_modal > 0) then
            call get_floor_modes(trim(state%group), with_clamped_edges(state%modes%stack), plate, state%air, clamped_modes, &
               error, get_highest_frequency(get_box(room, plate, bands)))
            if (.not. allocated(error)) call get_radiation(case, state, clamped_modes, bands, clamped_radiation, error, &
               radiation)
            if (allocated(error)) return
            call predict_supported(case, state, excitation, clamped_modes, clamped_radiation, clamped)
            ! The modes of clamped edges may be resolved in fewer bands.
            associate (n => clamped%n_modal)
               prediction%edge_level(:n, 2) = clamped%rated_level(:n, shown)
               prediction%rated_level(:n, :) = &
                  10*log10((10**(prediction%rated_level(:n, :)/10) + 10**(clamped%rated_level(:n, :)/10))/2)
            end associate
         end if
         prediction%level = prediction%rated_level(:, shown)
         call add_ratings(prediction)
         call add_uncertainty(state%modes%stack, state%edges_are_known, prediction)
         if (room%required > 0.0_wp) prediction%probability = get_probability(room, prediction)
      end associate
   end subroutine predict_room

   !> A force and its levels.
   subroutine get_excitation(case, bands, force, sample_rate, excitation, error)
      type(case_type), intent(in) :: case
      !> Bands from `get_room_bands`: [n_band].
      type(band_type), intent(in) :: bands(:)
      !> Force on the floor, N: [n_sample].
      real(wp), intent(in) :: force(:)
      !> Samples per second, Hz.
      real(wp), intent(in) :: sample_rate
      type(excitation_type), intent(out) :: excitation
      !> Set if a level cannot be computed.
      type(error_type), allocatable, intent(out) :: error

      excitation%force = force
      excitation%sample_rate = sample_rate
      excitation%bands = bands
      allocate (excitation%level(size(bands)))
      call get_force_exposure_levels(force, sample_rate, bands, trim(case%level_method), excitation%level, error)
   end subroutine get_excitation

   !> Level in the room below a floor with known edges. Walls, a ceiling and a covering change modal levels as much as
   !> statistical ones.
   subroutine predict_supported(case, state, excitation, modes, radiation, prediction)
      type(case_type), intent(in) :: case
      !> The floor, prepared.
      type(floor_state_type), intent(in) :: state
      type(excitation_type), intent(in) :: excitation
      type(floor_modes_type), intent(in) :: modes
      !> Its radiation by these modes.
      type(modal_radiation_type), intent(in) :: radiation
      type(room_level_type), intent(out) :: prediction
      type(modal_radiation_type) :: used
      type(room_level_type) :: bare
      type(modal_room_type) :: modal
      type(box_type) :: box
      integer :: i

      associate (room => case%room, plate => state%plate, bands => excitation%bands, level => excitation%level)
         used = radiation
         if (room%radiation /= modal_radiation) then
            used%radiation_factor = get_plate_radiation(plate, room%air, bands%center)
            used%upper_factor = used%radiation_factor
         end if
         if (.not. state%has_modal_conductance) used%conductance = get_plate_conductance(state, bands%center)
         call get_room_level(plate, used, room, bands, level - state%improvement, prediction)
         box = get_box(room, plate, bands)
         prediction%crossover = get_crossover(box)
         ! A floor whose mobility is measured has the modes of its plate alone.
         if (state%is_measured) used%conductance = radiation%conductance
         call get_room_level(plate, used, get_bare_room(room), bands, level, bare)
      end associate
      do i = 1, 2
         if (i == 1 .or. case%room%positions == positions_of_rating) then
            call place(use_standard_positions(case%room, i), box)
            call get_modal_room(modes, box, excitation%force, excitation%sample_rate, .false., .false., modal)
         end if
         associate (n => modal%n_band)
            prediction%n_modal = n
            prediction%rated_level(:n, i) = modal%mean + prediction%level(:n) - bare%level(:n)
         end associate
      end do
   end subroutine predict_supported

   !> Radiation of a floor in bands. Those that its modes do not reach, because coupled functions resolve few waves, have
   !> that of the simply supported floor without further supports: its waves are so short that these matter little. The
   !> middle of the floor represents it if not all of it is resolved.
   subroutine get_radiation(case, state, modes, bands, radiation, error, known)
      type(case_type), intent(in) :: case
      !> The floor, prepared.
      type(floor_state_type), intent(in) :: state
      !> Its modes as it is supported.
      type(floor_modes_type), intent(in) :: modes
      !> The bands: [n_band].
      type(band_type), intent(in) :: bands(:)
      type(modal_radiation_type), intent(out) :: radiation
      !> Set if the modes cannot be computed.
      type(error_type), allocatable, intent(out) :: error
      !> Radiation for the bands that the modes do not reach (default: that of the simply supported floor).
      type(modal_radiation_type), intent(in), optional :: known
      type(floor_modes_type) :: simple_modes
      type(modal_radiation_type) :: beyond
      real(wp) :: area(4)
      integer :: n

      n = count(bands%upper <= modes%limit/(2*pi))
      area = get_area(case%room, state%plate)
      call get_modal_radiation(modes, state%plate, case%room%air, bands(:n), area, radiation)
      if (n == size(bands)) return
      if (present(known)) then
         beyond = known
      else
         simple_modes = modes
         ! Beyond the modes of a file the plate takes their place.
         if (.not. modes%known_limit < huge(1.0_wp)) call get_floor_modes(trim(state%group), get_simplified(modes%stack), &
            state%plate, state%air, simple_modes, error)
         if (allocated(error)) return
         ! Of a floor whose middle represents it, as much of the middle as the room covers; losses keep energy near the
         ! strike.
         associate (stack => simple_modes%stack)
            if (stack%length*stack%width < product([state%plate%length, state%plate%width])*(1 - 1.0e-9_wp)) area = &
               [0.0_wp, min(area(2) - area(1), stack%length), 0.0_wp, min(area(4) - area(3), stack%width)]
         end associate
         call get_modal_radiation(simple_modes, state%plate, case%room%air, bands, area, beyond)
         if (n > 0) beyond%energy_beyond = max(beyond%energy_beyond, radiation%energy_beyond(n))
      end if
      radiation%radiation_factor = [radiation%radiation_factor, beyond%radiation_factor(n + 1:)]
      radiation%upper_factor = [radiation%upper_factor, beyond%upper_factor(n + 1:)]
      radiation%energy_beyond = [radiation%energy_beyond, beyond%energy_beyond(n + 1:)]
      radiation%conductance = [radiation%conductance, beyond%conductance(n + 1:)]
   end subroutine get_radiation

   !> Part of a floor above a room: its ends along length and width, m.
   pure function get_area(room, plate) result(area)
      type(room_type), intent(in) :: room
      type(plate_type), intent(in) :: plate
      real(wp) :: area(4)

      associate (completed => get_completed_room(room, plate))
         area = [room%corner_x, room%corner_x + completed%length, room%corner_y, room%corner_y + completed%width]
      end associate
   end function get_area

   !> The room as a box.
   pure function get_box(room, plate, bands) result(box)
      type(room_type), intent(in) :: room
      type(plate_type), intent(in) :: plate
      !> Bands of a prediction: [n_band].
      type(band_type), intent(in) :: bands(:)
      type(box_type) :: box

      associate (completed => get_completed_room(room, plate))
         box = box_type(sides=[completed%length, completed%width, completed%height], corner=[room%corner_x, room%corner_y], &
            air=room%air, bands=bands, reverberation_time=get_reverberation_times(room, size(bands)))
      end associate
   end function get_box

   !> The room without walls and ceiling.
   elemental function get_bare_room(room) result(bare)
      type(room_type), intent(in) :: room
      type(room_type) :: bare

      bare = room
      bare%ceiling%mass = 0.0_wp
      bare%walls%lengths%count = 0
   end function get_bare_room

   !> Places ball and microphone.
   subroutine place(are_standard, box)
      !> At the positions of KS F 2810-2, not at even ones.
      logical, intent(in) :: are_standard
      type(box_type), intent(inout) :: box
      real(wp), allocatable :: even(:, :)
      real(wp) :: distance(3)
      integer :: i

      if (are_standard) then
         call place_standard(box)
         return
      end if
      call get_strike_points(2*n_even, even)
      distance = min(even_distance, box%sides/4)
      ! Every other point is one of the ball; heights are in another order than the other coordinates.
      box%ball = spread(distance(:2), 2, n_even) + spread(box%sides(:2) - 2*distance(:2), 2, n_even)*even(:, 1::2)
      box%microphone = reshape([(distance(:2) + (box%sides(:2) - 2*distance(:2))*even(:, 2*i), &
         distance(3) + (box%sides(3) - 2*distance(3))*modulo(0.5_wp + 7*(i - 0.5_wp)/n_even, 1.0_wp), i=1, n_even)], &
         [3, n_even])
   end subroutine place

end module thud_room_prediction
