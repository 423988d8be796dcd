!> A source of a single mass: its state and its record.
module thud_single_mass
   use thud_contact_source, only: contact_source_type
   use thud_force_history, only: force_history_type
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: at_deflection, at_impulse, at_loss, at_velocity, single_mass_type

   !> Indices in the state: deflection (m), velocity (m/s), impulse on the floor (N s), energy lost (J).
   integer, parameter :: at_deflection = 1, at_velocity = 2, at_impulse = 3, at_loss = 4

   !> Equation of motion of the source, for this state.
   type, abstract, extends(contact_source_type) :: single_mass_type
   contains
      procedure(get_components_interface), deferred :: get_components
      procedure :: record_sample
      procedure :: record_peaks
   end type single_mass_type

   abstract interface
      !> Components of the force at one instant.
      pure subroutine get_components_interface(self, state, components, elastic_force)
         import :: single_mass_type, wp
         implicit none (type, external)
         class(single_mass_type), intent(in) :: self
         !> State: [4].
         real(wp), intent(in) :: state(:)
         !> Components of the force on the floor, N: [n_component].
         real(wp), intent(out) :: components(:)
         !> Force without the flux of momentum, N.
         real(wp), intent(out) :: elastic_force
      end subroutine get_components_interface
   end interface

contains

   !> Writes motion and forces of one sample into the history.
   pure subroutine record_sample(self, state, i, history)
      class(single_mass_type), intent(in) :: self
      real(wp), intent(in) :: state(:)
      integer, intent(in) :: i
      type(force_history_type), intent(inout) :: history

      history%deflection(i) = state(at_deflection)
      history%velocity(i) = state(at_velocity)
      if (.not. self%touching) return
      call self%get_components(state, history%component(i, :), history%elastic_force(i))
      history%peak_elastic_force = max(history%peak_elastic_force, history%elastic_force(i))
      history%peak_force = max(history%peak_force, history%peak_elastic_force, sum(history%component(i, :)))
      ! A component may jump at first touch: the first sample is the mean of both sides.
      if (i == 1) history%component(i, :) = history%component(i, :)/2
      history%floor_force(i) = sum(history%component(i, :))
   end subroutine record_sample

   !> Updates the maxima of deflection and force.
   pure subroutine record_peaks(self, state, history)
      class(single_mass_type), intent(in) :: self
      real(wp), intent(in) :: state(:)
      type(force_history_type), intent(inout) :: history
      real(wp) :: components(size(history%component, 2))
      real(wp) :: elastic_force

      call self%get_components(state, components, elastic_force)
      history%max_deflection = max(history%max_deflection, state(at_deflection))
      history%peak_elastic_force = max(history%peak_elastic_force, elastic_force)
      history%peak_force = max(history%peak_force, history%peak_elastic_force)
   end subroutine record_peaks

end module thud_single_mass
