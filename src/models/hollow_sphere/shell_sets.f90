!> Many drops of `thud_hollow_sphere`, a block of balls at a time: the same equation, steps and checks
!> as `solve_hollow_sphere`, and the same numbers to 1e-10; the impulse to the residual of its balance.
!>
!> Sets that cannot be computed have NaN; they leave the others as they are.
module thud_shell_sets
   use, intrinsic :: iso_c_binding, only: c_f_pointer, c_loc, c_sizeof
   use thud_ball, only: ball_type, get_ball_fields
   use thud_cache_line, only: get_aligned_start, line_length
   use thud_constants, only: pi
   use thud_drop, only: drop_type, get_drop_fields, get_impact_velocity
   use thud_error, only: error_type
   use thud_field, only: field_type
   use thud_force_history, only: force_history_type, holds_impulse, max_residual
   use thud_hollow_sphere, only: compression_weights, flux_choices, get_shell_stiffness, hollow_sphere_type, &
      restitution_weights, solve_hollow_sphere
   use thud_impact_batch, only: impact_batch_type
   use thud_interval, only: interval_type, new_interval
   use thud_kinds, only: wp
   use thud_new_field, only: in_group
   use thud_power, only: not_a_number
   use thud_sampling, only: get_sample_count, min_contact_samples, sampling_type
   use thud_shell_batch, only: batch_size
   use thud_shell_impacts, only: solve_impacts
   implicit none (type, external)
   private

   public :: block_size, get_blocks, get_numbers, get_set_fields, set_outcome_type, set_type, solve_block

   !> Sets of one block.
   integer, parameter :: block_size = batch_size

   !> One drop.
   type :: set_type
      type(ball_type) :: ball
      type(drop_type) :: drop
      !> Index of the flux term, as in `flux_choices`.
      integer :: flux = 1
   end type set_type

   !> Outcome of one drop; NaN where it could not be computed.
   type :: set_outcome_type
      !> The batch has computed it; else the single solver has the result or the error.
      logical :: computed = .false.
      !> Time from first touch to release, s.
      real(wp) :: contact_time = not_a_number
      !> Maximum elastic force, N.
      real(wp) :: peak_elastic_force = not_a_number
      !> Maximum force on the floor, N.
      real(wp) :: peak_force = not_a_number
      !> Maximum deflection, m.
      real(wp) :: max_deflection = not_a_number
      !> Velocity at release over velocity at first touch.
      real(wp) :: restitution = not_a_number
      !> Impulse given to the floor, N s: the change of momentum, which the sum of the forces has confirmed.
      real(wp) :: impulse = not_a_number
   end type set_outcome_type

   !> Residual of the balances of impulse and energy above which the single solver decides: the sums that
   !> are taken here have up to some twenty times the error of the single solver's.
   real(wp), parameter :: doubtful = 0.1_wp*max_residual

contains

   !> Keys and allowed ranges of the numbers of a set.
   function get_set_fields(set) result(fields)
      !> The set that the fields read and set.
      type(set_type), intent(in), target :: set
      !> One field per number, as in `get_numbers`: [n_key].
      type(field_type), allocatable :: fields(:)

      fields = [in_group('ball', get_ball_fields(set%ball)), in_group('drop', get_drop_fields(set%drop))]
   end function get_set_fields

   !> The numbers of a set: ball and drop hold nothing else, in the order of their keys.
   pure function get_numbers(set) result(values)
      type(set_type), intent(in) :: set
      !> The numbers: [n_key].
      real(wp) :: values((storage_size(set%ball) + storage_size(set%drop))/storage_size(1.0_wp))

      values = [transfer(set%ball, values), transfer(set%drop, values)]
   end function get_numbers

   !> Blocks of the sets that can be computed: of one choice of the flux term, so that balls share their
   !> equation, and with similar contact times, because a block takes as long as its longest contact.
   subroutine get_blocks(sets, valid, order, first)
      !> The sets: [n_set].
      type(set_type), intent(in) :: sets(:)
      !> The values of each set lie inside their ranges: [n_set].
      logical, intent(out) :: valid(:)
      !> Numbers of the sets whose input is right: [n_valid].
      integer, allocatable, intent(out) :: order(:)
      !> Indices in `order` where blocks begin, and the one after the last: [n_block + 1].
      integer, allocatable, intent(out) :: first(:)
      !> Classes of contact times per doubling.
      integer, parameter :: classes = 64
      !> Maximum number of classes, for each choice of the flux term.
      integer, parameter :: max_class = 64*classes
      integer :: next(0:size(compression_weights)*max_class)
      integer :: class(size(sets))
      integer :: i, j

      call check_sets(sets, valid)
      next = 0
      do i = 1, size(sets)
         if (.not. valid(i)) cycle
         class(i) = int(classes*(32 + log(get_rough_contact_time(sets(i)))/log(2.0_wp)))
         class(i) = min(max(class(i), 0), max_class - 1) + (sets(i)%flux - 1)*max_class
         next(class(i) + 1) = next(class(i) + 1) + 1
      end do
      do i = 1, ubound(next, 1)
         next(i) = next(i) + next(i - 1)
      end do
      allocate (order(next(ubound(next, 1))))
      first = [((j, j=next((i - 1)*max_class) + 1, next(i*max_class), block_size), &
         i=1, size(compression_weights)), size(order) + 1]
      do i = 1, size(sets)
         if (.not. valid(i)) cycle
         next(class(i)) = next(class(i)) + 1
         order(next(class(i))) = i
      end do
   end subroutine get_blocks

   !> Whether the values of each set lie inside their ranges.
   subroutine check_sets(sets, valid)
      type(set_type), intent(in) :: sets(:)
      !> Whether they do: [n_set].
      logical, intent(out) :: valid(:)
      type(set_type), target :: any_set
      type(field_type), allocatable :: fields(:)
      type(interval_type) :: range
      real(wp), allocatable :: values(:, :)
      integer :: i

      allocate (fields, source=get_set_fields(any_set))
      allocate (values(size(sets), size(fields)))
      do i = 1, size(sets)
         values(i, :) = get_numbers(sets(i))
      end do
      valid = sets%flux >= 1 .and. sets%flux <= size(compression_weights)
      do i = 1, size(fields)
         range = new_interval(fields(i)%range)
         valid = valid .and. range%contains_sets(i, fields%key, values)
      end do
   end subroutine check_sets

   !> Half a period of the linear spring and the gas to third order, s: the amplitude from the energy,
   !> the period of a Duffing oscillator by harmonic balance. Good to 10 %, and alike for like sets.
   pure function get_rough_contact_time(set) result(time)
      type(set_type), intent(in) :: set
      !> The time, s.
      real(wp) :: time
      real(wp) :: linear, cubic, speed

      associate (ball => set%ball)
         linear = (get_shell_stiffness(ball) + 2*pi*ball%outer_radius*ball%gauge_pressure)/ball%mass
         cubic = 1.5_wp*pi*ball%heat_capacity_ratio*(ball%ambient_pressure + ball%gauge_pressure) &
            /(ball%outer_radius*ball%mass)
      end associate
      speed = get_impact_velocity(set%drop)
      time = pi/sqrt(linear + 0.75_wp*cubic*2*speed**2/(linear + sqrt(linear**2 + 2*cubic*speed**2)))
   end function get_rough_contact_time

   !> Outcomes and forces of up to `block_size` sets with the same choice of the flux term.
   subroutine solve_block(sets, sampling, force, last_sample, outcomes)
      !> The sets, their input checked: [n_set].
      type(set_type), intent(in) :: sets(:)
      type(sampling_type), intent(in) :: sampling
      !> Elastic forces, then floor forces, N, up to the last contact: [2 block_size, n_sample].
      real(wp), intent(inout), contiguous :: force(:, :)
      !> Index of the last sample that was written.
      integer, intent(out) :: last_sample
      !> The outcomes: [n_set].
      type(set_outcome_type), intent(out) :: outcomes(:)
      type(impact_batch_type), pointer :: impacts
      real(wp), target :: buffer(c_sizeof(impacts)/c_sizeof(1.0_wp) + line_length)
      real(wp) :: sampled(block_size)
      real(wp) :: step
      integer :: i

      call c_f_pointer(c_loc(buffer(get_aligned_start(buffer))), impacts)

      step = 1/(sampling%sample_rate*real(sampling%substeps, wp))
      impacts%shell%weight = compression_weights(sets(1)%flux)
      impacts%restitution_weight = restitution_weights(sets(1)%flux)
      do i = 1, block_size
         ! Balls without a set repeat the last one.
         call set_lane(impacts, i, sets(min(i, size(sets))), step)
      end do
      call solve_impacts(impacts, get_sample_count(sampling), sampling%substeps, force, last_sample)
      sampled = sum(force(block_size + 1:, :last_sample), dim=2)/sampling%sample_rate
      do i = 1, size(sets)
         outcomes(i)%computed = is_computed(impacts, i, sets(i), sampling)
         if (.not. outcomes(i)%computed) cycle
         associate (diameter => 2*sets(i)%ball%outer_radius)
            outcomes(i)%contact_time = impacts%contact(i)*step
            outcomes(i)%peak_elastic_force = impacts%peak_elastic_force(i)
            outcomes(i)%peak_force = impacts%peak_force(i)
            outcomes(i)%max_deflection = impacts%max_deflection(i)*diameter
            outcomes(i)%restitution = -impacts%states(impacts%now)%velocity(i)/impacts%impact_velocity(i)
            outcomes(i)%impulse = sets(i)%ball%mass*(1 + outcomes(i)%restitution)*get_impact_velocity(sets(i)%drop)
         end associate
         outcomes(i)%computed = holds_impulse(sampled(i), outcomes(i)%impulse)
      end do
   end subroutine solve_block

   !> Equation and beginning of one ball; see `thud_shell_batch` for the units.
   pure subroutine set_lane(impacts, i, set, step)
      type(impact_batch_type), intent(inout) :: impacts
      !> Index of the ball.
      integer, intent(in) :: i
      type(set_type), intent(in) :: set
      !> The step, s.
      real(wp), intent(in) :: step
      real(wp) :: pressure_unit

      associate (ball => set%ball, shell => impacts%shell)
         pressure_unit = 2*pi*ball%outer_radius*step**2/ball%mass
         shell%stiffness(i) = get_shell_stiffness(ball)*step**2/ball%mass
         shell%gas_pressure(i) = pressure_unit*(ball%ambient_pressure + ball%gauge_pressure)
         shell%air_pressure(i) = pressure_unit*ball%ambient_pressure
         shell%exponent(i) = -ball%heat_capacity_ratio
         shell%closing(i) = (ball%outer_radius - ball%wall_thickness)/ball%outer_radius
         impacts%impact_velocity(i) = get_impact_velocity(set%drop)*step/(2*ball%outer_radius)
         shell%force_unit(i) = 2*ball%outer_radius*ball%mass/step**2
      end associate
   end subroutine set_lane

   !> Whether a ball has a result: the checks of `solve_lumped`.
   function is_computed(impacts, i, set, sampling) result(computed)
      type(impact_batch_type), intent(in) :: impacts
      integer, intent(in) :: i
      type(set_type), intent(in) :: set
      type(sampling_type), intent(in) :: sampling
      logical :: computed
      type(force_history_type) :: history
      type(error_type), allocatable :: error
      real(wp) :: change, energy

      computed = impacts%released(i) .and. .not. impacts%left(i)
      if (computed) computed = impacts%contact(i) >= min_contact_samples*sampling%substeps
      if (.not. computed) return
      associate (state => impacts%states(impacts%now), v0 => impacts%impact_velocity(i))
         change = abs(state%impulse(i) - (v0 - state%velocity(i)))/(v0 - state%velocity(i))
         energy = abs(state%velocity(i)**2 + 2*state%loss(i) - v0**2)/v0**2
      end associate
      if (max(change, energy) <= doubtful) return
      ! The sums of the single solver, which include the stages of each step, decide.
      call solve_hollow_sphere(set%ball, set%drop, hollow_sphere_type(momentum_flux=flux_choices(set%flux)), sampling, &
         history, error)
      computed = .not. allocated(error)
   end function is_computed

end module thud_shell_sets
