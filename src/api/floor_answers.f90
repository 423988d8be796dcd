!> Answers on floors and the rooms below them; see `thud_answer`.
module thud_floor_answers
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use thud_ascending, only: get_ascending_order
   use thud_band, only: band_type, get_bands
   use thud_bundle, only: bundle_type
   use thud_case, only: case_type
   use thud_compute, only: drop_on_floor, prepare_floor
   use thud_constants, only: pi
   use thud_error, only: error_type, input_error
   use thud_floor_model, only: check_radiator, floor_state_type, get_plate_conductance, get_transfer, has_own_modes
   use thud_floor_modes, only: floor_modes_type, get_selected_modes
   use thud_floor_result, only: get_point_velocity
   use thud_force_history, only: force_history_type
   use thud_injected_energy, only: get_injected_energies, get_mean_conductances, get_total_energy
   use thud_kinds, only: wp
   use thud_measured_mobility_floor, only: measured_mobility_floor_type
   use thud_mobility_fit, only: fit_mobility
   use thud_modal_radiation, only: get_modal_radiation, modal_radiation_type
   use thud_modal_room, only: box_type, get_crossover, get_modal_room, modal_room_type
   use thud_modes, only: get_mode_values
   use thud_plate, only: get_critical_frequency, get_plate_radiation, get_surface_mass, get_total_loss
   use thud_receiver, only: get_mobility, receiver_type
   use thud_request, only: request_type
   use thud_result_bundle, only: add_history, add_room_level
   use thud_room, only: check_below, get_rating_index, get_room_bands, room_level_type, use_standard_positions
   use thud_room_prediction, only: get_area, get_box, place, predict_room
   implicit none (type, external)
   private

   public :: answer_floor_energy, answer_floor_impact, answer_mobility, answer_mobility_fit, answer_point_velocity
   public :: answer_floor_modes, answer_modal_room, answer_radiation, answer_radiator, answer_room_level

contains

   !> Mobility of a case's floor, m/(N s), at the frequencies `frequency`, Hz: under the source or, with `point`, m, from
   !> the source to this point.
   subroutine answer_mobility(case, request, bundle, error)
      type(case_type), intent(in) :: case
      type(request_type), intent(in) :: request
      type(bundle_type), intent(inout) :: bundle
      !> Set if the floor has no such point.
      type(error_type), allocatable, intent(out) :: error
      type(floor_state_type) :: state
      type(receiver_type) :: receiver
      complex(wp), allocatable :: mobility(:)

      call prepare_floor(case, state, error)
      if (allocated(error)) return
      receiver = state%receiver
      associate (point => request%get_array('point'))
         if (size(point) == 2) call get_transfer(state, point(1), point(2), receiver, error)
      end associate
      if (allocated(error)) return
      mobility = get_mobility(receiver, request%get_array('frequency'))
      call bundle%add_array('real', shape(mobility), real(mobility, wp))
      call bundle%add_array('imaginary', shape(mobility), aimag(mobility))
   end subroutine answer_mobility

   !> Energy that the record `force`, N, at `sample_rate`, Hz, injects into a case's floor in the band set `bands`.
   subroutine answer_floor_energy(case, request, bundle, error)
      type(case_type), intent(in) :: case
      type(request_type), intent(in) :: request
      type(bundle_type), intent(inout) :: bundle
      !> Set if a level cannot be computed.
      type(error_type), allocatable, intent(out) :: error
      type(band_type), allocatable :: bands(:)
      type(floor_state_type) :: state
      character(len=:), allocatable :: set
      real(wp), allocatable :: energy(:)

      call request%get_text('bands', set)
      bands = get_bands(set)
      call prepare_floor(case, state, error)
      if (allocated(error)) return
      allocate (energy(size(bands)))
      call get_injected_energies(state%receiver, request%get_array('force'), request%get_number('sample_rate'), bands, &
         energy, error)
      if (allocated(error)) return
      call bundle%add_array('frequency', shape(bands), bands%nominal)
      call bundle%add_array('energy', shape(bands), energy)
      call bundle%add_array('conductance', shape(bands), get_mean_conductances(state%receiver, bands))
      call bundle%add_number('total', get_total_energy(state%receiver, request%get_array('force'), &
         request%get_number('sample_rate')))
   end subroutine answer_floor_energy

   !> Velocity, m/s, of the point `point`, m, of a case's floor under the record `force`, N, at `sample_rate`, Hz.
   subroutine answer_point_velocity(case, request, bundle, error)
      type(case_type), intent(in) :: case
      type(request_type), intent(in) :: request
      type(bundle_type), intent(inout) :: bundle
      !> Set if the floor has no such point.
      type(error_type), allocatable, intent(out) :: error
      type(floor_state_type) :: state
      real(wp), allocatable :: velocity(:)

      call prepare_floor(case, state, error)
      associate (force => request%get_array('force'), point => request%get_array('point'))
         allocate (velocity(size(force)))
         if (.not. allocated(error)) call get_point_velocity(state, force, request%get_number('sample_rate'), point(1), &
            point(2), velocity, error)
      end associate
      if (.not. allocated(error)) call bundle%add_array('velocity', shape(velocity), velocity)
   end subroutine answer_point_velocity

   !> The impact on a case's mobile floor, and the level in the room below, if it has one; empty if the floor is rigid or the
   !> model does not couple with it.
   subroutine answer_floor_impact(case, bundle, error)
      type(case_type), intent(in) :: case
      type(bundle_type), intent(inout) :: bundle
      type(error_type), allocatable, intent(out) :: error
      type(floor_state_type) :: state
      type(force_history_type), allocatable :: on_floor
      type(room_level_type) :: prediction

      call prepare_floor(case, state, error)
      if (.not. allocated(error)) call drop_on_floor(case, state, on_floor, error)
      if (allocated(error) .or. .not. allocated(on_floor)) return
      call add_history(bundle, 'on_floor.', on_floor)
      if (.not. case%has_room) return
      call predict_room(case, state, on_floor%floor_force, on_floor%sample_rate, prediction, error)
      if (.not. allocated(error)) call add_room_level(bundle, case, state, prediction)
   end subroutine answer_floor_impact

   !> Level in the room below, from the record `force`, N, at `sample_rate`, Hz.
   subroutine answer_room_level(case, request, bundle, error)
      type(case_type), intent(in) :: case
      type(request_type), intent(in) :: request
      type(bundle_type), intent(inout) :: bundle
      !> Set if the floor cannot radiate into the room.
      type(error_type), allocatable, intent(out) :: error
      type(floor_state_type) :: state
      type(room_level_type) :: prediction

      call prepare_floor(case, state, error)
      if (.not. allocated(error)) call predict_room(case, state, request%get_array('force'), &
         request%get_number('sample_rate'), prediction, error)
      if (.not. allocated(error)) call add_room_level(bundle, case, state, prediction)
   end subroutine answer_room_level

   !> Sound in the modal room below for each of the positions `ball` and `microphone`, m from the corner of the room, from
   !> the record `force`, N, at `sample_rate`, Hz, in bands up to `highest`, Hz, by default the crossover. With `pressure`,
   !> the sound pressure, too.
   subroutine answer_modal_room(case, request, bundle, error)
      type(case_type), intent(in) :: case
      type(request_type), intent(in) :: request
      type(bundle_type), intent(inout) :: bundle
      !> Set if the floor has no modes.
      type(error_type), allocatable, intent(out) :: error
      type(modal_room_type) :: room
      type(floor_state_type) :: state
      type(box_type) :: box

      call prepare_with_room(case, state, box, error)
      if (allocated(error)) return
      associate (stated_ball => request%get_array('ball'), stated_microphone => request%get_array('microphone'))
         call place(use_standard_positions(case%room, get_rating_index(case%room)), box)
         if (size(stated_ball) > 0) box%ball = reshape(stated_ball, [2, size(stated_ball)/2])
         if (size(stated_microphone) > 0) box%microphone = reshape(stated_microphone, [3, size(stated_microphone)/3])
      end associate
      call get_modal_room(state%modes, box, request%get_array('force'), request%get_number('sample_rate'), &
         request%get_number('pressure') > 0.0_wp, .true., room, request%get_number('highest', get_crossover(box)))
      if (.not. all(ieee_is_finite(room%mean))) then
         error = input_error('balls: all positions lie on rigid supports, which do not move; allowed: at least one ' &
            //'elsewhere')
         return
      end if
      call bundle%add_array('sides', [3], box%sides)
      call bundle%add_array('ball', shape(box%ball), box%ball)
      call bundle%add_array('microphone', shape(box%microphone), box%microphone)
      call bundle%add_array('frequency', [room%n_band], box%bands(:room%n_band)%nominal)
      call bundle%add_array('level', shape(room%level), room%level)
      call bundle%add_array('mean', shape(room%mean), room%mean)
      call bundle%add_array('spread', shape(room%spread), room%spread)
      call bundle%add_array('floor_energy', shape(room%floor_energy), room%floor_energy)
      call bundle%add_array('room_energy', shape(room%room_energy), room%room_energy)
      call bundle%add_number('floor_modes', real(room%floor_modes, wp))
      call bundle%add_number('room_modes', real(room%room_modes, wp))
      call bundle%add_number('crossover', get_crossover(box))
      call bundle%add_number('sample_rate', room%sample_rate)
      if (allocated(room%pressure)) call bundle%add_array('pressure', shape(room%pressure), room%pressure)
   end subroutine answer_modal_room

   !> Radiation of a case's floor into the room below in the rated one-third-octave bands, by its modes: averaged over the
   !> floor, or over the strike points `x`, `y`, relative to its sides.
   subroutine answer_radiation(case, request, bundle, error)
      type(case_type), intent(in) :: case
      type(request_type), intent(in) :: request
      type(bundle_type), intent(inout) :: bundle
      !> Set if the floor has no modes.
      type(error_type), allocatable, intent(out) :: error
      type(modal_radiation_type) :: radiation
      type(floor_state_type) :: state
      type(box_type) :: box

      call prepare_with_room(case, state, box, error)
      if (allocated(error)) return
      associate (x => request%get_array('x'), y => request%get_array('y'), area => get_area(case%room, state%plate))
         if (size(x) > 0) then
            call get_modal_radiation(state%modes, state%plate, box%air, box%bands, area, radiation, &
               reshape([x, y], [2, size(x)], order=[2, 1]))
         else
            call get_modal_radiation(state%modes, state%plate, box%air, box%bands, area, radiation)
         end if
      end associate
      call bundle%add_array('frequency', shape(box%bands), box%bands%nominal)
      call bundle%add_array('radiation_factor', shape(box%bands), radiation%radiation_factor)
      call bundle%add_array('radiated', shape(box%bands), radiation%radiated)
   end subroutine answer_radiation

   !> Natural frequencies, Hz, and loss factors of the modes of a case's floor up to `highest`, Hz, and the shapes of its
   !> radiating plate at the points `x`, `y`, m, 1/sqrt(kg).
   subroutine answer_floor_modes(case, request, bundle, error)
      type(case_type), intent(in) :: case
      type(request_type), intent(in) :: request
      type(bundle_type), intent(inout) :: bundle
      !> Set if the floor has no modes.
      type(error_type), allocatable, intent(out) :: error
      type(floor_state_type) :: state
      type(floor_modes_type) :: modes
      real(wp), allocatable :: shapes(:, :)
      integer, allocatable :: order(:)

      call prepare_floor(case, state, error)
      if (.not. allocated(error)) call check_modes(state, error)
      if (allocated(error)) return
      ! No more than needed, because a large floor has many.
      modes = get_selected_modes(state%modes, state%modes%omega < min(2*pi*request%get_number('highest'), &
         state%modes%limit))
      associate (x => request%get_array('x'))
         order = get_ascending_order(modes%omega)
         call bundle%add_array('frequency', [size(order)], modes%omega(order)/(2*pi))
         call bundle%add_array('loss_factor', [size(order)], modes%loss_factor(order))
         call bundle%add_number('limit', modes%limit/(2*pi))
         call bundle%add_number('length', modes%stack%length)
         call bundle%add_number('width', modes%stack%width)
         if (size(x) == 0) return
         shapes = get_mode_values(modes%modes, modes%stack%radiator, x, request%get_array('y'))
         shapes = shapes(order, :)
         call bundle%add_array('shape', shape(shapes), shapes)
      end associate
   end subroutine answer_floor_modes

   !> A case's floor, prepared, and the room below as a box.
   subroutine prepare_with_room(case, state, box, error)
      type(case_type), intent(in) :: case
      type(floor_state_type), intent(out) :: state
      type(box_type), intent(out) :: box
      !> Set if the floor has no modes or cannot radiate into the room.
      type(error_type), allocatable, intent(out) :: error
      type(band_type), allocatable :: bands(:)

      call get_room_bands(bands, error)
      if (.not. allocated(error)) call prepare_floor(case, state, error)
      if (.not. allocated(error)) call check_radiator(state, error)
      if (.not. allocated(error)) call check_below(state%plate, case%room, error)
      if (.not. allocated(error)) call check_modes(state, error)
      if (.not. allocated(error)) box = get_box(case%room, state%plate, bands)
   end subroutine prepare_with_room

   !> Checks that a floor has modes.
   subroutine check_modes(state, error)
      !> The floor, prepared.
      type(floor_state_type), intent(in) :: state
      !> Set if it has none.
      type(error_type), allocatable, intent(out) :: error

      if (.not. has_own_modes(state)) error = input_error('&floor: name: this floor has no modes; allowed: a rectangular ' &
         //'floor')
   end subroutine check_modes

   !> The plate of a floor that radiates into the room below, at the frequencies `frequency`, Hz.
   subroutine answer_radiator(case, request, bundle, error)
      type(case_type), intent(in) :: case
      type(request_type), intent(in) :: request
      type(bundle_type), intent(inout) :: bundle
      !> Set if the floor cannot radiate into the room.
      type(error_type), allocatable, intent(out) :: error
      type(floor_state_type) :: state

      call prepare_floor(case, state, error)
      if (.not. allocated(error)) call check_radiator(state, error)
      if (allocated(error)) return
      associate (air => case%room%air, frequency => request%get_array('frequency'), plate => state%plate)
         call bundle%add_number('surface_mass', get_surface_mass(plate))
         call bundle%add_number('critical_frequency', get_critical_frequency(plate, air))
         call bundle%add_number('length', plate%length)
         call bundle%add_number('width', plate%width)
         call bundle%add_array('conductance', shape(frequency), get_plate_conductance(state, frequency))
         call bundle%add_array('loss_factor', shape(frequency), get_total_loss(plate, air, frequency))
         call bundle%add_array('radiation_factor', shape(frequency), get_plate_radiation(plate, air, frequency))
      end associate
   end subroutine answer_radiator

   !> Fits a floor with `order` poles to the mobility `real` + i `imaginary`, m/(N s), at the frequencies `frequency`, Hz.
   !> `free_error` of the answer is the relative error before the fit was made passive.
   subroutine answer_mobility_fit(request, bundle, error)
      type(request_type), intent(in) :: request
      type(bundle_type), intent(inout) :: bundle
      !> Set if the fit fails.
      type(error_type), allocatable, intent(out) :: error
      type(measured_mobility_floor_type) :: floor
      real(wp) :: free_error

      call fit_mobility(request%get_array('frequency'), cmplx(request%get_array('real'), request%get_array('imaginary'), &
         wp), nint(request%get_number('order')), floor, free_error, error)
      if (allocated(error)) return
      call bundle%add_number('free_error', free_error)
      call bundle%add_number('floor.direct', floor%direct)
      call bundle%add_number('floor.lowest_frequency', floor%lowest_frequency)
      call bundle%add_number('floor.highest_frequency', floor%highest_frequency)
      associate (n => floor%pole_frequency%count)
         call bundle%add_array('floor.pole_frequency', [n], floor%pole_frequency%values(:n))
         call bundle%add_array('floor.damping_ratio', [n], floor%damping_ratio%values(:n))
         call bundle%add_array('floor.residue_real', [n], floor%residue_real%values(:n))
         call bundle%add_array('floor.residue_imaginary', [n], floor%residue_imaginary%values(:n))
      end associate
   end subroutine answer_mobility_fit

end module thud_floor_answers
