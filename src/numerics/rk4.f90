!> Classical fourth-order Runge-Kutta steps for autonomous systems of ordinary differential equations.
module thud_rk4
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: ode_type, rk4_step

   !> A first-order autonomous system of ordinary differential equations.
   type, abstract :: ode_type
   contains
      procedure(derivative_interface), deferred :: get_derivative
   end type ode_type

   abstract interface
      !> Right-hand side of the system.
      pure subroutine derivative_interface(self, state, rate, valid)
         import :: ode_type, wp
         implicit none (type, external)
         class(ode_type), intent(in) :: self
         !> State: [n_state].
         real(wp), intent(in) :: state(:)
         !> Its derivative: [n_state].
         real(wp), intent(out) :: rate(:)
         !> False if the state has left the domain of the equations.
         logical, intent(out) :: valid
      end subroutine derivative_interface
   end interface

contains

   !> One step. Shorter steps from the same state are the dense output: as a function of `step`, the result follows the
   !> solution with a local error of order step**5.
   pure subroutine rk4_step(ode, state, step, new_state, valid)
      class(ode_type), intent(in) :: ode
      !> State at the beginning: [n_state].
      real(wp), intent(in) :: state(:)
      !> Length of the step.
      real(wp), intent(in) :: step
      !> State at the end; the state at the beginning if the step is not valid: [n_state].
      real(wp), intent(out) :: new_state(:)
      !> False if a stage has left the domain of the equations.
      logical, intent(out) :: valid
      real(wp), dimension(size(state)) :: k1, k2, k3, k4

      new_state = state
      call ode%get_derivative(state, k1, valid)
      if (.not. valid) return
      call ode%get_derivative(state + step/2*k1, k2, valid)
      if (.not. valid) return
      call ode%get_derivative(state + step/2*k2, k3, valid)
      if (.not. valid) return
      call ode%get_derivative(state + step*k3, k4, valid)
      if (.not. valid) return
      new_state = state + step/6*(k1 + 2*(k2 + k3) + k4)
   end subroutine rk4_step

end module thud_rk4
