!> One run from end to end: case, source model, force history, levels, verdict, files.
module thud_run
   use thud_ball_files, only: get_modes_csv, get_snapshots_csv
   use thud_case, only: case_type
   use thud_case_text, only: get_case_text, read_case
   use thud_compute, only: compute, is_conforming, results_type, scope_type
   use thud_constants, only: version
   use thud_csv, only: get_history_csv, get_table_csv
   use thud_error, only: error_type, input_error
   use thud_file, only: get_file_stem, read_text_file
   use thud_floor_report, only: get_floor_force_csv, get_floor_levels_csv, get_floor_summary, get_floor_table
   use thud_force_history, only: force_history_type
   use thud_kinds, only: wp
   use thud_report, only: get_model_histories_csv, get_force_csv, get_levels_csv, get_summary
   use thud_result_directory, only: check_target, close_results, new_result_directory, open_results, &
      result_directory_type, write_file
   use thud_room_report, only: get_room_levels_csv, get_room_summary, get_room_table
   use thud_table, only: get_compression_table, get_defaults_lines, get_modes_table, get_table
   use thud_text, only: lower_case, newline
   implicit none (type, external)
   private

   public :: load_case, outcome_type, run_case, run_options_type

   !> Maximum length of a warning.
   integer, parameter :: message_length = 1200

   !> What is written where.
   type :: run_options_type
      !> Directory for the results; empty for `outputs/<name of the case>`.
      character(len=:), allocatable :: output
      !> New directory that the caller puts in the place of `output`; empty if the run does.
      character(len=:), allocatable :: folder
      !> Also replace results of another case or command.
      logical :: replace = .false.
      !> Also write additional quantities of the model; also show numbers of the solver.
      logical :: write_all = .false., verbose = .false.
   end type run_options_type

   !> Outcome of a run for its caller.
   type :: outcome_type
      !> Directory that holds the files.
      character(len=:), allocatable :: directory
      !> Table for the screen.
      character(len=:), allocatable :: table
      !> Warnings for the user: [n_warning].
      character(len=message_length), allocatable :: warning(:)
      !> The source conforms to the limits, or there is no impact to assess.
      logical :: conforms = .true.
   end type outcome_type

contains

   !> Runs a namelist file and writes its results.
   subroutine run_case(path, options, case, results, outcome, error)
      character(len=*), intent(in) :: path
      type(run_options_type), intent(in) :: options
      type(case_type), target, intent(out) :: case
      type(results_type), intent(out) :: results
      !> Table, verdict and directory of the results.
      type(outcome_type), intent(out) :: outcome
      !> Set if the run fails; the directory is unchanged then.
      type(error_type), allocatable, intent(out) :: error
      type(result_directory_type) :: directory
      character(len=1) :: no_names(0)

      call load_case(path, case, error)
      if (allocated(error)) return
      outcome%directory = options%output
      if (options%output == '') outcome%directory = 'outputs/'//trim(case%name)
      directory = new_result_directory(outcome%directory, 'run', trim(case%name), [path], options%replace)
      if (options%folder == '') call check_target(directory, no_names, error)
      ! The default scope is all that the case asks for.
      if (.not. allocated(error)) call compute(case, scope_type(), results, error)
      if (.not. allocated(error)) then
         outcome%warning = results%warning
         if (options%folder == '') then
            call open_results(directory, error)
            call write_results(case, results, options, directory, outcome, error)
            call close_results(directory, error)
         else
            directory%folder = options%folder
            call write_results(case, results, options, directory, outcome, error)
         end if
      end if
      if (allocated(error)) error%message = path//': '//error%message
   end subroutine run_case

   !> Writes the files of results, and makes table and verdict.
   subroutine write_results(case, results, options, directory, outcome, error)
      type(case_type), intent(in) :: case
      type(results_type), intent(in) :: results
      type(run_options_type), intent(in) :: options
      type(result_directory_type), intent(inout) :: directory
      !> The outcome; table and verdict are set.
      type(outcome_type), intent(inout) :: outcome
      !> Set if an earlier step fails, or a file cannot be written.
      type(error_type), allocatable, intent(inout) :: error
      character(len=:), allocatable :: text, summary
      character(len=1) :: no_names(0)
      real(wp) :: no_values(0)

      outcome%table = 'thud '//version//'   case '//trim(case%name)
      if (case%has_impact) outcome%table = outcome%table//'   model '//trim(case%model)
      outcome%table = outcome%table//newline
      ! The input with all defaults filled in.
      call get_case_text(case, text)
      call write_file(directory, 'effective.nml', text, error)
      if (case%has_modes) then
         call get_modes_csv(results%modes, text)
         call write_file(directory, 'modes.csv', text, error)
         outcome%table = outcome%table//newline//get_modes_table(results%modes)
      end if
      ! A case without an impact has free modes alone: neither floor nor room nor compression.
      if (.not. case%has_impact) then
         outcome%table = outcome%table//get_defaults_lines(case)
         return
      end if
      outcome%conforms = is_conforming(case, results%impact%assessment)
      outcome%table = outcome%table//newline//get_table(case, results%impact%history, &
         results%impact%assessment, options%verbose)
      call write_file(directory, 'force.csv', get_force_csv(results%impact%history, no_names, reshape(no_values, &
         [size(results%impact%history%deflection), 0])), error)
      call write_file(directory, 'levels.csv', get_levels_csv(case, results%impact%assessment), error)
      summary = get_summary(case, results%impact%history, results%impact%assessment, results%warning)
      call write_history_files(results%impact%history, '', options%write_all, directory, error)
      if (allocated(results%on_floor)) then
         call get_floor_table(case, results%impact, results%on_floor, results%floor, text)
         outcome%table = outcome%table//newline//text
         call get_floor_force_csv(results%impact%history, results%on_floor, results%floor, text)
         call write_file(directory, 'floor_force.csv', text, error)
         call get_floor_levels_csv(results%impact, results%floor, text)
         call write_file(directory, 'floor_levels.csv', text, error)
         call get_floor_summary(results%on_floor, text)
         summary = summary//text
         call write_history_files(results%on_floor, 'floor_', options%write_all, directory, error)
      end if
      if (case%has_room) summary = summary//get_room_summary(case, results%room)
      call write_file(directory, 'summary.nml', summary, error)
      if (case%has_room) then
         call get_room_table(case, results%room, results%impact%history%contact_time, allocated(results%on_floor), text)
         outcome%table = outcome%table//newline//text
         call get_room_levels_csv(results%room, text)
         call write_file(directory, 'room_levels.csv', text, error)
         call write_file(directory, 'room_octaves.csv', get_table_csv('nominal_Hz,level_dB', &
            reshape([results%room%octaves%nominal, results%room%octave_level], [size(results%room%octaves), 2])), error)
      end if
      outcome%table = outcome%table//get_defaults_lines(case)
      if (case%has_compression) then
         call write_file(directory, 'compression.csv', get_history_csv('deflection_m,force_N', &
            results%compression%deflection, reshape(results%compression%force, [size(results%compression%force), 1])), error)
         outcome%table = outcome%table//newline//get_compression_table(results%compression)
      end if
   end subroutine write_results

   !> Writes the files with additional quantities and snapshots, if a history has them.
   subroutine write_history_files(history, prefix, write_all, directory, error)
      type(force_history_type), intent(in) :: history
      !> Prefix of the file names.
      character(len=*), intent(in) :: prefix
      !> Write additional quantities of the model.
      logical, intent(in) :: write_all
      type(result_directory_type), intent(inout) :: directory
      !> Set if an earlier step fails, or a file cannot be written.
      type(error_type), allocatable, intent(inout) :: error
      character(len=:), allocatable :: text

      if (write_all .and. allocated(history%model_history)) call write_file(directory, prefix//'model_histories.csv', &
         get_model_histories_csv(history), error)
      if (.not. allocated(history%motion)) return
      call get_snapshots_csv(history%motion, text)
      call write_file(directory, prefix//'snapshots.csv', text, error)
   end subroutine write_history_files

   !> Reads a case from a namelist file.
   subroutine load_case(path, case, error, unchecked, room_alone)
      character(len=*), intent(in) :: path
      type(case_type), intent(out) :: case
      !> Set if the file is not a valid case.
      type(error_type), allocatable, intent(out) :: error
      !> Skip the check of ranges and of the case as a whole (default: false).
      logical, intent(in), optional :: unchecked
      !> Allow a room without a floor (default: false).
      logical, intent(in), optional :: room_alone
      ! Endings of recordings and studies, which the driver reads.
      character(len=*), parameter :: other_endings = '.wav.flac.tdms.h5.hdf5.mat.uff.unv.csv.lvm.toml.'
      character(len=:), allocatable :: text
      integer :: dot

      dot = max(1, index(path, '.', back=.true.))
      if (path(dot:dot) == '.' .and. index(other_endings, lower_case(path(dot:))//'.') > 0) then
         error = input_error('this is no namelist file; allowed: a namelist file; thud-driver measure reads recordings,'// &
            ' thud-driver fit, sweep and other studies read TOML')
      else
         call read_text_file(path, text, error)
      end if
      if (.not. allocated(error)) call read_case(text, get_file_stem(path), case, error, unchecked, &
         path(:index(path, '/', back=.true.)), room_alone)
      if (allocated(error)) error = input_error(path//': '//error%message)
   end subroutine load_case

end module thud_run
