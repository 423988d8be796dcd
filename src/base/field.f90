!> One key of the input: its name, unit, allowed range and meaning, and the variable that it sets. The input is read,
!> checked, written and documented by this description.
module thud_field
   use thud_error, only: error_type, input_error
   use thud_interval, only: get_range_text, interval_type, new_interval
   use thud_kinds, only: wp
   use thud_suggestion, only: get_suggestion
   use thud_text, only: is_number, join, join_quoted, lower_case, quoted, replaced, shortened, to_text
   implicit none (type, external)
   private

   public :: check_fields, field_type, get_interval, key_length, list_type, name_length, text_list_type

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

   !> Length of the name of a key or a group.
   integer, parameter :: key_length = 24

   !> Maximum number of allowed texts of one key.
   integer, parameter :: max_choices = 12

   !> Allowed texts of a logical value.
   character(len=*), parameter :: flags(*) = [character(len=7) :: '.true.', '.false.', 'true', 'false', '.t.', '.f.', &
      't', 'f']

   !> Marks list entries that are not given.
   real(wp), parameter :: unset = -huge(1.0_wp)

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
      !> The variable of a real key, else null.
      real(wp), pointer :: real_value => null()
      !> The variable of an integer key, else null.
      integer, pointer :: integer_value => null()
      !> The variable of a logical key, else null.
      logical, pointer :: logical_value => null()
      !> The variable of a list key, else null.
      type(list_type), pointer :: list_value => null()
      !> The variable of a text key, else null.
      character(len=name_length), pointer :: text_value => null()
      !> The variable of a key with a list of texts, else null.
      type(text_list_type), pointer :: text_list_value => null()
      !> Allowed range of numbers, see `thud_interval`.
      character(len=72) :: range = ''
      !> The entries of the list must be whole numbers.
      logical :: whole_entries = .false.
      !> The key belongs to the resolution or the output, and is no property of the source.
      logical :: is_numerical = .false.
      !> The text is the path of a file, relative to the directory of the case or to the current one.
      logical :: is_path = .false.
      !> At the value 0 the key is derived from others.
      logical :: derived_at_zero = .false.
      !> Calibrated on the standard ball: where the key is not stated, it has the value of the standard ball by the model.
      logical :: is_calibrated = .false.
      !> A choice and its values with which the key has an effect, the calibrated one first; blank: with all:
      !> [max_choices].
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
      procedure :: get_kind
      procedure :: get_text
      procedure :: get_allowed
      procedure :: is_empty
      procedure :: get_needed_choice
      procedure :: has_effect
      procedure, private :: get_error
   end type field_type

contains

   !> The value of the choice that decides whether a key has an effect; blank if there is none.
   pure function get_needed_choice(field, fields) result(choice)
      class(field_type), intent(in) :: field
      !> Keys that the case uses: [n_field].
      type(field_type), intent(in) :: fields(:)
      character(len=key_length) :: choice
      integer :: i

      choice = ''
      do i = 1, size(fields)
         if (fields(i)%n_choice == 0 .or. fields(i)%owner /= field%owner) cycle
         if (fields(i)%key == field%needs(1)) choice = fields(i)%text_value(:key_length)
      end do
   end function get_needed_choice

   !> Whether a key has an effect with the choices of the case.
   pure function has_effect(field, fields) result(yes)
      class(field_type), intent(in) :: field
      !> Keys that the case uses: [n_field].
      type(field_type), intent(in) :: fields(:)
      logical :: yes

      yes = field%needs(1) == '' .or. any(field%needs(2:) == field%get_needed_choice(fields))
   end function has_effect

   !> Returns an error for the first value outside its range, NaN included.
   subroutine check_fields(fields, error)
      !> The fields: [n_field].
      type(field_type), intent(in) :: fields(:)
      type(error_type), allocatable, intent(out) :: error
      type(interval_type) :: interval
      character(len=:), allocatable :: text, suggestion
      logical :: inside
      integer :: i

      do i = 1, size(fields)
         associate (field => fields(i))
            inside = .true.
            suggestion = ''
            interval = get_interval(fields, i)
            if (field%n_choice > 0) then
               inside = any(field%choices(:field%n_choice) == field%text_value)
               if (.not. inside) call get_suggestion(trim(field%text_value), field%choices(:field%n_choice), suggestion)
            else if (associated(field%list_value)) then
               associate (entries => field%list_value%values(:field%list_value%count))
                  inside = all(interval%contains(entries))
                  if (field%whole_entries) inside = inside .and. .not. any(abs(entries - anint(entries)) > 0.0_wp)
               end associate
            else if (field%range /= '') then
               inside = interval%contains(field%get_number())
            end if
            if (inside) cycle
            call field%get_text(text)
            error = field%get_error(text, 'is not allowed'//suggestion, interval)
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
      if (interval%lower_expression == '' .and. interval%upper_expression == '') return
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
      character(len=2*name_length) :: word
      character(len=128) :: message
      character(len=:), allocatable :: line, wanted
      integer :: status, whole
      real(wp) :: list(list_length + 1)
      real(wp) :: number
      namelist /list_group/ list
      namelist /text_group/ word

      status = 1
      if (associated(self%real_value)) then
         wanted = 'a number'
         if (is_number(text)) read (text, *, iostat=status, iomsg=message) number
         if (status == 0) self%real_value = number
      else if (associated(self%list_value)) then
         wanted = 'a list of up to '//to_text(list_length)//' numbers'
         line = '&list_group list = '//text//' /'
         list = unset
         if (are_numbers(text)) read (line, nml=list_group, iostat=status, iomsg=message)
         if (status == 0) call set_list(list, self%list_value, status)
      else if (associated(self%text_list_value)) then
         wanted = 'a list of up to '//to_text(text_list_length)//' short texts in quotes'
         call set_text_list(text, self%text_list_value, status)
      else if (associated(self%integer_value)) then
         wanted = 'a whole number'
         if (is_number(text)) read (text, *, iostat=status, iomsg=message) whole
         if (status == 0) self%integer_value = whole
      else if (associated(self%logical_value)) then
         wanted = '.true. or .false.'
         if (any(lower_case(text) == flags)) status = 0
         if (status == 0) self%logical_value = scan(text, 'tT') > 0
      else
         wanted = 'short text in quotes'
         line = '&text_group word = '//text//' /'
         word = ''
         if (scan(text(1:1), '''"') == 1 .and. text(len(text):) == text(1:1)) then
            read (line, nml=text_group, iostat=status, iomsg=message)
         end if
         ! A longer text would have been cut.
         if (status == 0) status = merge(0, 1, len_trim(text) <= len(word) + 2 .and. len_trim(word) <= name_length)
         if (status == 0) self%text_value = word(:name_length)
         if (status == 0 .and. self%n_choice > 0) self%text_value = lower_case(self%text_value)
      end if
      if (status /= 0) error = self%get_error(text, 'is not '//wanted, new_interval(self%range))
   end subroutine set_from_text

   !> Whether a list holds only numbers, some perhaps with repeats such as `3*0.1`. The namelist reader would skip other
   !> entries without an error (`-`), or read them as null values (`1*`).
   pure function are_numbers(text) result(yes)
      character(len=*), intent(in) :: text
      logical :: yes
      character(len=len(text) + 1) :: remaining
      integer :: last

      yes = .true.
      remaining = adjustl(replaced(text, ',', ' '))
      do while (yes .and. remaining /= '')
         last = index(remaining, ' ') - 1
         yes = is_number(remaining(index(remaining(:last), '*') + 1:last))
         remaining = adjustl(remaining(last + 1:))
      end do
   end function are_numbers

   !> Sets a list from the entries that were read.
   subroutine set_list(entries, list, status)
      !> The entries; `unset` for entries missing from the input: [list_length + 1].
      real(wp), intent(in) :: entries(:)
      type(list_type), intent(inout) :: list
      !> Nonzero if there are too many entries or gaps between them.
      integer, intent(out) :: status
      logical :: is_set(size(entries))

      ! Written so that a NaN counts as given; the range check reports it later.
      is_set = .not. entries <= unset
      status = merge(0, 1, all(is_set(:count(is_set))) .and. count(is_set) <= list_length)
      if (status /= 0) return
      list%count = count(is_set)
      list%values(:list%count) = entries(:list%count)
   end subroutine set_list

   !> Sets a list of texts from texts in quotes, separated by commas or blanks.
   subroutine set_text_list(text, list, status)
      character(len=*), intent(in) :: text
      type(text_list_type), intent(inout) :: list
      !> Nonzero if there are too many texts, one is too long, or something else stands between them.
      integer, intent(out) :: status
      type(text_list_type) :: entries
      character(len=:), allocatable :: entry
      integer :: first, last

      status = 1
      first = verify(text, ' ,')
      do while (first > 0)
         if (scan(text(first:first), '''"') == 0 .or. entries%count == text_list_length) return
         call read_quoted(text, first, entry, last)
         if (last == 0 .or. len_trim(entry) > name_length) return
         entries%count = entries%count + 1
         entries%values(entries%count) = entry
         first = verify(text(last + 1:), ' ,')
         if (first > 0) first = last + first
      end do
      list = entries
      status = 0
   end subroutine set_text_list

   !> Reads a text in quotes; a doubled quote stands for one.
   pure subroutine read_quoted(text, first, entry, last)
      character(len=*), intent(in) :: text
      !> Position of the opening quote.
      integer, intent(in) :: first
      !> The text between the quotes.
      character(len=:), allocatable, intent(out) :: entry
      !> Position of the closing quote; 0 if there is none.
      integer, intent(out) :: last
      logical :: is_doubled

      entry = ''
      last = first + 1
      do while (last <= len(text))
         if (text(last:last) == text(first:first)) then
            is_doubled = last < len(text)
            if (is_doubled) is_doubled = text(last + 1:last + 1) == text(first:first)
            if (.not. is_doubled) return
            last = last + 1
         end if
         entry = entry//text(last:last)
         last = last + 1
      end do
      last = 0
   end subroutine read_quoted

   !> Value as a number: the index of a choice, 0 or 1 for a flag.
   function get_number(self) result(number)
      class(field_type), intent(in) :: self
      !> The number; 0 for free text and lists.
      real(wp) :: number

      number = 0.0_wp
      if (associated(self%real_value)) number = self%real_value
      if (associated(self%integer_value)) number = real(self%integer_value, wp)
      if (associated(self%logical_value)) number = merge(1.0_wp, 0.0_wp, self%logical_value)
      if (self%n_choice > 0) number = real(findloc(self%choices(:self%n_choice) == self%text_value, .true., dim=1), wp)
   end function get_number

   !> Sets the variable from a number as `get_number` returns it.
   subroutine set_number(self, number, entry, error)
      class(field_type), intent(in) :: self
      real(wp), intent(in) :: number
      !> Index of the list entry to set; 0 if the key is not a list.
      integer, intent(in) :: entry
      !> Set if the key cannot have this value.
      type(error_type), allocatable, intent(out) :: error
      logical :: whole

      whole = abs(number) <= real(huge(1), wp)
      if (whole) whole = .not. abs(number - anint(number)) > 0.0_wp
      if (associated(self%real_value)) then
         self%real_value = number
      else if (associated(self%list_value)) then
         self%list_value%values(entry) = number
      else if (.not. whole) then
         error = self%get_error(to_text(number), 'is not a whole number', new_interval(self%range))
      else if (associated(self%integer_value)) then
         self%integer_value = nint(number)
      else if (associated(self%logical_value)) then
         self%logical_value = nint(number) /= 0
      else if (nint(number) >= 1 .and. nint(number) <= self%n_choice) then
         self%text_value = self%choices(nint(number))
      else
         error = self%get_error(to_text(number), 'is not the number of a choice', new_interval(self%range))
      end if
   end subroutine set_number

   !> Kind of the value: `real`, `whole`, `flag`, `choice`, `text`, `list`, `texts`.
   pure function get_kind(self) result(kind)
      class(field_type), intent(in) :: self
      character(len=6) :: kind

      kind = 'text'
      if (associated(self%real_value)) kind = 'real'
      if (associated(self%integer_value)) kind = 'whole'
      if (associated(self%logical_value)) kind = 'flag'
      if (associated(self%list_value)) kind = 'list'
      if (associated(self%text_list_value)) kind = 'texts'
      if (self%n_choice > 0) kind = 'choice'
   end function get_kind

   !> Error that names group, key, value and allowed range.
   function get_error(self, value, problem, interval) result(error)
      class(field_type), intent(in) :: self
      !> The value as text; the fault, as `is not a whole number`.
      character(len=*), intent(in) :: value, problem
      type(interval_type), intent(in) :: interval
      type(error_type) :: error
      character(len=:), allocatable :: allowed

      call self%get_allowed(allowed, interval)
      error = input_error('&'//trim(self%group)//': '//trim(self%key)//' = '//shortened(value)//' '//problem &
         //'; allowed: '//allowed)
   end function get_error

   !> The value in namelist syntax.
   subroutine get_text(self, text)
      class(field_type), intent(in) :: self
      !> The value; text is in quotes.
      character(len=:), allocatable, intent(out) :: text

      if (associated(self%real_value)) then
         text = to_text(self%real_value)
      else if (associated(self%list_value)) then
         text = join(self%list_value%values(:self%list_value%count))
      else if (associated(self%text_list_value)) then
         text = join_quoted(self%text_list_value%values(:self%text_list_value%count))
      else if (associated(self%integer_value)) then
         text = to_text(self%integer_value)
      else if (associated(self%logical_value)) then
         text = to_text(self%logical_value)
      else
         text = quoted(self%text_value)
      end if
   end subroutine get_text

   !> The allowed range in words: `0 < outer_radius <= 10 m`.
   subroutine get_allowed(self, text, interval)
      class(field_type), intent(in) :: self
      !> The range with its unit, or the list of allowed words.
      character(len=:), allocatable, intent(out) :: text
      !> The range with resolved ends (default: unresolved).
      type(interval_type), intent(in), optional :: interval

      if (self%n_choice > 0) then
         text = join_quoted(self%choices(:self%n_choice))
      else if (associated(self%text_value)) then
         text = 'text in quotes, up to '//to_text(name_length)//' characters'
      else if (associated(self%text_list_value)) then
         text = 'up to '//to_text(text_list_length)//' texts in quotes, each up to '//to_text(name_length)//' characters'
      else if (associated(self%logical_value)) then
         text = '.true., .false.'
      else
         if (present(interval)) then
            call get_range_text(interval, trim(self%key), text)
         else
            call get_range_text(new_interval(self%range), trim(self%key), text)
         end if
         if (self%unit /= '') text = text//' '//trim(self%unit)
         if (associated(self%integer_value) .or. self%whole_entries) text = text//', whole'
      end if
   end subroutine get_allowed

   !> Whether the field is a list without entries, which a namelist cannot hold.
   pure function is_empty(self) result(empty)
      class(field_type), intent(in) :: self
      logical :: empty

      empty = .false.
      if (associated(self%list_value)) empty = self%list_value%count == 0
      if (associated(self%text_list_value)) empty = self%text_list_value%count == 0
   end function is_empty

end module thud_field
