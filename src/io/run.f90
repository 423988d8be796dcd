!> One run from end to end: case, source model, force history, levels, verdict, files.
module thud_run
   use thud_band, only: band_type, get_octaves, get_thirds, octave_count
   use thud_case, only: case_type, get_case_text, read_case
   use thud_constants, only: version
   use thud_error, only: error_type, input_error
   use thud_file, only: get_file_stem, read_text_file, text_file_type
   use thud_finite_element_options, only: get_frame_count
   use thud_force_exposure, only: get_force_exposure_levels
   use thud_force_history, only: force_history_type
   use thud_free_modes, only: free_modes_type, get_free_modes
   use thud_kinds, only: wp
   use thud_mesh_files, only: estimate_motion_bytes, get_modes_files, get_motion_files, modes_names, &
      motion_names
   use thud_motion, only: motion_type
   use thud_report, only: get_channels_csv, get_force_csv, get_levels_csv, get_summary
   use thud_result_directory, only: check_owner, write_results
   use thud_source_limits, only: conforms, criterion_count, criterion_type, get_criteria, get_peak_count, &
      get_source_limits, source_limits_type
   use thud_source_model, only: solve_model
   use thud_system, only: get_free_bytes
   use thud_table, only: get_modes_table, get_table
   use thud_text, only: newline, to_text
   implicit none (type, external)
   private

   public :: compute_case, load_case, outcome_type, results_type, run_case, store_case

   !> Files of an impact.
   character(len=13), parameter :: file_names(3) = [character(len=13) :: 'force.csv', 'levels.csv', 'summary.nml']

   !> File of models that have more to tell.
   character(len=*), parameter :: channel_file = 'channels.csv'

   !> The full input, which tells whose results a directory holds.
   character(len=*), parameter :: input_file = 'effective.nml'

   !> What a case gives.
   type :: results_type
      !> The force, where an impact is asked for.
      type(force_history_type) :: history
      !> Snapshots, where the model has some.
      type(motion_type) :: motion
      !> Free modes, where they are asked for.
      type(free_modes_type) :: modes
   end type results_type

   !> What a run leaves for its caller.
   type :: outcome_type
      !> Directory that holds the files.
      character(len=:), allocatable :: directory
      !> Table for the screen.
      character(len=:), allocatable :: table
      !> A remark for the user, empty where there is none.
      character(len=:), allocatable :: remark
      !> The source conforms to the limits, or there is no impact to judge.
      logical :: conforms = .true.
   end type outcome_type

contains

   !> Runs a namelist file and writes its results.
   subroutine run_case(path, output, outcome, error)
      !> Path of the namelist file.
      character(len=*), intent(in) :: path
      !> Directory for the results; empty for `outputs/<name of the case>`.
      character(len=*), intent(in) :: output
      !> Table, verdict and place of the results.
      type(outcome_type), intent(out) :: outcome
      !> The run failed; nothing was written.
      type(error_type), allocatable, intent(out) :: error
      type(case_type) :: case
      type(results_type) :: results

      call load_case(path, case, error)
      if (allocated(error)) return
      call store_case(case, output, results, outcome, error)
      if (allocated(error)) then
         error%message = path//': '//error%message
      else if (outcome%remark /= '') then
         outcome%remark = path//': '//outcome%remark
      end if
   end subroutine run_case

   !> Computes a case and writes its results.
   subroutine store_case(case, output, results, outcome, error)
      !> The case.
      type(case_type), intent(in) :: case
      !> Directory for the results; empty for `outputs/<name of the case>`.
      character(len=*), intent(in) :: output
      !> The results.
      type(results_type), intent(out) :: results
      !> Table, verdict and place of the results.
      type(outcome_type), intent(out) :: outcome
      !> The run failed; nothing was written.
      type(error_type), allocatable, intent(out) :: error
      type(text_file_type), allocatable :: files(:)
      type(text_file_type) :: input
      logical :: differs

      input%name = input_file
      input%content = get_case_text(case)
      outcome%directory = output
      if (output == '') outcome%directory = 'outputs/'//trim(case%name)
      outcome%remark = ''
      call check_owner(outcome%directory, input, differs, error)
      if (.not. allocated(error)) call check_space(case, outcome%directory, error)
      if (.not. allocated(error)) call compute_case(case, results, error)
      if (.not. allocated(error)) call describe(case, results, files, outcome, error)
      if (.not. allocated(error)) call write_results(outcome%directory, input, files, differs, error)
      if (allocated(error)) return
      if (differs) outcome%remark = 'replaces the results of another input of the same name in '//outcome%directory
   end subroutine store_case

   !> Complains where snapshots would fill the disk.
   subroutine check_space(case, directory, error)
      !> The case.
      type(case_type), intent(in) :: case
      !> Directory for the results.
      character(len=*), intent(in) :: directory
      !> Names the bytes that are wanted and those that are free.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: wanted, free

      if (.not. case%has_impact .or. case%model /= 'finite_element') return
      associate (options => case%options%finite_element)
         wanted = estimate_motion_bytes(options%mesh%polar_elements, options%mesh%radial_elements, &
            get_frame_count(options, case%sampling))
         free = get_free_bytes(directory)
         if (wanted <= free) return
         error = input_error('&output: snapshot_interval = '//to_text(options%snapshot_interval) &
            //' s makes files of up to '//to_text(wanted)//' bytes, and '//directory//' has room for '//to_text(free) &
            //'; allowed: a longer interval, or 0 for no snapshots')
      end associate
   end subroutine check_space

   !> Computes what a case asks for.
   subroutine compute_case(case, results, error)
      !> The case.
      type(case_type), intent(in) :: case
      !> The results.
      type(results_type), intent(out) :: results
      !> A computation failed.
      type(error_type), allocatable, intent(out) :: error

      if (case%has_modes) call get_free_modes(case%ball, case%options%finite_element%mesh, case%modes%count, results%modes, &
         error)
      if (allocated(error) .or. .not. case%has_impact) return
      call solve_model(trim(case%model), case%options, case%ball, case%drop, case%sampling, results%history, &
         results%motion, error)
   end subroutine compute_case

   !> Table, verdict and files of results.
   subroutine describe(case, results, files, outcome, error)
      !> The case.
      type(case_type), intent(in) :: case
      !> Its results.
      type(results_type), intent(in) :: results
      !> The files: [n_file].
      type(text_file_type), allocatable, intent(out) :: files(:)
      !> Gets table and verdict.
      type(outcome_type), intent(inout) :: outcome
      !> A level cannot be computed.
      type(error_type), allocatable, intent(out) :: error
      type(criterion_type) :: criteria(criterion_count)
      type(band_type), allocatable :: bands(:)
      real(wp), allocatable :: elastic_level(:), floor_level(:)
      integer :: first, at

      allocate (files(count_files(case, results)))
      at = 0
      outcome%table = 'thud '//version//'   case '//trim(case%name)
      if (case%has_impact) outcome%table = outcome%table//'   model '//trim(case%model)
      outcome%table = outcome%table//newline
      if (case%has_modes) then
         call get_modes_files(results%modes, files(at + 1:at + size(modes_names)))
         at = at + size(modes_names)
         outcome%table = outcome%table//newline//get_modes_table(results%modes)
      end if
      if (.not. case%has_impact) return
      associate (history => results%history)
         call judge_case(case, history, bands, elastic_level, floor_level, criteria, error)
         if (allocated(error)) return
         outcome%conforms = all(conforms(criteria))
         outcome%table = outcome%table//newline//get_table(case, history, elastic_level, floor_level, criteria)
         ! The octaves come first and serve the verdict also where only thirds are asked for.
         first = merge(octave_count, 0, case%bands == 'third') + 1
         files(at + 1:at + size(file_names))%name = file_names
         files(at + 1)%content = get_force_csv(history)
         files(at + 2)%content = get_levels_csv(bands(first:), elastic_level(first:), floor_level(first:), criteria, &
            trim(case%level_force))
         files(at + 3)%content = get_summary(case, history, criteria)
         at = at + size(file_names)
         if (allocated(history%channel)) then
            at = at + 1
            files(at)%name = channel_file
            files(at)%content = get_channels_csv(history)
         end if
      end associate
      if (results%motion%n_frame > 0) call get_motion_files(results%motion, files(at + 1:))
   end subroutine describe

   !> Number of files of results.
   pure function count_files(case, results) result(n_file)
      !> The case.
      type(case_type), intent(in) :: case
      !> Its results.
      type(results_type), intent(in) :: results
      !> The number.
      integer :: n_file

      n_file = 0
      if (case%has_modes) n_file = size(modes_names)
      if (.not. case%has_impact) return
      n_file = n_file + size(file_names)
      if (allocated(results%history%channel)) n_file = n_file + 1
      if (results%motion%n_frame > 0) n_file = n_file + results%motion%n_frame + size(motion_names)
   end function count_files

   !> Reads a case from a namelist file.
   subroutine load_case(path, case, error)
      !> Path of the file.
      character(len=*), intent(in) :: path
      !> The case.
      type(case_type), intent(out) :: case
      !> Names file, group, key, value and allowed range.
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: text

      call read_text_file(path, text, error)
      if (.not. allocated(error)) call read_case(text, get_file_stem(path), case, error)
      if (allocated(error)) error%message = path//': '//error%message
   end subroutine load_case

   !> Levels and criteria of a force history.
   subroutine judge_case(case, history, bands, elastic_level, floor_level, criteria, error)
      !> The case.
      type(case_type), intent(in) :: case
      !> Its force history.
      type(force_history_type), intent(in) :: history
      !> The bands, octaves first: [n_band].
      type(band_type), allocatable, intent(out) :: bands(:)
      !> Levels of the elastic force, dB: [n_band].
      real(wp), allocatable, intent(out) :: elastic_level(:)
      !> Levels of the force on the floor, dB: [n_band].
      real(wp), allocatable, intent(out) :: floor_level(:)
      !> The criteria: [n_criterion].
      type(criterion_type), intent(out) :: criteria(:)
      !> A level cannot be computed.
      type(error_type), allocatable, intent(out) :: error
      type(source_limits_type) :: limits
      real(wp) :: levels(octave_count)
      integer :: n_peak

      bands = get_octaves()
      if (case%bands /= 'octave') bands = [get_octaves(), get_thirds()]
      allocate (elastic_level(size(bands)), floor_level(size(bands)))
      call get_force_exposure_levels(history%elastic_force, history%sample_rate, bands, trim(case%level_method), &
         elastic_level, error)
      if (allocated(error)) return
      call get_force_exposure_levels(history%floor_force, history%sample_rate, bands, trim(case%level_method), &
         floor_level, error)
      if (allocated(error)) return
      call get_source_limits(case%source, limits, error)
      if (allocated(error)) return
      if (case%level_force == 'elastic') then
         levels = elastic_level(:octave_count)
         n_peak = get_peak_count(history%elastic_force, history%sample_rate)
      else
         levels = floor_level(:octave_count)
         n_peak = get_peak_count(history%floor_force, history%sample_rate)
      end if
      criteria = get_criteria(limits, levels, history%contact_time, history%restitution, n_peak, case%ball%mass, &
         case%drop%height)
   end subroutine judge_case

end module thud_run
