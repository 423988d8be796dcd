!> A run of many sets of the shell model from end to end: case and table in, one row of results per set out, a
!> chunk at a time, so that the memory does not grow with the table.
module thud_sets_run
   use thud_band, only: band_type, get_octaves, get_thirds, octave_count
   use thud_case, only: case_type, get_case_text
   use thud_constants, only: version
   use thud_shell_sets, only: set_outcome_type, set_type
   use thud_ensemble, only: force_count, new_projections, projections_type, solve_ensemble, verdict_type
   use thud_error, only: error_type, input_error
   use thud_file, only: text_file_type
   use thud_hollow_sphere, only: flux_choices
   use thud_kinds, only: wp
   use thud_progress, only: report_progress
   use thud_result_directory, only: add_text, begin_file, check_owner, close_results, open_results, result_directory_type
   use thud_run, only: load_case, outcome_type
   use thud_sampling, only: get_sample_count
   use thud_set_report, only: get_band_name, get_set_header, get_set_reason, get_set_rows
   use thud_set_status, only: set_is_fine
   use thud_set_table, only: open_set_table, read_sets, set_table_type
   use thud_text, only: fixed, newline, quoted, to_text
   implicit none (type, external)
   private

   public :: run_sets

   !> Sets that are read, computed and written at a time.
   integer, parameter :: chunk_size = 16384

   !> Files of the results.
   character(len=*), parameter :: result_file = 'sets.csv', input_file = 'sets.nml'

   !> What many sets came to.
   type :: tally_type
      !> Sets, those that were computed, and those that conform by the force of the case.
      integer :: sets = 0, computed = 0, conforming = 0
      !> Status of the first that failed.
      integer :: failure = set_is_fine
      !> Smallest and largest contact time, s, and octave levels of that force, dB: [octave_count + 1, 2].
      real(wp) :: span(octave_count + 1, 2) = spread([huge(1.0_wp), -huge(1.0_wp)], 1, octave_count + 1)
   end type tally_type

contains

   !> Computes all sets of a table and writes their results.
   subroutine run_sets(path, table_path, threads, output, outcome, error)
      !> Path of the namelist file, which gives what the table does not.
      character(len=*), intent(in) :: path
      !> Path of the table.
      character(len=*), intent(in) :: table_path
      !> Number of threads.
      integer, intent(in) :: threads
      !> Directory for the results; empty for `outputs/<name of the case>_sets`.
      character(len=*), intent(in) :: output
      !> Table, verdict and place of the results.
      type(outcome_type), intent(out) :: outcome
      !> The run failed; nothing was written.
      type(error_type), allocatable, intent(out) :: error
      type(case_type) :: case
      type(set_table_type) :: table
      type(tally_type) :: tally
      type(text_file_type) :: marker
      type(result_directory_type) :: results
      logical :: differs

      call load_case(path, case, error)
      if (allocated(error)) return
      call check_case(case, error)
      if (allocated(error)) then
         error%message = path//': '//error%message
         return
      end if
      call open_set_table(table_path, table, error)
      if (allocated(error)) return
      outcome%directory = output
      if (output == '') outcome%directory = 'outputs/'//trim(case%name)//'_sets'
      marker%name = input_file
      marker%content = get_case_text(case)
      call check_owner(outcome%directory, marker, differs, error)
      if (allocated(error)) return
      call open_results(outcome%directory, marker, [result_file], results, error)
      call write_sets(case, table, threads, results, tally, error)
      call close_results(results, differs, error)
      if (allocated(error)) return
      outcome%remark = ''
      if (differs) outcome%remark = 'replaces the results of another input of the same name in '//outcome%directory
      if (tally%computed < tally%sets) then
         if (outcome%remark /= '') outcome%remark = outcome%remark//'; '
         outcome%remark = outcome%remark//to_text(tally%sets - tally%computed)//' of '//to_text(tally%sets) &
            //' sets have no results, such as: '//trim(get_set_reason(tally%failure))
      end if
      if (outcome%remark /= '') outcome%remark = path//': '//outcome%remark
      outcome%conforms = tally%conforming == tally%sets
      call describe(case, tally, outcome%table)
   end subroutine run_sets

   !> Complains about cases whose sets cannot be computed together.
   subroutine check_case(case, error)
      !> The case.
      type(case_type), intent(in) :: case
      !> Names the key.
      type(error_type), allocatable, intent(out) :: error

      if (.not. case%has_impact .or. case%model /= 'hollow_sphere') then
         error = input_error('&model: name = '//quoted(case%model)//" has no sets; allowed: 'hollow_sphere'")
      else if (case%level_method /= 'exact') then
         error = input_error('&levels: method = '//quoted(case%level_method)//" is not for sets; allowed: 'exact'")
      end if
   end subroutine check_case

   !> Computes and writes chunk after chunk.
   subroutine write_sets(case, table, threads, results, tally, error)
      !> The case.
      type(case_type), intent(in) :: case
      !> The table, open.
      type(set_table_type), intent(inout) :: table
      !> Number of threads.
      integer, intent(in) :: threads
      !> Directory of the results.
      type(result_directory_type), intent(inout) :: results
      !> What the sets came to.
      type(tally_type), intent(out) :: tally
      !> What went wrong before; or a value is none, the sampling cannot be used, the file cannot be written.
      type(error_type), allocatable, intent(inout) :: error
      type(set_type) :: base
      type(set_type), allocatable :: sets(:)
      type(set_outcome_type), allocatable :: outcomes(:)
      type(verdict_type), allocatable :: verdicts(:)
      real(wp), allocatable :: levels(:, :, :), no_forces(:, :, :)
      type(projections_type) :: projections
      type(band_type), allocatable :: more(:)
      type(text_file_type) :: parts(threads)
      character(len=:), allocatable :: text
      integer :: n, first_band, first, last, i

      base = set_type(case%ball, case%drop, &
         findloc(flux_choices == case%options%hollow_sphere%momentum_flux, .true., dim=1))
      allocate (more(0))
      if (case%bands /= 'octave') more = get_thirds()
      ! The octaves come first and serve the verdict also where only thirds are asked for.
      first_band = merge(octave_count, 0, case%bands == 'third') + 1
      projections = new_projections(case%sampling%sample_rate, more, get_sample_count(case%sampling))
      allocate (sets(chunk_size), outcomes(chunk_size), verdicts(chunk_size), no_forces(0, 0, 0))
      allocate (levels(octave_count + size(more), force_count, chunk_size))
      call begin_file(results, result_file, error)
      call get_set_header(table, projections%bands(first_band:), text)
      call add_text(results, text, error)
      do while (.not. allocated(error))
         call read_sets(table, base, sets, n, error)
         if (allocated(error) .or. n == 0) exit
         call solve_ensemble(sets(:n), case%sampling, trim(case%source), threads, .true., projections, outcomes(:n), &
            levels(:, :, :n), verdicts(:n), no_forces, error)
         if (allocated(error)) exit
         call add(tally, outcomes(:n), levels(:, :, :n), verdicts(:n), merge(1, 2, case%level_force == 'elastic'))
         ! To write numbers takes longer than to compute them.
         !$omp parallel do num_threads(threads) private(first, last)
         do i = 1, threads
            first = (i - 1)*n/threads + 1
            last = i*n/threads
            call get_set_rows(table, tally%sets - n + first - 1, sets(first:last), outcomes(first:last), &
               levels(first_band:, :, first:last), verdicts(first:last), parts(i)%content)
         end do
         !$omp end parallel do
         do i = 1, threads
            call add_text(results, parts(i)%content, error)
         end do
         call report_progress(real(tally%sets, wp), 0.0_wp, 'sets')
      end do
      if (.not. allocated(error) .and. tally%sets == 0) error = input_error(trim(table%path) &
         //': the table has no sets; allowed: one in each line below the keys')
   end subroutine write_sets

   !> Adds sets to a tally.
   pure subroutine add(tally, outcomes, levels, verdicts, force)
      !> The tally.
      type(tally_type), intent(inout) :: tally
      !> Outcomes of the sets: [n_set].
      type(set_outcome_type), intent(in) :: outcomes(:)
      !> Levels, dB, octaves first: [n_band, force_count, n_set].
      real(wp), intent(in) :: levels(:, :, :)
      !> The verdicts: [n_set].
      type(verdict_type), intent(in) :: verdicts(:)
      !> Number of the force that the verdict is on.
      integer, intent(in) :: force
      real(wp) :: values(octave_count + 1)
      integer :: i

      tally%sets = tally%sets + size(outcomes)
      do i = 1, size(outcomes)
         if (tally%failure == set_is_fine) tally%failure = outcomes(i)%status
         if (outcomes(i)%status /= set_is_fine) cycle
         tally%computed = tally%computed + 1
         if (verdicts(i)%conforms(force)) tally%conforming = tally%conforming + 1
         values = [outcomes(i)%contact_time, levels(:octave_count, force, i)]
         tally%span(:, 1) = min(tally%span(:, 1), values)
         tally%span(:, 2) = max(tally%span(:, 2), values)
      end do
   end subroutine add

   !> What the screen shows.
   subroutine describe(case, tally, text)
      !> The case.
      type(case_type), intent(in) :: case
      !> What the sets came to.
      type(tally_type), intent(in) :: tally
      !> The table.
      character(len=:), allocatable, intent(out) :: text
      type(band_type) :: octaves(octave_count)
      integer :: i

      text = 'thud '//version//'   case '//trim(case%name)//'   model '//trim(case%model)//newline//newline &
         //'  '//to_text(tally%sets)//' sets, '//to_text(tally%computed)//' computed, '//to_text(tally%conforming) &
         //' conform to the limits of the '//trim(case%source)//' by the '//trim(case%level_force)//' force.'//newline
      if (tally%computed == 0) return
      octaves = get_octaves()
      text = text//'  contact time  '//fixed(1.0e3_wp*tally%span(1, 1), 3)//' to '//fixed(1.0e3_wp*tally%span(1, 2), 3) &
         //' ms'//newline
      do i = 1, octave_count
         text = text//'  '//get_band_name(octaves(i))//' Hz  '//fixed(tally%span(i + 1, 1), 2)//' to ' &
            //fixed(tally%span(i + 1, 2), 2)//' dB'//newline
      end do
   end subroutine describe

end module thud_sets_run
