!> A source of a few masses of which the first touches the floor: what the march on a floor that moves needs of it.
!>
!> Its equations of motion are laid out in pairs, displacement towards the floor (m) and velocity (m/s) of each mass, then
!> impulse given to the floor (N s) and energy lost (J); further places are its own. On a floor that moves they hold for
!> displacements and velocities relative to the floor, and give accelerations, force and loss all the same.
module thud_contact_source
   use thud_drop, only: drop_type
   use thud_error, only: error_type, numerical_error
   use thud_force_history, only: force_history_type
   use thud_kinds, only: wp
   use thud_rk4, only: ode_type
   use thud_text, only: fixed, to_text
   implicit none (type, external)
   private

   public :: coarse_error, contact_source_type

   !> Equations of motion of the source.
   type, abstract, extends(ode_type) :: contact_source_type
      !> Mass of the source, kg.
      real(wp) :: mass = 0.0_wp
      !> Masses that move, and places of the state.
      integer :: n_mass = 1, n_state = 4
      !> Mass that rests on the floor and moves with it, over the deflection, kg/m.
      real(wp) :: cap_growth = 0.0_wp
      !> The source touches the floor; its deflection grows.
      logical :: touching = .true., compressing = .true.
   contains
      procedure(record_sample_interface), deferred :: record_sample
      procedure(record_peaks_interface), deferred :: record_peaks
      procedure :: get_failure
      procedure :: get_reach
   end type contact_source_type

   abstract interface
      !> Writes motion and forces of one instant into the history.
      pure subroutine record_sample_interface(self, state, i, history)
         import :: contact_source_type, force_history_type, wp
         implicit none (type, external)
         !> The source in its present phase.
         class(contact_source_type), intent(in) :: self
         !> State, relative to the floor: [n_state].
         real(wp), intent(in) :: state(:)
         !> Number of the sample.
         integer, intent(in) :: i
         type(force_history_type), intent(inout) :: history
      end subroutine record_sample_interface

      !> Raises the maxima in the history to those of one instant of contact.
      pure subroutine record_peaks_interface(self, state, history)
         import :: contact_source_type, force_history_type, wp
         implicit none (type, external)
         !> The source in its present phase.
         class(contact_source_type), intent(in) :: self
         !> State, relative to the floor: [n_state].
         real(wp), intent(in) :: state(:)
         type(force_history_type), intent(inout) :: history
      end subroutine record_peaks_interface
   end interface

contains

   !> Error of a state outside the domain of the equations; sources that have such states override it.
   function get_failure(self, drop, time, state) result(error)
      class(contact_source_type), intent(in) :: self
      type(drop_type), intent(in) :: drop
      !> Time since first touch, s.
      real(wp), intent(in) :: time
      !> Last valid state: [n_state].
      real(wp), intent(in) :: state(:)
      type(error_type) :: error

      error = numerical_error('&drop: height = '//to_text(drop%height)//' m leads out of the model of a source of ' &
         //to_text(self%mass)//' kg: '//fixed(1.0e3_wp*time, 3)//' ms after first touch the deflection is ' &
         //to_text(state(1))//' m; allowed: lower drops')
   end function get_failure

   !> Line that the source in flight does not cross: no part of it sinks below.
   pure subroutine get_reach(self, state, displacement, velocity)
      class(contact_source_type), intent(in) :: self
      !> State: [n_state].
      real(wp), intent(in) :: state(:)
      !> Displacement of the line towards the floor, m, and its constant velocity, m/s.
      real(wp), intent(out) :: displacement, velocity

      displacement = state(1)
      velocity = state(2)
   end subroutine get_reach

   !> Error of steps that are too long for the source.
   pure function coarse_error(finding) result(error)
      !> What shows it.
      character(len=*), intent(in) :: finding
      type(error_type) :: error
      character(len=:), allocatable :: shown

      shown = finding
      if (index(finding, 'NaN') + index(finding, 'Infinity') > 0) shown = 'the motion leaves the range of numbers'
      error = numerical_error('&sampling: substeps is too low for this source: '//shown &
         //'; allowed: more substeps, a higher sample_rate, or a source of lower stiffness over mass')
   end function coarse_error

end module thud_contact_source
