!> Material of the ball in the transient model: options of the group `&material`, and the moduli that follow from them.
module thud_material
   use thud_ball, only: ball_type, get_density
   use thud_constants, only: pi
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type, list_type, name_length, new_field, only_with
   use thud_kinds, only: wp
   use thud_prony, only: check_fractional_loss, fit_constant_loss, fit_fractional_loss, get_modulus_ratio
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: check_material, get_material_fields, get_material_loss_factor, material_options_type, material_type, &
      new_material

   !> Maximum number of Maxwell branches.
   integer, parameter :: max_branches = 16

   !> Options of the group.
   type :: material_options_type
      !> Law of elasticity: `neo_hookean` or `mooney_rivlin`.
      character(len=name_length) :: law = 'neo_hookean'
      !> Second-invariant fraction of the shear modulus of a Mooney-Rivlin solid.
      real(wp) :: mooney_share = 0.2_wp
      !> Maximum bulk modulus divided by shear modulus, which limits Poisson's ratio.
      real(wp) :: bulk_ratio = 200.0_wp
      !> Law of viscosity: `none`, `kelvin_voigt`, `fractional`, `constant_loss` or `prony`.
      character(len=name_length) :: viscosity = 'fractional'
      !> Loss factor at `loss_frequency`.
      real(wp) :: loss_factor = 0.21_wp
      !> Frequency of the loss factor, Hz; there the storage modulus is the ball's modulus of elasticity.
      real(wp) :: loss_frequency = 74.0_wp
      !> Order of the fractional derivative.
      real(wp) :: fractional_order = 0.75_wp
      !> Prony series: moduli divided by the long-term modulus.
      type(list_type) :: prony_share
      !> Prony series: relaxation times, s.
      type(list_type) :: prony_time
   end type material_options_type

   !> The material.
   type :: material_type
      !> Density, kg/m3.
      real(wp) :: density = 0.0_wp
      !> Long-term shear modulus, Pa.
      real(wp) :: shear_modulus = 0.0_wp
      !> Second-invariant fraction of the shear modulus.
      real(wp) :: mooney_share = 0.0_wp
      !> Bulk modulus, Pa.
      real(wp) :: bulk_modulus = 0.0_wp
      !> Kelvin-Voigt viscosity, Pa s.
      real(wp) :: viscosity = 0.0_wp
      !> Shear moduli, Pa, and relaxation times, s, of the Maxwell branches: [n_branch].
      real(wp), allocatable :: branch_modulus(:), branch_time(:)
   end type material_type

contains

   !> Keys and allowed ranges of the group `&material`.
   function get_material_fields(options) result(fields)
      !> The options that the fields read and set.
      type(material_options_type), intent(in), target :: options
      !> One field per component: [9].
      type(field_type), allocatable :: fields(:)
      ! Laws with losses.
      character(len=*), parameter :: lossy(4) = [character(len=13) :: 'fractional', 'kelvin_voigt', 'constant_loss', 'prony']

      fields = [ &
         new_field('law', options%law, '', 'law of elasticity', &
         choices=[character(len=16) :: 'neo_hookean', 'mooney_rivlin']), &
         only_with('law', [new_field('mooney_share', options%mooney_share, '', &
         'second-invariant fraction of the shear modulus, for mooney_rivlin', '[0, 1]')], ['mooney_rivlin']), &
         new_field('bulk_ratio', options%bulk_ratio, '', &
         "maximum ratio of bulk to shear modulus; lower if Poisson's ratio implies a lower one", '[2, 100000]'), &
         new_field('viscosity', options%viscosity, '', 'law of viscosity', &
         choices=[character(len=16) :: 'none', 'kelvin_voigt', 'fractional', 'constant_loss', 'prony']), &
         only_with('viscosity', [ &
         new_field('loss_factor', options%loss_factor, '', 'loss factor: at loss_frequency (kelvin_voigt, ' &
         //'fractional), or from 10 to 1000 Hz (constant_loss)', '(0, 1]', trait='calibrated')], lossy(:3)), &
         only_with('viscosity', [new_field('loss_frequency', options%loss_frequency, 'Hz', &
         "frequency at which the ball's modulus is the storage modulus", '[1, 10000]', trait='calibrated')], lossy), &
         only_with('viscosity', [new_field('fractional_order', options%fractional_order, '', &
         'order of the derivative, for fractional; 1: as kelvin_voigt', '(0, 1]', trait='calibrated')], lossy(:1)), &
         only_with('viscosity', [new_field('prony_share', options%prony_share, '', &
         'moduli of the branches divided by the long-term modulus, for prony', '[0, 1000]'), &
         new_field('prony_time', options%prony_time, 's', 'relaxation times of the branches, for prony', &
         '(0, 1000]')], lossy(4:))]
   end function get_material_fields

   !> Returns an error if options do not fit each other, or if the model cannot take the ball.
   subroutine check_material(options, ball, error)
      !> The options, each inside its own range.
      type(material_options_type), intent(in) :: options
      type(ball_type), intent(in) :: ball
      type(error_type), allocatable, intent(out) :: error
      integer :: n_share, n_time

      n_share = options%prony_share%count
      n_time = options%prony_time%count
      if (options%viscosity == 'prony' .and. (n_share == 0 .or. n_share /= n_time .or. n_share > max_branches)) then
         error = input_error('has '//to_text(n_share)//' entries and prony_time '//to_text(n_time)//'; allowed: the same ' &
            //'number of both, 1 to '//to_text(max_branches), 'material', 'prony_share')
      else if (options%viscosity /= 'prony' .and. n_share + n_time > 0) then
         error = input_error("and prony_time do nothing with viscosity = '"//trim(options%viscosity)//"'; allowed: " &
            //"viscosity = 'prony'", 'material', 'prony_share')
      else if (ball%gauge_pressure > 0.0_wp) then
         error = input_error('= '//to_text(ball%gauge_pressure)//' Pa is not allowed with finite_element, whose wall ' &
            //'starts without stress; allowed: 0', 'ball', 'gauge_pressure')
      else if (ball%poisson_ratio < 0.0_wp) then
         error = input_error('= '//to_text(ball%poisson_ratio)//' is not allowed with finite_element; allowed: 0 to 0.5', &
            'ball', 'poisson_ratio')
      else if (options%viscosity == 'fractional') then
         call check_fractional_loss('material', options%fractional_order, options%loss_factor, &
            options%loss_frequency, error)
      end if
   end subroutine check_material

   !> Moduli of the material.
   subroutine new_material(options, ball, material, error)
      !> The options, checked.
      type(material_options_type), intent(in) :: options
      type(ball_type), intent(in) :: ball
      type(material_type), intent(out) :: material
      !> Set if no Prony series fits the loss factor.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: storage_modulus, poisson_ratio, omega, viscosity
      real(wp), allocatable :: relative_modulus(:)
      logical :: failed

      omega = 2*pi*options%loss_frequency
      material%density = get_density(ball)
      if (options%law == 'mooney_rivlin') material%mooney_share = options%mooney_share
      ! The modulus of elasticity stays unchanged, since it is the measured one.
      poisson_ratio = min(ball%poisson_ratio, (3*options%bulk_ratio - 2)/(2*(3*options%bulk_ratio + 1)))
      storage_modulus = ball%youngs_modulus/(2*(1 + poisson_ratio))
      material%bulk_modulus = ball%youngs_modulus/(3*(1 - 2*poisson_ratio))
      allocate (relative_modulus(0), material%branch_time(0))
      viscosity = 0.0_wp
      select case (options%viscosity)
      case ('kelvin_voigt')
         viscosity = options%loss_factor/omega
      case ('fractional')
         call fit_fractional_loss(options%fractional_order, options%loss_factor, options%loss_frequency, relative_modulus, &
            material%branch_time, viscosity)
      case ('constant_loss')
         call fit_constant_loss(options%loss_factor, relative_modulus, material%branch_time, failed)
         if (failed) then
            error = input_error('no Prony series has loss_factor = '//to_text(options%loss_factor)//' from 10 to 1000 Hz; ' &
               //'allowed: up to about 0.9', 'material')
            return
         end if
      case ('prony')
         relative_modulus = options%prony_share%values(:options%prony_share%count)
         material%branch_time = options%prony_time%values(:options%prony_time%count)
      case default
         continue
      end select
      material%shear_modulus = storage_modulus/real(get_modulus_ratio(relative_modulus, material%branch_time, omega), wp)
      material%viscosity = viscosity*material%shear_modulus
      allocate (material%branch_modulus, source=relative_modulus*material%shear_modulus)
   end subroutine new_material

   !> Loss factor of the material in shear.
   pure elemental function get_material_loss_factor(material, frequency) result(loss_factor)
      type(material_type), intent(in) :: material
      !> Frequency, Hz.
      real(wp), intent(in) :: frequency
      !> Loss modulus divided by storage modulus.
      real(wp) :: loss_factor
      complex(wp) :: ratio

      ratio = get_modulus_ratio(material%branch_modulus/material%shear_modulus, material%branch_time, 2*pi*frequency)
      loss_factor = (aimag(ratio) + 2*pi*frequency*material%viscosity/material%shear_modulus)/real(ratio, wp)
   end function get_material_loss_factor

end module thud_material
