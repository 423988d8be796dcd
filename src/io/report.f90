!> Results as text: the files of a run and the table on the screen.
module thud_report
   use thud_band, only: band_type, octave_count
   use thud_case, only: case_type
   use thud_constants, only: version
   use thud_force_history, only: force_history_type
   use thud_free_modes, only: free_modes_type
   use thud_kinds, only: wp
   use thud_source_limits, only: conforms, criterion_type
   use thud_text, only: fixed, join_quoted, newline, quoted, to_text
   implicit none (type, external)
   private

   public :: get_channels_csv, get_force_csv, get_levels_csv, get_modes_table, get_summary, get_table

   !> Format of a row of numbers: every bit of them, 25 characters each with its comma.
   character(len=*), parameter :: csv_form = '(*(es24.16e3,:,","))'

contains

   !> Force and motion against time, one line per sample, 17 digits.
   function get_force_csv(history) result(text)
      !> The history.
      type(force_history_type), intent(in) :: history
      !> Text of `force.csv`.
      character(len=:), allocatable :: text
      character(len=:), allocatable :: header
      character(len=25*(size(history%part, 2) + 5)) :: row, rest
      real(wp) :: values(size(history%part, 2) + 4)
      logical :: at_rest
      integer :: i, at

      header = 'time_s,deflection_m,velocity_m_per_s'
      do i = 1, size(history%part_name)
         header = header//','//trim(history%part_name(i))//'_N'
      end do
      header = header//',elastic_force_N,floor_force_N'//newline
      at_rest = .false.
      allocate (character(len=len(header) + size(history%part, 1)*len(row)) :: text)
      text(:len(header)) = header
      at = len(header)
      do i = 1, size(history%part, 1)
         write (row, csv_form) real(i - 1, wp)/history%sample_rate
         values = [history%deflection(i), history%velocity(i), history%part(i, :), history%elastic_force(i), &
            history%floor_force(i)]
         ! Formatting takes most of a run's time, and most rows stand after the release.
         if (i == 1 .or. any(abs(values) > 0.0_wp) .or. .not. at_rest) write (rest, csv_form) values
         at_rest = .not. any(abs(values) > 0.0_wp)
         row(25:) = ','//rest
         row(len(row):) = newline
         text(at + 1:at + len(row)) = row
         at = at + len(row)
      end do
   end function get_force_csv

   !> What else the model has to tell against time, 17 digits.
   function get_channels_csv(history) result(text)
      !> The history, with channels.
      type(force_history_type), intent(in) :: history
      !> Text of `channels.csv`.
      character(len=:), allocatable :: text
      character(len=25*(size(history%channel, 2) + 1)) :: row
      integer :: i

      text = 'time_s'
      do i = 1, size(history%channel_name)
         text = text//','//trim(history%channel_name(i))
      end do
      text = text//newline
      do i = 1, size(history%channel, 1)
         write (row, csv_form) real(i - 1, wp)/history%sample_rate, history%channel(i, :)
         text = text//trim(row)//newline
      end do
   end function get_channels_csv

   !> Levels, limits and verdict per band.
   function get_levels_csv(bands, elastic_level, floor_level, criteria, judged_level) result(text)
      !> The bands: [n_band].
      type(band_type), intent(in) :: bands(:)
      !> Levels of the elastic force, dB: [n_band].
      real(wp), intent(in) :: elastic_level(:)
      !> Levels of the force on the floor, dB: [n_band].
      real(wp), intent(in) :: floor_level(:)
      !> Criteria of the octaves, which are the first five: [n_criterion].
      type(criterion_type), intent(in) :: criteria(:)
      !> Force that the verdict is on.
      character(len=*), intent(in) :: judged_level
      !> Text of `levels.csv`.
      character(len=:), allocatable :: text
      logical :: octave
      integer :: i, j

      text = 'bandwidth,nominal_Hz,lower_edge_Hz,upper_edge_Hz,elastic_level_dB,floor_level_dB,' &
         //'lower_limit_dB,upper_limit_dB,verdict_'//judged_level//newline
      do i = 1, size(bands)
         octave = bands(i)%upper > 1.5_wp*bands(i)%lower
         text = text//trim(merge('octave', 'third ', octave))
         associate (numbers => [bands(i)%nominal, bands(i)%lower, bands(i)%upper, elastic_level(i), floor_level(i)])
            do j = 1, size(numbers)
               text = text//','//to_text(numbers(j))
            end do
         end associate
         if (octave) then
            text = text//','//to_text(criteria(i)%lower)//','//to_text(criteria(i)%upper)//','//verdict(criteria(i))
         else
            text = text//',,,no limit'
         end if
         text = text//newline
      end do
   end function get_levels_csv

   !> The scalars of a run as a namelist file.
   function get_summary(case, history, criteria) result(text)
      !> The case.
      type(case_type), intent(in) :: case
      !> Its force history.
      type(force_history_type), intent(in) :: history
      !> The criteria: [n_criterion].
      type(criterion_type), intent(in) :: criteria(:)
      !> Text of `summary.nml`.
      character(len=:), allocatable :: text

      text = '! thud '//version//': results of case '//trim(case%name)//', SI units, levels in dB re 1 N'//newline &
         //newline//'&summary'//newline &
         //line('case', quoted(case%name), '') &
         //line('model', quoted(case%model), '') &
         //line('contact_time', to_text(history%contact_time), 's') &
         //line('peak_force', to_text(history%peak_force), 'N, of the elastic force') &
         //line('peak_floor_force', to_text(history%peak_floor_force), 'N') &
         //line('max_deflection', to_text(history%max_deflection), 'm') &
         //line('impact_velocity', to_text(history%impact_velocity), 'm/s') &
         //line('restitution', to_text(history%restitution), '') &
         //line('impulse', to_text(history%impulse), 'N s, of the floor force') &
         //'/'//newline//newline//fact_group(history)//'&checks'//newline &
         //line('impulse_residual', to_text(history%impulse_residual), 'of the change of momentum') &
         //line('energy_residual', to_text(history%energy_residual), 'of the energy at first touch') &
         //'/'//newline//newline//'&verdict'//newline &
         //line('source', quoted(case%source), '') &
         //line('level_method', quoted(case%level_method), '') &
         //line('level_force', quoted(case%level_force), '') &
         //line('conforms', to_text(all(conforms(criteria))), '') &
         //line('criterion', join_quoted(criteria%name), '') &
         //line('unit', join_quoted(criteria%unit), '') &
         //line('value', joined(criteria%value), '') &
         //line('lower', joined(criteria%lower), '') &
         //line('upper', joined(criteria%upper), '') &
         //line('met', joined_logicals(conforms(criteria)), '') &
         //'/'//newline
   end function get_summary

   !> The table that a run shows on the screen.
   function get_table(case, history, elastic_level, floor_level, criteria) result(text)
      !> The case.
      type(case_type), intent(in) :: case
      !> Its force history.
      type(force_history_type), intent(in) :: history
      !> Levels of the elastic force, the octaves first, dB: [n_band].
      real(wp), intent(in) :: elastic_level(:)
      !> Levels of the force on the floor, dB: [n_band].
      real(wp), intent(in) :: floor_level(:)
      !> The criteria, the octaves first: [n_criterion].
      type(criterion_type), intent(in) :: criteria(:)
      !> The table.
      character(len=:), allocatable :: text
      character(len=6), parameter :: octave_name(octave_count) = ['  31.5', '    63', '   125', '   250', '   500']
      integer :: i

      text = '  octave   force exposure level, dB       limits, dB      verdict on the'//newline &
         //'      Hz     elastic       floor      '//padded(case%source, 18)//trim(case%level_force)//' force'//newline
      do i = 1, octave_count
         text = text//'  '//octave_name(i)//right(fixed(elastic_level(i), 2), 12)//right(fixed(floor_level(i), 2), 12) &
            //right(fixed(criteria(i)%lower, 1), 10)//' to '//padded(fixed(criteria(i)%upper, 1), 8) &
            //verdict(criteria(i))//newline
      end do
      text = text//newline &
         //scalar_row('contact time', history%contact_time*1000, 3, 'ms', criteria(octave_count + 1), 1000.0_wp) &
         //scalar_row('restitution', history%restitution, 4, '', criteria(octave_count + 2), 1.0_wp) &
         //scalar_row('peaks of the force', criteria(octave_count + 3)%value, 0, '', criteria(octave_count + 3), 1.0_wp) &
         //scalar_row('mass', case%ball%mass, 3, 'kg', criteria(octave_count + 4), 1.0_wp) &
         //scalar_row('drop height', case%drop%height, 3, 'm', criteria(octave_count + 5), 1.0_wp) &
         //scalar_row('peak elastic force', history%peak_force, 1, 'N') &
         //scalar_row('peak floor force', history%peak_floor_force, 1, 'N') &
         //scalar_row('largest deflection', history%max_deflection*1000, 3, 'mm') &
         //scalar_row('impulse', history%impulse, 3, 'N s') &
         //facts(history)//newline &
         //'  The source '//trim(merge('conforms        ', 'does not conform', all(conforms(criteria)))) &
         //' to the limits of the '//trim(case%source)//' (levels: '//trim(case%level_method)//').'//newline
   end function get_table

   !> Numbers that the model chose or found as a namelist group.
   function fact_group(history) result(text)
      !> The history.
      type(force_history_type), intent(in) :: history
      !> The group; empty where there are none.
      character(len=:), allocatable :: text
      integer :: i

      text = ''
      if (size(history%fact) == 0) return
      text = '&facts'//newline
      do i = 1, size(history%fact_name)
         text = text//line(trim(history%fact_name(i)), to_text(history%fact(i)), trim(history%fact_unit(i)))
      end do
      text = text//'/'//newline//newline
   end function fact_group

   !> The same as rows of the table.
   function facts(history) result(rows)
      !> The history.
      type(force_history_type), intent(in) :: history
      !> One row each.
      character(len=:), allocatable :: rows
      integer :: i

      rows = ''
      do i = 1, size(history%fact_name)
         rows = rows//'  '//padded(spaced(history%fact_name(i)), 20)//right(short_scientific(history%fact(i)), 10)//' ' &
            //trim(history%fact_unit(i))//newline
      end do
   end function facts

   !> A name with blanks for its underscores.
   pure function spaced(name) result(text)
      !> The name.
      character(len=*), intent(in) :: name
      !> The text.
      character(len=len(name)) :: text
      integer :: i

      text = name
      do i = 1, len(name)
         if (name(i:i) == '_') text(i:i) = ' '
      end do
   end function spaced

   !> A number with four digits.
   function short_scientific(value) result(text)
      !> The number.
      real(wp), intent(in) :: value
      !> Its text.
      character(len=:), allocatable :: text
      character(len=10) :: buffer

      write (buffer, '(es10.3)') value
      text = trim(adjustl(buffer))
   end function short_scientific

   !> The free modes on the screen.
   function get_modes_table(modes) result(text)
      !> The modes.
      type(free_modes_type), intent(in) :: modes
      !> The table.
      character(len=:), allocatable :: text
      integer :: i

      text = '  free modes     frequency   harmonic   participation'//newline &
         //'                       Hz                of the pole'//newline &
         //'   rigid        '//right(fixed(modes%rigid_frequency, 3), 9)//right('1', 11)//right('1.000', 16)//newline
      do i = 1, size(modes%frequency)
         text = text//right(to_text(i), 6)//right(fixed(modes%frequency(i), 3), 19) &
            //right(to_text(modes%harmonic(i)), 11)//right(fixed(modes%participation(i), 3), 16)//newline
      end do
   end function get_modes_table

   !> One scalar of the table, with its limits where there are any.
   function scalar_row(name, value, decimals, unit, criterion, scale) result(row)
      !> Name of the quantity.
      character(len=*), intent(in) :: name
      !> Its value in the shown unit.
      real(wp), intent(in) :: value
      !> Digits behind the point.
      integer, intent(in) :: decimals
      !> The shown unit.
      character(len=*), intent(in) :: unit
      !> Limits, in SI units.
      type(criterion_type), intent(in), optional :: criterion
      !> Shown unit over SI unit.
      real(wp), intent(in), optional :: scale
      !> The row.
      character(len=:), allocatable :: row

      row = '  '//padded(name, 20)//right(fixed(value, decimals), 10)//' '//padded(unit, 5)
      if (present(criterion) .and. present(scale)) then
         row = row//right(short(criterion%lower*scale), 8)//' to '//padded(short(criterion%upper*scale), 8) &
            //verdict(criterion)
      end if
      row = trim(row)//newline
   end function scalar_row

   !> A limit with up to three decimals and no idle zeros.
   pure function short(value) result(text)
      !> The limit.
      real(wp), intent(in) :: value
      !> Its text.
      character(len=:), allocatable :: text

      text = fixed(value, 3)
      text = text(:verify(text, '0', back=.true.))
      if (text(len(text):) == '.') text = text(:len(text) - 1)
   end function short

   !> Where a value lies: `conforms`, `too low` or `too high`.
   function verdict(criterion) result(word)
      !> The criterion.
      type(criterion_type), intent(in) :: criterion
      !> The verdict.
      character(len=:), allocatable :: word

      if (conforms(criterion)) then
         word = 'conforms'
      else
         word = trim(merge('too low ', 'too high', criterion%value < criterion%lower))
      end if
   end function verdict

   !> One line of a namelist group.
   pure function line(key, value, note) result(text)
      !> The key.
      character(len=*), intent(in) :: key
      !> Its value as text.
      character(len=*), intent(in) :: value
      !> Unit or remark, may be empty.
      character(len=*), intent(in) :: note
      !> The line with its end.
      character(len=:), allocatable :: text

      text = '   '//key//' = '//value
      if (note /= '') text = text//' ! '//note
      text = text//newline
   end function line

   !> Numbers with commas between.
   pure function joined(values) result(text)
      !> The numbers: [n].
      real(wp), intent(in) :: values(:)
      !> The list.
      character(len=:), allocatable :: text
      integer :: i

      text = to_text(values(1))
      do i = 2, size(values)
         text = text//', '//to_text(values(i))
      end do
   end function joined

   !> Truth values with commas between.
   pure function joined_logicals(values) result(text)
      !> The truth values: [n].
      logical, intent(in) :: values(:)
      !> The list.
      character(len=:), allocatable :: text
      integer :: i

      text = to_text(values(1))
      do i = 2, size(values)
         text = text//', '//to_text(values(i))
      end do
   end function joined_logicals

   !> Text with blanks behind it.
   pure function padded(text, width) result(cell)
      !> The text.
      character(len=*), intent(in) :: text
      !> Width of the cell; longer text keeps its length.
      integer, intent(in) :: width
      !> The cell.
      character(len=:), allocatable :: cell

      cell = trim(text)//repeat(' ', max(width - len_trim(text), 0))
   end function padded

   !> Text with blanks before it.
   pure function right(text, width) result(cell)
      !> The text.
      character(len=*), intent(in) :: text
      !> Width of the cell; longer text keeps its length.
      integer, intent(in) :: width
      !> The cell.
      character(len=:), allocatable :: cell

      cell = repeat(' ', max(width - len(text), 0))//text
   end function right

end module thud_report
