!> The flat API for Python: plain arguments, explicit shapes, a status and a message.
!> f2py wraps these procedures and nothing else; they pass on and decide nothing.
!>
!> `status` is 0, or the code of the error whose sentence is in `message`. Procedures marked
!> `threadsafe` let other Python threads run meanwhile; those that make long texts are not, see
!> `thud_text`.
module thud_api
   use thud_case, only: case_type, describe_keys, get_case_text, read_case
   use thud_constants, only: program_compiler => compiler, program_version => version
   use thud_error, only: error_type, get_status
   use thud_finite_element_options, only: get_frame_count
   use thud_kinds, only: wp
   use thud_material, only: get_material_loss_factor, material_type, new_material
   use thud_progress_line, only: begin_progress, end_progress
   use thud_run, only: compute_case, load_case, outcome_type, results_type, run_case
   use thud_sampling, only: get_sample_count
   implicit none (type, external)
   private

   public :: effective_case, free_modes, get_compiler, get_sizes, get_version, keys, loss_factors, run, solve

contains

   !> Version of the library.
   subroutine get_version(version)
      !f2py threadsafe
      !> Version, like `0.1.0`.
      character(len=32), intent(out) :: version

      version = program_version
   end subroutine get_version

   !> What the library was compiled with.
   subroutine get_compiler(compiler)
      !f2py threadsafe
      !> Compiler and its options.
      character(len=2048), intent(out) :: compiler

      compiler = program_compiler
   end subroutine get_compiler

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
      call get_status(error, status, message)
   end subroutine effective_case

   !> Sizes of the results of a case.
   subroutine get_sizes(text, n_sample, n_line, n_ring, n_frame, status, message)
      !f2py threadsafe
      !> Text of a namelist file.
      character(len=*), intent(in) :: text
      !> Samples of the record; 0 without an impact.
      integer, intent(out) :: n_sample
      !> Nodes from pole to pole of the snapshots; 0 without snapshots.
      integer, intent(out) :: n_line
      !> Nodes through the wall of the snapshots.
      integer, intent(out) :: n_ring
      !> Most snapshots.
      integer, intent(out) :: n_frame
      !> Code of the error, or 0.
      integer, intent(out) :: status
      !> Sentence of the error.
      character(len=1024), intent(out) :: message
      type(case_type), target :: case
      type(error_type), allocatable :: error

      n_sample = 0
      n_line = 0
      n_ring = 0
      n_frame = 0
      call read_case(text, 'python', case, error)
      if (.not. allocated(error) .and. case%has_impact) then
         n_sample = get_sample_count(case%sampling)
         if (case%model == 'finite_element') then
            associate (options => case%options%finite_element)
               n_frame = get_frame_count(options, case%sampling)
               if (n_frame > 0) n_line = options%mesh%polar_elements + 1
               if (n_frame > 0) n_ring = options%mesh%radial_elements + 1
            end associate
         end if
      end if
      call get_status(error, status, message)
   end subroutine get_sizes

   !> Results of a case: the force history and the snapshots.
   subroutine solve(text, n_sample, n_line, n_ring, n_frame, deflection, velocity, part, channel, elastic_force, &
      floor_force, fact, part_names, channel_names, fact_names, scalars, n_taken, time, start, position, node_velocity, &
      contact_pressure, cavity_pressure, status, message)
      !f2py threadsafe
      !> Text of a namelist file.
      character(len=*), intent(in) :: text
      !> Samples of the record, from `get_sizes`, as the next three.
      integer, intent(in) :: n_sample
      !> Nodes from pole to pole.
      integer, intent(in) :: n_line
      !> Nodes through the wall.
      integer, intent(in) :: n_ring
      !> Most snapshots.
      integer, intent(in) :: n_frame
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
      !> Numbers that the model chose or found; those without a name are zero: [8].
      real(wp), intent(out) :: fact(8)
      !> Names of the parts, with commas between.
      character(len=512), intent(out) :: part_names
      !> Names of the channels, with commas between; blank where there are none.
      character(len=512), intent(out) :: channel_names
      !> Names of the facts, with commas between; blank where there are none.
      character(len=512), intent(out) :: fact_names
      !> Sample rate, impact velocity, contact time, peak force, peak floor force, largest
      !> deflection, restitution, impulse, residuals of impulse and energy; SI units: [10].
      real(wp), intent(out) :: scalars(10)
      !> Number of snapshots.
      integer, intent(out) :: n_taken
      !> Times of the snapshots, s: [n_frame].
      real(wp), intent(out) :: time(n_frame)
      !> Positions of the nodes before the impact, m: [n_line, n_ring, 2].
      real(wp), intent(out) :: start(n_line, n_ring, 2)
      !> Positions, m: [n_line, n_ring, 2, n_frame].
      real(wp), intent(out) :: position(n_line, n_ring, 2, n_frame)
      !> Velocities, m/s: [n_line, n_ring, 2, n_frame].
      real(wp), intent(out) :: node_velocity(n_line, n_ring, 2, n_frame)
      !> Pressures on the floor, Pa: [n_line, n_frame].
      real(wp), intent(out) :: contact_pressure(n_line, n_frame)
      !> Overpressures of the gas, Pa: [n_frame].
      real(wp), intent(out) :: cavity_pressure(n_frame)
      !> Code of the error, or 0.
      integer, intent(out) :: status
      !> Sentence of the error.
      character(len=1024), intent(out) :: message
      type(case_type), target :: case
      type(results_type) :: results
      type(error_type), allocatable :: error

      deflection = 0.0_wp
      velocity = 0.0_wp
      part = 0.0_wp
      channel = 0.0_wp
      elastic_force = 0.0_wp
      floor_force = 0.0_wp
      fact = 0.0_wp
      part_names = ''
      channel_names = ''
      fact_names = ''
      scalars = 0.0_wp
      n_taken = 0
      time = 0.0_wp
      start = 0.0_wp
      position = 0.0_wp
      node_velocity = 0.0_wp
      contact_pressure = 0.0_wp
      cavity_pressure = 0.0_wp
      call read_case(text, 'python', case, error)
      if (.not. allocated(error)) call compute_case(case, results, error)
      call get_status(error, status, message)
      if (status /= 0 .or. .not. case%has_impact) return
      associate (history => results%history)
         deflection = history%deflection
         velocity = history%velocity
         part(:, :size(history%part_name)) = history%part
         elastic_force = history%elastic_force
         floor_force = history%floor_force
         fact(:size(history%fact)) = history%fact
         call join(history%part_name, part_names)
         call join(history%fact_name, fact_names)
         if (allocated(history%channel)) then
            channel(:, :size(history%channel_name)) = history%channel
            call join(history%channel_name, channel_names)
         end if
         scalars = [history%sample_rate, history%impact_velocity, history%contact_time, history%peak_force, &
            history%peak_floor_force, history%max_deflection, history%restitution, history%impulse, &
            history%impulse_residual, history%energy_residual]
      end associate
      n_taken = results%motion%n_frame
      if (n_taken == 0) return
      time = results%motion%time
      start = results%motion%start
      position = results%motion%position
      node_velocity = results%motion%velocity
      contact_pressure = results%motion%contact_pressure
      cavity_pressure = results%motion%cavity_pressure
   end subroutine solve

   !> Names with commas between.
   pure subroutine join(names, list)
      !> The names: [n].
      character(len=*), intent(in) :: names(:)
      !> The list; blank where there are none.
      character(len=512), intent(out) :: list
      integer :: i

      list = ''
      do i = 1, size(names)
         if (i > 1) list = trim(list)//','
         list = trim(list)//names(i)
      end do
   end subroutine join

   !> Free modes of the ball of a case.
   subroutine free_modes(text, count, n_line, n_ring, frequency, harmonic, participation, rigid_frequency, r, z, shape, &
      status, message)
      ! Not threadsafe: ARPACK keeps its state in static memory.
      !> Text of a namelist file with the group `&modes`.
      character(len=*), intent(in) :: text
      !> Number of modes that it asks for.
      integer, intent(in) :: count
      !> Nodes from pole to pole: twice the elements and one.
      integer, intent(in) :: n_line
      !> Nodes through the wall: twice the elements and one.
      integer, intent(in) :: n_ring
      !> Frequencies, Hz: [count].
      real(wp), intent(out) :: frequency(count)
      !> Harmonics: [count].
      integer, intent(out) :: harmonic(count)
      !> Participations of the lowest point: [count].
      real(wp), intent(out) :: participation(count)
      !> Frequency of the rigid motion, Hz.
      real(wp), intent(out) :: rigid_frequency
      !> Distances of the nodes from the axis, m: [n_line, n_ring].
      real(wp), intent(out) :: r(n_line, n_ring)
      !> Heights of the nodes over the centre, m: [n_line, n_ring].
      real(wp), intent(out) :: z(n_line, n_ring)
      !> Displacements in r and z, the largest of length 1: [2, n_line, n_ring, count].
      real(wp), intent(out) :: shape(2, n_line, n_ring, count)
      !> Code of the error, or 0.
      integer, intent(out) :: status
      !> Sentence of the error.
      character(len=1024), intent(out) :: message
      type(case_type), target :: case
      type(results_type) :: results
      type(error_type), allocatable :: error

      frequency = 0.0_wp
      harmonic = 0
      participation = 0.0_wp
      rigid_frequency = 0.0_wp
      r = 0.0_wp
      z = 0.0_wp
      shape = 0.0_wp
      call read_case(text, 'python', case, error)
      case%has_impact = .false.
      if (.not. allocated(error)) call compute_case(case, results, error)
      call get_status(error, status, message)
      if (status /= 0) return
      frequency = results%modes%frequency
      harmonic = results%modes%harmonic
      participation = results%modes%participation
      rigid_frequency = results%modes%rigid_frequency
      r = results%modes%mesh%r
      z = results%modes%mesh%z
      shape = results%modes%shape
   end subroutine free_modes

   !> Loss factor of the material of a case against frequency.
   subroutine loss_factors(text, frequency, n, loss_factor, status, message)
      !f2py threadsafe
      !f2py integer, intent(hide), depend(frequency) :: n = len(frequency)
      !> Text of a namelist file.
      character(len=*), intent(in) :: text
      !> Number of frequencies.
      integer, intent(in) :: n
      !> Frequencies, Hz: [n].
      real(wp), intent(in) :: frequency(n)
      !> Loss factors: [n].
      real(wp), intent(out) :: loss_factor(n)
      !> Code of the error, or 0.
      integer, intent(out) :: status
      !> Sentence of the error.
      character(len=1024), intent(out) :: message
      type(case_type), target :: case
      type(material_type) :: material
      type(error_type), allocatable :: error
      integer :: i

      loss_factor = 0.0_wp
      call read_case(text, 'python', case, error)
      if (.not. allocated(error)) call new_material(case%options%finite_element%material, case%ball, material, error)
      call get_status(error, status, message)
      if (status /= 0) return
      do i = 1, n
         loss_factor(i) = get_material_loss_factor(material, frequency(i))
      end do
   end subroutine loss_factors

   !> Runs a namelist file as the executable does.
   subroutine run(path, output, progress, directory, table, remark, conforming, status, message)
      !> Path of the file.
      character(len=*), intent(in) :: path
      !> Output directory, empty for the default.
      character(len=*), intent(in) :: output
      !> 1 to show progress on a terminal.
      integer, intent(in) :: progress
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
      if (progress == 1) call begin_progress()
      call run_case(path, output, outcome, error)
      call end_progress()
      call get_status(error, status, message)
      if (status /= 0) return
      directory = outcome%directory
      table = outcome%table
      remark = outcome%remark
      conforming = merge(1, 0, outcome%conforms)
   end subroutine run

end module thud_api
