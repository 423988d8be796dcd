!> Computes all results that a case asks for: free modes, quasi-static compression, the drop on a rigid floor with its levels
!> and criteria, the drop on the floor of the case, the level in the room below, and warnings. It reads and writes no files.
module thud_compute
   !$ use omp_lib, only: omp_get_max_threads
   use thud_band, only: band_type, get_level_bands, octave_count
   use thud_case, only: case_type, get_floor_number, get_model_number, get_modes_ball
   use thud_compression, only: compression_type, compute_compression
   use thud_error, only: error_type
   use thud_floor_model, only: floor_state_type
   use thud_floor_result, only: floor_result_type, get_floor_result
   use thud_force_exposure, only: get_force_exposure_levels
   use thud_force_history, only: force_count, force_history_type, force_names
   use thud_free_modes, only: free_modes_type, get_free_modes
   use thud_interrupt, only: is_forked
   use thud_kinds, only: wp
   use thud_memory, only: require_memory
   use thud_note, only: note_type
   use thud_receiver, only: is_rigid
   use thud_refined_drop, only: solve_drop
   use thud_room, only: room_level_type
   use thud_room_prediction, only: predict_room
   use thud_sampling, only: get_sample_count
   use thud_source_limits, only: combine_verdicts, conforms, criterion_count, criterion_type, get_criteria, get_peak_count, &
      get_verdict, verdict_conforms
   use thud_warnings, only: add_modes_warning, add_source_warning, get_warnings
   implicit none (type, external)
   private

   public :: assess_floor, assessment_type, compute, compute_impact, drop_on_floor, get_assessed_force
   public :: impact_type, is_conforming, results_type, scope_type

   !> Memory per sample of a record, including transforms and text, bytes; measured.
   real(wp), parameter :: sample_memory = 600.0_wp

   !> Which of the results that a case asks for are computed.
   type :: scope_type
      !> Levels and criteria.
      logical :: levels = .true.
      !> Energy injected into a mobile floor, and velocities of points of the floor.
      logical :: energies = .true.
      !> Level in the room below.
      logical :: room = .true.
   end type scope_type

   !> Levels and criteria of an impact.
   type :: assessment_type
      !> Bands of the levels, octaves first: [n_band].
      type(band_type), allocatable :: bands(:)
      !> Index of the first band that the case asks for.
      integer :: first_band = 1
      !> Levels of the forces in `force_names`, dB: [n_band, force_count].
      real(wp), allocatable :: level(:, :)
      !> Criteria of these forces, octave levels first: [criterion_count, force_count].
      type(criterion_type) :: criteria(criterion_count, force_count)
   end type assessment_type

   !> The drop on a rigid floor.
   type :: impact_type
      type(force_history_type) :: history
      type(assessment_type) :: assessment
   end type impact_type

   !> Results of a case; only those that it asks for are set.
   type :: results_type
      !> The drop on a rigid floor.
      type(impact_type) :: impact
      !> The floor, prepared if the case has one.
      type(floor_state_type) :: state
      !> The drop on a mobile floor, if the model couples with it.
      type(force_history_type), allocatable :: on_floor
      !> Levels and energies of the drop on the mobile floor.
      type(floor_result_type) :: floor
      type(free_modes_type) :: modes
      !> Level in the room below.
      type(room_level_type) :: room
      !> Quasi-static compression.
      type(compression_type) :: compression
      !> Warnings on implausible input or results: [n_warning].
      type(note_type), allocatable :: warning(:)
   end type results_type

contains

   !> Computes all results that a case asks for.
   subroutine compute(case, scope, results, error)
      !> The case, checked.
      type(case_type), intent(in) :: case
      type(scope_type), intent(in) :: scope
      type(results_type), intent(out) :: results
      type(error_type), allocatable, intent(out) :: error

      if (case%has_impact) call require_memory(sample_memory*get_sample_count(case%sampling), &
         '&sampling: so many samples', 'a lower sample_rate or duration', error)
      if (case%has_modes .and. .not. allocated(error)) call get_free_modes(get_modes_ball(case), case%modes%count, &
         results%modes, error)
      if (case%has_compression .and. .not. allocated(error)) call compute_compression(case%compression, case%ball, &
         case%models(get_model_number(case))%model, results%compression, error)
      if (case%has_impact .and. .not. allocated(error)) call compute_drops(case, scope, results%state, results%impact, &
         results%on_floor, error)
      if (case%has_impact .and. .not. allocated(error)) call assess_floor(case, scope, results%state, results%impact, &
         results%on_floor, results%floor, results%room, error)
      if (.not. allocated(error)) call get_warnings(case, results%state, results%impact%history, results%warning, &
         results%on_floor)
      if (case%has_impact .and. case%has_room .and. scope%room .and. scope%levels .and. .not. allocated(error)) then
         associate (criteria => results%impact%assessment%criteria(:, findloc(force_names == 'floor', .true., dim=1)))
            results%room%source_conforms = all(conforms(criteria(:octave_count)))
            call add_modes_warning(results%room, results%warning)
            call add_source_warning(criteria, results%warning)
         end associate
      end if
   end subroutine compute

   !> The drop of a case on a rigid floor, and its assessment.
   subroutine compute_impact(case, scope, impact, error)
      !> The case, checked.
      type(case_type), intent(in) :: case
      type(scope_type), intent(in) :: scope
      type(impact_type), intent(out) :: impact
      type(error_type), allocatable, intent(out) :: error

      call solve_drop(case%models(get_model_number(case))%model, case%ball, case%drop, case%sampling, impact%history, error)
      if (scope%levels .and. .not. allocated(error)) call assess(case, impact%history, impact%assessment, error)
   end subroutine compute_impact

   !> The drops of a case on a rigid floor and on its own, at the same time if two threads are allowed.
   subroutine compute_drops(case, scope, state, impact, on_floor, error)
      !> The case, checked.
      type(case_type), intent(in) :: case
      type(scope_type), intent(in) :: scope
      !> Its floor, prepared if it has one.
      type(floor_state_type), intent(out) :: state
      type(impact_type), intent(out) :: impact
      !> The drop on the floor; not allocated if the floor is rigid or the model does not couple with it.
      type(force_history_type), allocatable, intent(out) :: on_floor
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: floor_error
      integer :: i, n_thread

      ! Two tasks: the drop on a rigid floor, from which verdict, warnings and class follow also where there is a floor, and
      ! the floor with the drop on it, from which the level in the room below follows.
      n_thread = 1
      !$ if (case%has_floor .and. is_forked == 0) n_thread = min(2, omp_get_max_threads())
      !$omp parallel do num_threads(n_thread) schedule(static, 1)
      do i = 1, 2
         if (i == 1) then
            call compute_impact(case, scope, impact, error)
         else if (n_thread == 2 .or. .not. allocated(error)) then
            call case%floors(get_floor_number(case))%model%prepare(state, floor_error)
            if (.not. allocated(floor_error)) call drop_on_floor(case, state, on_floor, floor_error)
         end if
      end do
      !$omp end parallel do
      if (.not. allocated(error)) call move_alloc(floor_error, error)
   end subroutine compute_drops

   !> Levels and energies of the drop on the floor and the level in the room below, if the case asks for them.
   subroutine assess_floor(case, scope, state, impact, on_floor, floor, room, error)
      !> The case, checked.
      type(case_type), intent(in) :: case
      type(scope_type), intent(in) :: scope
      !> Its floor, prepared if it has one.
      type(floor_state_type), intent(in) :: state
      !> The drop on a rigid floor.
      type(impact_type), intent(in) :: impact
      !> The drop on the floor; not allocated if the floor is rigid or the model does not couple with it.
      type(force_history_type), allocatable, intent(in) :: on_floor
      type(floor_result_type), intent(out) :: floor
      type(room_level_type), intent(out) :: room
      type(error_type), allocatable, intent(out) :: error

      if (allocated(on_floor) .and. scope%levels) call get_floor_result(case, state, on_floor, scope%energies, floor, error)
      if (allocated(error) .or. .not. (case%has_room .and. scope%room)) return
      if (allocated(on_floor)) then
         call predict_room(case, state, on_floor%floor_force, on_floor%sample_rate, room, error)
      else
         call predict_room(case, state, impact%history%floor_force, impact%history%sample_rate, room, error)
      end if
   end subroutine assess_floor

   !> The drop of a case on its floor.
   subroutine drop_on_floor(case, state, on_floor, error)
      type(case_type), intent(in) :: case
      !> The floor, prepared.
      type(floor_state_type), intent(in) :: state
      !> The drop on the floor; not allocated if the floor is rigid or the model does not couple with it.
      type(force_history_type), allocatable, intent(out) :: on_floor
      type(error_type), allocatable, intent(out) :: error

      if (is_rigid(state%receiver)) return
      allocate (on_floor)
      call solve_drop(case%models(get_model_number(case))%model, case%ball, case%drop, case%sampling, on_floor, error, &
         state%receiver)
      ! A model that ignores the receiver has computed the drop on a rigid floor.
      if (.not. allocated(on_floor%floor_velocity)) deallocate (on_floor)
   end subroutine drop_on_floor

   !> Levels and criteria of the force history of a case, for both forces.
   subroutine assess(case, history, assessment, error)
      type(case_type), intent(in) :: case
      type(force_history_type), intent(in) :: history
      type(assessment_type), intent(out) :: assessment
      !> Set if a level cannot be computed.
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: force(:)
      integer :: i

      call get_level_bands(case%bands, assessment%bands, assessment%first_band)
      allocate (assessment%level(size(assessment%bands), force_count))
      do i = 1, force_count
         associate (level => assessment%level(:, i), criteria => assessment%criteria(:, i))
            force = history%elastic_force
            if (force_names(i) == 'floor') force = history%floor_force
            ! In most models both forces are equal.
            if (i > 1 .and. .not. any(abs(force - history%elastic_force) > 0.0_wp)) then
               level = assessment%level(:, 1)
               criteria = assessment%criteria(:, 1)
               cycle
            end if
            call get_force_exposure_levels(force, history%sample_rate, assessment%bands, trim(case%level_method), level, &
               error)
            if (.not. allocated(error)) call get_criteria(case%source, criteria, error)
            if (allocated(error)) return
            criteria%value = [level(:octave_count), history%contact_time, history%restitution, &
               real(get_peak_count(force, history%sample_rate), wp), case%ball%mass, case%drop%height]
            criteria(:octave_count + 2)%error = [history%numerical_error%octave, history%numerical_error%contact_time, &
               history%numerical_error%restitution]
         end associate
      end do
   end subroutine assess

   !> Index of the assessed force.
   pure function get_assessed_force(case) result(index)
      type(case_type), intent(in) :: case
      !> Index in `force_names`.
      integer :: index

      index = findloc(force_names == case%level_force, .true., dim=1)
   end function get_assessed_force

   !> Whether the source of a case conforms, whatever the numerical errors of its values.
   pure function is_conforming(case, assessment) result(yes)
      type(case_type), intent(in) :: case
      type(assessment_type), intent(in) :: assessment
      !> The assessed force meets all criteria.
      logical :: yes

      yes = combine_verdicts(get_verdict(assessment%criteria(:, get_assessed_force(case)))) == verdict_conforms
   end function is_conforming

end module thud_compute
