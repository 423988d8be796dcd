!> The paper's analytical model (section 2, after Hubbard and Stronge 2001): an elastic hollow
!> sphere whose flattened cap rests on the floor while the rest moves uniformly.
module thud_hollow_sphere
   use thud_ball, only: ball_type, drop_type, get_impact_velocity
   use thud_constants, only: pi
   use thud_contact_source, only: at_deflection, at_impulse, at_loss, at_velocity, coarse_step_error, contact_source_type
   use thud_error, only: error_type, numerical_error
   use thud_field, only: field_type, name_length, new_field
   use thud_force_history, only: force_history_type
   use thud_kinds, only: wp
   use thud_lumped, only: solve_lumped
   use thud_receiver, only: receiver_type
   use thud_sampling, only: sampling_type
   use thud_source_model, only: source_model_type
   use thud_text, only: fixed, to_text
   use thud_validity_limit, only: get_gravity_limit, get_wall_limits, validity_limit_type
   implicit none (type, external)
   private

   public :: compression_weights, flux_choices, get_gas_force
   public :: get_shell_stiffness, hollow_sphere_type, new_shell, restitution_weights, shell_type
   public :: solve_hollow_sphere

   !> Modulus of elasticity of the paper's ball, Pa (section 2.3).
   real(wp), parameter, public :: hollow_sphere_modulus = 1.6e6_wp

   !> Options of the model.
   type, extends(source_model_type) :: hollow_sphere_type
      !> Treatment of the momentum of wall that enters or leaves the flat cap, one of `flux_choices`.
      character(len=name_length) :: momentum_flux = 'momentum_balance'
   contains
      procedure :: get_fields
      procedure :: solve => solve_hollow_sphere
      procedure :: get_validity_limits
      procedure :: compress
   end type hollow_sphere_type

   !> The choices of `momentum_flux`.
   character(len=24), parameter :: flux_choices(4) = [character(len=24) :: &
      'momentum_balance', 'retarding', 'conservative', 'none']

   !> Factors s of the flux term in compression and in restitution, for each choice.
   real(wp), parameter :: compression_weights(4) = [0.0_wp, -1.0_wp, 0.5_wp, 0.0_wp]
   real(wp), parameter :: restitution_weights(4) = [1.0_wp, 0.0_wp, 0.5_wp, 0.0_wp]

   !> Equation of motion of the shell (paper eq. 3) for one phase of the impact.
   type, extends(contact_source_type) :: shell_type
      !> Outer radius R, m.
      real(wp) :: radius = 0.0_wp
      !> Deflection at which the flat cap meets the opposite wall and the cavity is closed, m.
      real(wp) :: closing_deflection = 0.0_wp
      !> Stiffness k of the shell, N/m.
      real(wp) :: stiffness = 0.0_wp
      !> Absolute pressure of the gas in the undeformed ball, Pa.
      real(wp) :: initial_pressure = 0.0_wp
      !> Pressure of the air around the ball, Pa.
      real(wp) :: ambient_pressure = 0.0_wp
      !> Ratio of specific heats of the gas.
      real(wp) :: heat_capacity_ratio = 0.0_wp
      !> Factors s of the flux term before and after the turning point.
      real(wp) :: compression_weight = 0.0_wp, restitution_weight = 0.0_wp
   contains
      procedure :: get_derivative
      procedure :: get_components
      procedure :: get_failure
   end type shell_type

contains

   !> Key and allowed values.
   function get_fields(self) result(fields)
      class(hollow_sphere_type), intent(in), target :: self
      type(field_type), allocatable :: fields(:)

      fields = [new_field('momentum_flux', self%momentum_flux, '', &
         'term for the momentum of wall that enters or leaves the flat cap', choices=flux_choices)]
   end function get_fields

   !> Limits of the assumptions: a thin shell, a wall that stays close to the sphere, and no gravity during the contact.
   function get_validity_limits(self, ball, drop, history) result(limits)
      class(hollow_sphere_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      type(drop_type), intent(in) :: drop
      type(force_history_type), intent(in) :: history
      type(validity_limit_type), allocatable :: limits(:)

      limits = [validity_limit_type('ball', 'wall thickness over outer radius', ball%wall_thickness/ball%outer_radius, &
         highest=0.4_wp, reason="shells are thin; the paper's ball has 0.36"), &
         get_wall_limits(ball, history), get_gravity_limit(drop, history)]
   end function get_validity_limits

   !> Force on each of two plates in a quasi-static compression: each plate flattens a cap of half their approach.
   subroutine compress(self, ball, deflection, force, error)
      class(hollow_sphere_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      real(wp), intent(in) :: deflection(:)
      real(wp), intent(out) :: force(:)
      type(error_type), allocatable, intent(out) :: error
      type(shell_type) :: shell
      integer :: i

      force = 0.0_wp
      shell = new_shell(ball, 0.0_wp, 0.0_wp)
      if (deflection(size(deflection)) >= shell%closing_deflection) then
         error = numerical_error('= '//to_text(deflection(size(deflection)))//' m: the cavity collapses; allowed: less ' &
            //'than its height, '//to_text(shell%closing_deflection)//' m', 'compression', 'max_deflection')
         return
      end if
      force = [(shell%stiffness*deflection(i)/2 + get_gas_force(shell, deflection(i)/2, caps=2), i=1, size(deflection))]
   end subroutine compress

   !> The equation of motion of a ball.
   pure function new_shell(ball, compression_weight, restitution_weight) result(shell)
      type(ball_type), intent(in) :: ball
      !> Factors s of the flux term in compression and in restitution.
      real(wp), intent(in) :: compression_weight, restitution_weight
      type(shell_type) :: shell

      shell%radius = ball%outer_radius
      shell%closing_deflection = 2*(ball%outer_radius - ball%wall_thickness)
      shell%mass = ball%mass
      ! m = M (1 - deflection/2R): the rest of the wall lies on the floor.
      shell%cap_mass_per_deflection = ball%mass/(2*ball%outer_radius)
      shell%stiffness = get_shell_stiffness(ball)
      shell%initial_pressure = ball%ambient_pressure + ball%gauge_pressure
      shell%ambient_pressure = ball%ambient_pressure
      shell%heat_capacity_ratio = ball%heat_capacity_ratio
      shell%compression_weight = compression_weight
      shell%restitution_weight = restitution_weight
   end function new_shell

   !> Stiffness of the shell under the flattening load, N/m (paper eq. 2, after Reissner).
   pure function get_shell_stiffness(ball) result(stiffness)
      type(ball_type), intent(in) :: ball
      !> k = 8 E h^2/(R sqrt(12 (1 - nu^2))), N/m.
      real(wp) :: stiffness

      stiffness = 8*ball%youngs_modulus*ball%wall_thickness**2 &
         /(ball%outer_radius*sqrt(12*(1 - ball%poisson_ratio**2)))
   end function get_shell_stiffness

   !> Force of the enclosed gas, N (paper eq. 2): adiabatic overpressure on the flat cap.
   pure function get_gas_force(shell, deflection, caps) result(force)
      class(shell_type), intent(in) :: shell
      !> Deflection, m; below the closing deflection.
      real(wp), intent(in) :: deflection
      !> Number of caps that have this deflection (default: 1).
      integer, intent(in), optional :: caps
      !> Force, N.
      real(wp) :: force
      real(wp) :: overpressure, lost_volume

      ! Fraction of the volume of the undeformed sphere.
      lost_volume = deflection**2*(3*shell%radius - deflection)/(4*shell%radius**3)
      if (present(caps)) lost_volume = caps*lost_volume
      overpressure = shell%initial_pressure*(1 - lost_volume)**(-shell%heat_capacity_ratio) - shell%ambient_pressure
      force = overpressure*pi*deflection*(2*shell%radius - deflection)
   end function get_gas_force

   !> Right-hand side of the equation of motion, m a = s (M/2R) v^2 - F_B - F_G, with
   !> m = M (1 - deflection/2R).
   pure subroutine get_derivative(self, state, rate, valid)
      class(shell_type), intent(in) :: self
      real(wp), intent(in) :: state(:)
      real(wp), intent(out) :: rate(:)
      logical, intent(out) :: valid
      real(wp) :: elastic_force, flux, moving_mass, weight

      associate (deflection => state(at_deflection), velocity => state(at_velocity))
         ! Below the closing deflection gas volume and moving mass are positive.
         valid = deflection < self%closing_deflection
         rate = 0.0_wp
         if (.not. valid) return
         elastic_force = self%stiffness*deflection + get_gas_force(self, deflection)
         flux = self%mass/(2*self%radius)*velocity**2
         weight = merge(self%compression_weight, self%restitution_weight, self%compressing)
         moving_mass = self%mass*(1 - deflection/(2*self%radius))
         rate(at_deflection) = velocity
         rate(at_velocity) = (weight*flux - elastic_force)/moving_mass
         ! The floor changes the momentum m v of the ball: d(m v)/dt = -(elastic + (1 - s) flux).
         rate(at_impulse) = elastic_force + (1 - weight)*flux
         rate(at_loss) = (0.5_wp - weight)*flux*velocity
      end associate
   end subroutine get_derivative

   !> Shell, gas and flux force at one instant.
   pure subroutine get_components(self, state, components, elastic_force)
      class(shell_type), intent(in) :: self
      real(wp), intent(in) :: state(:)
      !> F_B, F_G and the flux of momentum into the floor, N: [3].
      real(wp), intent(out) :: components(:)
      !> F_B + F_G (paper eq. 1), N.
      real(wp), intent(out) :: elastic_force
      real(wp) :: weight

      weight = merge(self%compression_weight, self%restitution_weight, self%compressing)
      components = [self%stiffness*state(at_deflection), get_gas_force(self, state(at_deflection)), &
         (1 - weight)*self%mass/(2*self%radius)*state(at_velocity)**2]
      elastic_force = components(1) + components(2)
   end subroutine get_components

   !> Whether a state results from a step that is too long: far outside the domain, or with several times the energy of the
   !> impact.
   pure function is_diverged(shell, drop, state) result(diverged)
      class(shell_type), intent(in) :: shell
      type(drop_type), intent(in) :: drop
      !> State: [4].
      real(wp), intent(in) :: state(:)
      !> True also if the state is not a number.
      logical :: diverged

      ! The factor leaves room for a floor that moves towards the ball.
      diverged = .not. (abs(state(at_deflection)/shell%closing_deflection - 0.5_wp) < 0.52_wp .and. &
         (1 - state(at_deflection)/(2*shell%radius))*state(at_velocity)**2 < 4*get_impact_velocity(drop)**2)
   end function is_diverged

   !> Error for a drop in which the cavity collapses.
   function get_failure(self, drop, time, state) result(error)
      class(shell_type), intent(in) :: self
      type(drop_type), intent(in) :: drop
      real(wp), intent(in) :: time
      real(wp), intent(in) :: state(:)
      type(error_type) :: error

      if (is_diverged(self, drop, state)) then
         error = coarse_step_error('a step ends at a deflection of '//to_text(state(at_deflection))//' m')
         return
      end if
      error = numerical_error('= '//to_text(drop%height)//' m: the cavity collapses '//fixed(1.0e3_wp*time, 3)//' ms ' &
         //'after first touch; allowed: a deflection of less than its height, '//fixed(1.0e3_wp*self%closing_deflection, &
         2)//' mm', 'drop', 'height')
   end function get_failure

   !> Force history of one drop.
   subroutine solve_hollow_sphere(self, ball, drop, sampling, history, error, receiver)
      class(hollow_sphere_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      type(drop_type), intent(in) :: drop
      type(sampling_type), intent(in) :: sampling
      type(force_history_type), intent(out) :: history
      type(error_type), allocatable, intent(out) :: error
      type(receiver_type), intent(in), optional :: receiver
      type(shell_type) :: shell
      integer :: choice

      choice = findloc(flux_choices, self%momentum_flux, dim=1)
      shell = new_shell(ball, compression_weights(choice), restitution_weights(choice))
      call solve_lumped(shell, drop, sampling, [character(len=12) :: 'shell_force', 'gas_force', 'flux_force'], &
         history, error, receiver)
      ! Only with the balance of momentum does the force end without a jump: another force has an error that is proportional
      ! to the sampling interval.
      if (self%momentum_flux /= 'momentum_balance') history%error_ratio = 1.0_wp
   end subroutine solve_hollow_sphere

end module thud_hollow_sphere
