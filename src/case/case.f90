!> A case: everything that one run needs, as the namelist file gives it.
module thud_case
   use thud_ball, only: ball_type, get_ball_fields
   use thud_band, only: band_choices
   use thud_drop, only: drop_type, get_drop_fields
   use thud_error, only: error_type, input_error
   use thud_field, only: check_fields, field_type, name_length
   use thud_force_exposure, only: level_methods
   use thud_free_modes, only: check_modes, get_modes_fields, modes_options_type
   use thud_namelist_text, only: group_type, parse_groups
   use thud_new_field, only: choice_field, text_field
   use thud_sampling, only: check_sampling, get_sampling_fields, sampling_type
   use thud_source_limits, only: source_names
   use thud_source_model, only: check_model, get_model_fields, get_owner, model_names, model_options_type
   use thud_text, only: join_quoted, newline, quoted, to_text
   implicit none (type, external)
   private

   public :: case_type, describe_keys, get_case_text, get_fields, read_case

   !> Groups that a file must hold for an impact, and for free modes.
   character(len=24), parameter :: impact_groups(3) = [character(len=24) :: 'ball', 'drop', 'model']
   character(len=24), parameter :: modes_groups(2) = [character(len=24) :: 'ball', 'modes']
   !> Groups that free modes use; the rest is for an impact.
   character(len=24), parameter :: groups_of_modes(4) = [character(len=24) :: 'case', 'ball', 'modes', 'mesh']

   !> Input of one run.
   type :: case_type
      !> Name of the case, also of its output directory.
      character(len=name_length) :: name = ''
      !> An impact is asked for, by the group `&model`.
      logical :: has_impact = .true.
      !> Free modes are asked for, by the group `&modes`.
      logical :: has_modes = .false.
      !> Number of free modes.
      type(modes_options_type) :: modes
      !> The ball.
      type(ball_type) :: ball
      !> The drop.
      type(drop_type) :: drop
      !> Source model, one of `model_names`.
      character(len=name_length) :: model = 'hollow_sphere'
      !> Options of every model; those of the chosen one count.
      type(model_options_type) :: options
      !> Sampling of the record.
      type(sampling_type) :: sampling
      !> Method of the levels.
      character(len=name_length) :: level_method = 'exact'
      !> Bands of the levels: octave, third or both.
      character(len=name_length) :: bands = 'octave'
      !> Force that the verdict is on: elastic or floor.
      character(len=name_length) :: level_force = 'elastic'
      !> Source whose limits apply.
      character(len=name_length) :: source = 'rubber_ball'
   end type case_type

contains

   !> Every key of the input, in the order of the written file.
   function get_fields(case) result(fields)
      !> The case that the fields read and set.
      type(case_type), intent(in), target :: case
      !> The keys: [n_field].
      type(field_type), allocatable :: fields(:)

      fields = [ &
         text_field('case', 'name', case%name, 'name of the case, also of its output directory'), &
         get_ball_fields(case%ball), &
         get_modes_fields(case%modes), &
         get_drop_fields(case%drop), &
         choice_field('model', 'name', case%model, 'source model', model_names), &
         get_model_fields(case%options), &
         get_sampling_fields(case%sampling), &
         choice_field('levels', 'method', case%level_method, 'method of the levels', level_methods), &
         choice_field('levels', 'bands', case%bands, 'bands of levels.csv', band_choices), &
         choice_field('levels', 'force', case%level_force, 'force that the verdict is on', &
         [character(len=8) :: 'elastic', 'floor']), &
         choice_field('limits', 'source', case%source, 'source whose limits apply', source_names)]
   end function get_fields

   !> What a group does in a case: it is used by the impact or by the free modes.
   pure elemental function is_used(case, group) result(used)
      !> The case.
      type(case_type), intent(in) :: case
      !> Name of the group.
      character(len=*), intent(in) :: group
      !> Whether it does anything.
      logical :: used

      used = case%has_modes .and. any(groups_of_modes == group)
      if (.not. case%has_impact .or. group == 'modes') return
      used = used .or. get_owner(group) == '' .or. get_owner(group) == case%model
   end function is_used

   !> The keys that do something, without lists that have no entries.
   function get_active_fields(case) result(fields)
      !> The case that the fields read and set.
      type(case_type), intent(in), target :: case
      !> The keys: [n_field].
      type(field_type), allocatable :: fields(:)
      logical, allocatable :: active(:)
      integer :: i

      allocate (fields, source=get_fields(case))
      active = [(is_used(case, fields(i)%group) .and. .not. fields(i)%is_empty(), i=1, size(fields))]
      fields = pack(fields, active)
   end function get_active_fields

   !> Case from the text of a namelist file, complete and inside all ranges.
   subroutine read_case(text, default_name, case, error)
      !> Text of the file.
      character(len=*), intent(in) :: text
      !> Name of the case where the text gives none.
      character(len=*), intent(in) :: default_name
      !> The case.
      type(case_type), target, intent(out) :: case
      !> What is wrong, with group, key, value and allowed range.
      type(error_type), allocatable, intent(out) :: error
      type(group_type), allocatable :: groups(:)
      type(field_type), allocatable :: fields(:)
      integer :: i

      if (len(default_name) <= name_length) case%name = default_name
      call parse_groups(text, groups, error)
      if (allocated(error)) return
      allocate (fields, source=get_fields(case))
      case%has_modes = any([(groups(i)%name == 'modes', i=1, size(groups))])
      case%has_impact = any([(groups(i)%name == 'model', i=1, size(groups))]) .or. .not. case%has_modes
      if (case%has_impact) then
         call check_groups(groups, fields, impact_groups, error)
      else
         call check_groups(groups, fields, modes_groups, error)
      end if
      if (allocated(error)) return
      do i = 1, size(groups)
         call assign_group(groups(i), fields, error)
         if (allocated(error)) return
      end do
      ! Anew, because some ranges depend on other values.
      call check_fields(get_active_fields(case), error)
      if (allocated(error)) return
      call check_sampling(case%sampling, error)
      if (allocated(error)) return
      call check_options(groups, case, error)
      if (allocated(error)) return
      call check_name(case%name, error)
   end subroutine read_case

   !> Complains about groups that do nothing, and about options that do not fit.
   subroutine check_options(groups, case, error)
      !> Groups of the file: [n_group].
      type(group_type), intent(in) :: groups(:)
      !> The case.
      type(case_type), intent(in) :: case
      !> What is wrong.
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      do i = 1, size(groups)
         if (is_used(case, groups(i)%name)) cycle
         error = input_error('&'//groups(i)%name//' in line '//to_text(groups(i)%line)//' does nothing ')
         if (case%has_impact) then
            error%message = error%message//'with &model: name = '//quoted(case%model)//'; allowed: &'//trim(case%model)
         else
            error%message = error%message//'with &modes alone; allowed: '//join_quoted(groups_of_modes)
         end if
         return
      end do
      if (case%has_modes) call check_modes(case%modes, case%options%finite_element%mesh, error)
      if (allocated(error) .or. .not. case%has_impact) return
      call check_model(case%model, case%options, case%ball, case%sampling, error)
   end subroutine check_options

   !> Complains about groups that are missing, unknown or given twice.
   subroutine check_groups(groups, fields, required_groups, error)
      !> Groups of the file: [n_group].
      type(group_type), intent(in) :: groups(:)
      !> Known keys: [n_field].
      type(field_type), intent(in) :: fields(:)
      !> Groups that have to be there: [n].
      character(len=*), intent(in) :: required_groups(:)
      !> What is wrong.
      type(error_type), allocatable, intent(out) :: error
      integer :: i, j

      do i = 1, size(groups)
         if (.not. any(fields%group == groups(i)%name)) then
            error = input_error('&'//groups(i)%name//' in line '//to_text(groups(i)%line) &
               //' is not a known group; allowed: '//join_quoted(distinct(fields%group)))
            return
         end if
         do j = 1, i - 1
            if (groups(j)%name /= groups(i)%name) cycle
            error = input_error('&'//groups(i)%name//' is given twice, in line '//to_text(groups(j)%line) &
               //' and in line '//to_text(groups(i)%line)//'; allowed: once')
            return
         end do
      end do
      do i = 1, size(required_groups)
         if (any([(groups(j)%name == required_groups(i), j=1, size(groups))])) cycle
         error = input_error('&'//trim(required_groups(i))//' is missing; allowed: files with the groups ' &
            //join_quoted(required_groups))
         return
      end do
   end subroutine check_groups

   !> Sets the variables of one group.
   subroutine assign_group(group, fields, error)
      !> The group.
      type(group_type), intent(in) :: group
      !> Known keys: [n_field].
      type(field_type), intent(in) :: fields(:)
      !> A key is unknown or given twice, or its value has the wrong type.
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: allowed
      integer :: i, j, place

      do i = 1, size(group%assignments)
         associate (given => group%assignments(i))
            place = findloc(fields%group == group%name .and. fields%key == given%key, .true., dim=1)
            if (place == 0) then
               error = input_error('&'//group%name//': '//given%key//' in line '//to_text(given%line) &
                  //' is not a known key; allowed: '//join_quoted(pack(fields%key, fields%group == group%name)))
            else if (any([(group%assignments(j)%key == given%key, j=1, i - 1)])) then
               error = input_error('&'//group%name//': '//given%key//' is given a second time in line ' &
                  //to_text(given%line)//'; allowed: once')
            else if (given%value == '') then
               call fields(place)%get_allowed(allowed)
               error = input_error('&'//group%name//': '//given%key//' in line '//to_text(given%line) &
                  //' has no value; allowed: '//allowed)
            else
               call fields(place)%set_from_text(given%value, error)
            end if
         end associate
         if (allocated(error)) return
      end do
   end subroutine assign_group

   !> Complains about a name that cannot name a directory.
   subroutine check_name(name, error)
      !> Name of the case.
      character(len=*), intent(in) :: name
      !> What is wrong.
      type(error_type), allocatable, intent(out) :: error
      logical :: usable
      integer :: i

      usable = name(1:1) /= ' ' .and. name /= '.' .and. name /= '..' .and. scan(name, '/') == 0 &
         .and. all([(iachar(name(i:i)) >= 32, i=1, len(name))])
      if (name == '') then
         error = input_error('&case: name is empty; allowed: a name of 1 to '//to_text(name_length) &
            //' characters, without it the name of the file')
      else if (.not. usable) then
         error = input_error('&case: name = '//quoted(name)//' is not allowed; allowed: a name for a directory, ' &
            //"without '/', of up to "//to_text(name_length)//' characters')
      end if
   end subroutine check_name

   !> Each text once, in order.
   pure function distinct(texts) result(once)
      !> The texts: [n].
      character(len=*), intent(in) :: texts(:)
      !> The texts without repetition.
      character(len=len(texts)), allocatable :: once(:)
      logical :: first(size(texts))
      integer :: i

      do i = 1, size(texts)
         first(i) = .not. any(texts(:i - 1) == texts(i))
      end do
      once = pack(texts, first)
   end function distinct

   !> The complete input as a namelist file; reading it gives the same case.
   function get_case_text(case) result(text)
      !> The case.
      type(case_type), intent(in), target :: case
      !> Text of the file.
      character(len=:), allocatable :: text
      character(len=:), allocatable :: value
      type(field_type), allocatable :: fields(:)
      integer :: i

      allocate (fields, source=get_active_fields(case))
      text = '! thud: the full input of case '//trim(case%name)//', SI units'//newline
      do i = 1, size(fields)
         if (.not. any(fields(:i - 1)%group == fields(i)%group)) text = text//newline//'&'//trim(fields(i)%group)//newline
         call fields(i)%get_text(value)
         text = text//'   '//fields(i)%key//' = '//value
         if (fields(i)%unit /= '') text = text//' ! '//trim(fields(i)%unit)
         text = text//newline
         if (.not. any(fields(i + 1:)%group == fields(i)%group)) text = text//'/'//newline
      end do
   end function get_case_text

   !> Every key with its default, allowed range and meaning, as a commented namelist file. Groups
   !> that the default model does not use stand behind `!`.
   function describe_keys() result(text)
      !> The description; a valid input file.
      character(len=:), allocatable :: text
      character(len=:), allocatable :: allowed, mark, value
      type(case_type), target :: case
      type(field_type), allocatable :: fields(:)
      integer :: i

      case%name = 'my_case'
      allocate (fields, source=get_fields(case))
      text = '! Every key of an input file with its default value. SI units.'//newline
      do i = 1, size(fields)
         mark = ''
         if (.not. is_used(case, fields(i)%group)) mark = '! '
         call fields(i)%get_allowed(allowed)
         call fields(i)%get_text(value)
         if (.not. any(fields(:i - 1)%group == fields(i)%group)) then
            text = text//newline//mark//'&'//trim(fields(i)%group)//newline
         end if
         text = text//mark//'   ! '//trim(fields(i)%meaning)//'; allowed: '//allowed//newline &
            //mark//'   '//trim(fields(i)%key)//' = '//value//newline
         if (.not. any(fields(i + 1:)%group == fields(i)%group)) text = text//mark//'/'//newline
      end do
   end function describe_keys

end module thud_case
