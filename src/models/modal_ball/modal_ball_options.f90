!> Options of the modal ball; `thud_modal_ball` adds the solution.
module thud_modal_ball_options
   use thud_ball, only: ball_type, get_density
   use thud_constants, only: pi
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type, list_type, name_length
   use thud_force_history, only: force_history_type
   use thud_kinds, only: wp
   use thud_new_field, only: choice_field, integer_field, list_field, logical_field, only_with, real_field
   use thud_prony, only: check_fractional_loss
   use thud_sampling, only: sampling_type
   use thud_source_model, only: resolution_type, source_model_type
   use thud_sphere_modes, only: family_type, get_families
   use thud_surface_rings, only: greatest_angle
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: get_error_ratio, modal_ball_options_type

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
   real(wp), parameter, public :: max_phase = pi/2

   !> Options of the model.
   type, abstract, extends(source_model_type) :: modal_ball_options_type
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
      !> Level of the resolution where the user leaves it open; no key.
      integer :: level = 1
      !> Angle of the outermost ring from the lowest point, rad; no key.
      real(wp) :: outermost_angle = greatest_angle
      !> Highest frequency of the modes of level 0, Hz; no key.
      real(wp) :: coarse_frequency = min_frequency
      !> Modes that levels 0 and 1 share; no key: [0:highest harmonic].
      type(family_type), allocatable :: families(:)
   contains
      procedure :: get_fields
      procedure :: check
      procedure :: get_highest_frequency
      procedure :: get_ring_count
      procedure :: refine
   end type modal_ball_options_type

contains

   !> Keys and allowed ranges.
   function get_fields(self) result(fields)
      class(modal_ball_options_type), intent(in), target :: self
      type(field_type), allocatable :: fields(:)

      fields = [ &
         real_field('highest_frequency', self%highest_frequency, 'Hz', &
         'highest frequency of oscillating modes; faster ones follow without inertia; 0: automatic', '[0, 20000]', &
         is_numerical=.true.), &
         integer_field('rings', self%rings, &
         'number of rings on the surface, from the lowest point to 60 degrees; 0: automatic', '[0, 400]'), &
         choice_field('damping_law', self%damping_law, 'damping law: loss factor as a function of frequency', &
         [character(len=10) :: 'constant', 'rising', 'fractional']), &
         only_with('damping_law', ['rising    ', 'fractional', 'constant  '], [real_field('loss_factor', &
         self%loss_factor, '', 'loss factor, twice the damping ratio', '[0, 1.9]', is_calibrated=.true.)]), &
         only_with('damping_law', ['rising    ', 'fractional'], [real_field('loss_frequency', self%loss_frequency, 'Hz', &
         'frequency at which loss_factor (rising, fractional) and the modulus (fractional) apply', '[0.1, 100000]', &
         is_calibrated=.true.)]), &
         only_with('damping_law', ['fractional'], [real_field('fractional_order', self%fractional_order, '', &
         'order of the derivative, for fractional; 1: as rising', '(0, 1]')]), &
         logical_field('cavity_gas', self%cavity_gas, 'the gas in the cavity resists volume changes'), &
         logical_field('contact_gravity', self%contact_gravity, 'gravity acts also during the contact'), &
         choice_field('floor_friction', self%floor_friction, 'friction of the floor: none or infinite (sticking)', &
         [character(len=5) :: 'none', 'stick']), &
         list_field('static_families', self%static_families, '', 'harmonics treated as quasi-static', &
         '[0, 400]', whole=.true.)]
   end function get_fields

   !> Returns an error if no fractional law has this loss factor, if there is a single ring, or if the modes without inertia
   !> would creep more slowly than the contact.
   subroutine check(self, ball, sampling, error)
      class(modal_ball_options_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      type(sampling_type), intent(in) :: sampling
      type(error_type), allocatable, intent(out) :: error

      if (self%rings == 1) then
         error = input_error('&modal_ball: rings = 1 cannot carry a pressure; allowed: from 2, or 0 for automatic')
      else if (self%highest_frequency > 0.0_wp .and. self%highest_frequency < lowest_frequency) then
         error = input_error('&modal_ball: highest_frequency = '//to_text(self%highest_frequency) &
            //' Hz is not allowed; allowed: from '//to_text(lowest_frequency)//' to 20000 Hz, or 0 for automatic')
      else if (self%damping_law == 'fractional') then
         call check_fractional_loss('modal_ball', self%fractional_order, self%loss_factor, self%loss_frequency, &
            error)
      end if
   end subroutine check

   !> The model at a level of resolution: modes, rings around the contact of the coarser drop, and time steps. Levels 0 and 1
   !> share their modes. If the user sets the resolution, it does not grow.
   subroutine refine(self, ball, level, coarse, sampling, refined, resolution)
      class(modal_ball_options_type), intent(inout) :: self
      type(ball_type), intent(in) :: ball
      integer, intent(in) :: level
      type(force_history_type), intent(in) :: coarse
      type(sampling_type), intent(inout) :: sampling
      class(source_model_type), allocatable, intent(out) :: refined
      type(resolution_type), intent(out) :: resolution
      class(modal_ball_options_type), allocatable :: finer
      real(wp) :: contact_steps
      integer :: refinement
      logical :: few_modes

      if (level == 0) call share_modes(self, ball, sampling)
      if (level > 1 .and. allocated(self%families)) deallocate (self%families)
      allocate (finer, source=self)
      finer%level = level
      refinement = 2**level
      contact_steps = coarse%contact_time*sampling%sample_rate*sampling%substeps
      ! Sticking rings converge slowly; without them few steps suffice.
      if (contact_steps > 0.0_wp .and. self%floor_friction /= 'stick') then
         refinement = min(2*refinement, max(refinement/2, ceiling(min_steps/contact_steps)))
      end if
      sampling%substeps = sampling%substeps*refinement
      few_modes = has_few_modes(self, self%coarse_frequency)
      ! A ball with few modes may have a larger contact than one with more.
      if (self%rings == 0 .and. allocated(coarse%model_history) .and. .not. few_modes) finer%outermost_angle = &
         min(greatest_angle, margin*asin(maxval(coarse%model_history(:, 1))/ball%outer_radius) &
         + added_rings*greatest_angle/(coarse_rings - 1))
      resolution = resolution_type(lowers_error=level <= 1 .or. level <= highest_level .and. .not. few_modes &
         .and. (self%rings == 0 .or. .not. self%highest_frequency > 0.0_wp), reference=level - 1)
      call move_alloc(finer, refined)
   end subroutine refine

   !> Computes the modes of levels 0 and 1.
   subroutine share_modes(self, ball, sampling)
      class(modal_ball_options_type), intent(inout) :: self
      type(ball_type), intent(in) :: ball
      !> Sampling of the input.
      type(sampling_type), intent(in) :: sampling
      type(error_type), allocatable :: error
      real(wp) :: highest_omega

      self%coarse_frequency = get_coarse_frequency(ball)
      highest_omega = min(2*pi*max(get_level_frequency(self, 0), get_level_frequency(self, 1)), &
         max_phase*sampling%sample_rate*sampling%substeps*max_refinement)
      ! After an error there are no families; the drop repeats it, and returns the error.
      call get_families(ball, self%cavity_gas, highest_omega, self%families, error)
   end subroutine share_modes

   !> Highest frequency of the modes of level 0, Hz.
   pure function get_coarse_frequency(ball) result(frequency)
      type(ball_type), intent(in) :: ball
      real(wp) :: frequency

      frequency = max(min_frequency, min_relative_frequency*get_shear_velocity(ball)/ball%outer_radius)
   end function get_coarse_frequency

   !> Velocity of shear waves, m/s.
   pure function get_shear_velocity(ball) result(velocity)
      type(ball_type), intent(in) :: ball
      real(wp) :: velocity

      velocity = sqrt(ball%youngs_modulus/(2*(1 + ball%poisson_ratio)*get_density(ball)))
   end function get_shear_velocity

   !> Estimated error of a result divided by its difference from the next coarser level: it is found from random balls
   !> (docs/modal_ball.md).
   pure function get_error_ratio(ball, history) result(ratio)
      type(ball_type), intent(in) :: ball
      !> The result.
      type(force_history_type), intent(in) :: history
      real(wp) :: ratio

      ! Wide contacts and compressible walls converge more slowly.
      ratio = usual_ratio + 25*max(0.0_wp, history%max_deflection/ball%outer_radius - wide_contact)
      if (ball%poisson_ratio < compressible) ratio = max(ratio, 2.5_wp)
   end function get_error_ratio

   !> Number of rings: that of the user, fewer at level 0, or that of the level of resolution.
   pure function get_ring_count(self) result(n_ring)
      class(modal_ball_options_type), intent(in) :: self
      integer :: n_ring

      n_ring = nint(merge(coarse_rings, default_rings*ratio**(self%level - 1), self%level == 0))
      if (self%rings > 0) n_ring = max(2, nint(self%rings*ratio**(self%level - 1)))
   end function get_ring_count

   !> Highest frequency of oscillating modes at the level of resolution, Hz.
   pure function get_highest_frequency(self) result(frequency)
      class(modal_ball_options_type), intent(in) :: self
      real(wp) :: frequency

      frequency = get_level_frequency(self, self%level)
   end function get_highest_frequency

   !> Highest frequency of oscillating modes at a level of resolution, Hz: automatic, or that of the user at level 1, lower
   !> at level 0. If the user leaves out modes that matter, the other levels have them, so that the error is known.
   pure function get_level_frequency(self, level) result(frequency)
      class(modal_ball_options_type), intent(in) :: self
      integer, intent(in) :: level
      real(wp) :: frequency

      if (self%highest_frequency > 0.0_wp .and. (level == 1 &
         .or. .not. has_few_modes(self, self%coarse_frequency))) then
         frequency = self%highest_frequency*ratio**(level - 1)
      else
         frequency = get_automatic_frequency(self, self%coarse_frequency, level)
      end if
   end function get_level_frequency

   !> Highest frequency of oscillating modes at a level of resolution where the user leaves it open, Hz.
   pure function get_automatic_frequency(self, coarse_frequency, level) result(frequency)
      class(modal_ball_options_type), intent(in) :: self
      !> That of level 0 without sticking, Hz.
      real(wp), intent(in) :: coarse_frequency
      integer, intent(in) :: level
      real(wp) :: frequency

      frequency = coarse_frequency*ratio**level
      ! Rings that are released lose the energy of modes without inertia.
      if (self%floor_friction == 'stick') frequency = 2*frequency
   end function get_automatic_frequency

   !> Whether the user's highest frequency is so low that even level 0 has more modes where it is automatic.
   pure function has_few_modes(self, coarse_frequency) result(yes)
      class(modal_ball_options_type), intent(in) :: self
      !> Automatic frequency of level 0 without sticking, Hz.
      real(wp), intent(in) :: coarse_frequency
      logical :: yes

      yes = self%highest_frequency > 0.0_wp .and. self%highest_frequency*ratio &
         < get_automatic_frequency(self, coarse_frequency, 0)
   end function has_few_modes

end module thud_modal_ball_options
