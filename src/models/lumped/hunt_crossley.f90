!> A lumped source on a spring with damping that grows with the deflection (Hunt and Crossley 1975; paper, reference [6]): a
!> baseline, also for the tyre.
module thud_hunt_crossley
   use thud_ball, only: ball_type, drop_type, get_impact_velocity
   use thud_contact_source, only: at_deflection, at_impulse, at_loss, at_velocity, contact_law_type, contact_source_type, &
      get_contact_force
   use thud_error, only: error_type, input_error, signal_base
   use thud_field, only: field_type, new_field
   use thud_force_history, only: force_history_type
   use thud_kinds, only: wp
   use thud_lumped, only: solve_lumped
   use thud_receiver, only: receiver_type
   use thud_sampling, only: sampling_type
   use thud_source_model, only: source_model_type
   use thud_text, only: to_text
   use thud_zero_search, only: bisection_type
   implicit none (type, external)
   private

   public :: get_damping, hunt_crossley_type

   !> Names of the components of the force.
   character(len=13), parameter :: force_names(2) = [character(len=13) :: 'spring_force', 'damping_force']

   !> Options of the model. Exactly one of stiffness and contact time is given, and at most one of damping and restitution; 0
   !> means not given.
   type, extends(source_model_type) :: hunt_crossley_type
      !> Stiffness k, N/m^exponent.
      real(wp) :: stiffness = 0.0_wp
      !> Target contact time, s.
      real(wp) :: contact_time = 0.0_wp
      !> Exponent n of the deflection; 3/2 for Hertz contact.
      real(wp) :: exponent = 1.5_wp
      !> Damping alpha, s/m.
      real(wp) :: damping = 0.0_wp
      !> Target coefficient of restitution.
      real(wp) :: restitution = 0.0_wp
   contains
      procedure :: get_fields
      procedure :: check
      procedure :: solve
      procedure :: compress
   end type hunt_crossley_type

   !> Equation of motion M z'' = -F with F = k d^n (1 + 3/2 alpha d').
   type, extends(contact_source_type) :: spring_type
      type(contact_law_type) :: law
   contains
      procedure :: get_derivative
      procedure :: get_components
   end type spring_type

contains

   !> Keys and allowed ranges.
   function get_fields(self) result(fields)
      class(hunt_crossley_type), intent(in), target :: self
      type(field_type), allocatable :: fields(:)

      fields = [ &
         new_field('stiffness', self%stiffness, '', &
         'contact stiffness, N/m^exponent; 0: derived from contact_time', '[0, 1e15]', trait='derived'), &
         new_field('contact_time', self%contact_time, 's', &
         'target contact time; 0: derived from stiffness', '[0, 10]', trait='derived'), &
         new_field('exponent', self%exponent, '', 'exponent of the deflection in the contact force', '[1, 5]'), &
         new_field('damping', self%damping, 's/m', &
         'damping coefficient alpha; 0: derived from restitution', '[0, 100]'), &
         new_field('restitution', self%restitution, '', &
         'target coefficient of restitution; 0: derived from damping', '[0, 1]', trait='derived')]
   end function get_fields

   !> Returns an error if values are missing or contradict each other.
   subroutine check(self, ball, sampling, error)
      class(hunt_crossley_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      type(sampling_type), intent(in) :: sampling
      type(error_type), allocatable, intent(out) :: error

      if (self%stiffness > 0.0_wp .eqv. self%contact_time > 0.0_wp) then
         error = input_error('= '//to_text(self%stiffness)//' with contact_time = '//to_text(self%contact_time)//' s is ' &
            //'not allowed; allowed: exactly one of them above 0', 'hunt_crossley', 'stiffness')
      else if (self%damping > 0.0_wp .and. self%restitution > 0.0_wp) then
         error = input_error('= '//to_text(self%damping)//' s/m with restitution = '//to_text(self%restitution)//' is not ' &
            //'allowed; allowed: at most one of them above 0', 'hunt_crossley', 'damping')
      else if (self%restitution > 0.0_wp .and. self%restitution < 0.01_wp) then
         error = input_error('= '//to_text(self%restitution)//' is not allowed; allowed: 0 (not given) or 0.01 <= ' &
            //'restitution <= 1', 'hunt_crossley', 'restitution')
      end if
   end subroutine check

   !> Right-hand side of the equation of motion.
   pure subroutine get_derivative(self, state, rate, valid)
      class(spring_type), intent(in) :: self
      real(wp), intent(in) :: state(:)
      real(wp), intent(out) :: rate(:)
      logical, intent(out) :: valid
      real(wp) :: components(2)
      real(wp) :: force

      valid = .true.
      call self%get_components(state, components, force)
      rate(at_deflection) = state(at_velocity)
      rate(at_velocity) = -force/self%mass
      rate(at_impulse) = force
      rate(at_loss) = components(2)*state(at_velocity)
   end subroutine get_derivative

   !> Spring and damping force at one instant.
   pure subroutine get_components(self, state, components, elastic_force)
      class(spring_type), intent(in) :: self
      real(wp), intent(in) :: state(:)
      !> k d^n and k d^n * 3/2 alpha d', N: [2].
      real(wp), intent(out) :: components(:)
      !> Spring plus damping force, N: elastic means without the flux of momentum, of which this model has none.
      real(wp), intent(out) :: elastic_force
      real(wp) :: force(3)

      force = get_contact_force(self%law, max(state(at_deflection), 0.0_wp), state(at_velocity))
      components = force(2:3)
      elastic_force = sum(components)
   end subroutine get_components

   !> Damping alpha that gives a coefficient of restitution, s/m.
   !>
   !> With x = 3/2 alpha v0 the balance of energy over both phases is
   !> x - ln(1 + x) + e x + ln(1 - e x) = 0, for any exponent.
   pure function get_damping(restitution, impact_velocity) result(damping)
      !> Coefficient of restitution e, above 0; velocity at first touch, m/s.
      real(wp), intent(in) :: restitution, impact_velocity
      !> alpha, s/m.
      real(wp) :: damping
      type(bisection_type) :: bracket

      damping = 0.0_wp
      if (restitution >= 1.0_wp) return
      ! The nonzero root: the function is positive below it and falls without bound towards 1/e.
      bracket%right = 1/restitution
      do while (bracket%is_open())
         call bracket%halve(balance(bracket%get_middle()) > 0.0_wp)
      end do
      damping = bracket%get_middle()/(1.5_wp*impact_velocity)

   contains

      !> Missing energy of the rebound, in units of M (v0/x)^2.
      pure function balance(x) result(missing)
         !> 3/2 alpha v0.
         real(wp), intent(in) :: x
         !> Zero if the balance holds.
         real(wp) :: missing

         missing = excess(x) - excess(-restitution*x)
      end function balance

      !> x - ln(1 + x), accurate also for small x.
      pure function excess(x) result(value)
         !> Argument above -1.
         real(wp), intent(in) :: x
         real(wp) :: value
         integer :: k

         if (abs(x) > 0.03_wp) then
            value = x - log(1 + x)
         else
            ! Ten terms of the series leave an error of 0.03**12.
            value = sum([((-x)**k/k, k=2, 11)])
         end if
      end function excess

   end function get_damping

   !> Stiffness that gives a contact time, N/m^exponent. The time is proportional to the length (M v0^2/k)^(1/(n + 1)): one
   !> contact on a rigid floor with a length of about the right order gives the ratio.
   subroutine get_stiffness(contact_time, exponent, damping, mass, drop, stiffness, error)
      !> Target contact time, s; exponent n of the deflection; damping alpha, s/m; mass, kg.
      real(wp), intent(in) :: contact_time, exponent, damping, mass
      type(drop_type), intent(in) :: drop
      !> k, N/m^exponent.
      real(wp), intent(out) :: stiffness
      !> Set if the damping is too high for a rebound.
      type(error_type), allocatable, intent(out) :: error
      !> Samples and steps in the time (M v0^2/k)^(1/(n + 1))/v0, a third of the contact of a spring without damping.
      real(wp), parameter :: samples = 100.0_wp, steps = 1000.0_wp
      type(force_history_type) :: history
      real(wp) :: unit, v0, duration

      v0 = get_impact_velocity(drop)
      unit = contact_time/3
      ! The rebound from a strong damper is at most as fast as 2/(3 alpha).
      duration = unit*min(10*(1 + 1.5_wp*damping*v0), 1000.0_wp)
      stiffness = mass*v0**2/(unit*v0)**(exponent + 1)
      call solve_lumped(new_spring(mass, stiffness, exponent, damping), drop, sampling_type(samples/unit, duration, &
         nint(steps/samples)), force_names, history, error)
      stiffness = stiffness*(history%contact_time/contact_time)**(exponent + 1)
   end subroutine get_stiffness

   !> Equation of motion of a source.
   pure function new_spring(mass, stiffness, exponent, damping) result(spring)
      !> Mass, kg; k, N/m^exponent; n; alpha, s/m.
      real(wp), intent(in) :: mass, stiffness, exponent, damping
      type(spring_type) :: spring

      spring = spring_type(mass=mass, law=contact_law_type(factor=stiffness, exponent=exponent, damping=1.5_wp*damping))
   end function new_spring

   !> Quasi-static force between two plates: k (deflection/2)^n.
   subroutine compress(self, ball, deflection, force, error)
      class(hunt_crossley_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      real(wp), intent(in) :: deflection(:)
      real(wp), intent(out) :: force(:)
      type(error_type), allocatable, intent(out) :: error

      force = self%stiffness*(deflection/2)**self%exponent
      if (.not. self%stiffness > 0.0_wp) error = input_error('= 0 is not allowed with &compression, because contact_time ' &
         //'gives a stiffness for a drop only; allowed: stiffness above 0, without contact_time', 'hunt_crossley', &
         'stiffness')
   end subroutine compress

   !> Force history of one drop.
   subroutine solve(self, ball, drop, sampling, history, error, receiver)
      class(hunt_crossley_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      type(drop_type), intent(in) :: drop
      type(sampling_type), intent(in) :: sampling
      type(force_history_type), intent(out) :: history
      type(error_type), allocatable, intent(out) :: error
      type(receiver_type), intent(in), optional :: receiver
      type(spring_type) :: spring
      real(wp) :: v0, damping, stiffness

      v0 = get_impact_velocity(drop)
      damping = self%damping
      if (self%restitution > 0.0_wp) damping = get_damping(self%restitution, v0)
      stiffness = self%stiffness
      if (self%contact_time > 0.0_wp) then
         call get_stiffness(self%contact_time, self%exponent, damping, ball%mass, drop, stiffness, error)
      end if
      if (allocated(error)) then
         if (error%code >= signal_base) return
         error = input_error('= '//to_text(damping)//' s/m at '//to_text(v0)//' m/s gives no contact time; allowed: lower ' &
            //'damping', 'hunt_crossley', 'damping')
         return
      end if
      spring = new_spring(ball%mass, stiffness, self%exponent, damping)
      call solve_lumped(spring, drop, sampling, force_names, history, error, receiver)
   end subroutine solve

end module thud_hunt_crossley
