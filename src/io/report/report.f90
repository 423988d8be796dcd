!> Results as text: the files of a run.
module thud_report
   use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
   use thud_band, only: octave_count
   use thud_case, only: case_type
   use thud_compute, only: assessment_type, get_assessed_force, is_conforming
   use thud_constants, only: version
   use thud_csv, only: get_history_csv, get_table_csv
   use thud_force_history, only: force_count, force_history_type, force_names
   use thud_kinds, only: wp
   use thud_quantities, only: get_quantities, history_quantity_count, quantities
   use thud_source_limits, only: combine_verdicts, criterion_type, get_verdict, verdict_conforms, verdict_fails, verdict_names
   use thud_text, only: join, join_quoted, newline, quoted, to_text
   implicit none (type, external)
   private

   public :: get_model_histories_csv, get_model_quantities, get_force_csv, get_levels_csv, get_quantity_lines
   public :: get_summary, get_verdict_word, line

contains

   !> Force and motion against time.
   function get_force_csv(history, names, columns) result(text)
      type(force_history_type), intent(in) :: history
      !> Names, with units, of additional columns: [n_column].
      character(len=*), intent(in) :: names(:)
      !> The additional columns: [n_time, n_column].
      real(wp), intent(in) :: columns(:, :)
      !> Text of `force.csv`.
      character(len=:), allocatable :: text

      text = get_history_csv('time_s,deflection_m,velocity_m_per_s'//listed(history%component_name, '_N') &
         //',elastic_force_N,floor_force_N'//listed(names, ''), get_times(history), reshape([history%deflection, &
         history%velocity, history%component, history%elastic_force, history%floor_force, columns], &
         [size(columns, 1), 4 + size(history%component_name) + size(names)]))
   end function get_force_csv

   !> Additional quantities of the model against time.
   function get_model_histories_csv(history) result(text)
      !> A history with such quantities.
      type(force_history_type), intent(in) :: history
      !> Text of `model_histories.csv`.
      character(len=:), allocatable :: text

      text = get_history_csv('time_s'//listed(history%model_history_name, ''), get_times(history), history%model_history)
   end function get_model_histories_csv

   !> Names of columns, each after a comma.
   pure function listed(names, ending) result(text)
      !> The names: [n_column].
      character(len=*), intent(in) :: names(:)
      !> Ending of each name.
      character(len=*), intent(in) :: ending
      character(len=:), allocatable :: text
      integer :: i

      text = ''
      do i = 1, size(names)
         text = text//','//trim(names(i))//ending
      end do
   end function listed

   !> Times of the samples, s: [n_time].
   pure function get_times(history) result(times)
      type(force_history_type), intent(in) :: history
      real(wp) :: times(size(history%floor_force))
      integer :: i

      times = [(real(i - 1, wp)/history%sample_rate, i=1, size(times))]
   end function get_times

   !> Levels, limits and verdict for each band.
   function get_levels_csv(case, assessment) result(text)
      type(case_type), intent(in) :: case
      type(assessment_type), intent(in) :: assessment
      !> Text of `levels.csv`.
      character(len=:), allocatable :: text
      character(len=:), allocatable :: header
      character(len=80) :: limits(size(assessment%bands))
      integer :: i

      header = 'bandwidth,nominal_Hz,lower_edge_Hz,upper_edge_Hz'
      do i = 1, force_count
         header = header//','//trim(force_names(i))//'_level_dB'
      end do
      limits = ',,no limit'
      do i = 1, octave_count
         associate (criterion => assessment%criteria(i, get_assessed_force(case)))
            limits(i) = to_text(criterion%lower)//','//to_text(criterion%upper)//','//get_verdict_word(criterion)
         end associate
      end do
      ! The octaves come first, because the verdict always needs them; `first_band` leaves them out of the file if the case
      ! does not ask for them. The name of the band's set is the first column.
      associate (bands => assessment%bands(assessment%first_band:), first => assessment%first_band)
         text = get_table_csv(header//',lower_limit_dB,upper_limit_dB,verdict_'//trim(case%level_force), &
            reshape([bands%nominal, bands%lower, bands%upper, assessment%level(first:, :)], &
            [size(bands), 3 + force_count]), bands%set, limits(first:))
      end associate
   end function get_levels_csv

   !> The quantities of a run as a namelist file.
   function get_summary(case, history, assessment, warning) result(text)
      type(case_type), intent(in) :: case
      type(force_history_type), intent(in) :: history
      type(assessment_type), intent(in) :: assessment
      !> Warnings on the case: [n].
      character(len=*), intent(in) :: warning(:)
      !> Text of `summary.nml`.
      character(len=:), allocatable :: text

      text = '! thud '//version//': results of case '//trim(case%name)//', SI units, levels in dB re 1 N'//newline &
         //newline//'&summary'//newline//line('case', quoted(case%name), '')//line('model', quoted(case%model), '') &
         //get_quantity_lines(history)//'/'//newline//newline//get_model_quantities('model_quantities', history)
      if (size(warning) > 0) text = text//'&warnings'//newline//line('warning', join_quoted(warning), '')//'/'//newline &
         //newline
      text = text//'&verdict'//newline &
         //line('source', quoted(case%source), '') &
         //line('level_method', quoted(case%level_method), '') &
         //line('level_force', quoted(case%level_force), '') &
         //line('conforms', trim(merge('.true. ', '.false.', is_conforming(case, assessment))), '')
      associate (criteria => assessment%criteria(:, get_assessed_force(case)))
         text = text//line('result', quoted(verdict_names(combine_verdicts(get_verdict(criteria)))), '') &
            //line('criterion', join_quoted(criteria%name), '') &
            //line('unit', join_quoted(criteria%unit), '') &
            //line('value', join(criteria%value), '') &
            //line('lower', join(criteria%lower), '') &
            //line('upper', join(criteria%upper), '') &
            //line('met', join(merge('.true. ', '.false.', get_verdict(criteria) == verdict_conforms)), '')
         if (history%numerical_error%known) text = text//line('numerical_error', join(criteria%error), '')
         text = text//'/'//newline
      end associate
   end function get_summary

   !> The quantities of an impact as lines of a namelist, without unknown ones.
   function get_quantity_lines(history) result(text)
      type(force_history_type), intent(in) :: history
      character(len=:), allocatable :: text
      real(wp) :: values(history_quantity_count)
      integer :: i

      values = get_quantities(history)
      text = ''
      do i = 1, history_quantity_count
         if (ieee_is_nan(values(i))) cycle
         text = text//line(trim(quantities(i)%name), to_text(values(i)), trim(quantities(i)%unit))
      end do
   end function get_quantity_lines

   !> The quantities of the model as a namelist group.
   function get_model_quantities(name, history) result(text)
      !> Name of the group.
      character(len=*), intent(in) :: name
      type(force_history_type), intent(in) :: history
      !> The group; empty if there are none.
      character(len=:), allocatable :: text
      integer :: i

      text = ''
      if (size(history%model_quantity) == 0) return
      text = '&'//name//newline
      do i = 1, size(history%model_quantity_name)
         text = text//line(trim(history%model_quantity_name(i)), to_text(history%model_quantity(i)), &
            trim(history%model_quantity_unit(i)))
      end do
      text = text//'/'//newline//newline
   end function get_model_quantities

   !> Verdict on one value: `conforms`, `too low` or `too high`, or `undecided` by its numerical error.
   function get_verdict_word(criterion) result(word)
      type(criterion_type), intent(in) :: criterion
      character(len=:), allocatable :: word

      word = trim(verdict_names(get_verdict(criterion)))
      if (get_verdict(criterion) == verdict_fails) word = trim(merge('too low ', 'too high', &
         criterion%value < criterion%lower))
   end function get_verdict_word

   !> One line of a namelist group.
   pure function line(key, value, note) result(text)
      character(len=*), intent(in) :: key
      !> Value as text; unit or note, may be empty.
      character(len=*), intent(in) :: value, note
      !> The line with its line feed.
      character(len=:), allocatable :: text

      text = '   '//key//' = '//value
      if (note /= '') text = text//' ! '//note
      text = text//newline
   end function line

end module thud_report
