!> The flat API for Python to ensembles; see `thud_api`.
module thud_ensemble_api
   use thud_ball, only: ball_type
   use thud_band, only: band_type, get_bands
   use thud_drop, only: drop_type
   use thud_shell_sets, only: get_set_fields, parameter_count, set_outcome_type, set_type
   use thud_ensemble, only: new_projections, projections_type, solve_ensemble, verdict_type
   use thud_error, only: error_type, get_status
   use thud_field, only: check_fields, field_type
   use thud_hollow_sphere, only: flux_choices
   use thud_kinds, only: wp
   use thud_sampling, only: check_sampling, get_sample_count, get_sampling_fields, sampling_type
   use thud_set_status, only: get_status_text, set_range
   implicit none (type, external)
   private

   public :: ensemble_keys, ensemble_size, solve_sets, status_text

   !> Matrices of the levels, kept from call to call; Python lets one call in at a time.
   type(projections_type) :: projections

contains

   !> Keys of a set and choices of the flux term.
   subroutine ensemble_keys(keys, choices)
      !f2py threadsafe
      !> Keys of the numbers, with commas between.
      character(len=512), intent(out) :: keys
      !> Choices of the flux term, with commas between.
      character(len=512), intent(out) :: choices
      type(set_type), target :: set
      type(field_type) :: fields(parameter_count)
      integer :: i

      fields = get_set_fields(set)
      keys = fields(1)%key
      do i = 2, parameter_count
         keys = trim(keys)//','//fields(i)%key
      end do
      choices = flux_choices(1)
      do i = 2, size(flux_choices)
         choices = trim(choices)//','//flux_choices(i)
      end do
   end subroutine ensemble_keys

   !> The reason behind a status.
   subroutine status_text(code, text)
      !f2py threadsafe
      !> The status of a set.
      integer, intent(in) :: code
      !> The reason.
      character(len=96), intent(out) :: text
      type(set_type), target :: set
      type(field_type) :: fields(parameter_count)

      fields = get_set_fields(set)
      text = get_status_text(code, fields(max(1, min(parameter_count, code - set_range)))%key)
   end subroutine status_text

   !> Samples of each record.
   subroutine ensemble_size(sample_rate, duration, substeps, n_sample, status, message)
      !f2py threadsafe
      !> Samples per second, Hz.
      real(wp), intent(in) :: sample_rate
      !> Length of the record, s.
      real(wp), intent(in) :: duration
      !> Steps per sampling interval.
      integer, intent(in) :: substeps
      !> Number of samples.
      integer, intent(out) :: n_sample
      !> Code of the error, or 0.
      integer, intent(out) :: status
      !> Sentence of the error.
      character(len=1024), intent(out) :: message
      type(sampling_type), target :: sampling
      type(error_type), allocatable :: error

      n_sample = 0
      sampling = sampling_type(sample_rate, duration, substeps)
      call check_fields(get_sampling_fields(sampling), error)
      if (.not. allocated(error)) call check_sampling(sampling, error)
      if (.not. allocated(error)) n_sample = get_sample_count(sampling)
      call get_status(error, status, message)
   end subroutine ensemble_size

   !> Outcomes of all sets; `ensemble_size` has checked the sampling.
   subroutine solve_sets(parameters, flux, n_set, sample_rate, duration, substeps, source, threads, judged, n_more, &
      n_force, n_sample, set_status, scalars, levels, met, forces, status, message)
      !f2py threadsafe
      !f2py integer, intent(hide), depend(flux) :: n_set = len(flux)
      !> Number of sets.
      integer, intent(in) :: n_set
      !> Numbers of the sets, as in `ensemble_keys`: [10, n_set].
      real(wp), intent(in) :: parameters(10, n_set)
      !> Numbers of the choices of the flux term, from 1: [n_set].
      integer, intent(in) :: flux(n_set)
      !> Samples per second, Hz.
      real(wp), intent(in) :: sample_rate
      !> Length of the record, s.
      real(wp), intent(in) :: duration
      !> Steps per sampling interval.
      integer, intent(in) :: substeps
      !> Source whose limits apply.
      character(len=*), intent(in) :: source
      !> Number of threads.
      integer, intent(in) :: threads
      !> 0 where neither levels nor verdicts are wanted.
      integer, intent(in) :: judged
      !> Bands besides the octaves: 15 thirds or none.
      integer, intent(in) :: n_more
      !> Sets whose forces are wanted: n_set or 0.
      integer, intent(in) :: n_force
      !> Samples of each record, or 0 where no forces are wanted.
      integer, intent(in) :: n_sample
      !> Status of each set: [n_set].
      integer, intent(out) :: set_status(n_set)
      !> Contact time, peak elastic and floor force, deflection, restitution, impulse: [6, n_set].
      real(wp), intent(out) :: scalars(6, n_set)
      !> Levels of the elastic and the floor force, dB, octaves first: [5 + n_more, 2, n_set].
      real(wp), intent(out) :: levels(5 + n_more, 2, n_set)
      !> 1 where the source conforms by that force, else 0: [2, n_set].
      integer, intent(out) :: met(2, n_set)
      !> Forces, N: [n_sample, 2, n_force].
      real(wp), intent(out) :: forces(n_sample, 2, n_force)
      !> Code of the error, or 0.
      integer, intent(out) :: status
      !> Sentence of the error.
      character(len=1024), intent(out) :: message
      type(set_type), allocatable :: sets(:)
      type(set_outcome_type), allocatable :: outcomes(:)
      type(verdict_type), allocatable :: verdicts(:)
      type(sampling_type) :: sampling
      type(error_type), allocatable :: error
      integer :: i

      sampling = sampling_type(sample_rate, duration, substeps)
      call require_projections(sampling, n_more)
      allocate (sets(n_set), outcomes(n_set), verdicts(n_set))
      do i = 1, n_set
         associate (p => parameters(:, i))
            sets(i) = set_type(ball_type(p(1), p(2), p(3), p(4), p(5), p(6), p(7), p(8)), drop_type(p(9), p(10)), flux(i))
         end associate
      end do
      call solve_ensemble(sets, sampling, source, threads, judged /= 0, projections, outcomes, levels, verdicts, forces, &
         error)
      do i = 1, n_set
         set_status(i) = outcomes(i)%status
         scalars(:, i) = [outcomes(i)%contact_time, outcomes(i)%peak_force, outcomes(i)%peak_floor_force, &
            outcomes(i)%max_deflection, outcomes(i)%restitution, outcomes(i)%impulse]
         met(:, i) = merge(1, 0, verdicts(i)%conforms)
      end do
      call get_status(error, status, message)
   end subroutine solve_sets

   !> Keeps the matrices of the last call where they serve this one.
   subroutine require_projections(sampling, n_more)
      !> The sampling.
      type(sampling_type), intent(in) :: sampling
      !> Bands besides the octaves.
      integer, intent(in) :: n_more
      type(projections_type) :: wanted
      type(band_type), allocatable :: thirds(:)

      thirds = get_bands('third')
      wanted = new_projections(sampling%sample_rate, thirds(:n_more), get_sample_count(sampling))
      if (allocated(projections%window)) then
         if (abs(wanted%sample_rate - projections%sample_rate) <= 0.0_wp &
            .and. size(wanted%bands) == size(projections%bands) &
            .and. size(wanted%window) == size(projections%window)) return
      end if
      projections = wanted
   end subroutine require_projections

end module thud_ensemble_api
