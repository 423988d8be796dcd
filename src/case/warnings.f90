!> Warnings on cases that are allowed but implausible: a ball unlike rubber, a force that no real source has.
module thud_warnings
   use thud_ball, only: ball_type, get_density
   use thud_band, only: get_band_name, octave_count, octaves
   use thud_case, only: case_type, get_active_fields, get_model_number, get_unstated_fields
   use thud_constants, only: not_a_number
   use thud_field, only: field_type
   use thud_floor_model, only: floor_state_type
   use thud_force_history, only: force_history_type
   use thud_kinds, only: wp
   use thud_note, only: note_type
   use thud_refined_drop, only: finer_quantities, get_resolution, max_error
   use thud_registry, only: floor_names, standard_moduli
   use thud_room, only: box_type, new_box, room_level_type
   use thud_source_limits, only: conforms, criterion_type
   use thud_text, only: fixed, quoted, to_text
   use thud_validity_limit, only: get_limit_note, validity_limit_type
   implicit none (type, external)
   private

   public :: add_floor_warnings, add_modes_warning, add_source_warning, get_warnings

   !> Edges of the octaves 31.5 Hz (lower) and 500 Hz (upper), Hz: [2].
   real(wp), parameter :: standard_band(2) = [22.4_wp, 707.0_wp]

   !> Largest relative difference between the areas of a room and of the floor above it.
   real(wp), parameter :: same_area = 0.01_wp

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
      !> The warnings: [n].
      type(note_type), allocatable, intent(out) :: warnings(:)
      !> Force history on a mobile floor.
      type(force_history_type), intent(in), optional :: on_floor

      allocate (warnings(0))
      ! Free modes, and these models, use the wall.
      if (.not. case%has_impact .or. standard_moduli(get_model_number(case)) > 0.0_wp) call add_limit_warnings( &
         get_rubber_limits(case%ball), warnings)
      if (.not. case%has_impact) return
      call add_law_warning(case, warnings)
      if (case%has_floor .and. case%floor /= floor_names(1) .and. .not. present(on_floor)) call add(warnings, &
         'floor_at_rest', 'floor', 'name', '= '//quoted(case%floor)//' does not move under the model '//quoted(case%model) &
         //': its force is that on a rigid floor')
      if (case%has_floor) call add_floor_warnings(case, state, warnings)
      call add_limit_warnings([get_limits(case, history), get_error_limit('sampling', history)], warnings)
      if (case%sampling%verify .and. all(history%model_quantity_name /= finer_quantities(1))) call add(warnings, &
         'not_verified', 'sampling', 'verify', 'is set, but the drop cannot be computed at a finer resolution: it is not ' &
         //'verified')
      if (present(on_floor)) call add_limit_warnings([get_limits(case, on_floor), get_error_limit('floor', on_floor)], &
         warnings)
   end subroutine get_warnings

   !> Limits within which the results of a model are valid.
   function get_limits(case, history) result(limits)
      type(case_type), intent(in) :: case
      type(force_history_type), intent(in) :: history
      !> The limits: [n_limit].
      type(validity_limit_type), allocatable :: limits(:)
      real(wp) :: total

      total = 10*log10(max(sum(history%floor_force**2)/history%sample_rate, tiny(1.0_wp)))
      associate (model => case%models(get_model_number(case))%model)
         limits = [ &
            ! If a force begins with a jump or a corner, aliasing changes the level of the 500 Hz octave by up to 0.2 dB at
            ! the limit, 2 dB at 2000 Hz.
            validity_limit_type('sampling', 'in Hz', case%sampling%sample_rate, lowest=8000.0_wp, &
            reason='aliasing changes the level at 500 Hz by up to 2 dB', subject='levels hold', key='sample_rate'), &
            model%get_validity_limits(case%ball, case%drop, history), &
            validity_limit_type('model', 'restitution minus 1', history%restitution - 1, highest=restitution_error, &
            reason='it gives energy to the source'), &
            validity_limit_type('floor', 'restitution', history%restitution, lowest=-restitution_error, &
            reason='the source goes on downwards with a floor too light for it'), &
            ! 40 dB from a conforming ball and a conforming tyre, 44 and 52 dB: 4.4 dB above the sums of the nominal octave
            ! levels, as for the standard ball and for a half sine of 20 ms.
            validity_limit_type('drop', 'force exposure level over all frequencies in dB', total, 4.0_wp, 92.0_wp, &
            'check the units of the input', 'sources have'), &
            validity_limit_type('levels', 'smallest fraction of the energy in an octave', &
            minval(10**((history%octave_level - total)/10)), lowest=1.0e-12_wp, &
            reason='rounding errors affect its level', subject='levels hold')]
      end associate
   end function get_limits

   !> Limit of the numerical error of the octave levels.
   function get_error_limit(group, history) result(limit)
      !> Group that the message names.
      character(len=*), intent(in) :: group
      type(force_history_type), intent(in) :: history
      type(validity_limit_type) :: limit
      integer :: first, last

      limit = validity_limit_type(group, 'numerical error', not_a_number, highest=max_error, &
         reason='no other resolution can be computed', subject='accepted')
      associate (error => history%numerical_error)
         if (.not. error%known) return
         first = max(1, findloc(error%octave > max_error, .true., dim=1))
         last = max(1, findloc(error%octave > max_error, .true., dim=1, back=.true.))
         ! Rounded up, so that it exceeds the limit as printed.
         limit%value = ceiling(100*maxval(error%octave))/100.0_wp
      end associate
      limit%quantity = 'numerical error in dB at '//trim(get_band_name(octaves(last)))//' Hz'
      if (first < last) limit%quantity = 'numerical error in dB at '//trim(get_band_name(octaves(first)))//' to ' &
         //trim(get_band_name(octaves(last)))//' Hz'
      limit%reason = 'raise the resolution, now '//get_resolution(history)
   end function get_error_limit

   !> Adds warnings on quantities outside their limits, unless there is one on the quantity.
   subroutine add_limit_warnings(limits, warnings)
      !> The limits: [n_limit].
      type(validity_limit_type), intent(in) :: limits(:)
      !> The warnings: [n].
      type(note_type), allocatable, intent(inout) :: warnings(:)
      type(note_type) :: note
      integer :: i

      do i = 1, size(limits)
         note = get_limit_note(limits(i))
         if (note%code == '' .or. any(warnings%group == note%group .and. warnings%key == note%key &
            .and. warnings%quantity == note%quantity)) cycle
         warnings = [warnings, note]
      end do
   end subroutine add_limit_warnings

   !> Adds warnings on octaves of the standard in which the floor model is not valid, on a room of unusual height, and on a
   !> room that is not as large as the floor.
   subroutine add_floor_warnings(case, state, warnings)
      !> A case with a floor.
      type(case_type), intent(in) :: case
      !> The floor, prepared.
      type(floor_state_type), intent(in) :: state
      !> The warnings: [n].
      type(note_type), allocatable, intent(inout) :: warnings(:)
      type(box_type) :: room

      if (state%lowest_frequency > standard_band(1)) call add(warnings, 'outside_frequencies', case%floor, '', 'below ' &
         //fixed(state%lowest_frequency, 0)//' Hz '//trim(state%validity_reason))
      if (state%highest_frequency < standard_band(2)) call add(warnings, 'outside_frequencies', case%floor, '', 'above ' &
         //fixed(state%highest_frequency, 0)//' Hz '//trim(state%validity_reason))
      if (.not. case%has_room) return
      room = new_box(case%room, state%plate)
      call add_limit_warnings([validity_limit_type('room', 'height in m', room%sides(3), 2.0_wp, 6.0_wp, &
         'check volume, length and width', 'most rooms have')], warnings)
      associate (room_area => product(room%sides(:2)), area => state%plate%length*state%plate%width)
         if (abs(room_area/area - 1) > same_area) call add(warnings, 'room_area', 'room', '', 'a room of ' &
            //fixed(room_area, 1)//' m2 below a floor of '//fixed(area, 1)//' m2: only the part of the floor above the ' &
            //'room radiates into it')
      end associate
   end subroutine add_floor_warnings

   !> Adds a warning on a source that does not conform, for a case with a room.
   subroutine add_source_warning(criteria, warnings)
      !> Criteria of the force on the floor, octave levels first: [n].
      type(criterion_type), intent(in) :: criteria(:)
      !> The warnings: [n].
      type(note_type), allocatable, intent(inout) :: warnings(:)
      character(len=:), allocatable :: deviations
      integer :: i

      deviations = ''
      do i = 1, octave_count
         if (.not. conforms(criteria(i))) deviations = deviations//', '//trim(get_band_name(octaves(i)))//' Hz ' &
            //fixed(criteria(i)%value - (criteria(i)%lower + criteria(i)%upper)/2, 1)//' dB'
      end do
      if (deviations /= '') call add(warnings, 'source_not_conforming', 'room', '', 'the source does not conform (' &
         //deviations(3:)//' from the nominal levels): the level in the room is not that of a standard source')
   end subroutine add_source_warning

   !> Adds a warning on bands below the crossover that are statistical: their modes are not resolved, or would take too long.
   subroutine add_modes_warning(prediction, warnings)
      type(room_level_type), intent(in) :: prediction
      !> The warnings: [n].
      type(note_type), allocatable, intent(inout) :: warnings(:)

      associate (next => prediction%n_modal + 1)
         if (next > size(prediction%bands)) return
         if (prediction%bands(next)%center <= prediction%box%crossover) call add(warnings, 'statistical_bands', 'room', '', &
            'from '//trim(get_band_name(prediction%bands(next)))//' Hz on the level is statistical, below the frequency ' &
            //'at which three modes of the room overlap, '//fixed(prediction%box%crossover, 0)//' Hz')
      end associate
   end subroutine add_modes_warning

   !> Limits of density, modulus and Poisson's ratio of a ball of rubber: porous unfilled natural to highly filled rubber,
   !> gels to hard rubber, filled ones included.
   function get_rubber_limits(ball) result(limits)
      type(ball_type), intent(in) :: ball
      type(validity_limit_type) :: limits(3)

      limits = [validity_limit_type('ball', 'density of the wall in kg/m3', get_density(ball), 800.0_wp, 2200.0_wp, &
         'check mass, outer_radius and wall_thickness', 'rubbers have'), &
         validity_limit_type('ball', 'in Pa', ball%youngs_modulus, 1.0e4_wp, 3.0e9_wp, 'check the unit', &
         'rubbers have', 'youngs_modulus'), &
         validity_limit_type('ball', '', ball%poisson_ratio, lowest=0.45_wp, &
         reason='they hardly change their volume', subject='rubbers have', key='poisson_ratio')]
   end function get_rubber_limits

   !> Adds a warning on a loss factor that is not stated, with a damping law other than that of the standard ball.
   subroutine add_law_warning(case, warnings)
      type(case_type), intent(in), target :: case
      !> The warnings: [n].
      type(note_type), allocatable, intent(inout) :: warnings(:)
      type(field_type), allocatable :: active(:), fields(:)
      character(len=:), allocatable :: law
      integer :: i, j

      allocate (active, source=get_active_fields(case))
      allocate (fields, source=get_unstated_fields(case))
      do i = 1, size(fields)
         if (fields(i)%key /= 'loss_factor' .or. fields(i)%needs(1) == '') cycle
         j = findloc(active%owner == fields(i)%owner .and. active%key == fields(i)%needs(1), .true., dim=1)
         call active(j)%get_text(law)
         if (law /= quoted(fields(i)%needs(2))) call add(warnings, 'law_of_standard_ball', fields(i)%group, 'loss_factor', &
            '= '//to_text(fields(i)%get_number())//' is that of the standard ball with '//trim(fields(i)%needs(1))//' = ' &
            //quoted(fields(i)%needs(2))//'; state it for '//law)
      end do
   end subroutine add_law_warning

   !> Adds a warning without a value.
   pure subroutine add(warnings, code, group, key, text)
      !> The warnings: [n].
      type(note_type), allocatable, intent(inout) :: warnings(:)
      !> See `note_type`.
      character(len=*), intent(in) :: code, group, key, text

      warnings = [warnings, note_type(code, group, key, text=text)]
   end subroutine add

end module thud_warnings
