!> The improved analytical model that the paper asks for (section 5): the exact modes of the free hollow sphere under
!> unilateral contact with the floor. Apart from the numerical resolution, its only input is geometry and material.
!>
!> Modes up to a highest frequency oscillate; all others follow the forces without inertia, by their flexibility and the
!> creep of the material. Time steps are exact for each mode. In every step the forces of the surface rings make gaps and
!> pressures complementary: no ring penetrates, none pulls, and there is no penalty stiffness.
module thud_modal_ball
   use thud_ball, only: ball_type, drop_type, get_density, get_impact_velocity
   use thud_constants, only: pi
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type, list_type, name_length, new_field, only_with
   use thud_force_history, only: add_model_quantity, force_history_type
   use thud_kinds, only: wp
   use thud_modal_compression, only: compress_modal_ball, get_flexibilities
   use thud_modal_run, only: march, modal_run_type, start_run
   use thud_mode_step, only: damping_type, index_amplitude, new_damping, new_modes, new_static_step, set_factors
   use thud_prony, only: check_fractional_loss
   use thud_receiver, only: new_receiver_step, receiver_type
   use thud_ring_contact, only: new_ring_contact
   use thud_sampling, only: sampling_type
   use thud_source_model, only: resolution_type, source_model_type
   use thud_sphere_modes, only: family_type, get_families, limit_family
   use thud_surface_rings, only: get_ring_response, greatest_angle, new_surface_rings
   use thud_text, only: to_text
   use thud_validity_limit, only: get_gravity_limit, get_wall_limits, validity_limit_type
   implicit none (type, external)
   private

   public :: modal_ball_type

   !> Modulus of elasticity of the standard ball, Pa, calibrated (docs/standard_ball.md): for linear modes an effective
   !> modulus.
   real(wp), parameter, public :: modal_ball_modulus = 1.56e6_wp

   !> Rings of levels 0 and 1.
   real(wp), parameter :: coarse_rings = 36.0_wp, default_rings = 40.0_wp

   !> Minimum of the highest frequency of the modes of level 0, Hz, and the same for stiff balls, divided by the velocity of
   !> shear waves per outer radius.
   real(wp), parameter :: min_frequency = 1000.0_wp, min_relative_frequency = 2.1_wp

   !> Minimum of the highest frequency that the user may state, Hz.
   real(wp), parameter :: lowest_frequency = 10.0_wp

   !> Ratio of frequencies from one level to the next, and of rings from level 1 on.
   real(wp), parameter :: ratio = 1.4_wp

   !> Highest level of resolution.
   integer, parameter :: highest_level = 3

   !> Angle of the outermost ring divided by that of the contact of a coarser drop; rings of level 0 are added.
   real(wp), parameter :: margin = 1.1_wp
   integer, parameter :: added_rings = 2

   !> Error of a level divided by its difference from the next coarser one: 1/(ratio**2 - 1) for the error of second order,
   !> and half as much again for modes that enter one by one (docs/modal_ball.md).
   real(wp), parameter :: usual_ratio = 1.5_wp

   !> Deflection relative to the radius above which, and Poisson's ratio below which it is larger.
   real(wp), parameter :: wide_contact = 0.36_wp, compressible = 0.4_wp

   !> Number of steps in a contact from level 1 on, as far as at most twice the steps of a level reach it.
   real(wp), parameter :: min_steps = 500.0_wp

   !> Maximum number of steps of level 1 in a step of the input, see `refine`.
   integer, parameter :: max_refinement = 4

   !> Maximum phase angle of a mode in a step; faster modes respond statically.
   real(wp), parameter :: max_phase = pi/2

   !> The model with its options.
   type, extends(source_model_type) :: modal_ball_type
      !> Highest frequency of modes that oscillate, Hz; 0: chosen with the resolution.
      real(wp) :: highest_frequency = 0.0_wp
      !> Number of rings of the surface that carry the pressure; 0: chosen with the resolution.
      integer :: rings = 0
      !> Loss factor: `constant`, `rising` in proportion to frequency, or of a `fractional` law.
      character(len=name_length) :: damping_law = 'rising'
      !> Loss factor, twice the damping ratio.
      real(wp) :: loss_factor = 0.31_wp
      !> Frequency at which `loss_factor` applies if it is not constant, Hz. At this frequency the storage modulus is the
      !> modulus of the ball.
      real(wp) :: loss_frequency = 74.0_wp
      !> Order of the fractional derivative.
      real(wp) :: fractional_order = 0.3_wp
      !> Whether the gas in the cavity resists changes of its volume.
      logical :: cavity_gas = .true.
      !> Whether gravity acts during the contact too.
      logical :: contact_gravity = .false.
      !> Friction of the floor: `none`, or `stick` (touching rings do not slide).
      character(len=name_length) :: floor_friction = 'none'
      !> Harmonics treated as quasi-static instead of oscillating.
      type(list_type) :: static_families
      !> Set by `refine`, no keys: angle of the outermost ring from the lowest point, rad, and modes that levels 0 and 1
      !> share: [0:highest harmonic].
      real(wp) :: outermost_angle = greatest_angle
      type(family_type), allocatable :: families(:)
   contains
      procedure :: get_fields
      procedure :: check
      procedure :: refine
      procedure :: solve
      procedure :: compress
      procedure :: get_validity_limits
   end type modal_ball_type

contains

   !> Keys and allowed ranges.
   function get_fields(self) result(fields)
      class(modal_ball_type), intent(in), target :: self
      type(field_type), allocatable :: fields(:)
      ! Laws with a loss factor, the calibrated one first; those with a frequency; that of an order.
      character(len=*), parameter :: laws(3) = [character(len=10) :: 'rising', 'fractional', 'constant']

      fields = [ &
         new_field('highest_frequency', self%highest_frequency, 'Hz', &
         'highest frequency of oscillating modes; faster ones follow without inertia; 0: automatic', '[0, 20000]', &
         trait='numerical'), &
         new_field('rings', self%rings, '', &
         'number of rings on the surface, from the lowest point to 60 degrees; 0: automatic', '[0, 400]'), &
         new_field('damping_law', self%damping_law, '', 'damping law: loss factor as a function of frequency', &
         choices=[character(len=10) :: 'constant', 'rising', 'fractional']), &
         only_with('damping_law', [new_field('loss_factor', self%loss_factor, '', &
         'loss factor, twice the damping ratio', '[0, 1.9]', trait='calibrated')], laws), &
         only_with('damping_law', [new_field('loss_frequency', self%loss_frequency, 'Hz', &
         'frequency at which loss_factor (rising, fractional) and the modulus (fractional) apply', '[0.1, 100000]', &
         trait='calibrated')], laws(:2)), &
         only_with('damping_law', [new_field('fractional_order', self%fractional_order, '', &
         'order of the derivative, for fractional; 1: as rising', '(0, 1]')], laws(2:2)), &
         new_field('cavity_gas', self%cavity_gas, '', 'the gas in the cavity resists volume changes'), &
         new_field('contact_gravity', self%contact_gravity, '', 'gravity acts also during the contact'), &
         new_field('floor_friction', self%floor_friction, '', 'friction of the floor: none or infinite (sticking)', &
         choices=[character(len=5) :: 'none', 'stick']), &
         new_field('static_families', self%static_families, '', 'harmonics treated as quasi-static', &
         '[0, 400]', trait='whole')]
   end function get_fields

   !> Returns an error if no fractional law has this loss factor, if there is a single ring, or if the modes without inertia
   !> would creep more slowly than the contact.
   subroutine check(self, ball, sampling, error)
      class(modal_ball_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      type(sampling_type), intent(in) :: sampling
      type(error_type), allocatable, intent(out) :: error

      if (self%rings == 1) then
         error = input_error('= 1 cannot carry a pressure; allowed: from 2, or 0 for automatic', 'modal_ball', 'rings')
      else if (self%highest_frequency > 0.0_wp .and. self%highest_frequency < lowest_frequency) then
         error = input_error('= '//to_text(self%highest_frequency)//' Hz is not allowed; allowed: from ' &
            //to_text(lowest_frequency)//' to 20000 Hz, or 0 for automatic', 'modal_ball', 'highest_frequency')
      else if (self%damping_law == 'fractional') then
         call check_fractional_loss('modal_ball', self%fractional_order, self%loss_factor, self%loss_frequency, &
            error)
      end if
   end subroutine check

   !> The model at a level of resolution: modes, rings around the contact of the coarser drop, and time steps. Levels 0 and 1
   !> share their modes. If the user sets the resolution, it does not grow.
   subroutine refine(self, ball, level, coarse, sampling, refined, resolution)
      class(modal_ball_type), intent(inout) :: self
      type(ball_type), intent(in) :: ball
      integer, intent(in) :: level
      type(force_history_type), intent(in) :: coarse
      type(sampling_type), intent(inout) :: sampling
      class(source_model_type), allocatable, intent(out) :: refined
      type(resolution_type), intent(out) :: resolution
      class(modal_ball_type), allocatable :: finer
      type(error_type), allocatable :: error
      real(wp) :: contact_steps
      integer :: refinement
      logical :: few_modes

      ! After an error there are no families; the drop repeats it, and returns the error.
      if (level == 0) call get_families(ball, self%cavity_gas, min(2*pi*max(get_frequency(self, ball, 0), &
         get_frequency(self, ball, 1)), max_phase*sampling%sample_rate*sampling%substeps*max_refinement), &
         self%families, error)
      if (level > 1 .and. allocated(self%families)) deallocate (self%families)
      allocate (finer, source=self)
      finer%rings = get_ring_count(self, level)
      finer%highest_frequency = get_frequency(self, ball, level)
      refinement = 2**level
      contact_steps = coarse%contact_time*sampling%sample_rate*sampling%substeps
      ! Sticking rings converge slowly; without them few steps suffice.
      if (contact_steps > 0.0_wp .and. self%floor_friction /= 'stick') then
         refinement = min(2*refinement, max(refinement/2, ceiling(min_steps/contact_steps)))
      end if
      sampling%substeps = sampling%substeps*refinement
      few_modes = has_few_modes(self, ball)
      ! A ball with few modes may have a larger contact than one with more.
      if (self%rings == 0 .and. allocated(coarse%model_history) .and. .not. few_modes) finer%outermost_angle = &
         min(greatest_angle, margin*asin(maxval(coarse%model_history(:, 1))/ball%outer_radius) &
         + added_rings*greatest_angle/(coarse_rings - 1))
      resolution = resolution_type(lowers_error=level <= 1 .or. level <= highest_level .and. .not. few_modes &
         .and. (self%rings == 0 .or. .not. self%highest_frequency > 0.0_wp), reference=level - 1)
      call move_alloc(finer, refined)
   end subroutine refine

   !> Number of rings: that of the user, fewer at level 0, or that of the level of resolution.
   pure function get_ring_count(self, level) result(n_ring)
      type(modal_ball_type), intent(in) :: self
      integer, intent(in) :: level
      integer :: n_ring

      n_ring = nint(merge(coarse_rings, default_rings*ratio**(level - 1), level == 0))
      if (self%rings > 0) n_ring = max(2, nint(self%rings*ratio**(level - 1)))
   end function get_ring_count

   !> Highest frequency of oscillating modes at a level of resolution, Hz: automatic, or that of the user at level 1, lower
   !> at level 0. If the user leaves out modes that matter, the other levels have them, so that the error is known.
   pure function get_frequency(self, ball, level) result(frequency)
      type(modal_ball_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      integer, intent(in) :: level
      real(wp) :: frequency

      if (self%highest_frequency > 0.0_wp .and. (level == 1 .or. .not. has_few_modes(self, ball))) then
         frequency = self%highest_frequency*ratio**(level - 1)
      else
         frequency = get_automatic_frequency(self, ball)*ratio**level
      end if
   end function get_frequency

   !> Highest frequency of oscillating modes at level 0 where the user leaves it open, Hz.
   pure function get_automatic_frequency(self, ball) result(frequency)
      type(modal_ball_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      real(wp) :: frequency

      frequency = max(min_frequency, min_relative_frequency*sqrt(ball%youngs_modulus/(2*(1 + ball%poisson_ratio) &
         *get_density(ball)))/ball%outer_radius)
      ! Rings that are released lose the energy of modes without inertia.
      if (self%floor_friction == 'stick') frequency = 2*frequency
   end function get_automatic_frequency

   !> Whether the user's highest frequency is so low that even level 0 has more modes where it is automatic.
   pure function has_few_modes(self, ball) result(yes)
      type(modal_ball_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      logical :: yes

      yes = self%highest_frequency > 0.0_wp .and. self%highest_frequency*ratio < get_automatic_frequency(self, ball)
   end function has_few_modes

   !> Limits of linear modes.
   function get_validity_limits(self, ball, drop, history) result(limits)
      class(modal_ball_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      type(drop_type), intent(in) :: drop
      type(force_history_type), intent(in) :: history
      type(validity_limit_type), allocatable :: limits(:)

      limits = get_wall_limits(ball, history)
      if (.not. self%contact_gravity) limits = [limits, get_gravity_limit(drop, history)]
   end function get_validity_limits

   !> Force on each of two plates in a quasi-static compression, with the long-term modulus.
   subroutine compress(self, ball, deflection, force, error)
      class(modal_ball_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      real(wp), intent(in) :: deflection(:)
      real(wp), intent(out) :: force(:)
      type(error_type), allocatable, intent(out) :: error
      type(ball_type) :: relaxed
      type(damping_type) :: damping

      call new_damping(self%damping_law, self%loss_factor, self%loss_frequency, self%fractional_order, &
         get_frequency(self, ball, 1), damping)
      relaxed = ball
      relaxed%youngs_modulus = damping%equilibrium_ratio*ball%youngs_modulus
      call compress_modal_ball(relaxed, self%cavity_gas, new_surface_rings(get_ring_count(self, 1), greatest_angle, &
         self%floor_friction == 'stick'), deflection, force, error)
   end subroutine compress

   !> Force history of one drop.
   subroutine solve(self, ball, drop, sampling, history, error, receiver)
      class(modal_ball_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      type(drop_type), intent(in) :: drop
      type(sampling_type), intent(in) :: sampling
      type(force_history_type), intent(out) :: history
      type(error_type), allocatable, intent(out) :: error
      type(receiver_type), intent(in), optional :: receiver
      type(modal_run_type) :: run

      if (present(receiver)) run%floor = receiver
      run%ball = ball
      run%interval = 1/(sampling%sample_rate*real(sampling%substeps, wp))
      call prepare(self, run, error)
      if (allocated(error)) return
      call start_run(run, get_impact_velocity(drop), merge(drop%gravity, 0.0_wp, self%contact_gravity))
      call march(run, sampling, history, error)
      ! Wide contacts and compressible walls converge more slowly; the numbers are found from random balls
      ! (docs/modal_ball.md).
      history%error_ratio = usual_ratio + 25*max(0.0_wp, history%max_deflection/ball%outer_radius - wide_contact)
      if (ball%poisson_ratio < compressible) history%error_ratio = max(history%error_ratio, 2.5_wp)
      call add_model_quantity(history, 'rings', '', real(size(run%rings%radius), wp))
      call add_model_quantity(history, 'highest_frequency', 'Hz', &
         min(get_frequency(self, ball, 1), max_phase/(2*pi*run%interval)))
      call add_model_quantity(history, 'substeps', '', real(sampling%substeps, wp))
   end subroutine solve

   !> Sets the steps of the modes, and the contact of the rings.
   subroutine prepare(self, run, error)
      type(modal_ball_type), intent(in) :: self
      !> The run; ball, floor and length of a step are set.
      type(modal_run_type), intent(inout) :: run
      !> Set if the modes cannot be computed, or if the rings cannot be distinguished.
      type(error_type), allocatable, intent(out) :: error
      type(family_type), allocatable :: families(:)
      real(wp), allocatable :: flexibility(:, :, :), gain(:, :, :), response(:, :)
      real(wp) :: highest_omega, omega
      integer :: i, n

      highest_omega = min(2*pi*get_frequency(self, run%ball, 1), max_phase/run%interval)
      if (allocated(self%families)) then
         families = self%families
      else
         call get_families(run%ball, self%cavity_gas, highest_omega, families, error)
         if (allocated(error)) return
      end if
      do n = 0, ubound(families, 1)
         omega = highest_omega
         if (any(nint(self%static_families%values(:self%static_families%count)) == n)) omega = 0.0_wp
         call limit_family(omega, families(n))
      end do
      run%rings = new_surface_rings(get_ring_count(self, 1), self%outermost_angle, self%floor_friction == 'stick')
      run%modes = new_modes(families, run%rings)
      call new_damping(self%damping_law, self%loss_factor, self%loss_frequency, self%fractional_order, &
         get_frequency(self, run%ball, 1), run%modes%damping)
      call set_factors(run%modes, run%interval)
      call get_flexibilities(run%ball, self%cavity_gas, families, ubound(run%rings%shape_at_ring, 3), flexibility, error)
      if (allocated(error)) return
      run%static_modes = new_static_step(run%modes%damping, run%interval, get_ring_response(run%rings, flexibility))
      ! Response of the oscillating modes after one step, of those without inertia, of the rigid ball and of the floor.
      allocate (gain(2, 2, 0:ubound(run%modes%first, 1) - 1), source=0.0_wp)
      do i = 1, size(run%modes%omega)
         associate (g => gain(:, :, run%modes%harmonic(i)), surface => run%modes%surface(i, :))
            g = g + run%modes%gain(i, index_amplitude)*spread(surface, 1, 2)*spread(surface, 2, 2)
         end associate
      end do
      response = run%static_modes%gain(1)*run%static_modes%flexibility + get_ring_response(run%rings, gain)
      run%floor_step = new_receiver_step(run%floor, run%interval)
      associate (own => response(::run%rings%n_dof, ::run%rings%n_dof))
         own = own + (run%interval**2/(2*run%ball%mass) + run%floor_step%compliance)
      end associate
      call new_ring_contact(response, run%rings%n_dof, run%contact, error)
   end subroutine prepare

end module thud_modal_ball
