!> Tables of text, files or pipes of any size, row by row. The first row determines whether tabs, semicolons, commas or
!> blanks separate the cells, which may stand in quotes. Decimal commas are allowed in quotes, or if the comma is not the
!> separator; a table must not mix decimal points and commas. Empty lines and text after a `#` are skipped.
module thud_table_reader
   use thud_error, only: error_type, input_error
   use thud_kinds, only: wp
   use thud_system, only: directory_exists
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

      if (directory_exists(path)) then
         error = input_error('this is a directory; allowed: a table')
         return
      end if
      open (newunit=table%unit, file=path, action='read', access='stream', form='formatted', status='old', &
         iostat=status, iomsg=reason)
      if (status == 0) return
      table%unit = 0
      error = input_error('the file cannot be read ('//trim(reason)//'); allowed: a table')
   end subroutine open_table

   !> Closes the file of a table that is not read to its end.
   subroutine close_table(table)
      type(table_reader_type), intent(inout) :: table

      if (table%unit /= 0) close (table%unit)
      table%unit = 0
   end subroutine close_table

   !> The next line, without its end. It is read in pieces, as it may be too long for the memory.
   subroutine read_line(table, line, error)
      type(table_reader_type), intent(inout) :: table
      !> The line; not allocated at the end of the table. Of a longer comment, its beginning.
      character(len=:), allocatable, intent(out) :: line
      !> Set if the line is too long or cannot be read.
      type(error_type), allocatable, intent(out) :: error
      character(len=4096) :: piece
      character(len=128) :: reason
      integer :: n, status

      do while (table%unit /= 0)
         read (table%unit, '(a)', advance='no', size=n, iostat=status, iomsg=reason) piece
         if (is_iostat_end(status)) exit
         if (.not. allocated(line)) then
            line = ''
            table%line = table%line + 1
            if (table%line == 1 .and. index(piece, byte_order_mark) == 1) piece = piece(len(byte_order_mark) + 1:n)
         end if
         if (len(line) <= line_length) line = line//piece(:n)
         if (len(line) > line_length .and. line(1:1) /= '#') then
            error = row_error(table, 'it is too long; allowed: up to '//to_text(line_length)//' characters')
         else if (status /= 0 .and. .not. is_iostat_eor(status)) then
            error = row_error(table, 'it cannot be read ('//trim(reason)//'); allowed: a table')
         end if
         if (status /= 0 .or. allocated(error)) return
      end do
      call close_table(table)
   end subroutine read_line

   !> The cells of the next row.
   subroutine read_row(table, cells, error)
      type(table_reader_type), intent(inout) :: table
      !> The cells, without quotes and surrounding blanks, numbers with decimal points; none at the end: [n_cell].
      character(len=cell_length), allocatable, intent(out) :: cells(:)
      !> Set if a line cannot be read, a cell is too long, a quote is not closed, or a decimal mark is not clear.
      type(error_type), allocatable, intent(out) :: error
      character(len=*), parameter :: known = tab//';, '
      character(len=:), allocatable :: line, structure
      logical :: is_first
      integer :: i

      is_first = table%line == 0
      do
         call read_line(table, line, error)
         if (allocated(error)) return
         if (.not. allocated(line)) exit
         ! On some systems lines end with a carriage return and a line feed.
         line = trim(adjustl(replaced(line(:index(line//'#', '#') - 1), achar(13), ' ')))
         if (line == '') cycle
         call get_structure(line, structure)
         ! The first of tab, semicolon, comma and blank that the first row holds; a single column has none.
         do i = len(known), 1, -1
            if (is_first .and. index(structure, known(i:i)) > 0) table%separator = known(i:i)
         end do
         call split_line(table, line, structure, cells, error)
         if (.not. allocated(error)) call find_decimal(table, cells, error)
         return
      end do
      allocate (cells(0))
   end subroutine read_row

   !> Splits a line into cells.
   subroutine split_line(table, line, structure, cells, error)
      type(table_reader_type), intent(in) :: table
      !> The line, without surrounding blanks, and without quoted text.
      character(len=*), intent(in) :: line, structure
      !> The cells, without surrounding blanks and quotes: [n_cell].
      character(len=cell_length), allocatable, intent(out) :: cells(:)
      !> Set if a cell is too long, or a quote is not closed.
      type(error_type), allocatable, intent(out) :: error
      integer :: i, n, at, length, last

      associate (separator => table%separator)
         last = len(line)
         ! Spreadsheets may end lines with the separator.
         if (separator == ';') last = verify(structure, '; ', back=.true.)
         n = 1
         do i = 1, last
            if (structure(i:i) == separator) n = n + 1
         end do
         allocate (cells(n))
         n = 0
         at = 1
         do while (at <= last + merge(1, 0, separator /= ' '))
            length = index(structure(at:last)//separator, separator) - 1
            n = n + 1
            cells(n) = adjustl(line(at:at + length - 1))
            if (len_trim(adjustl(line(at:at + length - 1))) > cell_length) then
               error = row_error(table, quoted(trim(cells(n)))//'... is too long; allowed: values of up to ' &
                  //to_text(cell_length)//' characters')
            else if (scan(cells(n)(1:1), '''"') == 1) then
               i = len_trim(cells(n))
               if (i == 1 .or. cells(n)(i:i) /= cells(n)(1:1)) error = row_error(table, 'a quote is not closed: ' &
                  //trim(cells(n))//'; allowed: quotes that begin and end in one cell')
               cells(n) = adjustl(cells(n)(2:i - 1))
            end if
            if (allocated(error)) return
            at = at + length + 1
            if (separator == ' ') at = at + max(0, verify(structure(at:)//'x', ' ') - 1)
         end do
      end associate
      cells = cells(:n)
   end subroutine split_line

   !> Finds the decimal mark of a table from the numbers of a row, and replaces it by a point.
   subroutine find_decimal(table, cells, error)
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
         if (table%decimal /= ' ' .and. cells(i)(at:at) /= table%decimal) then
            error = row_error(table, quoted(trim(cells(i)))//' has another decimal mark than the numbers before it; ' &
               //'allowed: one decimal mark in a table')
            return
         end if
         first = verify(cells(i), '+-')
         ! A comma may separate thousands, as in 1,575.
         if (table%decimal == ' ' .and. cells(i)(at:at) == ',' .and. at > first .and. at - first <= 3 &
            .and. len_trim(cells(i)) == at + 3 .and. cells(i)(first:first) /= '0' &
            .and. verify(trim(cells(i)(first:)), '0123456789,') == 0) then
            ambiguous = i
         else
            table%decimal = cells(i)(at:at)
         end if
      end do
      if (ambiguous > 0 .and. table%decimal == ' ') error = row_error(table, quoted(trim(cells(ambiguous))) &
         //' may have a decimal comma or be a thousand times as much; allowed: numbers such as 1575 and 1,5750')
      do i = 1, size(cells)
         cells(i) = replaced(cells(i), ',', '.')
      end do
   end subroutine find_decimal

   !> A line with `x` for quoted text, because separators in quotes do not separate.
   pure subroutine get_structure(line, structure)
      character(len=*), intent(in) :: line
      !> Allocated, since a long line has no space on the stack of a thread.
      character(len=:), allocatable, intent(out) :: structure
      character(len=1) :: quote
      integer :: i

      structure = line
      quote = ' '
      do i = 1, len(line)
         if (quote /= ' ') then
            if (line(i:i) == quote) quote = ' '
            structure(i:i) = 'x'
         else if (scan(line(i:i), '''"') == 1) then
            quote = line(i:i)
            structure(i:i) = 'x'
         end if
      end do
   end subroutine get_structure

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
