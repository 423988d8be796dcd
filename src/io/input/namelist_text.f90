!> Splits the text of an input file into the assignments of its namelist groups. Fortran's namelist `read` reads the values
!> later; alone it could not distinguish a missing group from an unterminated one, nor name the key of a bad value.
module thud_namelist_text
   use thud_error, only: error_type, input_error
   use thud_field, only: name_length
   use thud_text, only: lower_case, newline, replaced, shortened, tab, to_text
   implicit none (type, external)
   private

   public :: assignment_type, parse_namelist

   !> One `key = value`, or the beginning of a group.
   type :: assignment_type
      !> Group and key in lower case; the key is empty at the beginning of the group.
      character(len=name_length) :: group = '', key = ''
      !> Text of the value as written, in one line, without comments, surrounding blanks and trailing comma.
      character(len=:), allocatable :: value
      !> Line of the equals sign or of the `&`.
      integer :: line = 0
   end type assignment_type

   !> Characters allowed in names.
   character(len=*), parameter :: name_characters = 'ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_'

   !> Blank characters.
   character(len=*), parameter :: blanks = ' '//tab//newline//achar(13)

contains

   !> All groups of a text and their assignments, in order.
   subroutine parse_namelist(text, assignments, error)
      !> Text of the input file.
      character(len=*), intent(in) :: text
      !> Each group, followed by its assignments: [n_assignment].
      type(assignment_type), allocatable, intent(out) :: assignments(:)
      !> Set if the text does not consist of terminated groups with assignments.
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: clean
      type(assignment_type) :: latest
      character(len=1) :: quote
      integer :: i, begin, line, first, last

      allocate (assignments(0))
      ! Without comments.
      clean = text
      quote = ' '
      line = 1
      i = 0
      do while (i < len(text) .and. .not. allocated(error))
         i = i + 1
         if (clean(i:i) == newline .and. quote /= ' ') exit
         if (clean(i:i) == newline) line = line + 1
         if (quote /= ' ') then
            if (clean(i:i) == quote) quote = ' '
         else if (clean(i:i) == '!') then
            last = i + index(clean(i:)//newline, newline) - 2
            clean(i:last) = ''
            i = last
         else if (iachar(clean(i:i)) < 32 .and. scan(clean(i:i), blanks) == 0 .or. iachar(clean(i:i)) > 126) then
            ! Such as the special blanks and quotes of word processors.
            error = input_error('line '//to_text(line)//' holds a character that is not plain text outside quotes and ' &
               //'comments; allowed: letters, digits and signs of ASCII, saved as UTF-8')
         else if (latest%group == '') then
            if (scan(clean(i:i), blanks) > 0) cycle
            begin = i + verify(clean(i + 1:)//' ', name_characters)
            if (clean(i:i) /= '&' .or. begin == i + 1) error = input_error('line '//to_text(line)//' stands outside a ' &
               //"group; allowed: groups '&name key = value /' and comments after '!'")
            latest = assignment_type(lower_case(clean(i + 1:begin - 1)), '', '', line)
            assignments = [assignments, latest]
            i = begin - 1
         else if (clean(i:i) == '/' .or. lower_case(clean(i:min(i + 3, len(clean)))) == '&end') then
            call add_latest(clean(begin:i - 1))
            latest%group = ''
            if (clean(i:i) == '&') i = i + 3
         else if (clean(i:i) == '=') then
            last = begin - 1 + verify(clean(begin:i - 1), blanks, back=.true.)
            first = begin + verify(clean(begin:last), name_characters, back=.true.)
            call add_latest(clean(begin:first - 1))
            if (first > last .and. .not. allocated(error)) error = input_error('&'//shortened(trim(latest%group)) &
               //': an equals sign in line '//to_text(line)//" has no key; allowed: 'key = value'")
            latest%key = lower_case(clean(first:last))
            latest%line = line
            begin = i + 1
         else if (scan(clean(i:i), '''"') == 1) then
            quote = clean(i:i)
         else if (clean(i:i) == '&') then
            exit
         end if
      end do
      if (allocated(error)) return
      if (quote /= ' ') then
         error = input_error('a quote is not closed in line '//to_text(line)//'; allowed: quotes that begin and end in ' &
            //'one line')
      else if (latest%group /= '') then
         line = assignments(findloc(assignments%key == '', .true., dim=1, back=.true.))%line
         error = input_error('&'//shortened(trim(latest%group))//' in line '//to_text(line)//" is not terminated; " &
            //"allowed: a '/' at the end of the group")
      end if

   contains

      !> Adds the latest assignment, whose value is known now.
      subroutine add_latest(value)
         !> Text between an equals sign, or the beginning of the group, and the next key or the end of the group.
         character(len=*), intent(in) :: value
         integer :: from, to

         from = verify(value, blanks)
         to = verify(value, blanks//',', back=.true.)
         latest%value = ''
         if (from > 0 .and. to >= from) latest%value = replaced(value(from:to), blanks, ' ')
         if (latest%key /= '') then
            assignments = [assignments, latest]
         else if (latest%value /= '') then
            error = input_error('&'//shortened(trim(latest%group))//' in line '//to_text(latest%line)//": '" &
               //shortened(latest%value)//"' is not an assignment; allowed: 'key = value'")
         end if
      end subroutine add_latest

   end subroutine parse_namelist

end module thud_namelist_text
