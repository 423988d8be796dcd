!> Cases as namelist files: reading, writing, and the description of all keys.
module thud_case_text
   use thud_case, only: case_type, check_case, check_name, get_active_fields, get_fields, get_full_key, is_stated, &
      is_used, new_case, set_floor_air, set_standard_modulus
   use thud_error, only: error_type, input_error
   use thud_field, only: check_fields, field_type, name_length
   use thud_namelist_text, only: assignment_type, parse_namelist
   use thud_registry, only: floor_names
   use thud_system, only: get_size
   use thud_text, only: get_suggestion, join_quoted, newline, quoted, shortened, to_text
   implicit none (type, external)
   private

   public :: describe_keys, get_case_text, read_case

   !> Groups whose absence a run reports, because defaults apply then; for free modes alone only the first.
   character(len=*), parameter :: main_groups(*) = ['ball ', 'drop ', 'model']

   !> Length of a list of keys beyond which a message does not contain it.
   integer, parameter :: longest_list = 300

contains

   !> Reads a case from the text of a namelist file and checks it.
   subroutine read_case(text, default_name, case, error, unchecked, directory, room_alone)
      character(len=*), intent(in) :: text
      !> Name of the case if the text has none.
      character(len=*), intent(in) :: default_name
      type(case_type), target, intent(out) :: case
      !> Set if the text is not a valid case.
      type(error_type), allocatable, intent(out) :: error
      !> Skip the check of ranges and of the case as a whole (default: false).
      logical, intent(in), optional :: unchecked
      !> Directory of the case, with a slash at its end, in which files are searched first (default: the current one).
      character(len=*), intent(in), optional :: directory
      !> Allow a room without a floor (default: false).
      logical, intent(in), optional :: room_alone
      logical :: needs_floor
      type(assignment_type), allocatable :: assignments(:)
      type(field_type), allocatable :: fields(:)
      logical, allocatable :: stated(:)
      integer :: i

      call new_case(case)
      if (len(default_name) <= name_length) case%name = default_name
      call parse_namelist(text, assignments, error)
      if (size(assignments) == 0 .and. .not. allocated(error)) error = input_error('there is no namelist group; allowed: ' &
         //'files with groups such as '//join_quoted(main_groups))
      if (allocated(error)) return
      allocate (fields, source=get_fields(case))
      allocate (stated(size(fields)), source=.false.)
      case%has_modes = any(assignments%group == 'modes')
      case%has_floor = any(assignments%group == 'floor')
      case%has_room = any(assignments%group == 'room')
      case%has_compression = any(assignments%group == 'compression')
      case%has_unknowns = any(assignments%group == 'unknowns')
      case%has_impact = any(assignments%group == 'model') .or. .not. case%has_modes
      do i = 1, merge(size(main_groups), 1, case%has_impact)
         if (all(assignments%group /= main_groups(i))) case%left_out = trim(case%left_out)//' &'//main_groups(i)
      end do
      do i = 1, size(assignments)
         if (.not. allocated(error)) call assign(assignments, i, fields, stated, error)
      end do
      needs_floor = case%has_room
      if (present(room_alone)) needs_floor = needs_floor .and. .not. room_alone
      if (needs_floor .and. .not. (case%has_floor .or. allocated(error))) error = input_error( &
         '&room is given without &floor; allowed: both, for the level in the room below')
      if (present(directory) .and. .not. allocated(error)) call resolve_paths(fields, directory, error)
      if (allocated(error)) return
      case%unstated = pack(get_full_key(fields), fields%trait == 'calibrated' .and. .not. stated)
      if (any(case%unstated == 'ball.youngs_modulus')) call set_standard_modulus(case)
      call set_floor_air(case)
      ! The use of other keys depends on these, even in an unchecked case.
      call check_fields(pack(fields, fields%group == 'model' .or. fields%group == 'floor' .and. fields%key == 'name'), error)
      if (.not. allocated(error)) call check_name(case%name, error)
      if (.not. allocated(error)) call check_use(assignments, case, pack(fields, is_used(case, fields)), error)
      if (present(unchecked)) then
         if (unchecked) return
      end if
      if (.not. allocated(error)) call check_case(case, error)
   end subroutine read_case

   !> Makes the paths of files beside a case relative to the current directory. Without such a file a path is relative to
   !> the current directory already, as in the effective input beside the results.
   subroutine resolve_paths(fields, directory, error)
      !> All keys: [n_field].
      type(field_type), intent(in) :: fields(:)
      character(len=*), intent(in) :: directory
      !> Set if a path is too long.
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      do i = 1, size(fields)
         if (fields(i)%trait /= 'path') cycle
         select type (path => fields(i)%value)
         type is (character(len=*))
            if (path == '' .or. path(1:1) == '/') cycle
            if (get_size(directory//trim(path)) >= 0) call fields(i)%set_from_text(quoted(directory//trim(path)), error)
         end select
         if (allocated(error)) return
      end do
   end subroutine resolve_paths

   !> Returns an error if the case does not use a group.
   subroutine check_use(assignments, case, fields, error)
      !> Assignments of the file: [n_assignment].
      type(assignment_type), intent(in) :: assignments(:)
      type(case_type), intent(in) :: case
      !> The keys that the case uses: [n_field].
      type(field_type), intent(in) :: fields(:)
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: allowed, where
      integer :: i

      do i = 1, size(assignments)
         if (any(fields%group == assignments(i)%group)) cycle
         where = 'with &modes alone'
         if (case%has_impact) where = 'with &model: name = '//quoted(case%model)
         if (case%has_impact .and. any(floor_names == assignments(i)%group)) then
            where = 'without &floor'
            if (case%has_floor) where = 'with &floor: name = '//quoted(case%floor)
         end if
         call list_distinct(fields%group, allowed)
         error = input_error('&'//trim(assignments(i)%group)//' in line '//to_text(assignments(i)%line)//' does nothing ' &
            //where//'; allowed: '//allowed)
         return
      end do
   end subroutine check_use

   !> Sets the variable of an assignment.
   subroutine assign(assignments, i, fields, stated, error)
      !> Assignments of the file: [n_assignment].
      type(assignment_type), intent(in) :: assignments(:)
      !> Index of the assignment.
      integer, intent(in) :: i
      !> Known keys: [n_field].
      type(field_type), intent(in) :: fields(:)
      !> Set for the key: [n_field].
      logical, intent(inout) :: stated(:)
      !> Set if group or key is unknown or given twice, or the value has the wrong type.
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: allowed, suggestion, label
      integer :: earlier, field

      associate (group => assignments(i)%group, key => assignments(i)%key, &
         keys => pack(fields%key, fields%group == assignments(i)%group))
         earlier = findloc(assignments(:i - 1)%group == group .and. assignments(:i - 1)%key == key, .true., dim=1)
         field = findloc(fields%group == group .and. fields%key == key, .true., dim=1)
         label = '&'//shortened(trim(group))//': '//shortened(trim(key))//' in line '//to_text(assignments(i)%line)
         if (key == '') label = '&'//shortened(trim(group))//' in line '//to_text(assignments(i)%line)
         if (size(keys) == 0) then
            call get_suggestion(trim(group), fields%group, suggestion)
            call list_distinct(fields%group, allowed)
            error = input_error(label//' is not a known group'//suggestion//'; allowed: '//allowed)
         else if (earlier > 0) then
            error = input_error(label//' is given a second time, after line '//to_text(assignments(earlier)%line) &
               //'; allowed: once')
         else if (key == '') then
            continue
         else if (field == 0) then
            call get_suggestion(trim(key), keys, suggestion)
            call list_distinct(keys, allowed)
            if (len(allowed) > longest_list) allowed = 'the keys that thud --keys lists'
            error = input_error(label//' is not a known key'//suggestion//'; allowed: '//allowed)
         else if (assignments(i)%value == '') then
            call fields(field)%get_allowed(allowed)
            error = input_error(label//' has no value; allowed: '//allowed)
         else
            stated(field) = .true.
            call fields(field)%set_from_text(assignments(i)%value, error)
         end if
      end associate
   end subroutine assign

   !> Lists texts in quotes without repetition, in their order.
   pure subroutine list_distinct(texts, list)
      !> The texts: [n].
      character(len=*), intent(in) :: texts(:)
      character(len=:), allocatable, intent(out) :: list
      integer :: i

      list = ''
      do i = 1, size(texts)
         if (.not. any(texts(:i - 1) == texts(i))) list = list//', '//quoted(trim(texts(i)))
      end do
      list = list(3:)
   end subroutine list_distinct

   !> The input as the text of a namelist file; reading it gives the same case. Values of the standard ball for keys
   !> with an effect that the case does not state are comments.
   subroutine get_case_text(case, text)
      type(case_type), intent(in), target :: case
      character(len=:), allocatable, intent(out) :: text
      character(len=:), allocatable :: value
      logical :: stated
      type(field_type), allocatable :: fields(:)
      integer :: i

      allocate (fields, source=get_active_fields(case))
      fields = pack(fields, is_stated(case, fields) .or. [(fields(i)%has_effect(fields), i=1, size(fields))])
      text = '! thud: the full input of case '//trim(case%name)//', SI units'//newline
      do i = 1, size(fields)
         if (.not. any(fields(:i - 1)%group == fields(i)%group)) text = text//newline//'&'//trim(fields(i)%group)//newline
         call fields(i)%get_text(value)
         stated = is_stated(case, fields(i))
         text = text//merge('   ', '!  ', stated)//fields(i)%key//' = '//value
         if (fields(i)%unit /= '') text = text//' ! '//trim(fields(i)%unit)
         if (.not. stated) text = text//' ! not stated: standard ball'
         text = text//newline
         if (.not. any(fields(i + 1:)%group == fields(i)%group)) text = text//'/'//newline
      end do
   end subroutine get_case_text

   !> All keys with default, allowed range and meaning, as a commented namelist file. Groups that the default case does
   !> not use, empty lists, and values of the standard ball, which depend on the model, are commented out.
   subroutine describe_keys(text)
      !> The description; a valid input file.
      character(len=:), allocatable, intent(out) :: text
      character(len=:), allocatable :: allowed, mark, value
      type(case_type), target :: case
      type(field_type), allocatable :: fields(:), active(:)
      integer :: i

      call new_case(case)
      case%name = 'my_case'
      allocate (fields, source=get_fields(case))
      allocate (active, source=get_active_fields(case))
      text = '! Every key of an input file with its default value. SI units.'//newline
      do i = 1, size(fields)
         mark = ''
         if (.not. any(active%group == fields(i)%group)) mark = '! '
         call fields(i)%get_allowed(allowed)
         call fields(i)%get_text(value)
         if (.not. any(fields(:i - 1)%group == fields(i)%group)) then
            text = text//newline//mark//'&'//trim(fields(i)%group)//newline
         end if
         text = text//mark//'   ! '//trim(fields(i)%meaning)//'; allowed: '//allowed//newline
         if (mark == '' .and. (size(fields(i)%get_entries()) == 0 .or. fields(i)%trait == 'calibrated')) text = text//'! '
         text = text//mark//'   '//trim(fields(i)%key)//' = '//value//newline
         if (.not. any(fields(i + 1:)%group == fields(i)%group)) text = text//mark//'/'//newline
      end do
   end subroutine describe_keys

end module thud_case_text
