!> A tyre as two masses, rim and belt. The belt stands on the contact patch, whose force is inflation pressure times contact
!> area plus the force of the carcass, both damped and never tensile: F = (p w d + c d (d/d0)^(n - 1))(1 + a d'). A sidewall,
!> a linear spring with viscous damping, joins rim and belt (in tyre dynamics: residual stiffness and rigid ring).
module thud_two_mass
   use thud_ball, only: ball_type, drop_type, get_impact_velocity
   use thud_constants, only: pi
   use thud_contact_source, only: contact_law_type, contact_source_type, get_contact_force
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type, new_field
   use thud_force_history, only: force_history_type
   use thud_kinds, only: wp
   use thud_lumped, only: solve_lumped
   use thud_receiver, only: is_rigid, receiver_type
   use thud_sampling, only: sampling_type
   use thud_source_model, only: source_model_type
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: two_mass_type

   !> Indices in the state: displacement since first touch (m) and velocity (m/s) of belt and rim towards the floor, relative
   !> to the floor if it is mobile; impulse on the floor (N s); energy lost (J).
   integer, parameter :: at_belt = 1, at_belt_velocity = 2, at_rim = 3, at_rim_velocity = 4, at_impulse = 5, at_loss = 6, &
      n_state = 6

   !> Angle by which the fastest motion advances in a step, rad. On a rigid floor (Runge-Kutta) a step loses angle**6/72 of
   !> the energy, 4e-11 per radian of motion; on a mobile floor (Radau IIA) angle**6/3600, 3e-9 per radian.
   real(wp), parameter :: step_angle = 0.02_wp, coupled_angle = 0.1_wp

   !> Maximum number of steps of the tyre in a step of the input.
   real(wp), parameter :: max_refinement = 1.0e4_wp

   !> Deflection d0 at which the carcass stiffness is given, m.
   real(wp), parameter :: carcass_deflection = 0.02_wp

   !> Options of the model; the defaults are the standards' tyre, see docs/lumped_models.md.
   type, extends(source_model_type) :: two_mass_type
      !> Mass of belt and tread, kg; the rest of the mass is the rim.
      real(wp) :: belt_mass = 2.0_wp
      !> Inflation pressure p, Pa.
      real(wp) :: inflation_pressure = 2.4e5_wp
      !> Contact width w: contact area divided by deflection, m.
      real(wp) :: contact_width = 0.40_wp
      !> Carcass stiffness c: force of the carcass divided by deflection at `carcass_deflection`, N/m.
      real(wp) :: carcass_stiffness = 9.0e4_wp
      !> Exponent n of the carcass force.
      real(wp) :: carcass_exponent = 2.5_wp
      !> Damping a of the contact, s/m.
      real(wp) :: contact_damping = 0.06_wp
      !> Natural frequency of the belt on the sidewall with the rim fixed, Hz.
      real(wp) :: belt_frequency = 85.0_wp
      !> Damping ratio of the same motion.
      real(wp) :: belt_damping = 0.2_wp
   contains
      procedure :: get_fields
      procedure :: check
      procedure :: solve
   end type two_mass_type

   !> Equations of motion of belt and rim.
   type, extends(contact_source_type) :: tyre_type
      !> Masses of belt and rim, kg.
      real(wp) :: belt_mass, rim_mass
      !> Contact: the inflated patch, of stiffness p w, and the carcass.
      type(contact_law_type) :: law
      !> Stiffness, N/m, and damping, N s/m, of the sidewall.
      real(wp) :: sidewall_stiffness, sidewall_damping
   contains
      procedure :: get_derivative
      procedure :: get_components
      procedure :: get_center_motion
      procedure :: get_inner_energy
      procedure :: get_amplitude
   end type tyre_type

contains

   !> Keys and allowed ranges.
   function get_fields(self) result(fields)
      class(two_mass_type), intent(in), target :: self
      type(field_type), allocatable :: fields(:)

      fields = [ &
         new_field('belt_mass', self%belt_mass, 'kg', 'mass of belt and tread, less than the mass of the source', &
         '(0, 1000000)'), &
         new_field('inflation_pressure', self%inflation_pressure, 'Pa', 'inflation pressure', '[0, 1e8]'), &
         new_field('contact_width', self%contact_width, 'm', &
         'contact area divided by deflection of the contact patch', &
         '[0, 100]'), &
         new_field('carcass_stiffness', self%carcass_stiffness, 'N/m', &
         'force of the carcass divided by its deflection, at 20 mm', '[0, 1e12]'), &
         new_field('carcass_exponent', self%carcass_exponent, '', &
         'exponent of the deflection in the force of the carcass', '[1.5, 5]'), &
         new_field('contact_damping', self%contact_damping, 's/m', &
         'damping force of the contact divided by elastic force and velocity', '[0, 100]'), &
         new_field('belt_frequency', self%belt_frequency, 'Hz', &
         'natural frequency of the belt on the sidewall with fixed rim', '(0, 1000000]'), &
         new_field('belt_damping', self%belt_damping, '', &
         'damping ratio of the belt on the sidewall with fixed rim', '[0, 10]')]
   end function get_fields

   !> Returns an error if the belt leaves no mass for the rim, or if the patch has no stiffness.
   subroutine check(self, ball, sampling, error)
      class(two_mass_type), intent(in) :: self
      !> The source, here the tyre.
      type(ball_type), intent(in) :: ball
      type(sampling_type), intent(in) :: sampling
      type(error_type), allocatable, intent(out) :: error

      if (.not. self%belt_mass < ball%mass) then
         error = input_error('= '//to_text(self%belt_mass)//' kg leaves no rim; allowed: below &ball mass = ' &
            //to_text(ball%mass)//' kg', 'two_mass', 'belt_mass')
      else if (.not. self%inflation_pressure*self%contact_width + self%carcass_stiffness > 0.0_wp) then
         error = input_error('= '//to_text(self%carcass_stiffness)//' N/m with inflation_pressure = ' &
            //to_text(self%inflation_pressure)//' Pa and contact_width = '//to_text(self%contact_width)//' m bears no ' &
            //'load; allowed: a carcass or an inflated patch', 'two_mass', 'carcass_stiffness')
      end if
   end subroutine check

   !> Force history of one drop.
   subroutine solve(self, ball, drop, sampling, history, error, receiver)
      class(two_mass_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      type(drop_type), intent(in) :: drop
      type(sampling_type), intent(in) :: sampling
      type(force_history_type), intent(out) :: history
      type(error_type), allocatable, intent(out) :: error
      type(receiver_type), intent(in), optional :: receiver
      type(tyre_type) :: tyre
      type(sampling_type) :: finer
      real(wp) :: refinement

      tyre = new_tyre(ball%mass, self)
      finer = sampling
      refinement = get_fastest_rate(tyre, get_impact_velocity(drop)) &
         /(merge(step_angle, coupled_angle, is_rigid(receiver))*sampling%sample_rate)
      if (refinement > max_refinement) then
         error = input_error('= '//to_text(self%belt_mass)//' kg with the stiffness of patch and sidewall needs ' &
            //to_text(refinement)//' steps per step of the input; allowed: up to '//to_text(max_refinement), 'two_mass', &
            'belt_mass')
         return
      end if
      finer%substeps = sampling%substeps*ceiling(refinement)
      call solve_lumped(tyre, drop, finer, [character(len=14) :: 'pressure_force', 'carcass_force', 'damping_force'], &
         history, error, receiver, [character(len=19) :: 'belt_displacement_m', 'rim_displacement_m'])
      ! There is no flux of momentum: the "elastic" force is the whole force, including damping.
      history%peak_elastic_force = history%peak_force
   end subroutine solve

   !> The equations of motion in contact.
   pure function new_tyre(mass, options) result(tyre)
      !> Mass of belt and rim together, kg.
      real(wp), intent(in) :: mass
      type(two_mass_type), intent(in) :: options
      type(tyre_type) :: tyre
      real(wp) :: omega

      omega = 2*pi*options%belt_frequency
      tyre = tyre_type(mass=mass, n_mass=2, n_state=n_state, belt_mass=options%belt_mass, &
         rim_mass=mass - options%belt_mass, &
         law=contact_law_type(stiffness=options%inflation_pressure*options%contact_width, &
         factor=options%carcass_stiffness/carcass_deflection**(options%carcass_exponent - 1), &
         exponent=options%carcass_exponent, damping=options%contact_damping), &
         sidewall_stiffness=options%belt_mass*omega**2, &
         sidewall_damping=2*options%belt_damping*options%belt_mass*omega)
   end function new_tyre

   !> Upper bound of the fastest rate of the motion, rad/s: of natural frequencies (by the trace) and of decay rates.
   pure function get_fastest_rate(tyre, impact_velocity) result(rate)
      type(tyre_type), intent(in) :: tyre
      real(wp), intent(in) :: impact_velocity
      real(wp) :: rate
      real(wp) :: energy, deflection, power

      associate (n => tyre%law%exponent, factor => tyre%law%factor, k => tyre%law%stiffness)
         ! Largest deflection: the patch stores all of the energy.
         energy = tyre%mass/2*impact_velocity**2
         deflection = huge(1.0_wp)
         if (k > 0.0_wp) deflection = sqrt(2*energy/k)
         if (factor > 0.0_wp) deflection = min(deflection, ((n + 1)*energy/factor)**(1/(n + 1)))
         power = deflection**(n - 1)
         rate = max(sqrt((k + n*factor*power)/tyre%belt_mass &
            + tyre%sidewall_stiffness*(1/tyre%belt_mass + 1/tyre%rim_mass)), &
            tyre%law%damping*(k + factor*power)*deflection/tyre%belt_mass &
            + tyre%sidewall_damping*(1/tyre%belt_mass + 1/tyre%rim_mass))
      end associate
   end function get_fastest_rate

   !> Right-hand side of the equations of motion.
   pure subroutine get_derivative(self, state, rate, valid)
      class(tyre_type), intent(in) :: self
      real(wp), intent(in) :: state(:)
      real(wp), intent(out) :: rate(:)
      logical, intent(out) :: valid
      real(wp) :: components(3)
      real(wp) :: force, sidewall

      valid = .true.
      call self%get_components(state, components, force)
      associate (belt => state(at_belt_velocity), rim => state(at_rim_velocity))
         sidewall = self%sidewall_stiffness*(state(at_rim) - state(at_belt)) + self%sidewall_damping*(rim - belt)
         rate(at_belt) = belt
         rate(at_belt_velocity) = (sidewall - force)/self%belt_mass
         rate(at_rim) = rim
         rate(at_rim_velocity) = -sidewall/self%rim_mass
         rate(at_impulse) = force
         rate(at_loss) = components(3)*belt + self%sidewall_damping*(rim - belt)**2
      end associate
   end subroutine get_derivative

   !> Components of the force on the floor: inflation pressure, carcass, damping.
   pure subroutine get_components(self, state, components, elastic_force)
      class(tyre_type), intent(in) :: self
      real(wp), intent(in) :: state(:)
      real(wp), intent(out) :: components(:)
      !> The whole force, including damping: there is no flux of momentum.
      real(wp), intent(out) :: elastic_force

      components = 0.0_wp
      if (self%touching) components = get_contact_force(self%law, state(at_belt), state(at_belt_velocity))
      elastic_force = sum(components)
   end subroutine get_components

   !> Displacement, m, and velocity, m/s, of the center of mass: [2].
   pure function get_center_motion(self, state) result(center)
      class(tyre_type), intent(in) :: self
      real(wp), intent(in) :: state(:)
      real(wp) :: center(2)

      center = (self%belt_mass*state([at_belt, at_belt_velocity]) + self%rim_mass*state([at_rim, at_rim_velocity])) &
         /(self%belt_mass + self%rim_mass)
   end function get_center_motion

   !> Energy of the relative motion of belt and rim, and of the sidewall, J.
   pure function get_inner_energy(self, state) result(energy)
      class(tyre_type), intent(in) :: self
      real(wp), intent(in) :: state(:)
      real(wp) :: energy

      energy = self%belt_mass*self%rim_mass/(self%belt_mass + self%rim_mass)/2 &
         *(state(at_rim_velocity) - state(at_belt_velocity))**2 &
         + self%sidewall_stiffness/2*(state(at_rim) - state(at_belt))**2
   end function get_inner_energy

   !> Maximum displacement of the belt below the center of mass in flight, with all inner energy in the sidewall, m.
   pure function get_amplitude(self, state) result(amplitude)
      class(tyre_type), intent(in) :: self
      real(wp), intent(in) :: state(:)
      real(wp) :: amplitude

      amplitude = self%rim_mass/(self%belt_mass + self%rim_mass)*sqrt(2*self%get_inner_energy(state)/self%sidewall_stiffness)
   end function get_amplitude

end module thud_two_mass
