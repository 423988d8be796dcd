!> The results of a case as a list of records. A group of records is a file or a group of `summary.nml` of the same name (see
!> `thud_record_files`), or for callers in other languages alone; names of columns end with units. Results on a mobile floor
!> are in groups that begin with `floor_`.
module thud_records
   use thud_band, only: band_type, octave_count
   use thud_bundle, only: bundle_type
   use thud_case, only: case_type
   use thud_compression, only: compression_type
   use thud_compute, only: assessment_type, get_assessed_force, impact_type, is_conforming, results_type
   use thud_constants, only: not_a_number
   use thud_floor_model, only: floor_state_type
   use thud_floor_result, only: floor_result_type
   use thud_force_history, only: force_count, force_history_type, force_names, motion_type
   use thud_free_modes, only: free_modes_type
   use thud_kinds, only: wp
   use thud_note, only: get_subject, note_type
   use thud_quantities, only: get_quantities, history_quantity_count, quantities
   use thud_rating, only: get_class, get_rounded, rating_names, rating_titles
   use thud_room, only: room_level_type
   use thud_room_uncertainty, only: contribution_names, judge_requirement
   use thud_source_limits, only: combine_verdicts, criterion_type, get_verdict, verdict_conforms, verdict_fails, &
      verdict_names
   use thud_text, only: to_text
   use thud_warnings, only: add_floor_warnings, add_modes_warning
   implicit none (type, external)
   private

   public :: add_compression, add_history, add_results, add_room_level, get_rating_title, get_verdict_word, has_class

contains

   !> Adds the results of a case.
   subroutine add_results(bundle, case, results)
      type(bundle_type), intent(inout) :: bundle
      type(case_type), intent(in) :: case
      type(results_type), intent(in) :: results

      if (case%has_modes) call add_modes(bundle, results%modes)
      if (case%has_impact) then
         bundle%group = 'summary'
         call bundle%add_text('case', trim(case%name))
         call bundle%add_text('model', trim(case%model))
         call add_history(bundle, '', results%impact%history)
      end if
      call add_warnings(bundle, 'warnings', results%warning)
      if (allocated(results%impact%assessment%bands)) call add_assessment(bundle, case, results%impact%assessment, &
         results%impact%history%numerical_error%known)
      if (allocated(results%on_floor)) then
         call add_history(bundle, 'floor_', results%on_floor, results%impact%history, results%floor)
         if (allocated(results%floor%conductance)) call add_floor_levels(bundle, results%impact, results%floor)
      end if
      if (allocated(results%room%bands)) call add_room_level(bundle, case, results%state, results%room)
      if (case%has_compression) call add_compression(bundle, results%compression)
   end subroutine add_results

   !> Adds warnings, if there are any.
   subroutine add_warnings(bundle, group, warnings)
      type(bundle_type), intent(inout) :: bundle
      character(len=*), intent(in) :: group
      !> The warnings: [n].
      type(note_type), intent(in) :: warnings(:)
      character(len=len(warnings%quantity) + len(warnings%text) + 1) :: text(size(warnings))
      integer :: i

      bundle%group = group
      if (size(warnings) == 0) return
      call bundle%add_texts('code', warnings%code)
      call bundle%add_texts('subject', get_subject(warnings))
      do i = 1, size(warnings)
         text(i) = adjustl(trim(warnings(i)%quantity)//' '//warnings(i)%text)
      end do
      call bundle%add_texts('text', text)
      call bundle%add_array('value', shape(warnings), warnings%value)
      call bundle%add_array('low', shape(warnings), warnings%low)
      call bundle%add_array('high', shape(warnings), warnings%high)
   end subroutine add_warnings

   !> Adds a force history: its quantities, those of the model, the columns against time, and snapshots.
   subroutine add_history(bundle, prefix, history, blocked, floor)
      type(bundle_type), intent(inout) :: bundle
      !> Beginning of the names of the groups.
      character(len=*), intent(in) :: prefix
      type(force_history_type), intent(in) :: history
      !> The same drop on a rigid floor.
      type(force_history_type), intent(in), optional :: blocked
      !> Results on a mobile floor.
      type(floor_result_type), intent(in), optional :: floor
      real(wp) :: values(history_quantity_count), time(size(history%floor_force))
      integer :: n(1)
      integer :: i

      n = size(time)
      time = [(real(i - 1, wp)/history%sample_rate, i=1, n(1))]
      bundle%group = prefix//'summary'
      values = get_quantities(history)
      do i = 1, history_quantity_count
         call bundle%add_number(quantities(i)%name, values(i), quantities(i)%unit)
      end do
      if (allocated(history%floor_velocity)) call bundle%add_number('floor_work', history%floor_work, 'J')
      bundle%group = prefix//'model_quantities'
      do i = 1, size(history%model_quantity)
         call bundle%add_number(history%model_quantity_name(i), history%model_quantity(i), history%model_quantity_unit(i))
      end do
      bundle%group = prefix//'force'
      call bundle%add_array('time_s', n, time)
      call bundle%add_array('deflection_m', n, history%deflection)
      call bundle%add_array('velocity_m_per_s', n, history%velocity)
      do i = 1, size(history%component_name)
         call bundle%add_array(trim(history%component_name(i))//'_N', n, history%component(:, i))
      end do
      call bundle%add_array('elastic_force_N', n, history%elastic_force)
      call bundle%add_array('floor_force_N', n, history%floor_force)
      if (present(blocked)) call bundle%add_array('blocked_force_N', n, blocked%floor_force)
      if (allocated(history%floor_velocity)) then
         call bundle%add_array('floor_displacement_m', n, history%floor_displacement)
         call bundle%add_array('floor_velocity_m_per_s', n, history%floor_velocity)
      end if
      if (present(floor)) then
         if (allocated(floor%point_velocity)) then
            do i = 1, size(floor%point_velocity, 2)
               call bundle%add_array('point_'//to_text(i)//'_velocity_m_per_s', n, floor%point_velocity(:, i))
            end do
         end if
      end if
      if (allocated(history%model_history)) then
         bundle%group = prefix//'model_histories'
         call bundle%add_array('time_s', n, time)
         do i = 1, size(history%model_history_name)
            call bundle%add_array(history%model_history_name(i), n, history%model_history(:, i))
         end do
      end if
      bundle%group = prefix//'snapshots'
      if (allocated(history%motion)) call add_motion(bundle, history%motion)
   end subroutine add_history

   !> Adds snapshots, with a row for each time and node. Line and ring count the nodes from the lowest point to the highest
   !> and from the inner surface to the outer; neighbors of both make the cells. Stresses act on the outer surface, the
   !> pressure of the gas on the inner one.
   subroutine add_motion(bundle, motion)
      type(bundle_type), intent(inout) :: bundle
      type(motion_type), intent(in) :: motion
      character(len=*), parameter :: names(*) = [character(len=24) :: 'time_s', 'line', 'ring', 'start_radius_m', &
         'start_height_m', 'radius_m', 'height_m', 'radial_velocity_m_per_s', 'upward_velocity_m_per_s', &
         'contact_pressure_Pa', 'contact_shear_Pa', 'cavity_pressure_Pa', 'floor_displacement_m']
      real(wp) :: row(size(names))
      real(wp), allocatable :: rows(:, :)
      integer :: i, j, k, at

      allocate (rows(motion%n_frame*size(motion%start)/2, size(names)))
      at = 0
      do k = 1, motion%n_frame
         do j = 1, size(motion%start, 2)
            do i = 1, size(motion%start, 1)
               associate (snapshot => motion%snapshot(k))
                  row = [snapshot%time, real(i, wp), real(j, wp), motion%start(i - 1, j - 1, :), &
                     snapshot%position(i - 1, j - 1, :), snapshot%velocity(i - 1, j - 1, :), &
                     snapshot%contact_stress(i, [2, 1]), snapshot%cavity_pressure, snapshot%floor_displacement]
               end associate
               if (j < size(motion%start, 2)) row(10:11) = 0.0_wp
               at = at + 1
               rows(at, :) = row
            end do
         end do
      end do
      do i = 1, size(names)
         call bundle%add_array(names(i), [size(rows, 1)], rows(:, i))
      end do
   end subroutine add_motion

   !> Adds free modes, and their shapes for callers.
   subroutine add_modes(bundle, modes)
      type(bundle_type), intent(inout) :: bundle
      type(free_modes_type), intent(in) :: modes
      integer :: n(1)
      integer :: i

      n = size(modes%frequency)
      bundle%group = 'modes'
      call bundle%add_array('mode', n, [(real(i, wp), i=1, n(1))], kind='whole')
      call bundle%add_array('harmonic', n, real(modes%harmonic, wp), kind='whole')
      call bundle%add_array('frequency_Hz', n, modes%frequency)
      call bundle%add_array('pole_participation', n, modes%participation)
      bundle%group = 'mode_shapes'
      call bundle%add_array('r', shape(modes%r), modes%r)
      call bundle%add_array('z', shape(modes%z), modes%z)
      call bundle%add_array('shape', shape(modes%shape), modes%shape)
   end subroutine add_modes

   !> Adds a quasi-static compression.
   subroutine add_compression(bundle, compression)
      type(bundle_type), intent(inout) :: bundle
      type(compression_type), intent(in) :: compression

      bundle%group = 'compression'
      call bundle%add_array('deflection_m', shape(compression%deflection), compression%deflection)
      call bundle%add_array('force_N', shape(compression%force), compression%force)
   end subroutine add_compression

   !> Adds the levels in the bands of the case, with limits and verdicts, and the verdict on all criteria.
   subroutine add_assessment(bundle, case, assessment, errors_are_known)
      type(bundle_type), intent(inout) :: bundle
      type(case_type), intent(in) :: case
      type(assessment_type), intent(in) :: assessment
      !> The numerical errors of the criteria are known.
      logical, intent(in) :: errors_are_known
      real(wp) :: limit(size(assessment%bands), 2)
      character(len=16) :: verdict(size(assessment%bands))
      integer :: i

      associate (criteria => assessment%criteria(:, get_assessed_force(case)), first => assessment%first_band, &
         bands => assessment%bands(assessment%first_band:))
         limit = not_a_number
         limit(:octave_count, 1) = criteria(:octave_count)%lower
         limit(:octave_count, 2) = criteria(:octave_count)%upper
         verdict = 'no limit'
         do i = 1, octave_count
            verdict(i) = get_verdict_word(criteria(i))
         end do
         bundle%group = 'levels'
         call add_bands(bundle, bands)
         do i = 1, force_count
            call bundle%add_array(trim(force_names(i))//'_level_dB', shape(bands), assessment%level(first:, i))
         end do
         call bundle%add_array('lower_limit_dB', shape(bands), limit(first:, 1))
         call bundle%add_array('upper_limit_dB', shape(bands), limit(first:, 2))
         call bundle%add_texts('verdict_'//trim(case%level_force), verdict(first:))
         bundle%group = 'verdict'
         call bundle%add_text('source', trim(case%source))
         call bundle%add_text('level_method', trim(case%level_method))
         call bundle%add_text('level_force', trim(case%level_force))
         call bundle%add_number('conforms', merge(1.0_wp, 0.0_wp, is_conforming(case, assessment)), kind='flag')
         call bundle%add_text('result', trim(verdict_names(combine_verdicts(get_verdict(criteria)))))
         call bundle%add_texts('criterion', criteria%name)
         call bundle%add_texts('unit', criteria%unit)
         call bundle%add_array('value', shape(criteria), criteria%value)
         call bundle%add_array('lower', shape(criteria), criteria%lower)
         call bundle%add_array('upper', shape(criteria), criteria%upper)
         call bundle%add_array('met', shape(criteria), merge(1.0_wp, 0.0_wp, get_verdict(criteria) &
            == verdict_conforms), kind='flag')
         if (errors_are_known) call bundle%add_array('numerical_error', shape(criteria), criteria%error)
      end associate
   end subroutine add_assessment

   !> Adds the names and edges of bands.
   subroutine add_bands(bundle, bands)
      type(bundle_type), intent(inout) :: bundle
      !> The bands: [n_band].
      type(band_type), intent(in) :: bands(:)

      call bundle%add_texts('bandwidth', bands%set)
      call bundle%add_array('nominal_Hz', shape(bands), bands%nominal)
      call bundle%add_array('lower_edge_Hz', shape(bands), bands%lower)
      call bundle%add_array('upper_edge_Hz', shape(bands), bands%upper)
   end subroutine add_bands

   !> Adds the levels of the forces on rigid and mobile floor, and the energies injected into the floor, in each band.
   subroutine add_floor_levels(bundle, impact, floor)
      type(bundle_type), intent(inout) :: bundle
      !> The drop on a rigid floor.
      type(impact_type), intent(in) :: impact
      type(floor_result_type), intent(in) :: floor

      bundle%group = 'floor_levels'
      call add_bands(bundle, floor%bands)
      associate (n => shape(floor%bands), contact => floor%contact_level, &
         blocked => impact%assessment%level(impact%assessment%first_band:, findloc(force_names, 'floor', dim=1)))
         call bundle%add_array('blocked_level_dB', n, blocked)
         call bundle%add_array('contact_level_dB', n, contact)
         call bundle%add_array('difference_dB', n, contact - blocked)
         call bundle%add_array('energy_J', n, floor%energy)
         call bundle%add_array('conductance_m_per_Ns', n, floor%conductance)
      end associate
   end subroutine add_floor_levels

   !> Adds the level in the room below and its ratings, with warnings on the floor for callers.
   subroutine add_room_level(bundle, case, state, room)
      type(bundle_type), intent(inout) :: bundle
      type(case_type), intent(in) :: case
      !> The floor, prepared.
      type(floor_state_type), intent(in) :: state
      type(room_level_type), intent(in) :: room
      type(note_type), allocatable :: warnings(:)
      integer :: n(1)
      integer :: i

      bundle%group = 'room'
      call bundle%add_number('surface_mass', room%surface_mass)
      call bundle%add_number('volume', room%box%volume)
      call bundle%add_number('n_modal', real(room%n_modal, wp))
      call bundle%add_number('crossover', room%box%crossover)
      call bundle%add_array('sides', [3], room%box%sides)
      bundle%group = 'room_levels'
      n = size(room%bands)
      call bundle%add_array('nominal_Hz', n, room%bands%nominal)
      call bundle%add_array('level_dB', n, room%level)
      call bundle%add_array('uncertainty_dB', n, room%uncertainty)
      call bundle%add_array('simple_level_dB', n, room%edge_level(:, 1))
      call bundle%add_array('clamped_level_dB', n, room%edge_level(:, 2))
      call bundle%add_array('energy_J', n, room%energy)
      call bundle%add_array('conductance_s_kg', n, room%conductance)
      call bundle%add_array('radiation_factor', n, room%radiation_factor)
      call bundle%add_array('loss_factor', n, room%loss_factor)
      call bundle%add_array('reverberation_time_s', n, room%box%reverberation_time)
      call bundle%add_array('direct_share', n, room%path_share(:, 1))
      do i = 2, size(room%path_share, 2)
         call bundle%add_array('wall_'//to_text(i - 1)//'_share', n, room%path_share(:, i))
      end do
      bundle%group = 'room_octaves'
      call bundle%add_array('nominal_Hz', shape(room%octaves), room%octaves%nominal)
      call bundle%add_array('level_dB', shape(room%octaves), room%octave_level)
      bundle%group = 'room_summary'
      call bundle%add_texts('rating', rating_names)
      call bundle%add_texts('meaning', [(get_rating_title(case, i), i=1, size(rating_names))])
      call bundle%add_array('level', shape(room%rating), room%rating, 'dB')
      call bundle%add_number('uncertainty', room%rating_uncertainty, 'dB, standard')
      call bundle%add_array('rounded', shape(room%rating), real(get_rounded(room%rating), wp), 'dB')
      if (has_class(case, room)) call bundle%add_number('class', real(get_class(room%rating(1)), wp), &
         'of octaves, KS F 2863-2; 0: none', 'whole')
      call bundle%add_texts('contribution', contribution_names)
      call bundle%add_array('contributed', shape(room%contribution), room%contribution, 'dB')
      if (case%room%required > 0.0_wp) then
         call bundle%add_number('required', case%room%required, 'dB')
         call bundle%add_text('required_rating', trim(case%room%rating))
         call bundle%add_number('probability', room%probability, 'that it is met')
         call bundle%add_text('verdict', trim(verdict_names(judge_requirement(room))))
      end if
      allocate (warnings(0))
      call add_floor_warnings(case, state, warnings)
      call add_modes_warning(room, warnings)
      call add_warnings(bundle, 'room_warnings', warnings)
   end subroutine add_room_level

   !> Title of a rating; the standards are for the ball.
   pure function get_rating_title(case, rating) result(title)
      type(case_type), intent(in) :: case
      !> Index of the rating.
      integer, intent(in) :: rating
      character(len=len(rating_titles)) :: title

      title = rating_titles(rating)
      if (case%source /= 'rubber_ball') title = 'A-weighted level ('//trim(rating_names(rating))//')'
   end function get_rating_title

   !> Whether the class of KS F 2863-2 is stated: that of a rubber ball that conforms.
   pure function has_class(case, room) result(yes)
      type(case_type), intent(in) :: case
      type(room_level_type), intent(in) :: room
      logical :: yes

      yes = room%source_conforms .and. case%source == 'rubber_ball'
   end function has_class

   !> Verdict on one value: `conforms`, `too low` or `too high`, or `undecided` by its numerical error.
   pure function get_verdict_word(criterion) result(word)
      type(criterion_type), intent(in) :: criterion
      character(len=16) :: word

      word = verdict_names(get_verdict(criterion))
      if (get_verdict(criterion) == verdict_fails) word = merge('too low ', 'too high', criterion%value < criterion%lower)
   end function get_verdict_word

end module thud_records
