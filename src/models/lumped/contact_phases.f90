!> The phases of a lumped source: compression, restitution and flight, and the events between them.
module thud_contact_phases
   use thud_contact_source, only: contact_source_type
   use thud_coupled_step, only: coupled_state_type, get_relative_state
   use thud_error, only: error_type, numerical_error
   use thud_force_history, only: force_history_type
   use thud_kinds, only: wp
   use thud_receiver, only: can_strike, get_receiver_velocity, receiver_type
   use thud_receiver_stages, only: receiver_stages_type
   use thud_text, only: fixed
   implicit none (type, external)
   private

   public :: begin_contact, get_event, get_event_function, has_left, impact_type, pass_event, raise_peaks
   public :: update_maxima

   !> A light floor may stop the source, so that it never leaves. The floor has captured the source, and the contact ends, if
   !> kinetic energy and force times deflection are both below this fraction of the initial energy.
   real(wp), parameter :: capture_tolerance = 1.0e-12_wp

   !> Maximum number of Newton iterations for the first force, and the relative change that ends them.
   integer, parameter :: max_iterations = 50
   real(wp), parameter :: tolerance = 1.0e-12_wp

   !> Events that cut a step: turning point between compression and restitution, release, touch.
   integer, parameter :: turning_point = 1, release = 2, touch = 3

   !> No event.
   integer, parameter, public :: no_event = 0

   !> Impact in progress.
   type :: impact_type
      !> The receiver, without states if it is rigid, and its response over a whole step.
      type(receiver_type) :: receiver
      type(receiver_stages_type) :: stages
      !> Whether the receiver can move.
      logical :: is_mobile = .false.
      !> Motion of source and floor, now and at the end of the step that is tried.
      type(coupled_state_type) :: motion, end
      !> Time since first touch, s; velocity at first touch, the scale of velocities, m/s.
      real(wp) :: time = 0.0_wp, velocity_scale = 0.0_wp
      !> Maximum force on the floor so far, N.
      real(wp) :: peak_force = 0.0_wp
      !> Number of contacts so far.
      integer :: n_contact = 0
      !> Whether the floor has captured the source, that is, stopped it for good.
      logical :: captured = .false.
   end type impact_type

contains

   !> Sets force and velocity of the floor at touch. The force depends on the velocity, and by the direct mobility of the
   !> receiver the velocity depends on the force. The part of the ball that lies flat on the floor (the cap) has no mass at
   !> first touch.
   pure subroutine begin_contact(source, impact, error)
      class(contact_source_type), intent(inout) :: source
      type(impact_type), intent(inout) :: impact
      !> Set if the force does not converge.
      type(error_type), allocatable, intent(out) :: error
      real(wp), dimension(source%n_state) :: state, rate, slower, slower_rate
      real(wp) :: length, change
      integer :: k
      logical :: valid

      source%touching = .true.
      source%compressing = .true.
      impact%n_contact = impact%n_contact + 1
      associate (coupled => impact%motion, index => 2*source%n_mass + 1)
         coupled%force = 0.0_wp
         length = 1.0e-7_wp*impact%velocity_scale
         ! The force grows at most with the square of the velocity: Newton's method converges from one side.
         do k = 1, max_iterations
            coupled%floor_velocity = get_receiver_velocity(impact%receiver, coupled%force, coupled%receiver_motion)
            state = get_relative_state(source, coupled)
            slower = state
            slower(2) = state(2) - length
            call source%get_derivative(impact%time, state, rate, valid)
            call source%get_derivative(impact%time, slower, slower_rate, valid)
            change = (rate(index) - coupled%force) &
               /(1 + impact%receiver%direct*(rate(index) - slower_rate(index))/(state(2) - slower(2)))
            if (abs(change) <= epsilon(change)*abs(coupled%force)) exit
            coupled%force = coupled%force + change
         end do
         ! Written so that NaN fails too.
         if (.not. (valid .and. abs(change) <= tolerance*abs(coupled%force))) then
            error = numerical_error('&drop: '//fixed(1.0e3_wp*impact%time, 3)//' ms after first touch the first force of ' &
               //'a contact does not converge; allowed: a lower height, or a floor of lower mobility')
            return
         end if
         coupled%acceleration = rate(2:2*source%n_mass:2)
         impact%peak_force = max(impact%peak_force, coupled%force)
      end associate
   end subroutine begin_contact

   !> Event that lies inside a step. Written so that NaN ends a contact.
   pure function get_event(source, end) result(event)
      class(contact_source_type), intent(in) :: source
      !> Motion at the end of the step.
      type(coupled_state_type), intent(in) :: end
      integer :: event
      real(wp) :: state(source%n_state)

      state = get_relative_state(source, end)
      event = no_event
      if (.not. source%touching) then
         if (state(1) >= 0.0_wp) event = touch
      else if (source%compressing) then
         if (.not. state(2) > 0.0_wp) event = turning_point
      else if (.not. state(1) > 0.0_wp) then
         event = release
      else if (state(2) > 0.0_wp) then
         ! The floor approaches again.
         event = turning_point
      end if
   end function get_event

   !> Quantity that falls to zero at an event: gap, deflection or velocity.
   pure function get_event_function(source, event, motion) result(value)
      class(contact_source_type), intent(in) :: source
      !> The event.
      integer, intent(in) :: event
      type(coupled_state_type), intent(in) :: motion
      !> Positive before the event, m or m/s.
      real(wp) :: value
      real(wp) :: state(source%n_state)

      state = get_relative_state(source, motion)
      select case (event)
      case (touch)
         value = -state(1)
      case (release)
         value = state(1)
      case default
         value = merge(state(2), -state(2), source%compressing)
      end select
   end function get_event_function

   !> Changes the phase at an event.
   pure subroutine pass_event(source, event, impact, history, error)
      class(contact_source_type), intent(inout) :: source
      !> The event.
      integer, intent(in) :: event
      type(impact_type), intent(inout) :: impact
      !> History, in which maxima and the time of release are set.
      type(force_history_type), intent(inout) :: history
      !> Set if the first force of a contact does not converge.
      type(error_type), allocatable, intent(out) :: error

      associate (coupled => impact%motion)
         select case (event)
         case (turning_point)
            call update_maxima(source, impact, history)
            source%compressing = .not. source%compressing
         case (release)
            source%touching = .false.
            history%contact_time = impact%time
            coupled%force = 0.0_wp
            coupled%floor_velocity = get_receiver_velocity(impact%receiver, 0.0_wp, coupled%receiver_motion)
            coupled%state(1) = coupled%receiver_motion%displacement
         case default
            coupled%state(1) = coupled%receiver_motion%displacement
            call begin_contact(source, impact, error)
         end select
      end associate
   end subroutine pass_event

   !> Updates the maxima, and ends the contact if the floor has captured the source.
   pure subroutine update_maxima(source, impact, history)
      class(contact_source_type), intent(inout) :: source
      type(impact_type), intent(inout) :: impact
      !> History, in which maxima and contact time are set.
      type(force_history_type), intent(inout) :: history
      real(wp) :: center(2), components(size(history%component, 2)), state(source%n_state)
      real(wp) :: elastic_force

      if (.not. source%touching) return
      state = get_relative_state(source, impact%motion)
      center = source%get_center_motion(state)
      history%max_deflection = max(history%max_deflection, center(1))
      call source%get_components(state, components, elastic_force)
      call raise_peaks(components, elastic_force, history)
      if (.not. impact%is_mobile) return
      associate (coupled => impact%motion)
         impact%peak_force = max(impact%peak_force, coupled%force)
         impact%captured = max(maxval(coupled%state(2:2*source%n_mass:2)**2), coupled%force*state(1)/source%mass) &
            <= capture_tolerance*impact%velocity_scale**2
         if (.not. impact%captured) return
         source%touching = .false.
         history%contact_time = impact%time
         coupled%force = 0.0_wp
         coupled%floor_velocity = get_receiver_velocity(impact%receiver, 0.0_wp, coupled%receiver_motion)
      end associate
   end subroutine update_maxima

   !> Raises the maxima of the forces by those of one instant.
   pure subroutine raise_peaks(components, elastic_force, history)
      !> Components of the force on the floor, N: [n_component].
      real(wp), intent(in) :: components(:)
      !> Force without the flux of momentum, N.
      real(wp), intent(in) :: elastic_force
      type(force_history_type), intent(inout) :: history

      history%peak_elastic_force = max(history%peak_elastic_force, elastic_force)
      history%peak_force = max(history%peak_force, history%peak_elastic_force, sum(components))
   end subroutine raise_peaks

   !> Whether the source has left the floor for good, or the floor has captured it.
   pure function has_left(source, impact) result(left)
      class(contact_source_type), intent(in) :: source
      type(impact_type), intent(in) :: impact
      logical :: left
      real(wp) :: center(2)
      real(wp) :: gap

      left = .not. source%touching
      if (.not. left .or. impact%captured) return
      associate (state => get_relative_state(source, impact%motion))
         center = source%get_center_motion(state)
         ! Minimum gap between the first mass, which oscillates about the center of mass, and the floor, m.
         gap = -(center(1) + source%get_amplitude(state))
      end associate
      left = .not. can_strike(impact%receiver, impact%motion%receiver_motion, gap, -center(2) - impact%motion%floor_velocity)
   end function has_left

end module thud_contact_phases
