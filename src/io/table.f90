!> Results as tables on the screen.
module thud_table
   use thud_band, only: get_band_name, octave_count
   use thud_case, only: case_type
   use thud_compute, only: get_judged_force, verdict_type
   use thud_force_history, only: force_history_type
   use thud_free_modes, only: free_modes_type
   use thud_kinds, only: wp
   use thud_report, only: get_word
   use thud_source_limits, only: conforms, criterion_type
   use thud_text, only: fixed, newline, replaced, to_text
   implicit none (type, external)
   private

   public :: get_modes_table, get_table

contains

   !> The table that a run shows on the screen.
   function get_table(case, history, verdict) result(text)
      type(case_type), intent(in) :: case
      type(force_history_type), intent(in) :: history
      type(verdict_type), intent(in) :: verdict
      character(len=:), allocatable :: text
      integer :: i

      text = '  octave   force exposure level, dB       limits, dB      verdict on the'//newline &
         //'      Hz     elastic       floor      '//padded(case%source, 18)//trim(case%level_force)//' force'//newline
      associate (criteria => verdict%criteria(:, get_judged_force(case)))
         do i = 1, octave_count
            text = text//'  '//right(get_band_name(verdict%bands(i)), 6)//right(fixed(verdict%level(i, 1), 2), 12) &
               //right(fixed(verdict%level(i, 2), 2), 12)//right(fixed(criteria(i)%lower, 1), 10)//' to ' &
               //padded(fixed(criteria(i)%upper, 1), 8)//get_word(criteria(i))//newline
         end do
         text = text//newline &
            //scalar_row('contact time', history%contact_time*1000, 3, 'ms', criteria(octave_count + 1), 1000.0_wp) &
            //scalar_row('restitution', history%restitution, 4, '', criteria(octave_count + 2), 1.0_wp) &
            //scalar_row('peaks of the force', criteria(octave_count + 3)%value, 0, '', criteria(octave_count + 3), 1.0_wp) &
            //scalar_row('mass', case%ball%mass, 3, 'kg', criteria(octave_count + 4), 1.0_wp) &
            //scalar_row('drop height', case%drop%height, 3, 'm', criteria(octave_count + 5), 1.0_wp) &
            //scalar_row('peak elastic force', history%peak_elastic_force, 1, 'N') &
            //scalar_row('peak floor force', history%peak_force, 1, 'N') &
            //scalar_row('maximum deflection', history%max_deflection*1000, 3, 'mm') &
            //scalar_row('impulse', history%impulse, 3, 'N s') &
            //facts(history)//newline &
            //'  The source '//trim(merge('conforms        ', 'does not conform', all(conforms(criteria)))) &
            //' to the limits of the '//trim(case%source)//' (levels: '//trim(case%level_method)//').'//newline
      end associate
   end function get_table

   !> The free modes on the screen.
   function get_modes_table(modes) result(text)
      type(free_modes_type), intent(in) :: modes
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
      character(len=*), intent(in) :: name
      !> Its value in the shown unit.
      real(wp), intent(in) :: value
      integer, intent(in) :: decimals
      !> The shown unit.
      character(len=*), intent(in) :: unit
      !> Limits, in SI units.
      type(criterion_type), intent(in), optional :: criterion
      !> Shown unit over SI unit.
      real(wp), intent(in), optional :: scale
      character(len=:), allocatable :: row

      row = '  '//padded(name, 20)//right(fixed(value, decimals), 10)//' '//padded(unit, 5)
      if (present(criterion) .and. present(scale)) then
         row = row//right(short(criterion%lower*scale), 8)//' to '//padded(short(criterion%upper*scale), 8) &
            //get_word(criterion)
      end if
      row = trim(row)//newline
   end function scalar_row

   !> Numbers that the model chose or found, as rows.
   function facts(history) result(rows)
      type(force_history_type), intent(in) :: history
      character(len=:), allocatable :: rows
      integer :: i

      rows = ''
      do i = 1, size(history%fact_name)
         rows = rows//'  '//padded(replaced(history%fact_name(i), '_', ' '), 20) &
            //right(short_scientific(history%fact(i)), 10)//' '//trim(history%fact_unit(i))//newline
      end do
   end function facts

   !> A number with four digits.
   function short_scientific(value) result(text)
      real(wp), intent(in) :: value
      character(len=:), allocatable :: text
      character(len=10) :: buffer

      write (buffer, '(es10.3)') value
      text = trim(adjustl(buffer))
   end function short_scientific

   !> A limit with up to three decimals and no trailing zeros.
   pure function short(value) result(text)
      real(wp), intent(in) :: value
      character(len=:), allocatable :: text

      text = fixed(value, 3)
      text = text(:verify(text, '0', back=.true.))
      if (text(len(text):) == '.') text = text(:len(text) - 1)
   end function short

   !> Left-justified text.
   pure function padded(text, width) result(cell)
      character(len=*), intent(in) :: text
      !> Width of the cell; longer text keeps its length.
      integer, intent(in) :: width
      character(len=:), allocatable :: cell

      cell = trim(text)//repeat(' ', max(width - len_trim(text), 0))
   end function padded

   !> Right-justified text.
   pure function right(text, width) result(cell)
      character(len=*), intent(in) :: text
      !> Width of the cell; longer text keeps its length.
      integer, intent(in) :: width
      character(len=:), allocatable :: cell

      cell = repeat(' ', max(width - len(text), 0))//text
   end function right

end module thud_table
