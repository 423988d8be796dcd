!> Options of the modal ball; `thud_modal_ball` adds the solution.
module thud_modal_ball_options
   use thud_ball, only: ball_type
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type, list_type, name_length
   use thud_kinds, only: wp
   use thud_new_field, only: choice_field, integer_field, list_field, logical_field, real_field
   use thud_prony, only: check_fractional_loss
   use thud_sampling, only: sampling_type
   use thud_source_model, only: source_model_type
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: modal_ball_options_type

   !> Options of the model.
   type, abstract, extends(source_model_type) :: modal_ball_options_type
      !> Highest harmonic n whose modes oscillate.
      integer :: harmonics = 48
      !> Number of modes of each harmonic that oscillate.
      integer :: radial_modes = 5
      !> Highest harmonic whose static flexibility is included.
      integer :: static_harmonics = 180
      !> Number of rings of the surface that carry the pressure.
      integer :: rings = 60
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
   contains
      procedure, pass(options) :: get_fields
      procedure, pass(options) :: check
   end type modal_ball_options_type

contains

   !> Keys and allowed ranges.
   function get_fields(options) result(fields)
      class(modal_ball_options_type), intent(in), target :: options
      type(field_type), allocatable :: fields(:)

      fields = [ &
         integer_field('harmonics', options%harmonics, 'highest harmonic with oscillating modes', '[2, 200]'), &
         integer_field('radial_modes', options%radial_modes, 'number of oscillating modes per harmonic', '[1, 20]'), &
         integer_field('static_harmonics', options%static_harmonics, &
         'highest harmonic whose static flexibility is included', '[4, 400]'), &
         integer_field('rings', options%rings, 'number of rings on the surface, from the lowest point to 60 degrees', &
         '[2, static_harmonics/3]'), &
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
         '[0, harmonics]', whole=.true.)]
   end function get_fields

   !> Returns an error if the rings are too few for the harmonics, or if no fractional law has this loss factor.
   subroutine check(ball, options, sampling, error)
      type(ball_type), intent(in) :: ball
      class(modal_ball_options_type), intent(in) :: options
      type(sampling_type), intent(in) :: sampling
      type(error_type), allocatable, intent(out) :: error

      if (3*options%rings < options%harmonics) then
         error = input_error('&modal_ball: harmonics = '//to_text(options%harmonics)//' is too high for rings = ' &
            //to_text(options%rings)//'; allowed: up to three times the rings')
      else if (options%damping_law == 'fractional') then
         call check_fractional_loss('modal_ball', options%fractional_order, options%loss_factor, options%loss_frequency, &
            error)
      end if
   end subroutine check

end module thud_modal_ball_options
