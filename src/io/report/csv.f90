!> Tables of numbers as comma-separated values.
module thud_csv
   use thud_kinds, only: wp
   use thud_text, only: newline, to_text
   use thud_text_buffer, only: text_buffer_type
   implicit none (type, external)
   private

   public :: get_history_csv, get_table_csv

   !> Width of a number with all digits and its comma.
   integer, parameter :: width = 25

   !> Format of a row of numbers with all digits.
   character(len=*), parameter :: row_form = '(*(es24.16e3,:,","))'

contains

   !> Histories against time, with all digits.
   function get_history_csv(header, time, columns) result(text)
      !> Names of all columns, separated by commas.
      character(len=*), intent(in) :: header
      !> The first column: [n_row].
      real(wp), intent(in) :: time(:)
      !> The other columns: [n_row, n_column].
      real(wp), intent(in) :: columns(:, :)
      character(len=:), allocatable :: text
      character(len=width*size(columns, 2)) :: cells
      character(len=width*(size(columns, 2) + 1)) :: row
      logical :: at_rest
      integer :: i, at

      allocate (character(len=len(header) + 1 + size(time)*len(row)) :: text)
      text(:len(header) + 1) = header//newline
      at = len(header) + 1
      at_rest = .false.
      do i = 1, size(time)
         ! Formatting takes most of a run's time; the zeros after the release are formatted once.
         if (.not. at_rest .or. any(abs(columns(i, :)) > 0.0_wp)) write (cells, row_form) columns(i, :)
         at_rest = .not. any(abs(columns(i, :)) > 0.0_wp)
         write (row, row_form) time(i)
         row(width:) = ','//cells
         row(len(row):) = newline
         text(at + 1:at + len(row)) = row
         at = at + len(row)
      end do
   end function get_history_csv

   !> A table with as many digits as its numbers need.
   function get_table_csv(header, columns, labels, notes) result(text)
      !> Names of all columns, separated by commas.
      character(len=*), intent(in) :: header
      !> The numbers: [n_row, n_column].
      real(wp), intent(in) :: columns(:, :)
      !> Texts of additional columns before and after the numbers: [n_row].
      character(len=*), intent(in), optional :: labels(:), notes(:)
      character(len=:), allocatable :: text
      type(text_buffer_type) :: buffer
      integer :: i, j

      call buffer%append(header//newline)
      do i = 1, size(columns, 1)
         if (present(labels)) call buffer%append(trim(labels(i))//',')
         do j = 1, size(columns, 2)
            if (j > 1) call buffer%append(',')
            call buffer%append(to_text(columns(i, j)))
         end do
         if (present(notes)) call buffer%append(','//trim(notes(i)))
         call buffer%append(newline)
      end do
      text = buffer%get_text()
   end function get_table_csv

end module thud_csv
