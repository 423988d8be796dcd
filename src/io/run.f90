!> One run from end to end: case, source model, force history, levels, verdict, files.
module thud_run
   use thud_bundle, only: bundle_type
   use thud_case, only: case_type
   use thud_case_text, only: get_case_text, read_case
   use thud_compute, only: compute, is_conforming, results_type, scope_type
   use thud_constants, only: version
   use thud_error, only: error_type, prefix_error
   use thud_note, only: get_sentence
   use thud_record_files, only: get_csv, get_namelist
   use thud_records, only: add_results
   use thud_result_directory, only: add_text, check_target, close_results, open_results, result_directory_type
   use thud_screen_tables, only: get_screen_tables
   use thud_system, only: path_length, read_text_file
   use thud_text, only: newline
   implicit none (type, external)
   private

   public :: load_case, new_directory, outcome_type, run_case, run_options_type

   !> Maximum length of a warning.
   integer, parameter :: message_length = 1200

   !> Groups of results that are files: tables, then histories with all digits.
   integer, parameter :: table_count = 5
   character(len=*), parameter :: files(*) = [character(len=21) :: 'modes', 'levels', 'floor_levels', 'room_levels', &
      'room_octaves', 'force', 'snapshots', 'floor_force', 'floor_snapshots', 'compression', 'model_histories', &
      'floor_model_histories']

   !> Groups of results in `summary.nml`.
   character(len=*), parameter :: summary_groups(*) = [character(len=22) :: 'summary', 'model_quantities', 'warnings', &
      'verdict', 'floor_summary', 'floor_model_quantities', 'room_summary']

   !> What is written where.
   type :: run_options_type
      !> Directory for the results; empty for `outputs/<name of the case>`.
      character(len=:), allocatable :: output
      !> New directory that the caller puts in the place of `output`; empty if the run does.
      character(len=:), allocatable :: folder
      !> Also replace results of another case.
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
   subroutine run_case(path, options, case, records, outcome, error)
      character(len=*), intent(in) :: path
      type(run_options_type), intent(in) :: options
      type(case_type), target, intent(out) :: case
      !> The results; empty before.
      type(bundle_type), intent(inout) :: records
      !> Table, verdict and directory of the results.
      type(outcome_type), intent(out) :: outcome
      !> Set if the run fails; the directory is unchanged then.
      type(error_type), allocatable, intent(out) :: error
      type(result_directory_type) :: directory
      type(results_type) :: results
      character(len=1) :: no_names(0)

      call load_case(path, case, error)
      if (allocated(error)) return
      directory = new_directory(options, 'run', trim(case%name), '')
      directory%inputs = [character(len=path_length) :: path]
      outcome%directory = directory%path
      if (options%folder == '') call check_target(directory, no_names, error)
      ! The default scope is all that the case asks for.
      if (.not. allocated(error)) call compute(case, scope_type(), results, error)
      if (.not. allocated(error)) then
         outcome%warning = get_sentence(results%warning)
         if (case%has_impact) outcome%conforms = is_conforming(case, results%impact%assessment)
         call get_screen_tables(case, results, options%verbose, outcome%table)
         call add_results(records, case, results)
         if (options%folder == '') call open_results(directory, error)
         call write_results(case, records, options%write_all, directory, error)
         if (options%folder == '') call close_results(directory, error)
      end if
      if (allocated(error)) call prefix_error(error, path)
   end subroutine run_case

   !> The directory that a command writes, yet without its inputs.
   function new_directory(options, command, subject, ending) result(directory)
      type(run_options_type), intent(in) :: options
      !> Command; subject, the name of the case; ending of the default directory, `outputs/<subject><ending>`.
      character(len=*), intent(in) :: command, subject, ending
      type(result_directory_type) :: directory

      directory%path = options%output
      if (options%output == '') directory%path = 'outputs/'//subject//ending
      directory%command = command
      directory%subject = subject
      directory%replace = options%replace
      if (options%folder /= '') directory%folder = options%folder
   end function new_directory

   !> Writes the files of results.
   subroutine write_results(case, records, write_all, directory, error)
      type(case_type), intent(in) :: case
      type(bundle_type), intent(in) :: records
      !> Also write additional quantities of the model.
      logical, intent(in) :: write_all
      type(result_directory_type), intent(in) :: directory
      !> Set if an earlier step fails, or a file cannot be written.
      type(error_type), allocatable, intent(inout) :: error
      character(len=:), allocatable :: text, summary
      integer :: i

      ! The input with all defaults filled in.
      call get_case_text(case, text)
      call add_text(directory, 'effective.nml', text, error)
      do i = 1, size(files)
         if (index(files(i), 'model') > 0 .and. .not. write_all) cycle
         call get_csv(records, files(i), i > table_count, text)
         if (text /= '') call add_text(directory, trim(files(i))//'.csv', text, error)
      end do
      if (.not. case%has_impact) return
      summary = '! thud '//version//': results of case '//trim(case%name)//', SI units, levels in dB re 1 N'//newline
      do i = 1, size(summary_groups)
         call get_namelist(records, summary_groups(i), text)
         summary = summary//text
      end do
      call add_text(directory, 'summary.nml', summary, error)
   end subroutine write_results

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
      character(len=:), allocatable :: text
      integer :: dot, slash

      slash = scan(path, '/\', back=.true.)
      dot = index(path, '.', back=.true.)
      ! A name that begins with its only point has no ending.
      if (dot <= slash + 1) dot = len(path) + 1
      call read_text_file(path, text, error)
      if (.not. allocated(error)) call read_case(text, path(slash + 1:dot - 1), case, error, unchecked, path(:slash), &
         room_alone)
      if (allocated(error)) call prefix_error(error, path)
   end subroutine load_case

end module thud_run
