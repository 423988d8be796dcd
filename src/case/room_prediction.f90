!> Predictions of the level in the room below a floor: a statistical one and one by the modes of floor and room, and an
!> interval of the rating.
module thud_room_prediction
   use thud_band, only: band_type, octave_count
   use thud_case, only: case_type, get_floor_number
   use thud_constants, only: pi
   use thud_error, only: error_type
   use thud_floor_model, only: floor_model_type, floor_state_type, uncoupled_support
   use thud_floor_modes, only: floor_modes_type
   use thud_force_exposure, only: get_force_exposure_levels
   use thud_kinds, only: wp
   use thud_modal_radiation, only: get_modal_radiation, get_strike_points, modal_radiation_type
   use thud_modal_room, only: box_type, get_crossover, get_highest_frequency, get_modal_room, &
      get_standard_positions, modal_room_type, n_standard
   use thud_plate, only: get_plate_radiation, plate_type
   use thud_rating, only: rating_names
   use thud_room, only: check_below, get_completed_room, get_ratings, get_reverberation_times, get_room_bands, &
      get_room_level, modal_radiation, room_level_type, room_type, standard_positions
   use thud_source_limits, only: get_source_limits, source_limits_type
   implicit none (type, external)
   private

   public :: contribution_names, get_area, get_box, get_positions, predict_room

   !> Contributions to the interval of a rating.
   character(len=*), parameter :: contribution_names(*) = [character(len=18) :: 'source', 'edges', 'reverberation_time', &
      'positions', 'model']

   !> Uncertainty of a reverberation time, as a ratio; an estimate for times that are not measured.
   real(wp), parameter :: time_ratio = 1.2_wp

   !> Number of even positions of ball and of microphone, and their distance from the walls, m (ISO 16283-2).
   integer, parameter :: n_even = 16
   real(wp), parameter :: even_distance = 0.5_wp

   !> Coverage factor of the scatter of positions.
   real(wp), parameter :: coverage = 2.0_wp

contains

   !> Level in the room below, from a force history.
   subroutine predict_room(case, state, force, sample_rate, with_modes, prediction, error)
      !> The case, with floor and room.
      type(case_type), intent(in) :: case
      !> The floor, prepared.
      type(floor_state_type), intent(in) :: state
      !> Force on the floor, N: [n_sample].
      real(wp), intent(in) :: force(:)
      !> Samples per second, Hz.
      real(wp), intent(in) :: sample_rate
      !> Also predict it by the modes of floor and room, with the interval of the rating.
      logical, intent(in) :: with_modes
      type(room_level_type), intent(out) :: prediction
      !> Set if a level cannot be computed, or the floor cannot radiate into the room.
      type(error_type), allocatable, intent(out) :: error
      type(band_type), allocatable :: bands(:)
      type(floor_modes_type) :: modes
      type(modal_radiation_type) :: radiation
      type(plate_type) :: plate
      type(room_level_type) :: bare
      real(wp), allocatable :: level(:), conductance(:)

      call get_room_bands(bands, error)
      if (allocated(error)) return
      allocate (level(size(bands)), conductance(size(bands)))
      call get_force_exposure_levels(force, sample_rate, bands, trim(case%level_method), level, error)
      if (allocated(error)) return
      associate (floor => case%floors(get_floor_number(case))%model)
         level = level - floor%get_improvement(size(bands))
         call floor%get_radiator(state, bands%center, plate, conductance, error)
         if (.not. allocated(error)) call check_below(plate, case%room, error)
         if (.not. allocated(error)) call floor%get_radiating_modes(state, plate, modes, error)
         if (allocated(error)) return
         call get_radiation(case%room, floor, state, plate, modes, bands, radiation, error)
         if (allocated(error)) return
         if (case%room%radiation /= modal_radiation) then
            radiation%radiation_factor = get_plate_radiation(plate, case%room%air, bands%center)
            radiation%upper_factor = radiation%radiation_factor
         end if
         if (.not. floor%has_modal_conductance()) radiation%conductance = conductance
         call get_room_level(plate, radiation, case%room, bands, level, prediction)
         if (.not. with_modes) return
         call get_room_level(plate, radiation, get_bare_room(case%room), bands, level, bare)
         call add_modal_levels(case%room, floor, state, plate, modes, force, sample_rate, &
            prediction%level - bare%level - floor%get_improvement(size(bands)), prediction, error)
         if (.not. allocated(error)) call add_contributions(case, plate, radiation, level, prediction)
      end associate
   end subroutine predict_room

   !> Radiation of a floor in bands. Those that its modes do not reach, because coupled functions resolve few waves, have
   !> that of the simply supported floor without further supports: its waves are so short that these matter little. The
   !> middle of the floor represents it if not all of it is resolved.
   subroutine get_radiation(room, floor, state, plate, modes, bands, radiation, error)
      type(room_type), intent(in) :: room
      class(floor_model_type), intent(in) :: floor
      !> The floor, prepared.
      type(floor_state_type), intent(in) :: state
      type(plate_type), intent(in) :: plate
      !> Modes of the floor as it is supported.
      type(floor_modes_type), intent(in) :: modes
      !> The bands: [n_band].
      type(band_type), intent(in) :: bands(:)
      type(modal_radiation_type), intent(out) :: radiation
      !> Set if the modes cannot be computed.
      type(error_type), allocatable, intent(out) :: error
      type(floor_modes_type) :: simple_modes
      type(modal_radiation_type) :: beyond
      type(plate_type) :: simple_plate
      real(wp) :: area(4)
      integer :: n

      n = count(bands%upper <= modes%limit/(2*pi))
      area = get_area(room, plate)
      call get_modal_radiation(modes, plate, room%air, bands(:n), area, radiation)
      if (n == size(bands)) return
      call floor%get_room_modes(state, uncoupled_support, simple_plate, simple_modes, error)
      if (allocated(error)) return
      ! Of a floor whose middle represents it, as much of the middle as the room covers; losses keep energy near the strike.
      associate (stack => simple_modes%stack)
         if (stack%length*stack%width < plate%length*plate%width*(1 - 1.0e-9_wp)) area = &
            [0.0_wp, min(area(2) - area(1), stack%length), 0.0_wp, min(area(4) - area(3), stack%width)]
      end associate
      call get_modal_radiation(simple_modes, plate, room%air, bands(n + 1:), area, beyond)
      if (n > 0) beyond%energy_beyond = max(beyond%energy_beyond, radiation%energy_beyond(n))
      radiation%radiation_factor = [radiation%radiation_factor, beyond%radiation_factor]
      radiation%upper_factor = [radiation%upper_factor, beyond%upper_factor]
      radiation%energy_beyond = [radiation%energy_beyond, beyond%energy_beyond]
      radiation%conductance = [radiation%conductance, beyond%conductance]
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

   !> Levels by the modes of floor and room: as the floor is supported, simply supported and clamped. Walls and a ceiling
   !> change them as much as the statistical levels.
   subroutine add_modal_levels(room, floor, state, plate, modes, force, sample_rate, change, prediction, error)
      type(room_type), intent(in) :: room
      class(floor_model_type), intent(in) :: floor
      !> The floor, prepared.
      type(floor_state_type), intent(in) :: state
      type(plate_type), intent(in) :: plate
      !> Modes of the floor as it is supported.
      type(floor_modes_type), intent(in) :: modes
      real(wp), intent(in) :: force(:)
      real(wp), intent(in) :: sample_rate
      !> Change of the statistical levels by walls and ceiling, dB: [n_band].
      real(wp), intent(in) :: change(:)
      type(room_level_type), intent(inout) :: prediction
      !> Set if the modes cannot be computed.
      type(error_type), allocatable, intent(out) :: error
      character(len=*), parameter :: supports(2) = [character(len=7) :: 'simple', 'clamped']
      real(wp), allocatable :: ball(:, :), microphone(:, :)
      type(floor_modes_type) :: other_modes
      type(plate_type) :: other_plate
      type(modal_room_type) :: modal
      type(box_type) :: box
      integer :: i

      box = get_box(room, plate, prediction%bands)
      call get_positions(room, box, ball, microphone)
      allocate (prediction%modal_level, source=prediction%level)
      allocate (prediction%modal_spread, source=prediction%spread)
      allocate (prediction%mean_spread, source=prediction%spread/sqrt(real(size(ball, 2), wp)))
      if (floor%has_room_modes()) then
         call get_modal_room(modes, box, force, sample_rate, ball, microphone, .false., .false., modal)
         prediction%n_modal = modal%n_band
         prediction%n_left_out = modal%n_left_out
         prediction%crossover = get_crossover(box)
         prediction%mean_spread(:modal%n_band) = modal%mean_spread
         prediction%modal_level(:modal%n_band) = modal%mean + change(:modal%n_band)
         prediction%modal_spread(:modal%n_band) = modal%spread
      end if
      allocate (prediction%edge_level(size(prediction%level), 2), source=spread(prediction%modal_level, 2, 2))
      if (prediction%n_modal == 0 .or. floor%get_support() == '') return
      do i = 1, 2
         if (floor%get_support() == supports(i)) cycle
         call floor%get_room_modes(state, supports(i), other_plate, other_modes, error, get_highest_frequency(box))
         if (allocated(error)) return
         call get_modal_room(other_modes, box, force, sample_rate, ball, microphone, .false., .false., modal)
         prediction%edge_level(:modal%n_band, i) = modal%mean + change(:modal%n_band)
      end do
   end subroutine add_modal_levels

   !> Positions of ball and microphone, from the corner of the room, m.
   subroutine get_positions(room, box, ball, microphone)
      type(room_type), intent(in) :: room
      type(box_type), intent(in) :: box
      !> Positions: [2, n_ball], [3, n_microphone].
      real(wp), allocatable, intent(out) :: ball(:, :), microphone(:, :)
      real(wp), allocatable :: even(:, :)
      real(wp) :: distance(3)
      integer :: i

      if (room%positions == standard_positions) then
         allocate (ball(2, n_standard), microphone(3, n_standard))
         call get_standard_positions(box, ball, microphone)
         return
      end if
      call get_strike_points(2*n_even, even)
      distance = min(even_distance, box%sides/4)
      ! Every other point is one of the ball; heights are in another order than the other coordinates.
      ball = spread(distance(:2), 2, n_even) + spread(box%sides(:2) - 2*distance(:2), 2, n_even)*even(:, 1::2)
      microphone = reshape([(distance(:2) + (box%sides(:2) - 2*distance(:2))*even(:, 2*i), &
         distance(3) + (box%sides(3) - 2*distance(3))*modulo(0.5_wp + 7*(i - 0.5_wp)/n_even, 1.0_wp), i=1, n_even)], &
         [3, n_even])
   end subroutine get_positions

   !> Contributions to the intervals of the ratings, as differences from the means of both predictions.
   subroutine add_contributions(case, plate, radiation, level, prediction)
      type(case_type), intent(in) :: case
      type(plate_type), intent(in) :: plate
      type(modal_radiation_type), intent(in) :: radiation
      !> Levels of the force, dB: [n_band].
      real(wp), intent(in) :: level(:)
      type(room_level_type), intent(inout) :: prediction
      type(source_limits_type) :: limits
      type(error_type), allocatable :: error
      type(room_level_type) :: changed(2)
      type(room_type) :: room
      real(wp) :: modal(size(rating_names))
      real(wp) :: source_level(size(level))
      integer :: i, octave

      allocate (prediction%contribution(2, size(contribution_names), size(rating_names)), source=0.0_wp)
      modal = get_ratings(prediction, prediction%modal_level)
      associate (statistical => prediction%rating, source => prediction%contribution(:, 1, :), &
         edges => prediction%contribution(:, 2, :), time => prediction%contribution(:, 3, :), &
         positions => prediction%contribution(:, 4, :), model => prediction%contribution(:, 5, :))
         ! Another source that conforms: half the range of its octave, the octave of 31.5 Hz being the first.
         call get_source_limits(case%source, limits, error)
         do i = 1, size(level)
            octave = min(2 + (i - 1)/3, octave_count)
            source_level(i) = prediction%level(i) + (limits%upper_level(octave) - limits%lower_level(octave))/2
         end do
         source = get_ends(statistical - get_ratings(prediction, source_level))
         edges = get_ends(get_ratings(prediction, prediction%edge_level(:, 1)) - modal, &
            get_ratings(prediction, prediction%edge_level(:, 2)) - modal)
         do i = 1, 2
            room = case%room
            room%reverberation_time%values = room%reverberation_time%values*time_ratio**(2*i - 3)
            call get_room_level(plate, radiation, room, prediction%bands, level, changed(i))
         end do
         time = get_ends(changed(1)%rating - statistical, changed(2)%rating - statistical)
         positions = get_ends(coverage*get_rated_spread(prediction))
         model = get_ends((modal - statistical)/2)
         prediction%rated = (modal + statistical)/2
      end associate
      ! The contributions are independent of each other.
      prediction%interval(1, :) = prediction%rated - norm2(prediction%contribution(1, :, :), dim=1)
      prediction%interval(2, :) = prediction%rated + norm2(prediction%contribution(2, :, :), dim=1)
   end subroutine add_contributions

   !> Lower and upper ends of deviations, at most and at least 0, dB: [2, n].
   pure function get_ends(deviation, other) result(ends)
      real(wp), intent(in) :: deviation(:)
      !> Deviation the other way (default: as large, with the opposite sign).
      real(wp), intent(in), optional :: other(:)
      real(wp) :: ends(2, size(deviation))
      real(wp) :: opposite(size(deviation))

      opposite = -deviation
      if (present(other)) opposite = other
      ends(1, :) = min(deviation, opposite, 0.0_wp)
      ends(2, :) = max(deviation, opposite, 0.0_wp)
   end function get_ends

   !> Standard deviations of the ratings of the mean levels: that of the bands, weighted by their energies, as if their
   !> deviations were independent, dB.
   pure function get_rated_spread(prediction) result(deviation)
      type(room_level_type), intent(in) :: prediction
      real(wp) :: deviation(size(rating_names))
      real(wp) :: share(size(rating_names), size(prediction%modal_level))
      integer :: i

      do i = 1, size(share, 2)
         share(:, i) = 1 - 10**(0.1_wp*(get_ratings(prediction, without_band(prediction%modal_level, i)) &
            - get_ratings(prediction, prediction%modal_level)))
      end do
      deviation = norm2(share*spread(prediction%mean_spread, 1, size(rating_names)), dim=2)
   end function get_rated_spread

   !> Levels with one band silent, dB.
   pure function without_band(level, band) result(others)
      real(wp), intent(in) :: level(:)
      integer, intent(in) :: band
      real(wp) :: others(size(level))

      others = level
      others(band) = -1000.0_wp
   end function without_band

end module thud_room_prediction
