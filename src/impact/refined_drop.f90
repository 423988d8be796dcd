!> A drop at a resolution that is fine enough: the model is solved at two levels of resolution, and at higher ones until the
!> levels of the octaves agree. Its numerical error (modes left out, rings, elements, time steps and samples) is estimated by
!> the change from a coarser level.
module thud_refined_drop
   use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
   use thud_ball, only: ball_type, drop_type
   use thud_band, only: band_type, octave_count, octaves
   use thud_constants, only: not_a_number, pi
   use thud_error, only: error_type, signal_base
   use thud_force_exposure, only: get_force_exposure_levels
   use thud_force_history, only: add_model_quantity, check_samples, force_history_type, get_model_quantity, motion_type, &
      numerical_error_type
   use thud_kinds, only: wp
   use thud_receiver, only: receiver_type
   use thud_sampling, only: sampling_type
   use thud_source_model, only: resolution_type, source_model_type
   use thud_text, only: fixed
   implicit none (type, external)
   private

   public :: finer_prefix, finer_quantities, get_resolution, max_error, solve_drop

   !> Error of an octave level above which a finer resolution is tried, dB.
   real(wp), parameter :: max_error = 0.2_wp

   !> Bound of the levels of resolution; models stop at a lower one.
   integer, parameter :: max_level = 10

   !> Names of the quantities of a drop at a finer resolution: levels of the octaves of the force on the floor, and others.
   character(len=24), parameter :: finer_quantities(*) = [character(len=24) :: 'finer_octave_31_5', 'finer_octave_63', &
      'finer_octave_125', 'finer_octave_250', 'finer_octave_500', 'finer_contact_time', 'finer_restitution', &
      'finer_peak_force']

   !> Beginning of the names of the quantities of a drop at a finer resolution.
   character(len=*), parameter :: finer_prefix = 'finer_'

   !> Units of these quantities.
   character(len=2), parameter :: finer_units(*) = [character(len=2) :: 'dB', 'dB', 'dB', 'dB', 'dB', 's', '', 'N']

   !> Quantities of models that state the resolution, with the names of the keys that set it.
   character(len=24), parameter :: resolution_quantities(*) = [character(len=24) :: 'radial_elements', 'polar_elements', &
      'rings', 'highest_frequency', 'substeps']

   !> Part of the difference of two forces in an octave that is taken as in phase with the force, and so changes its level.
   real(wp), parameter :: in_phase = 0.15_wp

contains

   !> Force history of one drop, with its numerical error.
   subroutine solve_drop(model, ball, drop, sampling, history, error, receiver)
      !> The model with its options, checked.
      class(source_model_type), intent(in) :: model
      type(ball_type), intent(in) :: ball
      type(drop_type), intent(in) :: drop
      type(sampling_type), intent(in) :: sampling
      type(force_history_type), intent(out) :: history
      !> Set if the drop leaves the range of the model, or at every resolution the steps are too coarse.
      type(error_type), allocatable, intent(out) :: error
      !> The structure under the source (default: a rigid floor).
      type(receiver_type), intent(in), optional :: receiver
      class(source_model_type), allocatable :: shared, refined
      type(force_history_type) :: drops(0:max_level)
      type(motion_type), allocatable :: motion
      type(sampling_type) :: refined_sampling
      type(resolution_type) :: resolution
      real(wp) :: min_error(octave_count)
      integer :: coarser, level
      logical :: is_fine, is_verification

      allocate (shared, source=model)
      is_fine = .false.
      do level = 0, max_level
         coarser = max(level - 1, 0)
         refined_sampling = sampling
         call shared%refine(ball, level, drops(coarser), refined_sampling, refined, resolution)
         is_verification = is_fine .or. .not. resolution%lowers_error
         ! The error is not known if the coarsest resolution fails and there is one level.
         if (is_verification .and. drops(coarser)%numerical_error%known .and. .not. sampling%verify) exit
         call refined%solve(ball, drop, refined_sampling, drops(level), error, receiver)
         if (.not. allocated(error)) call check_samples(drops(level), error)
         if (allocated(error)) then
            if (level == 1 .or. error%code >= signal_base .or. level == 0 .and. error%has_short_record) return
            ! The result stands without the finer one; `get_warnings` reports a missing verification.
            deallocate (error)
            if (level > 0) exit
            drops(0) = force_history_type()
            cycle
         end if
         call complete(drops(level))
         if (level == 0) cycle
         resolution%ratio = max(resolution%ratio, drops(level)%error_ratio)
         if (is_verification) then
            if (.not. drops(coarser)%numerical_error%known) call estimate_error(drops(level), 1 + resolution%ratio, &
               min_error, drops(coarser))
            if (sampling%verify) call add_verification(drops(level), drops(coarser))
            exit
         end if
         if (allocated(drops(resolution%reference)%floor_force)) call estimate_error(drops(resolution%reference), &
            resolution%ratio, resolution%min_error, drops(level))
         min_error = resolution%min_error
         if (drops(level)%numerical_error%known) is_fine = maxval(drops(level)%numerical_error%octave) <= max_error
         if (allocated(drops(coarser)%motion)) deallocate (drops(coarser)%motion)
      end do
      ! The result is the last level that was not for verification; a copy of its snapshots would take their memory twice.
      call move_alloc(drops(level - 1)%motion, motion)
      history = drops(level - 1)
      call move_alloc(motion, history%motion)
   end subroutine solve_drop

   !> Sets what follows from the samples of a history: the octave levels, and a contact time that the model does not resolve.
   subroutine complete(history)
      type(force_history_type), intent(inout) :: history
      type(error_type), allocatable :: error

      call get_force_exposure_levels(history%floor_force, history%sample_rate, octaves, 'exact', &
         history%octave_level, error)
      if (allocated(error)) history%octave_level = not_a_number
      if (.not. history%exact_contact_time > 0.0_wp) history%exact_contact_time = history%contact_time
   end subroutine complete

   !> Estimates the error of a force history by its difference from a coarser one.
   subroutine estimate_error(coarse, ratio, min_error, history)
      !> The same drop at a coarser resolution; its sampling rate may be lower.
      type(force_history_type), intent(in) :: coarse
      !> Error of a level of the history divided by the difference.
      real(wp), intent(in) :: ratio
      !> Minimum errors of the octave levels, dB: [octave_count].
      real(wp), intent(in) :: min_error(:)
      !> The history; its errors are set.
      type(force_history_type), intent(inout) :: history
      real(wp), dimension(octave_count) :: change, level
      real(wp) :: time_change, peak_change, first_order_ratio, interval
      integer :: i
      type(error_type), allocatable :: error

      change = abs(history%octave_level - coarse%octave_level)
      if (any(ieee_is_nan(change))) return
      peak_change = abs(history%peak_force - coarse%peak_force)
      time_change = abs(history%exact_contact_time - coarse%exact_contact_time)
      if (size(coarse%floor_force) == size(history%floor_force)) then
         ! Levels may agree by chance, the forces do not.
         call get_force_exposure_levels(history%floor_force - coarse%floor_force, history%sample_rate, octaves, &
            'exact', level, error)
         if (allocated(error)) return
         change = max(change, in_phase*20/log(10.0_wp)*10**((level - history%octave_level)/20))
         ! The root of the mean square of the difference during the contact.
         peak_change = max(peak_change, sqrt(sum(10**(level/10))/history%contact_time))
      else if (coarse%sample_rate < history%sample_rate .and. .not. history%has_means) then
         ! Half the rate leaves out every other sample, which changes the spectrum by that of the samples with alternating
         ! signs. Levels may agree by chance: aliasing has one sign or the other, as the force ends before or after the
         ! middle of a sampling interval.
         call get_force_exposure_levels([(merge(1, -1, mod(i, 2) == 1)*history%floor_force(i), &
            i=1, size(history%floor_force))], history%sample_rate, octaves, 'exact', level, error)
         if (allocated(error)) return
         change = max(change, 20/log(10.0_wp)*10**((level - history%octave_level)/20))
      end if
      change = ratio*change
      if (history%has_means) change = change + get_mean_loss(history)
      ! Levels converge with the square of the step or element size: `ratio` = 1/(q**2 - 1) for sizes in the ratio q. Contact
      ! time, restitution and peak converge in proportion to it: 1/(q - 1).
      first_order_ratio = 1/(sqrt(1 + 1/ratio) - 1)
      ! Means show the end of the contact to within an interval.
      interval = merge(1/history%sample_rate, 0.0_wp, history%has_means)
      history%numerical_error = numerical_error_type(known=.true., octave=max(change, min_error), &
         contact_time=first_order_ratio*time_change + interval, &
         restitution=first_order_ratio*abs(history%restitution - coarse%restitution), &
         peak_force=first_order_ratio*peak_change + get_lost_peak(history) + get_left_out_force(history))
   end subroutine estimate_error

   !> Part of the peak force that samples may miss, N: the largest sample lies at most half an interval beside the maximum
   !> of a parabola, and a mean over an interval is lower by a third of that; steps within the interval may show more. Zero
   !> if the peak is not that of the samples.
   pure function get_lost_peak(history) result(loss)
      type(force_history_type), intent(in) :: history
      real(wp) :: loss
      integer :: i

      loss = 0.0_wp
      associate (force => history%floor_force)
         i = maxloc(force, dim=1)
         if (i == 1 .or. i == size(force) .or. abs(history%peak_force - force(i)) > 0.0_wp) return
         loss = (2*force(i) - force(i - 1) - force(i + 1))/8
      end associate
      if (history%has_means) loss = max(loss*4/3, history%step_peak_force - history%peak_force)
   end function get_lost_peak

   !> Estimated force of the modes that are left out, N: as much as the root of the mean square, during the contact, in the
   !> octave below the highest frequency of the modes. Zero if the model has no such frequency.
   function get_left_out_force(history) result(force)
      type(force_history_type), intent(in) :: history
      real(wp) :: force
      type(band_type) :: octave(1)
      type(error_type), allocatable :: error
      real(wp) :: level(1)

      force = 0.0_wp
      octave%upper = min(get_model_quantity(history, 'highest_frequency'), history%sample_rate/2)
      if (.not. octave(1)%upper > 0.0_wp) return
      octave%lower = octave%upper/2
      call get_force_exposure_levels(history%floor_force, history%sample_rate, octave, 'exact', level, error)
      if (.not. allocated(error)) force = sqrt(10**(level(1)/10)/history%contact_time)
   end function get_left_out_force

   !> Maximum reduction of octave levels by means over a sampling interval, dB: that of the highest frequency of each octave.
   pure function get_mean_loss(history) result(loss)
      type(force_history_type), intent(in) :: history
      real(wp) :: loss(octave_count)
      real(wp) :: phase(octave_count)
      real(wp) :: substeps

      phase = pi*octaves%upper/history%sample_rate
      loss = -20*log10(sin(phase)/phase)
      ! Two samples share the middle step of an odd number in half, which is lost in part; at the center of the octave,
      ! because spectra of contacts fall.
      substeps = get_model_quantity(history, 'substeps')
      if (mod(nint(substeps), 2) == 1) loss = loss - 20*log10(cos(pi*octaves%center/(history%sample_rate*substeps)))
   end function get_mean_loss

   !> Adds the numbers of the same drop at a finer resolution to the quantities of a history.
   subroutine add_verification(finer, history)
      type(force_history_type), intent(in) :: finer
      !> The history; its model quantities get `finer_quantities`.
      type(force_history_type), intent(inout) :: history
      real(wp) :: values(size(finer_quantities))
      integer :: i

      values = [finer%octave_level, finer%exact_contact_time, finer%restitution, finer%peak_force]
      if (any(ieee_is_nan(values))) return
      do i = 1, size(values)
         call add_model_quantity(history, finer_quantities(i), finer_units(i), values(i))
      end do
      do i = 1, size(finer%model_quantity)
         if (any(resolution_quantities == finer%model_quantity_name(i))) call add_model_quantity(history, &
            finer_prefix//finer%model_quantity_name(i), finer%model_quantity_unit(i), finer%model_quantity(i))
      end do
      if (finer%sample_rate > history%sample_rate) call add_model_quantity(history, finer_prefix//'sample_rate', 'Hz', &
         finer%sample_rate)
   end subroutine add_verification

   !> The resolution of a result, by the keys that set it.
   pure function get_resolution(history) result(text)
      type(force_history_type), intent(in) :: history
      !> The keys with their values, then blanks.
      character(len=96) :: text
      integer :: i

      text = ''
      do i = 1, size(resolution_quantities)
         associate (value => get_model_quantity(history, resolution_quantities(i)))
            if (value > 0.0_wp) text = trim(text)//', '//trim(resolution_quantities(i))//' = '//fixed(value, 0)
         end associate
      end do
      if (text == '') text = ', sample_rate = '//fixed(history%sample_rate, 0)
      text = text(3:)
   end function get_resolution

end module thud_refined_drop
