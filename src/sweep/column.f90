!> Columns of a table of samples: the keys in which the samples differ.
module thud_column
   use thud_case, only: case_type, get_active_fields
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type, key_length
   use thud_text, only: get_suggestion, join_quoted, quoted, to_text
   implicit none (type, external)
   private

   public :: column_type, find_columns

   !> Groups whose keys must be the same for all samples.
   character(len=key_length), parameter :: common_groups(*) = [character(len=key_length) :: &
      'case', 'model', 'modes', 'compression', 'unknowns', 'output', 'floor']

   !> A key in which samples differ.
   type :: column_type
      !> Index among the keys that the case uses.
      integer :: field = 0
      !> Index of the list entry; 0 if the key is not a list.
      integer :: entry = 0
   end type column_type

contains

   !> Finds keys by name; `frequency(2)` is an entry of a list, `plate.thickness` a key of a certain group.
   subroutine find_columns(case, names, columns, error)
      type(case_type), intent(in), target :: case
      !> The names: [n_column].
      character(len=*), intent(in) :: names(:)
      !> The keys: [n_column].
      type(column_type), allocatable, intent(out) :: columns(:)
      !> Set if a name is unknown or given twice, or the list has no such entry.
      type(error_type), allocatable, intent(out) :: error
      type(field_type), allocatable :: fields(:)
      logical, allocatable :: possible(:)
      character(len=:), allocatable :: group, key, suggestion, word
      logical :: known
      integer :: count, dot, i, j

      allocate (fields, source=get_active_fields(case))
      ! All samples must have levels in the same bands.
      possible = [(.not. any(common_groups == fields(i)%group) .and. fields(i)%owner /= 'modes' &
         .and. fields(i)%key /= 'bands', i=1, size(fields))]
      allocate (columns(size(names)))
      do i = 1, size(names)
         dot = index(names(i), '.')
         group = names(i)(:max(dot - 1, 0))
         word = trim(names(i)(dot + 1:))
         key = word(:index(word//'(', '(') - 1)
         ! Without a group, the name means the first of the keys with this name, which belongs to the source.
         columns(i)%field = findloc(possible .and. fields%key == key .and. (group == '' .or. fields%group == group), &
            .true., dim=1)
         count = 0
         known = columns(i)%field > 0 .and. dot /= 1
         if (known) then
            if (fields(columns(i)%field)%kind == 'list') count = size(fields(columns(i)%field)%get_entries())
            columns(i)%entry = findloc([(word == key//'('//to_text(j)//')', j=1, count)], .true., dim=1)
            known = word == key .and. count == 0 .or. columns(i)%entry > 0
         end if
         if (.not. known) then
            call get_suggestion(trim(names(i)), pack(fields%key, possible), suggestion)
            error = input_error(quoted(names(i))//' is not a key of samples'//suggestion//'; allowed: ' &
               //join_quoted(pack(fields%key, possible)))
            if (count > 0) error = input_error(quoted(names(i)) &
               //' is not an entry of the list; allowed: '//trim(key)//'(1) to '//trim(key)//'('//to_text(count)//')')
         else if (any([(columns(j)%field == columns(i)%field .and. columns(j)%entry == columns(i)%entry, j=1, i - 1)])) then
            error = input_error(quoted(names(i))//' is given twice; allowed: once')
         end if
         if (allocated(error)) return
      end do
   end subroutine find_columns

end module thud_column
