!> Damping of the modes.
module thud_modal_damping
   use thud_constants, only: pi
   use thud_fractional_loss, only: new_fractional_loss
   use thud_kinds, only: wp
   use thud_modal_ball_options, only: modal_ball_options_type
   use thud_mode_step, only: mode_step_type
   use thud_prony, only: fit_fractional_loss, get_storage_ratio
   implicit none (type, external)
   private

   public :: set_damping

contains

   !> Sets the Maxwell branches and the damping ratios of the modes.
   subroutine set_damping(options, modes, damping_ratio)
      class(modal_ball_options_type), intent(in) :: options
      !> The modes; their branches are set here.
      type(mode_step_type), intent(inout) :: modes
      !> Damping ratios: [n_mode].
      real(wp), intent(out) :: damping_ratio(:)
      real(wp) :: viscosity

      allocate (modes%relative_modulus(0), modes%time(0))
      select case (options%damping_law)
      case ('rising')
         modes%retardation_time = options%loss_factor/(2*pi*options%loss_frequency)
         damping_ratio = modes%retardation_time*modes%omega/2
      case ('fractional')
         call fit_fractional_loss(new_fractional_loss(options%fractional_order, options%loss_factor, &
            options%loss_frequency), modes%relative_modulus, modes%time, viscosity)
         modes%equilibrium_ratio = 1/get_storage_ratio(modes%relative_modulus, modes%time, 2*pi*options%loss_frequency)
         modes%relative_modulus = modes%relative_modulus*modes%equilibrium_ratio
         modes%retardation_time = viscosity*modes%equilibrium_ratio
         damping_ratio = modes%retardation_time*modes%omega/2
      case default
         damping_ratio = options%loss_factor/2
         modes%retardation_time = options%loss_factor/(2*pi*options%get_highest_frequency())
      end select
   end subroutine set_damping

end module thud_modal_damping
