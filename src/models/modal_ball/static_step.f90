!> Time steps of the modes without inertia: all modes too fast to oscillate. They share the creep of the material, so their
!> displacements at the rings follow the forces on the rings as one material does:
!> g u + sum of g_k (u - x_k) + t u' = C f and x_k' = (u - x_k)/tau_k, with the flexibility C of these modes, forces f that
!> are constant in a step, the moduli g and g_k relative to the storage modulus, and the retardation time t.
module thud_static_step
   use thud_kinds, only: wp
   use thud_matrix_exponential, only: get_exponential
   use thud_mode_step, only: mode_step_type
   implicit none (type, external)
   private

   public :: new_static_step, static_step_type

   !> Factors of a step, and the flexibility.
   type :: static_step_type
      !> Displacements of the rings due to unit forces, m/N: [n_gap, n_gap].
      real(wp), allocatable :: flexibility(:, :)
      !> Factors of u and of the internal variables in one step: [1 + n_branch, 1 + n_branch].
      real(wp), allocatable :: factor(:, :)
      !> The same variables after one step from rest due to unit C f: [1 + n_branch].
      real(wp), allocatable :: gain(:)
   end type static_step_type

contains

   !> The factors of a step.
   pure function new_static_step(modes, interval, flexibility) result(step)
      !> The modes; moduli, relaxation times and retardation time are set.
      type(mode_step_type), intent(in) :: modes
      !> Length of a step, s.
      real(wp), intent(in) :: interval
      !> Displacements of the rings due to unit forces, m/N: [n_gap, n_gap].
      real(wp), intent(in) :: flexibility(:, :)
      type(static_step_type) :: step
      real(wp) :: matrix(2 + size(modes%time), 2 + size(modes%time))
      integer :: k, n

      n = 1 + size(modes%time)
      step%flexibility = flexibility
      allocate (step%factor(n, n), step%gain(n), source=0.0_wp)
      if (.not. modes%retardation_time > 0.0_wp) then
         ! Elastic.
         step%gain(1) = 1
         return
      end if
      matrix = 0.0_wp
      matrix(1, 1) = -(modes%equilibrium_ratio + sum(modes%relative_modulus))
      matrix(1, 2:n) = modes%relative_modulus
      matrix(1, n + 1) = 1
      matrix(1, :) = matrix(1, :)/modes%retardation_time
      do k = 2, n
         matrix(k, [1, k]) = [1, -1]/modes%time(k - 1)
      end do
      matrix = get_exponential(interval*matrix)
      step%factor = matrix(:n, :n)
      step%gain = matrix(:n, n + 1)
   end function new_static_step

end module thud_static_step
