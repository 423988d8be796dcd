!> What is not known of a source: keys of the case, and the distributions of their values.
module thud_unknowns
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type, get_interval, key_length, list_type, new_field, text_list_type
   use thud_interval, only: interval_type
   use thud_kinds, only: wp
   use thud_text, only: get_suggestion, join_quoted, quoted, to_text
   implicit none (type, external)
   private

   public :: check_unknowns, get_unknowns_fields, unknowns_type

   !> Keys with their ranges; all lists have one entry for each unknown.
   type :: unknowns_type
      !> Names of the keys.
      type(text_list_type) :: key
      !> Minima and maxima in the units of the keys.
      type(list_type) :: low, high
      !> Standard deviations of normal distributions around the values of the case; 0: uniform. No entries: all uniform.
      type(list_type) :: standard_deviation
      !> Reasons of the ranges, with their sources.
      type(text_list_type) :: reason
   end type unknowns_type

contains

   !> Keys and allowed ranges of the group `&unknowns`.
   function get_unknowns_fields(unknowns) result(fields)
      !> The unknowns that the fields read and set.
      type(unknowns_type), intent(in), target :: unknowns
      !> One field per component: [5].
      type(field_type), allocatable :: fields(:)

      fields = [ &
         new_field('key', unknowns%key, '', 'keys of ball, drop and model whose values are not known'), &
         new_field('low', unknowns%low, '', 'their minima, in the units of the keys', '[-1e30, 1e30]'), &
         new_field('high', unknowns%high, '', 'their maxima', '[-1e30, 1e30]'), &
         new_field('standard_deviation', unknowns%standard_deviation, '', &
         'standard deviations around the values of the case, truncated by low and high; 0: uniform', '[0, 1e30]'), &
         new_field('reason', unknowns%reason, '', 'reasons of the ranges, with their sources')]
   end function get_unknowns_fields

   !> Returns an error if lists differ in length, a key is not known, or a range is empty or not allowed.
   subroutine check_unknowns(unknowns, fields, error)
      type(unknowns_type), intent(in) :: unknowns
      !> Keys that may be unknown: [n_field].
      type(field_type), intent(in) :: fields(:)
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      call check_counts(unknowns, error)
      do i = 1, unknowns%key%count
         if (allocated(error)) return
         call check_unknown(unknowns, i, fields, error)
      end do
   end subroutine check_unknowns

   !> Returns an error if lists differ in length.
   subroutine check_counts(unknowns, error)
      type(unknowns_type), intent(in) :: unknowns
      type(error_type), allocatable, intent(out) :: error
      character(len=*), parameter :: names(*) = [character(len=18) :: 'low', 'high', 'reason', 'standard_deviation']
      integer :: counts(size(names))
      integer :: i

      if (unknowns%key%count == 0) then
         error = input_error('is missing; allowed: names of keys of ball, drop and model, such as '//"'youngs_modulus'", &
            'unknowns', 'key')
         return
      end if
      counts = [unknowns%low%count, unknowns%high%count, unknowns%reason%count, unknowns%standard_deviation%count]
      do i = 1, size(names)
         if (counts(i) == unknowns%key%count .or. names(i) == 'standard_deviation' .and. counts(i) == 0) cycle
         error = input_error('has '//to_text(counts(i))//' entries; allowed: '//to_text(unknowns%key%count)//', one for ' &
            //'each key', 'unknowns', trim(names(i)))
         return
      end do
   end subroutine check_counts

   !> Returns an error if an unknown is not a key of the case, is stated twice, or its range is empty or not allowed.
   subroutine check_unknown(unknowns, i, fields, error)
      type(unknowns_type), intent(in) :: unknowns
      !> Index of the unknown.
      integer, intent(in) :: i
      !> Keys that may be unknown: [n_field].
      type(field_type), intent(in) :: fields(:)
      type(error_type), allocatable, intent(out) :: error
      type(interval_type) :: interval
      character(len=key_length), allocatable :: known(:)
      character(len=:), allocatable :: allowed, range, suggestion
      real(wp) :: value
      integer :: field

      associate (key => unknowns%key%values(i), low => unknowns%low%values(i), high => unknowns%high%values(i))
         field = findloc(fields%key == key, .true., dim=1)
         known = pack(fields%key, fields%trait /= 'numerical')
         if (.not. any(known == key)) then
            call get_suggestion(trim(key), known, suggestion)
            suggestion = ' is not allowed'//suggestion
            if (field > 0) suggestion = ' belongs to the computation, and its effect is the numerical error'
            error = input_error('= '//quoted(key)//suggestion//'; allowed: '//join_quoted(known), 'unknowns', 'key')
         else if (any(unknowns%key%values(:i - 1) == key)) then
            error = input_error('= '//quoted(key)//' is given twice; allowed: once', 'unknowns', 'key')
         end if
         if (allocated(error)) return
         range = 'low = '//to_text(low)//' and high = '//to_text(high)
         value = fields(field)%get_number()
         interval = get_interval(fields, field)
         call fields(field)%get_allowed(allowed, interval)
         if (.not. (interval%contains(low) .and. interval%contains(high) .and. low < high)) then
            error = input_error(range//' of '//trim(key)//' are not allowed; allowed: low < high, '//allowed, 'unknowns')
         else if (fields(field)%trait == 'derived' .and. .not. low > 0.0_wp) then
            error = input_error('= '//to_text(low)//' of '//trim(key)//' is not allowed: at 0 it is derived from other ' &
               //'keys; allowed: above 0', 'unknowns', 'low')
         else if (value < low .or. value > high) then
            error = input_error('the value of the case, '//trim(key)//' = '//to_text(value)//', is outside '//range &
               //'; allowed: a range that holds it', 'unknowns')
         end if
      end associate
   end subroutine check_unknown

end module thud_unknowns
