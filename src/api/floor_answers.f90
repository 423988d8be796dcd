!> Answers on floors and the rooms below them; see `thud_answer`.
module thud_floor_answers
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use thud_ascending, only: get_ascending_order
   use thud_band, only: band_type, get_bands
   use thud_bundle, only: bundle_type
   use thud_case, only: case_type, get_floor_number
   use thud_compute, only: drop_on_floor
   use thud_constants, only: pi
   use thud_error, only: error_type, input_error
   use thud_floor_model, only: floor_state_type, get_transfer, has_own_modes
   use thud_floor_modes, only: floor_modes_type, get_selected_modes
   use thud_floor_result, only: get_velocities
   use thud_force_history, only: force_history_type
   use thud_injected_energy, only: get_injected_energies, get_mean_conductances, get_total_energy
   use thud_kinds, only: wp
   use thud_measured_mobility_floor, only: fit_mobility, measured_mobility_floor_type
   use thud_modal_radiation, only: get_modal_radiation, modal_radiation_type
   use thud_modal_room, only: get_modal_room, modal_room_type
   use thud_modes, only: get_mode_values
   use thud_plate, only: get_plate_radiation, get_surface_mass, get_total_loss
   use thud_receiver, only: get_mobility, receiver_type
   use thud_records, only: add_history, add_room_level
   use thud_request, only: request_type
   use thud_room, only: box_type, check_below, get_rating_index, new_box, place, room_level_type
   use thud_room_prediction, only: predict_room
   implicit none (type, external)
   private

   public :: answer_floor, answer_mobility_fit

contains

   !> Answers a question on the floor of a case and the room below it.
   subroutine answer_floor(question, case, request, bundle, error)
      character(len=*), intent(in) :: question
      type(case_type), intent(in) :: case
      type(request_type), intent(in) :: request
      type(bundle_type), intent(inout) :: bundle
      !> Set if the floor cannot be prepared or does not have what the question asks for, or by a computation.
      type(error_type), allocatable, intent(out) :: error
      type(floor_state_type) :: state

      call case%floors(get_floor_number(case))%model%prepare(state, error)
      if (allocated(error)) return
      select case (question)
      case ('mobility')
         call answer_mobility()
      case ('floor_energy')
         call answer_floor_energy()
      case ('floor_impact', 'room_level')
         call answer_room_level()
      case default
         if (.not. has_own_modes(state)) then
            error = input_error('this floor has no modes; allowed: a rectangular floor', 'floor')
         else if (question == 'floor_modes') then
            call answer_floor_modes()
         else
            call check_below(state%plate, case%room, error)
            if (allocated(error)) return
            if (question == 'modal_room') call answer_modal_room()
            if (question == 'radiation') call answer_radiation()
         end if
      end select
   contains

      !> Mobility of the floor, m/(N s), at the frequencies `frequency`, Hz, and its velocity, m/s, under the record `force`,
      !> N, at `sample_rate`, Hz: under the source or, with `point`, m, from the source to this point.
      subroutine answer_mobility()
         type(receiver_type) :: receiver
         complex(wp), allocatable :: mobility(:)

         receiver = state%receiver
         associate (point => request%get_array('point'))
            if (size(point) == 2) call get_transfer(state, point(1), point(2), receiver, error)
         end associate
         if (allocated(error)) return
         mobility = get_mobility(receiver, request%get_array('frequency'))
         call bundle%add_array('real', shape(mobility), real(mobility, wp))
         call bundle%add_array('imaginary', shape(mobility), aimag(mobility))
         if (.not. request%has('force')) return
         associate (velocity => get_velocities(receiver, request%get_array('force'), request%get_number('sample_rate')))
            call bundle%add_array('velocity', shape(velocity), velocity)
         end associate
      end subroutine answer_mobility

      !> Energy that the record `force`, N, at `sample_rate`, Hz, injects into the floor in the band set `bands`.
      subroutine answer_floor_energy()
         type(band_type), allocatable :: bands(:)
         character(len=:), allocatable :: set
         real(wp), allocatable :: energy(:)

         call request%get_text('bands', set)
         bands = get_bands(set)
         allocate (energy(size(bands)))
         associate (force => request%get_array('force'), sample_rate => request%get_number('sample_rate'))
            call get_injected_energies(state%receiver, force, sample_rate, bands, energy, error)
            if (allocated(error)) return
            call bundle%add_array('frequency', shape(bands), bands%nominal)
            call bundle%add_array('energy', shape(bands), energy)
            call bundle%add_array('conductance', shape(bands), get_mean_conductances(state%receiver, bands))
            call bundle%add_number('total', get_total_energy(state%receiver, force, sample_rate))
         end associate
      end subroutine answer_floor_energy

      !> Level in the room below, if the case has one, from the record `force`, N, at `sample_rate`, Hz. Without a record,
      !> from the impact on the floor, which is answered, too; empty if the floor is rigid or the model does not couple with
      !> it.
      subroutine answer_room_level()
         type(force_history_type), allocatable :: on_floor
         type(room_level_type) :: prediction

         if (request%has('force')) then
            call predict_room(case, state, request%get_array('force'), request%get_number('sample_rate'), prediction, error)
         else
            call drop_on_floor(case, state, on_floor, error)
            if (allocated(error) .or. .not. allocated(on_floor)) return
            call add_history(bundle, 'floor_', on_floor)
            if (.not. case%has_room) return
            call predict_room(case, state, on_floor%floor_force, on_floor%sample_rate, prediction, error)
         end if
         if (.not. allocated(error)) call add_room_level(bundle, case, state, prediction)
      end subroutine answer_room_level

      !> Sound in the modal room below for each of the positions `ball` and `microphone`, m from the corner of the room, from
      !> the record `force`, N, at `sample_rate`, Hz, in bands up to `highest`, Hz, by default the crossover.
      subroutine answer_modal_room()
         type(modal_room_type) :: room
         type(box_type) :: box

         box = new_box(case%room, state%plate)
         call bundle%add_number('crossover', box%crossover)
         box%crossover = request%get_number('highest', box%crossover)
         call place(case%room, get_rating_index(case%room), box)
         associate (stated_ball => request%get_array('ball'), stated_microphone => request%get_array('microphone'))
            if (size(stated_ball) > 0) box%ball = reshape(stated_ball, [2, size(stated_ball)/2])
            if (size(stated_microphone) > 0) box%microphone = reshape(stated_microphone, [3, size(stated_microphone)/3])
         end associate
         call get_modal_room(state%modes, box, request%get_array('force'), request%get_number('sample_rate'), .true., room)
         if (.not. all(ieee_is_finite(room%mean))) then
            error = input_error('balls: all positions lie on rigid supports, which do not move; allowed: at least one ' &
               //'elsewhere')
            return
         end if
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
         call bundle%add_number('sample_rate', room%sample_rate)
         if (allocated(room%pressure)) call bundle%add_array('pressure', shape(room%pressure), room%pressure)
      end subroutine answer_modal_room

      !> Radiation of the floor into the room below in the rated one-third-octave bands, by its modes: averaged over the
      !> floor, or over the strike points `x`, `y`, relative to its sides.
      subroutine answer_radiation()
         type(box_type) :: box
         type(modal_radiation_type), allocatable :: radiation(:)
         real(wp), allocatable :: strike(:, :)

         ! Strike points that are not allocated are an absent argument.
         if (request%has('x')) strike = transpose(reshape([request%get_array('x'), request%get_array('y')], &
            [size(request%get_array('x')), 2]))
         box = new_box(case%room, state%plate)
         allocate (radiation(size(box%bands)))
         call get_modal_radiation(state%modes, state%plate, box%air, box%bands, &
            reshape([box%corner, box%corner + box%sides(:2)], [2, 2]), radiation, strike)
         call bundle%add_array('radiation_factor', shape(radiation), radiation%radiation_factor)
         call bundle%add_array('radiated', shape(radiation), radiation%radiated)
      end subroutine answer_radiation

      !> Natural frequencies, Hz, and loss factors of modes of the floor up to `highest`, Hz, at most `count` of them, the
      !> shapes of its radiating plate at the points `x`, `y`, relative to its sides, 1/sqrt(kg), and its plate: mass per
      !> area, and loss and radiation factors at the frequencies `frequency`, Hz.
      subroutine answer_floor_modes()
         type(floor_modes_type) :: selected
         integer, allocatable :: order(:)
         logical, allocatable :: is_wanted(:)
         real(wp), allocatable :: shapes(:, :)
         integer :: i

         associate (modes => state%modes, stack => state%modes%stack, plate => state%plate, &
            x => request%get_array('x'), y => request%get_array('y'), frequency => request%get_array('frequency'))
            is_wanted = modes%omega < min(2*pi*request%get_number('highest'), modes%limit)
            order = pack([(i, i=1, size(is_wanted))], is_wanted)
            order = order(get_ascending_order(modes%omega(order)))
            order = order(:min(size(order), nint(request%get_number('count', real(size(order), wp)))))
            call bundle%add_array('frequency', [size(order)], modes%omega(order)/(2*pi))
            call bundle%add_array('loss_factor', [size(order)], modes%loss_factor(order))
            call bundle%add_number('limit', modes%limit/(2*pi))
            call bundle%add_number('length', stack%length)
            call bundle%add_number('width', stack%width)
            call bundle%add_number('plate.surface_mass', get_surface_mass(plate))
            call bundle%add_array('plate.loss_factor', shape(frequency), get_total_loss(plate, state%air, frequency))
            call bundle%add_array('plate.radiation_factor', shape(frequency), get_plate_radiation(plate, state%air, &
               frequency))
            if (size(x) == 0) return
            is_wanted = .false.
            is_wanted(order) = .true.
            selected = get_selected_modes(modes, is_wanted)
            shapes = get_mode_values(selected%modes, stack%radiator, stack%length*x, stack%width*y)
            shapes = shapes(get_ascending_order(selected%omega), :)
            call bundle%add_array('shape', shape(shapes), shapes)
         end associate
      end subroutine answer_floor_modes
   end subroutine answer_floor

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
