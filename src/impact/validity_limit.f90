!> Validity limits of a theory: a quantity, the range in which the theory holds, and the reason. Results outside this range
!> are computed with a warning.
module thud_validity_limit
   use thud_ball, only: ball_type, get_density
   use thud_drop, only: drop_type
   use thud_force_history, only: force_history_type
   use thud_kinds, only: wp
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: get_gravity_limit, get_limit_message, get_size_limit, get_wall_limits, get_wave_limit, is_outside
   public :: validity_limit_type

   !> Length of a message about a limit.
   integer, parameter :: message_length = 240

   !> A validity limit.
   type :: validity_limit_type
      !> Namelist group of the keys that determine the quantity.
      character(len=24) :: group = ''
      !> Name of the limited quantity, with its unit if it has one.
      character(len=72) :: quantity = ''
      !> Value of the quantity, and range in which the theory holds.
      real(wp) :: value = 0.0_wp, lowest = -huge(1.0_wp), highest = huge(1.0_wp)
      !> Reason for the limit, as the end of a message.
      character(len=96) :: reason = ''
      !> What holds inside the range.
      character(len=16) :: subject = 'the theory holds'
   end type validity_limit_type

contains

   !> Whether the quantity lies outside the range.
   pure function is_outside(limit) result(yes)
      type(validity_limit_type), intent(in) :: limit
      logical :: yes

      ! Written so that NaN is outside too.
      yes = .not. (limit%value >= limit%lowest .and. limit%value <= limit%highest)
   end function is_outside

   !> Message about a quantity outside the range.
   pure function get_limit_message(limit) result(message)
      type(validity_limit_type), intent(in) :: limit
      character(len=message_length) :: message
      logical :: below

      below = limit%value < limit%lowest
      message = '&'//trim(limit%group)//': '//trim(limit%quantity)//' is '//trim(rounded(limit%value)) &
         //', '//trim(limit%subject)//' '//trim(merge('from ', 'up to', below))//' ' &
         //trim(rounded(merge(limit%lowest, limit%highest, below)))//': '//limit%reason
   end function get_limit_message

   !> A number with three digits.
   pure function rounded(value) result(text)
      real(wp), intent(in) :: value
      character(len=24) :: text
      real(wp) :: near

      if (.not. abs(value) < 1.0e300_wp) then
         ! A quotient may overflow; messages do not print Infinity.
         text = 'beyond 1e300'
         return
      end if
      write (text, '(es24.2e3)') value
      read (text, *) near
      text = to_text(near)
   end function rounded

   !> Limit of models that neglect gravity during the contact.
   pure function get_gravity_limit(drop, history) result(limit)
      type(drop_type), intent(in) :: drop
      type(force_history_type), intent(in) :: history
      type(validity_limit_type) :: limit

      limit = validity_limit_type('drop', 'gravity times contact time over velocity at first touch', &
         drop%gravity*history%contact_time/history%impact_velocity, highest=0.2_wp, &
         reason='gravity acts before first touch only')
   end function get_gravity_limit

   !> Limit of models that do not know the size of the source.
   pure function get_size_limit(ball, history) result(limit)
      type(ball_type), intent(in) :: ball
      type(force_history_type), intent(in) :: history
      type(validity_limit_type) :: limit

      limit = validity_limit_type('drop', 'deflection over twice outer_radius', &
         history%max_deflection/(2*ball%outer_radius), highest=1.0_wp, reason='the source is no thicker')
   end function get_size_limit

   !> Limit of the velocity at first touch, as a fraction of the velocity of waves in the wall.
   pure function get_wave_limit(ball, history, highest) result(limit)
      type(ball_type), intent(in) :: ball
      type(force_history_type), intent(in) :: history
      !> Fraction of the wave velocity up to which the theory holds.
      real(wp), intent(in) :: highest
      type(validity_limit_type) :: limit

      limit = validity_limit_type('drop', 'velocity at first touch over sqrt(youngs_modulus/density)', &
         history%impact_velocity/sqrt(ball%youngs_modulus/get_density(ball)), highest=highest, &
         reason='it is the order of the strain of the wall')
   end function get_wave_limit

   !> Limit of models of linear bending (docs/levels.md). The effective modulus of thick walls, such as that of the standard
   !> ball, includes what they neglect.
   pure function get_bending_limit(ball, history) result(limit)
      type(ball_type), intent(in) :: ball
      type(force_history_type), intent(in) :: history
      type(validity_limit_type) :: limit
      !> Ratio of thickness to outer radius below which a wall is thin.
      real(wp), parameter :: thin_wall = 0.3_wp

      limit = validity_limit_type('drop', 'deflection over wall_thickness', history%max_deflection/ball%wall_thickness, &
         highest=2.0_wp, reason='a wall that is pressed further buckles inwards')
      if (ball%wall_thickness >= thin_wall*ball%outer_radius) return
      limit%highest = 0.5_wp
      limit%reason = 'linear bending makes a thin wall too stiff: levels are up to 9 dB off those of finite elements'
   end function get_bending_limit

   !> Limits of models of an elastic wall that stays close to the sphere: [4].
   pure function get_wall_limits(ball, history) result(limits)
      type(ball_type), intent(in) :: ball
      type(force_history_type), intent(in) :: history
      type(validity_limit_type) :: limits(4)

      associate (radius => ball%outer_radius, wall => ball%wall_thickness)
         limits = [ &
            validity_limit_type('drop', 'deflection over outer_radius', history%max_deflection/radius, highest=0.5_wp, &
            reason='the wall outside the contact stays spherical'), &
            get_bending_limit(ball, history), &
            get_wave_limit(ball, history, 0.25_wp), &
            validity_limit_type('ball', 'stress of the wall by gauge_pressure over youngs_modulus', &
            ball%gauge_pressure*(radius - wall)/(2*wall*ball%youngs_modulus), highest=0.1_wp, &
            reason='the wall is free of stress before first touch')]
      end associate
   end function get_wall_limits

end module thud_validity_limit
