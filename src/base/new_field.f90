!> Constructors of key descriptions, one per kind of value. Ranges are intervals such as `(0, 10]`, see
!> `thud_interval`; `in_group` sets the group and the owner of keys, `only_with` the choice that they need.
module thud_new_field
   use thud_field, only: field_type, list_type, name_length, text_list_type
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: choice_field, in_group, integer_field, list_field, only_with, plain_field, real_field

contains

   !> Describes a real key.
   function real_field(key, variable, unit, meaning, range, is_numerical, derived_at_zero, is_calibrated) result(field)
      character(len=*), intent(in) :: key
      real(wp), intent(in), target :: variable
      !> SI unit, empty for a pure number; help text; allowed range.
      character(len=*), intent(in) :: unit, meaning, range
      !> See `field_type` (default: false).
      logical, intent(in), optional :: is_numerical, derived_at_zero, is_calibrated
      type(field_type) :: field

      field = field_type(kind='real', key=key, unit=unit, meaning=meaning, range=range)
      if (present(is_numerical)) field%is_numerical = is_numerical
      if (present(derived_at_zero)) field%derived_at_zero = derived_at_zero
      if (present(is_calibrated)) field%is_calibrated = is_calibrated
      field%value => variable
   end function real_field

   !> Describes an integer key.
   function integer_field(key, variable, meaning, range) result(field)
      character(len=*), intent(in) :: key
      integer, intent(in), target :: variable
      !> Help text; allowed range.
      character(len=*), intent(in) :: meaning, range
      type(field_type) :: field

      field = field_type(kind='whole', key=key, meaning=meaning, range=range)
      field%value => variable
   end function integer_field

   !> Describes a key with a list of numbers that share one range.
   function list_field(key, variable, unit, meaning, range, whole) result(field)
      character(len=*), intent(in) :: key
      type(list_type), intent(in), target :: variable
      !> SI unit, empty for pure numbers; help text; allowed range of each entry.
      character(len=*), intent(in) :: unit, meaning, range
      !> Entries must be whole numbers (default: false).
      logical, intent(in), optional :: whole
      type(field_type) :: field

      field = field_type(kind='list', key=key, unit=unit, meaning=meaning, range=range)
      if (present(whole)) field%whole_entries = whole
      field%value => variable
   end function list_field

   !> Describes a key that takes any value of its kind.
   function plain_field(key, variable, meaning, is_path) result(field)
      character(len=*), intent(in) :: key
      !> Logical, text of `name_length` or `text_list_type`.
      class(*), intent(in), target :: variable
      character(len=*), intent(in) :: meaning
      !> See `field_type` (default: false).
      logical, intent(in), optional :: is_path
      type(field_type) :: field

      field = field_type(kind='text', key=key, meaning=meaning)
      if (present(is_path)) field%is_path = is_path
      field%value => variable
      select type (variable)
      type is (logical)
         field%kind = 'flag'
      type is (text_list_type)
         field%kind = 'texts'
      end select
   end function plain_field

   !> Describes a key that takes one of several words.
   function choice_field(key, variable, meaning, choices) result(field)
      character(len=*), intent(in) :: key
      character(len=name_length), intent(in), target :: variable
      character(len=*), intent(in) :: meaning
      !> The allowed words: [n_choice].
      character(len=*), intent(in) :: choices(:)
      type(field_type) :: field

      field = plain_field(key, variable, meaning)
      field%kind = 'choice'
      field%n_choice = size(choices)
      field%choices(:size(choices)) = choices
   end function choice_field

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

   !> Keys that have an effect only with some values of a choice.
   function only_with(choice, values, fields) result(needing)
      !> Key of the choice.
      character(len=*), intent(in) :: choice
      !> Its values, the calibrated one first: [n_value].
      character(len=*), intent(in) :: values(:)
      !> The keys: [n_field].
      type(field_type), intent(in) :: fields(:)
      type(field_type) :: needing(size(fields))
      integer :: i

      needing = fields
      needing%needs(1) = choice
      do i = 1, size(values)
         needing%needs(i + 1) = values(i)
      end do
   end function only_with

end module thud_new_field
