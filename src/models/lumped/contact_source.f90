!> Interface of a source of a few masses, the first of which touches the floor. The floor may be rigid or mobile.
!>
!> The state holds displacement towards the floor (m) and velocity (m/s) of each mass in turn, then impulse on the floor
!> (N s) and energy lost (J). On a mobile floor displacements and velocities are relative to the floor, but the rates that
!> `get_derivative` returns for the velocities are the absolute accelerations of the masses; force and loss are defined as on
!> a rigid floor.
module thud_contact_source
   use thud_ball, only: drop_type
   use thud_error, only: error_type, numerical_error
   use thud_kinds, only: wp
   use thud_rk4, only: ode_type
   use thud_text, only: fixed, to_text
   implicit none (type, external)
   private

   public :: at_deflection, at_impulse, at_loss, at_velocity, coarse_step_error, contact_law_type, contact_source_type
   public :: get_contact_force

   !> Indices in the state of a single mass: deflection (m), velocity (m/s), impulse on the floor (N s), energy lost (J).
   integer, parameter :: at_deflection = 1, at_velocity = 2, at_impulse = 3, at_loss = 4

   !> Contact law: a linear and a power-law spring in parallel, damped in proportion to their force (Hunt and Crossley 1975),
   !> F = (k d + c d^n)(1 + a d'), never tensile.
   type :: contact_law_type
      !> Stiffness k of the linear spring, N/m.
      real(wp) :: stiffness = 0.0_wp
      !> Factor c of the power law, N/m^exponent, and its exponent n.
      real(wp) :: factor = 0.0_wp, exponent = 1.5_wp
      !> Damping a, s/m.
      real(wp) :: damping = 0.0_wp
   end type contact_law_type

   !> Equations of motion of the source.
   type, abstract, extends(ode_type) :: contact_source_type
      !> Mass of the source, kg.
      real(wp) :: mass = 0.0_wp
      !> Number of moving masses, and length of the state.
      integer :: n_mass = 1, n_state = 4
      !> Mass of the cap, the flattened part of a hollow ball, which lies on the floor and moves with it, per unit
      !> deflection, kg/m.
      real(wp) :: cap_mass_per_deflection = 0.0_wp
      !> Whether the source touches the floor, and whether its deflection grows.
      logical :: touching = .true., compressing = .true.
   contains
      procedure(get_components_interface), deferred :: get_components
      procedure :: get_center_motion
      procedure :: get_inner_energy
      procedure :: get_failure
      procedure :: get_amplitude
   end type contact_source_type

   abstract interface
      !> Components of the force at one instant.
      pure subroutine get_components_interface(self, state, components, elastic_force)
         import :: contact_source_type, wp
         implicit none (type, external)
         !> The source in its present phase.
         class(contact_source_type), intent(in) :: self
         !> State, relative to the floor: [n_state].
         real(wp), intent(in) :: state(:)
         !> Components of the force on the floor, N: [n_component].
         real(wp), intent(out) :: components(:)
         !> Force without the flux of momentum, N.
         real(wp), intent(out) :: elastic_force
      end subroutine get_components_interface
   end interface

contains

   !> Displacement, m, and velocity, m/s, of the center of mass: [2].
   pure function get_center_motion(self, state) result(center)
      class(contact_source_type), intent(in) :: self
      !> State: [n_state].
      real(wp), intent(in) :: state(:)
      real(wp) :: center(2)

      center = state(1:2)
   end function get_center_motion

   !> Energy of the relative motion of the masses and of the springs between them, J.
   pure function get_inner_energy(self, state) result(energy)
      class(contact_source_type), intent(in) :: self
      !> State: [n_state].
      real(wp), intent(in) :: state(:)
      real(wp) :: energy

      energy = 0.0_wp
   end function get_inner_energy

   !> Error after a step that leaves the domain of the equations. Sources with a limited domain override it.
   function get_failure(self, drop, time, state) result(error)
      class(contact_source_type), intent(in) :: self
      type(drop_type), intent(in) :: drop
      !> Time since first touch, s.
      real(wp), intent(in) :: time
      !> Last valid state: [n_state].
      real(wp), intent(in) :: state(:)
      type(error_type) :: error

      error = numerical_error('= '//to_text(drop%height)//' m: the source leaves the domain of its equations ' &
         //fixed(1.0e3_wp*time, 3)//' ms after first touch, at a deflection of '//to_text(state(1))//' m; allowed: a ' &
         //'lower height', 'drop', 'height')
   end function get_failure

   !> Maximum displacement of the first mass below the center of mass in flight, m.
   pure function get_amplitude(self, state) result(amplitude)
      class(contact_source_type), intent(in) :: self
      !> State: [n_state].
      real(wp), intent(in) :: state(:)
      real(wp) :: amplitude

      amplitude = 0.0_wp
   end function get_amplitude

   !> Error for steps that are too long for the source.
   pure function coarse_step_error(finding) result(error)
      !> Symptom, for the message.
      character(len=*), intent(in) :: finding
      type(error_type) :: error
      character(len=:), allocatable :: shown

      shown = finding
      if (index(finding, 'NaN') + index(finding, 'Infinity') > 0) shown = 'the motion grows without bound'
      error = numerical_error('is too low for this source: '//shown//'; allowed: more substeps, a higher sample_rate, or ' &
         //'a softer or heavier source', 'sampling', 'substeps')
      error%has_coarse_steps = .true.
   end function coarse_step_error

   !> Components of the force. They stay smooth beyond the end of a contact, where the search for it evaluates them.
   pure function get_contact_force(law, deflection, velocity) result(components)
      type(contact_law_type), intent(in) :: law
      !> Deflection d, m, and its rate, m/s.
      real(wp), intent(in) :: deflection, velocity
      !> Linear spring, power law, damping, N: [3].
      real(wp) :: components(3)

      components(1) = law%stiffness*deflection
      components(2) = law%factor*sign(abs(deflection)**law%exponent, deflection)
      components(3) = max(-1.0_wp, law%damping*velocity)*sum(components(1:2))
   end function get_contact_force

end module thud_contact_source
