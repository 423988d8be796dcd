!> Many drops of a case that differ in the values of some keys: outcomes, levels and verdicts of each.
!>
!> Drops of the shell model are computed in batches (`thud_ensemble`), all others one by one; threads share
!> them. No number of a drop depends on the threads, on the other drops or on its place among them.
module thud_many
   use thud_band, only: band_type, get_level_bands, octave_count
   use thud_batch_sets, only: fill_sets, suits_batch
   use thud_blocked_drop, only: blocked_type, solve_blocked
   use thud_case, only: case_type, check_case, get_active_fields, get_model_number
   use thud_column, only: column_type
   use thud_compute, only: get_cost, get_judged_force
   use thud_ensemble, only: are_alike, new_projections, projections_type, solve_ensemble
   use thud_error, only: error_type, input_error
   use thud_field, only: check_fields, field_type
   use thud_force_history, only: force_count, get_scalars, outcome_count
   use thud_further_results, only: further_length, get_further_names, solve_further
   use thud_interrupt, only: check_interrupt, is_interrupted
   use thud_kinds, only: wp
   use thud_power, only: not_a_number
   use thud_sampling, only: check_sampling, get_sample_count, get_step_count
   use thud_shell_sets, only: set_outcome_type, set_type
   use thud_source_limits, only: conforms, get_source_limits, source_limits_type
   use thud_source_model, only: typical_contact
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: leave_many, many_type, new_many, solve_many, take_many

   !> Approximate time of one step in a batch, s.
   real(wp), parameter :: batch_cost = 1.5e-8_wp

   !> Why a drop has no results.
   type :: reason_type
      !> A sentence; not allocated where it has results.
      character(len=:), allocatable :: text
   end type reason_type

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
      character(len=further_length), allocatable :: further_name(:)
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
      many%cost = get_cost(case)
      if (size(columns) > 0 .and. suits_batch(case, columns)) many%cost = batch_cost*get_step_count(case%sampling, &
         typical_contact)
      many%further_name = get_further_names(case, many%bands(many%first_band:))
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
      if (.not. allocated(error)) call solve_blocked(case, fields, many%judged, blocked, error)
      if (case%has_floor .and. .not. allocated(error)) call solve_further(case, blocked%history, &
         many%bands(many%first_band:), many%judged, many%further(:, drop), error)
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

end module thud_many
