!> Results as tables on the screen.
module thud_table
   use thud_band, only: band_type, get_band_name, get_octaves, octave_count
   use thud_case, only: case_type, get_model_number, get_unstated_fields
   use thud_compression, only: compression_type
   use thud_compute, only: assessment_type, get_assessed_force
   use thud_error, only: error_type
   use thud_field, only: field_type
   use thud_force_exposure, only: get_force_exposure_levels
   use thud_force_history, only: force_count, force_history_type, force_names, get_model_quantity, has_quantity
   use thud_free_modes, only: free_modes_type
   use thud_kinds, only: wp
   use thud_quantities, only: get_quantities, get_quantity, history_quantity_count, quantities, quantity_type, &
      sample_quantity_count, show
   use thud_refined_drop, only: finer_prefix, finer_quantities, resolution_quantities
   use thud_report, only: get_verdict_word
   use thud_source_limits, only: combine_verdicts, criterion_type, get_verdict, verdict_conforms, verdict_names, &
      verdict_undecided
   use thud_text, only: fixed, flush_right, newline, padded, replaced, screen_width, significant, to_text
   implicit none (type, external)
   private

   public :: get_compression_table, get_defaults_lines, get_force_title, get_modes_table, get_span_row, get_table
   public :: get_verification_rows, is_peak_of_other, with_prefix

   !> Numerical error of a level above which it is shown, dB.
   real(wp), parameter, public :: shown_error = 0.1_wp

contains

   !> The table that a run shows on the screen.
   function get_table(case, history, assessment, verbose) result(text)
      type(case_type), intent(in) :: case
      type(force_history_type), intent(in) :: history
      type(assessment_type), intent(in) :: assessment
      !> Also show the resolution and the quantities of the model.
      logical, intent(in) :: verbose
      character(len=:), allocatable :: text
      character(len=:), allocatable :: resolution
      real(wp) :: values(history_quantity_count)
      character(len=:), allocatable :: verdict, undecided
      integer, allocatable :: verdicts(:)
      integer :: i, assessed, other

      assessed = get_assessed_force(case)
      other = force_count + 1 - assessed
      ! In most models both forces are equal.
      if (.not. any(abs(assessment%level(:, other) - assessment%level(:, assessed)) > 0.0_wp)) other = 0
      text = '  '//padded(get_force_title(case%level_force), 27)//padded('value', 16)//padded('limits', 13)//'verdict'
      if (other > 0) text = text//flush_right(trim(merge('floor force  ', 'elastic force', force_names(other) == 'floor')), &
         screen_width - len(text))
      text = text//newline
      associate (criteria => assessment%criteria(:, assessed))
         verdicts = get_verdict(criteria)
         do i = 1, octave_count
            text = text//level_row(i, criteria(i))
         end do
         do i = octave_count + 1, size(criteria)
            text = text//quantity_row(get_quantity(criteria(i)%name), criteria(i)%value, criteria(i))
         end do
         text = text//newline
         do i = octave_count + 1, size(assessment%bands)
            text = text//level_row(i)
         end do
         if (size(assessment%bands) > octave_count) text = text//newline
         values = get_quantities(history)
         do i = 1, sample_quantity_count
            ! Quantities with limits are listed above.
            if (any(criteria%name == quantities(i)%name)) cycle
            if (is_peak_of_other(quantities(i), case)) cycle
            text = text//quantity_row(quantities(i), values(i))
         end do
         if (verbose) then
            text = text//model_quantity_rows(history)
            resolution = get_resolution(history, '')
            if (resolution /= '') text = text//'  resolution: '//resolution//newline
         end if
         do i = 1, octave_count
            associate (error => history%numerical_error%octave(i))
               if (.not. history%numerical_error%known) exit
               if (error > shown_error .or. verdicts(i) == verdict_undecided) text = text//row('error at ' &
                  //get_band_name(assessment%bands(i))//' Hz', fixed(error, 2), 'dB')
            end associate
         end do
         if (.not. history%numerical_error%known) text = text//row('numerical error', 'unknown', '')
         text = text//get_verification_rows(history)//newline
         verdict = 'the source '//trim(verdict_names(combine_verdicts(verdicts)))
         if (combine_verdicts(verdicts) == verdict_undecided) verdict = 'it is undecided whether the source conforms'
         undecided = ''
         if (any(verdicts == verdict_undecided)) undecided = '; '//to_text(count(verdicts == verdict_undecided)) &
            //' undecided by the numerical error'
         text = text//'  With these values '//verdict//' to the limits of the ' &
            //replaced(trim(case%source), '_', ' ')//': it meets ' &
            //to_text(count(verdicts == verdict_conforms))//' of '//to_text(size(criteria)) &
            //' criteria'//undecided//'.'//newline &
            //'  Levels in dB re 1 N, method '//trim(case%level_method)//'.'//newline
      end associate

   contains

      !> Row with the level of a band, by both forces if they differ.
      function level_row(band, criterion) result(line)
         !> Index of the band.
         integer, intent(in) :: band
         !> Limits of the level, if there are any.
         type(criterion_type), intent(in), optional :: criterion
         character(len=:), allocatable :: line

         line = row('level, '//get_band_name(assessment%bands(band))//' Hz '//trim(assessment%bands(band)%set), &
            fixed(assessment%level(band, assessed), 2), 'dB', criterion, 1.0_wp)
         if (other == 0) return
         line = line(:len(line) - 1)
         line = line//flush_right(fixed(assessment%level(band, other), 2)//' dB', screen_width - len(line))//newline
      end function level_row

   end function get_table

   !> Whether a quantity is the peak of the force that is not assessed.
   pure function is_peak_of_other(quantity, case) result(yes)
      type(quantity_type), intent(in) :: quantity
      type(case_type), intent(in) :: case
      logical :: yes

      yes = quantity%name == merge('peak_elastic_force', 'peak_force        ', case%level_force == 'floor')
   end function is_peak_of_other

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
      if (.not. case%models(get_model_number(case))%model%get_standard_modulus() > 0.0_wp) fields = fields(:0)
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

   !> Table of the free modes for the screen.
   function get_modes_table(modes) result(text)
      type(free_modes_type), intent(in) :: modes
      character(len=:), allocatable :: text
      integer :: i

      text = '  free modes     frequency   harmonic   participation'//newline &
         //'                       Hz                of the pole'//newline
      do i = 1, size(modes%frequency)
         text = text//flush_right(to_text(i), 6)//flush_right(fixed(modes%frequency(i), 2), 19) &
            //flush_right(to_text(modes%harmonic(i)), 11)//flush_right(fixed(modes%participation(i), 3), 16)//newline
      end do
   end function get_modes_table

   !> Table of the quasi-static compression for the screen: last point, secant stiffness there and at the first deflection
   !> above 0.
   function get_compression_table(compression) result(text)
      type(compression_type), intent(in) :: compression
      character(len=:), allocatable :: text

      associate (deflection => compression%deflection, force => compression%force, n => size(compression%force))
         text = '  quasi-static compression between plates'//newline &
            //row('peak deflection', fixed(1.0e3_wp*deflection(n), 2), 'mm') &
            //row('force there', significant(force(n), 4), 'N') &
            //row('secant stiffness', significant(force(n)/deflection(n)/1.0e3_wp, 4), 'kN/m') &
            //row('at the first point', significant(force(2)/deflection(2)/1.0e3_wp, 4), 'kN/m')
      end associate
   end function get_compression_table

   !> Row for a quantity, with its limits if there are any.
   function quantity_row(quantity, value, criterion) result(text)
      type(quantity_type), intent(in) :: quantity
      !> Value, in SI units.
      real(wp), intent(in) :: value
      !> Limits, in SI units.
      type(criterion_type), intent(in), optional :: criterion
      character(len=:), allocatable :: text

      text = row(quantity%title, show(quantity, quantity%display_scale*value), quantity%display_unit, criterion, &
         quantity%display_scale)
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

      text = '  '//padded(name, 22)//flush_right(value, 10)//' '//padded(unit, 5)
      if (present(criterion) .and. present(scale)) text = text//get_limits(criterion, scale)//get_verdict_word(criterion)
      text = trim(text)//newline
   end function row

   !> Minimum and maximum conforming value in the shown unit; a single number if they are equal.
   pure function get_limits(criterion, scale) result(text)
      type(criterion_type), intent(in) :: criterion
      !> Factor from the SI unit to the shown unit.
      real(wp), intent(in) :: scale
      character(len=:), allocatable :: text

      text = flush_right(short(criterion%lower*scale), 7)
      if (criterion%upper > criterion%lower) text = text//' to '//short(criterion%upper*scale)
      text = padded(text, 18)
   end function get_limits

   !> Row with minimum and maximum of a quantity.
   function get_span_row(name, span, decimals, unit) result(text)
      character(len=*), intent(in) :: name
      !> Minimum and maximum in the shown unit: [2].
      real(wp), intent(in) :: span(2)
      integer, intent(in) :: decimals
      !> The shown unit.
      character(len=*), intent(in) :: unit
      character(len=:), allocatable :: text

      text = '  '//padded(name, 22)//flush_right(fixed(span(1), decimals), 10)//' to ' &
         //flush_right(fixed(span(2), decimals), 8)//' '//unit//newline
   end function get_span_row

   !> Rows with the quantities of the model.
   function model_quantity_rows(history) result(rows)
      type(force_history_type), intent(in) :: history
      character(len=:), allocatable :: rows
      integer :: i

      rows = ''
      do i = 1, size(history%model_quantity_name)
         if (index(history%model_quantity_name(i), finer_prefix) == 1) cycle
         if (any(resolution_quantities == history%model_quantity_name(i))) cycle
         ! On a hard floor there is none.
         if (history%model_quantity_name(i) == 'maximum_penetration' .and. .not. history%model_quantity(i) > 0.0_wp) cycle
         rows = rows//'  '//padded(replaced(trim(history%model_quantity_name(i)), '_', ' '), 22)
         if (history%model_quantity_unit(i) == '') then
            rows = rows//flush_right(significant(history%model_quantity(i), 4), 10)//newline
         else
            rows = rows//with_prefix(history%model_quantity(i), trim(history%model_quantity_unit(i)), 4, 10)//newline
         end if
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

   !> The resolution of a result in words; empty if it is the sampling of the input.
   pure function get_resolution(history, prefix) result(text)
      type(force_history_type), intent(in) :: history
      !> `finer_prefix` for the drop at a finer resolution, or empty.
      character(len=*), intent(in) :: prefix
      character(len=:), allocatable :: text

      if (has_quantity(history, prefix//'radial_elements')) then
         text = 'mesh '//whole(prefix//'radial_elements')//' x '//whole(prefix//'polar_elements')
      else if (has_quantity(history, prefix//'rings')) then
         text = whole(prefix//'rings')//' rings, modes up to '//whole(prefix//'highest_frequency')//' Hz, substeps ' &
            //whole(prefix//'substeps')
      else if (has_quantity(history, prefix//'sample_rate')) then
         text = whole(prefix//'sample_rate')//' samples per second'
      else
         text = ''
      end if

   contains

      !> A quantity without decimals.
      pure function whole(name) result(number)
         character(len=*), intent(in) :: name
         character(len=:), allocatable :: number

         number = fixed(get_model_quantity(history, name), 0)
      end function whole

   end function get_resolution

   !> Rows that compare a result with that at a finer resolution and with the stated error; none if it is not verified.
   function get_verification_rows(history) result(rows)
      type(force_history_type), intent(in) :: history
      character(len=:), allocatable :: rows
      character(len=:), allocatable :: resolution
      type(band_type) :: octaves(octave_count)
      type(error_type), allocatable :: error
      real(wp) :: values(history_quantity_count), level(octave_count)
      real(wp) :: finer
      integer :: i, first

      rows = ''
      first = findloc(history%model_quantity_name, finer_quantities(1), dim=1)
      if (first == 0) return
      octaves = get_octaves()
      call get_force_exposure_levels(history%floor_force, history%sample_rate, octaves, 'exact', level, error)
      if (allocated(error)) return
      rows = newline//'  at a finer resolution      value          change    stated error'//newline
      resolution = get_resolution(history, finer_prefix)
      if (resolution /= '') rows = rows//'  ('//resolution//')'//newline
      values = get_quantities(history)
      do i = 1, octave_count
         finer = history%model_quantity(first - 1 + i)
         rows = rows//compared('level, '//get_band_name(octaves(i))//' Hz octave', finer, level(i), &
            history%numerical_error%octave(i), get_quantity('octave_500_error'), get_quantity('octave_500_error'))
      end do
      do i = octave_count + 1, size(finer_quantities)
         finer = history%model_quantity(first - 1 + i)
         associate (name => finer_quantities(i) (len(finer_prefix) + 1:))
            rows = rows//compared(name, finer, values(findloc(quantities%name, name, dim=1)), &
               values(findloc(quantities%name, trim(name)//'_error', dim=1)), get_quantity(name), &
               get_quantity(trim(name)//'_error'))
         end associate
      end do

   contains

      !> Row with a number at the finer resolution, its change, and the stated error; marked if the change exceeds the error.
      function compared(name, finer, value, error, quantity, error_quantity) result(text)
         character(len=*), intent(in) :: name
         !> SI units.
         real(wp), intent(in) :: finer, value, error
         !> Unit and decimals of the number and of its error on the screen.
         type(quantity_type), intent(in) :: quantity, error_quantity
         character(len=:), allocatable :: text

         associate (scale => quantity%display_scale, decimals => error_quantity%decimals)
            text = row(replaced(trim(name), '_', ' '), fixed(finer*scale, quantity%decimals), quantity%display_unit)
            text = padded(text(:len(text) - 1), 40)//flush_right(fixed((finer - value)*scale, decimals), 8) &
               //flush_right(fixed(error*scale, decimals), 16)
            ! As far as the decimals show it.
            if (abs(finer - value)*scale > error*scale + 0.5_wp*10.0_wp**(-decimals)) text = text//'  exceeded'
            text = text//newline
         end associate
      end function compared

   end function get_verification_rows

   !> A limit with up to three decimals, without trailing zeros.
   pure function short(value) result(text)
      real(wp), intent(in) :: value
      character(len=:), allocatable :: text

      text = fixed(value, 3)
      text = text(:verify(text, '0', back=.true.))
      if (text(len(text):) == '.') text = text(:len(text) - 1)
   end function short

end module thud_table
