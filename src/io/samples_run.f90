!> A run of many samples from end to end: reads a case and a table, and writes one row of results per sample, in chunks, so
!> that the memory does not grow with the table.
module thud_samples_run
   use thud_case, only: case_type, get_full_key, keep_impact_only
   use thud_case_text, only: get_case_text
   use thud_constants, only: version
   use thud_ensemble, only: suits_batch
   use thud_error, only: error_type, input_error
   use thud_kinds, only: wp
   use thud_progress, only: report_progress
   use thud_result_directory, only: add_text, begin_file, check_target, close_results, open_results, &
      result_directory_type, write_file
   use thud_run, only: load_case, outcome_type, run_options_type
   use thud_sample_report, only: get_sample_header, get_sample_rows
   use thud_sample_table, only: open_sample_table, read_samples, sample_table_type
   use thud_screen_tables, only: get_defaults_lines, get_force_title
   use thud_sweep, only: new_sweep, solve_sweep, sweep_type
   use thud_system, only: path_length
   use thud_text, only: newline, replaced, to_text
   use thud_text_buffer, only: text_buffer_type
   implicit none (type, external)
   private

   public :: run_samples

   !> Files of results and of the full input.
   character(len=*), parameter :: result_file = 'samples.csv', input_file = 'samples.nml'

   !> Number of samples in a chunk for each thread, in batches and one by one; progress is reported after each chunk.
   integer, parameter :: batch_chunk = 1024, single_chunk = 16

   !> Summary of many samples.
   type :: tally_type
      !> Numbers of samples, of computed samples, and of conforming samples.
      integer :: samples = 0, computed = 0, conforming = 0
      !> Message of the first sample that failed.
      character(len=1024) :: failure = ''
   end type tally_type

contains

   !> Computes all samples of a table and writes their results.
   subroutine run_samples(path, table_path, threads, options, outcome, error)
      !> Path of the namelist file, for all keys that are not in the table.
      character(len=*), intent(in) :: path
      character(len=*), intent(in) :: table_path
      integer, intent(in) :: threads
      !> What is written where, by default into `outputs/<name of the case>_samples`.
      type(run_options_type), intent(in) :: options
      !> Table, verdict and directory of the results.
      type(outcome_type), intent(out) :: outcome
      !> Set if the run fails; the directory is unchanged then.
      type(error_type), allocatable, intent(out) :: error
      type(case_type), target :: case
      type(sample_table_type) :: table
      type(tally_type) :: tally
      type(result_directory_type) :: results
      character(len=:), allocatable :: text
      integer :: i

      call load_case(path, case, error, unchecked=.true.)
      if (allocated(error)) return
      call keep_impact_only(case)
      if (.not. case%has_impact) error = input_error(path//': &model is missing; allowed: samples of a case ' &
         //'with a source model')
      if (allocated(error)) return
      call open_sample_table(table_path, case, table, error)
      if (allocated(error)) return
      ! The table states the keys of its columns.
      case%unstated = pack(case%unstated, [(.not. any(get_full_key(table%fields) == case%unstated(i)), &
         i=1, size(case%unstated))])
      outcome%directory = options%output
      if (options%output == '') outcome%directory = 'outputs/'//trim(case%name)//'_samples'
      results%path = outcome%directory
      results%command = 'samples'
      results%subject = trim(case%name)
      results%inputs = [character(len=path_length) :: path, table_path]
      results%replace = options%replace
      call check_target(results, [result_file, input_file], error)
      if (.not. allocated(error)) call open_results(results, error)
      call get_case_text(case, text)
      call write_file(results, input_file, text, error)
      call write_samples(case, table, threads, results, tally, error)
      call close_results(results, error)
      if (allocated(error)) return
      allocate (outcome%warning(merge(1, 0, tally%computed < tally%samples)))
      outcome%warning = to_text(tally%samples - tally%computed)//' of ' &
         //to_text(tally%samples)//' samples have no results, such as: '//trim(tally%failure)
      outcome%conforms = tally%conforming == tally%samples
      outcome%table = 'thud '//version//'   case '//trim(case%name)//'   model '//trim(case%model)//newline//newline &
         //'  '//to_text(tally%samples)//trim(merge(' sample, ', ' samples,', tally%samples == 1))//' ' &
         //to_text(tally%computed)//' computed, '//to_text(tally%conforming)//' conform to '
      if (any(table%names == 'source') .or. any(table%names == 'force')) then
         outcome%table = outcome%table//'all their limits.'//newline
      else
         outcome%table = outcome%table//'all limits of the '//replaced(trim(case%source), '_', ' ')//' by the ' &
            //get_force_title(case%level_force)//'.'//newline
      end if
      outcome%table = outcome%table &
         //'  The samples state no numerical errors; a run of a single case states its own.'//newline
      outcome%table = outcome%table//get_defaults_lines(case)
   end subroutine run_samples

   !> Computes and writes all samples, in chunks.
   subroutine write_samples(case, table, threads, results, tally, error)
      type(case_type), intent(in), target :: case
      !> The table, open.
      type(sample_table_type), intent(inout) :: table
      integer, intent(in) :: threads
      type(result_directory_type), intent(inout) :: results
      type(tally_type), intent(out) :: tally
      !> Set if an earlier step failed, a value or the sampling is invalid, or the file cannot be written.
      type(error_type), allocatable, intent(inout) :: error
      type(sweep_type) :: sweep
      type(text_buffer_type) :: parts(threads)
      real(wp), allocatable :: values(:, :)
      character(len=:), allocatable :: text
      integer :: n, i

      call new_sweep(case, .true., sweep)
      allocate (values(size(table%columns), threads*merge(batch_chunk, single_chunk, suits_batch(case, table%columns))))
      call begin_file(results, result_file, error)
      call get_sample_header(table, sweep, text)
      call add_text(results, text, error)
      do while (.not. allocated(error))
         call read_samples(table, values, n, error)
         if (allocated(error) .or. n == 0) exit
         call solve_sweep(case, table%columns, values(:, :n), threads, .false., sweep, error)
         if (allocated(error)) exit
         ! Formatting numbers takes longer than computing them.
         !$omp parallel do num_threads(threads)
         do i = 1, threads
            call get_sample_rows(table, tally%samples, values(:, :n), (i - 1)*n/threads + 1, i*n/threads, sweep, &
               parts(i))
         end do
         !$omp end parallel do
         i = findloc(sweep%status /= 0, .true., dim=1)
         if (i > 0 .and. tally%failure == '') tally%failure = sweep%reason(i)%text
         tally%samples = tally%samples + n
         tally%computed = tally%computed + count(sweep%status == 0)
         ! The last column is the verdict.
         tally%conforming = tally%conforming + count(sweep%values(size(sweep%columns), :) > 0.0_wp)
         do i = 1, threads
            call add_text(results, parts(i)%get_text(), error)
         end do
         call report_progress(real(tally%samples, wp), 0.0_wp, 'samples')
      end do
      if (.not. allocated(error) .and. tally%samples == 0) error = input_error(trim(table%path) &
         //': the table has no samples; allowed: one in each line below the keys')
      if (.not. allocated(error) .and. tally%computed == 0) error = input_error(trim(table%path)//': none of ' &
         //to_text(tally%samples)//' samples has results, such as: '//trim(tally%failure))
   end subroutine write_samples

end module thud_samples_run
