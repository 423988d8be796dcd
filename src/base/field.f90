!> One key of the input: its name, unit, allowed range and meaning, and the variable that it
!> sets. Reading, checking, writing and describing the input all use this one description.
module thud_field
   use thud_error, only: error_type, input_error
   use thud_kinds, only: wp
   use thud_text, only: join_quoted, lower_case, quoted, to_text
   implicit none (type, external)
   private

   public :: check_fields, choice_field, field_type, integer_field, name_length, real_field, text_field

   !> Length of text values such as the name of a model or a case.
   integer, parameter :: name_length = 128

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
      !> Allowed texts, empty for free text: [n_choice].
      character(len=24), allocatable :: choices(:)
   contains
      procedure :: set_from_text
      procedure :: check
      procedure :: get_text
      procedure :: get_allowed
      procedure, private :: complain
   end type field_type

contains

   !> Describes a real key.
   function real_field(group, key, variable, unit, meaning, lower, upper, lower_open, upper_open) result(field)
      !> Namelist group.
      character(len=*), intent(in) :: group
      !> Key within the group.
      character(len=*), intent(in) :: key
      !> The variable behind the key.
      real(wp), intent(in), target :: variable
      !> SI unit, empty for a pure number.
      character(len=*), intent(in) :: unit
      !> What the value is.
      character(len=*), intent(in) :: meaning
      !> Lower bound of the allowed range.
      real(wp), intent(in) :: lower
      !> Upper bound of the allowed range.
      real(wp), intent(in) :: upper
      !> The lower bound itself is not allowed (default: it is).
      logical, intent(in), optional :: lower_open
      !> The upper bound itself is not allowed (default: it is).
      logical, intent(in), optional :: upper_open
      !> The description.
      type(field_type) :: field

      field = field_type(group=group, key=key, unit=unit, meaning=meaning, lower=lower, upper=upper)
      field%real_value => variable
      if (present(lower_open)) field%lower_open = lower_open
      if (present(upper_open)) field%upper_open = upper_open
   end function real_field

   !> Describes an integer key.
   function integer_field(group, key, variable, meaning, lower, upper) result(field)
      !> Namelist group.
      character(len=*), intent(in) :: group
      !> Key within the group.
      character(len=*), intent(in) :: key
      !> The variable behind the key.
      integer, intent(in), target :: variable
      !> What the value is.
      character(len=*), intent(in) :: meaning
      !> Smallest allowed value.
      integer, intent(in) :: lower
      !> Largest allowed value.
      integer, intent(in) :: upper
      !> The description.
      type(field_type) :: field

      field = field_type(group=group, key=key, meaning=meaning, lower=real(lower, wp), upper=real(upper, wp))
      field%integer_value => variable
   end function integer_field

   !> Describes a key with free text.
   function text_field(group, key, variable, meaning) result(field)
      !> Namelist group.
      character(len=*), intent(in) :: group
      !> Key within the group.
      character(len=*), intent(in) :: key
      !> The variable behind the key.
      character(len=name_length), intent(in), target :: variable
      !> What the value is.
      character(len=*), intent(in) :: meaning
      !> The description.
      type(field_type) :: field

      field = field_type(group=group, key=key, meaning=meaning)
      field%text_value => variable
   end function text_field

   !> Describes a key that takes one of several words.
   function choice_field(group, key, variable, meaning, choices) result(field)
      !> Namelist group.
      character(len=*), intent(in) :: group
      !> Key within the group.
      character(len=*), intent(in) :: key
      !> The variable behind the key.
      character(len=name_length), intent(in), target :: variable
      !> What the value is.
      character(len=*), intent(in) :: meaning
      !> The allowed words: [n_choice].
      character(len=*), intent(in) :: choices(:)
      !> The description.
      type(field_type) :: field

      field = text_field(group, key, variable, meaning)
      allocate (field%choices, source=[character(len=24) :: choices])
   end function choice_field

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
      character(len=name_length) :: word
      character(len=128) :: message
      character(len=:), allocatable :: line, wanted
      integer :: status, whole
      real(wp) :: number
      namelist /real_group/ number
      namelist /integer_group/ whole
      namelist /text_group/ word

      ! The run-time library's own namelist reader decides what a value is.
      if (associated(self%real_value)) then
         wanted = 'a number'
         line = '&real_group number = '//text//' /'
         read (line, nml=real_group, iostat=status, iomsg=message)
         if (status == 0) self%real_value = number
      else if (associated(self%integer_value)) then
         wanted = 'a whole number'
         line = '&integer_group whole = '//text//' /'
         read (line, nml=integer_group, iostat=status, iomsg=message)
         if (status == 0) self%integer_value = whole
      else
         wanted = 'text in quotes'
         line = '&text_group word = '//text//' /'
         status = merge(0, 1, scan(text(1:1), '''"') == 1 .and. len(text) <= name_length)
         if (status == 0) read (line, nml=text_group, iostat=status, iomsg=message)
         if (status == 0) self%text_value = word
         if (allocated(self%choices)) self%text_value = lower_case(self%text_value)
      end if
      if (status /= 0) error = self%complain(text, 'is not '//wanted)
   end subroutine set_from_text

   !> Complains about a value outside the allowed range, NaN included.
   subroutine check(self, error)
      !> The field.
      class(field_type), intent(in) :: self
      !> Names group, key, value and allowed range.
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: text
      real(wp) :: value
      logical :: inside

      if (associated(self%text_value)) then
         if (.not. allocated(self%choices)) return
         inside = any(self%choices == self%text_value)
      else
         if (associated(self%real_value)) then
            value = self%real_value
         else
            value = real(self%integer_value, wp)
         end if
         ! Asked so that NaN is never inside.
         inside = (value > self%lower .or. (.not. self%lower_open .and. value >= self%lower)) &
            .and. (value < self%upper .or. (.not. self%upper_open .and. value <= self%upper))
      end if
      if (inside) return
      call self%get_text(text)
      error = self%complain(text, 'is not allowed')
   end subroutine check

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

      if (associated(self%real_value)) then
         text = to_text(self%real_value)
      else if (associated(self%integer_value)) then
         text = to_text(self%integer_value)
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

      if (allocated(self%choices)) then
         text = join_quoted(self%choices)
      else if (associated(self%text_value)) then
         text = 'text in quotes, up to '//to_text(name_length)//' characters'
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

   !> Takes `.0` from the end of a text.
   pure subroutine drop_idle_decimal(text)
      !> A text that ends with a number.
      character(len=:), allocatable, intent(inout) :: text

      if (len(text) < 3) return
      if (text(len(text) - 1:) == '.0') text = text(:len(text) - 2)
   end subroutine drop_idle_decimal

end module thud_field
