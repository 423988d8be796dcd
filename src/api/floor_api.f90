!> The flat API for Python to floors and the rooms below them; see `thud_api`.
module thud_floor_api
   use thud_band, only: band_type, find_bands
   use thud_bundle, only: bundle_type, leave
   use thud_case, only: case_type, get_floor_number
   use thud_case_text, only: read_case
   use thud_compute, only: drop_on_case_floor => drop_on_floor, predict_room_level
   use thud_error, only: error_type
   use thud_floor_result, only: get_point_velocity
   use thud_force_history, only: force_history_type
   use thud_injected_energy, only: get_injected_energies, get_mean_conductances
   use thud_kinds, only: int64, wp
   use thud_plate, only: get_critical_frequency, get_plate_radiation, get_surface_mass, get_total_loss, plate_type
   use thud_receiver, only: get_mobility, receiver_type
   use thud_remarks, only: add_floor_remark, remark_length
   use thud_result_bundle, only: add_history, add_remarks
   use thud_room, only: few_modes, get_room_bands, room_level_type
   use thud_system, only: begin_call, end_call
   implicit none (type, external)
   private

   public :: drop_on_floor, floor_energies, floor_mobility, get_radiator, point_velocity, predict_room

contains

   !> Mobility of the floor of a case, under the source or from there to a point.
   subroutine floor_mobility(text, frequency, n, to_point, x, y, status, handle, n_byte, n_value)
      !f2py threadsafe
      !f2py integer, intent(hide), depend(frequency) :: n = len(frequency)
      !> Text of a namelist file with the group `&floor`.
      character(len=*), intent(in) :: text
      !> Number of frequencies.
      integer, intent(in) :: n
      !> Frequencies, Hz: [n].
      real(wp), intent(in) :: frequency(n)
      !> 1 for the velocity of a point.
      integer, intent(in) :: to_point
      !> Place of the point, m.
      real(wp), intent(in) :: x, y
      !> Status, handle and sizes as in `leave`.
      integer, intent(out) :: status, n_byte, n_value
      integer(int64), intent(out) :: handle
      type(bundle_type), pointer :: bundle
      type(case_type), target :: case
      type(receiver_type) :: receiver
      type(error_type), allocatable :: error
      complex(wp) :: mobility(n)

      call begin_call()
      allocate (bundle)
      call read_case(text, 'python', case, error)
      if (.not. allocated(error)) then
         associate (floor => case%floors(get_floor_number(case))%model)
            if (to_point == 1) then
               call floor%get_transfer(x, y, receiver, error)
            else
               call floor%get_receiver(receiver, error)
            end if
         end associate
      end if
      if (.not. allocated(error)) then
         mobility = get_mobility(receiver, frequency)
         call bundle%add_array('real', [n], real(mobility, wp))
         call bundle%add_array('imaginary', [n], aimag(mobility))
      end if
      call leave(bundle, error, status, handle, n_byte, n_value)
      call end_call()
   end subroutine floor_mobility

   !> Energy that a force gives to the floor of a case, by bands.
   subroutine floor_energies(text, set, force, velocity, n, sample_rate, status, handle, n_byte, n_value)
      !f2py threadsafe
      !f2py integer, intent(hide), depend(force) :: n = len(force)
      !> Text of a namelist file with the group `&floor`; set of bands.
      character(len=*), intent(in) :: text, set
      !> Number of samples.
      integer, intent(in) :: n
      !> Force on the floor, N, and velocity of the floor, m/s: [n].
      real(wp), intent(in) :: force(n), velocity(n)
      !> Samples per second, Hz.
      real(wp), intent(in) :: sample_rate
      !> Status, handle and sizes as in `leave`.
      integer, intent(out) :: status, n_byte, n_value
      integer(int64), intent(out) :: handle
      type(bundle_type), pointer :: bundle
      type(case_type), target :: case
      type(receiver_type) :: receiver
      type(band_type), allocatable :: bands(:)
      type(error_type), allocatable :: error
      real(wp), allocatable :: by_motion(:), by_mobility(:)

      call begin_call()
      allocate (bundle)
      call read_case(text, 'python', case, error)
      if (.not. allocated(error)) call find_bands(set, bands, error)
      if (.not. allocated(error)) then
         associate (floor => case%floors(get_floor_number(case))%model)
            call floor%get_receiver(receiver, error)
         end associate
      end if
      if (.not. allocated(error)) then
         allocate (by_motion(size(bands)), by_mobility(size(bands)))
         call get_injected_energies(receiver, force, velocity, sample_rate, bands, by_motion, by_mobility, error)
      end if
      if (.not. allocated(error)) then
         call bundle%add_array('frequency', shape(bands), bands%nominal)
         call bundle%add_array('by_motion', shape(bands), by_motion)
         call bundle%add_array('by_mobility', shape(bands), by_mobility)
         call bundle%add_array('conductance', shape(bands), get_mean_conductances(receiver, bands))
      end if
      call leave(bundle, error, status, handle, n_byte, n_value)
      call end_call()
   end subroutine floor_energies

   !> Velocity of a point of the floor of a case.
   subroutine point_velocity(text, force, n, sample_rate, x, y, status, handle, n_byte, n_value)
      !f2py threadsafe
      !f2py integer, intent(hide), depend(force) :: n = len(force)
      !> Text of a namelist file with the group `&floor`.
      character(len=*), intent(in) :: text
      !> Number of samples.
      integer, intent(in) :: n
      !> Force on the floor, N: [n].
      real(wp), intent(in) :: force(n)
      !> Samples per second, Hz; place of the point, m.
      real(wp), intent(in) :: sample_rate, x, y
      !> Status, handle and sizes as in `leave`.
      integer, intent(out) :: status, n_byte, n_value
      integer(int64), intent(out) :: handle
      type(bundle_type), pointer :: bundle
      type(case_type), target :: case
      type(error_type), allocatable :: error
      real(wp) :: velocity(n)

      call begin_call()
      allocate (bundle)
      call read_case(text, 'python', case, error)
      if (.not. allocated(error)) then
         associate (floor => case%floors(get_floor_number(case))%model)
            call get_point_velocity(floor, force, sample_rate, x, y, velocity, error)
         end associate
      end if
      if (.not. allocated(error)) call bundle%add_array('velocity', [n], velocity)
      call leave(bundle, error, status, handle, n_byte, n_value)
      call end_call()
   end subroutine point_velocity

   !> The impact of a case on its floor alone.
   subroutine drop_on_floor(text, status, handle, n_byte, n_value)
      !f2py threadsafe
      !> Text of a namelist file with the group `&floor`.
      character(len=*), intent(in) :: text
      !> Status, handle and sizes as in `leave`; the bundle is empty where the force is the blocked one.
      integer, intent(out) :: status, n_byte, n_value
      integer(int64), intent(out) :: handle
      type(bundle_type), pointer :: bundle
      type(case_type), target :: case
      type(force_history_type), allocatable :: on_floor
      type(error_type), allocatable :: error

      call begin_call()
      allocate (bundle)
      call read_case(text, 'python', case, error)
      if (.not. allocated(error)) call drop_on_case_floor(case, on_floor, error)
      if (allocated(on_floor) .and. .not. allocated(error)) call add_history(bundle, 'on_floor.', on_floor)
      call leave(bundle, error, status, handle, n_byte, n_value)
      call end_call()
   end subroutine drop_on_floor

   !> Level that a force causes in the room below.
   subroutine predict_room(text, level, n_band, status, handle, n_byte, n_value)
      !f2py threadsafe
      !f2py integer, intent(hide), depend(level) :: n_band = len(level)
      !> Text of a namelist file with floor and room.
      character(len=*), intent(in) :: text
      integer, intent(in) :: n_band
      !> Force exposure levels of the thirds that a rating is made of, see `get_rated`, dB: [n_band].
      real(wp), intent(in) :: level(n_band)
      !> Status, handle and sizes as in `leave`.
      integer, intent(out) :: status, n_byte, n_value
      integer(int64), intent(out) :: handle
      type(bundle_type), pointer :: bundle
      type(case_type), target :: case
      type(room_level_type) :: prediction
      type(band_type), allocatable :: bands(:)
      character(len=remark_length), allocatable :: remarks(:)
      type(error_type), allocatable :: error
      integer :: n(1)

      call begin_call()
      allocate (bundle)
      call read_case(text, 'python', case, error)
      if (.not. allocated(error)) call get_room_bands(bands, error)
      if (.not. allocated(error)) call predict_room_level(case, bands, level, prediction, error)
      if (.not. allocated(error)) then
         n = n_band
         call bundle%add_number('surface_mass', prediction%surface_mass)
         call bundle%add_number('few_modes', few_modes)
         call bundle%add_array('bands.conductance', n, prediction%conductance)
         call bundle%add_array('bands.frequency', n, prediction%bands%nominal)
         call bundle%add_array('bands.energy', n, prediction%energy)
         call bundle%add_array('bands.radiation_factor', n, prediction%radiation_factor)
         call bundle%add_array('bands.loss_factor', n, prediction%loss_factor)
         call bundle%add_array('bands.reverberation_time', n, prediction%reverberation_time)
         call bundle%add_array('bands.floor_modes', n, prediction%floor_modes)
         call bundle%add_array('bands.room_modes', n, prediction%room_modes)
         call bundle%add_array('bands.level', n, prediction%level)
         call bundle%add_array('bands.time', n, prediction%time)
         call bundle%add_array('bands.spread', n, prediction%spread)
         call bundle%add_array('octaves.frequency', shape(prediction%octave_level), prediction%octaves%nominal)
         call bundle%add_array('octaves.level', shape(prediction%octave_level), prediction%octave_level)
         call bundle%add_array('octaves.time', shape(prediction%octave_level), prediction%octave_time)
         call bundle%add_array('history.time', shape(prediction%history_time), prediction%history_time)
         call bundle%add_array('history.level', shape(prediction%history), prediction%history)
         allocate (remarks(0))
         call add_floor_remark(case, remarks)
         call add_remarks(bundle, remarks)
      end if
      call leave(bundle, error, status, handle, n_byte, n_value)
      call end_call()
   end subroutine predict_room

   !> The plate of a floor that radiates into the room below, at some frequencies.
   subroutine get_radiator(text, frequency, n_frequency, status, handle, n_byte, n_value)
      !f2py threadsafe
      !f2py integer, intent(hide), depend(frequency) :: n_frequency = len(frequency)
      !> Text of a namelist file with floor and room.
      character(len=*), intent(in) :: text
      integer, intent(in) :: n_frequency
      !> Frequencies, Hz: [n_frequency].
      real(wp), intent(in) :: frequency(n_frequency)
      !> Status, handle and sizes as in `leave`.
      integer, intent(out) :: status, n_byte, n_value
      integer(int64), intent(out) :: handle
      type(bundle_type), pointer :: bundle
      type(case_type), target :: case
      type(plate_type) :: plate
      type(error_type), allocatable :: error
      real(wp) :: conductance(n_frequency)
      integer :: n(1)

      call begin_call()
      allocate (bundle)
      call read_case(text, 'python', case, error)
      if (.not. allocated(error)) then
         associate (floor => case%floors(get_floor_number(case))%model)
            call floor%get_radiator(frequency, plate, conductance, error)
         end associate
      end if
      if (.not. allocated(error)) then
         n = n_frequency
         associate (air => case%room%air)
            call bundle%add_number('surface_mass', get_surface_mass(plate))
            call bundle%add_number('critical_frequency', get_critical_frequency(plate, air))
            call bundle%add_number('length', plate%length)
            call bundle%add_number('width', plate%width)
            call bundle%add_array('conductance', n, conductance)
            call bundle%add_array('loss_factor', n, get_total_loss(plate, air, frequency))
            call bundle%add_array('radiation_factor', n, get_plate_radiation(plate, air, frequency))
         end associate
      end if
      call leave(bundle, error, status, handle, n_byte, n_value)
      call end_call()
   end subroutine get_radiator

end module thud_floor_api
