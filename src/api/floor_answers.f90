!> Answers on floors and the rooms below them; see `thud_answer`.
module thud_floor_answers
   use thud_band, only: band_type, find_bands
   use thud_bundle, only: bundle_type
   use thud_case, only: case_type, get_floor_number
   use thud_compute, only: drop_on_floor, predict_room_level
   use thud_error, only: error_type
   use thud_floor_result, only: get_point_velocity
   use thud_force_history, only: force_history_type
   use thud_injected_energy, only: get_injected_energies, get_mean_conductances, get_total_energy
   use thud_kinds, only: wp
   use thud_measured_mobility_floor, only: measured_mobility_floor_type
   use thud_mobility_fit, only: fit_mobility
   use thud_plate, only: get_critical_frequency, get_plate_radiation, get_surface_mass, get_total_loss, plate_type
   use thud_receiver, only: get_mobility, receiver_type
   use thud_request, only: request_type
   use thud_result_bundle, only: add_history, add_room_level
   use thud_room, only: get_room_bands, room_level_type
   implicit none (type, external)
   private

   public :: answer_floor_energy, answer_floor_impact, answer_mobility, answer_mobility_fit, answer_point_velocity
   public :: answer_radiator, answer_room_level

contains

   !> Mobility of a case's floor, m/(N s), at the frequencies `frequency`, Hz: under the source or, with `point`, m, from
   !> the source to this point.
   subroutine answer_mobility(case, request, bundle, error)
      type(case_type), intent(in) :: case
      type(request_type), intent(in) :: request
      type(bundle_type), intent(inout) :: bundle
      !> Set if the floor has no such point.
      type(error_type), allocatable, intent(out) :: error
      type(receiver_type) :: receiver
      real(wp), allocatable :: point(:)
      complex(wp), allocatable :: mobility(:)

      allocate (point, source=request%get_array('point'))
      associate (floor => case%floors(get_floor_number(case))%model)
         if (size(point) == 2) then
            call floor%get_transfer(point(1), point(2), receiver, error)
         else
            call floor%get_receiver(receiver, error)
         end if
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
      !> Set if the band set is unknown, or a level cannot be computed.
      type(error_type), allocatable, intent(out) :: error
      type(band_type), allocatable :: bands(:)
      type(receiver_type) :: receiver
      character(len=:), allocatable :: set
      real(wp), allocatable :: force(:), energy(:)

      call request%get_text('bands', set)
      call find_bands(set, bands, error)
      if (.not. allocated(error)) call case%floors(get_floor_number(case))%model%get_receiver(receiver, error)
      if (allocated(error)) return
      allocate (force, source=request%get_array('force'))
      allocate (energy(size(bands)))
      call get_injected_energies(receiver, force, request%get_number('sample_rate'), bands, energy, error)
      if (allocated(error)) return
      call bundle%add_array('frequency', shape(bands), bands%nominal)
      call bundle%add_array('energy', shape(bands), energy)
      call bundle%add_array('conductance', shape(bands), get_mean_conductances(receiver, bands))
      call bundle%add_number('total', get_total_energy(receiver, force, request%get_number('sample_rate')))
   end subroutine answer_floor_energy

   !> Velocity, m/s, of the point `point`, m, of a case's floor under the record `force`, N, at `sample_rate`, Hz.
   subroutine answer_point_velocity(case, request, bundle, error)
      type(case_type), intent(in) :: case
      type(request_type), intent(in) :: request
      type(bundle_type), intent(inout) :: bundle
      !> Set if the floor has no such point.
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: force(:), velocity(:), point(:)

      allocate (force, source=request%get_array('force'))
      allocate (point, source=request%get_array('point'))
      allocate (velocity, mold=force)
      associate (floor => case%floors(get_floor_number(case))%model)
         call get_point_velocity(floor, force, request%get_number('sample_rate'), point(1), point(2), velocity, error)
      end associate
      if (.not. allocated(error)) call bundle%add_array('velocity', shape(velocity), velocity)
   end subroutine answer_point_velocity

   !> The impact on a case's mobile floor; empty if the floor is rigid or the model does not couple with it.
   subroutine answer_floor_impact(case, bundle, error)
      type(case_type), intent(in) :: case
      type(bundle_type), intent(inout) :: bundle
      type(error_type), allocatable, intent(out) :: error
      type(force_history_type), allocatable :: on_floor

      call drop_on_floor(case, on_floor, error)
      if (allocated(on_floor) .and. .not. allocated(error)) call add_history(bundle, 'on_floor.', on_floor)
   end subroutine answer_floor_impact

   !> Level in the room below, from levels of the force `levels`, dB, in the rated one-third-octave bands.
   subroutine answer_room_level(case, request, bundle, error)
      type(case_type), intent(in) :: case
      type(request_type), intent(in) :: request
      type(bundle_type), intent(inout) :: bundle
      !> Set if the floor cannot radiate into the room.
      type(error_type), allocatable, intent(out) :: error
      type(room_level_type) :: prediction
      type(band_type), allocatable :: bands(:)

      call get_room_bands(bands, error)
      if (.not. allocated(error)) call predict_room_level(case, bands, request%get_array('levels'), prediction, error)
      if (.not. allocated(error)) call add_room_level(bundle, case, prediction)
   end subroutine answer_room_level

   !> The plate of a floor that radiates into the room below, at the frequencies `frequency`, Hz.
   subroutine answer_radiator(case, request, bundle, error)
      type(case_type), intent(in) :: case
      type(request_type), intent(in) :: request
      type(bundle_type), intent(inout) :: bundle
      !> Set if the floor cannot radiate into the room.
      type(error_type), allocatable, intent(out) :: error
      type(plate_type) :: plate
      real(wp), allocatable :: frequency(:), conductance(:)

      allocate (frequency, source=request%get_array('frequency'))
      allocate (conductance, mold=frequency)
      associate (floor => case%floors(get_floor_number(case))%model)
         call floor%get_radiator(frequency, plate, conductance, error)
      end associate
      if (allocated(error)) return
      associate (air => case%room%air)
         call bundle%add_number('surface_mass', get_surface_mass(plate))
         call bundle%add_number('critical_frequency', get_critical_frequency(plate, air))
         call bundle%add_number('length', plate%length)
         call bundle%add_number('width', plate%width)
         call bundle%add_array('conductance', shape(frequency), conductance)
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
