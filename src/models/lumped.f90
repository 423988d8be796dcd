!> Impact of a source with one degree of freedom: marches from first touch over the turning point
!> to release, samples the forces, and checks the balances of impulse and energy.
module thud_lumped
   use thud_contact_source, only: coarse_error, contact_source_type
   use thud_coupled_impact, only: solve_coupled
   use thud_drop, only: drop_type, get_impact_velocity
   use thud_error, only: error_type, input_error
   use thud_force_history, only: check_samples, force_history_type, max_residual, new_force_history
   use thud_interrupt, only: check_interrupt
   use thud_kinds, only: wp
   use thud_receiver, only: is_rigid, receiver_type
   use thud_rk4, only: locate_zero, longest_valid, rk4_step
   use thud_sampling, only: check_contact_samples, get_sample_count, sampling_type
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: at_deflection, at_impulse, at_loss, at_velocity, lumped_type, solve_lumped

   !> Places of the quantities in the state: deflection (m), velocity (m/s), impulse given to the
   !> floor (N s), energy lost (J).
   integer, parameter :: at_deflection = 1, at_velocity = 2, at_impulse = 3, at_loss = 4, n_state = 4

   !> Equation of motion of the source; its state is laid out as above.
   type, abstract, extends(contact_source_type) :: lumped_type
   contains
      procedure(get_parts_interface), deferred :: get_parts
      procedure :: record_sample
      procedure :: record_peaks
   end type lumped_type

   abstract interface
      !> Parts of the force at one instant.
      pure subroutine get_parts_interface(self, state, parts, elastic_force)
         import :: lumped_type, wp
         implicit none (type, external)
         !> The source.
         class(lumped_type), intent(in) :: self
         !> State: [4].
         real(wp), intent(in) :: state(:)
         !> Parts of the force on the floor, N: [n_part].
         real(wp), intent(out) :: parts(:)
         !> Elastic force, N.
         real(wp), intent(out) :: elastic_force
      end subroutine get_parts_interface
   end interface

contains

   !> Force history of one drop.
   subroutine solve_lumped(source, drop, sampling, part_name, history, error, receiver)
      !> The source in its compression phase.
      class(lumped_type), intent(inout) :: source
      type(drop_type), intent(in) :: drop
      !> Sampling rate, length of the record, substeps.
      type(sampling_type), intent(in) :: sampling
      !> Names of the parts of the force: [n_part].
      character(len=*), intent(in) :: part_name(:)
      !> Force and motion from first touch on.
      type(force_history_type), intent(out) :: history
      !> The equation fails, the contact outlasts the record, or the steps are too coarse.
      type(error_type), allocatable, intent(out) :: error
      !> What the source drops on (default: a rigid floor).
      type(receiver_type), intent(in), optional :: receiver
      real(wp) :: state(n_state)
      logical :: moves

      history = new_force_history(sampling%sample_rate, get_sample_count(sampling), part_name)
      history%impact_velocity = get_impact_velocity(drop)
      moves = present(receiver)
      if (moves) moves = .not. is_rigid(receiver)
      if (moves) then
         call solve_coupled(source, drop, sampling, sampling%substeps, receiver, history, state, error)
      else
         call march(source, drop, sampling, history, state, error)
      end if
      if (allocated(error)) return
      ! The contact time of a motion whose balances do not close would give a wrong advice.
      call finish(source%mass, state, history, error)
      if (.not. allocated(error)) call check_contact_samples(sampling, history%contact_time, error)
      if (.not. allocated(error)) call check_samples(history, error)
   end subroutine solve_lumped

   !> Marches from first touch to release on a rigid floor.
   subroutine march(source, drop, sampling, history, state, error)
      class(lumped_type), intent(inout) :: source
      type(drop_type), intent(in) :: drop
      type(sampling_type), intent(in) :: sampling
      !> Gets samples, maxima and contact time.
      type(force_history_type), intent(inout) :: history
      !> State at release: [4].
      real(wp), intent(out) :: state(:)
      !> The equation fails, or the contact outlasts the record.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: time, step
      integer :: i, j
      logical :: released

      state = [0.0_wp, history%impact_velocity, 0.0_wp, 0.0_wp]
      step = 1/(sampling%sample_rate*real(sampling%substeps, wp))
      source%compressing = .true.
      released = .false.
      call source%record_sample(state, 1, history)
      samples: do i = 2, size(history%floor_force)
         do j = 1, sampling%substeps
            time = real((i - 2)*sampling%substeps + j - 1, wp)*step
            call advance(source, drop, time + step, time, state, history, released, error)
            if (allocated(error)) return
            if (released) exit samples
         end do
         call source%record_sample(state, i, history)
         call check_interrupt(error)
         if (allocated(error)) return
      end do samples
      if (.not. released) then
         error = input_error('&sampling: duration = '//to_text(sampling%duration) &
            //' s ends while the source is still in contact; allowed: longer than the contact')
         return
      end if
      history%contact_time = time
      history%peak_elastic_force = max(history%peak_elastic_force, maxval(history%elastic_force))
      history%peak_force = max(history%peak_elastic_force, history%peak_force)
   end subroutine march

   !> Moves time and state on to the given time; stops short at release.
   subroutine advance(source, drop, end_time, time, state, history, released, error)
      !> The source; it changes its phase at the turning point.
      class(lumped_type), intent(inout) :: source
      type(drop_type), intent(in) :: drop
      !> Time at the end of the step, s.
      real(wp), intent(in) :: end_time
      !> Time since first touch, s.
      real(wp), intent(inout) :: time
      !> State at that time: [4].
      real(wp), intent(inout) :: state(:)
      !> Gets deflection and force at the turning point.
      type(force_history_type), intent(inout) :: history
      !> The contact ended at `time`.
      logical, intent(out) :: released
      !> The state leaves the domain of the equation.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: new_state(n_state)
      real(wp) :: length
      logical :: valid
      integer :: component

      released = .false.
      do
         length = end_time - time
         call rk4_step(source, time, state, length, new_state, valid)
         if (.not. valid) then
            length = longest_valid(source, time, state, length)
            call rk4_step(source, time, state, length, new_state, valid)
            error = source%get_failure(drop, time + length, new_state)
            return
         end if
         ! Compression ends with the velocity, restitution with the deflection.
         component = merge(at_velocity, at_deflection, source%compressing)
         if (new_state(component) > 0.0_wp) then
            time = end_time
            state = new_state
            return
         end if
         length = locate_zero(source, time, state, length, component)
         call rk4_step(source, time, state, length, new_state, valid)
         time = time + length
         state = new_state
         state(component) = 0.0_wp
         released = .not. source%compressing
         if (released) return
         source%compressing = .false.
         call source%record_peaks(state, history)
      end do
   end subroutine advance

   !> Writes motion and forces of one instant into the history.
   pure subroutine record_sample(self, state, i, history)
      !> The source in its present phase.
      class(lumped_type), intent(in) :: self
      !> State at the sample: [4].
      real(wp), intent(in) :: state(:)
      !> Number of the sample.
      integer, intent(in) :: i
      type(force_history_type), intent(inout) :: history

      history%deflection(i) = state(at_deflection)
      history%velocity(i) = state(at_velocity)
      if (.not. self%touching) return
      call self%get_parts(state, history%part(i, :), history%elastic_force(i))
      history%peak_force = max(history%peak_force, sum(history%part(i, :)))
      ! A part that starts with a jump at first touch: a sample of a jump is the mean of its two sides.
      if (i == 1) history%part(i, :) = history%part(i, :)/2
      history%floor_force(i) = sum(history%part(i, :))
   end subroutine record_sample

   !> Raises the maxima of deflection and elastic force.
   pure subroutine record_peaks(self, state, history)
      !> The source in its present phase.
      class(lumped_type), intent(in) :: self
      !> State: [4].
      real(wp), intent(in) :: state(:)
      type(force_history_type), intent(inout) :: history
      real(wp) :: parts(size(history%part, 2))
      real(wp) :: elastic_force

      call self%get_parts(state, parts, elastic_force)
      history%max_deflection = max(history%max_deflection, state(at_deflection))
      history%peak_elastic_force = max(history%peak_elastic_force, elastic_force)
   end subroutine record_peaks

   !> Scalars of the impact from the state at release, and the check of the balances.
   subroutine finish(mass, state, history, error)
      !> Mass that moves again after release, kg.
      real(wp), intent(in) :: mass
      !> State at release: [4].
      real(wp), intent(in) :: state(:)
      !> The history; its samples are complete.
      type(force_history_type), intent(inout) :: history
      !> A balance does not close.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: energy, momentum

      associate (v0 => history%impact_velocity, velocity => state(at_velocity))
         history%restitution = -velocity/v0
         momentum = mass*(v0 - velocity)
         energy = mass/2*v0**2
         history%impulse = state(at_impulse)
         history%impulse_residual = abs(history%impulse - momentum)/momentum
         history%energy_residual = abs(mass/2*velocity**2 + state(at_loss) + history%floor_work - energy)/energy
      end associate
      ! Written so that NaN fails too.
      if (.not. max(history%impulse_residual, history%energy_residual) <= max_residual) then
         error = coarse_error('the balance of impulse misses by '//to_text(history%impulse_residual) &
            //' and that of energy by '//to_text(history%energy_residual)//', more than '//to_text(max_residual))
      end if
   end subroutine finish

end module thud_lumped
