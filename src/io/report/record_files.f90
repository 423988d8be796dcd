!> Records as text: a group of them as a table of comma-separated values, or as a namelist group.
module thud_record_files
   use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
   use thud_bundle, only: bundle_type, record_type
   use thud_kinds, only: wp
   use thud_text, only: join, join_quoted, newline, split, to_text
   use thud_text_buffer, only: text_buffer_type
   implicit none (type, external)
   private

   public :: get_csv, get_namelist

   !> Maximum length of a text in a list, such as a warning.
   integer, parameter :: cell_length = 256

   !> Width of a number with all digits and its comma.
   integer, parameter :: width = 25

   !> Format of a row of numbers with all digits.
   character(len=*), parameter :: row_form = '(*(es24.16e3,:,","))'

contains

   !> A group as a table with as many digits as its numbers need, and empty cells for unknown ones; or, of histories, the
   !> first column their times, with all digits.
   subroutine get_csv(bundle, group, all_digits, text)
      type(bundle_type), intent(in) :: bundle
      character(len=*), intent(in) :: group
      logical, intent(in) :: all_digits
      !> The table with a header; empty if the results have no such group.
      character(len=:), allocatable, intent(out) :: text
      type(text_buffer_type) :: buffer
      character(len=cell_length), allocatable :: column(:), cells(:, :)
      integer, allocatable :: members(:)
      integer :: i, j

      call find_group(bundle, group, members, text)
      if (text == '') return
      call buffer%append(text)
      if (all_digits) then
         call append_numbers(bundle, members, buffer)
      else
         do j = 1, size(members)
            call get_cells(bundle%records(members(j)), column)
            if (j == 1) allocate (cells(size(column), size(members)))
            cells(:, j) = column
         end do
         do i = 1, size(cells, 1)
            do j = 1, size(members)
               call buffer%append(trim(cells(i, j))//merge(newline, ',', j == size(members)))
            end do
         end do
      end if
      text = buffer%get_text()
   end subroutine get_csv

   !> Appends rows of numbers with all digits.
   subroutine append_numbers(bundle, members, buffer)
      type(bundle_type), intent(in) :: bundle
      !> Indices of the columns: [n_column].
      integer, intent(in) :: members(:)
      type(text_buffer_type), intent(inout) :: buffer
      character(len=width*size(members)) :: row
      real(wp) :: values(size(members))
      logical :: at_rest
      integer :: i, j

      at_rest = .false.
      do i = 1, size(bundle%records(members(1))%values)
         values = [(bundle%records(members(j))%values(i, 1, 1), j=1, size(members))]
         ! Formatting takes most of a run's time; the zeros after the release are formatted once.
         if (.not. at_rest .or. any(abs(values(2:)) > 0.0_wp)) write (row(width + 1:), row_form) values(2:)
         at_rest = .not. any(abs(values(2:)) > 0.0_wp)
         write (row(:width), row_form) values(1)
         row(width:width) = ','
         row(len(row):) = newline
         call buffer%append(row)
      end do
   end subroutine append_numbers

   !> A group as a namelist group behind an empty line, without unknown numbers.
   subroutine get_namelist(bundle, group, text)
      type(bundle_type), intent(in) :: bundle
      character(len=*), intent(in) :: group
      !> The group; empty if the results have no such group.
      character(len=:), allocatable, intent(out) :: text
      character(len=cell_length), allocatable :: cells(:)
      integer, allocatable :: members(:)
      integer :: i

      call find_group(bundle, group, members, text)
      if (text /= '') text = newline//'&'//trim(group)//newline
      do i = 1, size(members)
         associate (record => bundle%records(members(i)))
            call get_cells(record, cells)
            if (record%kind /= 'text' .and. all(cells == '')) cycle
            text = text//'   '//trim(record%name)//' = '
            if (record%kind == 'text') text = text//join_quoted(cells)
            if (record%kind /= 'text') text = text//join(cells)
            if (record%unit /= '') text = text//' ! '//trim(record%unit)
         end associate
         text = text//newline
      end do
      if (text /= '') text = text//'/'//newline
   end subroutine get_namelist

   !> Indices of the records of a group, and their names as the header of a table.
   pure subroutine find_group(bundle, group, members, header)
      type(bundle_type), intent(in) :: bundle
      character(len=*), intent(in) :: group
      !> The indices: [n].
      integer, allocatable, intent(out) :: members(:)
      !> The names with commas between them; empty if the results have no such group.
      character(len=:), allocatable, intent(out) :: header
      integer :: i

      header = ''
      allocate (members(0))
      do i = 1, bundle%n_record
         if (bundle%records(i)%group /= group) cycle
         members = [members, i]
         header = header//trim(merge(',', ' ', size(members) > 1))//trim(bundle%records(i)%name)
      end do
      if (header /= '') header = header//newline
   end subroutine find_group

   !> The numbers or the lines of a record, each as text.
   subroutine get_cells(record, cells)
      type(record_type), intent(in) :: record
      !> The cells, empty for NaN: [n].
      character(len=cell_length), allocatable, intent(out) :: cells(:)
      integer :: i

      if (record%kind == 'text') then
         call split(record%text//newline, newline, cells)
         cells = cells(:size(cells) - 1)
         return
      end if
      allocate (cells(size(record%values)))
      do i = 1, size(cells)
         associate (value => record%values(i, 1, 1))
            select case (record%kind)
            case ('whole')
               cells(i) = to_text(nint(value))
            case ('flag')
               cells(i) = merge('.true. ', '.false.', value > 0.0_wp)
            case default
               cells(i) = to_text(value)
               if (ieee_is_nan(value)) cells(i) = ''
            end select
         end associate
      end do
   end subroutine get_cells

end module thud_record_files
