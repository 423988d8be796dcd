!> The drop on a mobile floor as text: files and the table on the screen.
module thud_floor_report
   use thud_band, only: band_type, get_band_name, get_octaves, octave_count
   use thud_case, only: case_type
   use thud_compute, only: impact_type
   use thud_csv, only: get_table_csv
   use thud_floor_result, only: floor_result_type
   use thud_force_history, only: force_history_type, force_names
   use thud_kinds, only: wp
   use thud_quantities, only: get_quantities, get_quantity, history_quantity_count, quantities, quantity_type, &
      sample_quantity_count, show
   use thud_report, only: get_model_quantities, get_force_csv, get_quantity_lines, line
   use thud_table, only: get_verification_rows, is_peak_of_other, shown_error, with_prefix
   use thud_text, only: fixed, flush_right, newline, significant, to_text
   implicit none (type, external)
   private

   public :: get_floor_force_csv, get_floor_levels_csv, get_floor_summary, get_floor_table

   !> Widths of the columns of the table: names, numbers, units, energies.
   integer, parameter :: name_column = 22, number_column = 10, unit_column = 4, energy_column = 8

   !> Additional columns of `floor_force.csv` for every floor.
   character(len=32), parameter :: own_columns(3) = [character(len=32) :: &
      'blocked_force_N', 'floor_displacement_m', 'floor_velocity_m_per_s']

contains

   !> Forces and motion of the floor against time.
   subroutine get_floor_force_csv(blocked, contact, floor_result, text)
      !> The drops on rigid and mobile floor.
      type(force_history_type), intent(in) :: blocked, contact
      type(floor_result_type), intent(in) :: floor_result
      !> Text of `floor_force.csv`.
      character(len=:), allocatable, intent(out) :: text
      character(len=32) :: names(size(own_columns) + size(floor_result%point_velocity, 2))
      real(wp) :: columns(size(contact%floor_force), size(names))
      integer :: i

      names(:size(own_columns)) = own_columns
      do i = 1, size(floor_result%point_velocity, 2)
         names(size(own_columns) + i) = 'point_'//to_text(i)//'_velocity_m_per_s'
      end do
      columns(:, 1) = blocked%floor_force
      columns(:, 2) = contact%floor_displacement
      columns(:, 3) = contact%floor_velocity
      columns(:, size(own_columns) + 1:) = floor_result%point_velocity
      text = get_force_csv(contact, names, columns)
   end subroutine get_floor_force_csv

   !> Levels of both forces, and energies, in each band.
   subroutine get_floor_levels_csv(impact, floor_result, text)
      !> The drop on a rigid floor.
      type(impact_type), intent(in) :: impact
      type(floor_result_type), intent(in) :: floor_result
      !> Text of `floor_levels.csv`.
      character(len=:), allocatable, intent(out) :: text

      associate (bands => floor_result%bands, blocked => get_blocked_levels(impact), contact => floor_result%contact_level)
         text = get_table_csv('bandwidth,nominal_Hz,lower_edge_Hz,upper_edge_Hz,blocked_level_dB,contact_level_dB,' &
            //'difference_dB,energy_J,conductance_m_per_Ns', reshape([bands%nominal, bands%lower, bands%upper, blocked, &
            contact, contact - blocked, floor_result%energy, floor_result%conductance], [size(bands), 8]), bands%set)
      end associate
   end subroutine get_floor_levels_csv

   !> Levels of the force on a rigid floor in the bands of the case, dB: [n_band].
   pure function get_blocked_levels(impact) result(level)
      type(impact_type), intent(in) :: impact
      real(wp), allocatable :: level(:)

      level = impact%assessment%level(impact%assessment%first_band:, findloc(force_names, 'floor', dim=1))
   end function get_blocked_levels

   !> The quantities of the drop on the mobile floor.
   subroutine get_floor_summary(contact, text)
      type(force_history_type), intent(in) :: contact
      !> Groups of `summary.nml`.
      character(len=:), allocatable, intent(out) :: text

      text = newline//'&floor_summary'//newline//get_quantity_lines(contact)//line('floor_work', &
         to_text(contact%floor_work), 'J')//'/'//newline
      if (size(contact%model_quantity) > 0) text = text//newline//get_model_quantities('floor_model_quantities', contact)
   end subroutine get_floor_summary

   !> Table that compares the drops on mobile and rigid floor.
   subroutine get_floor_table(case, impact, contact, floor_result, text)
      type(case_type), intent(in) :: case
      !> The drop on a rigid floor.
      type(impact_type), intent(in) :: impact
      !> The drop on the mobile floor.
      type(force_history_type), intent(in) :: contact
      type(floor_result_type), intent(in) :: floor_result
      !> The table.
      character(len=:), allocatable, intent(out) :: text
      character(len=name_column) :: name
      character(len=:), allocatable :: deviation
      real(wp), allocatable :: blocked_level(:)
      real(wp) :: values(history_quantity_count, 2)
      type(band_type) :: octaves(octave_count)
      integer :: i

      octaves = get_octaves()
      allocate (blocked_level, source=get_blocked_levels(impact))
      name = 'on '//trim(case%floor)
      text = '  '//name//'   blocked       contact    difference       energy'//newline
      do i = 1, size(floor_result%bands)
         name = 'level, '//get_band_name(floor_result%bands(i))//' Hz '//trim(floor_result%bands(i)%set)
         associate (contact_level => floor_result%contact_level(i))
            text = text//'  '//name//cell(fixed(blocked_level(i), 2), 'dB')//cell(fixed(contact_level, 2), 'dB') &
               //cell(fixed(contact_level - blocked_level(i), 2), 'dB') &
               //with_prefix(floor_result%energy(i), 'J', 3, energy_column)//newline
         end associate
      end do
      text = text//newline
      values(:, 1) = get_quantities(impact%history)
      values(:, 2) = get_quantities(contact)
      do i = 1, sample_quantity_count
         if (is_peak_of_other(quantities(i), case)) cycle
         call add_quantity(quantities(i), values(i, 1), values(i, 2))
      end do
      call add_row('velocity of the floor', '-', significant(1.0e3_wp*maxval(abs(contact%floor_velocity)), 3), 'mm/s')
      call add_row('its displacement', '-', significant(1.0e3_wp*maxval(abs(contact%floor_displacement)), 3), 'mm')
      associate (work => get_quantity('floor_work'))
         call add_row(trim(work%title), '-', show(work, work%display_scale*contact%floor_work), trim(work%display_unit))
      end associate
      do i = 1, octave_count
         associate (errors => [impact%history%numerical_error%octave(i), contact%numerical_error%octave(i)])
            if (errors(2) > shown_error) call add_row('error at '//get_band_name(octaves(i))//' Hz', fixed(errors(1), 2), &
               fixed(errors(2), 2), 'dB')
         end associate
      end do
      text = text//get_verification_rows(contact)
      deviation = fixed(1.0e2_wp*(floor_result%total_energy/max(contact%floor_work, tiny(1.0_wp)) - 1), 2)
      if (deviation == '0.00') deviation = 'less than 0.01'
      text = text//newline//'  The energy by the mobility of the floor, in all frequencies, differs by '//deviation//' %.' &
         //newline

   contains

      !> Adds a quantity of both drops.
      subroutine add_quantity(quantity, rigid, moving)
         type(quantity_type), intent(in) :: quantity
         !> Values on rigid and mobile floor, SI units.
         real(wp), intent(in) :: rigid, moving

         call add_row(trim(quantity%title), show(quantity, quantity%display_scale*rigid), &
            show(quantity, quantity%display_scale*moving), trim(quantity%display_unit))
      end subroutine add_quantity

      !> Adds a number of both drops.
      subroutine add_row(title, rigid, moving, unit)
         character(len=*), intent(in) :: title
         !> Values on rigid and mobile floor, in the shown unit, as text.
         character(len=*), intent(in) :: rigid, moving
         character(len=*), intent(in) :: unit

         name = title
         text = text//'  '//name//merge(cell(rigid, ''), cell(rigid, unit), rigid == '-')//trim(cell(moving, unit))//newline
      end subroutine add_row

   end subroutine get_floor_table

   !> A number with its unit in a column.
   pure function cell(number, unit) result(text)
      character(len=*), intent(in) :: number, unit
      character(len=number_column + 1 + unit_column) :: text

      text = flush_right(number, number_column)//' '//unit
   end function cell

end module thud_floor_report
