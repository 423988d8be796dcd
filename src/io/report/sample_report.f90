!> Results of many samples as rows of a table.
module thud_sample_report
   use thud_kinds, only: wp
   use thud_sample_table, only: sample_table_type
   use thud_sweep, only: sweep_type
   use thud_text, only: newline, to_text
   use thud_text_buffer, only: text_buffer_type
   implicit none (type, external)
   private

   public :: get_sample_header, get_sample_rows

   !> Width of a comma and a number with all digits, and their format.
   integer, parameter :: width = 25
   character(len=*), parameter :: form = '(*(:,",",es24.16e3))'

contains

   !> Header row of the results.
   subroutine get_sample_header(table, sweep, text)
      type(sample_table_type), intent(in) :: table
      !> The sweep, with its columns.
      type(sweep_type), intent(in) :: sweep
      character(len=:), allocatable, intent(out) :: text
      integer :: i

      text = 'sample'
      do i = 1, size(table%names)
         text = text//','//trim(table%names(i))
      end do
      do i = 1, size(sweep%columns)
         if (sweep%columns(i)%is_wanted) text = text//','//trim(sweep%columns(i)%name)
      end do
      text = text//',status,reason'//newline
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
      character(len=width) :: cell
      character(len=width*size(sweep%columns)) :: cells
      logical :: is_number(size(sweep%columns))
      integer :: i, j, at

      is_number = sweep%columns%is_wanted .and. .not. sweep%columns%is_flag
      do i = first, last
         call rows%append(to_text(before + i))
         do j = 1, size(table%names)
            associate (field => table%fields(j))
               write (cell, form) values(j, i)
               if (field%n_choice > 0) cell = ','//field%choices(nint(values(j, i)))
               call rows%append(trim(cell))
            end associate
         end do
         ! All numbers at once: a statement for each takes longer.
         write (cells, form) pack(sweep%values(:, i), is_number)
         at = 0
         do j = 1, size(is_number)
            if (sweep%status(i) /= 0) then
               if (sweep%columns(j)%is_wanted) call rows%append(',')
            else if (is_number(j)) then
               call rows%append(cells(at + 1:at + width))
               at = at + width
            else if (sweep%columns(j)%is_flag) then
               call rows%append(trim(merge(',yes', ',no ', sweep%values(j, i) > 0.0_wp)))
            end if
         end do
         call rows%append(','//to_text(sweep%status(i))//',')
         if (sweep%status(i) /= 0) then
            associate (reason => sweep%reason(i)%text)
               call rows%append('"')
               do j = 1, len(reason)
                  call rows%append(repeat(reason(j:j), merge(2, 1, reason(j:j) == '"')))
               end do
               call rows%append('"')
            end associate
         end if
         call rows%append(newline)
      end do
   end subroutine get_sample_rows

end module thud_sample_report
