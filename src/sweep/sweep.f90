!> Many samples of a case, drops that differ in the values of some keys: quantities, levels and verdict of each sample.
!>
!> Samples of the shell model are computed in batches (`thud_ensemble`), all others one by one; threads share
!> the work. The results of a sample do not depend on the number of threads, the other samples or its index.
module thud_sweep
   use thud_band, only: band_type, get_level_bands
   use thud_band_projection, only: get_window_index, get_window_length
   use thud_cache_line, only: get_aligned_start, line_length
   use thud_case, only: case_type, check_case, get_active_fields, get_floor_number, keep_impact_only, set_floor_air
   use thud_column, only: column_type
   use thud_compute, only: assess_floor, compute_impact, drop_on_floor, impact_type, scope_type
   use thud_constants, only: not_a_number
   use thud_ensemble, only: fill_samples, get_record, projections_type, solve_drops, &
      suits_batch
   use thud_error, only: error_type, input_error
   use thud_field, only: check_fields, field_type, key_length
   use thud_floor_model, only: floor_state_type
   use thud_floor_result, only: floor_result_type
   use thud_force_history, only: force_count, force_history_type
   use thud_interrupt, only: check_interrupt, is_interrupted
   use thud_kinds, only: wp
   use thud_quantities, only: get_quantities, sample_quantity_count
   use thud_registry, only: floor_names
   use thud_result_column, only: get_result_columns, result_column_type, set_floor_values, set_source_values
   use thud_room, only: room_level_type
   use thud_sampling, only: check_sampling, get_sample_count
   use thud_shell_samples, only: block_size, get_blocks, sample_type
   use thud_source_limits, only: conforms, criterion_count, criterion_type, get_criteria
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: keep_matrices, new_sweep, solve_sweep, sweep_type

   !> The reason why a sample has no results.
   type :: reason_type
      !> A message; not allocated if the sample has results.
      character(len=:), allocatable :: text
   end type reason_type

   !> Results of many samples; a sample without results has NaN and does not conform.
   type :: sweep_type
      !> Levels and verdicts are wanted.
      logical :: levels = .true.
      !> Bands and matrices of the levels.
      type(projections_type), allocatable :: projections
      !> 0, or the error code: [n_sample].
      integer, allocatable :: status(:)
      !> Messages of the errors: [n_sample].
      type(reason_type), allocatable :: reason(:)
      !> Columns of the results: [n_column].
      type(result_column_type), allocatable :: columns(:)
      !> Their values, for a flag 0 or 1: [n_column, n_sample].
      real(wp), allocatable :: values(:, :)
      !> Forces, N; of size 0 if not wanted: [n_time, force_count, n_sample].
      real(wp), allocatable :: force(:, :, :)
   end type sweep_type

   !> What the samples of one thread share.
   type :: shared_type
      !> The drop on a rigid floor, and its error, if it failed.
      type(impact_type) :: impact
      type(error_type), allocatable :: error
      !> The floor, prepared.
      type(floor_state_type) :: floor
      !> They are those of an earlier sample with these values of the keys in which samples differ: [n_column].
      logical :: has_impact = .false., has_floor = .false.
      real(wp), allocatable :: values(:)
   end type shared_type

   !> Matrices of an earlier sweep, which take as long as some thousand drops; one thread at a time has them.
   type(projections_type), allocatable :: kept

contains

   !> Prepares for many samples of a case.
   subroutine new_sweep(case, levels, sweep)
      type(case_type), intent(in), target :: case
      !> Levels and verdicts are wanted.
      logical, intent(in) :: levels
      !> The sweep, with the matrices of an earlier one if they fit.
      type(sweep_type), intent(out) :: sweep
      type(band_type), allocatable :: bands(:)
      logical :: reuse
      ! Index of the first band that the case asks for; number of windows up to that of the longest record.
      integer :: first_band, n_window

      call get_level_bands(case%bands, bands, first_band)
      sweep%levels = levels
      sweep%columns = get_result_columns(case, bands, first_band)
      !$omp critical (thud_sweep)
      call move_alloc(kept, sweep%projections)
      !$omp end critical (thud_sweep)
      n_window = get_window_index(get_sample_count(case%sampling))
      reuse = allocated(sweep%projections)
      ! Choices of bands differ in their number.
      if (reuse) reuse = size(sweep%projections%window) == n_window .and. size(sweep%projections%bands) == size(bands) &
         .and. abs(sweep%projections%sample_rate - case%sampling%sample_rate) <= 0.0_wp
      if (reuse) return
      sweep%projections = projections_type(case%sampling%sample_rate, bands)
      allocate (sweep%projections%window(n_window))
   end subroutine new_sweep

   !> Leaves the matrices of a sweep to the next one.
   subroutine keep_matrices(sweep)
      !> The sweep, which computes no further samples.
      type(sweep_type), intent(inout) :: sweep

      !$omp critical (thud_sweep)
      call move_alloc(sweep%projections, kept)
      !$omp end critical (thud_sweep)
   end subroutine keep_matrices

   !> Computes samples.
   subroutine solve_sweep(case, columns, values, threads, forces, sweep, error)
      !> The case; it may be invalid if the values of the samples make it valid.
      type(case_type), intent(in), target :: case
      !> Keys in which the samples differ: [n_column].
      type(column_type), intent(in) :: columns(:)
      !> Values of the keys, as `get_number` returns them: [n_column, n_sample].
      real(wp), intent(in) :: values(:, :)
      integer, intent(in) :: threads
      !> Forces are wanted too.
      logical, intent(in) :: forces
      type(sweep_type), intent(inout) :: sweep
      !> Set if `check_samples` fails, there is not enough memory, or after an interrupt.
      type(error_type), allocatable, intent(out) :: error
      integer, allocatable :: remaining(:)
      character(len=128) :: message
      integer :: i, status

      call check_samples(case, columns, forces, error)
      if (allocated(error)) return
      if (allocated(sweep%force)) deallocate (sweep%force, sweep%status, sweep%reason)
      allocate (sweep%force(merge(get_sample_count(case%sampling), 0, forces), force_count, size(values, 2)), stat=status, &
         errmsg=message)
      if (status /= 0) then
         error = input_error('the forces of '//to_text(size(values, 2))//' samples have no space in memory; allowed: ' &
            //'fewer at a time')
         return
      end if
      allocate (sweep%status(size(values, 2)), sweep%reason(size(values, 2)))
      sweep%status = 1
      sweep%values = spread(merge(0.0_wp, not_a_number, sweep%columns%is_flag), 2, size(values, 2))
      if (suits_batch(case, columns)) call solve_batch(case, columns, values, threads, sweep, error)
      if (allocated(error)) return
      ! Those that fail in a batch are repeated one by one, for their error messages.
      remaining = pack([(i, i=1, size(values, 2))], sweep%status /= 0)
      !$omp parallel num_threads(threads) if (size(remaining) > 1)
      call solve_remaining()
      !$omp end parallel
      call check_interrupt(error)

   contains

      !> Computes the samples of one thread, one by one.
      subroutine solve_remaining()
         type(case_type), target :: thread_case
         type(shared_type) :: shared
         type(field_type), allocatable :: fields(:)
         integer :: i

         thread_case = case
         allocate (fields, source=get_active_fields(thread_case))
         call keep_impact_only(thread_case)
         ! No table has its numbers.
         thread_case%sampling%verify = .false.
         !$omp do schedule(dynamic)
         do i = 1, size(remaining)
            if (.not. is_interrupted()) call solve_sample(thread_case, fields, columns, values(:, remaining(i)), &
               remaining(i), shared, sweep)
         end do
         !$omp end do
      end subroutine solve_remaining

   end subroutine solve_sweep

   !> Returns an error if samples cannot be computed together.
   subroutine check_samples(case, columns, forces, error)
      type(case_type), intent(in), target :: case
      !> Keys in which the samples differ: [n_column].
      type(column_type), intent(in) :: columns(:)
      !> Forces are wanted.
      logical, intent(in) :: forces
      !> Set if the case has no impact, a key common to all samples is out of range, or forces are wanted but records may
      !> have different lengths.
      type(error_type), allocatable, intent(out) :: error
      type(field_type), allocatable :: fields(:)
      integer :: i

      if (.not. case%has_impact) then
         error = input_error('the case computes no impact; allowed: a case with &model')
         return
      end if
      allocate (fields, source=get_active_fields(case))
      ! Keys of the case that all samples share.
      call check_fields(pack(fields, fields%owner == '' .and. fields%group /= 'ball' .and. fields%group /= 'drop' &
         .and. [(all(columns%field /= i), i=1, size(fields))]), error)
      if (allocated(error) .or. .not. forces) return
      if (any(fields(columns%field)%key == 'duration' .or. fields(columns%field)%key == 'sample_rate')) then
         error = input_error('forces are wanted of samples with their own sampling; allowed: one sampling for all, ' &
            //'that of the case')
      else
         call check_sampling(case%sampling, error)
      end if
   end subroutine check_samples

   !> Computes one sample, not in a batch.
   subroutine solve_sample(case, fields, columns, values, sample, shared, sweep)
      !> The case; the keys of the columns are overwritten.
      type(case_type), intent(inout), target :: case
      !> Keys of the case: [n_field].
      type(field_type), intent(in) :: fields(:)
      !> Keys in which the samples differ: [n_column].
      type(column_type), intent(in) :: columns(:)
      !> Values of the keys for this sample: [n_column].
      real(wp), intent(in) :: values(:)
      !> Index of the sample.
      integer, intent(in) :: sample
      !> What an earlier sample of the same call has computed; afterwards also what this one has.
      type(shared_type), intent(inout) :: shared
      type(sweep_type), intent(inout) :: sweep
      type(scope_type) :: scope
      type(force_history_type), allocatable :: on_floor
      type(floor_result_type) :: floor
      type(room_level_type) :: room
      type(error_type), allocatable :: error
      integer :: i

      scope = scope_type(levels=sweep%levels, energies=.false., room=sweep%levels)
      do i = 1, size(columns)
         if (.not. allocated(error)) call fields(columns(i)%field)%set_number(values(i), columns(i)%entry, error)
      end do
      call set_floor_air(case)
      if (.not. allocated(error)) call check_case(case, error)
      if (.not. allocated(error)) call compute_shared(case, [(any(fields(columns(i)%field)%owner &
         == [character(len=key_length) :: 'floor', 'room', floor_names]), i=1, size(columns))], values, scope, shared, error)
      if (case%has_floor .and. .not. allocated(error)) call drop_on_floor(case, shared%floor, on_floor, error)
      if (.not. allocated(error)) call assess_floor(case, scope, shared%floor, shared%impact, on_floor, floor, room, error)
      sweep%status(sample) = 0
      if (allocated(error)) then
         sweep%status(sample) = error%code
         sweep%reason(sample)%text = error%message
         if (size(sweep%force) > 0) sweep%force(:, :, sample) = not_a_number
         return
      end if
      associate (history => shared%impact%history, assessment => shared%impact%assessment, &
         values => sweep%values(:, sample), quantity => get_quantities(shared%impact%history))
         if (sweep%levels) then
            call set_source_values(case, assessment%criteria(:, 1), quantity(:sample_quantity_count), assessment%level, &
               all(conforms(assessment%criteria), dim=1), values)
         else
            values(:sample_quantity_count) = quantity(:sample_quantity_count)
         end if
         if (case%has_floor) call set_floor_values(case, shared%impact, on_floor, floor, room, sweep%columns, values)
         if (size(sweep%force) > 0) then
            sweep%force(:, 1, sample) = history%elastic_force
            sweep%force(:, 2, sample) = history%floor_force
         end if
      end associate
   end subroutine solve_sample

   !> Computes the drop on a rigid floor, unless the sample before differs only in floor and room; prepares the floor, unless
   !> the sample before does not differ in floor and room.
   subroutine compute_shared(case, of_floor, values, scope, shared, error)
      !> The case of a sample, checked.
      type(case_type), intent(in) :: case
      !> Whether the keys in which samples differ are those of floor and room: [n_column].
      logical, intent(in) :: of_floor(:)
      !> Values of these keys: [n_column].
      real(wp), intent(in) :: values(:)
      type(scope_type), intent(in) :: scope
      type(shared_type), intent(inout) :: shared
      !> Set if the drop fails, or the floor cannot be prepared.
      type(error_type), allocatable, intent(out) :: error

      if (.not. allocated(shared%values)) shared%values = values
      associate (changed => .not. abs(values - shared%values) <= 0.0_wp)
         shared%has_impact = shared%has_impact .and. .not. any(changed .and. .not. of_floor)
         shared%has_floor = shared%has_floor .and. .not. any(changed .and. of_floor)
      end associate
      shared%values = values
      if (.not. shared%has_impact) then
         call compute_impact(case, scope, shared%impact, shared%error)
         shared%has_impact = .true.
      end if
      if (allocated(shared%error)) error = shared%error
      if (allocated(error) .or. shared%has_floor) return
      call case%floors(get_floor_number(case))%model%prepare(shared%floor, error)
      shared%has_floor = .not. allocated(error)
   end subroutine compute_shared

   !> Computes samples of the shell model in batches; threads share blocks of samples.
   subroutine solve_batch(case, columns, values, threads, sweep, error)
      type(case_type), intent(in), target :: case
      !> Keys in which the samples differ: [n_column].
      type(column_type), intent(in) :: columns(:)
      !> Values of the keys: [n_column, n_sample].
      real(wp), intent(in) :: values(:, :)
      integer, intent(in) :: threads
      !> The sweep; samples without results keep their status.
      type(sweep_type), intent(inout) :: sweep
      !> Set if the sampling is invalid, its records do not fit into memory, the source is unknown, or after an interrupt.
      type(error_type), allocatable, intent(out) :: error
      type(sample_type) :: samples(size(values, 2))
      type(criterion_type) :: criteria(criterion_count)
      logical :: valid(size(values, 2))
      integer, allocatable :: order(:), first(:)

      call check_sampling(case%sampling, error)
      if (.not. allocated(error)) call get_criteria(case%source, criteria, error)
      if (allocated(error)) return
      call fill_samples(case, columns, values, samples)
      call get_blocks(samples, valid, order, first)
      !$omp parallel num_threads(threads)
      call solve_blocks()
      !$omp end parallel

   contains

      !> Computes the blocks of one thread. Memory beyond the longest contact is never touched.
      subroutine solve_blocks()
         type(error_type), allocatable :: thread_error
         real(wp), allocatable :: block_values(:, :), force(:)
         character(len=128) :: message
         logical :: computed(block_size)
         integer :: i, j, n_row, n_time, n_written, start, status

         start = 1
         n_row = force_count*block_size
         n_time = get_window_length(size(sweep%projections%window))
         allocate (force(n_row*n_time + line_length), stat=status, errmsg=message)
         if (status /= 0) then
            thread_error = input_error('= '//to_text(case%sampling%duration)//' s at sample_rate = ' &
               //to_text(case%sampling%sample_rate)//' Hz gives the forces of '//to_text(block_size)//' samples no space ' &
               //'in memory; allowed: shorter records, or fewer threads', 'sampling', 'duration')
         else
            start = get_aligned_start(force)
         end if
         !$omp do schedule(dynamic)
         do i = 1, size(first) - 1
            if (.not. allocated(thread_error)) call check_interrupt(thread_error)
            if (allocated(thread_error)) cycle
            associate (indices => order(first(i):first(i + 1) - 1))
               block_values = sweep%values(:, indices)
               call solve_drops(case, samples(indices), criteria(:merge(criterion_count, 0, sweep%levels)), &
                  sweep%projections, force(start), n_written, computed(:size(indices)), block_values)
               do j = 1, size(indices)
                  if (.not. computed(j)) cycle
                  sweep%status(indices(j)) = 0
                  sweep%values(:, indices(j)) = block_values(:, j)
                  if (size(sweep%force) > 0) call store_forces(j, indices(j), n_written, force(start))
               end do
            end associate
         end do
         !$omp end do
         !$omp critical (thud_sweep_error)
         if (allocated(thread_error)) error = thread_error
         !$omp end critical (thud_sweep_error)
      end subroutine solve_blocks

      !> Stores the forces of a sample.
      subroutine store_forces(i, sample, n_written, force)
         !> Index of the sample in the block, and among all samples; number of instants that are set.
         integer, intent(in) :: i, sample, n_written
         !> Forces of the block, N: [force_count block_size, n_written].
         real(wp), intent(in) :: force(force_count*block_size, n_written)
         integer :: j

         do j = 1, force_count
            sweep%force(:, j, sample) = get_record(force, i, j, n_written, size(sweep%force, 1))
         end do
      end subroutine store_forces

   end subroutine solve_batch

end module thud_sweep
