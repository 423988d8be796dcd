!> Drops of the shell model in batches: samples of a sweep, the forces of a block of them, and their levels, computed while
!> the forces are in cache.
!>
!> The results of a sample do not depend on the number of threads, the other samples or its index: they come from its
!> own column in arrays of fixed shape. A sample that has no result here is left to the solver of single drops.
module thud_ensemble
   use thud_band, only: band_type, octave_count
   use thud_band_projection, only: band_projection_type, get_band_energies, get_window_index, get_window_length, &
      new_band_projection
   use thud_case, only: case_type, get_active_fields, get_model_number
   use thud_column, only: column_type
   use thud_error, only: error_type
   use thud_field, only: field_type
   use thud_force_history, only: force_count
   use thud_hollow_sphere, only: flux_choices, hollow_sphere_type
   use thud_kinds, only: wp
   use thud_quantities, only: sample_quantity_count
   use thud_result_column, only: set_source_values
   use thud_sampling, only: get_sample_count
   use thud_shell_samples, only: block_size, get_sample_fields, sample_outcome_type, sample_type, solve_block
   use thud_source_limits, only: conforms, criterion_type, get_peak_count
   implicit none (type, external)
   private

   public :: fill_samples, get_record, projections_type, solve_drops, suits_batch

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

contains

   !> Whether samples can be computed in batches: the case has the shell model, exact levels and no floor, and the samples
   !> differ only in ball, drop and options of the model.
   function suits_batch(case, columns) result(suits)
      type(case_type), intent(in), target :: case
      !> Keys in which the samples differ: [n_column].
      type(column_type), intent(in) :: columns(:)
      logical :: suits
      type(field_type), allocatable :: fields(:)
      integer :: i

      suits = .false.
      select type (model => case%models(get_model_number(case))%model)
      type is (hollow_sphere_type)
         allocate (fields, source=get_active_fields(case))
         fields = fields(columns%field)
         suits = case%level_method == 'exact' .and. .not. case%has_floor .and. all([(fields(i)%group == 'ball' &
            .or. fields(i)%group == 'drop' .or. fields(i)%owner == case%model, i=1, size(fields))])
      end select
   end function suits_batch

   !> Makes the samples of the shell model.
   subroutine fill_samples(case, columns, values, samples)
      !> The case, for all values that are not in the columns.
      type(case_type), intent(in), target :: case
      !> Keys in which the samples differ: [n_column].
      type(column_type), intent(in) :: columns(:)
      !> Values of the keys: [n_column, n_sample].
      real(wp), intent(in) :: values(:, :)
      !> The samples: [n_sample].
      type(sample_type), intent(out) :: samples(:)
      type(sample_type), target :: sample
      type(error_type), allocatable :: error
      type(field_type), allocatable :: fields(:), sample_fields(:)
      integer :: index_of(size(columns))
      integer :: i, j

      sample%ball = case%ball
      sample%drop = case%drop
      allocate (fields, source=get_active_fields(case))
      allocate (sample_fields, source=get_sample_fields(sample))
      ! The only other key is the choice of the flux term.
      index_of = [(findloc(sample_fields%key == fields(columns(j)%field)%key, .true., dim=1), j=1, size(columns))]
      select type (model => case%models(get_model_number(case))%model)
      type is (hollow_sphere_type)
         sample%flux = findloc(flux_choices == model%momentum_flux, .true., dim=1)
      end select
      do i = 1, size(samples)
         do j = 1, size(columns)
            if (index_of(j) > 0) then
               call sample_fields(index_of(j))%set_number(values(j, i), 0, error)
            else
               sample%flux = nint(values(j, i))
               ! A number that is not whole is no valid choice.
               if (abs(values(j, i) - sample%flux) > 0.0_wp) sample%flux = 0
            end if
         end do
         samples(i) = sample
      end do
   end subroutine fill_samples

   !> Results of one block of samples, and their forces.
   subroutine solve_drops(case, samples, criteria, projections, force, n_written, computed, values)
      !> The case, for all that samples share.
      type(case_type), intent(in) :: case
      !> The samples, with the same choice of the flux term: [n_sample].
      type(sample_type), intent(in) :: samples(:)
      !> Criteria of the source, of which only the ranges are used: [criterion_count]; none without levels and verdicts.
      type(criterion_type), intent(in) :: criteria(:)
      !> Matrices of the levels for this sampling rate.
      type(projections_type), intent(inout) :: projections
      !> Elastic forces, then forces on the floor, N: [force_count block_size, length of the longest window].
      real(wp), intent(inout) :: force(force_count*block_size, get_window_length(size(projections%window)))
      !> Index of the last instant at which a force is not zero.
      integer, intent(out) :: n_written
      !> The sample has been computed: [n_sample].
      logical, intent(out) :: computed(:)
      !> Values of the columns, set for samples that have been computed: [n_column, n_sample].
      real(wp), intent(inout) :: values(:, :)
      type(sample_outcome_type) :: outcomes(size(samples))
      type(criterion_type) :: tested(size(criteria))
      real(wp) :: level(size(projections%bands), force_count, size(samples)), quantity(sample_quantity_count)
      logical :: conforming(force_count)
      integer :: window_index(size(samples))
      integer :: i, j, window

      associate (rate => case%sampling%sample_rate, n_time => get_sample_count(case%sampling))
         call solve_block(samples, case%sampling, force(:, :n_time), n_written, outcomes)
         computed = outcomes%computed
         window_index = 0
         do i = 1, merge(size(samples), 0, size(criteria) > 0)
            if (computed(i)) window_index(i) = get_window_index(min(int(outcomes(i)%contact_time*rate) + 1, size(force, 2)))
         end do
         force(:, n_written + 1:get_window_length(max(1, maxval(window_index)))) = 0.0_wp
         ! Each sample has its own window, so that its levels do not depend on the other samples of the block.
         do window = minval(window_index, mask=window_index > 0), maxval(window_index)
            if (any(window_index == window)) call set_levels(projections, window, window_index == window, force, level, &
               computed)
         end do
         do i = 1, size(samples)
            if (.not. computed(i)) cycle
            associate (outcome => outcomes(i))
               quantity = [outcome%contact_time, outcome%peak_force, outcome%peak_elastic_force, outcome%max_deflection, &
                  outcome%restitution, outcome%impulse]
            end associate
            values(:sample_quantity_count, i) = quantity
            if (size(criteria) == 0) cycle
            tested = criteria
            do j = 1, force_count
               tested%value = [level(:octave_count, j, i), outcomes(i)%contact_time, outcomes(i)%restitution, 1.0_wp, &
                  samples(i)%ball%mass, samples(i)%drop%height]
               conforming(j) = all(conforms(tested))
               if (.not. conforming(j)) cycle
               ! Peaks are counted last, as this takes longer than all other criteria.
               tested(octave_count + 3)%value = get_peak_count(get_record(force, i, j, n_written, n_time), rate)
               conforming(j) = conforms(tested(octave_count + 3))
            end do
            call set_source_values(case, criteria, quantity, level(:, :, i), conforming, values(:, i))
         end do
      end associate
   end subroutine solve_drops

   !> Levels of all samples with the same window; none is computed if the matrices of the window would take too long or
   !> LAPACK fails.
   subroutine set_levels(projections, window, chosen, force, level, computed)
      type(projections_type), intent(inout) :: projections
      !> Index of the window.
      integer, intent(in) :: window
      !> The sample has this window: [n_sample].
      logical, intent(in) :: chosen(:)
      !> Forces, N: [force_count block_size, n_time].
      real(wp), intent(in), contiguous :: force(:, :)
      !> Levels, dB, of which those of chosen samples are set: [n_band, force_count, n_sample].
      real(wp), intent(inout) :: level(:, :, :)
      !> They have been computed: [n_sample].
      logical, intent(inout) :: computed(:)
      real(wp) :: energy(force_count*block_size, size(projections%bands)), square_sum(force_count*block_size)
      logical :: has_matrices
      integer :: i, j, row

      !$omp critical (thud_projections)
      associate (projection => projections%window(window), length => get_window_length(window))
         if (projection%n_sample == 0) call new_band_projection(length, projections%sample_rate, projections%bands, &
            projection)
         has_matrices = projection%n_sample > 0
      end associate
      !$omp end critical (thud_projections)
      where (chosen) computed = has_matrices
      if (.not. has_matrices) return
      call get_band_energies(projections%window(window), force, energy, square_sum)
      do i = 1, size(chosen)
         if (.not. chosen(i)) cycle
         do j = 1, force_count
            row = i + (j - 1)*block_size
            level(:, j, i) = 10*log10(max(energy(row, :), epsilon(1.0_wp)*square_sum(row)/projections%sample_rate))
         end do
      end do
   end subroutine set_levels

   !> One force of one sample, N: [n_time].
   pure function get_record(force, sample, number, n_written, n_time) result(record)
      !> Forces of the block, N: [force_count block_size, at least n_written].
      real(wp), intent(in) :: force(:, :)
      !> Index of the sample in the block, and of the force in `force_names`.
      integer, intent(in) :: sample, number
      !> Number of instants that are set; length of the record.
      integer, intent(in) :: n_written, n_time
      real(wp) :: record(n_time)

      record(:n_written) = force(sample + (number - 1)*block_size, :n_written)
      record(n_written + 1:) = 0.0_wp
   end function get_record

end module thud_ensemble
