!> Results as tables on the screen.
module thud_screen_tables
   use thud_band, only: band_type, get_band_name, octave_count, octaves
   use thud_case, only: case_type, get_model_number, get_unstated_fields
   use thud_compute, only: get_assessed_force, impact_type, results_type
   use thud_constants, only: version
   use thud_field, only: field_type
   use thud_force_history, only: force_count, force_history_type, force_names
   use thud_kinds, only: wp
   use thud_quantities, only: get_quantities, get_quantity, history_quantity_count, quantities, quantity_type, &
      sample_quantity_count
   use thud_records, only: get_verdict_word
   use thud_refined_drop, only: finer_prefix, finer_quantities
   use thud_registry, only: standard_moduli
   use thud_room_table, only: get_room_table
   use thud_source_limits, only: combine_verdicts, criterion_count, criterion_type, get_verdict, verdict_conforms, &
      verdict_names, verdict_undecided
   use thud_text, only: fixed, flush_right, get_width, marked, newline, padded, replaced, screen_width, significant, to_text
   implicit none (type, external)
   private

   public :: get_defaults_lines, get_force_title, get_impact_table, get_screen_tables, get_verification_rows

   !> Numerical error of a level above which it is shown, dB.
   real(wp), parameter :: shown_error = 0.1_wp

   !> Width of the names of rows.
   integer, parameter :: name_width = 22

contains

   !> All tables of a case.
   subroutine get_screen_tables(case, results, verbose, text)
      type(case_type), intent(in) :: case
      type(results_type), intent(in) :: results
      !> Also show the quantities of the model.
      logical, intent(in) :: verbose
      character(len=:), allocatable, intent(out) :: text
      integer :: i

      text = 'thud '//version//'   case '//trim(case%name)
      if (case%has_impact) text = text//'   model '//trim(case%model)
      text = text//newline
      if (case%has_modes) then
         text = text//newline//'  free modes     frequency   harmonic   participation'//newline &
            //'                       Hz                of the pole'//newline
         do i = 1, size(results%modes%frequency)
            text = text//flush_right(to_text(i), 6)//flush_right(fixed(results%modes%frequency(i), 2), 19) &
               //flush_right(to_text(results%modes%harmonic(i)), 11) &
               //flush_right(fixed(results%modes%participation(i), 3), 16)//newline
         end do
      end if
      if (case%has_impact) text = text//newline//get_impact_table(case, results%impact, verbose)
      if (allocated(results%on_floor)) text = text//newline//get_floor_table(case, results)
      if (allocated(results%room%bands)) text = text//newline//get_room_table(case, results%room, &
         results%impact%history%contact_time, allocated(results%on_floor))
      text = text//get_defaults_lines(case)
      if (.not. case%has_compression) return
      ! The last point, and secant stiffnesses there and at the first deflection above 0.
      associate (deflection => results%compression%deflection, force => results%compression%force)
         i = size(force)
         text = text//newline//'  quasi-static compression between plates'//newline &
            //row('peak deflection', fixed(1.0e3_wp*deflection(i), 2), 'mm') &
            //row('force there', significant(force(i), 4), 'N') &
            //row('secant stiffness', significant(force(i)/deflection(i)/1.0e3_wp, 4), 'kN/m') &
            //row('at the first point', significant(force(2)/deflection(2)/1.0e3_wp, 4), 'kN/m')
      end associate
   end subroutine get_screen_tables

   !> Levels of the assessed force and quantities of the drop on a rigid floor, with limits and verdicts.
   function get_impact_table(case, impact, verbose) result(text)
      type(case_type), intent(in) :: case
      type(impact_type), intent(in) :: impact
      !> Also show the quantities of the model.
      logical, intent(in) :: verbose
      character(len=:), allocatable :: text
      character(len=:), allocatable :: verdict
      integer :: verdicts(criterion_count)
      integer :: i, assessed, other

      assessed = get_assessed_force(case)
      other = force_count + 1 - assessed
      associate (history => impact%history, criteria => impact%assessment%criteria(:, assessed), &
         bands => impact%assessment%bands, level => impact%assessment%level)
         verdicts = get_verdict(criteria)
         ! In most models both forces are equal.
         if (.not. any(abs(level(:, other) - level(:, assessed)) > 0.0_wp)) other = 0
         text = '  '//padded(get_force_title(case%level_force), 27)//padded('value', 16)//padded('limits', 13)//'verdict'
         if (other > 0) text = text//flush_right(trim(force_names(other))//' force', screen_width - len(text))
         text = text//newline
         do i = 1, octave_count
            text = text//level_row(i, criteria(i))
         end do
         do i = octave_count + 1, size(criteria)
            text = text//quantity_row(get_quantity(criteria(i)%name), criteria(i)%value, criteria(i))
         end do
         text = text//newline
         do i = octave_count + 1, size(bands)
            text = text//level_row(i)
         end do
         if (size(bands) > octave_count) text = text//newline
         text = text//quantity_rows(case, history, criteria%name)
         if (verbose) text = text//model_quantity_rows(history, '')
         text = text//error_rows(history, verdicts(:octave_count) == verdict_undecided)
         if (.not. history%numerical_error%known) text = text//row('numerical error', 'unknown', '')
         verdict = marked(verdict_names(combine_verdicts(verdicts)), combine_verdicts(verdicts))
         if (combine_verdicts(verdicts) == verdict_undecided) then
            verdict = 'it is '//verdict//' whether the source conforms'
         else
            verdict = 'the source '//verdict
         end if
         text = text//get_verification_rows(history)//newline//'  With these values '//verdict//' to the limits of the ' &
            //replaced(trim(case%source), '_', ' ')//': it meets ' &
            //to_text(count(verdicts == verdict_conforms))//' of '//to_text(size(criteria))//' criteria'
         if (any(verdicts == verdict_undecided)) text = text//'; '//to_text(count(verdicts == verdict_undecided)) &
            //' undecided by the numerical error'
         text = text//'.'//newline//'  Levels in dB re 1 N, method '//trim(case%level_method)//'.'//newline
      end associate

   contains

      !> Row with the level of a band, by both forces if they differ.
      function level_row(band, criterion) result(line)
         !> Index of the band.
         integer, intent(in) :: band
         !> Limits of the level, if there are any.
         type(criterion_type), intent(in), optional :: criterion
         character(len=:), allocatable :: line

         associate (assessment => impact%assessment)
            line = row(get_level_title(assessment%bands(band)), fixed(assessment%level(band, assessed), 2), 'dB', &
               criterion, 1.0_wp)
            if (other == 0) return
            line = line(:len(line) - 1)
            line = line//flush_right(fixed(assessment%level(band, other), 2)//' dB', screen_width - get_width(line))//newline
         end associate
      end function level_row

   end function get_impact_table

   !> Name of the level of a band.
   function get_level_title(band) result(title)
      type(band_type), intent(in) :: band
      character(len=name_width) :: title

      title = 'level, '//get_band_name(band)//' Hz '//band%set
   end function get_level_title

   !> Levels and quantities of the drop on a mobile floor.
   function get_floor_table(case, results) result(text)
      type(case_type), intent(in) :: case
      !> Results with a drop on a mobile floor.
      type(results_type), intent(in) :: results
      character(len=:), allocatable :: text
      character(len=:), allocatable :: deviation, line
      character(len=1) :: none(0)
      integer :: i

      associate (history => results%on_floor, floor => results%floor, &
         blocked => results%impact%assessment%level(results%impact%assessment%first_band:, 2))
         text = '  '//padded('on '//trim(case%floor), 27)//padded('contact', 13)//padded('- blocked', 15)//'energy'//newline
         do i = 1, size(floor%bands)
            line = row(get_level_title(floor%bands(i)), fixed(floor%contact_level(i), 2), 'dB')
            text = text//padded(line(:len(line) - 1), 40)//flush_right(fixed(floor%contact_level(i) - blocked(i), 2), 8) &
               //' dB  '//with_prefix(floor%energy(i), 'J', 3, 8)//newline
         end do
         text = text//newline//quantity_rows(case, history, none) &
            //row('velocity of the floor', significant(1.0e3_wp*maxval(abs(history%floor_velocity)), 3), 'mm/s') &
            //row('its displacement', significant(1.0e3_wp*maxval(abs(history%floor_displacement)), 3), 'mm') &
            //quantity_row(get_quantity('floor_work'), history%floor_work) &
            //error_rows(history, spread(.false., 1, octave_count))
         deviation = fixed(1.0e2_wp*(floor%total_energy/max(history%floor_work, tiny(1.0_wp)) - 1), 2)
         if (deviation == '0.00') deviation = 'less than 0.01'
         text = text//get_verification_rows(history)//newline//'  The energy by the mobility of the floor, in all ' &
            //'frequencies, differs by '//deviation//' %.'//newline
      end associate
   end function get_floor_table

   !> Rows with the quantities of a drop, without the peak of the force that is not assessed.
   function quantity_rows(case, history, listed) result(rows)
      type(case_type), intent(in) :: case
      type(force_history_type), intent(in) :: history
      !> Names of quantities that another row shows: [n].
      character(len=*), intent(in) :: listed(:)
      character(len=:), allocatable :: rows
      real(wp) :: values(history_quantity_count)
      character(len=18) :: other
      integer :: i

      rows = ''
      other = merge('peak_elastic_force', 'peak_force        ', case%level_force == 'floor')
      values = get_quantities(history)
      do i = 1, sample_quantity_count
         if (any(listed == quantities(i)%name) .or. quantities(i)%name == other) cycle
         rows = rows//quantity_row(quantities(i), values(i))
      end do
   end function quantity_rows

   !> Rows with large numerical errors of octave levels.
   function error_rows(history, matters) result(rows)
      type(force_history_type), intent(in) :: history
      !> The error matters, however small: [octave_count].
      logical, intent(in) :: matters(:)
      character(len=:), allocatable :: rows
      integer :: i

      rows = ''
      do i = 1, octave_count
         associate (error => history%numerical_error%octave(i))
            if (history%numerical_error%known .and. (error > shown_error .or. matters(i))) rows = rows &
               //row('error at '//get_band_name(octaves(i))//' Hz', fixed(error, 2), 'dB')
         end associate
      end do
   end function error_rows

   !> Lines that name the main groups missing from the file, and the values of the standard ball for keys that it does not
   !> state.
   function get_defaults_lines(case) result(lines)
      type(case_type), intent(in), target :: case
      !> The lines; empty if nothing is missing.
      character(len=:), allocatable :: lines
      character(len=:), allocatable :: value
      type(field_type), allocatable :: fields(:)
      integer :: i

      lines = ''
      if (case%left_out /= '') lines = '  Defaults hold for'//trim(case%left_out)//', which the file leaves out.'//newline
      allocate (fields, source=get_unstated_fields(case))
      ! Without a wall the modulus has no effect.
      if (.not. standard_moduli(get_model_number(case)) > 0.0_wp) fields = fields(:0)
      if (size(fields) > 0) lines = lines//'  Not stated, so of the standard ball:'
      do i = 1, size(fields)
         call fields(i)%get_text(value)
         lines = lines//' '//trim(fields(i)%key)//' = '//trim(value//' '//fields(i)%unit) &
            //merge(newline, ',', i == size(fields))
      end do
   end function get_defaults_lines

   !> Name of a force in tables for readers.
   pure function get_force_title(force) result(title)
      !> One of `force_names`.
      character(len=*), intent(in) :: force
      character(len=merge(18, 13, force == 'floor')) :: title

      title = merge('force on the floor', 'elastic force     ', force == 'floor')
   end function get_force_title

   !> Row for a quantity, with its limits if there are any.
   function quantity_row(quantity, value, criterion) result(text)
      type(quantity_type), intent(in) :: quantity
      !> Value, in SI units.
      real(wp), intent(in) :: value
      !> Limits, in SI units.
      type(criterion_type), intent(in), optional :: criterion
      character(len=:), allocatable :: text
      character(len=:), allocatable :: number
      real(wp) :: shown

      shown = quantity%display_scale*value
      number = fixed(shown, quantity%decimals)
      ! Below the last decimal with three significant digits, 0 as `0`.
      if (abs(shown) < 10.0_wp**(-quantity%decimals)) number = significant(shown, 3)
      text = row(quantity%title, number, quantity%display_unit, criterion, quantity%display_scale)
   end function quantity_row

   !> Row for a number, with its limits if there are any.
   function row(name, value, unit, criterion, scale) result(text)
      character(len=*), intent(in) :: name
      !> Text of the value in the shown unit.
      character(len=*), intent(in) :: value
      !> The shown unit.
      character(len=*), intent(in) :: unit
      !> Limits, in SI units.
      type(criterion_type), intent(in), optional :: criterion
      !> Factor from the SI unit to the shown unit.
      real(wp), intent(in), optional :: scale
      character(len=:), allocatable :: text
      character(len=:), allocatable :: limits

      text = '  '//padded(name, name_width)//flush_right(value, 10)//' '//padded(unit, 5)
      if (present(criterion) .and. present(scale)) then
         limits = flush_right(short(criterion%lower*scale), 7)
         ! A single number if both are equal.
         if (criterion%upper > criterion%lower) limits = limits//' to '//short(criterion%upper*scale)
         text = text//padded(limits, 18)//marked(get_verdict_word(criterion), get_verdict(criterion))
      end if
      text = trim(text)//newline
   end function row

   !> Rows with the quantities of the model.
   function model_quantity_rows(history, prefix) result(rows)
      type(force_history_type), intent(in) :: history
      !> `finer_prefix` for the resolution of the drop at a finer one, or empty.
      character(len=*), intent(in) :: prefix
      character(len=:), allocatable :: rows
      integer :: i

      rows = ''
      do i = 1, size(history%model_quantity_name)
         associate (name => history%model_quantity_name(i), value => history%model_quantity(i), &
            unit => history%model_quantity_unit(i))
            if ((index(name, finer_prefix) == 1 .neqv. prefix /= '') .or. any(finer_quantities == name)) cycle
            ! On a hard floor there is none.
            if (name == 'maximum_penetration' .and. .not. value > 0.0_wp) cycle
            rows = rows//'  '//padded(replaced(trim(name(len(prefix) + 1:)), '_', ' '), name_width)
            if (unit /= '') then
               rows = rows//with_prefix(value, trim(unit), 4, 10)//newline
            else if (abs(value - anint(value)) > 0.0_wp) then
               rows = rows//flush_right(significant(value, 4), 10)//newline
            else
               rows = rows//flush_right(fixed(value, 0), 10)//newline
            end if
         end associate
      end do
   end function model_quantity_rows

   !> A number with significant digits and the prefix of its unit: ` 90.9 mJ`.
   pure function with_prefix(value, unit, digits, width) result(text)
      !> Value in the unit without prefix.
      real(wp), intent(in) :: value
      character(len=*), intent(in) :: unit
      integer, intent(in) :: digits
      !> Width of the number.
      integer, intent(in) :: width
      character(len=:), allocatable :: text
      character(len=*), parameter :: prefixes(-3:3) = ['n', 'u', 'm', ' ', 'k', 'M', 'G']
      integer :: power

      power = floor(log10(max(abs(value), tiny(1.0_wp)))/3)
      if (abs(power) > 3) power = 0
      text = flush_right(significant(value*10.0_wp**(-3*power), digits), width)//' '//trim(adjustl(prefixes(power)//unit))
   end function with_prefix

   !> Rows that compare a result with that at a finer resolution and with the stated error; none if it is not verified.
   function get_verification_rows(history) result(rows)
      type(force_history_type), intent(in) :: history
      character(len=:), allocatable :: rows
      type(quantity_type) :: quantity, error_quantity
      character(len=:), allocatable :: line
      real(wp), dimension(size(finer_quantities)) :: values, errors
      real(wp) :: change, stated
      integer :: i, first

      rows = ''
      first = findloc(history%model_quantity_name, finer_quantities(1), dim=1)
      if (first == 0) return
      rows = newline//'  at a finer resolution      value          change    stated error'//newline &
         //model_quantity_rows(history, finer_prefix)
      values = [history%octave_level, history%contact_time, history%restitution, history%peak_force]
      associate (error => history%numerical_error)
         errors = [error%octave, error%contact_time, error%restitution, error%peak_force]
      end associate
      do i = 1, size(finer_quantities)
         associate (name => finer_quantities(i) (len(finer_prefix) + 1:), finer => history%model_quantity(first - 1 + i))
            error_quantity = get_quantity(trim(name)//'_error')
            quantity = error_quantity
            if (i > octave_count) quantity = get_quantity(name)
            if (i <= octave_count) quantity%title = get_level_title(octaves(min(i, octave_count)))
            line = quantity_row(quantity, finer)
            change = (finer - values(i))*quantity%display_scale
            stated = errors(i)*quantity%display_scale
            rows = rows//padded(line(:len(line) - 1), 40)//flush_right(fixed(change, error_quantity%decimals), 8) &
               //flush_right(fixed(stated, error_quantity%decimals), 16)
            ! As far as the decimals show it.
            if (abs(change) > stated + 0.5_wp*10.0_wp**(-error_quantity%decimals)) rows = rows//'  exceeded'
            rows = rows//newline
         end associate
      end do
   end function get_verification_rows

   !> A limit with up to three decimals, without trailing zeros.
   pure function short(value) result(text)
      real(wp), intent(in) :: value
      character(len=:), allocatable :: text

      text = fixed(value, 3)
      text = text(:verify(text, '0', back=.true.))
      if (text(len(text):) == '.') text = text(:len(text) - 1)
   end function short

end module thud_screen_tables
