!> A case, the input of one run: its keys, the keys that it uses, and their checks.
module thud_case
   use thud_ball, only: ball_type, drop_type, get_ball_fields, get_drop_fields
   use thud_band, only: band_choices
   use thud_compression, only: check_compression, compression_options_type, get_compression_fields
   use thud_error, only: error_type, input_error
   use thud_field, only: check_fields, field_type, in_group, key_length, name_length, new_field
   use thud_force_exposure, only: level_methods
   use thud_free_modes, only: check_modes, get_modes_fields, modes_options_type
   use thud_kinds, only: wp
   use thud_rectangular_floor, only: rectangular_floor_type
   use thud_registry, only: first_radiating, floor_names, floor_slot_type, model_names, model_slot_type, new_floors, &
      new_models, standard_moduli
   use thud_room, only: check_below_subceiling, check_room, get_room_fields, room_type
   use thud_sampling, only: check_sampling, get_sampling_fields, sampling_type
   use thud_source_limits, only: source_names
   use thud_text, only: is_utf8, join_quoted, lower_case, quoted, to_text
   use thud_unknowns, only: check_unknowns, get_unknowns_fields, unknowns_type
   implicit none (type, external)
   private

   public :: case_type, check_case, check_name, get_active_fields, get_fields, get_floor_number, get_model_number
   public :: get_full_key, get_modes_ball, get_unstated_fields, is_stated, is_used, keep_impact_only
   public :: new_case, set_floor_air, set_standard_modulus

   !> Model whose modulus the free modes have.
   character(len=*), parameter :: modes_model = 'finite_element'

   !> Input of one run.
   type :: case_type
      !> Main groups missing from the text of the case, so that their defaults apply: ` &drop &model`.
      character(len=32) :: left_out = ''
      !> Calibrated keys that the text of the case does not state, as `group.key`: [n].
      character(len=2*key_length + 1), allocatable :: unstated(:)
      !> Name of the case and of its output directory.
      character(len=name_length) :: name = ''
      !> The case asks for an impact: it has the group `&model`, or no `&modes`.
      logical :: has_impact = .true.
      !> The case asks for free modes: it has the group `&modes`.
      logical :: has_modes = .false.
      !> The case asks for the drop on a mobile floor: it has the group `&floor`.
      logical :: has_floor = .false.
      !> The case asks for the level in the room below: it has the group `&room`.
      logical :: has_room = .false.
      !> Number of free modes.
      type(modes_options_type) :: modes
      !> The case asks for a quasi-static compression: it has the group `&compression`.
      logical :: has_compression = .false.
      !> Options of the compression.
      type(compression_options_type) :: compression
      !> The case states what is not known of its source: it has the group `&unknowns`.
      logical :: has_unknowns = .false.
      !> What is not known of the source.
      type(unknowns_type) :: unknowns
      type(ball_type) :: ball
      type(drop_type) :: drop
      !> Source model, one of `model_names`.
      character(len=name_length) :: model = model_names(1)
      !> All models with their options; the case uses the chosen one: [n_model].
      type(model_slot_type), allocatable :: models(:)
      type(sampling_type) :: sampling
      !> Method of the levels.
      character(len=name_length) :: level_method = 'exact'
      !> Bands of the levels: octave, third or both.
      character(len=name_length) :: bands = 'octave'
      !> Assessed force: `floor`, or `elastic`, the ball force of the paper.
      character(len=name_length) :: level_force = 'floor'
      !> Source whose limits apply.
      character(len=name_length) :: source = 'rubber_ball'
      !> Floor, one of `floor_names`.
      character(len=name_length) :: floor = floor_names(1)
      !> All floors with their options; the case uses the chosen one: [n_floor].
      type(floor_slot_type), allocatable :: floors(:)
      !> Room below.
      type(room_type) :: room
   end type case_type

contains

   !> The default case.
   subroutine new_case(case)
      type(case_type), intent(out) :: case

      call new_models(case%models)
      call new_floors(case%floors)
      allocate (case%unstated(0))
      call set_standard_modulus(case)
   end subroutine new_case

   !> Modulus of the standard ball by a model, Pa; that of the case for models that do not use the wall.
   function get_modulus(case, model) result(modulus)
      type(case_type), intent(in) :: case
      !> One of `model_names`.
      character(len=*), intent(in) :: model
      real(wp) :: modulus

      modulus = sum(standard_moduli, mask=model_names == model)
      if (.not. modulus > 0.0_wp) modulus = case%ball%youngs_modulus
   end function get_modulus

   !> Gives the ball the modulus of the standard ball by the source model, or for free modes alone by finite elements.
   subroutine set_standard_modulus(case)
      type(case_type), intent(inout) :: case
      character(len=name_length) :: model

      model = case%model
      if (.not. case%has_impact) model = modes_model
      case%ball%youngs_modulus = get_modulus(case, model)
   end subroutine set_standard_modulus

   !> The ball of the free modes: a modulus that is not stated is that of finite elements, whatever the source model.
   function get_modes_ball(case) result(ball)
      type(case_type), intent(in) :: case
      type(ball_type) :: ball

      ball = case%ball
      if (any(case%unstated == 'ball.youngs_modulus')) ball%youngs_modulus = get_modulus(case, modes_model)
   end function get_modes_ball

   !> Group and key, as in `unstated`.
   pure elemental function get_full_key(field) result(name)
      type(field_type), intent(in) :: field
      character(len=2*key_length + 1) :: name

      name = trim(field%group)//'.'//field%key
   end function get_full_key

   !> Whether the text of a case states a key, or the key is not calibrated.
   pure elemental function is_stated(case, field) result(stated)
      type(case_type), intent(in) :: case
      type(field_type), intent(in) :: field
      logical :: stated

      stated = .not. any(case%unstated == get_full_key(field))
   end function is_stated

   !> Surrounds the floors with the air of the room, after keys of the case have been set.
   pure subroutine set_floor_air(case)
      type(case_type), intent(inout) :: case
      integer :: i

      do i = 1, size(case%floors)
         case%floors(i)%model%air = case%room%air
      end do
   end subroutine set_floor_air

   !> Leaves out free modes, compression and unknowns, which an impact does not use.
   pure subroutine keep_impact_only(case)
      type(case_type), intent(inout) :: case

      case%has_modes = .false.
      case%has_compression = .false.
      case%has_unknowns = .false.
   end subroutine keep_impact_only

   !> Index of the chosen model.
   pure function get_model_number(case) result(number)
      type(case_type), intent(in) :: case
      !> Index in `model_names`; 0 if there is no such model.
      integer :: number

      number = findloc(model_names == case%model, .true., dim=1)
   end function get_model_number

   !> Index of the chosen floor.
   pure function get_floor_number(case) result(number)
      type(case_type), intent(in) :: case
      !> Index in `floor_names`; 0 if there is no such floor.
      integer :: number

      number = findloc(floor_names == case%floor, .true., dim=1)
   end function get_floor_number

   !> All keys of the input, in the order of the written file.
   function get_fields(case) result(fields)
      !> The case that the fields read and set.
      type(case_type), intent(in), target :: case
      !> The keys: [n_field].
      type(field_type), allocatable :: fields(:)
      integer :: i

      fields = [ &
         in_group('case', [new_field('name', case%name, '', 'name of the case and of its output directory')]), &
         in_group('ball', get_ball_fields(case%ball)), &
         in_group('modes', get_modes_fields(case%modes), owner='modes'), &
         in_group('compression', get_compression_fields(case%compression), owner='compression'), &
         in_group('drop', get_drop_fields(case%drop)), &
         in_group('model', [ &
         new_field('name', case%model, '', 'source model', choices=model_names)])]
      do i = 1, size(case%models)
         fields = [fields, in_group(model_names(i), case%models(i)%model%get_fields(), owner=model_names(i))]
      end do
      fields = [fields, &
         in_group('sampling', get_sampling_fields(case%sampling)), &
         in_group('levels', [ &
         new_field('method', case%level_method, '', 'method of computing the levels', choices=level_methods), &
         new_field('bands', case%bands, '', 'bands of levels.csv', choices=band_choices), &
         new_field('force', case%level_force, '', 'assessed force, for which levels, peak force and verdict are reported', &
         choices=[character(len=8) :: 'floor', 'elastic'])]), &
         in_group('limits', [new_field('source', case%source, '', 'source whose limits apply', choices=source_names)]), &
         in_group('unknowns', get_unknowns_fields(case%unknowns), owner='unknowns'), &
         in_group('floor', [new_field('name', case%floor, '', 'floor under the source', choices=floor_names)], 'floor')]
      do i = 1, size(case%floors)
         fields = [fields, in_group(floor_names(i), case%floors(i)%model%get_fields(), owner=floor_names(i))]
      end do
      fields = [fields, in_group('room', get_room_fields(case%room), owner='room')]
   end function get_fields

   !> Whether a case uses a key, for the impact, its model, the free modes, the compression, the unknowns, the floor or the
   !> room.
   pure elemental function is_used(case, field) result(used)
      type(case_type), intent(in) :: case
      type(field_type), intent(in) :: field
      logical :: used

      select case (field%owner)
      case ('')
         used = case%has_impact .or. field%group == 'case' .or. field%group == 'ball'
      case ('modes')
         used = case%has_modes
      case ('compression')
         used = case%has_impact .and. case%has_compression
      case ('unknowns')
         used = case%has_impact .and. case%has_unknowns
      case ('room')
         used = case%has_impact .and. case%has_room
      case default
         used = case%has_impact .and. (field%owner == case%model .or. case%has_floor &
            .and. any(field%owner == [character(len=name_length) :: 'floor', case%floor]))
      end select
   end function is_used

   !> The keys that a case uses, without empty lists: [n_field].
   function get_active_fields(case) result(fields)
      !> The case that the fields read and set.
      type(case_type), intent(in), target :: case
      type(field_type), allocatable :: fields(:)
      integer :: i

      allocate (fields, source=get_fields(case))
      fields = pack(fields, [(is_used(case, fields(i)) .and. size(fields(i)%get_entries()) > 0, i=1, size(fields))])
   end function get_active_fields

   !> The keys with an effect that have the value of the standard ball because the case does not state them: [n_field].
   function get_unstated_fields(case) result(fields)
      !> The case that the fields read and set.
      type(case_type), intent(in), target :: case
      type(field_type), allocatable :: fields(:)
      integer :: i

      allocate (fields, source=get_active_fields(case))
      fields = pack(fields, .not. is_stated(case, fields) .and. [(fields(i)%has_effect(fields), i=1, size(fields))])
   end function get_unstated_fields

   !> The keys of ball, drop and source model that are real numbers: [n_field].
   function get_source_fields(case) result(fields)
      !> The case that the fields read.
      type(case_type), intent(in), target :: case
      type(field_type), allocatable :: fields(:)
      integer :: i

      allocate (fields, source=get_active_fields(case))
      fields = pack(fields, [(fields(i)%kind == 'real' &
         .and. (fields(i)%owner == case%model .or. any(fields(i)%group == ['ball', 'drop'])), i=1, size(fields))])
   end function get_source_fields

   !> Returns an error if values of a case are out of range or contradict each other.
   subroutine check_case(case, error)
      type(case_type), intent(in), target :: case
      type(error_type), allocatable, intent(out) :: error

      call check_fields(get_active_fields(case), error)
      if (.not. allocated(error)) call check_sampling(case%sampling, error)
      if (.not. allocated(error)) call check_name(case%name, error)
      if (allocated(error)) return
      if (case%has_modes) call check_modes(case%ball, error)
      if (allocated(error) .or. .not. case%has_impact) return
      if (case%has_compression) call check_compression(case%compression, case%ball, error)
      if (case%has_unknowns .and. .not. allocated(error)) call check_unknowns(case%unknowns, get_source_fields(case), error)
      if (case%has_floor .and. .not. allocated(error)) call check_floor(case, error)
      if (case%has_room .and. .not. allocated(error)) call check_room(case%room, error)
      if (allocated(error)) return
      associate (model => case%models(get_model_number(case))%model)
         call model%check(case%ball, case%sampling, error)
      end associate
   end subroutine check_case

   !> Returns an error if options of the floor contradict each other, or it cannot radiate into the room below.
   subroutine check_floor(case, error)
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      associate (floor => case%floors(get_floor_number(case))%model)
         call floor%check(case%has_room, error)
         if (allocated(error) .or. .not. case%has_room) return
         if (get_floor_number(case) < first_radiating) error = input_error('= '//quoted(trim(case%floor))//' has no plate ' &
            //'that radiates into a room; allowed: no &room, or '//join_quoted(floor_names(first_radiating:)), 'floor', &
            'name')
         select type (floor)
         class is (rectangular_floor_type)
            if (floor%subceiling%thickness > 0.0_wp) call check_below_subceiling(case%room, error)
         end select
      end associate
   end subroutine check_floor

   !> Returns an error if a name cannot be that of a directory.
   subroutine check_name(name, error)
      character(len=*), intent(in) :: name
      type(error_type), allocatable, intent(out) :: error
      !> Devices of Windows, which has no files of these names, whatever their extension.
      character(len=*), parameter :: devices = '/con/prn/aux/nul/com1/com2/com3/com4/com5/com6/com7/com8/com9' &
         //'/lpt1/lpt2/lpt3/lpt4/lpt5/lpt6/lpt7/lpt8/lpt9/'
      logical :: usable
      integer :: i

      usable = name(1:1) /= ' ' .and. scan(name, '/\:*?"<>|') == 0 &
         .and. scan(trim(name), '.', back=.true.) < len_trim(name) &
         .and. all([(iachar(name(i:i)) >= 32, i=1, len(name))]) .and. is_utf8(name) &
         .and. index(devices, '/'//trim(lower_case(name(:index(name//'.', '.') - 1)))//'/') == 0
      if (name == '') then
         error = input_error('is empty; allowed: a name of 1 to '//to_text(name_length)//' characters, without it the ' &
            //'name of the file', 'case', 'name')
      else if (.not. usable) then
         error = input_error('= '//quoted(name)//' is not allowed; allowed: a name for a directory on any system, UTF-8 ' &
            //'of up to '//to_text(name_length)//' characters without / \ : * ? " < > |, without a period at its end, and ' &
            //'not that of a device of Windows, such as con', 'case', 'name')
      end if
   end subroutine check_name

end module thud_case
