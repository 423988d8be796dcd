!> Keys, models and results as JSON for other programs. Modules of the Python package and the key reference are generated
!> from it.
module thud_schema
   use thud_band, only: band_set_names, band_type, get_bands
   use thud_case, only: case_type, get_active_fields, get_fields, new_case, set_standard_modulus
   use thud_constants, only: version
   use thud_error, only: error_type
   use thud_field, only: field_type, name_length
   use thud_interval, only: interval_type, new_interval
   use thud_kinds, only: wp
   use thud_quantities, only: history_quantity_count, quantities, sample_quantity_count
   use thud_rating, only: class_limits, get_rated_bands, rating_names, rating_titles
   use thud_registry, only: floor_names, model_names
   use thud_room_uncertainty, only: met_from
   use thud_source_limits, only: criterion_count, criterion_type, get_criteria, source_names, verdict_names
   use thud_text, only: join, newline, to_text
   implicit none (type, external)
   private

   public :: get_schema

contains

   !> Writes the schema.
   subroutine get_schema(text)
      !> One JSON object.
      character(len=:), allocatable, intent(out) :: text
      type(case_type), target :: case
      type(field_type), allocatable :: fields(:)
      type(band_type), allocatable :: bands(:)
      type(criterion_type) :: criteria(criterion_count)
      type(error_type), allocatable :: error
      character(len=:), allocatable :: entry
      integer :: i, j

      call new_case(case)
      allocate (fields, source=get_fields(case))
      text = '{"version": '//text_value(version)//','//newline//'"models": '//list_of(model_names)//','//newline &
         //'"floors": '//list_of(floor_names)//','//newline//'"sources": '//list_of(source_names)//','//newline &
         //'"verdicts": '//list_of(verdict_names)//','//newline//'"band_sets": {'
      do i = 1, size(band_set_names)
         bands = get_bands(band_set_names(i))
         text = text//newline//text_value(band_set_names(i))//': {"nominal": ['//join(bands%nominal)//'], "center": [' &
            //join(bands%center)//'], "lower": ['//join(bands%lower)//'], "upper": ['//join(bands%upper)//']}' &
            //trim(merge(',', ' ', i < size(band_set_names)))
      end do
      text = text//'},'//newline//'"rated_bands": {'
      do i = 1, size(band_set_names)
         bands = get_rated_bands(band_set_names(i))
         text = text//newline//text_value(band_set_names(i))//': ['//join(bands%nominal)//']' &
            //trim(merge(',', ' ', i < size(band_set_names)))
      end do
      text = text//'},'//newline//'"limits": {'
      do i = 1, size(source_names)
         call get_criteria(source_names(i), criteria, error)
         text = text//newline//text_value(source_names(i))//': ['
         do j = 1, criterion_count
            text = text//'{"name": '//text_value(criteria(j)%name)//', "unit": '//text_value(criteria(j)%unit) &
               //', "lower": '//to_text(criteria(j)%lower)//', "upper": '//to_text(criteria(j)%upper)//'}' &
               //trim(merge(',', ' ', j < criterion_count))
         end do
         text = text//']'//trim(merge(',', ' ', i < size(source_names)))
      end do
      text = text//'},'//newline//'"class_limits": ['//join(class_limits)//'],'//newline//'"met_from": ' &
         //to_text(met_from)//','//newline//'"ratings": {'
      do i = 1, size(rating_names)
         text = text//newline//text_value(rating_names(i))//': '//text_value(rating_titles(i)) &
            //trim(merge(',', ' ', i < size(rating_names)))
      end do
      text = text//'},'//newline//'"quantities": ['
      do i = 1, size(quantities)
         associate (quantity => quantities(i))
            text = text//newline//'{"name": '//text_value(quantity%name)//', "title": '//text_value(quantity%title) &
               //', "symbol": '//text_value(quantity%symbol)//', "unit": '//text_value(quantity%unit) &
               //', "display_unit": '//text_value(quantity%display_unit)//', "display_scale": ' &
               //to_text(quantity%display_scale)//', "decimals": '//to_text(quantity%decimals)//', "meaning": ' &
               //text_value(quantity%meaning)//'}'//trim(merge(',', ' ', i < size(quantities)))
         end associate
      end do
      text = text//'],'//newline//'"sample_quantities": '//to_text(sample_quantity_count)//','//newline &
         //'"history_quantities": '//to_text(history_quantity_count)//','//newline//'"keys": ['
      do i = 1, size(fields)
         call describe(fields(i), entry)
         text = text//newline//entry//trim(merge(',', ' ', i < size(fields)))
      end do
      call describe_standard_ball(entry)
      text = text//'],'//newline//'"standard_ball": ['//newline//entry//']}'
   end subroutine get_schema

   !> Describes the calibrated keys: the values of the standard ball by each model, and for free modes alone by ''.
   subroutine describe_standard_ball(text)
      !> JSON objects with a comma between them.
      character(len=:), allocatable, intent(out) :: text
      type(case_type), target :: case
      type(field_type), allocatable :: fields(:)
      character(len=name_length) :: models(size(model_names) + 1)
      integer :: i, j

      text = ''
      models = [character(len=name_length) :: '', model_names]
      do i = 1, size(models)
         call new_case(case)
         case%has_impact = models(i) /= ''
         case%has_modes = models(i) == ''
         if (case%has_impact) case%model = models(i)
         call set_standard_modulus(case)
         fields = get_active_fields(case)
         do j = 1, size(fields)
            if (fields(j)%trait /= 'calibrated') cycle
            if (text /= '') text = text//','//newline
            text = text//'{"model": '//text_value(models(i))//', "key": ' &
               //text_value(fields(j)%key)//', "value": '//json_value(fields(j))//'}'
         end do
      end do
   end subroutine describe_standard_ball

   !> Describes a key.
   subroutine describe(field, text)
      type(field_type), intent(in) :: field
      !> A JSON object.
      character(len=:), allocatable, intent(out) :: text
      type(interval_type) :: interval
      character(len=:), allocatable :: value

      value = json_value(field)
      if (field%trait == 'calibrated') value = 'null'
      text = '{"owner": '//text_value(field%owner)//', "group": '//text_value(field%group)//', "name": ' &
         //text_value(field%key)//', "kind": '//text_value(field%kind)//', "unit": '//text_value(field%unit) &
         //', "default": '//value//', "choices": '//list_of(field%choices(:field%n_choice))//', "meaning": ' &
         //text_value(field%meaning)//', "needs": '//list_of(pack(field%needs, field%needs /= ''))
      if (field%range /= '') then
         interval = new_interval(field%range)
         text = text//', "lower": '//end_value(interval%lower, interval%lower_key)//', "upper": ' &
            //end_value(interval%upper, interval%upper_key)//', "lower_open": ' &
            //trim(merge('true ', 'false', interval%lower_open))//', "upper_open": ' &
            //trim(merge('true ', 'false', interval%upper_open))//', "whole": ' &
            //trim(merge('true ', 'false', field%trait == 'whole'))
      end if
      text = text//'}'
   end subroutine describe

   !> The value of a key.
   function json_value(field) result(value)
      type(field_type), intent(in) :: field
      !> A JSON value.
      character(len=:), allocatable :: value

      call field%get_text(value)
      select case (field%kind)
      case ('flag')
         value = trim(merge('true ', 'false', value == '.true.'))
      case ('list', 'texts')
         ! Lists of texts are empty by default.
         value = '['//value//']'
      case ('choice', 'text')
         value = text_value(value(2:len(value) - 1))
      case default
         continue
      end select
   end function json_value

   !> One end of a range: a number, or a key in quotes.
   function end_value(number, key) result(value)
      real(wp), intent(in) :: number
      !> The key; blank for a number.
      character(len=*), intent(in) :: key
      character(len=:), allocatable :: value

      value = to_text(number)
      if (key /= '') value = text_value(key)
   end function end_value

   !> Text as a JSON string.
   pure function text_value(text) result(value)
      !> The text; trailing blanks are dropped.
      character(len=*), intent(in) :: text
      character(len=:), allocatable :: value
      integer :: i

      value = '"'
      do i = 1, len_trim(text)
         if (scan(text(i:i), '"\') == 1) value = value//'\'
         value = value//text(i:i)
      end do
      value = value//'"'
   end function text_value

   !> Words as a JSON list.
   pure function list_of(words) result(list)
      !> The words: [n_word].
      character(len=*), intent(in) :: words(:)
      character(len=:), allocatable :: list
      integer :: i

      list = '['
      do i = 1, size(words)
         if (i > 1) list = list//', '
         list = list//text_value(words(i))
      end do
      list = list//']'
   end function list_of

end module thud_schema
