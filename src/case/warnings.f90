!> Warnings on cases that are allowed but implausible: a ball unlike rubber, a force that no real source has.
module thud_warnings
   use thud_ball, only: ball_type, get_density
   use thud_band, only: band_type, get_band_name, get_octaves, octave_count
   use thud_case, only: case_type, get_active_fields, get_model_number, get_unstated_fields
   use thud_error, only: error_type
   use thud_field, only: field_type, key_length
   use thud_floor_model, only: floor_state_type
   use thud_force_exposure, only: get_force_exposure_levels
   use thud_force_history, only: force_history_type
   use thud_kinds, only: wp
   use thud_refined_drop, only: finer_quantities, get_resolution_keys
   use thud_registry, only: floor_names
   use thud_room, only: get_completed_room, room_level_type, room_type
   use thud_sampling, only: get_rate_limit
   use thud_source_limits, only: conforms, criterion_type
   use thud_text, only: fixed, quoted, to_text
   use thud_validity_limit, only: get_limit_message, is_outside, validity_limit_type
   implicit none (type, external)
   private

   public :: add_floor_warning, add_height_warning, add_modes_warning, add_source_warning, get_warnings, warning_length

   !> Maximum length of a warning.
   integer, parameter :: warning_length = 240

   !> Range of densities of rubbers, from porous unfilled natural rubber to highly filled rubber, kg/m3: [2].
   real(wp), parameter :: rubber_density(2) = [800.0_wp, 2200.0_wp]

   !> Range of moduli of elasticity of rubbers, from gels to hard rubber, Pa: [2].
   real(wp), parameter :: rubber_modulus(2) = [1.0e4_wp, 3.0e9_wp]

   !> Range of Poisson's ratios of rubbers, including filled ones: [2].
   real(wp), parameter :: rubber_ratio(2) = [0.45_wp, 0.5_wp]

   !> Levels over all frequencies of a conforming ball and a conforming tyre, dB re 1 N and 1 s: [2]. They are 4.4 dB above
   !> the sums of the nominal octave levels, as for the standard ball and for a half sine of 20 ms.
   real(wp), parameter :: source_level(2) = [44.0_wp, 52.0_wp]

   !> Distance from `source_level` beyond which the units of the input are probably wrong, dB.
   real(wp), parameter :: max_distance = 40.0_wp

   !> Edges of the octaves 31.5 Hz (lower) and 500 Hz (upper), Hz: [2].
   real(wp), parameter :: standard_band(2) = [22.4_wp, 707.0_wp]

   !> An octave level this far below the level over all frequencies is affected by rounding errors, dB.
   real(wp), parameter :: max_decline = 120.0_wp

   !> Range of usual heights of rooms, m: [2].
   real(wp), parameter :: usual_height(2) = [2.0_wp, 6.0_wp]

   !> Largest relative difference between the areas of a room and of the floor above it.
   real(wp), parameter :: same_area = 0.01_wp

   !> Numerical error of an octave level above which a warning is raised, dB.
   real(wp), parameter :: max_error = 0.2_wp

   !> Beginning of this warning.
   character(len=*), parameter :: error_title = 'the numerical error'

   !> Rounding error of a coefficient of restitution.
   real(wp), parameter :: restitution_error = 1.0e-6_wp

contains

   !> Warnings on a case and its force.
   subroutine get_warnings(case, state, history, warnings, on_floor)
      !> The case, checked.
      type(case_type), intent(in) :: case
      !> Its floor, prepared if it has one.
      type(floor_state_type), intent(in) :: state
      !> Force history; without samples if the case has no impact.
      type(force_history_type), intent(in) :: history
      !> Messages: [n].
      character(len=warning_length), allocatable, intent(out) :: warnings(:)
      !> Force history on a mobile floor.
      type(force_history_type), intent(in), optional :: on_floor
      logical :: uses_wall

      allocate (warnings(0))
      uses_wall = .not. case%has_impact
      if (case%has_impact) uses_wall = case%models(get_model_number(case))%model%get_standard_modulus() > 0.0_wp
      if (uses_wall) call add_limit_warnings(get_rubber_limits(case%ball), warnings)
      if (.not. case%has_impact) return
      call add_law_warning(case, warnings)
      if (case%has_floor .and. case%floor /= floor_names(1) .and. .not. present(on_floor)) call add(warnings, &
         '&floor: name = '//quoted(case%floor)//' does not move under the model '//quoted(case%model) &
         //': its force is that on a rigid floor')
      if (case%has_floor) call add_floor_warning(case, state, warnings)
      if (case%has_room) call add_height_warning(case, state, warnings)
      call add_limit_warnings(get_limits(case, history), warnings)
      call add_level_warnings(history, warnings)
      call add_error_warning(history, '', warnings)
      if (present(on_floor)) call add_error_warning(on_floor, '&floor: ', warnings)
      if (case%sampling%verify .and. all(history%model_quantity_name /= finer_quantities(1))) call add(warnings, &
         '&sampling: verify: the drop cannot be computed at a finer resolution, and is not verified')
      if (present(on_floor)) call add_limit_warnings(get_limits(case, on_floor), warnings)
   end subroutine get_warnings

   !> Limits within which the results of a model are valid.
   function get_limits(case, history) result(limits)
      type(case_type), intent(in) :: case
      type(force_history_type), intent(in) :: history
      !> The limits: [n_limit].
      type(validity_limit_type), allocatable :: limits(:)

      associate (model => case%models(get_model_number(case))%model)
         limits = [get_rate_limit(case%sampling), model%get_validity_limits(case%ball, case%drop, case%sampling, history), &
            validity_limit_type('model', 'restitution minus 1', history%restitution - 1, highest=restitution_error, &
            reason='it gives energy to the source'), &
            validity_limit_type('floor', 'restitution', history%restitution, lowest=-restitution_error, &
            reason='the source goes on downwards with a floor too light for it')]
      end associate
   end function get_limits

   !> Adds warnings on quantities outside their limits, unless there is one on the quantity.
   subroutine add_limit_warnings(limits, warnings)
      !> The limits: [n_limit].
      type(validity_limit_type), intent(in) :: limits(:)
      !> Messages: [n].
      character(len=warning_length), allocatable, intent(inout) :: warnings(:)
      integer :: i

      do i = 1, size(limits)
         if (.not. is_outside(limits(i)) .or. any(index(warnings, trim(limits(i)%quantity)//' is ') > 0)) cycle
         call add(warnings, get_limit_message(limits(i)))
      end do
   end subroutine add_limit_warnings

   !> Adds a warning on a large numerical error, with the keys that lower it.
   subroutine add_error_warning(history, prefix, warnings)
      type(force_history_type), intent(in) :: history
      !> Beginning of the message.
      character(len=*), intent(in) :: prefix
      !> Messages: [n].
      character(len=warning_length), allocatable, intent(inout) :: warnings(:)
      type(band_type) :: bands(octave_count)
      character(len=:), allocatable :: octaves, keys
      integer :: lowest, highest

      bands = get_octaves()
      associate (error => history%numerical_error)
         if (.not. error%known) then
            call add(warnings, prefix//error_title//' could not be estimated: no other resolution can be computed')
            return
         end if
         lowest = findloc(error%octave > max_error, .true., dim=1)
         if (lowest == 0) return
         highest = findloc(error%octave > max_error, .true., dim=1, back=.true.)
         octaves = trim(get_band_name(bands(highest)))//' Hz'
         if (lowest < highest) octaves = trim(get_band_name(bands(lowest)))//' to '//octaves
         call get_resolution_keys(history, keys)
         ! Rounded up, so that it exceeds the limit as printed.
         call add(warnings, prefix//error_title//' of the octave levels is up to ' &
            //fixed(ceiling(100*maxval(error%octave))/100.0_wp, 2)//' dB ('//octaves//'); raise ' &
            //keys)
      end associate
   end subroutine add_error_warning

   !> Adds warnings on forces in wrong units, and on levels dominated by rounding errors.
   subroutine add_level_warnings(history, warnings)
      type(force_history_type), intent(in) :: history
      !> Messages: [n].
      character(len=warning_length), allocatable, intent(inout) :: warnings(:)
      type(band_type) :: bands(octave_count)
      type(error_type), allocatable :: error
      real(wp) :: levels(octave_count)
      real(wp) :: total
      integer :: first

      total = 10*log10(max(sum(history%floor_force**2)/history%sample_rate, tiny(1.0_wp)))
      if (total < source_level(1) - max_distance .or. total > source_level(2) + max_distance) call add(warnings, &
         'the force exposure level over all frequencies is '//fixed(total, 1)//' dB, sources that conform have ' &
         //fixed(source_level(1), 0)//' to '//fixed(source_level(2), 0)//' dB; check the units of the input')
      bands = get_octaves()
      call get_force_exposure_levels(history%floor_force, history%sample_rate, bands, 'exact', levels, error)
      if (allocated(error)) return
      first = findloc(levels < total - max_decline, .true., dim=1)
      if (first > 0) call add(warnings, 'octaves from '//trim(get_band_name(bands(first))) &
         //' Hz on hold less than 1e-12 of the energy of the force: rounding errors affect their levels')
   end subroutine add_level_warnings

   !> Adds warnings on octaves of the standard in which the floor model is not valid.
   subroutine add_floor_warning(case, state, warnings)
      !> A case with a floor.
      type(case_type), intent(in) :: case
      !> The floor, prepared.
      type(floor_state_type), intent(in) :: state
      !> Messages: [n].
      character(len=warning_length), allocatable, intent(inout) :: warnings(:)

      if (state%lowest_frequency > standard_band(1)) call add(warnings, '&'//trim(case%floor)//': below ' &
         //fixed(state%lowest_frequency, 0)//' Hz '//trim(state%validity_reason))
      if (state%highest_frequency < standard_band(2)) call add(warnings, '&'//trim(case%floor)//': above ' &
         //fixed(state%highest_frequency, 0)//' Hz '//trim(state%validity_reason))
   end subroutine add_floor_warning

   !> Adds a warning on a source that does not conform, for a case with a room.
   subroutine add_source_warning(criteria, warnings)
      !> Criteria of the force on the floor, octave levels first: [n].
      type(criterion_type), intent(in) :: criteria(:)
      !> Messages: [n].
      character(len=warning_length), allocatable, intent(inout) :: warnings(:)
      type(band_type) :: bands(octave_count)
      character(len=:), allocatable :: octaves
      integer :: i

      bands = get_octaves()
      octaves = ''
      do i = 1, octave_count
         if (.not. conforms(criteria(i))) octaves = octaves//', '//trim(get_band_name(bands(i)))//' Hz ' &
            //fixed(criteria(i)%value - (criteria(i)%lower + criteria(i)%upper)/2, 1)//' dB'
      end do
      if (octaves /= '') call add(warnings, '&room: the source does not conform ('//octaves(3:) &
         //' from the nominal levels): the level in the room is not that of a standard source')
   end subroutine add_source_warning

   !> Adds a warning on bands below the crossover that are statistical: their modes are not resolved, or would take too long.
   subroutine add_modes_warning(prediction, warnings)
      type(room_level_type), intent(in) :: prediction
      !> Messages: [n].
      character(len=warning_length), allocatable, intent(inout) :: warnings(:)

      associate (next => prediction%n_modal + 1)
         if (next > size(prediction%bands)) return
         if (prediction%bands(next)%center <= prediction%crossover) call add(warnings, '&room: from ' &
            //trim(get_band_name(prediction%bands(next)))//' Hz on the level is statistical, below the frequency at which ' &
            //'three modes of the room overlap, '//fixed(prediction%crossover, 0)//' Hz')
      end associate
   end subroutine add_modes_warning

   !> Adds warnings on a room of unusual height and a room that is not as large as the floor.
   subroutine add_height_warning(case, state, warnings)
      !> A case with floor and room.
      type(case_type), intent(in) :: case
      !> The floor, prepared.
      type(floor_state_type), intent(in) :: state
      !> Messages: [n].
      character(len=warning_length), allocatable, intent(inout) :: warnings(:)
      type(room_type) :: room

      room = get_completed_room(case%room, state%plate)
      call add_limit_warnings([validity_limit_type('room', 'height in m', room%height, usual_height(1), usual_height(2), &
         'check volume, length and width', 'most rooms have')], warnings)
      associate (room_area => room%length*room%width, area => state%plate%length*state%plate%width)
         if (abs(room_area/area - 1) > same_area) call add(warnings, '&room: a room of '//fixed(room_area, 1) &
            //' m2 below a floor of '//fixed(area, 1)//' m2: only the part of the floor above the room radiates into it')
      end associate
   end subroutine add_height_warning

   !> Limits of density, modulus and Poisson's ratio of a ball of rubber.
   function get_rubber_limits(ball) result(limits)
      type(ball_type), intent(in) :: ball
      type(validity_limit_type) :: limits(3)

      limits = [validity_limit_type('ball', 'density of the wall in kg/m3', get_density(ball), rubber_density(1), &
         rubber_density(2), 'check mass, outer_radius and wall_thickness', 'rubbers have'), &
         validity_limit_type('ball', 'youngs_modulus in Pa', ball%youngs_modulus, rubber_modulus(1), rubber_modulus(2), &
         'check the unit', 'rubbers have'), &
         validity_limit_type('ball', 'poisson_ratio', ball%poisson_ratio, rubber_ratio(1), &
         reason='they hardly change their volume', subject='rubbers have')]
   end function get_rubber_limits

   !> Adds a warning on a loss factor that is not stated, with a damping law other than that of the standard ball.
   subroutine add_law_warning(case, warnings)
      type(case_type), intent(in), target :: case
      !> Messages: [n].
      character(len=warning_length), allocatable, intent(inout) :: warnings(:)
      type(field_type), allocatable :: fields(:)
      character(len=key_length) :: law
      integer :: i

      allocate (fields, source=get_unstated_fields(case))
      do i = 1, size(fields)
         if (fields(i)%key /= 'loss_factor') cycle
         law = fields(i)%get_needed_choice(get_active_fields(case))
         if (law /= fields(i)%needs(2)) call add(warnings, &
            '&'//trim(fields(i)%group)//': loss_factor = '//to_text(fields(i)%get_number())//' is that of the standard ' &
            //'ball with '//trim(fields(i)%needs(1))//' = '//quoted(fields(i)%needs(2))//'; state it for '//quoted(law))
      end do
   end subroutine add_law_warning

   !> Adds a warning.
   pure subroutine add(warnings, message)
      !> Messages: [n].
      character(len=warning_length), allocatable, intent(inout) :: warnings(:)
      character(len=*), intent(in) :: message

      warnings = [character(len=warning_length) :: warnings, message]
   end subroutine add

end module thud_warnings
