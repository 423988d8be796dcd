!> Options of the modal ball.
module thud_modal_ball_options
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type, list_type, name_length
   use thud_kinds, only: wp
   use thud_new_field, only: choice_field, integer_field, list_field, logical_field, real_field
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: check_modal_ball, get_modal_ball_fields, modal_ball_type

   !> Options of the model.
   type :: modal_ball_type
      !> Highest harmonic n whose modes oscillate.
      integer :: harmonics = 32
      !> Modes of each harmonic that oscillate.
      integer :: radial_modes = 5
      !> Highest harmonic whose static flexibility counts.
      integer :: static_harmonics = 96
      !> Rings of the lower half of the surface.
      integer :: rings = 44
      !> Loss factor: `constant`, or `rising` in proportion to frequency.
      character(len=name_length) :: damping_law = 'constant'
      !> Loss factor, twice the damping ratio.
      real(wp) :: loss_factor = 0.1_wp
      !> Frequency of this loss factor where it rises, Hz.
      real(wp) :: loss_frequency = 74.0_wp
      !> The gas in the cavity resists changes of its volume.
      logical :: cavity_gas = .true.
      !> Harmonics that answer statically instead of oscillating.
      type(list_type) :: static_families
   end type modal_ball_type

contains

   !> Keys and allowed ranges of the group `&modal_ball`.
   function get_modal_ball_fields(options) result(fields)
      !> The options that the fields read and set.
      type(modal_ball_type), intent(in), target :: options
      !> One field per component: [9].
      type(field_type), allocatable :: fields(:)
      character(len=*), parameter :: group = 'modal_ball'

      fields = [ &
         integer_field(group, 'harmonics', options%harmonics, 'highest harmonic whose modes oscillate', 2, 200), &
         integer_field(group, 'radial_modes', options%radial_modes, 'modes of each harmonic that oscillate', 1, 20), &
         integer_field(group, 'static_harmonics', options%static_harmonics, &
         'highest harmonic whose static flexibility counts', 4, 400), &
         integer_field(group, 'rings', options%rings, 'rings of the lower half of the surface', 2, 200), &
         choice_field(group, 'damping_law', options%damping_law, 'loss factor against frequency', &
         [character(len=8) :: 'constant', 'rising']), &
         real_field(group, 'loss_factor', options%loss_factor, '', 'loss factor, twice the damping ratio', &
         0.0_wp, 1.9_wp), &
         real_field(group, 'loss_frequency', options%loss_frequency, 'Hz', 'frequency of a rising loss factor', &
         0.1_wp, 1.0e5_wp), &
         logical_field(group, 'cavity_gas', options%cavity_gas, 'the gas in the cavity resists changes of its volume'), &
         list_field(group, 'static_families', options%static_families, '', 'harmonics that answer statically', &
         0.0_wp, 200.0_wp)]
   end function get_modal_ball_fields

   !> Complains about numbers of harmonics and rings that do not go together.
   subroutine check_modal_ball(options, error)
      !> The options, each inside its own range.
      type(modal_ball_type), intent(in) :: options
      !> What is wrong.
      type(error_type), allocatable, intent(out) :: error
      logical :: wrong(options%static_families%count)

      associate (families => options%static_families%values(:options%static_families%count))
         wrong = abs(families - nint(families)) > 0.0_wp .or. nint(families) > options%harmonics
         if (options%static_harmonics < options%harmonics) then
            error = input_error('&modal_ball: static_harmonics = '//to_text(options%static_harmonics) &
               //' is not allowed; allowed: harmonics = '//to_text(options%harmonics)//' or more')
         else if (2*options%rings > options%static_harmonics) then
            error = input_error('&modal_ball: rings = '//to_text(options%rings) &
               //' cannot be told apart by static_harmonics = '//to_text(options%static_harmonics) &
               //'; allowed: up to half of it')
         else if (2*options%rings < options%harmonics) then
            error = input_error('&modal_ball: harmonics = '//to_text(options%harmonics)//' is too high for rings = ' &
               //to_text(options%rings)//'; allowed: up to twice the rings')
         else if (any(wrong)) then
            error = input_error('&modal_ball: static_families holds '//to_text(families(findloc(wrong, .true., dim=1))) &
               //'; allowed: whole numbers up to harmonics = '//to_text(options%harmonics))
         end if
      end associate
   end subroutine check_modal_ball

end module thud_modal_ball_options
