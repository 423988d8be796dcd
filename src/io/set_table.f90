!> Tables of parameter sets: comma-separated text with the keys in its first line and one set in each of the
!> others. Empty lines and lines that begin with `#` are skipped.
module thud_set_table
   use thud_shell_sets, only: get_set_fields, parameter_count, set_type
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type
   use thud_hollow_sphere, only: flux_choices
   use thud_kinds, only: wp
   use thud_line_reader, only: close_lines, line_length, line_reader_type, open_lines, read_line
   use thud_system, only: directory_exists
   use thud_text, only: join_quoted, quoted, to_text
   implicit none (type, external)
   private

   public :: open_set_table, read_sets, set_table_type

   !> Longest path of a file.
   integer, parameter :: path_length = 4096

   !> Number of the column that chooses the flux term, behind those of the numbers.
   integer, parameter :: flux_column = parameter_count + 1

   !> An open table.
   type :: set_table_type
      !> Path of the file.
      character(len=path_length) :: path = ''
      !> Its lines.
      type(line_reader_type) :: reader
      !> Keys of all columns that there may be.
      character(len=24) :: keys(flux_column) = ''
      !> For each column of the file its place among the keys: [n_column].
      integer, allocatable :: columns(:)
   end type set_table_type

contains

   !> Opens a table and reads its first line.
   subroutine open_set_table(path, table, error)
      !> Path of the file.
      character(len=*), intent(in) :: path
      !> The table.
      type(set_table_type), intent(out) :: table
      !> The file cannot be read, or a key is not known or given twice.
      type(error_type), allocatable, intent(out) :: error
      character(len=line_length) :: line
      character(len=:), allocatable :: key
      type(set_type), target :: set
      type(field_type) :: fields(parameter_count)
      integer :: at, place
      logical :: done, there

      table%path = path
      fields = get_set_fields(set)
      table%keys = [fields%key, 'momentum_flux           ']
      allocate (table%columns(0))
      if (directory_exists(path)) then
         error = input_error(path//': this is a directory; allowed: a table of sets')
         return
      end if
      call open_lines(path, table%reader, done)
      if (.not. done) then
         error = input_error(path//': the file cannot be read; allowed: a table of sets')
         return
      end if
      call next_line(table, line, there, error)
      if (.not. (there .or. allocated(error))) error = input_error(path//': the table is empty; allowed: keys in the ' &
         //'first line and one set in each of the others')
      at = 1
      do while (.not. allocated(error) .and. at <= len_trim(line) + 1)
         key = trim(adjustl(line(at:get_end(line, at))))
         place = findloc(table%keys == key, .true., dim=1)
         if (place == 0) then
            error = line_error(table, quoted(key)//' is not a known key; allowed: '//join_quoted(table%keys))
         else if (any(table%columns == place)) then
            error = line_error(table, quoted(key)//' is given twice; allowed: once')
         else
            table%columns = [table%columns, place]
         end if
         at = get_end(line, at) + 2
      end do
      if (allocated(error)) call close_lines(table%reader)
   end subroutine open_set_table

   !> The next sets.
   subroutine read_sets(table, base, sets, n_set, error)
      !> The table.
      type(set_table_type), intent(inout) :: table
      !> What a set has where the table has no column for it.
      type(set_type), intent(in) :: base
      !> Room for the sets: [n_room].
      type(set_type), intent(inout) :: sets(:)
      !> Number of sets that were read; fewer than there is room for at the end of the table.
      integer, intent(out) :: n_set
      !> A line has the wrong number of values, or a value is none.
      type(error_type), allocatable, intent(out) :: error
      character(len=line_length) :: line
      type(set_type), target :: set
      type(field_type) :: fields(parameter_count)
      integer :: at, i
      logical :: there

      fields = get_set_fields(set)
      n_set = 0
      do while (n_set < size(sets))
         call next_line(table, line, there, error)
         if (allocated(error) .or. .not. there) return
         set = base
         at = 1
         do i = 1, size(table%columns)
            if (at > len_trim(line) + 1) exit
            call read_value(table, table%columns(i), trim(line(at:get_end(line, at))), fields, set%flux, error)
            if (allocated(error)) return
            at = get_end(line, at) + 2
         end do
         if (i <= size(table%columns) .or. at <= len_trim(line) + 1) then
            error = line_error(table, 'the number of values is another than that of the keys; allowed: ' &
               //to_text(size(table%columns))//' values with commas between')
            return
         end if
         n_set = n_set + 1
         sets(n_set) = set
      end do
   end subroutine read_sets

   !> The next line with something in it.
   subroutine next_line(table, line, there, error)
      !> The table; closed at its end.
      type(set_table_type), intent(inout) :: table
      !> The line.
      character(len=line_length), intent(out) :: line
      !> There was one.
      logical, intent(out) :: there
      !> The line is too long or cannot be read.
      type(error_type), allocatable, intent(out) :: error
      integer :: length

      there = .false.
      do while (.not. there)
         call read_line(table%reader, line, length)
         if (length == -1) exit
         if (length < 0) error = input_error(trim(table%path)//': the file cannot be read; allowed: a table of sets')
         if (length > line_length .and. line(1:1) /= '#') error = line_error(table, 'it is too long; allowed: up to ' &
            //to_text(line_length)//' characters')
         if (allocated(error)) exit
         there = line /= '' .and. line(1:1) /= '#'
      end do
      if (.not. there) call close_lines(table%reader)
   end subroutine next_line

   !> One value of a set.
   subroutine read_value(table, column, text, fields, flux, error)
      !> The table.
      type(set_table_type), intent(in) :: table
      !> Place of its key.
      integer, intent(in) :: column
      !> The value as it stands in the table.
      character(len=*), intent(in) :: text
      !> Numbers of the set, one of which is set: [parameter_count].
      type(field_type), intent(in) :: fields(:)
      !> Number of the choice of the flux term, which may be set.
      integer, intent(inout) :: flux
      !> The value is none.
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: word
      character(len=128) :: message
      real(wp) :: number
      integer :: status

      word = trim(adjustl(text))
      if (column == flux_column) then
         flux = findloc(flux_choices == word, .true., dim=1)
         if (flux == 0) error = line_error(table, 'momentum_flux = '//quoted(word)//' is not allowed; allowed: ' &
            //join_quoted(flux_choices))
         return
      end if
      status = 1
      if (is_number(word)) read (word, *, iostat=status, iomsg=message) number
      if (status == 0) status = merge(0, 1, abs(number) <= huge(number))
      if (status == 0) then
         fields(column)%real_value = number
      else
         error = line_error(table, trim(fields(column)%key)//' = '//quoted(word)//' is not a number; allowed: a ' &
            //'number in SI units')
      end if
   end subroutine read_value

   !> Whether a text holds nothing but a number; to the reader other characters mean repeats and names, and signs
   !> exponents without a letter.
   pure function is_number(text) result(yes)
      !> The text, without blanks around it.
      character(len=*), intent(in) :: text
      !> It may be a number.
      logical :: yes
      integer :: sign

      yes = text /= '' .and. verify(text, '0123456789+-.eEdD') == 0
      sign = scan(text, '+-', back=.true.)
      if (sign > 1) yes = yes .and. scan(text(sign - 1:sign - 1), 'eEdD') == 1
   end function is_number

   !> Last character of the value that begins at a place of a line.
   pure function get_end(line, at) result(last)
      !> The line.
      character(len=*), intent(in) :: line
      !> The place.
      integer, intent(in) :: at
      !> The last character before the next comma or the end of the line.
      integer :: last

      last = len_trim(line)
      if (at > last) return
      if (index(line(at:last), ',') > 0) last = at + index(line(at:last), ',') - 2
   end function get_end

   !> Error of a line.
   function line_error(table, message) result(error)
      !> The table.
      type(set_table_type), intent(in) :: table
      !> What is wrong with the line.
      character(len=*), intent(in) :: message
      !> The error, with file and line.
      type(error_type) :: error

      error = input_error(trim(table%path)//', line '//to_text(table%reader%line)//': '//message)
   end function line_error

end module thud_set_table
