!> Many drops of the shell model: threads share blocks of samples, and the levels of a block are computed while
!> its forces are in cache.
!>
!> The results of a sample do not depend on the number of threads, the other samples or its index: they come from its
!> own column in arrays of fixed shape or, for levels of a long contact, from its own record.
module thud_ensemble
   use thud_band, only: band_type, get_octaves, octave_count
   use thud_band_projection, only: band_projection_type, get_band_energies, get_window_length, get_window_index, &
      is_projection_fast, new_band_projection
   use thud_cache_line, only: get_aligned_start, line_length
   use thud_constants, only: reference_force, reference_time
   use thud_error, only: error_type, input_error, numerical_error
   use thud_force_exposure, only: get_force_exposure_levels
   use thud_force_history, only: force_count
   use thud_interrupt, only: check_interrupt
   use thud_kinds, only: wp
   use thud_power, only: not_a_number
   use thud_sampling, only: check_sampling, get_sample_count, sampling_type
   use thud_shell_samples, only: block_size, get_blocks, sample_outcome_type, sample_type, solve_block
   use thud_source_limits, only: conforms, criterion_count, criterion_type, get_criteria, get_peak_count, &
      get_source_limits, source_limits_type
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: are_alike, new_projections, projections_type, solve_ensemble

   !> Matrices that give the levels, one per window length, computed when first needed; `thud_band_projection` explains
   !> windows and folding.
   type :: projections_type
      !> Samples per second, Hz.
      real(wp) :: sample_rate = 0.0_wp
      !> Bands of the levels, octaves first: [n_band].
      type(band_type), allocatable :: bands(:)
      !> The matrices: [n_window].
      type(band_projection_type), allocatable :: window(:)
   end type projections_type

   !> Workspace of one thread.
   type :: workspace_type
      !> Forces, N, with space for alignment: [2 block_size n_time + line_length].
      real(wp), allocatable :: force(:)
      !> Folded forces, N: [2 block_size n_time].
      real(wp), allocatable :: folded(:)
      !> Index of the last force sample that is not zero.
      integer :: n_written = 0
      !> Criteria, with the values of one sample at a time.
      type(criterion_type) :: criteria(criterion_count)
      !> Error that stops the thread.
      type(error_type), allocatable :: error
   end type workspace_type

contains

   !> The projections, still without matrices.
   pure function new_projections(sample_rate, bands, n_time) result(projections)
      !> Samples per second, Hz.
      real(wp), intent(in) :: sample_rate
      !> Bands in addition to the octaves: [n_more].
      type(band_type), intent(in) :: bands(:)
      !> Number of samples of the longest record.
      integer, intent(in) :: n_time
      type(projections_type) :: projections

      projections%sample_rate = sample_rate
      allocate (projections%bands(octave_count + size(bands)))
      projections%bands(:octave_count) = get_octaves()
      projections%bands(octave_count + 1:) = bands
      allocate (projections%window(get_window_index(n_time)))
   end function new_projections

   !> Whether two sets of matrices are interchangeable: same rate, bands and longest window.
   pure function are_alike(first, other) result(alike)
      type(projections_type), intent(in) :: first
      !> The other, which may be empty.
      type(projections_type), intent(in) :: other
      logical :: alike

      alike = .false.
      if (.not. allocated(other%window)) return
      alike = size(first%window) == size(other%window) .and. size(first%bands) == size(other%bands)
      if (.not. alike) return
      alike = abs(first%sample_rate - other%sample_rate) <= 0.0_wp .and. all(first%bands%set == other%bands%set)
   end function are_alike

   !> Computes quantities, levels and verdicts of all samples.
   subroutine solve_ensemble(samples, sampling, source, threads, with_levels, projections, computed, quantity, levels, met, &
      forces, error)
      !> The samples: [n_sample].
      type(sample_type), intent(in) :: samples(:)
      type(sampling_type), intent(in) :: sampling
      !> Source whose limits apply.
      character(len=*), intent(in) :: source
      integer, intent(in) :: threads
      !> Compute levels and verdicts; otherwise levels are NaN and no sample conforms.
      logical, intent(in) :: with_levels
      !> Matrices of the levels for this sampling rate.
      type(projections_type), intent(inout) :: projections
      !> The sample has been computed: [n_sample].
      logical, intent(out) :: computed(:)
      !> The quantities of samples, SI units, NaN if not computed: [sample_quantity_count, n_sample].
      real(wp), intent(out) :: quantity(:, :)
      !> Force exposure levels, dB, NaN if not computed: [n_band, force_count, n_sample].
      real(wp), intent(out) :: levels(:, :, :)
      !> The source conforms, by each force: [force_count, n_sample].
      logical, intent(out) :: met(:, :)
      !> Forces, N, NaN if not computed; of size 0 if not wanted: [n_time, force_count, n_sample].
      real(wp), intent(out) :: forces(:, :, :)
      !> Set if the sampling is invalid, its records do not fit into memory, the source is unknown, or after an interrupt.
      type(error_type), allocatable, intent(out) :: error
      type(source_limits_type) :: limits
      integer, allocatable :: order(:), first(:)

      quantity = not_a_number
      levels = not_a_number
      met = .false.
      forces = not_a_number
      call check_sampling(sampling, error)
      if (.not. allocated(error)) call get_source_limits(source, limits, error)
      if (allocated(error)) return
      call get_blocks(samples, computed, order, first)
      !$omp parallel num_threads(threads)
      call run_blocks()
      !$omp end parallel

   contains

      !> Computes the blocks of one thread, in its own workspace.
      subroutine run_blocks()
         type(workspace_type) :: workspace
         integer :: block

         call set_workspace(workspace, sampling, limits, get_window_length(size(projections%window)))
         !$omp do schedule(dynamic)
         do block = 1, size(first) - 1
            call check_interrupt(workspace%error)
            if (.not. allocated(workspace%error)) call run_block(workspace, order(first(block):first(block + 1) - 1))
         end do
         !$omp end do
         !$omp critical (thud_ensemble_error)
         if (allocated(workspace%error)) error = workspace%error
         !$omp end critical (thud_ensemble_error)
      end subroutine run_blocks

      !> Computes one block, from samples to verdicts.
      subroutine run_block(workspace, indices)
         type(workspace_type), intent(inout) :: workspace
         !> Indices of the samples: [n_in_block].
         integer, intent(in) :: indices(:)
         type(sample_outcome_type) :: outcomes(size(indices))
         real(wp) :: block_levels(size(levels, 1), force_count, size(indices))
         logical :: block_met(force_count, size(indices))
         integer :: i, j

         call solve_workspace(workspace, samples(indices), sampling, with_levels, projections, outcomes, block_levels, &
            block_met)
         do i = 1, size(indices)
            computed(indices(i)) = outcomes(i)%computed
            levels(:, :, indices(i)) = block_levels(:, :, i)
            met(:, indices(i)) = block_met(:, i)
            if (.not. outcomes(i)%computed) cycle
            associate (outcome => outcomes(i))
               quantity(:, indices(i)) = [outcome%contact_time, outcome%peak_force, outcome%peak_elastic_force, &
                  outcome%max_deflection, outcome%restitution, outcome%impulse]
            end associate
            do j = 1, merge(force_count, 0, size(forces) > 0)
               forces(:, j, indices(i)) = get_record(workspace, i, j, sampling)
            end do
         end do
      end subroutine run_block

   end subroutine solve_ensemble

   !> Allocates a workspace. Its memory beyond the longest contact is never touched.
   subroutine set_workspace(workspace, sampling, limits, n_time)
      !> The workspace, with `error` set if memory is lacking.
      type(workspace_type), intent(out) :: workspace
      !> The sampling, for the error message.
      type(sampling_type), intent(in) :: sampling
      type(source_limits_type), intent(in) :: limits
      !> Length of the longest window.
      integer, intent(in) :: n_time
      character(len=128) :: message
      integer :: status

      allocate (workspace%force(force_count*block_size*n_time + line_length), stat=status, errmsg=message)
      if (status == 0) allocate (workspace%folded(force_count*block_size*n_time), stat=status, errmsg=message)
      if (status /= 0) workspace%error = input_error('&sampling: duration = '//to_text(sampling%duration) &
         //' s at sample_rate = '//to_text(sampling%sample_rate)//' Hz gives the forces of '//to_text(block_size) &
         //' samples no space in memory; allowed: shorter records, or fewer threads')
      workspace%criteria = get_criteria(limits, spread(0.0_wp, 1, octave_count), 0.0_wp, 0.0_wp, 1, 0.0_wp, 0.0_wp)
   end subroutine set_workspace

   !> Outcomes, levels and verdicts of one block.
   subroutine solve_workspace(workspace, samples, sampling, with_levels, projections, outcomes, levels, met)
      type(workspace_type), intent(inout), target :: workspace
      !> The samples: [n_sample].
      type(sample_type), intent(in) :: samples(:)
      type(sampling_type), intent(in) :: sampling
      !> Compute levels and verdicts.
      logical, intent(in) :: with_levels
      type(projections_type), intent(inout) :: projections
      !> The outcomes: [n_sample].
      type(sample_outcome_type), intent(out) :: outcomes(:)
      !> Levels, dB: [n_band, force_count, n_sample].
      real(wp), intent(out) :: levels(:, :, :)
      !> The source conforms, by each force: [force_count, n_sample].
      logical, intent(out) :: met(:, :)
      real(wp), pointer, contiguous :: force(:, :)
      integer :: window_index(size(samples))
      integer :: i, j, n_written, window

      force => get_force(workspace)
      call solve_block(samples, sampling, force(:, :get_sample_count(sampling)), n_written, outcomes)
      levels = not_a_number
      met = .false.
      workspace%n_written = n_written
      if (.not. with_levels) return
      window_index = 0
      do i = 1, size(samples)
         if (.not. outcomes(i)%computed) cycle
         window_index(i) = get_window_index(min(int(outcomes(i)%contact_time*sampling%sample_rate) + 1, size(force, 2)))
      end do
      force(:, n_written + 1:get_window_length(max(1, maxval(window_index)))) = 0.0_wp
      ! Each sample has its own window, so that its levels do not depend on the other samples of the block.
      do window = minval(window_index, mask=window_index > 0), maxval(window_index)
         if (.not. any(window_index == window)) cycle
         if (is_projection_fast(get_window_length(window), projections%sample_rate, projections%bands)) then
            call project(workspace, force, window, window_index == window, projections, levels)
         else
            call get_levels_one_by_one(workspace, force, window, window_index == window, projections, levels)
         end if
         if (allocated(workspace%error)) return
         do i = 1, size(samples)
            if (window_index(i) /= window) cycle
            do j = 1, force_count
               met(j, i) = is_conforming(workspace%criteria, samples(i), outcomes(i), levels(:, j, i), &
                  force(:, :n_written), i + (j - 1)*block_size, sampling)
            end do
         end do
      end do
   end subroutine solve_workspace

   !> Levels of all samples with the same window, by matrix products.
   subroutine project(workspace, force, window, chosen, projections, levels)
      type(workspace_type), intent(inout) :: workspace
      !> Forces, N: [force_count block_size, n_time].
      real(wp), intent(in), contiguous :: force(:, :)
      !> Index of the window.
      integer, intent(in) :: window
      !> The sample has this window: [n_sample].
      logical, intent(in) :: chosen(:)
      type(projections_type), intent(inout) :: projections
      !> Levels, dB; only those of chosen samples are written: [n_band, force_count, n_sample].
      real(wp), intent(inout) :: levels(:, :, :)
      real(wp) :: energy(force_count*block_size, size(projections%bands)), square_sum(force_count*block_size)
      integer :: i, j, row

      call require_window(projections, window, workspace%error)
      if (allocated(workspace%error)) return
      call get_band_energies(projections%window(window), force_count*block_size, force, workspace%folded, energy, square_sum)
      do i = 1, size(chosen)
         if (.not. chosen(i)) cycle
         do j = 1, force_count
            row = i + (j - 1)*block_size
            levels(:, j, i) = 10*log10(max(energy(row, :), epsilon(1.0_wp)*square_sum(row)/projections%sample_rate) &
               /(reference_force**2*reference_time))
         end do
      end do
   end subroutine project

   !> Computes the same levels as `project`, but one record at a time; fails only after an interrupt.
   subroutine get_levels_one_by_one(workspace, force, window, chosen, projections, levels)
      type(workspace_type), intent(inout) :: workspace
      !> As in `project`.
      real(wp), intent(in) :: force(:, :)
      integer, intent(in) :: window
      logical, intent(in) :: chosen(:)
      type(projections_type), intent(in) :: projections
      real(wp), intent(inout) :: levels(:, :, :)
      integer :: i, j

      do i = 1, size(chosen)
         if (.not. chosen(i)) cycle
         do j = 1, force_count
            call get_force_exposure_levels(force(i + (j - 1)*block_size, :get_window_length(window)), &
               projections%sample_rate, projections%bands, 'exact', levels(:, j, i), workspace%error)
            if (allocated(workspace%error)) return
         end do
      end do
   end subroutine get_levels_one_by_one

   !> The forces of the block in a workspace, as an array.
   function get_force(workspace) result(force)
      type(workspace_type), intent(in), target :: workspace
      !> Elastic forces, then forces on the floor, N: [force_count block_size, n_time].
      real(wp), pointer, contiguous :: force(:, :)
      integer :: first

      first = get_aligned_start(workspace%force)
      force(1:force_count*block_size, 1:size(workspace%folded)/(force_count*block_size)) => &
         workspace%force(first:first + size(workspace%folded) - 1)
   end function get_force

   !> Computes the matrices of a window unless they exist.
   subroutine require_window(projections, window, error)
      type(projections_type), intent(inout) :: projections
      !> Index of the window.
      integer, intent(in) :: window
      !> Set if the matrices cannot be computed.
      type(error_type), allocatable, intent(inout) :: error
      logical :: failed

      !$omp critical (thud_projections)
      failed = .false.
      if (projections%window(window)%n_sample == 0) call new_band_projection(get_window_length(window), &
         projections%sample_rate, projections%bands, projections%window(window), failed)
      !$omp end critical (thud_projections)
      if (failed) error = numerical_error('&sampling: sample_rate: the matrices of the levels for ' &
         //to_text(get_window_length(window))//' samples cannot be made; allowed: other rates')
   end subroutine require_window

   !> Whether a sample meets all criteria. Peaks are counted last, as this takes longer than all other criteria.
   function is_conforming(criteria, sample, outcome, levels, force, row, sampling) result(met)
      !> The criteria; their values are overwritten: [criterion_count].
      type(criterion_type), intent(inout) :: criteria(:)
      type(sample_type), intent(in) :: sample
      type(sample_outcome_type), intent(in) :: outcome
      !> Levels, dB, octaves first: [n_band].
      real(wp), intent(in) :: levels(:)
      !> Forces, N, without the zeros at the end: [force_count block_size, n_sample].
      real(wp), intent(in) :: force(:, :)
      !> Row of the force of this sample.
      integer, intent(in) :: row
      type(sampling_type), intent(in) :: sampling
      logical :: met
      real(wp) :: record(get_sample_count(sampling))

      criteria%value = [levels(:octave_count), outcome%contact_time, outcome%restitution, 1.0_wp, sample%ball%mass, &
         sample%drop%height]
      met = all(conforms(criteria))
      if (.not. met) return
      record = 0.0_wp
      record(:size(force, 2)) = force(row, :)
      criteria(octave_count + 3)%value = real(get_peak_count(record, sampling%sample_rate), wp)
      met = all(conforms(criteria))
   end function is_conforming

   !> One force of one sample, N: [n_time].
   function get_record(workspace, i, j, sampling) result(record)
      type(workspace_type), intent(in), target :: workspace
      !> Index of the sample in the block, and of the force in `force_names`.
      integer, intent(in) :: i, j
      type(sampling_type), intent(in) :: sampling
      real(wp) :: record(get_sample_count(sampling))
      real(wp), pointer, contiguous :: force(:, :)

      force => get_force(workspace)
      record = 0.0_wp
      record(:workspace%n_written) = force(i + (j - 1)*block_size, :workspace%n_written)
   end function get_record

end module thud_ensemble
