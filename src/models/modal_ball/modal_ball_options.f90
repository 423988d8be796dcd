!> Options of the modal ball; `thud_modal_ball` adds the solution.
module thud_modal_ball_options
   use thud_ball, only: ball_type, get_density
   use thud_blas_threads, only: restore_blas_threads, use_one_blas_thread
   use thud_constants, only: pi
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type, list_type, name_length
   use thud_force_history, only: force_history_type
   use thud_kinds, only: wp
   use thud_new_field, only: choice_field, integer_field, list_field, logical_field, real_field
   use thud_prony, only: check_fractional_loss
   use thud_sampling, only: sampling_type
   use thud_source_model, only: source_model_type
   use thud_sphere_modes, only: family_type, get_families
   use thud_surface_rings, only: greatest_angle
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: modal_ball_options_type

   !> Rings of levels 0 and 1.
   real(wp), parameter :: coarse_rings = 36.0_wp, default_rings = 40.0_wp

   !> Minimum of the highest frequency of the modes of level 0, Hz, and the same for stiff balls, divided by the velocity of
   !> shear waves per outer radius.
   real(wp), parameter :: min_frequency = 1000.0_wp, min_relative_frequency = 2.1_wp

   !> Ratio of frequencies from one level to the next, and of rings from level 1 on.
   real(wp), parameter :: ratio = 1.4_wp

   !> Highest level of resolution.
   integer, parameter :: highest_level = 3

   !> Angle of the outermost ring divided by that of the contact of a coarser drop; rings of level 0 are added.
   real(wp), parameter :: margin = 1.1_wp
   integer, parameter :: added_rings = 2

   !> Number of steps in a contact from level 1 on, as far as at most twice the steps of a level reach it.
   real(wp), parameter :: min_steps = 500.0_wp

   !> Maximum number of steps of level 1 in a step of the input, see `set_level`.
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
      character(len=name_length) :: damping_law = 'constant'
      !> Loss factor, twice the damping ratio.
      real(wp) :: loss_factor = 0.1_wp
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
      procedure, pass(options) :: get_fields
      procedure, pass(options) :: check
      procedure, pass(options) :: get_highest_frequency
      procedure, pass(options) :: get_ring_count
      procedure, pass(options) :: share_setup
      procedure, pass(options) :: set_level
      procedure, pass(options) :: get_highest_level
      procedure, pass(options) :: get_error_ratio
   end type modal_ball_options_type

contains

   !> Keys and allowed ranges.
   function get_fields(options) result(fields)
      class(modal_ball_options_type), intent(in), target :: options
      type(field_type), allocatable :: fields(:)

      fields = [ &
         real_field('highest_frequency', options%highest_frequency, 'Hz', &
         'highest frequency of oscillating modes; faster ones follow without inertia; 0: automatic', '[0, 20000]', &
         is_numerical=.true.), &
         integer_field('rings', options%rings, &
         'number of rings on the surface, from the lowest point to 60 degrees; 0: automatic', '[0, 400]'), &
         choice_field('damping_law', options%damping_law, 'damping law: loss factor as a function of frequency', &
         [character(len=10) :: 'constant', 'rising', 'fractional']), &
         real_field('loss_factor', options%loss_factor, '', 'loss factor, twice the damping ratio', &
         '[0, 1.9]'), &
         real_field('loss_frequency', options%loss_frequency, 'Hz', &
         'frequency at which loss_factor (rising, fractional) and the modulus (fractional) apply', '[0.1, 100000]'), &
         real_field('fractional_order', options%fractional_order, '', &
         'order of the derivative, for fractional; 1: as rising', '(0, 1]'), &
         logical_field('cavity_gas', options%cavity_gas, 'the gas in the cavity resists volume changes'), &
         logical_field('contact_gravity', options%contact_gravity, 'gravity acts also during the contact'), &
         choice_field('floor_friction', options%floor_friction, 'friction of the floor: none or infinite (sticking)', &
         [character(len=5) :: 'none', 'stick']), &
         list_field('static_families', options%static_families, '', 'harmonics treated as quasi-static', &
         '[0, 400]', whole=.true.)]
   end function get_fields

   !> Returns an error if no fractional law has this loss factor, or if there is a single ring.
   subroutine check(ball, options, sampling, error)
      type(ball_type), intent(in) :: ball
      class(modal_ball_options_type), intent(in) :: options
      type(sampling_type), intent(in) :: sampling
      type(error_type), allocatable, intent(out) :: error

      if (options%rings == 1) then
         error = input_error('&modal_ball: rings = 1 cannot carry a pressure; allowed: from 2, or 0 for automatic')
      else if (options%damping_law == 'fractional') then
         call check_fractional_loss('modal_ball', options%fractional_order, options%loss_factor, options%loss_frequency, &
            error)
      end if
   end subroutine check

   !> Computes the modes of level 1, which include those of level 0.
   subroutine share_setup(ball, options, sampling)
      type(ball_type), intent(in) :: ball
      class(modal_ball_options_type), intent(inout) :: options
      type(sampling_type), intent(in) :: sampling
      type(error_type), allocatable :: error
      real(wp) :: highest_omega

      options%level = 1
      associate (shear_modulus => ball%youngs_modulus/(2*(1 + ball%poisson_ratio)))
         options%coarse_frequency = max(min_frequency, &
            min_relative_frequency*sqrt(shear_modulus/get_density(ball))/ball%outer_radius)
      end associate
      highest_omega = min(2*pi*options%get_highest_frequency(), &
         max_phase*sampling%sample_rate*sampling%substeps*max_refinement)
      call use_one_blas_thread()
      ! After an error there are no families; the drop repeats it, and returns the error.
      call get_families(ball, options%cavity_gas, highest_omega, options%families, error)
      call restore_blas_threads()
   end subroutine share_setup

   !> Sets the resolution: modes, rings around the contact of the coarser drop, and time steps.
   subroutine set_level(ball, options, level, sampling, coarse)
      type(ball_type), intent(in) :: ball
      class(modal_ball_options_type), intent(inout) :: options
      integer, intent(in) :: level
      type(sampling_type), intent(inout) :: sampling
      type(force_history_type), intent(in) :: coarse

      real(wp) :: contact_steps
      integer :: refinement

      if (level > 1 .and. allocated(options%families)) deallocate (options%families)
      options%level = level
      refinement = 2**level
      contact_steps = coarse%contact_time*sampling%sample_rate*sampling%substeps
      ! Sticking rings converge slowly; without them few steps suffice.
      if (contact_steps > 0.0_wp .and. options%floor_friction /= 'stick') then
         refinement = min(2*refinement, max(refinement/2, ceiling(min_steps/contact_steps)))
      end if
      sampling%substeps = sampling%substeps*refinement
      if (options%rings > 0 .or. .not. allocated(coarse%model_history)) return
      options%outermost_angle = min(greatest_angle, margin*asin(maxval(coarse%model_history(:, 1))/ball%outer_radius) &
         + added_rings*greatest_angle/(coarse_rings - 1))
   end subroutine set_level

   !> Highest level of resolution: the user's keys do not grow.
   function get_highest_level(ball, options, sampling) result(level)
      type(ball_type), intent(in) :: ball
      class(modal_ball_options_type), intent(in) :: options
      type(sampling_type), intent(in) :: sampling
      integer :: level

      level = merge(1, highest_level, options%rings > 0 .and. options%highest_frequency > 0.0_wp)
   end function get_highest_level

   !> Estimated error of a result divided by its difference from the next coarser level: it is found from random balls
   !> (docs/modal_ball.md).
   function get_error_ratio(options, level) result(ratio)
      class(modal_ball_options_type), intent(in) :: options
      integer, intent(in) :: level
      real(wp) :: ratio

      ratio = 1.0_wp
   end function get_error_ratio

   !> Number of rings: that of the user, fewer at level 0, or that of the level of resolution.
   pure function get_ring_count(options) result(n_ring)
      class(modal_ball_options_type), intent(in) :: options
      integer :: n_ring

      n_ring = nint(merge(coarse_rings, default_rings*ratio**(options%level - 1), options%level == 0))
      if (options%rings > 0) n_ring = max(2, nint(options%rings*ratio**(options%level - 1)))
   end function get_ring_count

   !> Highest frequency of oscillating modes, Hz: that of the user, lower at level 0, or that of the level of resolution.
   pure function get_highest_frequency(options) result(frequency)
      class(modal_ball_options_type), intent(in) :: options
      real(wp) :: frequency

      frequency = options%highest_frequency*ratio**(options%level - 1)
      if (frequency > 0.0_wp) return
      frequency = options%coarse_frequency*ratio**options%level
      ! Rings that are released lose the energy of modes without inertia.
      if (options%floor_friction == 'stick') frequency = 2*frequency
   end function get_highest_frequency

end module thud_modal_ball_options
