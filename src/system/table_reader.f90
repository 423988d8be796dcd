!> Tables of text, files or pipes of any size, row by row. The first row determines whether tabs, semicolons, commas or
!> blanks separate the cells, which may stand in quotes. Decimal commas are allowed if the comma is not the separator; a
!> table must not mix decimal points and commas. Empty lines and text after a `#` are skipped.
module thud_table_reader
   use, intrinsic :: iso_fortran_env, only: iostat_end
   use thud_error, only: error_type, input_error
   use thud_kinds, only: wp
   use thud_system, only: get_native_path, get_size, is_directory
   use thud_text, only: byte_order_mark, is_number, newline, quoted, replaced, tab, to_text
   implicit none (type, external)
   private

   public :: cell_length, open_table, read_number, read_row, row_error, table_reader_type

   !> Maximum length of a line.
   integer, parameter :: line_length = 1048576

   !> Maximum length of a cell.
   integer, parameter :: cell_length = 64

   !> An open table. Its file is closed at its end, or with the table.
   type :: table_reader_type
      private
      !> Unit of the file; 0 if it is closed.
      integer :: unit = 0
      !> Number of the latest line.
      integer :: line = 0
      !> Separator of the cells; a line feed, which no line holds, until the first row, and for a single column.
      character(len=1) :: separator = newline
      !> Decimal mark of the numbers; blank until a number has one.
      character(len=1) :: decimal = ' '
   contains
      final :: close_table
   end type table_reader_type

contains

   !> Opens a table.
   subroutine open_table(path, table, error)
      character(len=*), intent(in) :: path
      type(table_reader_type), intent(out) :: table
      !> Set if the file cannot be read; no message of a table names its path.
      type(error_type), allocatable, intent(out) :: error
      character(len=128) :: reason
      integer :: status

      status = 1
      reason = 'it is a directory'
      if (get_size(path) /= is_directory) open (newunit=table%unit, file=get_native_path(path), action='read', &
         access='stream', form='formatted', status='old', iostat=status, iomsg=reason)
      if (status == 0) return
      table%unit = 0
      error = input_error('the file cannot be read ('//trim(reason)//'); allowed: a table')
   end subroutine open_table

   !> Closes the file of a table.
   subroutine close_table(table)
      type(table_reader_type), intent(inout) :: table

      if (table%unit /= 0) close (table%unit)
      table%unit = 0
   end subroutine close_table

   !> The cells of the next row.
   subroutine read_row(table, cells, error)
      type(table_reader_type), intent(inout) :: table
      !> The cells, without quotes and surrounding blanks, numbers with decimal points; none at the end: [n_cell].
      character(len=cell_length), allocatable, intent(out) :: cells(:)
      !> Set if a line cannot be read, a cell is too long or has half a quote, or a decimal mark is not clear.
      type(error_type), allocatable, intent(out) :: error
      character(len=*), parameter :: separators = tab//';, '
      character(len=:), allocatable :: line
      character(len=4096) :: piece
      logical :: is_first
      character(len=128) :: reason
      integer :: i, n, status

      allocate (cells(0))
      is_first = table%line == 0
      do while (size(cells) == 0)
         line = ''
         ! In pieces, as the line may be too long for the memory.
         do
            status = iostat_end
            if (table%unit /= 0) read (table%unit, '(a)', advance='no', size=n, iostat=status, iomsg=reason) piece
            if (is_iostat_end(status)) exit
            line = line//piece(:n)
            if (status /= 0 .or. len(line) > line_length) exit
         end do
         if (is_iostat_end(status)) call close_table(table)
         ! A last line without line end may fill its pieces.
         if (is_iostat_end(status) .and. line == '') exit
         table%line = table%line + 1
         if (status >= 0 .or. len(line) > line_length) then
            if (len(line) > line_length) reason = 'too long'
            error = row_error(table, 'it cannot be read ('//trim(reason)//'); allowed: up to '//to_text(line_length) &
               //' characters')
            return
         end if
         if (table%line == 1 .and. index(line, byte_order_mark) == 1) line = line(len(byte_order_mark) + 1:)
         ! On some systems lines end with a carriage return and a line feed.
         line = trim(adjustl(replaced(line(:index(line//'#', '#') - 1), achar(13), ' ')))
         do i = len(separators), 1, -1
            if (is_first .and. index(line, separators(i:i)) > 0) table%separator = separators(i:i)
         end do
         ! Spreadsheets write empty cells at the end of a line.
         if (table%separator == ';') line = line(:verify(line, '; ', back=.true.))
         if (line == '') cycle
         call split_line(table, line, cells, error)
         if (.not. allocated(error)) call set_points(table, cells, error)
         if (allocated(error)) return
      end do
   end subroutine read_row

   !> Splits a line into cells.
   subroutine split_line(table, line, cells, error)
      type(table_reader_type), intent(in) :: table
      !> The line, without surrounding blanks.
      character(len=*), intent(in) :: line
      !> The cells, without surrounding blanks and quotes: [n_cell].
      character(len=cell_length), allocatable, intent(out) :: cells(:)
      !> Set if a cell is too long, or has a quote only at its beginning.
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: cell
      integer :: at, i, length, n

      allocate (cells(1 + count([(line(i:i) == table%separator, i=1, len(line))])))
      n = 0
      at = 1
      do while (at <= len(line) + 1)
         length = index(line(at:), table%separator) - 1
         if (length < 0) length = len(line) - at + 1
         cell = trim(adjustl(line(at:at + length - 1)))
         at = at + length + 1
         ! One of several blanks in a row.
         if (cell == '' .and. table%separator == ' ') cycle
         if (len(cell) > cell_length) then
            error = row_error(table, quoted(cell(:cell_length))//'... is too long; allowed: values of up to ' &
               //to_text(cell_length)//' characters')
         else if (scan(cell, '''"') == 1) then
            if (len(cell) == 1 .or. cell(len(cell):) /= cell(:1)) error = row_error(table, 'a quote is not closed: '//cell &
               //'; allowed: quotes that begin and end in one cell, without a separator between them')
            cell = trim(adjustl(cell(2:len(cell) - 1)))
         end if
         if (allocated(error)) return
         n = n + 1
         cells(n) = cell
      end do
      cells = cells(:n)
   end subroutine split_line

   !> Finds the decimal mark of a table from the numbers of a row, and replaces it by a point.
   subroutine set_points(table, cells, error)
      type(table_reader_type), intent(inout) :: table
      !> The cells of the row: [n_cell].
      character(len=cell_length), intent(inout) :: cells(:)
      !> Set if a number has another decimal mark than earlier ones, or its comma may also separate thousands.
      type(error_type), allocatable, intent(out) :: error
      integer :: ambiguous, i, at, first

      ambiguous = 0
      do i = 1, size(cells)
         at = scan(cells(i), '.,')
         if (at == 0 .or. .not. is_number(trim(replaced(cells(i), ',', '.')))) cycle
         first = verify(cells(i), '+-')
         ! A comma may separate thousands, as in 1,575.
         if (cells(i)(at:at) == ',' .and. at > first .and. at - first <= 3 .and. len_trim(cells(i)) == at + 3 &
            .and. cells(i)(first:first) /= '0' .and. verify(trim(cells(i)(first:)), '0123456789,') == 0 &
            .and. table%decimal == ' ') then
            ambiguous = i
         else if (table%decimal == ' ') then
            table%decimal = cells(i)(at:at)
         else if (cells(i)(at:at) /= table%decimal) then
            error = row_error(table, quoted(trim(cells(i)))//' has another decimal mark than the numbers before it; ' &
               //'allowed: one decimal mark in a table')
            return
         end if
      end do
      if (ambiguous > 0 .and. table%decimal == ' ') error = row_error(table, quoted(trim(cells(ambiguous))) &
         //' may have a decimal comma or be a thousand times as much; allowed: numbers such as 1575 and 1,5750')
      do i = 1, size(cells)
         cells(i) = replaced(cells(i), ',', '.')
      end do
   end subroutine set_points

   !> The finite number in a cell.
   elemental subroutine read_number(cell, value, valid)
      character(len=*), intent(in) :: cell
      real(wp), intent(out) :: value
      !> The cell is one.
      logical, intent(out) :: valid
      character(len=128) :: message
      integer :: status

      value = 0.0_wp
      status = merge(0, 1, is_number(trim(cell)))
      if (status == 0) read (cell, *, iostat=status, iomsg=message) value
      valid = status == 0 .and. abs(value) <= huge(value)
   end subroutine read_number

   !> Error for the latest row.
   function row_error(table, message) result(error)
      type(table_reader_type), intent(in) :: table
      !> The fault in the row.
      character(len=*), intent(in) :: message
      type(error_type) :: error

      error = input_error('line '//to_text(table%line)//': '//message)
   end function row_error

end module thud_table_reader
