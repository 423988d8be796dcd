!> Tables of samples: text with the keys in the first line and one sample in each further line. The first line determines
!> whether tabs, semicolons, commas or blanks separate the values; values may stand in quotes. Decimal commas are allowed
!> in quotes, or if the comma is not the separator; a table must not mix decimal points and commas. Empty lines and text
!> after a `#` are skipped.
module thud_sample_table
   use thud_case, only: case_type, get_active_fields
   use thud_column, only: column_type, find_columns
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type
   use thud_kinds, only: wp
   use thud_line_reader, only: close_lines, line_length, line_reader_type, open_lines, read_line
   use thud_suggestion, only: get_suggestion
   use thud_system, only: directory_exists, path_length
   use thud_text, only: is_number, join_quoted, lower_case, newline, quoted, replaced, tab, to_text
   implicit none (type, external)
   private

   public :: open_sample_table, read_samples, sample_table_type

   !> Maximum number of columns.
   integer, parameter :: max_columns = 256

   !> Maximum length of a name or value.
   integer, parameter :: cell_length = 64

   !> An open table.
   type :: sample_table_type
      character(len=path_length) :: path = ''
      !> The open file.
      type(line_reader_type) :: reader
      !> Separator of the cells.
      character(len=1) :: separator = ' '
      !> Decimal mark of the numbers; blank until a number has one.
      character(len=1) :: decimal = ' '
      !> Keys of the columns: [n_column].
      type(column_type), allocatable :: columns(:)
      !> Names of the columns: [n_column].
      character(len=cell_length), allocatable :: names(:)
      !> Descriptions of the keys; they point to variables of the case: [n_column].
      type(field_type), allocatable :: fields(:)
   end type sample_table_type

contains

   !> Opens a table and reads its first line.
   subroutine open_sample_table(path, case, table, error)
      character(len=*), intent(in) :: path
      !> The case that uses the keys.
      type(case_type), intent(in), target :: case
      type(sample_table_type), intent(out) :: table
      !> Set if the file cannot be read, or a key is unknown or given twice.
      type(error_type), allocatable, intent(out) :: error
      character(len=line_length) :: line
      type(field_type), allocatable :: fields(:)
      logical :: done, has_line

      table%path = path
      if (directory_exists(path)) then
         error = input_error(path//': this is a directory; allowed: a table of samples')
         return
      end if
      call open_lines(path, table%reader, done)
      if (.not. done) then
         error = input_error(path//': the file cannot be read; allowed: a table of samples')
         return
      end if
      call next_line(table, line, has_line, error)
      if (.not. (has_line .or. allocated(error))) error = input_error(path//': the table is empty; allowed: keys in the ' &
         //'first line and one sample in each of the others')
      if (.not. allocated(error)) then
         table%separator = get_separator(line)
         call split_line(table, line, table%names, error)
      end if
      if (.not. allocated(error)) then
         call find_columns(case, table%names, table%columns, error)
         if (allocated(error)) error = line_error(table, error%message)
      end if
      if (.not. allocated(error)) then
         allocate (fields, source=get_active_fields(case))
         table%fields = fields(table%columns%field)
      else
         call close_lines(table%reader)
      end if
   end subroutine open_sample_table

   !> Reads the next samples.
   subroutine read_samples(table, values, n_sample, error)
      type(sample_table_type), intent(inout) :: table
      !> Values of the samples: [n_column, n_max].
      real(wp), intent(out) :: values(:, :)
      !> Number of samples read; less than `n_max` only at the end of the table.
      integer, intent(out) :: n_sample
      !> Set if a line has the wrong number of values, or a value is not valid.
      type(error_type), allocatable, intent(out) :: error
      character(len=line_length) :: line
      character(len=cell_length), allocatable :: cells(:)
      integer :: i
      logical :: has_line

      n_sample = 0
      do while (n_sample < size(values, 2))
         call next_line(table, line, has_line, error)
         if (allocated(error) .or. .not. has_line) return
         call split_line(table, line, cells, error)
         if (allocated(error)) return
         if (size(cells) /= size(table%names)) then
            error = line_error(table, 'it has '//to_text(size(cells))//' values and the first line ' &
               //to_text(size(table%names))//' keys; allowed: one value for each key, with commas, semicolons, tabs or ' &
               //'blanks between')
            return
         end if
         call find_decimal(table, cells, error)
         if (allocated(error)) return
         n_sample = n_sample + 1
         do i = 1, size(cells)
            call read_value(table, i, trim(replaced(cells(i), ',', '.')), values(i, n_sample), error)
            if (allocated(error)) return
         end do
      end do
   end subroutine read_samples

   !> Reads the next line that is not empty.
   subroutine next_line(table, line, has_line, error)
      !> The table; closed at its end.
      type(sample_table_type), intent(inout) :: table
      !> The line, without comment.
      character(len=line_length), intent(out) :: line
      !> There is such a line.
      logical, intent(out) :: has_line
      !> Set if the line is too long or cannot be read.
      type(error_type), allocatable, intent(out) :: error
      integer :: length, mark

      has_line = .false.
      do while (.not. has_line)
         call read_line(table%reader, line, length)
         if (length == -1) exit
         if (length < 0) error = input_error(trim(table%path)//': the file cannot be read; allowed: a table of samples')
         mark = index(line, '#')
         if (mark > 0) line(mark:) = ''
         if (length > line_length .and. mark == 0) error = line_error(table, 'it is too long; allowed: up to ' &
            //to_text(line_length)//' characters')
         if (allocated(error)) exit
         has_line = line /= ''
      end do
      if (.not. has_line) call close_lines(table%reader)
   end subroutine next_line

   !> Separator of a table: the first of tab, semicolon, comma and blank that its first line holds.
   pure function get_separator(line) result(separator)
      !> The first line.
      character(len=*), intent(in) :: line
      !> The separator; for a single column a line feed, which no line holds.
      character(len=1) :: separator
      character(len=*), parameter :: known = tab//';, '
      character(len=len(line)) :: structure
      integer :: i

      structure = get_structure(adjustl(line))
      separator = newline
      do i = len(known), 1, -1
         if (index(trim(structure), known(i:i)) > 0) separator = known(i:i)
      end do
   end function get_separator

   !> Splits a line into cells.
   subroutine split_line(table, line, cells, error)
      type(sample_table_type), intent(in) :: table
      character(len=*), intent(in) :: line
      !> The cells, without surrounding blanks and quotes: [n_cell].
      character(len=cell_length), allocatable, intent(out) :: cells(:)
      !> Set if there are too many cells, one is too long, or a quote is not closed.
      type(error_type), allocatable, intent(out) :: error
      character(len=len(line)) :: text, structure
      integer :: i, n, at, length, last

      text = adjustl(line)
      structure = get_structure(text)
      last = len_trim(text)
      associate (separator => table%separator)
         ! Spreadsheets may end lines with the separator.
         if (separator == ';') last = verify(structure(:last), '; ', back=.true.)
         allocate (cells(max_columns))
         n = 0
         at = 1
         do while (at <= last + merge(1, 0, separator /= ' '))
            length = index(structure(at:last)//separator, separator) - 1
            if (n == max_columns .or. len_trim(adjustl(text(at:at + length - 1))) > cell_length) then
               error = line_error(table, 'it has too many values or one that is too long; allowed: up to ' &
                  //to_text(max_columns)//' values of up to '//to_text(cell_length)//' characters')
               return
            end if
            n = n + 1
            cells(n) = adjustl(text(at:at + length - 1))
            at = at + length + 1
            if (separator == ' ') at = at + max(0, verify(structure(at:)//'x', ' ') - 1)
         end do
      end associate
      cells = cells(:n)
      do i = 1, n
         call unquote(table, cells(i), error)
         if (allocated(error)) return
      end do
   end subroutine split_line

   !> Finds the decimal mark of a table from the numbers of a line.
   subroutine find_decimal(table, cells, error)
      type(sample_table_type), intent(inout) :: table
      !> The cells of the line: [n_cell].
      character(len=cell_length), intent(in) :: cells(:)
      !> Set if a number has another decimal mark than earlier ones, or its comma may also separate thousands.
      type(error_type), allocatable, intent(out) :: error
      integer :: ambiguous, i, at

      ambiguous = 0
      do i = 1, size(cells)
         at = scan(cells(i), '.,')
         if (at == 0 .or. .not. is_number(trim(replaced(cells(i), ',', '.')))) cycle
         if (table%decimal /= ' ' .and. cells(i)(at:at) /= table%decimal) then
            error = line_error(table, quoted(trim(cells(i)))//' has another decimal mark than the numbers before it; ' &
               //'allowed: one decimal mark in a table')
            return
         end if
         if (table%decimal == ' ' .and. may_separate_thousands(cells(i))) then
            ambiguous = i
         else
            table%decimal = cells(i)(at:at)
         end if
      end do
      if (ambiguous > 0 .and. table%decimal == ' ') error = line_error(table, quoted(trim(cells(ambiguous))) &
         //' may have a decimal comma or be a thousand times as much; allowed: numbers such as 1575 and 1,5750')
   end subroutine find_decimal

   !> Whether the comma of a number may separate thousands, as in 1,575.
   pure function may_separate_thousands(cell) result(may)
      character(len=*), intent(in) :: cell
      logical :: may
      integer :: first, comma

      first = verify(cell, '+-')
      comma = index(cell, ',')
      may = comma > first .and. comma - first <= 3 .and. len_trim(cell) - comma == 3 .and. cell(first:first) /= '0' &
         .and. verify(trim(cell(first:)), '0123456789,') == 0
   end function may_separate_thousands

   !> Removes the quotes around a cell, and blanks next to them.
   subroutine unquote(table, cell, error)
      type(sample_table_type), intent(in) :: table
      character(len=cell_length), intent(inout) :: cell
      !> Set if the quote is not closed.
      type(error_type), allocatable, intent(out) :: error
      integer :: last

      if (scan(cell(1:1), '''"') == 0) return
      last = len_trim(cell)
      if (last > 1 .and. cell(last:last) == cell(1:1)) then
         cell = adjustl(cell(2:last - 1))
      else
         error = line_error(table, 'a quote is not closed: '//trim(cell)//'; allowed: quotes that begin and end in one cell')
      end if
   end subroutine unquote

   !> A line with `x` for quoted text, because separators in quotes do not separate.
   pure function get_structure(line) result(structure)
      character(len=*), intent(in) :: line
      character(len=len(line)) :: structure
      character(len=1) :: quote
      integer :: i

      structure = line
      quote = ' '
      do i = 1, len_trim(line)
         if (quote /= ' ') then
            if (line(i:i) == quote) quote = ' '
            structure(i:i) = 'x'
         else if (scan(line(i:i), '''"') == 1) then
            quote = line(i:i)
            structure(i:i) = 'x'
         end if
      end do
   end function get_structure

   !> Reads one value of a sample.
   subroutine read_value(table, column, word, value, error)
      type(sample_table_type), intent(in) :: table
      integer, intent(in) :: column
      !> The value as written in the table.
      character(len=*), intent(in) :: word
      !> The value; the index of a choice, 0 or 1 for a flag.
      real(wp), intent(out) :: value
      !> Set if the key cannot have this value.
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: suggestion, wanted
      character(len=128) :: message
      integer :: status

      value = 0.0_wp
      status = 1
      associate (field => table%fields(column))
         select case (field%get_kind())
         case ('choice')
            call get_suggestion(word, field%choices(:field%n_choice), suggestion)
            wanted = 'allowed'//suggestion//'; allowed: '//join_quoted(field%choices(:field%n_choice))
            value = real(findloc(field%choices(:field%n_choice) == lower_case(word), .true., dim=1), wp)
            status = merge(0, 1, value > 0.0_wp)
         case ('flag')
            wanted = 'allowed; allowed: true, false'
            select case (lower_case(word))
            case ('true', '.true.', '1')
               value = 1.0_wp
               status = 0
            case ('false', '.false.', '0')
               status = 0
            case default
               continue
            end select
         case default
            wanted = 'a number; allowed: a number in SI units'
            if (is_number(word)) read (word, *, iostat=status, iomsg=message) value
            if (status == 0) status = merge(0, 1, abs(value) <= huge(value))
         end select
      end associate
      if (status /= 0) error = line_error(table, trim(table%names(column))//' = '//quoted(word)//' is not '//wanted)
   end subroutine read_value

   !> Error for the latest line.
   function line_error(table, message) result(error)
      type(sample_table_type), intent(in) :: table
      !> The fault in the line.
      character(len=*), intent(in) :: message
      type(error_type) :: error

      error = input_error(trim(table%path)//', line '//to_text(table%reader%line)//': '//message)
   end function line_error

end module thud_sample_table
