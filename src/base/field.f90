!> One key of the input: its name, unit, allowed range and meaning, and the variable that it sets. The input is read,
!> checked, written and documented by this description. `in_group` sets group and owner, `only_with` a switch of keys.
module thud_field
   use thud_error, only: error_type, input_error
   use thud_interval, only: get_range_text, interval_type, key_length, new_interval
   use thud_kinds, only: wp
   use thud_text, only: get_suggestion, is_number, join, join_quoted, lower_case, quoted, shortened, to_text
   implicit none (type, external)
   private

   public :: check_fields, field_type, get_interval, in_group, key_length, list_type, name_length, new_field, only_with
   public :: text_list_type

   !> Maximum number of entries of a list.
   integer, parameter :: list_length = 64

   !> A list of numbers of any length up to `list_length`.
   type :: list_type
      !> Number of entries.
      integer :: count = 0
      !> The entries; the first `count` are used: [list_length].
      real(wp) :: values(list_length) = 0.0_wp
   end type list_type

   !> Length of text values such as the name of a model or a case.
   integer, parameter :: name_length = 128

   !> Maximum number of entries of a list of texts.
   integer, parameter :: text_list_length = 16

   !> A list of texts of any length up to `text_list_length`.
   type :: text_list_type
      !> Number of entries.
      integer :: count = 0
      !> The entries; the first `count` are used: [text_list_length].
      character(len=name_length) :: values(text_list_length) = ''
   end type text_list_type

   !> Maximum number of allowed texts of one key.
   integer, parameter :: max_choices = 12

   !> Description of one key and a pointer to its variable.
   type :: field_type
      !> Namelist group.
      character(len=key_length) :: group = ''
      !> Key within the group.
      character(len=key_length) :: key = ''
      !> What uses the key: the name of a source model or of a floor, or `modes`, `compression`, `unknowns`, `floor` or
      !> `room`; blank if every impact uses it.
      character(len=key_length) :: owner = ''
      !> SI unit, empty for pure numbers and text.
      character(len=8) :: unit = ''
      !> Help text: what the value is, in a few words.
      character(len=128) :: meaning = ''
      !> Kind of the value: `real`, `whole`, `flag`, `choice`, `text`, `list`, `texts`.
      character(len=6) :: kind = ''
      !> The variable: real, integer, logical, text, `list_type` or `text_list_type`.
      class(*), pointer :: value => null()
      !> Allowed range of numbers such as `(0, 10]`, see `thud_interval`.
      character(len=72) :: range = ''
      !> What else there is to know: `whole` (only integers), `numerical` (belongs to the resolution or the output, and is no
      !> property of the source), `path` (of a file, relative to the directory of the case or to the current one),
      !> `derived` (at the value 0 it follows from other keys), or `calibrated` (on the standard ball: where the key is not
      !> stated, it has the value of the standard ball by the model).
      character(len=10) :: trait = ''
      !> Key without which this one has no effect, and, if that is a choice, the values with which it has one, the
      !> calibrated one first; blank: none: [max_choices].
      character(len=key_length) :: needs(max_choices) = ''
      !> Number of allowed texts; 0 for free text.
      integer :: n_choice = 0
      !> Allowed texts; the first `n_choice` are used: [max_choices]. The size is fixed because some compilers lose
      !> allocatable components in array constructors.
      character(len=key_length) :: choices(max_choices) = ''
   contains
      procedure :: set_from_text
      procedure :: set_number
      procedure :: get_number
      procedure :: get_entries
      procedure :: get_text
      procedure :: get_allowed
      procedure :: has_effect
      procedure :: get_error
   end type field_type

contains

   !> Describes a key.
   function new_field(key, variable, unit, meaning, range, choices, trait) result(field)
      character(len=*), intent(in) :: key
      !> Real, integer, logical, text of `name_length`, `list_type` or `text_list_type`.
      class(*), intent(in), target :: variable
      !> SI unit, empty if there is none; help text.
      character(len=*), intent(in) :: unit, meaning
      !> Allowed range of numbers, of a list that of each entry (default: all).
      character(len=*), intent(in), optional :: range
      !> The allowed words (default: any text): [n_choice].
      character(len=*), intent(in), optional :: choices(:)
      !> See `field_type` (default: none, of an integer `whole`).
      character(len=*), intent(in), optional :: trait
      type(field_type) :: field

      field = field_type(key=key, unit=unit, meaning=meaning)
      field%value => variable
      if (present(range)) field%range = range
      select type (variable)
      type is (real(wp))
         field%kind = 'real'
      type is (integer)
         field%kind = 'whole'
         field%trait = 'whole'
      type is (logical)
         field%kind = 'flag'
      type is (list_type)
         field%kind = 'list'
      type is (text_list_type)
         field%kind = 'texts'
      class default
         field%kind = 'text'
      end select
      if (present(trait)) field%trait = trait
      if (.not. present(choices)) return
      field%kind = 'choice'
      field%n_choice = size(choices)
      field%choices(:size(choices)) = choices
   end function new_field

   !> Puts keys into a namelist group, except keys that have one already, and sets their owner: [n_field].
   function in_group(group, fields, owner) result(placed)
      character(len=*), intent(in) :: group
      !> The keys: [n_field].
      type(field_type), intent(in) :: fields(:)
      !> A source model, a floor, `modes`, `compression`, `unknowns`, `floor` or `room` (default: the present one).
      character(len=*), intent(in), optional :: owner
      type(field_type) :: placed(size(fields))

      placed = fields
      where (placed%group == '') placed%group = group
      if (present(owner)) placed%owner = owner
   end function in_group

   !> Keys that have an effect only with another one.
   function only_with(switch, fields, values) result(needing)
      !> The other key.
      character(len=*), intent(in) :: switch
      !> The keys: [n_field].
      type(field_type), intent(in) :: fields(:)
      !> Its values, if it is a choice, the calibrated one first (default: any but 0 and an empty list): [n_value].
      character(len=*), intent(in), optional :: values(:)
      type(field_type) :: needing(size(fields))
      integer :: i

      needing = fields
      do i = 1, size(fields)
         needing(i)%needs(1) = switch
         if (present(values)) needing(i)%needs(2:size(values) + 1) = values
      end do
   end function only_with

   !> Whether a key has an effect with the values of the other keys.
   pure recursive function has_effect(field, fields) result(yes)
      class(field_type), intent(in) :: field
      !> Keys that the case uses: [n_field].
      type(field_type), intent(in) :: fields(:)
      logical :: yes
      integer :: i

      i = findloc(fields%owner == field%owner .and. fields%key == field%needs(1), .true., dim=1)
      yes = field%needs(1) == ''
      if (i > 0) yes = fields(i)%has_effect(fields) .and. any(abs(fields(i)%get_entries()) > 0.0_wp)
      if (yes .and. field%needs(2) /= '') yes = any(field%needs(2:) == fields(i)%choices(nint(fields(i)%get_number())))
   end function has_effect

   !> Returns an error for the first value outside its range, NaN included; ranges that depend on other keys come last.
   subroutine check_fields(fields, error)
      !> The fields: [n_field].
      type(field_type), intent(in) :: fields(:)
      type(error_type), allocatable, intent(out) :: error
      type(interval_type) :: intervals(size(fields))
      character(len=:), allocatable :: text
      logical :: depends(size(fields))
      logical :: inside
      integer :: indices(size(fields))
      integer :: i

      indices = [(i, i=1, size(fields))]
      intervals = [(get_interval(fields, i), i=1, size(fields))]
      depends = intervals%lower_key /= '' .or. intervals%upper_key /= ''
      indices = [pack(indices, .not. depends), pack(indices, depends)]
      do i = 1, size(fields)
         associate (field => fields(indices(i)), interval => intervals(indices(i)))
            inside = field%kind /= 'choice' .or. field%get_number() > 0.0_wp
            if (field%range /= '') inside = all(interval%contains(field%get_entries()))
            if (field%trait == 'whole') inside = inside .and. all(is_whole(field%get_entries()))
            if (inside) cycle
            call field%get_text(text)
            error = field%get_error(text, interval)
            return
         end associate
      end do
   end subroutine check_fields

   !> Allowed range of a number; its ends may depend on other keys of the same group.
   function get_interval(fields, i) result(interval)
      !> All fields: [n_field].
      type(field_type), intent(in) :: fields(:)
      !> Index of the field.
      integer, intent(in) :: i
      type(interval_type) :: interval
      integer, allocatable :: group(:)
      integer :: j

      interval = new_interval(fields(i)%range)
      if (interval%lower_key == '' .and. interval%upper_key == '') return
      group = pack([(j, j=1, size(fields))], fields%group == fields(i)%group)
      call interval%resolve(fields(group)%key, [(fields(group(j))%get_number(), j=1, size(group))])
   end function get_interval

   !> Sets the variable from the text of a namelist assignment.
   subroutine set_from_text(self, text, error)
      class(field_type), intent(in) :: self
      !> Text after the equals sign.
      character(len=*), intent(in) :: text
      !> Set if the text is not a value of the key's kind.
      type(error_type), allocatable, intent(out) :: error
      type(list_type) :: numbers
      type(text_list_type) :: texts
      logical :: valid

      select type (value => self%value)
      type is (logical)
         valid = any(lower_case(text) == [character(len=7) :: '.true.', '.false.', 'true', 'false', '.t.', '.f.', 't', 'f'])
         if (valid) value = scan(text, 'tT') > 0
      type is (list_type)
         call read_numbers(text, numbers, valid)
         if (valid) value = numbers
      type is (text_list_type)
         call read_texts(text, texts, valid)
         if (valid) value = texts
      type is (character(len=*))
         call read_texts(text, texts, valid)
         valid = valid .and. texts%count == 1
         if (valid) value = texts%values(1)
         if (valid .and. self%kind == 'choice') value = lower_case(value)
      class default
         valid = is_number(text) .and. (self%kind == 'real' .or. verify(text, '+-0123456789') == 0)
         if (valid) call read_numbers(text, numbers, valid)
         if (valid) call self%set_number(numbers%values(1), 0, error)
         valid = valid .and. .not. allocated(error)
      end select
      if (.not. valid) error = self%get_error(text)
   end subroutine set_from_text

   !> Reads numbers between commas or blanks, some perhaps with repeats such as `3*0.1`. The namelist reader would skip other
   !> entries without an error (`-`), or read them as null values (`1*`).
   subroutine read_numbers(text, list, valid)
      character(len=*), intent(in) :: text
      type(list_type), intent(out) :: list
      !> False if there are too many entries, gaps between them, or something that is not a number.
      logical, intent(out) :: valid
      character(len=len(text) + 1) :: remaining
      character(len=128) :: message
      real(wp) :: number
      integer :: last, n, star, status

      valid = .false.
      remaining = adjustl(text)
      do while (remaining /= '')
         last = scan(remaining, ' ,') - 1
         star = index(remaining(:last), '*')
         n = merge(0, 1, star > 0)
         if (any(star == [2, 3, 4]) .and. verify(remaining(:star - 1), '0123456789') == 0) read (remaining(:star - 1), *) n
         valid = n > 0 .and. n <= list_length - list%count .and. is_number(remaining(star + 1:last))
         if (valid) read (remaining(star + 1:last), *, iostat=status, iomsg=message) number
         valid = valid .and. status == 0
         if (.not. valid) return
         list%values(list%count + 1:list%count + n) = number
         list%count = list%count + n
         remaining = adjustl(remaining(last + 1:))
         if (remaining(1:1) == ',') remaining = adjustl(remaining(2:))
      end do
   end subroutine read_numbers

   !> Reads texts in quotes, with commas or blanks between them; a doubled quote stands for one.
   subroutine read_texts(text, list, valid)
      character(len=*), intent(in) :: text
      type(text_list_type), intent(out) :: list
      !> False if there are too many texts, one is too long, or something else stands between them.
      logical, intent(out) :: valid
      character(len=:), allocatable :: entry
      integer :: first, last, length

      last = 0
      do
         first = last + verify(text(last + 1:), ' ,')
         valid = first == last
         if (valid .or. list%count == text_list_length) return
         if (scan(text(first:first), '''"') == 0) return
         entry = ''
         last = first
         do
            length = index(text(last + 1:), text(first:first))
            if (length == 0) return
            entry = entry//text(last + 1:last + length)
            last = last + length
            if (index(text(last + 1:), text(first:first)) /= 1) exit
            last = last + 1
         end do
         entry = entry(:len(entry) - 1)
         if (len_trim(entry) > name_length) return
         list%count = list%count + 1
         list%values(list%count) = entry
      end do
   end subroutine read_texts

   !> Value as a number: the index of a choice, 0 or 1 for a flag.
   pure function get_number(self) result(number)
      class(field_type), intent(in) :: self
      !> The number; 0 for a choice that is not allowed, for free text and lists.
      real(wp) :: number

      number = 0.0_wp
      select type (value => self%value)
      type is (real(wp))
         number = value
      type is (integer)
         number = real(value, wp)
      type is (logical)
         number = merge(1.0_wp, 0.0_wp, value)
      type is (character(len=*))
         number = real(findloc(self%choices(:self%n_choice) == value, .true., dim=1), wp)
      end select
   end function get_number

   !> Entries of a list; of another kind its value as a number: [n_entry].
   pure function get_entries(self) result(entries)
      class(field_type), intent(in) :: self
      real(wp), allocatable :: entries(:)

      select type (value => self%value)
      type is (list_type)
         entries = value%values(:value%count)
      type is (text_list_type)
         entries = spread(0.0_wp, 1, value%count)
      class default
         entries = [self%get_number()]
      end select
   end function get_entries

   !> Sets the variable from a number as `get_number` returns it.
   subroutine set_number(self, number, entry, error)
      class(field_type), intent(in) :: self
      real(wp), intent(in) :: number
      !> Index of the list entry to set; 0 if the key is not a list.
      integer, intent(in) :: entry
      !> Set if the key cannot have this value.
      type(error_type), allocatable, intent(out) :: error
      logical :: valid

      valid = is_whole(number)
      select type (value => self%value)
      type is (real(wp))
         value = number
         return
      type is (list_type)
         value%values(entry) = number
         return
      type is (integer)
         if (valid) value = nint(number)
      type is (logical)
         if (valid) value = nint(number) /= 0
      type is (character(len=*))
         valid = valid .and. number >= 1 .and. number <= self%n_choice
         if (valid) value = self%choices(nint(number))
      end select
      if (.not. valid) error = self%get_error(to_text(number))
   end subroutine set_number

   !> Whether a number is an integer.
   elemental function is_whole(number) result(yes)
      real(wp), intent(in) :: number
      logical :: yes

      yes = abs(number) <= huge(1) .and. .not. abs(number - anint(number)) > 0.0_wp
   end function is_whole

   !> Error that names group, key, value and allowed range.
   function get_error(self, value, interval) result(error)
      class(field_type), intent(in) :: self
      !> The value as text.
      character(len=*), intent(in) :: value
      !> The range with resolved ends (default: unresolved).
      type(interval_type), intent(in), optional :: interval
      type(error_type) :: error
      character(len=:), allocatable :: allowed, suggestion

      ! Without the quotes.
      call get_suggestion(value(2:len(value) - 1), self%choices(:self%n_choice), suggestion)
      call self%get_allowed(allowed, interval)
      error = input_error('= '//shortened(value)//' is not allowed'//suggestion//'; allowed: '//allowed, self%group, &
         self%key)
      if (.not. present(interval)) return
      error%value = self%get_number()
      error%range = interval
   end function get_error

   !> The value in namelist syntax.
   subroutine get_text(self, text)
      class(field_type), intent(in) :: self
      !> The value; text is in quotes.
      character(len=:), allocatable, intent(out) :: text

      select type (value => self%value)
      type is (character(len=*))
         text = quoted(value)
      type is (text_list_type)
         text = join_quoted(value%values(:value%count))
      type is (integer)
         text = to_text(value)
      type is (logical)
         text = trim(merge('.true. ', '.false.', value))
      class default
         text = join(self%get_entries())
      end select
   end subroutine get_text

   !> The allowed range in words: `0 < outer_radius <= 10 m`.
   subroutine get_allowed(self, text, interval)
      class(field_type), intent(in) :: self
      !> The range with its unit, or the list of allowed words.
      character(len=:), allocatable, intent(out) :: text
      !> The range with resolved ends (default: unresolved).
      type(interval_type), intent(in), optional :: interval
      type(interval_type) :: range

      select case (self%kind)
      case ('choice')
         text = join_quoted(self%choices(:self%n_choice))
      case ('text')
         text = 'text in quotes, up to '//to_text(name_length)//' characters'
      case ('texts')
         text = 'up to '//to_text(text_list_length)//' texts in quotes, each up to '//to_text(name_length)//' characters'
      case ('flag')
         text = '.true., .false.'
      case default
         range = new_interval(self%range)
         if (present(interval)) range = interval
         call get_range_text(range, trim(self%key), text)
         if (self%unit /= '') text = text//' '//trim(self%unit)
         if (self%trait == 'whole') text = text//', whole'
         if (self%kind == 'list') text = text//', up to '//to_text(list_length)//' numbers'
      end select
   end subroutine get_allowed

end module thud_field
