!> Descriptions of keys, one constructor per kind of value.
module thud_new_field
   use thud_field, only: field_type, list_type, name_length
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: choice_field, integer_field, list_field, logical_field, real_field, text_field

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

   !> Describes a key that is true or false.
   function logical_field(group, key, variable, meaning) result(field)
      !> Namelist group.
      character(len=*), intent(in) :: group
      !> Key within the group.
      character(len=*), intent(in) :: key
      !> The variable behind the key.
      logical, intent(in), target :: variable
      !> What the value is.
      character(len=*), intent(in) :: meaning
      !> The description.
      type(field_type) :: field

      field = field_type(group=group, key=key, meaning=meaning)
      field%logical_value => variable
   end function logical_field

   !> Describes a key with a list of numbers, each of which lies in one range.
   function list_field(group, key, variable, unit, meaning, lower, upper, lower_open, upper_open) result(field)
      !> Namelist group.
      character(len=*), intent(in) :: group
      !> Key within the group.
      character(len=*), intent(in) :: key
      !> The variable behind the key.
      type(list_type), intent(in), target :: variable
      !> SI unit, empty for pure numbers.
      character(len=*), intent(in) :: unit
      !> What the values are.
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

      field = real_field(group, key, variable%values(1), unit, meaning, lower, upper, lower_open, upper_open)
      field%real_value => null()
      field%list_value => variable
   end function list_field

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
      field%n_choice = size(choices)
      field%choices(:size(choices)) = choices
   end function choice_field

end module thud_new_field
