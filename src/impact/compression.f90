!> Quasi-static compression of the ball between two rigid plates, as in a press: its options and its result.
module thud_compression
   use thud_ball, only: ball_type
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type, name_length, new_field
   use thud_kinds, only: wp
   use thud_source_model, only: source_model_type
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: check_compression, compression_options_type, compression_type, compute_compression, get_compression_fields

   !> Options of the group `&compression`.
   type :: compression_options_type
      !> Maximum approach of the plates, m.
      real(wp) :: max_deflection = 0.04_wp
      !> Number of points of the curve, including the undeformed ball.
      integer :: points = 41
      !> State of the gas in the ball: `vented`, `isothermal` or `adiabatic`.
      character(len=name_length) :: gas = 'vented'
   end type compression_options_type

   !> Force-deflection curve.
   type :: compression_type
      !> Approach of the plates, m: [n].
      real(wp), allocatable :: deflection(:)
      !> Force on each plate, N: [n].
      real(wp), allocatable :: force(:)
   end type compression_type

contains

   !> Keys and allowed ranges of the group `&compression`.
   function get_compression_fields(options) result(fields)
      !> The options that the fields read and set.
      type(compression_options_type), intent(in), target :: options
      !> One field per component: [3].
      type(field_type) :: fields(3)

      fields = [ &
         new_field('max_deflection', options%max_deflection, 'm', 'maximum approach of the plates', '[1e-15, 10]'), &
         new_field('points', options%points, '', &
         'number of points of the curve, including the undeformed ball', '[2, 10000]'), &
         new_field('gas', options%gas, '', 'gas in the ball: leaves through the hole (vented), or is sealed in', &
         choices=[character(len=10) :: 'vented', 'isothermal', 'adiabatic'])]
   end function get_compression_fields

   !> Checks that the ball allows a compression.
   subroutine check_compression(options, ball, error)
      !> The options, each inside its own range.
      type(compression_options_type), intent(in) :: options
      type(ball_type), intent(in) :: ball
      type(error_type), allocatable, intent(out) :: error

      if (options%max_deflection >= 2*ball%outer_radius) then
         error = input_error('= '//to_text(options%max_deflection)//' m is not allowed; allowed: less than the diameter, ' &
            //to_text(2*ball%outer_radius)//' m', 'compression', 'max_deflection')
      else if (options%gas == 'vented' .and. ball%gauge_pressure > 0.0_wp) then
         error = input_error("= 'vented' with gauge_pressure = "//to_text(ball%gauge_pressure)//" Pa is not allowed; " &
            //"allowed: 'isothermal', 'adiabatic', or no overpressure", 'compression', 'gas')
      end if
   end subroutine check_compression

   !> Quasi-static compression of a ball by a model, at deflections equally spaced from 0.
   subroutine compute_compression(options, ball, model, compression, error)
      type(compression_options_type), intent(in) :: options
      type(ball_type), intent(in) :: ball
      class(source_model_type), intent(in) :: model
      type(compression_type), intent(out) :: compression
      !> Set if the model has no compression, or the ball cannot be pressed so far.
      type(error_type), allocatable, intent(out) :: error
      type(ball_type) :: pressed
      integer :: i

      pressed = ball
      ! Without ambient pressure there is no overpressure at any volume.
      if (options%gas == 'vented') pressed%ambient_pressure = 0.0_wp
      if (options%gas == 'isothermal') pressed%heat_capacity_ratio = 1.0_wp
      compression%deflection = [(options%max_deflection*real(i, wp)/(options%points - 1), i=0, options%points - 1)]
      allocate (compression%force, mold=compression%deflection)
      call model%compress(pressed, compression%deflection, compression%force, error)
   end subroutine compute_compression

end module thud_compression
