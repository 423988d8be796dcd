!> Results as text: the files of a run.
module thud_report
   use thud_band, only: octave_count
   use thud_case, only: case_type
   use thud_compression, only: compression_type
   use thud_compute, only: get_assessed_force, is_conforming, assessment_type
   use thud_constants, only: version
   use thud_force_history, only: force_count, force_history_type, force_names
   use thud_kinds, only: wp
   use thud_quantities, only: get_quantities, quantities
   use thud_source_limits, only: conforms, criterion_type
   use thud_text, only: join_quoted, newline, quoted, to_text
   use thud_text_buffer, only: text_buffer_type
   implicit none (type, external)
   private

   public :: get_channels_csv, get_compression_csv, get_fact_group, get_force_csv, get_levels_csv, get_scalar_lines
   public :: get_summary, get_word, line

   !> Format of a row of numbers: every bit of them, 25 characters each with its comma.
   character(len=*), parameter :: csv_form = '(*(es24.16e3,:,","))'

contains

   !> Force and motion against time, one line per sample, 17 digits.
   function get_force_csv(history, names, columns) result(text)
      type(force_history_type), intent(in) :: history
      !> Names, with units, of further columns: [n_column].
      character(len=*), intent(in), optional :: names(:)
      !> The columns: [n_sample, n_column].
      real(wp), intent(in), optional :: columns(:, :)
      !> Text of `force.csv`.
      character(len=:), allocatable :: text
      character(len=:), allocatable :: header, row, rest
      real(wp), allocatable :: values(:)
      logical :: at_rest
      integer :: i, at

      header = 'time_s,deflection_m,velocity_m_per_s'
      do i = 1, size(history%part_name)
         header = header//','//trim(history%part_name(i))//'_N'
      end do
      header = header//',elastic_force_N,floor_force_N'
      if (present(names)) then
         do i = 1, size(names)
            header = header//','//trim(names(i))
         end do
         allocate (values(size(history%part, 2) + 4 + size(names)))
      else
         allocate (values(size(history%part, 2) + 4))
      end if
      header = header//newline
      allocate (character(len=25*(size(values) + 1)) :: row, rest)
      at_rest = .false.
      allocate (character(len=len(header) + size(history%part, 1)*len(row)) :: text)
      text(:len(header)) = header
      at = len(header)
      do i = 1, size(history%part, 1)
         write (row, csv_form) real(i - 1, wp)/history%sample_rate
         values(:size(history%part, 2) + 4) = [history%deflection(i), history%velocity(i), history%part(i, :), &
            history%elastic_force(i), history%floor_force(i)]
         if (present(columns)) values(size(history%part, 2) + 5:) = columns(i, :)
         ! Formatting takes most of a run's time, and most rows are after the release.
         if (i == 1 .or. any(abs(values) > 0.0_wp) .or. .not. at_rest) write (rest, csv_form) values
         at_rest = .not. any(abs(values) > 0.0_wp)
         row(25:) = ','//rest
         row(len(row):) = newline
         text(at + 1:at + len(row)) = row
         at = at + len(row)
      end do
   end function get_force_csv

   !> Force against deflection of a slow compression, 17 digits.
   function get_compression_csv(compression) result(text)
      type(compression_type), intent(in) :: compression
      !> Text of `compression.csv`.
      character(len=:), allocatable :: text
      type(text_buffer_type) :: buffer
      character(len=50) :: row
      integer :: i

      call buffer%append('deflection_m,force_N'//newline)
      do i = 1, size(compression%force)
         write (row, csv_form) compression%deflection(i), compression%force(i)
         row(len(row):) = newline
         call buffer%append(row)
      end do
      text = buffer%get_text()
   end function get_compression_csv

   !> Channels of the model against time, 17 digits.
   function get_channels_csv(history) result(text)
      !> The history, with channels.
      type(force_history_type), intent(in) :: history
      !> Text of `channels.csv`.
      character(len=:), allocatable :: text
      character(len=25*(size(history%channel, 2) + 1)) :: row
      character(len=:), allocatable :: header
      integer :: i, at

      header = 'time_s'
      do i = 1, size(history%channel_name)
         header = header//','//trim(history%channel_name(i))
      end do
      header = header//newline
      ! Allocated once: text that grows line by line would be copied for each line.
      allocate (character(len=len(header) + size(history%channel, 1)*len(row)) :: text)
      text(:len(header)) = header
      at = len(header)
      do i = 1, size(history%channel, 1)
         write (row, csv_form) real(i - 1, wp)/history%sample_rate, history%channel(i, :)
         row(len(row):) = newline
         text(at + 1:at + len(row)) = row
         at = at + len(row)
      end do
   end function get_channels_csv

   !> Levels, limits and verdict per band.
   function get_levels_csv(case, assessment) result(text)
      type(case_type), intent(in) :: case
      type(assessment_type), intent(in) :: assessment
      !> Text of `levels.csv`.
      character(len=:), allocatable :: text
      integer :: i, j

      text = 'bandwidth,nominal_Hz,lower_edge_Hz,upper_edge_Hz'
      do j = 1, force_count
         text = text//','//trim(force_names(j))//'_level_dB'
      end do
      text = text//',lower_limit_dB,upper_limit_dB,verdict_'//trim(case%level_force)//newline
      ! The octaves serve the verdict even where only other bands are asked for.
      do i = assessment%first_band, size(assessment%bands)
         associate (band => assessment%bands(i))
            text = text//trim(band%set)
            associate (numbers => [band%nominal, band%lower, band%upper, assessment%level(i, :)])
               do j = 1, size(numbers)
                  text = text//','//to_text(numbers(j))
               end do
            end associate
         end associate
         if (i <= octave_count) then
            associate (criterion => assessment%criteria(i, get_assessed_force(case)))
               text = text//','//to_text(criterion%lower)//','//to_text(criterion%upper)//','//get_word(criterion)
            end associate
         else
            text = text//',,,no limit'
         end if
         text = text//newline
      end do
   end function get_levels_csv

   !> The scalars of a run as a namelist file.
   function get_summary(case, history, assessment, remark) result(text)
      type(case_type), intent(in) :: case
      type(force_history_type), intent(in) :: history
      type(assessment_type), intent(in) :: assessment
      !> Remarks on the case: [n].
      character(len=*), intent(in) :: remark(:)
      !> Text of `summary.nml`.
      character(len=:), allocatable :: text

      text = '! thud '//version//': results of case '//trim(case%name)//', SI units, levels in dB re 1 N'//newline &
         //newline//'&summary'//newline//line('case', quoted(case%name), '')//line('model', quoted(case%model), '') &
         //get_scalar_lines(history)//'/'//newline//newline//get_fact_group('facts', history)//remark_group(remark) &
         //'&verdict'//newline &
         //line('source', quoted(case%source), '') &
         //line('level_method', quoted(case%level_method), '') &
         //line('level_force', quoted(case%level_force), '') &
         //line('conforms', to_text(is_conforming(case, assessment)), '')
      associate (criteria => assessment%criteria(:, get_assessed_force(case)))
         text = text//line('criterion', join_quoted(criteria%name), '') &
            //line('unit', join_quoted(criteria%unit), '') &
            //line('value', joined(criteria%value), '') &
            //line('lower', joined(criteria%lower), '') &
            //line('upper', joined(criteria%upper), '') &
            //line('met', joined_logicals(conforms(criteria)), '')//'/'//newline
      end associate
   end function get_summary

   !> The numbers that describe an impact as lines of a namelist.
   function get_scalar_lines(history) result(text)
      type(force_history_type), intent(in) :: history
      character(len=:), allocatable :: text
      real(wp) :: values(size(quantities))
      integer :: i

      values = get_quantities(history)
      text = ''
      do i = 1, size(quantities)
         text = text//line(trim(quantities(i)%name), to_text(values(i)), trim(quantities(i)%unit))
      end do
   end function get_scalar_lines

   !> Numbers that the model chose or found as a namelist group.
   function get_fact_group(name, history) result(text)
      !> Name of the group.
      character(len=*), intent(in) :: name
      type(force_history_type), intent(in) :: history
      !> The group; empty where there are none.
      character(len=:), allocatable :: text
      integer :: i

      text = ''
      if (size(history%fact) == 0) return
      text = '&'//name//newline
      do i = 1, size(history%fact_name)
         text = text//line(trim(history%fact_name(i)), to_text(history%fact(i)), trim(history%fact_unit(i)))
      end do
      text = text//'/'//newline//newline
   end function get_fact_group

   !> Remarks as a namelist group.
   function remark_group(remark) result(text)
      !> The remarks: [n].
      character(len=*), intent(in) :: remark(:)
      !> The group; empty where there are none.
      character(len=:), allocatable :: text

      text = ''
      if (size(remark) > 0) text = '&remarks'//newline//line('remark', join_quoted(remark), '') &
         //'/'//newline//newline
   end function remark_group

   !> Where a value lies: `conforms`, `too low` or `too high`.
   function get_word(criterion) result(word)
      type(criterion_type), intent(in) :: criterion
      character(len=:), allocatable :: word

      if (conforms(criterion)) then
         word = 'conforms'
      else
         word = trim(merge('too low ', 'too high', criterion%value < criterion%lower))
      end if
   end function get_word

   !> One line of a namelist group.
   pure function line(key, value, note) result(text)
      character(len=*), intent(in) :: key
      !> Its value as text; unit or remark, may be empty.
      character(len=*), intent(in) :: value, note
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
      character(len=:), allocatable :: text
      integer :: i

      text = to_text(values(1))
      do i = 2, size(values)
         text = text//', '//to_text(values(i))
      end do
   end function joined_logicals

end module thud_report
