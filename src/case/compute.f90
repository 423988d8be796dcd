!> Computes a case: free modes, slow compression, the force history of its model, levels and verdict. It knows no files.
module thud_compute
   use thud_band, only: band_type, get_level_bands, octave_count
   use thud_case, only: case_type, check_case, get_floor_number, get_model_number
   use thud_compression, only: compression_type, get_deflections, get_pressed_ball
   use thud_error, only: error_type
   use thud_floor_result, only: floor_result_type
   use thud_force_exposure, only: get_force_exposure_levels
   use thud_force_history, only: force_count, force_history_type, force_names
   use thud_free_modes, only: free_modes_type, get_free_modes
   use thud_kinds, only: wp
   use thud_memory, only: require_memory
   use thud_plate, only: plate_type
   use thud_receiver, only: is_rigid, receiver_type
   use thud_remarks, only: get_remarks, remark_length
   use thud_room, only: check_below, get_room_bands, get_room_level, room_level_type
   use thud_sampling, only: get_sample_count
   use thud_source_limits, only: conforms, criterion_count, criterion_type, get_criteria, get_peak_count, &
      get_source_limits, source_limits_type
   implicit none (type, external)
   private

   public :: compress_case, compute_case, drop_on_floor, get_cost, get_judged_force, is_conforming, judge_case, predict_room
   public :: predict_room_level, results_type, verdict_type

   !> Memory that a sample of a record takes, its transforms and text included, bytes; measured.
   real(wp), parameter :: sample_memory = 600.0_wp

   !> Levels and criteria of an impact.
   type :: verdict_type
      !> Bands of the levels, the octaves first: [n_band].
      type(band_type), allocatable :: bands(:)
      !> Number of the first band that the case asks for.
      integer :: first_band = 1
      !> Levels, dB: [n_band, force_count].
      real(wp), allocatable :: level(:, :)
      !> Criteria, the octaves first: [criterion_count, force_count].
      type(criterion_type) :: criteria(criterion_count, force_count)
   end type verdict_type

   !> Results of a case.
   type :: results_type
      !> The force, where an impact is asked for.
      type(force_history_type) :: history
      !> Its levels and verdict.
      type(verdict_type) :: verdict
      !> The force on a floor that moves, where one is asked for and the model couples with it.
      type(force_history_type), allocatable :: on_floor
      !> What it makes of the floor.
      type(floor_result_type) :: floor
      !> Free modes, where they are asked for.
      type(free_modes_type) :: modes
      !> Level in the room below, where it is asked for.
      type(room_level_type) :: room
      !> Slow compression, where it is asked for.
      type(compression_type) :: compression
      !> What is possible but not plausible: [n_remark].
      character(len=remark_length), allocatable :: remark(:)
   end type results_type

contains

   !> Computes what a case asks for, without levels and verdict.
   subroutine compute_case(case, results, error)
      !> The case, checked.
      type(case_type), intent(in) :: case
      type(results_type), intent(out) :: results
      !> A computation failed.
      type(error_type), allocatable, intent(out) :: error

      if (case%has_impact) call require_memory(sample_memory*get_sample_count(case%sampling), &
         '&sampling: so many samples', 'a lower sample_rate or duration', error)
      if (case%has_modes .and. .not. allocated(error)) call get_free_modes(case%ball, case%modes%mesh, case%modes%count, &
         results%modes, error)
      if (case%has_compression .and. .not. allocated(error)) call compress_case(case, results%compression, error)
      if (allocated(error)) return
      if (case%has_impact) then
         associate (model => case%models(get_model_number(case))%model)
            call model%solve(case%ball, case%drop, case%sampling, results%history, error)
         end associate
      end if
      if (allocated(error)) return
      if (case%has_impact .and. case%has_floor) call drop_on_floor(case, results%on_floor, error)
      if (.not. allocated(error)) call get_remarks(case, results%history, results%remark, results%on_floor)
   end subroutine compute_case

   !> The drop of a case on its floor.
   subroutine drop_on_floor(case, on_floor, error)
      type(case_type), intent(in) :: case
      !> The history; not allocated where the floor is rigid, or the model's force is the blocked one.
      type(force_history_type), allocatable, intent(out) :: on_floor
      !> The computation failed.
      type(error_type), allocatable, intent(out) :: error
      type(receiver_type) :: receiver

      associate (model => case%models(get_model_number(case))%model, floor => case%floors(get_floor_number(case))%model)
         if (.not. model%couples()) return
         call floor%get_receiver(receiver, error)
         if (allocated(error)) return
         if (is_rigid(receiver)) return
         allocate (on_floor)
         call model%solve(case%ball, case%drop, case%sampling, on_floor, error, receiver)
      end associate
      ! Models that leave the receiver alone have dropped on a rigid floor.
      if (.not. allocated(on_floor%floor_velocity)) deallocate (on_floor)
   end subroutine drop_on_floor

   !> Approximate time of the drop of a case and its levels on one core, s.
   function get_cost(case) result(cost)
      type(case_type), intent(in) :: case
      !> The time, s; of a case that is refused that of the refusal.
      real(wp) :: cost
      type(error_type), allocatable :: error
      type(receiver_type) :: receiver

      cost = 1.0e-3_wp
      call check_case(case, error)
      if (allocated(error)) return
      associate (model => case%models(get_model_number(case))%model)
         cost = cost + model%get_cost(case%ball, case%sampling)
         if (.not. (case%has_floor .and. model%couples())) return
         call case%floors(get_floor_number(case))%model%get_receiver(receiver, error)
         if (allocated(error) .or. is_rigid(receiver)) return
         cost = cost + 1.0e-3_wp + model%get_cost(case%ball, case%sampling, receiver)
      end associate
   end function get_cost

   !> Slow compression of the ball of a case by its model.
   subroutine compress_case(case, compression, error)
      type(case_type), intent(in) :: case
      type(compression_type), intent(out) :: compression
      !> The model has none, or the ball cannot be pressed so far.
      type(error_type), allocatable, intent(out) :: error

      allocate (compression%deflection, source=get_deflections(case%compression))
      allocate (compression%force, mold=compression%deflection)
      associate (model => case%models(get_model_number(case))%model)
         call model%compress(get_pressed_ball(case%compression, case%ball), compression%deflection, compression%force, error)
      end associate
   end subroutine compress_case

   !> Levels and criteria of the force history of a case.
   subroutine judge_case(case, history, verdict, error)
      type(case_type), intent(in) :: case
      type(force_history_type), intent(in) :: history
      !> Levels and criteria of both forces.
      type(verdict_type), intent(out) :: verdict
      !> A level cannot be computed.
      type(error_type), allocatable, intent(out) :: error

      call get_level_bands(case%bands, verdict%bands, verdict%first_band)
      allocate (verdict%level(size(verdict%bands), force_count))
      call judge_force(case, history, history%elastic_force, verdict%bands, verdict%level(:, 1), verdict%criteria(:, 1), &
         error)
      if (allocated(error)) return
      ! Most models have the same force twice.
      if (any(abs(history%floor_force - history%elastic_force) > 0.0_wp)) then
         call judge_force(case, history, history%floor_force, verdict%bands, verdict%level(:, 2), verdict%criteria(:, 2), &
            error)
      else
         verdict%level(:, 2) = verdict%level(:, 1)
         verdict%criteria(:, 2) = verdict%criteria(:, 1)
      end if
   end subroutine judge_case

   !> Levels and criteria of one force.
   subroutine judge_force(case, history, force, bands, level, criteria, error)
      type(case_type), intent(in) :: case
      type(force_history_type), intent(in) :: history
      !> The force, N: [n_sample].
      real(wp), intent(in) :: force(:)
      !> The bands, octaves first: [n_band].
      type(band_type), intent(in) :: bands(:)
      !> Levels, dB: [n_band].
      real(wp), intent(out) :: level(:)
      !> The criteria: [criterion_count].
      type(criterion_type), intent(out) :: criteria(:)
      !> A level cannot be computed.
      type(error_type), allocatable, intent(out) :: error
      type(source_limits_type) :: limits

      call get_source_limits(case%source, limits, error)
      if (allocated(error)) return
      call get_force_exposure_levels(force, history%sample_rate, bands, trim(case%level_method), level, error)
      if (allocated(error)) return
      criteria = get_criteria(limits, level(:octave_count), history%contact_time, history%restitution, &
         get_peak_count(force, history%sample_rate), case%ball%mass, case%drop%height)
   end subroutine judge_force

   !> Level that a force causes in the room below.
   subroutine predict_room(case, force, sample_rate, prediction, error)
      !> The case, with floor and room.
      type(case_type), intent(in) :: case
      !> Force on the floor, N: [n_sample].
      real(wp), intent(in) :: force(:)
      !> Samples per second, Hz.
      real(wp), intent(in) :: sample_rate
      type(room_level_type), intent(out) :: prediction
      !> A level cannot be computed.
      type(error_type), allocatable, intent(out) :: error
      type(band_type), allocatable :: bands(:)
      real(wp), allocatable :: level(:)

      call get_room_bands(bands, error)
      if (allocated(error)) return
      allocate (level(size(bands)))
      call get_force_exposure_levels(force, sample_rate, bands, trim(case%level_method), level, error)
      if (.not. allocated(error)) call predict_room_level(case, bands, level, prediction, error)
   end subroutine predict_room

   !> Level that force exposure levels cause in the room below.
   subroutine predict_room_level(case, bands, level, prediction, error)
      !> The case, with floor and room.
      type(case_type), intent(in) :: case
      !> Thirds of `get_room_bands`, and levels of the force on the floor in them, dB: [n_band].
      type(band_type), intent(in) :: bands(:)
      real(wp), intent(in) :: level(:)
      type(room_level_type), intent(out) :: prediction
      !> The floor radiates into no room.
      type(error_type), allocatable, intent(out) :: error
      type(plate_type) :: plate
      real(wp) :: conductance(size(bands))

      associate (floor => case%floors(get_floor_number(case))%model)
         call floor%get_radiator(bands%centre, plate, conductance, error)
      end associate
      if (.not. allocated(error)) call check_below(plate, case%room, error)
      if (.not. allocated(error)) call get_room_level(plate, conductance, case%room, bands, level, prediction)
   end subroutine predict_room_level

   !> Number of the force that the verdict is on.
   pure function get_judged_force(case) result(number)
      type(case_type), intent(in) :: case
      !> Its place in `force_names`.
      integer :: number

      number = findloc(force_names == case%level_force, .true., dim=1)
   end function get_judged_force

   !> Whether the source of a case conforms.
   pure function is_conforming(case, verdict) result(yes)
      type(case_type), intent(in) :: case
      type(verdict_type), intent(in) :: verdict
      !> All criteria of the judged force are met.
      logical :: yes

      yes = all(conforms(verdict%criteria(:, get_judged_force(case))))
   end function is_conforming

end module thud_compute
