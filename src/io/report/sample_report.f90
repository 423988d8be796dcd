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
   subroutine get_sample_rows(table, before, values, first, last, sweep, rows)
      type(sample_table_type), intent(in) :: table
      !> Number of samples before the first of `values`.
      integer, intent(in) :: before
      !> Values of the keys: [n_column, n_sample].
      real(wp), intent(in) :: values(:, :)
      !> Indices of the first and the last sample to write.
      integer, intent(in) :: first, last
      type(sweep_type), intent(in) :: sweep
      type(text_buffer_type), intent(out) :: rows
      integer :: i, j

      do i = first, last
         call rows%append(to_text(before + i))
         do j = 1, size(table%names)
            associate (field => table%fields(j))
               if (field%n_choice > 0) then
                  call rows%append(','//trim(field%choices(nint(values(j, i)))))
               else
                  call append_numbers(rows, values(j:j, i))
               end if
            end associate
         end do
         associate (levels => sweep%level(sweep%first_band:, :, i))
            if (sweep%status(i) == 0) then
               call append_numbers(rows, [sweep%quantity(:, i), levels])
               do j = 1, force_count
                  call rows%append(','//trim(merge('yes', 'no ', sweep%conforms(j, i))))
               end do
               call append_numbers(rows, [sweep%floor_value(:, i), sweep%margin(i)])
               call rows%append(','//trim(merge('yes', 'no ', sweep%verdict(i)))//',0,'//newline)
            else
               call rows%append(repeat(',', sample_quantity_count + size(levels) + force_count &
                  + size(sweep%floor_column) + 3)//to_text(sweep%status(i))//',"')
               associate (reason => sweep%reason(i)%text)
                  do j = 1, len(reason)
                     call rows%append(repeat(reason(j:j), merge(2, 1, reason(j:j) == '"')))
                  end do
               end associate
               call rows%append('"'//newline)
            end if
         end associate
      end do
   end subroutine get_sample_rows

   !> Adds cells with numbers to a row that has cells already.
   subroutine append_numbers(rows, numbers)
      type(text_buffer_type), intent(inout) :: rows
      !> The numbers: [n_number].
      real(wp), intent(in) :: numbers(:)
      !> Maximum width of a number with its comma.
      integer, parameter :: width = 26
      character(len=width*size(numbers)) :: cells

      write (cells, '(*(:,",",es24.16e3))') numbers
      call rows%append(trim(cells))
   end subroutine append_numbers

end module thud_sample_report
