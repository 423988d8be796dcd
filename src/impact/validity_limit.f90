!> Validity limits of a theory: a quantity, the range in which the theory holds, and the reason. Results outside this range
!> are computed with a warning.
module thud_validity_limit
   use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
   use thud_ball, only: ball_type, drop_type, get_density
   use thud_force_history, only: force_history_type
   use thud_kinds, only: wp
   use thud_note, only: note_type
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: get_gravity_limit, get_limit_note, get_wall_limits, get_wave_limit, validity_limit_type

   !> A validity limit.
   type :: validity_limit_type
      !> Namelist group of the keys that determine the quantity.
      character(len=24) :: group = ''
      !> Name of the limited quantity, with its unit if it has one; of a key only what follows its name.
      character(len=72) :: quantity = ''
      !> Value of the quantity, and range in which the theory holds.
      real(wp) :: value = 0.0_wp, lowest = -huge(1.0_wp), highest = huge(1.0_wp)
      !> Reason for the limit, as the end of a message.
      character(len=128) :: reason = ''
      !> What holds inside the range.
      character(len=16) :: subject = 'the theory holds'
      !> Key that is the quantity; blank if it is none.
      character(len=24) :: key = ''
   end type validity_limit_type

contains

   !> Note on a quantity outside the range; without a code if it is inside.
   pure function get_limit_note(limit) result(note)
      type(validity_limit_type), intent(in) :: limit
      type(note_type) :: note
      logical :: below

      ! NaN is outside.
      if (limit%value >= limit%lowest .and. limit%value <= limit%highest) return
      below = limit%value < limit%lowest
      note = note_type('outside_limits', limit%group, limit%key, limit%quantity, limit%value)
      if (abs(limit%lowest) < huge(1.0_wp)) note%low = limit%lowest
      if (abs(limit%highest) < huge(1.0_wp)) note%high = limit%highest
      note%text = 'is '//trim(rounded(limit%value))//', '//trim(limit%subject)//' '//trim(merge('from ', 'up to', below)) &
         //' '//trim(rounded(merge(limit%lowest, limit%highest, below)))//': '//limit%reason
   end function get_limit_note

   !> A number with three digits.
   pure function rounded(value) result(text)
      real(wp), intent(in) :: value
      character(len=24) :: text
      real(wp) :: near

      ! A quotient may overflow; messages do not print Infinity.
      text = merge('unknown     ', 'beyond 1e300', ieee_is_nan(value))
      if (.not. abs(value) < 1.0e300_wp) return
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

   !> Limit of the velocity at first touch, as a fraction of the velocity of waves in the wall.
   pure function get_wave_limit(ball, history, highest) result(limit)
      type(ball_type), intent(in) :: ball
      type(force_history_type), intent(in) :: history
      !> Fraction of the wave velocity up to which the theory holds.
      real(wp), intent(in) :: highest
      type(validity_limit_type) :: limit

      limit = validity_limit_type('drop', 'velocity at first touch over that of waves in the wall', &
         history%impact_velocity/sqrt(ball%youngs_modulus/get_density(ball)), highest=highest, &
         reason='it is the order of the strain of the wall')
   end function get_wave_limit

   !> Limits of models of an elastic wall that stays close to the sphere: [5].
   pure function get_wall_limits(ball, history) result(limits)
      type(ball_type), intent(in) :: ball
      type(force_history_type), intent(in) :: history
      type(validity_limit_type), allocatable :: limits(:)
      !> Ratio of thickness to outer radius from which on the effective modulus of a wall, as that of the standard ball,
      !> includes what linear bending neglects (docs/levels.md).
      real(wp), parameter :: thick_wall = 0.3_wp

      associate (radius => ball%outer_radius, wall => ball%wall_thickness)
         limits = [ &
            validity_limit_type('drop', 'deflection over outer radius', history%max_deflection/radius, highest=0.5_wp, &
            reason='the wall outside the contact stays spherical'), &
            validity_limit_type('drop', 'deflection over wall thickness', history%max_deflection/wall, &
            highest=merge(huge(1.0_wp), 0.5_wp, wall >= thick_wall*radius), &
            reason='linear bending makes a thin wall too stiff: levels are up to 9 dB off those of finite elements'), &
            validity_limit_type('drop', 'deflection over wall thickness', history%max_deflection/wall, highest=2.0_wp, &
            reason='a wall that is pressed further buckles inwards'), &
            get_wave_limit(ball, history, 0.25_wp), &
            validity_limit_type('ball', "stress of the wall by gauge pressure over Young's modulus", &
            ball%gauge_pressure*(radius - wall)/(2*wall*ball%youngs_modulus), highest=0.1_wp, &
            reason='the wall is free of stress before first touch')]
      end associate
   end function get_wall_limits

end module thud_validity_limit
