!> Results of many samples as rows of a table.
module thud_sample_report
   use thud_band, only: get_band_name
   use thud_force_history, only: force_count, force_names
   use thud_kinds, only: wp
   use thud_quantities, only: quantities, sample_quantity_count
   use thud_sample_table, only: sample_table_type
   use thud_sweep, only: sweep_type
   use thud_text, only: newline, replaced, to_text
   use thud_text_buffer, only: text_buffer_type
   implicit none (type, external)
   private

   public :: get_sample_header, get_sample_rows

contains

   !> Header row of the results.
   subroutine get_sample_header(table, sweep, text)
      type(sample_table_type), intent(in) :: table
      !> The sweep, with its bands and columns.
      type(sweep_type), intent(in) :: sweep
      character(len=:), allocatable, intent(out) :: text
      integer :: i, j

      text = 'sample'
      do i = 1, size(table%names)
         text = text//','//trim(table%names(i))
      end do
      do i = 1, sample_quantity_count
         text = text//','//trim(quantities(i)%name)
         if (quantities(i)%unit /= '') text = text//'_'//replaced(trim(quantities(i)%unit), ' ', '_')
      end do
      do j = 1, force_count
         do i = sweep%first_band, size(sweep%bands)
            text = text//','//trim(force_names(j))//'_'//trim(sweep%bands(i)%set)//'_'//get_band_name(sweep%bands(i)) &
               //'_Hz_dB'
         end do
      end do
      do j = 1, force_count
         text = text//','//trim(force_names(j))//'_conforms'
      end do
      do i = 1, size(sweep%floor_column)
         text = text//','//trim(sweep%floor_column(i))
      end do
      text = text//',margin_dB,conforms,status,reason'//newline
   end subroutine get_sample_header

   !> Rows of the results, with 17 digits; cells of samples without results are empty.
   subroutine get_sample_rows(table, before, values, first, last, sweep, text)
      type(sample_table_type), intent(in) :: table
      !> Number of samples before the first of `values`.
      integer, intent(in) :: before
      !> Values of the keys: [n_column, n_sample].
      real(wp), intent(in) :: values(:, :)
      !> Indices of the first and the last sample to write.
      integer, intent(in) :: first, last
      type(sweep_type), intent(in) :: sweep
      character(len=:), allocatable, intent(out) :: text
      !> Maximum width of a number with its comma.
      integer, parameter :: number_width = 26
      character(len=*), parameter :: numbers_form = '(*(:,",",es24.16e3))'
      character(len=number_width*(size(table%names) + sample_quantity_count + size(sweep%level(:, :, 1)) &
         + size(sweep%floor_column)) + get_rest_width(sweep)) :: row
      type(text_buffer_type) :: buffer
      integer :: i, j, at

      do i = first, last
         row = to_text(before + i)
         do j = 1, size(table%names)
            at = len_trim(row) + 1
            associate (field => table%fields(j))
               if (field%n_choice > 0) then
                  row(at:) = ','//field%choices(nint(values(j, i)))
               else
                  write (row(at:), numbers_form) values(j, i)
               end if
            end associate
         end do
         at = len_trim(row) + 1
         if (sweep%status(i) == 0) then
            write (row(at:), numbers_form) sweep%quantity(:, i), sweep%level(sweep%first_band:, :, i)
            do j = 1, force_count
               row(len_trim(row) + 1:) = ','//trim(merge('yes', 'no ', sweep%conforms(j, i)))
            end do
            if (size(sweep%floor_column) > 0) write (row(len_trim(row) + 1:), numbers_form) sweep%floor_value(:, i)
            write (row(len_trim(row) + 1:), numbers_form) sweep%margin(i)
            row(len_trim(row) + 1:) = ','//trim(merge('yes', 'no ', sweep%verdict(i)))//',0,'//newline
         else
            row(at:) = repeat(',', sample_quantity_count + size(sweep%level(sweep%first_band:, :, i)) + force_count &
               + size(sweep%floor_column) + 3) &
               //to_text(sweep%status(i))//','//trim(in_quotes(sweep%reason(i)%text))//newline
         end if
         call buffer%append(row(:index(row, newline)))
      end do
      text = buffer%get_text()
   end subroutine get_sample_rows

   !> Width sufficient for all cells of a row except numbers: choices, verdicts, and the longest reason in quotes.
   pure function get_rest_width(sweep) result(width)
      type(sweep_type), intent(in) :: sweep
      integer :: width
      integer :: i

      width = 1024
      do i = 1, size(sweep%reason)
         if (allocated(sweep%reason(i)%text)) width = max(width, 1024 + 2*len(sweep%reason(i)%text))
      end do
   end function get_rest_width

   !> A message as a cell of a table.
   pure function in_quotes(message) result(cell)
      character(len=*), intent(in) :: message
      !> The message in quotes, with quotes inside doubled.
      character(len=2*len(message) + 2) :: cell
      integer :: i, at

      cell = '"'
      at = 1
      do i = 1, len(message)
         at = at + 1
         cell(at:at) = message(i:i)
         if (message(i:i) == '"') at = at + 1
         if (message(i:i) == '"') cell(at:at) = '"'
      end do
      cell(at + 1:) = '"'
   end function in_quotes

end module thud_sample_report
