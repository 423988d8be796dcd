!> Many drops of a case that differ in the values of some keys: outcomes, levels and verdicts of each.
!>
!> Drops of the shell model are computed in batches (`thud_ensemble`), all others one by one; threads share
!> them. No number of a drop depends on the threads, on the other drops or on its place among them.
module thud_many
   use thud_band, only: band_type, get_band_name, get_level_bands, octave_count
   use thud_case, only: case_type, check_case, get_active_fields, get_model_number
   use thud_compute, only: drop_on_floor, get_judged_force, judge_case, predict_room, verdict_type
   use thud_ensemble, only: are_alike, new_projections, projections_type, solve_ensemble
   use thud_error, only: error_type, input_error
   use thud_field, only: check_fields, field_type, key_length, list_type
   use thud_force_exposure, only: get_force_exposure_levels
   use thud_force_history, only: force_count, force_history_type, get_scalars, outcome_count
   use thud_hollow_sphere, only: flux_choices, hollow_sphere_type
   use thud_interrupt, only: check_interrupt, is_interrupted
   use thud_kinds, only: wp
   use thud_power, only: not_a_number
   use thud_rating, only: get_a_weighted_level, get_standardisation
   use thud_registry, only: floor_names
   use thud_room, only: get_room_bands, room_level_type
   use thud_sampling, only: check_sampling, get_sample_count
   use thud_shell_sets, only: get_set_fields, set_outcome_type, set_type
   use thud_source_limits, only: conforms, get_source_limits, source_limits_type
   use thud_suggestion, only: get_suggestion
   use thud_text, only: join_quoted, quoted, to_text
   implicit none (type, external)
   private

   public :: column_type, find_columns, leave_many, many_type, new_many, solve_many, take_many

   !> Groups in whose keys drops may not differ: names, and what a run writes.
   character(len=key_length), parameter :: common_groups(*) = [character(len=key_length) :: &
      'case', 'model', 'modes', 'compression', 'output', 'floor']

   !> Approximate time of a drop on a plate beyond that of a drop on a rigid floor, s.
   real(wp), parameter :: floor_cost = 1.2e-2_wp

   !> Approximate time of one drop in a batch, s.
   real(wp), parameter :: batch_cost = 1.5e-5_wp

   !> A key in whose values drops differ.
   type :: column_type
      !> Its place among the keys that the case uses.
      integer :: place = 0
      !> Which entry of a list; 0 for keys that are no lists.
      integer :: entry = 0
   end type column_type

   !> Why a drop has no results.
   type :: reason_type
      !> A sentence; not allocated where it has results.
      character(len=:), allocatable :: text
   end type reason_type

   !> The drop on a rigid floor that serves again while only floor and room differ.
   type :: blocked_type
      !> All numbers that it hangs on; not allocated before the first: [n_number].
      real(wp), allocatable :: signature(:)
      type(force_history_type) :: history
      type(verdict_type) :: verdict
      !> The drop failed.
      type(error_type), allocatable :: error
   end type blocked_type

   !> Results of many drops: NaN and not conforming where there are none.
   type :: many_type
      !> Bands of the levels, octaves first: [n_band].
      type(band_type), allocatable :: bands(:)
      !> Number of the first band that the case asks for.
      integer :: first_band = 1
      !> Approximate time of one drop on one core, s.
      real(wp) :: cost = 0.0_wp
      !> Levels and verdicts are wanted.
      logical :: judged = .true.
      !> Matrices of the levels, kept from call to call.
      type(projections_type) :: projections
      !> 0, or the code of the error: [n_drop].
      integer, allocatable :: status(:)
      !> Sentences of the errors: [n_drop].
      type(reason_type), allocatable :: reason(:)
      !> The first of `scalar_fields`: [outcome_count, n_drop].
      real(wp), allocatable :: outcome(:, :)
      !> Levels, dB: [n_band, force_count, n_drop].
      real(wp), allocatable :: level(:, :, :)
      !> The source conforms by each force: [force_count, n_drop].
      logical, allocatable :: conforms(:, :)
      !> Minimum distance of an octave level of the judged force to its limits, dB, positive inside: [n_drop].
      real(wp), allocatable :: margin(:)
      !> The source conforms by the judged force: [n_drop].
      logical, allocatable :: verdict(:)
      !> Names, with units, of further results of cases with a floor: [n_further].
      character(len=32), allocatable :: further_name(:)
      !> Levels of the contact force and the energy to the floor; levels and ratings in the room: [n_further, n_drop].
      real(wp), allocatable :: further(:, :)
      !> The latest drop on a rigid floor, kept from call to call.
      type(blocked_type) :: blocked
      !> Forces, N, of no size where they are not wanted: [n_sample, force_count, n_drop].
      real(wp), allocatable :: force(:, :, :)
   end type many_type

   !> What an earlier call has prepared for the next one; one thread at a time owns it.
   type(many_type), allocatable :: kept

contains

   !> Keys by their names, entries of lists as `frequency(2)`, those of a group as `plate.thickness`.
   subroutine find_columns(case, names, columns, error)
      type(case_type), intent(in), target :: case
      !> The names: [n_column].
      character(len=*), intent(in) :: names(:)
      !> The keys: [n_column].
      type(column_type), allocatable, intent(out) :: columns(:)
      !> A name is unknown, given twice, or no entry of its list.
      type(error_type), allocatable, intent(out) :: error
      type(field_type), allocatable :: fields(:)
      type(list_type), pointer :: list
      logical, allocatable :: possible(:)
      character(len=:), allocatable :: group, key, suggestion
      logical :: known
      integer :: i, j

      allocate (fields, source=get_active_fields(case))
      ! Levels of all drops have the same bands.
      possible = [(.not. any(common_groups == fields(i)%group) .and. fields(i)%owner /= 'modes' &
         .and. fields(i)%key /= 'bands', i=1, size(fields))]
      allocate (columns(size(names)))
      do i = 1, size(names)
         call split_name(names(i), group, key, columns(i)%entry, known)
         ! Of keys of one name the first is meant, that of the source, unless a group is named.
         columns(i)%place = findloc(possible .and. fields%key == key .and. (group == '' .or. fields%group == group), &
            .true., dim=1)
         nullify (list)
         known = known .and. columns(i)%place > 0
         if (columns(i)%place > 0) then
            list => fields(columns(i)%place)%list_value
            if (associated(list)) then
               known = known .and. columns(i)%entry >= 1 .and. columns(i)%entry <= list%count
            else
               known = known .and. index(names(i), '(') == 0
            end if
         end if
         if (.not. known) then
            call get_suggestion(trim(names(i)), pack(fields%key, possible), suggestion)
            error = input_error(quoted(names(i))//' is not a key of drops'//suggestion//'; allowed: ' &
               //join_quoted(pack(fields%key, possible)))
            if (columns(i)%place > 0 .and. associated(list)) error = input_error(quoted(names(i)) &
               //' is not an entry of the list; allowed: '//trim(key)//'(1) to '//trim(key)//'('//to_text(list%count)//')')
         else if (any([(columns(j)%place == columns(i)%place .and. columns(j)%entry == columns(i)%entry, j=1, i - 1)])) then
            error = input_error(quoted(names(i))//' is given twice; allowed: once')
         end if
         if (allocated(error)) return
      end do
   end subroutine find_columns

   !> Group, key and entry of a name such as `frequency(2)` or `plate.thickness`.
   pure subroutine split_name(name, group, key, entry, valid)
      character(len=*), intent(in) :: name
      !> The group, empty where none is named.
      character(len=:), allocatable, intent(out) :: group, key
      !> The entry; 0 where none is named.
      integer, intent(out) :: entry
      !> The name is a key, or a key with a number in brackets.
      logical, intent(out) :: valid
      integer :: bracket, dot, last

      dot = index(name, '.')
      group = name(:max(dot - 1, 0))
      key = name(dot + 1:)
      entry = 0
      valid = dot /= 1
      bracket = index(name, '(')
      if (bracket == 0) return
      key = name(dot + 1:bracket - 1)
      last = len_trim(name)
      valid = valid .and. last > bracket + 1 .and. last < bracket + 6 .and. name(last:last) == ')' &
         .and. verify(name(bracket + 1:last - 1), '0123456789') == 0
      if (valid) read (name(bracket + 1:last - 1), *) entry
   end subroutine split_name

   !> Prepares for many drops of a case.
   subroutine new_many(case, columns, judged, many)
      type(case_type), intent(in), target :: case
      !> In what the drops differ: [n_column].
      type(column_type), intent(in) :: columns(:)
      !> Levels and verdicts are wanted.
      logical, intent(in) :: judged
      !> What is kept from an earlier call serves again where it fits.
      type(many_type), intent(inout) :: many
      type(projections_type) :: wanted

      call get_level_bands(case%bands, many%bands, many%first_band)
      many%judged = judged
      many%cost = case%models(get_model_number(case))%model%get_cost()
      if (suits_batch(case, columns)) many%cost = batch_cost
      if (case%has_floor) many%cost = many%cost + floor_cost
      call name_further(case, many)
      wanted = new_projections(case%sampling%sample_rate, many%bands(octave_count + 1:), get_sample_count(case%sampling))
      if (.not. are_alike(wanted, many%projections)) many%projections = wanted
   end subroutine new_many

   !> Takes what an earlier call has left, or an empty one.
   subroutine take_many(many)
      !> The results of an earlier call, or none.
      type(many_type), allocatable, intent(out) :: many

      !$omp critical (thud_many)
      call move_alloc(kept, many)
      !$omp end critical (thud_many)
      if (.not. allocated(many)) allocate (many)
   end subroutine take_many

   !> Keeps what the next call can use.
   subroutine leave_many(many)
      !> The results, which are released.
      type(many_type), allocatable, intent(inout) :: many

      call clear(many)
      !$omp critical (thud_many)
      call move_alloc(many, kept)
      !$omp end critical (thud_many)
   end subroutine leave_many

   !> Releases the results of drops.
   subroutine clear(many)
      type(many_type), intent(inout) :: many

      if (allocated(many%status)) deallocate (many%status, many%reason, many%conforms, many%margin, many%verdict, &
         many%outcome, many%level, many%further)
      if (allocated(many%force)) deallocate (many%force)
   end subroutine clear

   !> Computes drops.
   subroutine solve_many(case, columns, values, threads, forces, many, error)
      !> The case; drops may make valid what is not in it.
      type(case_type), intent(in), target :: case
      !> In what the drops differ: [n_column].
      type(column_type), intent(in) :: columns(:)
      !> Their values, as `get_number` of the keys gives them: [n_column, n_drop].
      real(wp), intent(in) :: values(:, :)
      integer, intent(in) :: threads
      !> Forces are wanted too.
      logical, intent(in) :: forces
      type(many_type), intent(inout) :: many
      !> As of `check_drops`, there is no space in memory, or an interrupt.
      type(error_type), allocatable, intent(out) :: error
      integer, allocatable :: left(:)
      integer :: n_drop, i

      n_drop = size(values, 2)
      call check_drops(case, columns, forces, error)
      if (allocated(error)) return
      call set_size(many, n_drop, merge(get_sample_count(case%sampling), 0, forces), error)
      if (allocated(error)) return
      left = [(i, i=1, n_drop)]
      if (suits_batch(case, columns)) then
         call solve_batch(case, columns, values, threads, many, error)
         if (allocated(error)) return
         ! The single solver gives the reasons.
         left = pack(left, many%status /= 0)
      end if
      !$omp parallel num_threads(threads) if (size(left) > 1)
      call solve_singly()
      !$omp end parallel
      call check_interrupt(error)

   contains

      !> The drops of one thread, one after the other.
      subroutine solve_singly()
         type(case_type), target :: own
         type(blocked_type) :: blocked
         type(field_type), allocatable :: fields(:)
         integer :: drop

         own = case
         allocate (fields, source=get_active_fields(own))
         ! Nobody reads the free modes or the compression of a drop.
         own%has_modes = .false.
         own%has_compression = .false.
         blocked = many%blocked
         !$omp do schedule(dynamic)
         do drop = 1, size(left)
            if (.not. is_interrupted()) call solve_one(own, fields, columns, values(:, left(drop)), left(drop), blocked, &
               many)
         end do
         !$omp end do
         !$omp single
         many%blocked = blocked
         !$omp end single
      end subroutine solve_singly

   end subroutine solve_many

   !> Refuses drops that cannot be computed together.
   subroutine check_drops(case, columns, forces, error)
      type(case_type), intent(in), target :: case
      !> In what the drops differ: [n_column].
      type(column_type), intent(in) :: columns(:)
      !> Forces are wanted.
      logical, intent(in) :: forces
      !> The case has no impact, a key of all drops has a value out of range, or forces are wanted of records of
      !> different length.
      type(error_type), allocatable, intent(out) :: error
      type(field_type), allocatable :: fields(:)
      integer :: i

      if (.not. case%has_impact) then
         error = input_error('the case computes no impact; allowed: a case with &model')
         return
      end if
      allocate (fields, source=get_active_fields(case))
      ! What every drop takes over from the case.
      call check_fields(pack(fields, fields%owner == '' .and. fields%group /= 'ball' .and. fields%group /= 'drop' &
         .and. [(all(columns%place /= i), i=1, size(fields))]), error)
      if (allocated(error) .or. .not. forces) return
      if (any([(any(fields(columns(i)%place)%key == [character(len=11) :: 'duration', 'sample_rate']), &
         i=1, size(columns))])) then
         error = input_error('forces are wanted of drops with their own sampling; allowed: one sampling for all, ' &
            //'that of the case')
      else
         call check_sampling(case%sampling, error)
      end if
   end subroutine check_drops

   !> Space for the results of a number of drops.
   subroutine set_size(many, n_drop, n_sample, error)
      type(many_type), intent(inout) :: many
      integer, intent(in) :: n_drop
      !> Samples of the forces that are wanted.
      integer, intent(in) :: n_sample
      !> There is no space in memory.
      type(error_type), allocatable, intent(out) :: error
      character(len=128) :: message
      integer :: status

      call clear(many)
      allocate (many%status(n_drop), many%reason(n_drop), many%outcome(outcome_count, n_drop), &
         many%level(size(many%bands), force_count, n_drop), many%conforms(force_count, n_drop), many%margin(n_drop), &
         many%verdict(n_drop), many%further(size(many%further_name), n_drop))
      allocate (many%force(n_sample, force_count, merge(n_drop, 0, n_sample > 0)), stat=status, errmsg=message)
      if (status /= 0) then
         error = input_error('the forces of '//to_text(n_drop)//' drops have no space in memory; allowed: fewer at a time')
         return
      end if
      many%conforms = .false.
      many%verdict = .false.
      many%margin = not_a_number
      many%further = not_a_number
   end subroutine set_size

   !> One drop by the single solver.
   subroutine solve_one(case, fields, columns, values, drop, blocked, many)
      !> The case; the keys of the columns are overwritten.
      type(case_type), intent(inout), target :: case
      !> Its keys: [n_field].
      type(field_type), intent(in) :: fields(:)
      !> In what drops differ: [n_column].
      type(column_type), intent(in) :: columns(:)
      !> Values of this one: [n_column].
      real(wp), intent(in) :: values(:)
      integer, intent(in) :: drop
      !> An earlier drop, or this one.
      type(blocked_type), intent(inout) :: blocked
      type(many_type), intent(inout) :: many
      type(error_type), allocatable :: error
      real(wp), allocatable :: scalars(:)
      integer :: i

      do i = 1, size(columns)
         if (.not. allocated(error)) call fields(columns(i)%place)%set_number(values(i), columns(i)%entry, error)
      end do
      if (.not. allocated(error)) call check_case(case, error)
      if (.not. allocated(error)) call solve_blocked(case, get_signature(fields, many%judged), many%judged, blocked, error)
      if (case%has_floor .and. .not. allocated(error)) call solve_floor(case, blocked%history, many, many%further(:, drop), &
         error)
      many%status(drop) = 0
      many%outcome(:, drop) = not_a_number
      many%level(:, :, drop) = not_a_number
      if (size(many%force) > 0) many%force(:, :, drop) = not_a_number
      if (allocated(error)) then
         many%further(:, drop) = not_a_number
         many%status(drop) = error%code
         many%reason(drop)%text = error%message
         return
      end if
      scalars = get_scalars(blocked%history)
      many%outcome(:, drop) = scalars(:outcome_count)
      if (size(many%force) > 0) then
         many%force(:, 1, drop) = blocked%history%elastic_force
         many%force(:, 2, drop) = blocked%history%floor_force
      end if
      if (.not. many%judged) return
      many%level(:, :, drop) = blocked%verdict%level
      many%conforms(:, drop) = all(conforms(blocked%verdict%criteria), dim=1)
      call judge(case, drop, many)
   end subroutine solve_one

   !> The drop on a rigid floor, unless the one before was the same.
   subroutine solve_blocked(case, signature, judged, blocked, error)
      !> The case, checked.
      type(case_type), intent(in) :: case
      !> What force and verdict hang on: [n_number].
      real(wp), intent(in) :: signature(:)
      !> Levels and verdict are wanted.
      logical, intent(in) :: judged
      type(blocked_type), intent(inout) :: blocked
      !> The drop failed.
      type(error_type), allocatable, intent(out) :: error
      logical :: same

      same = allocated(blocked%signature)
      if (same) same = size(signature) == size(blocked%signature)
      if (same) same = .not. any(abs(signature - blocked%signature) > 0.0_wp)
      if (.not. same) then
         blocked%signature = signature
         associate (model => case%models(get_model_number(case))%model)
            call model%solve(case%ball, case%drop, case%sampling, blocked%history, blocked%error)
         end associate
         if (judged .and. .not. allocated(blocked%error)) call judge_case(case, blocked%history, blocked%verdict, &
            blocked%error)
      end if
      if (allocated(blocked%error)) error = blocked%error
   end subroutine solve_blocked

   !> All numbers of the keys that the drop on a rigid floor hangs on.
   function get_signature(fields, judged) result(signature)
      !> The keys that the case uses: [n_field].
      type(field_type), intent(in) :: fields(:)
      !> Levels and verdict are wanted.
      logical, intent(in) :: judged
      !> The numbers, of lists with their count: [n_number].
      real(wp), allocatable :: signature(:)
      integer :: i

      signature = [merge(1.0_wp, 0.0_wp, judged)]
      do i = 1, size(fields)
         associate (field => fields(i))
            if (any(field%owner == [character(len=key_length) :: 'floor', 'room', floor_names])) cycle
            if (associated(field%list_value)) then
               signature = [signature, real(field%list_value%count, wp), field%list_value%values(:field%list_value%count)]
            else
               signature = [signature, field%get_number()]
            end if
         end associate
      end do
   end function get_signature

   !> The drop on the floor, and the level in the room below.
   subroutine solve_floor(case, blocked, many, further, error)
      !> The case, checked, with a floor.
      type(case_type), intent(in) :: case
      !> The drop on a rigid floor.
      type(force_history_type), intent(in) :: blocked
      type(many_type), intent(in) :: many
      !> Results in the order of their names: [n_further].
      real(wp), intent(out) :: further(:)
      !> The drop failed.
      type(error_type), allocatable, intent(out) :: error
      type(force_history_type), allocatable :: contact
      type(room_level_type) :: room
      integer :: n

      further = not_a_number
      call drop_on_floor(case, contact, error)
      if (allocated(error)) return
      ! On a rigid floor, and of models that know its force only.
      if (.not. allocated(contact)) allocate (contact, source=blocked)
      n = size(many%bands) - many%first_band + 1
      further(n + 1) = contact%floor_work
      if (.not. many%judged) return
      call get_force_exposure_levels(contact%floor_force, contact%sample_rate, many%bands(many%first_band:), &
         trim(case%level_method), further(:n), error)
      if (allocated(error) .or. .not. case%has_room) return
      call predict_room(case, contact%floor_force, contact%sample_rate, room, error)
      if (allocated(error)) return
      further(n + 2:) = [room%level, room%a_weighted, get_a_weighted_level(room%bands(1)%set, room%level &
         + get_standardisation(room%reverberation_time, case%room%volume))]
   end subroutine solve_floor

   !> Names of the further results of a case.
   subroutine name_further(case, many)
      type(case_type), intent(in) :: case
      !> The results, with their bands; get the names.
      type(many_type), intent(inout) :: many
      type(band_type), allocatable :: bands(:)
      type(error_type), allocatable :: error
      integer :: i

      if (allocated(many%further_name)) deallocate (many%further_name)
      allocate (many%further_name(0))
      if (.not. case%has_floor) return
      many%further_name = [character(len=32) :: ('contact_'//trim(many%bands(i)%set)//'_'//get_band_name(many%bands(i)) &
         //'_Hz_dB', i=many%first_band, size(many%bands)), 'floor_work_J']
      if (.not. case%has_room) return
      call get_room_bands(bands, error)
      many%further_name = [character(len=32) :: many%further_name, ('room_'//trim(bands(i)%set)//'_' &
         //get_band_name(bands(i))//'_Hz_dB', i=1, size(bands)), 'room_rating_dB', 'room_standardised_rating_dB']
   end subroutine name_further

   !> Verdict by the judged force.
   subroutine judge(case, drop, many)
      !> The case of the drop.
      type(case_type), intent(in) :: case
      !> Number of the drop, whose levels are known.
      integer, intent(in) :: drop
      !> Gets margin and verdict.
      type(many_type), intent(inout) :: many
      type(source_limits_type) :: limits
      type(error_type), allocatable :: error
      integer :: force

      force = get_judged_force(case)
      call get_source_limits(case%source, limits, error)
      many%verdict(drop) = many%conforms(force, drop)
      associate (level => many%level(:octave_count, force, drop))
         many%margin(drop) = minval(min(level - limits%lower_level, limits%upper_level - level))
      end associate
   end subroutine judge

   !> Whether drops can be computed in batches: by the shell model, with exact levels, if they differ in nothing
   !> but ball, drop and the options of the model.
   function suits_batch(case, columns) result(suits)
      type(case_type), intent(in), target :: case
      !> In what the drops differ: [n_column].
      type(column_type), intent(in) :: columns(:)
      logical :: suits
      type(field_type), allocatable :: fields(:)
      integer :: i

      suits = .false.
      select type (model => case%models(get_model_number(case))%model)
      type is (hollow_sphere_type)
         allocate (fields, source=get_active_fields(case))
         fields = fields(columns%place)
         suits = case%level_method == 'exact' .and. .not. case%has_floor .and. all([(fields(i)%group == 'ball' &
            .or. fields(i)%group == 'drop' .or. fields(i)%owner == case%model, i=1, size(fields))])
      end select
   end function suits_batch

   !> Drops of the shell model in batches.
   subroutine solve_batch(case, columns, values, threads, many, error)
      type(case_type), intent(in), target :: case
      !> In what the drops differ: [n_column].
      type(column_type), intent(in) :: columns(:)
      !> Their values: [n_column, n_drop].
      real(wp), intent(in) :: values(:, :)
      integer, intent(in) :: threads
      type(many_type), intent(inout) :: many
      !> There is no space in memory.
      type(error_type), allocatable, intent(out) :: error
      type(set_type), allocatable :: sets(:)
      type(set_outcome_type), allocatable :: outcomes(:)
      integer :: i

      allocate (sets(size(values, 2)), outcomes(size(values, 2)))
      call fill_sets(case, columns, values, sets)
      call solve_ensemble(sets, case%sampling, trim(case%source), threads, many%judged, many%projections, outcomes, &
         many%level, many%conforms, many%force, error)
      if (allocated(error)) return
      do i = 1, size(sets)
         associate (found => outcomes(i))
            many%status(i) = merge(0, 1, found%computed)
            many%outcome(:, i) = [found%contact_time, found%peak_force, found%peak_elastic_force, found%max_deflection, &
               found%restitution, found%impulse]
         end associate
         if (many%judged .and. many%status(i) == 0) call judge(case, i, many)
      end do
   end subroutine solve_batch

   !> Parameter sets of the shell model.
   subroutine fill_sets(case, columns, values, sets)
      !> The case, which gives what is not in the columns.
      type(case_type), intent(in), target :: case
      !> In what the drops differ: [n_column].
      type(column_type), intent(in) :: columns(:)
      !> Their values: [n_column, n_drop].
      real(wp), intent(in) :: values(:, :)
      !> The sets: [n_drop].
      type(set_type), intent(out) :: sets(:)
      type(set_type), target :: set
      type(field_type), allocatable :: fields(:), set_fields(:)
      integer :: place(size(columns))
      integer :: i, j

      set%ball = case%ball
      set%drop = case%drop
      allocate (fields, source=get_active_fields(case))
      allocate (set_fields, source=get_set_fields(set))
      ! The only other key is the choice of the flux term.
      place = [(findloc(set_fields%key == fields(columns(j)%place)%key, .true., dim=1), j=1, size(columns))]
      select type (model => case%models(get_model_number(case))%model)
      type is (hollow_sphere_type)
         set%flux = findloc(flux_choices == model%momentum_flux, .true., dim=1)
      end select
      do i = 1, size(sets)
         do j = 1, size(columns)
            if (place(j) > 0) then
               set_fields(place(j))%real_value = values(j, i)
            else
               set%flux = nint(values(j, i))
               ! A number that is not whole chooses nothing.
               if (abs(values(j, i) - set%flux) > 0.0_wp) set%flux = 0
            end if
         end do
         sets(i) = set
      end do
   end subroutine fill_sets

end module thud_many
