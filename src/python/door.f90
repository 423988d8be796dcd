!> The flat door for Python: plain arguments, explicit shapes, a status and a message.
!> f2py wraps these procedures and nothing else; they pass on and decide nothing.
!>
!> `status` is 0, or the code of the error whose sentence is in `message`. Procedures marked
!> `threadsafe` let other Python threads run meanwhile; those that make long texts are not, see
!> `thud_text`.
module thud_door
   use thud_band, only: band_type, get_octaves, get_thirds, octave_count, third_count
   use thud_case, only: case_type, describe_keys, get_case_text, read_case
   use thud_constants, only: program_version => version
   use thud_error, only: error_type, input_error
   use thud_force_exposure, only: get_force_exposure_levels
   use thud_force_history, only: force_history_type
   use thud_kinds, only: wp
   use thud_run, only: load_case, outcome_type, run_case, solve_case
   use thud_sampling, only: get_sample_count
   use thud_source_limits, only: conforms, criterion_count, criterion_type, get_criteria, get_peak_count, &
      get_source_limits, source_limits_type
   implicit none (type, external)
   private

   public :: count_peaks, count_samples, effective_case, force_exposure, get_bands, get_version, judge, keys, run, solve

contains

   !> Version of the library.
   subroutine get_version(version)
      !f2py threadsafe
      !> Version, like `0.1.0`.
      character(len=32), intent(out) :: version

      version = program_version
   end subroutine get_version

   !> The commented list of all keys.
   subroutine keys(text)
      !> A namelist file.
      character(len=16384), intent(out) :: text

      text = describe_keys()
   end subroutine keys

   !> The full input of a namelist file.
   subroutine effective_case(path, text, status, message)
      !> Path of the file.
      character(len=*), intent(in) :: path
      !> The case with every key.
      character(len=16384), intent(out) :: text
      !> Code of the error, or 0.
      integer, intent(out) :: status
      !> Sentence of the error.
      character(len=1024), intent(out) :: message
      type(case_type), target :: case
      type(error_type), allocatable :: error

      text = ''
      call load_case(path, case, error)
      if (.not. allocated(error)) text = get_case_text(case)
      call tell(error, status, message)
   end subroutine effective_case

   !> Length of the history of a case.
   subroutine count_samples(text, n_sample, status, message)
      !f2py threadsafe
      !> Text of a namelist file.
      character(len=*), intent(in) :: text
      !> Samples of the record.
      integer, intent(out) :: n_sample
      !> Code of the error, or 0.
      integer, intent(out) :: status
      !> Sentence of the error.
      character(len=1024), intent(out) :: message
      type(case_type), target :: case
      type(error_type), allocatable :: error

      n_sample = 0
      call read_case(text, 'python', case, error)
      if (.not. allocated(error)) n_sample = get_sample_count(case%sampling)
      call tell(error, status, message)
   end subroutine count_samples

   !> Force history of a case.
   subroutine solve(text, n_sample, deflection, velocity, part, channel, elastic_force, floor_force, part_names, &
      channel_names, scalars, status, message)
      !f2py threadsafe
      !> Text of a namelist file.
      character(len=*), intent(in) :: text
      !> Samples of the record, from `count_samples`.
      integer, intent(in) :: n_sample
      !> Deflection, m: [n_sample].
      real(wp), intent(out) :: deflection(n_sample)
      !> Velocity, m/s: [n_sample].
      real(wp), intent(out) :: velocity(n_sample)
      !> Parts of the force, N; columns without a name are zero: [n_sample, 4].
      real(wp), intent(out) :: part(n_sample, 4)
      !> Whatever else the model tells; columns without a name are zero: [n_sample, 12].
      real(wp), intent(out) :: channel(n_sample, 12)
      !> Elastic force, N: [n_sample].
      real(wp), intent(out) :: elastic_force(n_sample)
      !> Force on the floor, N: [n_sample].
      real(wp), intent(out) :: floor_force(n_sample)
      !> Names of the parts, with commas between.
      character(len=512), intent(out) :: part_names
      !> Names of the channels, with commas between; blank where there are none.
      character(len=512), intent(out) :: channel_names
      !> Sample rate, impact velocity, contact time, peak force, peak floor force, largest
      !> deflection, restitution, impulse, residuals of impulse and energy; SI units: [10].
      real(wp), intent(out) :: scalars(10)
      !> Code of the error, or 0.
      integer, intent(out) :: status
      !> Sentence of the error.
      character(len=1024), intent(out) :: message
      type(case_type), target :: case
      type(force_history_type) :: history
      type(error_type), allocatable :: error
      integer :: i

      deflection = 0.0_wp
      velocity = 0.0_wp
      part = 0.0_wp
      elastic_force = 0.0_wp
      floor_force = 0.0_wp
      scalars = 0.0_wp
      part_names = ''
      channel_names = ''
      channel = 0.0_wp
      call read_case(text, 'python', case, error)
      if (.not. allocated(error)) call solve_case(case, history, error)
      if (.not. allocated(error)) then
         if (size(history%deflection) /= n_sample) error = input_error('n_sample is not that of count_samples')
      end if
      call tell(error, status, message)
      if (status /= 0) return
      deflection = history%deflection
      velocity = history%velocity
      part(:, :size(history%part_name)) = history%part
      elastic_force = history%elastic_force
      floor_force = history%floor_force
      do i = 1, size(history%part_name)
         part_names = trim(part_names)//','//history%part_name(i)
      end do
      part_names = part_names(2:)
      if (allocated(history%channel)) then
         channel(:, :size(history%channel_name)) = history%channel
         do i = 1, size(history%channel_name)
            channel_names = trim(channel_names)//','//history%channel_name(i)
         end do
         channel_names = channel_names(2:)
      end if
      scalars = [history%sample_rate, history%impact_velocity, history%contact_time, history%peak_force, &
         history%peak_floor_force, history%max_deflection, history%restitution, history%impulse, &
         history%impulse_residual, history%energy_residual]
   end subroutine solve

   !> Number of bands, edges and mid frequencies.
   subroutine get_bands(bandwidth, n_band, nominal, centre, lower, upper)
      !f2py threadsafe
      !> `octave` or `third`.
      character(len=*), intent(in) :: bandwidth
      !> Number of bands: 15 entries are always written, the first n_band hold.
      integer, intent(out) :: n_band
      !> Rounded mid frequencies, Hz: [15].
      real(wp), intent(out) :: nominal(15)
      !> Exact mid frequencies, Hz: [15].
      real(wp), intent(out) :: centre(15)
      !> Lower edges, Hz: [15].
      real(wp), intent(out) :: lower(15)
      !> Upper edges, Hz: [15].
      real(wp), intent(out) :: upper(15)
      type(band_type), allocatable :: bands(:)

      bands = bands_of(bandwidth)
      n_band = size(bands)
      nominal(:n_band) = bands%nominal
      centre(:n_band) = bands%centre
      lower(:n_band) = bands%lower
      upper(:n_band) = bands%upper
      nominal(n_band + 1:) = 0.0_wp
      centre(n_band + 1:) = 0.0_wp
      lower(n_band + 1:) = 0.0_wp
      upper(n_band + 1:) = 0.0_wp
   end subroutine get_bands

   !> Force exposure levels of any record.
   subroutine force_exposure(force, n_sample, sample_rate, bandwidth, method, n_band, levels, status, message)
      !f2py threadsafe
      !f2py integer, intent(hide), depend(force) :: n_sample = len(force)
      !> Number of samples.
      integer, intent(in) :: n_sample
      !> Force, N: [n_sample].
      real(wp), intent(in) :: force(n_sample)
      !> Samples per second, Hz.
      real(wp), intent(in) :: sample_rate
      !> `octave` or `third`.
      character(len=*), intent(in) :: bandwidth
      !> `exact` or `fft`.
      character(len=*), intent(in) :: method
      !> Number of bands: 5 octaves or 15 thirds.
      integer, intent(in) :: n_band
      !> Levels, dB: [n_band].
      real(wp), intent(out) :: levels(n_band)
      !> Code of the error, or 0.
      integer, intent(out) :: status
      !> Sentence of the error.
      character(len=1024), intent(out) :: message
      type(error_type), allocatable :: error

      levels = 0.0_wp
      call get_force_exposure_levels(force, sample_rate, bands_of(bandwidth), method, levels, error)
      call tell(error, status, message)
   end subroutine force_exposure

   !> Number of peaks of a force.
   subroutine count_peaks(force, n_sample, n_peak)
      !f2py threadsafe
      !f2py integer, intent(hide), depend(force) :: n_sample = len(force)
      !> Number of samples.
      integer, intent(in) :: n_sample
      !> Force, N: [n_sample].
      real(wp), intent(in) :: force(n_sample)
      !> Number of peaks.
      integer, intent(out) :: n_peak

      n_peak = get_peak_count(force)
   end subroutine count_peaks

   !> Criteria of a source and which of them are met.
   subroutine judge(source, levels, contact_time, restitution, n_peak, mass, drop_height, names, units, value, lower, &
      upper, met, status, message)
      !f2py threadsafe
      !> Source whose limits apply.
      character(len=*), intent(in) :: source
      !> Octave levels 31.5 to 500 Hz, dB: [5].
      real(wp), intent(in) :: levels(5)
      !> Contact time, s.
      real(wp), intent(in) :: contact_time
      !> Coefficient of restitution.
      real(wp), intent(in) :: restitution
      !> Number of peaks of the force.
      integer, intent(in) :: n_peak
      !> Mass, kg.
      real(wp), intent(in) :: mass
      !> Height of drop, m.
      real(wp), intent(in) :: drop_height
      !> Names of the criteria, with commas between.
      character(len=512), intent(out) :: names
      !> Units of the criteria, with commas between.
      character(len=512), intent(out) :: units
      !> Values: [10].
      real(wp), intent(out) :: value(10)
      !> Smallest conforming values: [10].
      real(wp), intent(out) :: lower(10)
      !> Largest conforming values: [10].
      real(wp), intent(out) :: upper(10)
      !> 1 where the criterion is met, else 0: [10].
      integer, intent(out) :: met(10)
      !> Code of the error, or 0.
      integer, intent(out) :: status
      !> Sentence of the error.
      character(len=1024), intent(out) :: message
      type(criterion_type) :: criteria(criterion_count)
      type(source_limits_type) :: limits
      type(error_type), allocatable :: error
      integer :: i

      names = ''
      units = ''
      value = 0.0_wp
      lower = 0.0_wp
      upper = 0.0_wp
      met = 0
      call get_source_limits(source, limits, error)
      call tell(error, status, message)
      if (status /= 0) return
      criteria = get_criteria(limits, levels, contact_time, restitution, n_peak, mass, drop_height)
      do i = 1, criterion_count
         names = trim(names)//','//criteria(i)%name
         units = trim(units)//','//criteria(i)%unit
      end do
      names = names(2:)
      units = units(2:)
      value = criteria%value
      lower = criteria%lower
      upper = criteria%upper
      met = merge(1, 0, conforms(criteria))
   end subroutine judge

   !> Runs a namelist file as the executable does.
   subroutine run(path, output, directory, table, remark, conforming, status, message)
      !> Path of the file.
      character(len=*), intent(in) :: path
      !> Output directory, empty for the default.
      character(len=*), intent(in) :: output
      !> Directory of the results.
      character(len=4096), intent(out) :: directory
      !> Table for the screen.
      character(len=8192), intent(out) :: table
      !> A remark for the user, or blanks.
      character(len=4096), intent(out) :: remark
      !> 1 where the source conforms to the limits, else 0.
      integer, intent(out) :: conforming
      !> Code of the error, or 0.
      integer, intent(out) :: status
      !> Sentence of the error.
      character(len=1024), intent(out) :: message
      type(outcome_type) :: outcome
      type(error_type), allocatable :: error

      directory = ''
      table = ''
      remark = ''
      conforming = 0
      call run_case(path, output, outcome, error)
      call tell(error, status, message)
      if (status /= 0) return
      directory = outcome%directory
      table = outcome%table
      remark = outcome%remark
      conforming = merge(1, 0, outcome%conforms)
   end subroutine run

   !> An error as status and message.
   pure subroutine tell(error, status, message)
      !> The error, if any.
      type(error_type), allocatable, intent(in) :: error
      !> Its code, or 0.
      integer, intent(out) :: status
      !> Its sentence, or blanks.
      character(len=*), intent(out) :: message

      status = 0
      message = ''
      if (.not. allocated(error)) return
      status = error%code
      message = error%message
   end subroutine tell

   !> The bands of a width.
   pure function bands_of(bandwidth) result(bands)
      !> `third`, or anything else for octaves; Python has checked it.
      character(len=*), intent(in) :: bandwidth
      !> The bands: [n_band].
      type(band_type), allocatable :: bands(:)

      if (bandwidth == 'third') then
         allocate (bands(third_count), source=get_thirds())
      else
         allocate (bands(octave_count), source=get_octaves())
      end if
   end function bands_of

end module thud_door
