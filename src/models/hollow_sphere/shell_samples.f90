!> Many drops of `thud_hollow_sphere`, a block of balls at a time: the same equation and steps as
!> `solve_hollow_sphere`. The values agree to 1e-10; the impulse agrees to the residual of its balance.
!>
!> Samples that cannot be computed, or whose balances must be checked, are NaN and do not affect others.
module thud_shell_samples
   use, intrinsic :: iso_c_binding, only: c_f_pointer, c_loc, c_sizeof
   use thud_ball, only: ball_type, drop_type, get_ball_fields, get_drop_fields, get_impact_velocity
   use thud_cache_line, only: get_aligned_start, line_length
   use thud_constants, only: not_a_number, pi
   use thud_field, only: field_type, in_group
   use thud_force_history, only: holds_impulse, min_contact_samples
   use thud_hollow_sphere, only: compression_weights, get_shell_stiffness, restitution_weights
   use thud_interval, only: interval_type, new_interval
   use thud_kinds, only: wp
   use thud_sampling, only: get_sample_count, sampling_type
   use thud_shell_impacts, only: impact_batch_type, solve_impacts
   use thud_shell_series, only: batch_size
   implicit none (type, external)
   private

   public :: block_size, get_blocks, get_sample_fields, sample_outcome_type, sample_type, solve_block

   !> Samples of one block.
   integer, parameter :: block_size = batch_size

   !> One drop.
   type :: sample_type
      type(ball_type) :: ball
      type(drop_type) :: drop
      !> Index of the flux term, as in `flux_choices`.
      integer :: flux = 1
   end type sample_type

   !> Outcome of one drop; NaN if it could not be computed.
   type :: sample_outcome_type
      !> Whether the batch has computed the drop; if not, the single solver gives the result or the error.
      logical :: computed = .false.
      !> Time from first touch to release, s.
      real(wp) :: contact_time = not_a_number
      !> Maximum elastic force, N.
      real(wp) :: peak_elastic_force = not_a_number
      !> Maximum force on the floor, N.
      real(wp) :: peak_force = not_a_number
      !> Maximum deflection, m.
      real(wp) :: max_deflection = not_a_number
      !> Velocity at release divided by velocity at first touch.
      real(wp) :: restitution = not_a_number
      !> Impulse on the floor, N s: the change of momentum.
      real(wp) :: impulse = not_a_number
   end type sample_outcome_type

   !> Minimum number of steps in the time in which the maximum deceleration would stop the ball. From there on the balances
   !> of impulse and energy miss by less than 1e-7 and need no check; otherwise the single solver checks them.
   real(wp), parameter :: min_stop_steps = 50.0_wp

contains

   !> Keys and allowed ranges of the numbers of a sample.
   function get_sample_fields(sample) result(fields)
      !> The sample that the fields read and set.
      type(sample_type), intent(in), target :: sample
      !> One field per number: [n_key].
      type(field_type), allocatable :: fields(:)

      fields = [in_group('ball', get_ball_fields(sample%ball)), in_group('drop', get_drop_fields(sample%drop))]
   end function get_sample_fields

   !> Blocks of the samples that can be computed: with one choice of the flux term, so that balls share their equation, and
   !> with similar contact times, because a block takes as long as its longest contact.
   subroutine get_blocks(samples, valid, order, first)
      !> The samples: [n_sample].
      type(sample_type), intent(in) :: samples(:)
      !> Whether the values of each sample lie inside their ranges: [n_sample].
      logical, intent(out) :: valid(:)
      !> Indices of the valid samples: [n_valid].
      integer, allocatable, intent(out) :: order(:)
      !> Indices in `order` at which blocks begin, and the index after the last: [n_block + 1].
      integer, allocatable, intent(out) :: first(:)
      !> Number of classes of contact times per doubling.
      integer, parameter :: classes = 64
      !> Maximum number of classes, for each choice of the flux term.
      integer, parameter :: max_class = 64*classes
      integer :: next(0:size(compression_weights)*max_class)
      integer :: class(size(samples))
      integer :: i, j

      call check_samples(samples, valid)
      next = 0
      do i = 1, size(samples)
         if (.not. valid(i)) cycle
         class(i) = int(classes*(32 + log(get_rough_contact_time(samples(i)))/log(2.0_wp)))
         class(i) = min(max(class(i), 0), max_class - 1) + (samples(i)%flux - 1)*max_class
         next(class(i) + 1) = next(class(i) + 1) + 1
      end do
      do i = 1, ubound(next, 1)
         next(i) = next(i) + next(i - 1)
      end do
      allocate (order(next(ubound(next, 1))))
      first = [((j, j=next((i - 1)*max_class) + 1, next(i*max_class), block_size), &
         i=1, size(compression_weights)), size(order) + 1]
      do i = 1, size(samples)
         if (.not. valid(i)) cycle
         next(class(i)) = next(class(i)) + 1
         order(next(class(i))) = i
      end do
   end subroutine get_blocks

   !> Whether the values of each sample lie inside their ranges.
   subroutine check_samples(samples, valid)
      type(sample_type), intent(in) :: samples(:)
      !> Whether all values of the sample do: [n_sample].
      logical, intent(out) :: valid(:)
      type(sample_type), target :: sample
      type(field_type), allocatable :: fields(:)
      type(interval_type) :: range
      real(wp), allocatable :: values(:, :)
      integer :: i, j

      allocate (fields, source=get_sample_fields(sample))
      allocate (values(size(samples), size(fields)))
      do i = 1, size(samples)
         sample = samples(i)
         do j = 1, size(fields)
            values(i, j) = fields(j)%get_number()
         end do
      end do
      valid = samples%flux >= 1 .and. samples%flux <= size(compression_weights)
      do i = 1, size(fields)
         range = new_interval(fields(i)%range)
         do j = 1, size(samples)
            call range%resolve(fields%key, values(j, :))
            valid(j) = valid(j) .and. range%contains(values(j, i))
         end do
      end do
   end subroutine check_samples

   !> Half a period with the linear spring and the gas to third order, s: amplitude from the energy, period of a Duffing
   !> oscillator by harmonic balance. Accurate to 10 %, and similar for similar samples.
   pure function get_rough_contact_time(sample) result(time)
      type(sample_type), intent(in) :: sample
      real(wp) :: time
      real(wp) :: linear, cubic, speed

      associate (ball => sample%ball)
         linear = (get_shell_stiffness(ball) + 2*pi*ball%outer_radius*ball%gauge_pressure)/ball%mass
         cubic = 1.5_wp*pi*ball%heat_capacity_ratio*(ball%ambient_pressure + ball%gauge_pressure) &
            /(ball%outer_radius*ball%mass)
      end associate
      speed = get_impact_velocity(sample%drop)
      time = pi/sqrt(linear + 0.75_wp*cubic*2*speed**2/(linear + sqrt(linear**2 + 2*cubic*speed**2)))
   end function get_rough_contact_time

   !> Outcomes and forces of up to `block_size` samples with the same choice of the flux term.
   subroutine solve_block(samples, sampling, force, n_written, outcomes)
      !> The samples, with checked input: [n_sample].
      type(sample_type), intent(in) :: samples(:)
      type(sampling_type), intent(in) :: sampling
      !> Elastic forces, then floor forces, N; the first `n_written` instants are set: [2*block_size, n_time].
      real(wp), intent(inout), contiguous :: force(:, :)
      !> Number of instants up to the latest release.
      integer, intent(out) :: n_written
      !> The outcomes: [n_sample].
      type(sample_outcome_type), intent(out) :: outcomes(:)
      type(impact_batch_type), pointer :: impacts
      real(wp), target :: buffer(c_sizeof(impacts)/c_sizeof(1.0_wp) + line_length)
      real(wp) :: sampled(block_size)
      real(wp) :: step, restitution, impulse, max_deceleration
      integer :: i

      call c_f_pointer(c_loc(buffer(get_aligned_start(buffer))), impacts)

      step = 1/(sampling%sample_rate*real(sampling%substeps, wp))
      impacts%shell%weight = compression_weights(samples(1)%flux)
      impacts%restitution_weight = restitution_weights(samples(1)%flux)
      do i = 1, block_size
         ! Lanes without a sample repeat the last one; `thud_shell_series` states the units.
         associate (sample => samples(min(i, size(samples))), shell => impacts%shell)
            associate (ball => sample%ball, pressure_unit => 2*pi*sample%ball%outer_radius*step**2/sample%ball%mass)
               shell%stiffness(i) = get_shell_stiffness(ball)*step**2/ball%mass
               shell%gas_pressure(i) = pressure_unit*(ball%ambient_pressure + ball%gauge_pressure)
               shell%air_pressure(i) = pressure_unit*ball%ambient_pressure
               shell%exponent(i) = -ball%heat_capacity_ratio
               shell%closing(i) = (ball%outer_radius - ball%wall_thickness)/ball%outer_radius
               impacts%impact_velocity(i) = get_impact_velocity(sample%drop)*step/(2*ball%outer_radius)
               shell%force_unit(i) = 2*ball%outer_radius*ball%mass/step**2
            end associate
         end associate
      end do
      call solve_impacts(impacts, get_sample_count(sampling), sampling%substeps, force, n_written)
      ! A loop over instants, which compilers vectorize, unlike the sum of an array over its second dimension.
      sampled = 0.0_wp
      do i = 1, n_written
         sampled = sampled + force(block_size + 1:, i)
      end do
      sampled = sampled/sampling%sample_rate
      do i = 1, size(samples)
         associate (ball => samples(i)%ball, v0 => impacts%impact_velocity(i), max_deflection => impacts%max_deflection(i), &
            outcome => outcomes(i))
            restitution = -impacts%state%velocity(i)/v0
            impulse = ball%mass*(1 + restitution)*get_impact_velocity(samples(i)%drop)
            max_deceleration = impacts%peak_elastic_force(i)/impacts%shell%force_unit(i)/(1 - max_deflection)
            outcome%computed = impacts%contact_steps(i) >= min_contact_samples*sampling%substeps &
               .and. min_stop_steps*max_deceleration <= v0 .and. holds_impulse(sampled(i), impulse)
            if (outcome%computed) outcome = sample_outcome_type(.true., impacts%contact_steps(i)*step, &
               impacts%peak_elastic_force(i), impacts%peak_force(i), 2*ball%outer_radius*max_deflection, restitution, &
               impulse)
         end associate
      end do
   end subroutine solve_block

end module thud_shell_samples
