!> A drop at a resolution that is fine enough: the model is solved at two levels of resolution, and at higher ones until the
!> levels of the octaves agree. The difference is the stated numerical error.
module thud_resolved_drop
   use thud_ball, only: ball_type
   use thud_band, only: octave_count
   use thud_constants, only: pi
   use thud_drop, only: drop_type, get_impact_velocity
   use thud_error, only: error_type, signal_base
   use thud_force_history, only: force_history_type
   use thud_kinds, only: wp
   use thud_motion, only: motion_type
   use thud_numerical_error, only: add_verification, estimate_error, get_largest_error
   use thud_receiver, only: receiver_type
   use thud_sampling, only: sampling_type
   use thud_source_model, only: convergence_type, source_model_type
   implicit none (type, external)
   private

   public :: get_drop_cost, solve_drop

   !> Error of an octave level above which a finer resolution is tried, dB.
   real(wp), parameter :: max_error = 0.2_wp

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
      class(source_model_type), allocatable :: prepared
      type(force_history_type) :: coarse, finer
      type(force_history_type), allocatable :: references(:)
      type(motion_type), allocatable :: motion
      type(convergence_type) :: convergence
      type(error_type), allocatable :: coarse_error
      real(wp) :: min_error(octave_count)
      integer :: level, highest
      logical :: is_finest

      is_finest = .false.
      highest = model%get_highest_level(ball, sampling)
      allocate (references(0:highest))
      allocate (prepared, source=model)
      call prepared%share_setup(ball, sampling)
      call solve_at(0, history, coarse_error)
      if (allocated(coarse_error)) then
         if (is_interrupt(coarse_error) .or. coarse_error%has_short_record) then
            call move_alloc(coarse_error, error)
            return
         end if
      end if
      do level = 1, highest
         if (.not. allocated(coarse_error)) then
            call move_alloc(history%motion, motion)
            coarse = history
            references(level - 1) = history
         end if
         call solve_at(level, history, error)
         if (allocated(error)) then
            if (is_interrupt(error) .or. level == 1) return
            ! The next coarser level has a result, and no finer one can be computed.
            deallocate (error)
            history = coarse
            call move_alloc(motion, history%motion)
            is_finest = .true.
            exit
         end if
         if (allocated(coarse_error)) deallocate (coarse_error)
         associate (reference => references(convergence%reference))
            if (allocated(reference%floor_force)) call estimate_error(reference, convergence%ratio, convergence%min_error, &
               history)
         end associate
         if (history%numerical_error%known .and. get_largest_error(history) <= max_error) exit
      end do
      level = min(level, highest)
      min_error = convergence%min_error
      if (is_finest .or. history%numerical_error%known .and. .not. sampling%verify) return
      ! The error is not known if the coarsest resolution fails and there is one level.
      call solve_at(level + 1, finer, error)
      if (allocated(error)) then
         ! The result stands without the finer one; `get_warnings` reports that.
         if (.not. is_interrupt(error)) deallocate (error)
         return
      end if
      if (.not. history%numerical_error%known) then
         call estimate_error(finer, 1 + convergence%ratio, min_error, history)
      end if
      if (sampling%verify) call add_verification(finer, history)

   contains

      !> Force history at a level of resolution.
      subroutine solve_at(level, history, error)
         integer, intent(in) :: level
         type(force_history_type), intent(out) :: history
         type(error_type), allocatable, intent(out) :: error
         class(source_model_type), allocatable :: resolved
         type(sampling_type) :: resolved_sampling

         allocate (resolved, source=prepared)
         resolved_sampling = sampling
         call resolved%set_level(ball, level, resolved_sampling, coarse)
         call resolved%solve(ball, drop, resolved_sampling, history, error, receiver)
         convergence = resolved%get_convergence(ball, level, history)
      end subroutine solve_at

   end subroutine solve_drop

   !> Approximate computing time of one drop with its numerical error on one core: that of the levels which are probably
   !> computed.
   function get_drop_cost(model, ball, drop, sampling, receiver) result(cost)
      !> The model with its options, checked.
      class(source_model_type), intent(in) :: model
      type(ball_type), intent(in) :: ball
      type(drop_type), intent(in) :: drop
      type(sampling_type), intent(in) :: sampling
      !> The structure under the source (default: a rigid floor).
      type(receiver_type), intent(in), optional :: receiver
      !> The time, s.
      real(wp) :: cost
      class(source_model_type), allocatable :: resolved
      type(sampling_type) :: resolved_sampling
      type(force_history_type) :: contact, coarse
      integer :: level, expected_level

      ! Only models that use the wall have such a modulus.
      if (model%get_standard_modulus() > 0.0_wp) contact = estimate_contact(ball, drop)
      expected_level = min(model%get_highest_level(ball, sampling), model%get_expected_level(ball, contact))
      cost = 0.0_wp
      do level = 0, merge(expected_level + 1, expected_level, sampling%verify)
         allocate (resolved, source=model)
         resolved_sampling = sampling
         call resolved%set_level(ball, level, resolved_sampling, coarse)
         if (allocated(contact%model_history)) then
            cost = cost + resolved%get_cost(ball, resolved_sampling, receiver, contact%contact_time)
         else
            cost = cost + resolved%get_cost(ball, resolved_sampling, receiver)
         end if
         deallocate (resolved)
         coarse = contact
      end do
   end function get_drop_cost

   !> Contact time, deflection and contact radius for estimates of cost, from a linear shell under a point load (Reissner
   !> 1946) and Hertz's contact of a solid sphere (Johnson, Contact Mechanics, 1985, section 11.4) in series. The factors are
   !> means over modal balls.
   function estimate_contact(ball, drop) result(history)
      type(ball_type), intent(in) :: ball
      type(drop_type), intent(in) :: drop
      type(force_history_type) :: history
      real(wp) :: stiffness, plane_modulus, velocity, time

      velocity = get_impact_velocity(drop)
      plane_modulus = ball%youngs_modulus/(1 - ball%poisson_ratio**2)
      stiffness = 4*ball%youngs_modulus*ball%wall_thickness**2/(ball%outer_radius*sqrt(3*(1 - ball%poisson_ratio**2)))
      time = hypot(pi*sqrt(ball%mass/stiffness), &
         2.87_wp*(ball%mass**2/(ball%outer_radius*plane_modulus**2*velocity))**0.2_wp)
      history%contact_time = 0.85_wp*time
      history%max_deflection = min(ball%outer_radius, 0.7_wp*velocity*time/pi)
      allocate (history%model_history(1, 1), source=sqrt(ball%outer_radius*history%max_deflection))
   end function estimate_contact

   !> Whether an error is an interrupt.
   pure function is_interrupt(error) result(yes)
      type(error_type), allocatable, intent(in) :: error
      logical :: yes

      yes = .false.
      if (allocated(error)) yes = error%code >= signal_base
   end function is_interrupt

end module thud_resolved_drop
