!> The level in the room below a floor: by the modes of floor and room as far as these are apart, statistical above.
!>
!> Where the support of the edges is unknown, it is the energy mean of the levels with simply supported and with clamped
!> edges: the mean over many dwellings whose edges lie between the two deviates from it by less than 0.5 dB.
module thud_room_prediction
   use thud_case, only: case_type
   use thud_constants, only: pi
   use thud_error, only: error_type
   use thud_floor_model, only: check_radiator, floor_state_type, get_plate_conductance
   use thud_floor_modes, only: floor_modes_type, get_floor_modes
   use thud_force_exposure, only: get_force_exposure_levels
   use thud_kinds, only: wp
   use thud_modal_radiation, only: get_modal_radiation, modal_radiation_type
   use thud_modal_room, only: get_highest_frequency, get_modal_room, modal_room_type
   use thud_plate, only: get_plate_radiation
   use thud_plate_stack, only: get_simplified, with_clamped_edges
   use thud_room, only: add_ratings, box_type, check_below, get_rating_index, modal_radiation, new_box, of_thirds, place, &
      positions_of_rating, room_level_type, room_type
   use thud_room_uncertainty, only: add_uncertainty, get_probability
   use thud_statistical_level, only: get_statistical_level
   implicit none (type, external)
   private

   public :: predict_room

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
      type(modal_radiation_type), allocatable :: radiation(:), clamped_radiation(:)
      type(room_level_type) :: clamped
      type(box_type) :: box
      real(wp), allocatable :: force_level(:)
      integer :: shown

      call check_radiator(state, error)
      if (.not. allocated(error)) call check_below(state%plate, case%room, error)
      if (allocated(error)) return
      box = new_box(case%room, state%plate)
      allocate (force_level(size(box%bands)))
      call get_force_exposure_levels(force, sample_rate, box%bands, trim(case%level_method), force_level, error)
      if (.not. allocated(error)) call get_radiation(state%modes, radiation, error)
      if (allocated(error)) return
      ! `rated_level` is the statistical level, that of modes in the bands that they reach, and then the mean over edges.
      call predict_supported(state%modes, radiation, prediction)
      shown = min(get_rating_index(case%room), of_thirds)
      prediction%edge_level = spread(prediction%rated_level(:, shown), 2, 2)
      if (.not. state%edges_are_known .and. prediction%n_modal > 0) then
         call get_floor_modes(trim(state%group), with_clamped_edges(state%modes%stack), state%plate, state%air, &
            clamped_modes, error, get_highest_frequency(box))
         if (.not. allocated(error)) call get_radiation(clamped_modes, clamped_radiation, error, radiation)
         if (allocated(error)) return
         call predict_supported(clamped_modes, clamped_radiation, clamped)
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
      if (case%room%required > 0.0_wp) prediction%probability = get_probability(case%room, prediction)
   contains

      !> Radiation of the floor in bands. Those that its modes do not reach, because coupled functions resolve few waves,
      !> have that of the simply supported floor without further supports: its waves are so short that these matter little.
      !> The middle of the floor represents it if not all of it is resolved.
      subroutine get_radiation(modes, radiation, error, known)
         !> Modes of the floor as it is supported.
         type(floor_modes_type), intent(in) :: modes
         !> The radiation: [n_band].
         type(modal_radiation_type), allocatable, intent(out) :: radiation(:)
         !> Set if the modes cannot be computed.
         type(error_type), allocatable, intent(out) :: error
         !> Radiation for the bands that the modes do not reach (default: that of the simply supported floor).
         type(modal_radiation_type), intent(in), optional :: known(:)
         type(floor_modes_type) :: simple_modes
         real(wp) :: area(2, 2)
         integer :: n

         associate (bands => box%bands, plate => state%plate)
            allocate (radiation(size(bands)))
            area = reshape([box%corner, box%corner + box%sides(:2)], [2, 2])
            n = count(bands%upper <= modes%limit/(2*pi))
            call get_modal_radiation(modes, plate, box%air, bands(:n), area, radiation(:n))
            if (n == size(bands)) return
            if (present(known)) then
               radiation(n + 1:) = known(n + 1:)
               return
            end if
            simple_modes = modes
            ! Modes of a file have no plates with stiffness; beyond these modes the infinite plate takes their place.
            if (modes%stack%plate(1)%along > 0.0_wp) call get_floor_modes(trim(state%group), get_simplified(modes%stack), &
               plate, state%air, simple_modes, error)
            if (allocated(error)) return
            ! Of a floor whose middle represents it, as much of the middle as the room covers; losses keep energy near the
            ! strike.
            associate (stack => simple_modes%stack)
               if (stack%length*stack%width < plate%length*plate%width*(1 - 1.0e-9_wp)) area = reshape([0.0_wp, 0.0_wp, &
                  min(box%sides(:2), [stack%length, stack%width])], [2, 2])
            end associate
            call get_modal_radiation(simple_modes, plate, box%air, bands(n + 1:), area, radiation(n + 1:))
            if (n > 0) radiation(n + 1:)%energy_beyond = max(radiation(n + 1:)%energy_beyond, radiation(n)%energy_beyond)
         end associate
      end subroutine get_radiation

      !> Level below the floor with known edges. Walls, a ceiling and a covering change modal levels as much as statistical
      !> ones.
      subroutine predict_supported(modes, radiation, prediction)
         !> Modes of the floor with these edges, and its radiation by them: [n_band].
         type(floor_modes_type), intent(in) :: modes
         type(modal_radiation_type), intent(in) :: radiation(:)
         type(room_level_type), intent(out) :: prediction
         type(modal_radiation_type) :: used(size(radiation))
         type(room_level_type) :: bare
         type(room_type) :: bare_room
         type(modal_room_type) :: modal
         integer :: i

         used = radiation
         if (case%room%radiation /= modal_radiation) then
            used%radiation_factor = get_plate_radiation(state%plate, box%air, box%bands%center)
            used%upper_factor = used%radiation_factor
         end if
         if (.not. state%has_modal_conductance) used%conductance = get_plate_conductance(state, box%bands%center)
         call get_statistical_level(state%plate, used, case%room, box, force_level - state%improvement, prediction)
         ! A floor whose mobility is measured has the modes of its plate alone.
         if (state%is_measured) used%conductance = radiation%conductance
         bare_room = case%room
         bare_room%ceiling%mass = 0.0_wp
         bare_room%walls%lengths%count = 0
         call get_statistical_level(state%plate, used, bare_room, box, force_level, bare)
         do i = 1, size(prediction%rated_level, 2)
            if (i == 1 .or. case%room%positions == positions_of_rating) then
               call place(case%room, i, box)
               call get_modal_room(modes, box, force, sample_rate, .false., modal)
            end if
            associate (n => modal%n_band)
               prediction%n_modal = n
               prediction%rated_level(:n, i) = modal%mean + prediction%statistical_level(:n) - bare%statistical_level(:n)
            end associate
         end do
      end subroutine predict_supported
   end subroutine predict_room

end module thud_room_prediction
