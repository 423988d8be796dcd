!> A run of many samples from end to end: reads a case and a table, the keys in its first row and one sample in each further
!> row, and writes one row of results per sample, in chunks, so that the memory does not grow with the table.
module thud_samples_run
   use thud_case, only: case_type, get_active_fields, get_full_key, keep_impact_only
   use thud_case_text, only: get_case_text
   use thud_column, only: column_type, find_columns
   use thud_constants, only: version
   use thud_ensemble, only: suits_batch
   use thud_error, only: error_type, input_error, prefix_error
   use thud_field, only: field_type
   use thud_kinds, only: wp
   use thud_progress, only: report_progress
   use thud_result_directory, only: add_text, check_target, close_results, open_results, result_directory_type
   use thud_run, only: load_case, new_directory, outcome_type, run_options_type
   use thud_screen_tables, only: get_defaults_lines, get_force_title
   use thud_sweep, only: new_sweep, solve_sweep, sweep_type
   use thud_system, only: path_length
   use thud_table_reader, only: cell_length, open_table, read_number, read_row, row_error, table_reader_type
   use thud_text, only: lower_case, newline, quoted, replaced, to_text
   use thud_text_buffer, only: text_buffer_type
   implicit none (type, external)
   private

   public :: run_samples

   !> Files of results and of the full input.
   character(len=*), parameter :: result_file = 'samples.csv', input_file = 'samples.nml'

   !> Number of samples in a chunk for each thread, in batches and one by one; progress is reported after each chunk.
   integer, parameter :: batch_chunk = 1024, single_chunk = 16

   !> Width of a comma and a number with all digits, and their format.
   integer, parameter :: width = 25
   character(len=*), parameter :: form = '(*(:,",",es24.16e3))'

   !> An open table.
   type :: table_type
      character(len=:), allocatable :: path
      type(table_reader_type) :: reader
      !> Keys of the columns, and their names in the table: [n_column].
      type(column_type), allocatable :: columns(:)
      character(len=cell_length), allocatable :: names(:)
      !> Descriptions of the keys; they point to variables of the case: [n_column].
      type(field_type), allocatable :: fields(:)
   end type table_type

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
      type(table_type) :: table
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
      results = new_directory(options, 'samples', trim(case%name), '_samples')
      results%inputs = [character(len=path_length) :: path, table_path]
      outcome%directory = results%path
      call open_samples(table_path, case, table, error)
      if (allocated(error)) return
      ! The table states the keys of its columns.
      case%unstated = pack(case%unstated, [(.not. any(get_full_key(table%fields) == case%unstated(i)), &
         i=1, size(case%unstated))])
      call check_target(results, [result_file, input_file], error)
      if (.not. allocated(error)) call open_results(results, error)
      call get_case_text(case, text)
      call add_text(results, input_file, text, error)
      call write_samples(case, table, threads, results, tally, error)
      call close_results(results, error)
      if (allocated(error)) return
      allocate (outcome%warning(merge(1, 0, tally%computed < tally%samples)))
      outcome%warning = to_text(tally%samples - tally%computed)//' of ' &
         //to_text(tally%samples)//' samples have no results, such as: '//trim(tally%failure)
      outcome%conforms = tally%conforming == tally%samples
      text = 'all limits of the '//replaced(trim(case%source), '_', ' ')//' by the '//get_force_title(case%level_force)
      if (any(table%names == 'source') .or. any(table%names == 'force')) text = 'all their limits'
      outcome%table = 'thud '//version//'   case '//trim(case%name)//'   model '//trim(case%model)//newline//newline &
         //'  '//to_text(tally%samples)//trim(merge(' sample, ', ' samples,', tally%samples == 1))//' ' &
         //to_text(tally%computed)//' computed, '//to_text(tally%conforming)//' conform to '//text//'.'//newline &
         //'  The samples state no numerical errors; a run of a single case states its own.'//newline &
         //get_defaults_lines(case)
   end subroutine run_samples

   !> Opens a table and reads its first row.
   subroutine open_samples(path, case, table, error)
      character(len=*), intent(in) :: path
      !> The case that uses the keys.
      type(case_type), intent(in), target :: case
      type(table_type), intent(out) :: table
      !> Set if the file cannot be read, or a key is unknown or given twice.
      type(error_type), allocatable, intent(out) :: error
      type(field_type), allocatable :: fields(:)

      call open_table(path, table%reader, error)
      if (.not. allocated(error)) call read_row(table%reader, table%names, error)
      if (.not. allocated(error)) then
         call find_columns(case, table%names, table%columns, error)
         if (allocated(error)) error = row_error(table%reader, error%message)
         if (size(table%names) == 0) error = input_error('the table is empty; allowed: keys in the first line and one ' &
            //'sample in each of the others')
      end if
      table%path = path
      if (allocated(error)) then
         call prefix_error(error, path)
      else
         allocate (fields, source=get_active_fields(case))
         table%fields = fields(table%columns%field)
      end if
   end subroutine open_samples

   !> Computes and writes all samples, in chunks.
   subroutine write_samples(case, table, threads, results, tally, error)
      type(case_type), intent(in), target :: case
      !> The table, open.
      type(table_type), intent(inout) :: table
      integer, intent(in) :: threads
      type(result_directory_type), intent(in) :: results
      type(tally_type), intent(out) :: tally
      !> Set if an earlier step failed, a value is invalid, there is no result, or the file cannot be written.
      type(error_type), allocatable, intent(inout) :: error
      type(sweep_type) :: sweep
      type(text_buffer_type) :: rows(threads)
      real(wp), allocatable :: values(:, :)
      character(len=cell_length), allocatable :: names(:)
      character(len=:), allocatable :: header
      integer :: n, i

      if (allocated(error)) return
      call new_sweep(case, .true., sweep)
      allocate (values(size(table%columns), threads*merge(batch_chunk, single_chunk, suits_batch(case, table%columns))))
      names = [character(len=cell_length) :: table%names, pack(sweep%columns%name, sweep%columns%is_wanted), 'status', &
         'reason']
      header = 'sample'
      do i = 1, size(names)
         header = header//','//trim(names(i))
      end do
      call add_text(results, result_file, header//newline, error)
      do while (.not. allocated(error))
         call read_samples(table, values, n, error)
         if (allocated(error) .or. n == 0) exit
         call solve_sweep(case, table%columns, values(:, :n), threads, .false., sweep, error)
         if (allocated(error)) exit
         ! Formatting numbers takes longer than computing them.
         !$omp parallel do num_threads(threads)
         do i = 1, threads
            call get_rows(table, tally%samples, values, (i - 1)*n/threads + 1, i*n/threads, sweep, rows(i))
         end do
         !$omp end parallel do
         i = findloc(sweep%status /= 0, .true., dim=1)
         if (i > 0 .and. tally%failure == '') tally%failure = sweep%reason(i)%text
         tally%samples = tally%samples + n
         tally%computed = tally%computed + count(sweep%status == 0)
         ! The last column is the verdict.
         tally%conforming = tally%conforming + count(sweep%values(size(sweep%columns), :) > 0.0_wp)
         do i = 1, threads
            call add_text(results, result_file, rows(i)%get_text(), error)
         end do
         call report_progress(real(tally%samples, wp), 0.0_wp, 'samples')
      end do
      if (allocated(error)) return
      if (tally%samples == 0) then
         error = input_error(table%path//': the table has no samples; allowed: one in each line below the keys')
      else if (tally%computed == 0) then
         error = input_error(table%path//': none of '//to_text(tally%samples)//' samples has results, such as: ' &
            //trim(tally%failure))
      end if
   end subroutine write_samples

   !> Reads the next samples.
   subroutine read_samples(table, values, n_sample, error)
      type(table_type), intent(inout) :: table
      !> Values of the samples; of a choice its index, of a flag 0 or 1: [n_column, n_max].
      real(wp), intent(out) :: values(:, :)
      !> Number of samples read; less than `n_max` only at the end of the table.
      integer, intent(out) :: n_sample
      !> Set if a row has the wrong number of values, or a value is not valid.
      type(error_type), allocatable, intent(out) :: error
      character(len=cell_length), allocatable :: cells(:)
      character(len=cell_length) :: word
      logical :: valid
      integer :: i

      n_sample = 0
      do while (n_sample < size(values, 2))
         call read_row(table%reader, cells, error)
         if (.not. allocated(error) .and. size(cells) == 0) return
         if (.not. allocated(error) .and. size(cells) /= size(table%names)) error = row_error(table%reader, 'it has ' &
            //to_text(size(cells))//' values and the first line '//to_text(size(table%names))//' keys; allowed: one value ' &
            //'for each key, with commas, semicolons, tabs or blanks between')
         n_sample = n_sample + 1
         do i = 1, size(table%names)
            if (allocated(error)) exit
            word = lower_case(cells(i))
            associate (field => table%fields(i), value => values(i, n_sample))
               select case (field%kind)
               case ('choice')
                  value = real(findloc(field%choices(:field%n_choice) == word, .true., dim=1), wp)
                  valid = value > 0.0_wp
               case ('flag')
                  valid = any(word == [character(len=7) :: 'true', '.true.', '1', 'false', '.false.', '0'])
                  value = merge(1.0_wp, 0.0_wp, scan(word, 't1') > 0)
               case default
                  call read_number(cells(i), value, valid)
               end select
               if (.not. valid) then
                  error = field%get_error(quoted(cells(i)))
                  error = row_error(table%reader, error%message)
               end if
            end associate
         end do
         if (allocated(error)) exit
      end do
      if (allocated(error)) call prefix_error(error, table%path)
   end subroutine read_samples

   !> Rows of the results, with 17 digits; cells of samples without results are empty.
   subroutine get_rows(table, before, values, first, last, sweep, rows)
      type(table_type), intent(in) :: table
      !> Number of samples before the first of `values`.
      integer, intent(in) :: before
      !> Values of the keys: [n_column, at least n_sample].
      real(wp), intent(in) :: values(:, :)
      !> Indices of the first and the last sample to write.
      integer, intent(in) :: first, last
      type(sweep_type), intent(in) :: sweep
      type(text_buffer_type), intent(out) :: rows
      character(len=width) :: cell
      character(len=width*size(sweep%columns)) :: cells
      logical :: is_number(size(sweep%columns))
      integer :: i, j, at

      is_number = sweep%columns%is_wanted .and. .not. sweep%columns%is_flag
      do i = first, last
         call rows%append(to_text(before + i))
         do j = 1, size(table%names)
            write (cell, form) values(j, i)
            if (table%fields(j)%n_choice > 0) cell = ','//table%fields(j)%choices(nint(values(j, i)))
            call rows%append(trim(cell))
         end do
         if (sweep%status(i) /= 0) then
            call rows%append(repeat(',', count(sweep%columns%is_wanted))//','//to_text(sweep%status(i))//',"' &
               //replaced(sweep%reason(i)%text, '"', "'")//'"'//newline)
            cycle
         end if
         ! All numbers at once: a statement for each takes longer.
         write (cells, form) pack(sweep%values(:, i), is_number)
         at = 0
         do j = 1, size(is_number)
            if (is_number(j)) then
               call rows%append(cells(at + 1:at + width))
               at = at + width
            else if (sweep%columns(j)%is_flag) then
               call rows%append(trim(merge(',yes', ',no ', sweep%values(j, i) > 0.0_wp)))
            end if
         end do
         call rows%append(',0,'//newline)
      end do
   end subroutine get_rows

end module thud_samples_run
