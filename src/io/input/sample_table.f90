!> Tables of samples: the keys in the first row and one sample in each further row, see `thud_table_reader`.
module thud_sample_table
   use thud_case, only: case_type, get_active_fields
   use thud_column, only: column_type, find_columns
   use thud_error, only: error_type, input_error, prefix_error
   use thud_field, only: field_type
   use thud_kinds, only: wp
   use thud_system, only: path_length
   use thud_table_reader, only: cell_length, open_table, read_number, read_row, row_error, table_reader_type
   use thud_text, only: lower_case, quoted, to_text
   implicit none (type, external)
   private

   public :: open_sample_table, read_samples, sample_table_type

   !> An open table.
   type :: sample_table_type
      character(len=path_length) :: path = ''
      !> The open file.
      type(table_reader_type) :: reader
      !> Keys of the columns: [n_column].
      type(column_type), allocatable :: columns(:)
      !> Names of the columns: [n_column].
      character(len=cell_length), allocatable :: names(:)
      !> Descriptions of the keys; they point to variables of the case: [n_column].
      type(field_type), allocatable :: fields(:)
   end type sample_table_type

contains

   !> Opens a table and reads its first row.
   subroutine open_sample_table(path, case, table, error)
      character(len=*), intent(in) :: path
      !> The case that uses the keys.
      type(case_type), intent(in), target :: case
      type(sample_table_type), intent(out) :: table
      !> Set if the file cannot be read, or a key is unknown or given twice.
      type(error_type), allocatable, intent(out) :: error
      type(field_type), allocatable :: fields(:)

      table%path = path
      call open_table(path, table%reader, error)
      if (.not. allocated(error)) call read_row(table%reader, table%names, error)
      if (.not. allocated(error)) then
         if (size(table%names) == 0) error = input_error('the table is empty; allowed: keys in the first line and one ' &
            //'sample in each of the others')
      end if
      if (.not. allocated(error)) then
         call find_columns(case, table%names, table%columns, error)
         if (allocated(error)) error = row_error(table%reader, error%message)
      end if
      if (allocated(error)) then
         call prefix_error(error, path)
      else
         allocate (fields, source=get_active_fields(case))
         table%fields = fields(table%columns%field)
      end if
   end subroutine open_sample_table

   !> Reads the next samples.
   subroutine read_samples(table, values, n_sample, error)
      type(sample_table_type), intent(inout) :: table
      !> Values of the samples: [n_column, n_max].
      real(wp), intent(out) :: values(:, :)
      !> Number of samples read; less than `n_max` only at the end of the table.
      integer, intent(out) :: n_sample
      !> Set if a row has the wrong number of values, or a value is not valid.
      type(error_type), allocatable, intent(out) :: error
      character(len=cell_length), allocatable :: cells(:)
      integer :: i

      n_sample = 0
      do while (n_sample < size(values, 2))
         call read_row(table%reader, cells, error)
         if (allocated(error)) exit
         if (size(cells) == 0) return
         if (size(cells) /= size(table%names)) error = row_error(table%reader, 'it has '//to_text(size(cells)) &
            //' values and the first line '//to_text(size(table%names))//' keys; allowed: one value for each key, with ' &
            //'commas, semicolons, tabs or blanks between')
         n_sample = n_sample + 1
         do i = 1, size(cells)
            if (.not. allocated(error)) call read_value(table, i, trim(cells(i)), values(i, n_sample), error)
         end do
         if (allocated(error)) exit
      end do
      if (allocated(error)) call prefix_error(error, trim(table%path))
   end subroutine read_samples

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
      logical :: valid

      associate (field => table%fields(column))
         select case (field%kind)
         case ('choice')
            value = real(findloc(field%choices(:field%n_choice) == lower_case(word), .true., dim=1), wp)
            valid = value > 0.0_wp
         case ('flag')
            valid = any(lower_case(word) == [character(len=7) :: 'true', '.true.', '1', 'false', '.false.', '0'])
            value = merge(1.0_wp, 0.0_wp, scan(word, 'tT1') > 0)
         case default
            call read_number(word, value, valid)
         end select
         if (valid) return
         error = field%get_error(quoted(word))
         error = row_error(table%reader, error%message)
      end associate
   end subroutine read_value

end module thud_sample_table
