!> One run from end to end: case, source model, force history, levels, verdict, files.
module thud_run
   use thud_case, only: case_type, get_model_number
   use thud_case_text, only: get_case_text, read_case
   use thud_compute, only: compute_case, is_conforming, judge_case, predict_room, results_type
   use thud_constants, only: version
   use thud_error, only: error_type, input_error
   use thud_file, only: get_file_stem, read_text_file, text_file_type
   use thud_kinds, only: wp
   use thud_mesh_files, only: estimate_motion_bytes, get_modes_files, get_motion_files, modes_names, &
      motion_names
   use thud_report, only: get_channels_csv, get_compression_csv, get_force_csv, get_levels_csv, get_summary
   use thud_result_directory, only: check_owner, write_results
   use thud_room_report, only: get_room_files, get_room_table, room_file_names
   use thud_system, only: get_free_bytes
   use thud_table, only: get_compression_table, get_defaults_line, get_modes_table, get_table
   use thud_text, only: fixed, newline
   implicit none (type, external)
   private

   public :: load_case, outcome_type, replaces, run_case

   !> Files of an impact.
   character(len=13), parameter :: file_names(3) = [character(len=13) :: 'force.csv', 'levels.csv', 'summary.nml']

   !> File of models with channels.
   character(len=*), parameter :: channel_file = 'channels.csv'

   !> File of a slow compression.
   character(len=*), parameter :: compression_file = 'compression.csv'

   !> The full input, which says whose results a directory holds.
   character(len=*), parameter :: input_file = 'effective.nml'

   !> Remark on a directory, which follows.
   character(len=*), parameter :: replaces = 'replaces the results of another input of the same name in '

   !> A remark.
   type :: remark_type
      !> A sentence, with the file that it is about.
      character(len=:), allocatable :: text
   end type remark_type

   !> What a run leaves for its caller.
   type :: outcome_type
      !> Directory that holds the files.
      character(len=:), allocatable :: directory
      !> Table for the screen.
      character(len=:), allocatable :: table
      integer :: n_remark = 0
      !> Remarks for the user: [n_remark].
      type(remark_type), allocatable :: remarks(:)
      !> The source conforms to the limits, or there is no impact to judge.
      logical :: conforms = .true.
   contains
      procedure :: add_remark
   end type outcome_type

contains

   !> Adds a remark.
   subroutine add_remark(self, path, remark)
      class(outcome_type), intent(inout) :: self
      !> The file that it is about; a sentence.
      character(len=*), intent(in) :: path, remark
      type(remark_type), allocatable :: remarks(:)
      integer :: i

      allocate (remarks(self%n_remark + 1))
      do i = 1, self%n_remark
         call move_alloc(self%remarks(i)%text, remarks(i)%text)
      end do
      self%n_remark = self%n_remark + 1
      remarks(self%n_remark)%text = path//': '//remark
      call move_alloc(remarks, self%remarks)
   end subroutine add_remark

   !> Runs a namelist file and writes its results.
   subroutine run_case(path, output, case, results, outcome, error)
      character(len=*), intent(in) :: path
      !> Directory for the results; empty for `outputs/<name of the case>`.
      character(len=*), intent(in) :: output
      type(case_type), target, intent(out) :: case
      type(results_type), intent(out) :: results
      !> Table, verdict and place of the results.
      type(outcome_type), intent(out) :: outcome
      !> The run failed; nothing was written.
      type(error_type), allocatable, intent(out) :: error

      call load_case(path, case, error)
      if (allocated(error)) return
      call store_case(path, case, output, results, outcome, error)
      if (allocated(error)) error%message = path//': '//error%message
   end subroutine run_case

   !> Computes a case and writes its results.
   subroutine store_case(path, case, output, results, outcome, error)
      !> The file of the case.
      character(len=*), intent(in) :: path
      type(case_type), intent(in), target :: case
      !> Directory for the results; empty for `outputs/<name of the case>`.
      character(len=*), intent(in) :: output
      type(results_type), intent(out) :: results
      !> Table, verdict and place of the results.
      type(outcome_type), intent(out) :: outcome
      !> The run failed; nothing was written.
      type(error_type), allocatable, intent(out) :: error
      type(text_file_type), allocatable :: files(:)
      type(text_file_type) :: input
      logical :: differs
      integer :: i

      input%name = input_file
      call get_case_text(case, input%content)
      outcome%directory = output
      if (output == '') outcome%directory = 'outputs/'//trim(case%name)
      call check_owner(outcome%directory, input, differs, error)
      if (.not. allocated(error)) call check_space(case, outcome%directory, error)
      if (.not. allocated(error)) call compute_case(case, results, error)
      if (case%has_impact .and. .not. allocated(error)) call judge_case(case, results%history, results%verdict, error)
      if (case%has_room .and. .not. allocated(error)) then
         if (allocated(results%on_floor)) then
            call predict_room(case, results%on_floor%floor_force, results%on_floor%sample_rate, results%room, error)
         else
            call predict_room(case, results%history%floor_force, results%history%sample_rate, results%room, error)
         end if
      end if
      if (allocated(error)) return
      call describe(case, results, files, outcome)
      call write_results(outcome%directory, input, files, differs, error)
      if (allocated(error)) return
      if (differs) call outcome%add_remark(path, replaces//outcome%directory)
      do i = 1, size(results%remark)
         call outcome%add_remark(path, trim(results%remark(i)))
      end do
   end subroutine store_case

   !> Refuses snapshots that would fill the disk.
   subroutine check_space(case, directory, error)
      type(case_type), intent(in) :: case
      character(len=*), intent(in) :: directory
      !> Names the bytes that are wanted and those that are free.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: wanted, free

      if (.not. case%has_impact) return
      associate (model => case%models(get_model_number(case))%model)
         wanted = estimate_motion_bytes(model%get_snapshot_shape(case%sampling))
      end associate
      free = get_free_bytes(directory)
      if (wanted <= free) return
      error = input_error('&output: the snapshots make files of up to '//fixed(wanted/1.0e6_wp, 1)//' MB, and '//directory &
         //' has space for '//fixed(free/1.0e6_wp, 1)//' MB; allowed: a longer snapshot_interval, or 0 for no snapshots')
   end subroutine check_space

   !> Table, verdict and files of results.
   subroutine describe(case, results, files, outcome)
      type(case_type), intent(in) :: case
      type(results_type), intent(in) :: results
      !> The files: [n_file].
      type(text_file_type), allocatable, intent(out) :: files(:)
      !> Gets table and verdict.
      type(outcome_type), intent(inout) :: outcome
      character(len=:), allocatable :: room_table
      integer :: at

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
      if (.not. case%has_impact) outcome%table = outcome%table//get_defaults_line(case)
      if (.not. case%has_impact) return
      associate (history => results%history, verdict => results%verdict)
         outcome%conforms = is_conforming(case, verdict)
         outcome%table = outcome%table//newline//get_table(case, history, verdict)
         if (case%has_room) then
            call get_room_table(case, results%room, history%contact_time, allocated(results%on_floor), room_table)
            outcome%table = outcome%table//newline//room_table
         end if
         outcome%table = outcome%table//get_defaults_line(case)
         files(at + 1:at + size(file_names))%name = file_names
         files(at + 1)%content = get_force_csv(history)
         files(at + 2)%content = get_levels_csv(case, verdict)
         files(at + 3)%content = get_summary(case, history, verdict, results%remark)
         at = at + size(file_names)
         if (allocated(history%channel)) then
            at = at + 1
            files(at)%name = channel_file
            files(at)%content = get_channels_csv(history)
         end if
      end associate
      if (case%has_room) then
         call get_room_files(results%room, files(at + 1:at + size(room_file_names)))
         at = at + size(room_file_names)
      end if
      if (case%has_compression) then
         at = at + 1
         files(at)%name = compression_file
         files(at)%content = get_compression_csv(results%compression)
         outcome%table = outcome%table//newline//get_compression_table(results%compression)
      end if
      if (results%history%motion%n_frame > 0) call get_motion_files(results%history%motion, files(at + 1:))
   end subroutine describe

   !> Number of files of results.
   pure function count_files(case, results) result(n_file)
      type(case_type), intent(in) :: case
      type(results_type), intent(in) :: results
      integer :: n_file

      n_file = 0
      if (case%has_modes) n_file = size(modes_names)
      if (.not. case%has_impact) return
      n_file = n_file + size(file_names)
      if (allocated(results%history%channel)) n_file = n_file + 1
      if (case%has_room) n_file = n_file + size(room_file_names)
      if (case%has_compression) n_file = n_file + 1
      if (results%history%motion%n_frame > 0) n_file = n_file + results%history%motion%n_frame + size(motion_names)
   end function count_files

   !> Reads a case from a namelist file.
   subroutine load_case(path, case, error, unchecked)
      character(len=*), intent(in) :: path
      type(case_type), intent(out) :: case
      !> Names file, group, key, value and allowed range.
      type(error_type), allocatable, intent(out) :: error
      !> Values may lie outside their ranges (default: they may not).
      logical, intent(in), optional :: unchecked
      character(len=:), allocatable :: text

      call read_text_file(path, text, error)
      if (.not. allocated(error)) call read_case(text, get_file_stem(path), case, error, unchecked)
      if (allocated(error)) error%message = path//': '//error%message
   end subroutine load_case

end module thud_run
