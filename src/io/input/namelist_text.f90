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
      !> Text of the value as written, without comments.
      character(len=:), allocatable :: value
      !> Line of the key or of the `&`.
      integer :: line = 0
   end type assignment_type

   !> Characters allowed in names.
   character(len=*), parameter :: name_characters = 'abcdefghijklmnopqrstuvwxyz0123456789_'

   !> Blank characters.
   character(len=*), parameter :: blanks = ' '//tab//newline//achar(13)

contains

   !> All groups of a text and their assignments, in order.
   subroutine parse_namelist(text, assignments, error)
      !> Text of the input file.
      character(len=*), intent(in) :: text
      !> Each group, followed by its assignments: [n_assignment].
      type(assignment_type), allocatable, intent(out) :: assignments(:)
      !> Set if the text does not consist of terminated groups.
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: clean, structure
      integer :: start, gap

      allocate (assignments(0))
      call separate(text, clean, structure, error)
      start = 1
      do while (.not. allocated(error))
         gap = verify(structure(start:), blanks)
         if (gap == 0) return
         start = start + gap - 1
         call read_group(clean, structure, start, assignments, error)
      end do
   end subroutine parse_namelist

   !> Replaces comments by blanks, and in a second copy also quoted text by `x`.
   subroutine separate(text, clean, structure, error)
      !> Text of the input file.
      character(len=*), intent(in) :: text
      !> The text without comments; all characters keep their positions.
      character(len=:), allocatable, intent(out) :: clean
      !> The same in lower case, with `x` for quoted text.
      character(len=:), allocatable, intent(out) :: structure
      !> Set if a quote is not closed, or the file is not text.
      type(error_type), allocatable, intent(out) :: error
      character(len=1) :: quote
      logical :: in_comment
      integer :: i

      clean = text
      structure = lower_case(text)
      quote = ' '
      in_comment = .false.
      do i = 1, len(text)
         if (text(i:i) == newline) then
            if (quote /= ' ') exit
            in_comment = .false.
         else if (in_comment) then
            clean(i:i) = ' '
            structure(i:i) = ' '
         else if (quote /= ' ') then
            if (text(i:i) == quote) quote = ' '
            structure(i:i) = 'x'
         else if (text(i:i) == '!') then
            in_comment = .true.
            clean(i:i) = ' '
            structure(i:i) = ' '
         else if (text(i:i) == "'" .or. text(i:i) == '"') then
            quote = text(i:i)
            structure(i:i) = 'x'
         else if (iachar(text(i:i)) < 32 .and. scan(text(i:i), blanks) == 0 .or. iachar(text(i:i)) > 126) then
            ! Such as the special blanks and quotes of word processors.
            error = input_error('line '//to_text(line_of(text, i))//' holds a character that is not plain text outside' &
               //' quotes and comments; allowed: letters, digits and signs of ASCII')
            return
         end if
      end do
      if (quote /= ' ') error = input_error('a quote is not closed in line '//to_text(line_of(text, i - 1)) &
         //'; allowed: quotes that begin and end in one line')
   end subroutine separate

   !> Reads one group.
   subroutine read_group(clean, structure, start, assignments, error)
      !> Text without comments; the same without quoted text.
      character(len=*), intent(in) :: clean, structure
      !> Position of the first character of the group; afterwards that behind its end.
      integer, intent(inout) :: start
      !> Groups and assignments so far: [n_assignment].
      type(assignment_type), allocatable, intent(inout) :: assignments(:)
      !> Set if no group starts here, it has no end, or a part of it is not `key = value`.
      type(error_type), allocatable, intent(out) :: error
      type(assignment_type) :: new
      character(len=:), allocatable :: label
      logical :: closed
      integer :: begin, finish, equals, first, last

      new%line = line_of(structure, start)
      begin = start + verify(structure(start + 1:)//' ', name_characters)
      if (structure(start:start) /= '&' .or. begin == start + 1) then
         error = input_error('line '//to_text(new%line)//' stands outside a group; ' &
            //"allowed: groups '&name key = value /' and comments after '!'")
         return
      end if
      new%group = structure(start + 1:begin - 1)
      new%value = ''
      assignments = [assignments, new]
      label = '&'//shortened(trim(new%group))
      ! The group ends with `/` or `&end`.
      finish = begin - 1 + scan(structure(begin:), '/&')
      closed = finish >= begin
      if (closed) closed = structure(finish:finish) == '/' .or. index(structure(finish:)//' ', '&end') == 1
      if (.not. closed) then
         error = input_error(label//' in line '//to_text(new%line)//" is not terminated; allowed: a '/' at the end of the " &
            //'group')
         return
      end if
      start = finish + merge(1, len('&end'), structure(finish:finish) == '/')
      do
         ! The next key and its equals sign; all positions lie past the end if there is none.
         first = finish
         last = finish
         equals = finish
         if (index(structure(begin:finish - 1), '=') > 0) then
            equals = begin - 1 + index(structure(begin:finish - 1), '=')
            last = begin - 1 + verify(structure(begin:equals - 1), blanks, back=.true.)
            first = begin + verify(structure(begin:last), name_characters, back=.true.)
         end if
         call get_value(clean(begin:first - 1), new%value)
         if (new%key /= '') then
            assignments = [assignments, new]
         else if (new%value /= '') then
            call get_value(clean(begin:finish - 1), new%value)
            error = input_error(label//' in line '//to_text(new%line)//": '"//shortened(new%value) &
               //"' is not an assignment; allowed: 'key = value'")
         end if
         if (allocated(error) .or. first >= finish) return
         new%line = line_of(structure, first)
         if (last < first) error = input_error(label//': an equals sign in line '//to_text(new%line) &
            //" has no key; allowed: 'key = value'")
         if (allocated(error)) return
         new%key = structure(first:last)
         begin = equals + 1
      end do
   end subroutine read_group

   !> The value in one line, without surrounding blanks and trailing comma.
   pure subroutine get_value(text, value)
      !> Text between an equals sign and the next key.
      character(len=*), intent(in) :: text
      character(len=:), allocatable, intent(out) :: value
      integer :: first, last

      first = verify(text, blanks)
      last = verify(text, blanks//',', back=.true.)
      value = ''
      if (first > 0 .and. last >= first) value = replaced(text(first:last), blanks, ' ')
   end subroutine get_value

   !> Line number of a position, from 1.
   pure function line_of(text, position) result(line)
      character(len=*), intent(in) :: text
      !> Position of a character.
      integer, intent(in) :: position
      integer :: line
      integer :: i

      line = 1
      do i = 1, min(position, len(text)) - 1
         if (text(i:i) == newline) line = line + 1
      end do
   end function line_of

end module thud_namelist_text
