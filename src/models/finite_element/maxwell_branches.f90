!> Stresses of the Maxwell branches of rubber at large strain, for a block of elements.
!>
!> A branch has the energy mu_i/2 (tr(C Cv^-1) - 3) with the isochoric right Cauchy-Green tensor C, and the viscous flow
!> Cv' = (C - tr(C Cv^-1)/3 Cv)/tau_i (Simo and Miehe 1992). Steps are in closed form after Shutov, Landgraf and Ihlemann
!> (2013, Comput. Methods Appl. Mech. Eng. 265, 213-225), with exp(step/tau) - 1 in place of their step/tau, which is exact
!> at small strain. Cv stays symmetric, positive definite and of determinant 1 with any step.
!>
!> The viscous tensors are known at the midpoints between the instants of the displacements, as velocities are: the step is
!> of second order. A branch that relaxes within a step acts as a viscosity.
!>
!> Components as in `thud_element_block`. Arithmetic limits the speed: each step has two cube roots per branch and point.
module thud_maxwell_branches
   use thud_element_block, only: n_lane, n_symmetric
   use thud_kinds, only: wp
   use thud_rubber, only: get_inverse_cube_root
   implicit none (type, external)
   private

   public :: add_branch_stress, branch_step_type, new_branch_step

   !> Length of a step divided by the relaxation time beyond which a branch has lost its memory.
   real(wp), parameter :: max_step_ratio = 100.0_wp

   !> Multiplication takes a fraction of the time of a division.
   real(wp), parameter :: third = 1/3.0_wp

   !> Distance from 1 within which the series of the cube root has all digits.
   real(wp), parameter :: near_1 = 1.0e-3_wp

   !> What a step of some length means for a branch.
   type :: branch_step_type
      !> Shear modulus, Pa; modulus divided by relaxation time, Pa/s.
      real(wp) :: modulus = 0.0_wp, power_factor = 0.0_wp
      !> Weights of the deformation, relative to the viscous tensor, for the mean stress of the step and for its end.
      real(wp) :: mean_weight = 0.0_wp, end_weight = 0.0_wp
      !> Derivative of the weight for the end with respect to tr(C Cv^-1).
      real(wp) :: weight_slope = 0.0_wp
      !> Energy divided by tr(C Cv^-1) - 3 in the mean state of the step, Pa.
      real(wp) :: stiffness = 0.0_wp
   end type branch_step_type

contains

   !> A step of a branch.
   pure elemental function new_branch_step(modulus, time, interval) result(step)
      !> Shear modulus, Pa; relaxation time, s; length of the step, s.
      real(wp), intent(in) :: modulus, time, interval
      type(branch_step_type) :: step
      real(wp) :: ratio

      ratio = interval/time
      step%modulus = modulus
      step%power_factor = modulus/time
      if (ratio < 1.0e-3_wp) then
         ! A series, since the difference would lose digits; off by x**4/720.
         step%mean_weight = ratio/2 + ratio**2/12
      else
         ! The value of exp(t/time) - 1 at the instant t at which a decaying stress equals its mean over the step.
         step%mean_weight = ratio/(1 - exp(-ratio)) - 1
      end if
      ! Work, energy and loss of a linear branch balance over the steps.
      step%stiffness = modulus/2*(1 + step%mean_weight)*(1 + exp(-ratio))/2
      ratio = min(ratio, max_step_ratio)
      step%end_weight = exp(ratio) - 1
      ! The weight grows at the rate tr(C Cv^-1)/3, 1 at small strain: a correction of second order in the step.
      step%weight_slope = ratio**2/6
   end function new_branch_step

   !> Adds the mean stresses of one Maxwell branch over a step, and updates its viscous tensors.
   pure subroutine add_branch_stress(step, c, inverse, viscous, isochoric, density, power)
      type(branch_step_type), intent(in) :: step
      !> Isochoric right Cauchy-Green tensors C, and their inverses: [n_lane, symmetric].
      real(wp), intent(in) :: c(n_lane, n_symmetric), inverse(n_lane, n_symmetric)
      !> Viscous tensors Cv, advanced from half a step before to half a step after: [n_lane, symmetric].
      real(wp), intent(inout) :: viscous(n_lane, n_symmetric)
      !> Isochoric stresses 2 dW/dC, Pa: [n_lane, symmetric].
      real(wp), intent(inout) :: isochoric(n_lane, n_symmetric)
      !> Energies, J/m3, and dissipated powers, W/m3, per undeformed volume: [n_lane].
      real(wp), intent(inout) :: density(n_lane), power(n_lane)
      real(wp), dimension(n_lane, n_symmetric) :: adjugate
      real(wp), dimension(n_lane) :: root, trace_of_inverse
      real(wp) :: distance, norm, end_norm, rr, zz, hoop, rz, determinant, scale, factor, trace, weight
      integer :: j

      ! Mixtures are divided by their norm at C = Cv, near which their determinant is 1.
      norm = 1/(1 + step%mean_weight)
      distance = 0.0_wp
      !$omp simd private(rr, zz, hoop, rz, determinant) reduction(+:distance)
      do j = 1, n_lane
         rr = viscous(j, 1) + step%mean_weight*c(j, 1)
         zz = viscous(j, 2) + step%mean_weight*c(j, 2)
         hoop = viscous(j, 3) + step%mean_weight*c(j, 3)
         rz = viscous(j, 4) + step%mean_weight*c(j, 4)
         adjugate(j, 1) = zz*hoop
         adjugate(j, 2) = rr*hoop
         adjugate(j, 3) = rr*zz - rz**2
         adjugate(j, 4) = rz*hoop
         determinant = norm**3*hoop*adjugate(j, 3)
         distance = distance + (1 - determinant)**2
         root(j) = get_root_near_1(determinant)
         trace_of_inverse(j) = rr*inverse(j, 1) + zz*inverse(j, 2) + hoop*inverse(j, 3) + 2*rz*inverse(j, 4)
      end do
      ! The determinant of an adjugate is the square of that of the tensor.
      if (.not. distance <= near_1**2) call get_inverse_cube_root(n_lane, norm**3*sqrt(get_determinants(adjugate)), root)
      end_norm = 1/(1 + step%end_weight)
      distance = 0.0_wp
      !$omp simd private(rr, zz, hoop, rz, determinant, scale, factor, trace, weight) reduction(+:distance)
      do j = 1, n_lane
         ! The inverse of the mixture scaled to determinant 1 is the scaled adjugate.
         scale = norm*root(j)
         factor = step%modulus*scale**2
         isochoric(j, 1) = isochoric(j, 1) + factor*adjugate(j, 1)
         isochoric(j, 2) = isochoric(j, 2) + factor*adjugate(j, 2)
         isochoric(j, 3) = isochoric(j, 3) + factor*adjugate(j, 3)
         isochoric(j, 4) = isochoric(j, 4) - factor*adjugate(j, 4)
         trace = scale**2*(c(j, 1)*adjugate(j, 1) + c(j, 2)*adjugate(j, 2) + c(j, 3)*adjugate(j, 3) &
            - 2*c(j, 4)*adjugate(j, 4))
         density(j) = density(j) + step%stiffness*(trace - 3)
         ! The square of the deviator of C Cv^-1, by its first and second invariants.
         power(j) = power(j) + step%power_factor*(third*trace**2 - scale*trace_of_inverse(j))
         weight = step%end_weight + step%weight_slope*(trace - 3)
         rr = viscous(j, 1) + weight*c(j, 1)
         zz = viscous(j, 2) + weight*c(j, 2)
         hoop = viscous(j, 3) + weight*c(j, 3)
         rz = viscous(j, 4) + weight*c(j, 4)
         determinant = end_norm**3*hoop*(rr*zz - rz**2)
         distance = distance + (1 - determinant)**2
         scale = end_norm*get_root_near_1(determinant)
         viscous(j, 1) = scale*rr
         viscous(j, 2) = scale*zz
         viscous(j, 3) = scale*hoop
         viscous(j, 4) = scale*rz
      end do
      if (.not. distance <= near_1**2) call normalize(viscous)
   end subroutine add_branch_stress

   !> x**(-1/3) of a number within `near_1` of 1, by a series.
   pure function get_root_near_1(x) result(root)
      real(wp), intent(in) :: x
      real(wp) :: root

      associate (y => 1 - x)
         root = 1 + y*(1/3.0_wp + y*(2/9.0_wp + y*(14/81.0_wp + y*(35/243.0_wp))))
      end associate
   end function get_root_near_1

   !> Scales tensors to determinant 1.
   pure subroutine normalize(tensor)
      !> The tensors: [n_lane, symmetric].
      real(wp), intent(inout) :: tensor(n_lane, n_symmetric)
      real(wp) :: root(n_lane)
      integer :: k

      call get_inverse_cube_root(n_lane, get_determinants(tensor), root)
      do k = 1, n_symmetric
         tensor(:, k) = root*tensor(:, k)
      end do
   end subroutine normalize

   !> Determinants of symmetric tensors.
   pure function get_determinants(tensor) result(determinant)
      !> The tensors: [n_lane, symmetric].
      real(wp), intent(in) :: tensor(n_lane, n_symmetric)
      !> Their determinants: [n_lane].
      real(wp) :: determinant(n_lane)

      determinant = tensor(:, 3)*(tensor(:, 1)*tensor(:, 2) - tensor(:, 4)**2)
   end function get_determinants

end module thud_maxwell_branches
