!> One run from end to end: case, source model, force history, levels, verdict, files.
module thud_run
   use thud_ball_files, only: estimate_snapshot_bytes, get_modes_csv, get_snapshots_csv
   use thud_case, only: case_type, get_model_number
   use thud_case_text, only: get_case_text, read_case
   use thud_compute, only: compute, is_conforming, results_type, scope_type
   use thud_constants, only: version
   use thud_csv, only: get_history_csv
   use thud_error, only: error_type, input_error
   use thud_file, only: get_file_stem, read_text_file, text_file_type
   use thud_floor_report, only: get_floor_force_csv, get_floor_levels_csv, get_floor_summary, get_floor_table
   use thud_force_history, only: force_history_type
   use thud_kinds, only: wp
   use thud_report, only: get_model_histories_csv, get_force_csv, get_levels_csv, get_summary
   use thud_result_directory, only: check_target, close_results, new_result_directory, open_results, &
      result_directory_type, write_file
   use thud_room_report, only: get_room_files, get_room_summary, get_room_table, room_file_names
   use thud_system, only: get_free_bytes
   use thud_table, only: get_compression_table, get_defaults_lines, get_modes_table, get_table
   use thud_text, only: fixed, lower_case, newline
   implicit none (type, external)
   private

   public :: load_case, outcome_type, run_case, run_options_type

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

   !> A warning or a note.
   type :: message_type
      !> Text, beginning with the file concerned.
      character(len=:), allocatable :: text
   end type message_type

   !> Outcome of a run for its caller.
   type :: outcome_type
      !> Directory that holds the files.
      character(len=:), allocatable :: directory
      !> Table for the screen.
      character(len=:), allocatable :: table
      integer :: n_message = 0
      !> Warnings and notes for the user: [n_message].
      type(message_type), allocatable :: messages(:)
      !> The source conforms to the limits, or there is no impact to assess.
      logical :: conforms = .true.
   contains
      procedure :: add_message
   end type outcome_type

contains

   !> Adds a warning or a note.
   subroutine add_message(self, path, text)
      class(outcome_type), intent(inout) :: self
      !> The file concerned; the message.
      character(len=*), intent(in) :: path, text
      type(message_type), allocatable :: messages(:)
      integer :: i

      allocate (messages(self%n_message + 1))
      do i = 1, self%n_message
         call move_alloc(self%messages(i)%text, messages(i)%text)
      end do
      self%n_message = self%n_message + 1
      messages(self%n_message)%text = path//': '//text
      call move_alloc(messages, self%messages)
   end subroutine add_message

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

      call load_case(path, case, error)
      if (allocated(error)) return
      call compute_and_write(path, case, options, results, outcome, error)
      if (allocated(error)) error%message = path//': '//error%message
   end subroutine run_case

   !> Computes a case and writes its results.
   subroutine compute_and_write(path, case, options, results, outcome, error)
      !> The file of the case.
      character(len=*), intent(in) :: path
      type(case_type), intent(in), target :: case
      type(run_options_type), intent(in) :: options
      type(results_type), intent(out) :: results
      !> Table, verdict and directory of the results.
      type(outcome_type), intent(out) :: outcome
      !> Set if the run fails; the directory is unchanged then.
      type(error_type), allocatable, intent(out) :: error
      type(text_file_type), allocatable :: files(:)
      type(result_directory_type) :: directory
      character(len=1) :: no_names(0)
      logical :: opens
      integer :: i

      outcome%directory = options%output
      if (options%output == '') outcome%directory = 'outputs/'//trim(case%name)
      directory = new_result_directory(outcome%directory, 'run', trim(case%name), [path], options%replace)
      opens = options%folder == ''
      if (.not. opens) directory%folder = options%folder
      if (opens) call check_target(directory, no_names, error)
      if (.not. allocated(error)) call check_space(case, outcome%directory, error)
      ! The default scope is all that the case asks for.
      if (.not. allocated(error)) call compute(case, scope_type(), results, error)
      if (allocated(error)) return
      call format_results(case, results, options%write_all, options%verbose, files, outcome)
      if (opens) call open_results(directory, error)
      do i = 1, size(files)
         call write_file(directory, files(i)%name, files(i)%content, error)
      end do
      if (opens) call close_results(directory, error)
      if (allocated(error)) return
      do i = 1, size(results%warning)
         call outcome%add_message(path, trim(results%warning(i)))
      end do
   end subroutine compute_and_write

   !> Returns an error if snapshots would fill the disk.
   subroutine check_space(case, directory, error)
      type(case_type), intent(in) :: case
      character(len=*), intent(in) :: directory
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: wanted, free

      if (.not. case%has_impact) return
      associate (model => case%models(get_model_number(case))%model)
         wanted = estimate_snapshot_bytes(model%get_snapshot_shape(case%ball, case%sampling))
      end associate
      ! The drop on a mobile floor has snapshots, too.
      if (case%has_floor) wanted = 2*wanted
      free = get_free_bytes(directory)
      if (wanted <= free) return
      error = input_error('&output: the snapshots make files of up to '//fixed(wanted/1.0e6_wp, 1)//' MB, and '//directory &
         //' has space for '//fixed(free/1.0e6_wp, 1)//' MB; allowed: a longer snapshot_interval, or 0 for no snapshots')
   end subroutine check_space

   !> Makes table, verdict and files from results.
   subroutine format_results(case, results, write_all, verbose, files, outcome)
      type(case_type), intent(in) :: case
      type(results_type), intent(in) :: results
      !> Also write additional quantities of the model; also show numbers of the solver.
      logical, intent(in) :: write_all, verbose
      !> The files: [n_file].
      type(text_file_type), allocatable, intent(out) :: files(:)
      !> The outcome; table and verdict are set.
      type(outcome_type), intent(inout) :: outcome
      character(len=:), allocatable :: text, summary

      outcome%table = 'thud '//version//'   case '//trim(case%name)
      if (case%has_impact) outcome%table = outcome%table//'   model '//trim(case%model)
      outcome%table = outcome%table//newline
      allocate (files(0))
      ! The input with all defaults filled in.
      call get_case_text(case, text)
      call add_file(files, 'effective.nml', text)
      if (case%has_modes) then
         call get_modes_csv(results%modes, text)
         call add_file(files, 'modes.csv', text)
         outcome%table = outcome%table//newline//get_modes_table(results%modes)
      end if
      ! A case without an impact has free modes alone: neither floor nor room nor compression.
      if (.not. case%has_impact) then
         outcome%table = outcome%table//get_defaults_lines(case)
         return
      end if
      outcome%conforms = is_conforming(case, results%impact%assessment)
      outcome%table = outcome%table//newline//get_table(case, results%impact%history, &
         results%impact%assessment, verbose)
      call add_file(files, 'force.csv', get_force_csv(results%impact%history))
      call add_file(files, 'levels.csv', get_levels_csv(case, results%impact%assessment))
      summary = get_summary(case, results%impact%history, results%impact%assessment, results%warning)
      call add_history_files(results%impact%history, '', write_all, files)
      if (allocated(results%on_floor)) then
         call get_floor_table(case, results%impact, results%on_floor, results%floor, text)
         outcome%table = outcome%table//newline//text
         call get_floor_force_csv(results%impact%history, results%on_floor, results%floor, text)
         call add_file(files, 'floor_force.csv', text)
         call get_floor_levels_csv(results%impact, results%floor, text)
         call add_file(files, 'floor_levels.csv', text)
         call get_floor_summary(results%on_floor, text)
         summary = summary//text
         call add_history_files(results%on_floor, 'floor_', write_all, files)
      end if
      if (case%has_room) summary = summary//get_room_summary(case, results%room)
      call add_file(files, 'summary.nml', summary)
      if (case%has_room) then
         call get_room_table(case, results%room, results%impact%history%contact_time, allocated(results%on_floor), text)
         outcome%table = outcome%table//newline//text
         call extend(files, size(room_file_names))
         call get_room_files(results%room, files(size(files) - size(room_file_names) + 1:))
      end if
      outcome%table = outcome%table//get_defaults_lines(case)
      if (case%has_compression) then
         call add_file(files, 'compression.csv', get_history_csv('deflection_m,force_N', &
            results%compression%deflection, reshape(results%compression%force, [size(results%compression%force), 1])))
         outcome%table = outcome%table//newline//get_compression_table(results%compression)
      end if
   end subroutine format_results

   !> Adds the files with additional quantities and snapshots, if a history has them.
   subroutine add_history_files(history, prefix, write_all, files)
      type(force_history_type), intent(in) :: history
      !> Prefix of the file names.
      character(len=*), intent(in) :: prefix
      !> Write additional quantities of the model.
      logical, intent(in) :: write_all
      !> The files: [n_file].
      type(text_file_type), allocatable, intent(inout) :: files(:)
      character(len=:), allocatable :: text

      if (write_all .and. allocated(history%model_history)) call add_file(files, prefix//'model_histories.csv', &
         get_model_histories_csv(history))
      if (.not. allocated(history%motion)) return
      call get_snapshots_csv(history%motion, text)
      call add_file(files, prefix//'snapshots.csv', text)
   end subroutine add_history_files

   !> Adds a file.
   subroutine add_file(files, name, content)
      !> The files: [n_file].
      type(text_file_type), allocatable, intent(inout) :: files(:)
      character(len=*), intent(in) :: name, content

      call extend(files, 1)
      files(size(files))%name = name
      files(size(files))%content = content
   end subroutine add_file

   !> Extends the list by empty files.
   subroutine extend(files, count)
      !> The files: [n_file].
      type(text_file_type), allocatable, intent(inout) :: files(:)
      integer, intent(in) :: count
      type(text_file_type), allocatable :: more(:)
      integer :: i

      allocate (more(size(files) + count))
      do i = 1, size(files)
         more(i)%name = files(i)%name
         call move_alloc(files(i)%content, more(i)%content)
      end do
      call move_alloc(more, files)
   end subroutine extend

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
