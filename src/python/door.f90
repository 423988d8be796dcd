!> The flat door for Python: plain arguments, explicit shapes, a status and a message.
!> f2py wraps these procedures and nothing else; they pass on and decide nothing.
!>
!> `status` is 0, or the code of the error whose sentence is in `message`. Procedures marked
!> `threadsafe` let other Python threads run meanwhile; those that make long texts are not, see
!> `thud_text`.
module thud_door
   use thud_case, only: case_type, describe_keys, get_case_text, read_case
   use thud_constants, only: program_version => version
   use thud_error, only: error_type, input_error, tell
   use thud_force_history, only: force_history_type
   use thud_kinds, only: wp
   use thud_run, only: load_case, outcome_type, run_case, solve_case
   use thud_sampling, only: get_sample_count
   implicit none (type, external)
   private

   public :: count_samples, effective_case, get_version, keys, run, solve

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

end module thud_door
