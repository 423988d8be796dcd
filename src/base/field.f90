!> One key of the input: its name, unit, allowed range and meaning, and the variable that it
!> sets. Reading, checking, writing and describing the input all use this one description.
module thud_field
   use thud_error, only: error_type, input_error
   use thud_kinds, only: wp
   use thud_text, only: join_quoted, lower_case, quoted, to_text
   implicit none (type, external)
   private

   public :: check_fields, field_type, list_type, name_length

   !> Most entries of a list.
   integer, parameter :: list_length = 64

   !> A list of numbers of any length up to `list_length`.
   type :: list_type
      !> Number of entries.
      integer :: count = 0
      !> The entries, the first `count` hold: [list_length].
      real(wp) :: values(list_length) = 0.0_wp
   end type list_type

   !> Length of text values such as the name of a model or a case.
   integer, parameter :: name_length = 128

   !> Most allowed texts of one key.
   integer, parameter :: max_choices = 12

   !> What no entry of a list can be.
   real(wp), parameter :: unset = -huge(1.0_wp)

   !> Description of one key and a pointer to the variable behind it.
   type :: field_type
      !> Namelist group.
      character(len=24) :: group = ''
      !> Key within the group.
      character(len=24) :: key = ''
      !> SI unit, empty for pure numbers and text.
      character(len=8) :: unit = ''
      !> What the value is, in a few words.
      character(len=96) :: meaning = ''
      !> The real variable that is described, else null.
      real(wp), pointer :: real_value => null()
      !> The integer variable that is described, else null.
      integer, pointer :: integer_value => null()
      !> The logical variable that is described, else null.
      logical, pointer :: logical_value => null()
      !> The list that is described, else null.
      type(list_type), pointer :: list_value => null()
      !> The text variable that is described, else null.
      character(len=name_length), pointer :: text_value => null()
      !> Lower bound of the allowed range.
      real(wp) :: lower = -huge(1.0_wp)
      !> Upper bound of the allowed range.
      real(wp) :: upper = huge(1.0_wp)
      !> The lower bound itself is not allowed.
      logical :: lower_open = .false.
      !> The upper bound itself is not allowed.
      logical :: upper_open = .false.
      !> Number of allowed texts; 0 for free text.
      integer :: n_choice = 0
      !> Allowed texts, the first `n_choice` hold; of fixed size, because compilers lose allocatable
      !> components of array constructors: [max_choices].
      character(len=24) :: choices(max_choices) = ''
   contains
      procedure :: set_from_text
      procedure :: check
      procedure :: get_text
      procedure :: get_allowed
      procedure :: is_empty
      procedure, private :: complain
      procedure :: contains => contains_value
   end type field_type

contains

   !> First complaint of a list of fields, if any.
   subroutine check_fields(fields, error)
      !> The fields: [n_field].
      type(field_type), intent(in) :: fields(:)
      !> Names group, key, value and allowed range.
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      do i = 1, size(fields)
         call fields(i)%check(error)
         if (allocated(error)) return
      end do
   end subroutine check_fields

   !> Sets the variable from the text of a namelist assignment.
   subroutine set_from_text(self, text, error)
      !> The field.
      class(field_type), intent(in) :: self
      !> What stood behind the equals sign.
      character(len=*), intent(in) :: text
      !> The text is not a value of the wanted type.
      type(error_type), allocatable, intent(out) :: error
      character(len=2*name_length) :: word
      character(len=128) :: message
      character(len=:), allocatable :: line, wanted
      integer :: status, whole
      logical :: flag
      real(wp) :: list(list_length + 1)
      real(wp) :: number
      namelist /real_group/ number
      namelist /list_group/ list
      namelist /integer_group/ whole
      namelist /logical_group/ flag
      namelist /text_group/ word

      ! The run-time library's own namelist reader decides what a value is.
      status = 1
      if (associated(self%real_value)) then
         wanted = 'a number'
         line = '&real_group number = '//text//' /'
         if (is_plain(text, repeats=.false.)) read (line, nml=real_group, iostat=status, iomsg=message)
         if (status == 0) self%real_value = number
      else if (associated(self%list_value)) then
         wanted = 'a list of up to '//to_text(list_length)//' numbers'
         line = '&list_group list = '//text//' /'
         list = unset
         if (is_plain(text, repeats=.true.)) read (line, nml=list_group, iostat=status, iomsg=message)
         if (status == 0) call set_list(list, self%list_value, status)
      else if (associated(self%integer_value)) then
         wanted = 'a whole number'
         line = '&integer_group whole = '//text//' /'
         if (index(text, '*') == 0) read (line, nml=integer_group, iostat=status, iomsg=message)
         if (status == 0) self%integer_value = whole
      else if (associated(self%logical_value)) then
         wanted = '.true. or .false.'
         line = '&logical_group flag = '//text//' /'
         if (index(text, '*') == 0) read (line, nml=logical_group, iostat=status, iomsg=message)
         if (status == 0) self%logical_value = flag
      else
         wanted = 'short text in quotes'
         line = '&text_group word = '//text//' /'
         word = ''
         if (scan(text(1:1), '''"') == 1) read (line, nml=text_group, iostat=status, iomsg=message)
         if (status == 0) status = merge(0, 1, len_trim(word) <= name_length)
         if (status == 0) self%text_value = word(:name_length)
         if (status == 0 .and. self%n_choice > 0) self%text_value = lower_case(self%text_value)
      end if
      if (status /= 0) error = self%complain(text, 'is not '//wanted)
   end subroutine set_from_text

   !> Whether numbers are written in the usual way. A namelist may also hold null values (`1*`) and
   !> exponents without a letter (`1+3` for 1000): nobody means them.
   pure function is_plain(text, repeats) result(plain)
      !> What stood behind the equals sign.
      character(len=*), intent(in) :: text
      !> `3*0.1` is allowed.
      logical, intent(in) :: repeats
      !> The text is plain.
      logical :: plain
      integer :: i

      plain = scan(text, 'qQ') == 0 .and. (repeats .or. index(text, '*') == 0)
      do i = 2, len(text)
         if (scan(text(i:i), '+-') > 0) plain = plain .and. scan(text(i - 1:i - 1), ' ,*eEdD') > 0
      end do
   end function is_plain

   !> Takes over the entries that were read.
   subroutine set_list(entries, list, status)
      !> The entries, those that were not given hold `unset`: [list_length + 1].
      real(wp), intent(in) :: entries(:)
      !> The list.
      type(list_type), intent(inout) :: list
      !> Not 0 where there are too many entries or gaps between them.
      integer, intent(out) :: status
      logical :: given(size(entries))

      ! Asked so that a NaN counts as given; the check of the range refuses it later.
      given = .not. entries <= unset
      status = merge(0, 1, all(given(:count(given))) .and. count(given) <= list_length)
      if (status /= 0) return
      list%count = count(given)
      list%values(:list%count) = entries(:list%count)
   end subroutine set_list

   !> Complains about a value outside the allowed range, NaN included.
   subroutine check(self, error)
      !> The field.
      class(field_type), intent(in) :: self
      !> Names group, key, value and allowed range.
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: text
      logical :: inside

      inside = .true.
      if (self%n_choice > 0) then
         inside = any(self%choices(:self%n_choice) == self%text_value)
      else if (associated(self%real_value)) then
         inside = self%contains(self%real_value)
      else if (associated(self%list_value)) then
         inside = all(self%contains(self%list_value%values(:self%list_value%count)))
      else if (associated(self%integer_value)) then
         inside = self%contains(real(self%integer_value, wp))
      end if
      if (inside) return
      call self%get_text(text)
      error = self%complain(text, 'is not allowed')
   end subroutine check

   !> Whether a value lies in the allowed range; NaN never does.
   elemental function contains_value(self, value) result(inside)
      !> The field.
      class(field_type), intent(in) :: self
      !> The value.
      real(wp), intent(in) :: value
      !> It lies in the range.
      logical :: inside

      inside = (value > self%lower .or. (.not. self%lower_open .and. value >= self%lower)) &
         .and. (value < self%upper .or. (.not. self%upper_open .and. value <= self%upper))
   end function contains_value

   !> Error that names group, key, value and allowed range.
   function complain(self, value, what) result(error)
      !> The field.
      class(field_type), intent(in) :: self
      !> The value as text.
      character(len=*), intent(in) :: value
      !> What is wrong with it.
      character(len=*), intent(in) :: what
      !> The error.
      type(error_type) :: error
      character(len=:), allocatable :: allowed

      call self%get_allowed(allowed)
      error = input_error('&'//trim(self%group)//': '//trim(self%key)//' = '//value//' '//what &
         //'; allowed: '//allowed)
   end function complain

   !> The value as it stands in a namelist.
   subroutine get_text(self, text)
      !> The field.
      class(field_type), intent(in) :: self
      !> The value; text is in quotes.
      character(len=:), allocatable, intent(out) :: text
      integer :: i

      if (associated(self%real_value)) then
         text = to_text(self%real_value)
      else if (associated(self%list_value)) then
         text = ''
         do i = 1, self%list_value%count
            if (i > 1) text = text//', '
            text = text//to_text(self%list_value%values(i))
         end do
      else if (associated(self%integer_value)) then
         text = to_text(self%integer_value)
      else if (associated(self%logical_value)) then
         text = to_text(self%logical_value)
      else
         text = quoted(self%text_value)
      end if
   end subroutine get_text

   !> The allowed range in words: `0 < outer_radius <= 10 m`.
   subroutine get_allowed(self, text)
      !> The field.
      class(field_type), intent(in) :: self
      !> The range with its unit, or the list of allowed words.
      character(len=:), allocatable, intent(out) :: text

      if (self%n_choice > 0) then
         text = join_quoted(self%choices(:self%n_choice))
      else if (associated(self%text_value)) then
         text = 'text in quotes, up to '//to_text(name_length)//' characters'
      else if (associated(self%logical_value)) then
         text = '.true., .false.'
      else
         text = to_text(self%lower)
         call drop_idle_decimal(text)
         text = text//' '//trim(merge('< ', '<=', self%lower_open))//' '//trim(self%key)//' ' &
            //trim(merge('< ', '<=', self%upper_open))//' '//to_text(self%upper)
         call drop_idle_decimal(text)
         if (self%unit /= '') text = text//' '//trim(self%unit)
         if (associated(self%integer_value)) text = text//', whole'
      end if
   end subroutine get_allowed

   !> Whether the field is a list without entries, which a namelist cannot hold.
   pure function is_empty(self) result(empty)
      !> The field.
      class(field_type), intent(in) :: self
      !> It is one.
      logical :: empty

      empty = .false.
      if (associated(self%list_value)) empty = self%list_value%count == 0
   end function is_empty

   !> Takes `.0` from the end of a text.
   pure subroutine drop_idle_decimal(text)
      !> A text that ends with a number.
      character(len=:), allocatable, intent(inout) :: text

      if (len(text) < 3) return
      if (text(len(text) - 1:) == '.0') text = text(:len(text) - 2)
   end subroutine drop_idle_decimal

end module thud_field
