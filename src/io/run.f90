!> One run from end to end: case, source model, force history, levels, verdict, files.
module thud_run
   use thud_band, only: band_type, get_octaves, get_thirds, octave_count
   use thud_case, only: case_type, get_case_text, read_case
   use thud_error, only: error_type
   use thud_file, only: check_owner, get_file_stem, read_text_file, text_file_type, &
      write_files
   use thud_force_exposure, only: get_force_exposure_levels
   use thud_force_history, only: force_history_type
   use thud_kinds, only: wp
   use thud_posix, only: remove_file
   use thud_report, only: get_channels_csv, get_force_csv, get_levels_csv, get_summary, get_table
   use thud_source_limits, only: conforms, criterion_count, criterion_type, get_criteria, get_peak_count, &
      get_source_limits, source_limits_type
   use thud_source_model, only: solve_model
   implicit none (type, external)
   private

   public :: load_case, outcome_type, run_case, solve_case

   !> Files of a run.
   character(len=13), parameter :: file_names(4) = [character(len=13) :: &
      'force.csv', 'levels.csv', 'summary.nml', 'effective.nml']

   !> File of models that have more to tell.
   character(len=*), parameter :: channel_file = 'channels.csv'

   !> Figures that the driver may have added; they show the results that they were drawn from.
   character(len=10), parameter :: figure_names(4) = [character(len=10) :: &
      'force.png', 'force.svg', 'levels.png', 'levels.svg']

   !> What a run leaves for its caller.
   type :: outcome_type
      !> Directory that holds the files.
      character(len=:), allocatable :: directory
      !> Table for the screen.
      character(len=:), allocatable :: table
      !> A remark for the user, empty where there is none.
      character(len=:), allocatable :: remark
      !> The source conforms to the limits.
      logical :: conforms = .false.
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
      type(force_history_type) :: history
      type(criterion_type) :: criteria(criterion_count)
      type(band_type), allocatable :: bands(:)
      real(wp), allocatable :: elastic_level(:), floor_level(:)
      character(len=:), allocatable :: input
      type(text_file_type), allocatable :: files(:)
      logical :: differs
      integer :: first, i

      call load_case(path, case, error)
      if (allocated(error)) return
      input = get_case_text(case)
      outcome%directory = output
      if (output == '') outcome%directory = 'outputs/'//trim(case%name)
      call check_owner(outcome%directory, [character(len=13) :: file_names, channel_file], 'effective.nml', input, &
         differs, error)
      if (.not. allocated(error)) call solve_case(case, history, error)
      if (.not. allocated(error)) call judge_case(case, history, bands, elastic_level, floor_level, criteria, error)
      if (.not. allocated(error)) then
         outcome%conforms = all(conforms(criteria))
         outcome%table = get_table(case, history, elastic_level, floor_level, criteria)
         ! The octaves come first and serve the verdict also where only thirds are asked for.
         first = merge(octave_count, 0, case%bands == 'third') + 1
         allocate (files(size(file_names) + merge(1, 0, allocated(history%channel))))
         files(:size(file_names))%name = file_names
         files(1)%content = get_force_csv(history)
         files(2)%content = get_levels_csv(bands(first:), elastic_level(first:), floor_level(first:), criteria, &
            trim(case%level_force))
         files(3)%content = get_summary(case, history, criteria)
         files(4)%content = input
         if (allocated(history%channel)) then
            files(size(files))%name = channel_file
            files(size(files))%content = get_channels_csv(history)
         end if
         call write_files(outcome%directory, files, error)
      end if
      if (.not. allocated(error)) then
         outcome%remark = ''
         if (differs) then
            outcome%remark = path//': replaces the results of another input of the same name in '//outcome%directory
            do i = 1, size(figure_names)
               call remove_file(outcome%directory//'/'//trim(figure_names(i)))
            end do
            if (.not. allocated(history%channel)) call remove_file(outcome%directory//'/'//channel_file)
         end if
      end if
      if (allocated(error)) error%message = path//': '//error%message
   end subroutine run_case

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

   !> Force history of a case.
   subroutine solve_case(case, history, error)
      !> The case.
      type(case_type), intent(in) :: case
      !> Its force history.
      type(force_history_type), intent(out) :: history
      !> The model failed.
      type(error_type), allocatable, intent(out) :: error

      call solve_model(trim(case%model), case%options, case%ball, case%drop, case%sampling, history, error)
   end subroutine solve_case

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
         n_peak = get_peak_count(history%elastic_force)
      else
         levels = floor_level(:octave_count)
         n_peak = get_peak_count(history%floor_force)
      end if
      criteria = get_criteria(limits, levels, history%contact_time, history%restitution, n_peak, case%ball%mass, &
         case%drop%height)
   end subroutine judge_case

end module thud_run
