!> The flat API for Python: plain arguments, explicit shapes, a status. f2py wraps these procedures and nothing
!> else; they pass on and decide nothing.
!>
!> Results are self-describing bundles: a procedure leaves one and returns its handle and its sizes; `collect` hands
!> it over and frees it. `status` is 0, or the code of the error whose sentence is the text `message` of the bundle.
!> Procedures marked `threadsafe` let other Python threads run meanwhile.
module thud_api
   use thud_band, only: band_type
   use thud_bundle, only: bundle_type, leave, take
   use thud_case, only: case_type, get_floor_number, get_model_number
   use thud_case_text, only: get_case_text, read_case
   use thud_compression, only: compression_type
   use thud_compute, only: compress_case, compute_case, drop_on_case_floor => drop_on_floor, predict_room_level, results_type
   use thud_constants, only: compiler, version
   use thud_error, only: error_type
   use thud_force_history, only: force_history_type, get_scalars, scalar_fields
   use thud_free_modes, only: free_modes_type
   use thud_kinds, only: int64, int8, wp
   use thud_plate, only: get_critical_frequency, get_plate_radiation, get_surface_mass, get_total_loss, plate_type
   use thud_progress, only: latest_progress
   use thud_progress_line, only: begin_progress, end_progress
   use thud_remarks, only: add_floor_remark, remark_length
   use thud_room, only: get_room_bands, room_level_type
   use thud_run, only: load_case, outcome_type, run_case
   use thud_system, only: begin_call, end_call, end_all_calls => end_calls
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: check_text, collect, compress, describe_library, drop_on_floor, effective_case, end_calls, free_modes
   public :: get_progress, get_radiator, loss_factors, predict_room, run, solve

contains

   !> Hands a bundle over and frees it.
   subroutine collect(handle, n_byte, n_value, bytes, values)
      !f2py threadsafe
      !> Handle of the bundle; it can be used once.
      integer(int64), intent(in) :: handle
      !> Size of its header and its texts; number of its numbers, at least 1.
      integer, intent(in) :: n_byte, n_value
      !> Header, a zero, and texts: [n_byte].
      integer(int8), intent(out) :: bytes(n_byte)
      !> The numbers, in the order of the header: [n_value].
      real(wp), intent(out) :: values(n_value)
      type(bundle_type), pointer :: bundle

      call take(handle, bundle)
      bytes = transfer(bundle%header//achar(0)//bundle%text, bytes)
      call bundle%copy_values(values)
      deallocate (bundle)
   end subroutine collect

   !> Ends the calls that are running in other threads, as an interrupt does.
   subroutine end_calls()

      call end_all_calls()
   end subroutine end_calls

   !> How far the latest long work of this process is.
   subroutine get_progress(done)
      !> Part that is done, 0 to 1.
      real(wp), intent(out) :: done

      done = latest_progress
   end subroutine get_progress

   !> Version and compiler of the library.
   subroutine describe_library(status, handle, n_byte, n_value)
      !f2py threadsafe
      !> Status, handle and sizes as in `leave`.
      integer, intent(out) :: status, n_byte, n_value
      integer(int64), intent(out) :: handle
      type(bundle_type), pointer :: bundle
      type(error_type), allocatable :: error

      allocate (bundle)
      call bundle%add_text('version', version)
      call bundle%add_text('compiler', compiler)
      call leave(bundle, error, status, handle, n_byte, n_value)
   end subroutine describe_library

   !> The full input of a namelist file.
   subroutine effective_case(path, status, handle, n_byte, n_value)
      ! Not threadsafe: functions with deferred-length texts keep the length in static memory.
      character(len=*), intent(in) :: path
      !> Status, handle and sizes as in `leave`.
      integer, intent(out) :: status, n_byte, n_value
      integer(int64), intent(out) :: handle
      type(bundle_type), pointer :: bundle
      type(case_type), target :: case
      type(error_type), allocatable :: error
      character(len=:), allocatable :: text

      allocate (bundle)
      call load_case(path, case, error)
      if (.not. allocated(error)) then
         call get_case_text(case, text)
         call bundle%add_text('case', text)
      end if
      call leave(bundle, error, status, handle, n_byte, n_value)
   end subroutine effective_case

   !> Whether the text of a namelist file is a case.
   subroutine check_text(text, status, handle, n_byte, n_value)
      !f2py threadsafe
      character(len=*), intent(in) :: text
      !> Status, handle and sizes as in `leave`.
      integer, intent(out) :: status, n_byte, n_value
      integer(int64), intent(out) :: handle
      type(bundle_type), pointer :: bundle
      type(case_type), target :: case
      type(error_type), allocatable :: error

      allocate (bundle)
      call read_case(text, 'python', case, error)
      call leave(bundle, error, status, handle, n_byte, n_value)
   end subroutine check_text

   !> The impact of a case.
   subroutine solve(text, status, handle, n_byte, n_value)
      !f2py threadsafe
      !> Text of a namelist file.
      character(len=*), intent(in) :: text
      !> Status, handle and sizes as in `leave`.
      integer, intent(out) :: status, n_byte, n_value
      integer(int64), intent(out) :: handle
      type(bundle_type), pointer :: bundle
      type(case_type), target :: case
      type(results_type) :: results
      type(error_type), allocatable :: error

      allocate (bundle)
      call begin_call()
      call read_case(text, 'python', case, error)
      if (.not. allocated(error)) call compute_case(case, results, error)
      if (.not. allocated(error)) call add_results(bundle, case, results)
      call end_call()
      call leave(bundle, error, status, handle, n_byte, n_value)
   end subroutine solve

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

      allocate (bundle)
      call begin_call()
      call read_case(text, 'python', case, error)
      if (.not. allocated(error)) call drop_on_case_floor(case, on_floor, error)
      if (allocated(on_floor) .and. .not. allocated(error)) call add_history(bundle, 'on_floor.', on_floor)
      call end_call()
      call leave(bundle, error, status, handle, n_byte, n_value)
   end subroutine drop_on_floor

   !> Adds what a case has computed to a bundle.
   subroutine add_results(bundle, case, results)
      type(bundle_type), intent(inout) :: bundle
      type(case_type), intent(in) :: case
      type(results_type), intent(in) :: results
      integer :: i

      if (case%has_impact) call add_history(bundle, '', results%history)
      if (allocated(results%on_floor)) call add_history(bundle, 'on_floor.', results%on_floor)
      if (case%has_modes) call add_modes(bundle, results%modes)
      if (case%has_compression) call add_compression(bundle, results%compression)
      do i = 1, size(results%remark)
         call bundle%add_text('remarks.'//to_text(i), trim(results%remark(i)))
      end do
   end subroutine add_results

   !> Adds a force history to a bundle.
   subroutine add_history(bundle, prefix, history)
      type(bundle_type), intent(inout) :: bundle
      !> What the names of its items begin with.
      character(len=*), intent(in) :: prefix
      type(force_history_type), intent(in) :: history
      real(wp) :: scalars(size(scalar_fields))
      integer :: n(1)
      integer :: i

      n = size(history%deflection)
      scalars = get_scalars(history)
      do i = 1, size(scalars)
         call bundle%add_number(prefix//'scalars.'//scalar_fields(i)%name, scalars(i))
      end do
      do i = 1, size(history%fact)
         call bundle%add_number(prefix//'facts.'//history%fact_name(i), history%fact(i))
      end do
      call bundle%add_array(prefix//'samples.deflection', n, history%deflection)
      call bundle%add_array(prefix//'samples.velocity', n, history%velocity)
      call bundle%add_array(prefix//'samples.elastic_force', n, history%elastic_force)
      call bundle%add_array(prefix//'samples.floor_force', n, history%floor_force)
      if (allocated(history%floor_velocity)) then
         call bundle%add_array(prefix//'floor.floor_displacement', n, history%floor_displacement)
         call bundle%add_array(prefix//'floor.floor_velocity', n, history%floor_velocity)
         call bundle%add_number(prefix//'floor.floor_work', history%floor_work)
      end if
      do i = 1, size(history%part_name)
         call bundle%add_array(prefix//'parts.'//history%part_name(i), n, history%part(:, i))
      end do
      if (allocated(history%channel)) then
         do i = 1, size(history%channel_name)
            call bundle%add_array(prefix//'channels.'//history%channel_name(i), n, history%channel(:, i))
         end do
      end if
      associate (motion => history%motion, n_frame => history%motion%n_frame)
         if (n_frame == 0) return
         call bundle%add_array(prefix//'motion.time', [n_frame], motion%time)
         call bundle%add_array(prefix//'motion.start', shape(motion%start), motion%start)
         call bundle%add_array(prefix//'motion.position', [shape(motion%start), n_frame], motion%position)
         call bundle%add_array(prefix//'motion.velocity', [shape(motion%start), n_frame], motion%velocity)
         call bundle%add_array(prefix//'motion.contact_pressure', [size(motion%start, 1), n_frame], motion%contact_pressure)
         call bundle%add_array(prefix//'motion.contact_shear', [size(motion%start, 1), n_frame], motion%contact_shear)
         call bundle%add_array(prefix//'motion.cavity_pressure', [n_frame], motion%cavity_pressure)
         call bundle%add_array(prefix//'motion.floor_displacement', [n_frame], motion%floor_displacement)
      end associate
   end subroutine add_history

   !> Free modes of the ball of a case.
   subroutine free_modes(text, status, handle, n_byte, n_value)
      ! Not threadsafe: ARPACK keeps its state in static memory.
      !> Text of a namelist file with the group `&modes`.
      character(len=*), intent(in) :: text
      !> Status, handle and sizes as in `leave`.
      integer, intent(out) :: status, n_byte, n_value
      integer(int64), intent(out) :: handle
      type(bundle_type), pointer :: bundle
      type(case_type), target :: case
      type(results_type) :: results
      type(error_type), allocatable :: error

      allocate (bundle)
      call begin_call()
      call read_case(text, 'python', case, error)
      case%has_impact = .false.
      if (.not. allocated(error)) call compute_case(case, results, error)
      if (.not. allocated(error)) call add_results(bundle, case, results)
      call end_call()
      call leave(bundle, error, status, handle, n_byte, n_value)
   end subroutine free_modes

   !> Adds free modes to a bundle.
   subroutine add_modes(bundle, modes)
      type(bundle_type), intent(inout) :: bundle
      type(free_modes_type), intent(in) :: modes

      call bundle%add_array('modes.frequency', shape(modes%frequency), modes%frequency)
      call bundle%add_array('modes.harmonic', shape(modes%harmonic), real(modes%harmonic, wp))
      call bundle%add_array('modes.participation', shape(modes%participation), modes%participation)
      call bundle%add_number('modes.rigid_frequency', modes%rigid_frequency)
      call bundle%add_array('modes.r', shape(modes%mesh%r), modes%mesh%r)
      call bundle%add_array('modes.z', shape(modes%mesh%z), modes%mesh%z)
      call bundle%add_array('modes.shape', shape(modes%shape), modes%shape)
   end subroutine add_modes

   !> Slow compression of the ball of a case.
   subroutine compress(text, status, handle, n_byte, n_value)
      !f2py threadsafe
      !> Text of a namelist file with the group `&compression`.
      character(len=*), intent(in) :: text
      !> Status, handle and sizes as in `leave`.
      integer, intent(out) :: status, n_byte, n_value
      integer(int64), intent(out) :: handle
      type(bundle_type), pointer :: bundle
      type(case_type), target :: case
      type(compression_type) :: compression
      type(error_type), allocatable :: error

      allocate (bundle)
      call begin_call()
      call read_case(text, 'python', case, error)
      if (.not. allocated(error)) call compress_case(case, compression, error)
      if (.not. allocated(error)) call add_compression(bundle, compression)
      call end_call()
      call leave(bundle, error, status, handle, n_byte, n_value)
   end subroutine compress

   !> Adds a slow compression to a bundle.
   subroutine add_compression(bundle, compression)
      type(bundle_type), intent(inout) :: bundle
      type(compression_type), intent(in) :: compression

      call bundle%add_array('compression.deflection', shape(compression%deflection), compression%deflection)
      call bundle%add_array('compression.force', shape(compression%force), compression%force)
   end subroutine add_compression

   !> Loss factor of the material of a case against frequency.
   subroutine loss_factors(text, frequency, n, status, handle, n_byte, n_value)
      !f2py threadsafe
      !f2py integer, intent(hide), depend(frequency) :: n = len(frequency)
      !> Text of a namelist file.
      character(len=*), intent(in) :: text
      !> Number of frequencies.
      integer, intent(in) :: n
      !> Frequencies, Hz: [n].
      real(wp), intent(in) :: frequency(n)
      !> Status, handle and sizes as in `leave`.
      integer, intent(out) :: status, n_byte, n_value
      integer(int64), intent(out) :: handle
      type(bundle_type), pointer :: bundle
      type(case_type), target :: case
      type(error_type), allocatable :: error
      real(wp) :: loss_factor(n)

      allocate (bundle)
      call read_case(text, 'python', case, error)
      if (.not. allocated(error)) then
         associate (model => case%models(get_model_number(case))%model)
            call model%get_loss_factors(case%ball, frequency, loss_factor, error)
         end associate
      end if
      if (.not. allocated(error)) call bundle%add_array('loss_factors', [n], loss_factor)
      call leave(bundle, error, status, handle, n_byte, n_value)
   end subroutine loss_factors

   !> Runs a namelist file as the executable does, and keeps what it has computed.
   subroutine run(path, output, progress, status, handle, n_byte, n_value)
      ! Not threadsafe: functions with deferred-length texts keep the length in static memory.
      !> Path of the file; output directory, empty for the default.
      character(len=*), intent(in) :: path, output
      !> 1 to show progress on a terminal.
      integer, intent(in) :: progress
      !> Status, handle and sizes as in `leave`.
      integer, intent(out) :: status, n_byte, n_value
      integer(int64), intent(out) :: handle
      type(bundle_type), pointer :: bundle
      type(case_type), target :: case
      type(results_type) :: results
      type(outcome_type) :: outcome
      type(error_type), allocatable :: error
      character(len=:), allocatable :: text
      integer :: i

      allocate (bundle)
      call begin_call()
      if (progress == 1) call begin_progress()
      call run_case(path, output, case, results, outcome, error)
      call end_progress()
      if (.not. allocated(error)) then
         call get_case_text(case, text)
         call bundle%add_text('case', text)
         call bundle%add_text('directory', outcome%directory)
         call bundle%add_text('table', outcome%table)
         do i = 1, outcome%n_remark
            call bundle%add_text('run_remarks.'//to_text(i), outcome%remarks(i)%text)
         end do
         call bundle%add_number('conforms', merge(1.0_wp, 0.0_wp, outcome%conforms))
         call add_results(bundle, case, results)
      end if
      call end_call()
      call leave(bundle, error, status, handle, n_byte, n_value)
   end subroutine run

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
      integer :: i

      allocate (bundle)
      call read_case(text, 'python', case, error)
      if (.not. allocated(error)) call get_room_bands(bands, error)
      if (.not. allocated(error)) call predict_room_level(case, bands, level, prediction, error)
      if (.not. allocated(error)) then
         n = n_band
         call bundle%add_number('surface_mass', prediction%surface_mass)
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
         do i = 1, size(remarks)
            call bundle%add_text('remarks.'//to_text(i), trim(remarks(i)))
         end do
      end if
      call leave(bundle, error, status, handle, n_byte, n_value)
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
   end subroutine get_radiator

end module thud_api
