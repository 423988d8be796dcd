!> Stresses of the Maxwell branches of rubber at large strain, for the elements of one ring together.
!>
!> A branch has the energy mu_i/2 (tr(Cbar Cv^-1) - 3) and the viscous flow Cv' = (Cbar - tr(Cbar Cv^-1)/3 Cv)/tau_i (Simo
!> and Miehe 1992). Steps are in closed form after Shutov, Landgraf and Ihlemann (2013, Comput. Methods Appl. Mech. Eng. 265,
!> 213-225), with exp(step/tau) - 1 in place of their step/tau, which is exact at small strain. Cv stays symmetric, positive
!> definite and of determinant 1 with any step.
!>
!> Components as in `thud_element_row`.
module thud_maxwell_branches
   use thud_element_row, only: n_component, n_point, n_symmetric
   use thud_kinds, only: wp
   use thud_rubber, only: get_inverse_cube_root
   implicit none (type, external)
   private

   public :: add_branch_stress

   !> Length of a step divided by the relaxation time beyond which a branch has lost its memory.
   real(wp), parameter :: max_step_ratio = 100.0_wp

contains

   !> Adds the mean stresses of the Maxwell branches over a step, and updates their viscous tensors.
   !>
   !> The viscous tensors are known at the midpoints between the instants of the displacements, as velocities are: the step
   !> is of second order. A branch that relaxes within a step acts as a viscosity.
   pure subroutine add_branch_stress(n, modulus, time, interval, commit, weight, f, cofactor, jacobian, viscous, stress, &
      energy, power)
      !> Number of elements.
      integer, intent(in) :: n
      !> Shear moduli of the branches, Pa; relaxation times, s: [n_branch].
      real(wp), intent(in) :: modulus(:), time(:)
      !> Length of the step, s.
      real(wp), intent(in) :: interval
      !> Whether the viscous tensors advance to the end of the step. Otherwise they stay unchanged, and the
      !> moduli are raised to those of the fastest mode, in which strains and viscous tensors change sign in each step.
      logical, intent(in) :: commit
      !> Volumes of the points, undeformed, m3: [n, point].
      real(wp), intent(in) :: weight(n, n_point)
      !> Deformation gradients: [n, component, point].
      real(wp), intent(in) :: f(n, n_component, n_point)
      !> Their cofactors: [n, component, point].
      real(wp), intent(in) :: cofactor(n, n_component, n_point)
      !> Their determinants: [n, point].
      real(wp), intent(in) :: jacobian(n, n_point)
      !> Viscous tensors Cv, advanced from half a step before to half a step after: [n, symmetric, point, branch].
      real(wp), intent(inout) :: viscous(n, n_symmetric, n_point, size(time))
      !> Stresses, Pa: [n, component, point].
      real(wp), intent(inout) :: stress(n, n_component, n_point)
      !> Sums to which energy, J, and dissipated power, W, of the branches are added.
      real(wp), intent(inout) :: energy, power
      real(wp) :: isochoric_factor(n)
      real(wp), dimension(n, n_symmetric) :: c, branch_stress
      real(wp), dimension(size(time)) :: ratio, mean_weight, effective
      real(wp) :: stored
      integer :: b, g

      ratio = interval/time
      mean_weight = get_mean_weight(ratio)
      effective = modulus
      if (.not. commit) effective = modulus*(1 + tanh(ratio/2))
      do g = 1, n_point
         call get_isochoric(n, f(:, :, g), jacobian(:, g), isochoric_factor, c)
         branch_stress = 0.0_wp
         do b = 1, size(time)
            stored = 0.0_wp
            call take_branch_step(n, effective(b), time(b), ratio(b), mean_weight(b), commit, weight(:, g), c, &
               viscous(:, :, g, b), branch_stress, stored, power)
            ! Scaled so that work, energy and loss of a linear branch balance over the steps.
            energy = energy + stored*(1 + mean_weight(b))*(1 + exp(-ratio(b)))/2
         end do
         call add_stress_at_point(n, isochoric_factor, c, branch_stress, f(:, :, g), cofactor(:, :, g), jacobian(:, g), &
            stress(:, :, g))
      end do
   end subroutine add_branch_stress

   !> Weight of the deformation for the mean stress of a step, x/(1 - exp(-x)) - 1: the value of exp(t/time) - 1 at the
   !> instant t at which a decaying stress equals its mean over the step.
   pure elemental function get_mean_weight(ratio) result(mean_weight)
      !> Length of the step divided by the relaxation time, x.
      real(wp), intent(in) :: ratio
      real(wp) :: mean_weight

      if (ratio < 1.0e-3_wp) then
         ! A series, since the difference would lose digits; off by x**4/720.
         mean_weight = ratio/2 + ratio**2/12
      else
         mean_weight = ratio/(1 - exp(-ratio)) - 1
      end if
   end function get_mean_weight

   !> Isochoric right Cauchy-Green tensors at one Gauss point.
   pure subroutine get_isochoric(n, f, jacobian, isochoric_factor, c)
      integer, intent(in) :: n
      !> Deformation gradients: [n, component].
      real(wp), intent(in) :: f(n, n_component)
      !> Their determinants: [n].
      real(wp), intent(in) :: jacobian(n)
      !> Determinants to the power -2/3: [n].
      real(wp), intent(out) :: isochoric_factor(n)
      !> The tensors: [n, symmetric].
      real(wp), intent(out) :: c(n, n_symmetric)
      real(wp) :: root(n)
      integer :: j

      call get_inverse_cube_root(n, jacobian, root)
      isochoric_factor = root**2
      !$omp simd
      do j = 1, n
         c(j, 1) = isochoric_factor(j)*(f(j, 1)**2 + f(j, 3)**2)
         c(j, 2) = isochoric_factor(j)*(f(j, 2)**2 + f(j, 4)**2)
         c(j, 3) = isochoric_factor(j)*f(j, 5)**2
         c(j, 4) = isochoric_factor(j)*(f(j, 1)*f(j, 2) + f(j, 3)*f(j, 4))
      end do
   end subroutine get_isochoric

   !> Adds stress, energy and loss of one Maxwell branch at one Gauss point, and updates its viscous tensor.
   pure subroutine take_branch_step(n, modulus, time, ratio, mean_weight, commit, weight, c, viscous, branch_stress, &
      energy, power)
      integer, intent(in) :: n
      !> Shear modulus, Pa; relaxation time, s; step divided by relaxation time.
      real(wp), intent(in) :: modulus, time, ratio
      !> Weight of the deformation, relative to the viscous tensor, for the mean stress of the step.
      real(wp), intent(in) :: mean_weight
      !> Whether the viscous tensors advance to the end of the step.
      logical, intent(in) :: commit
      !> Volumes of the points, undeformed, m3: [n].
      real(wp), intent(in) :: weight(n)
      !> Isochoric right Cauchy-Green tensors: [n, symmetric].
      real(wp), intent(in) :: c(n, n_symmetric)
      !> Viscous tensors Cv: [n, symmetric].
      real(wp), intent(inout) :: viscous(n, n_symmetric)
      !> Sum to which modulus times inverse of the viscous tensor within the step is added, Pa: [n, symmetric].
      real(wp), intent(inout) :: branch_stress(n, n_symmetric)
      !> Sums to which energy, J, and dissipated power, W, are added.
      real(wp), intent(inout) :: energy, power
      real(wp) :: determinant(n), root(n), strain_weight(n), trace(n), tensor(n, n_symmetric)
      real(wp) :: scale, square, i1, i2, i3, i4
      integer :: j

      strain_weight = mean_weight
      call mix(n, mean_weight, strain_weight, c, viscous, tensor, determinant)
      call get_inverse_cube_root(n, determinant, root)
      !$omp simd private(scale, square, i1, i2, i3, i4) reduction(+:energy, power)
      do j = 1, n
         ! Inverse of the tensor scaled to determinant 1, which is the scaled adjugate.
         scale = root(j)**2
         i1 = scale*tensor(j, 2)*tensor(j, 3)
         i2 = scale*tensor(j, 1)*tensor(j, 3)
         i3 = scale*(tensor(j, 1)*tensor(j, 2) - tensor(j, 4)**2)
         i4 = -scale*tensor(j, 4)*tensor(j, 3)
         trace(j) = c(j, 1)*i1 + c(j, 2)*i2 + c(j, 3)*i3 + 2*c(j, 4)*i4
         square = (c(j, 1)*i1 + c(j, 4)*i4)**2 + (c(j, 2)*i2 + c(j, 4)*i4)**2 + (c(j, 3)*i3)**2 &
            + 2*(c(j, 1)*i4 + c(j, 4)*i2)*(c(j, 4)*i1 + c(j, 2)*i4)
         branch_stress(j, 1) = branch_stress(j, 1) + modulus*i1
         branch_stress(j, 2) = branch_stress(j, 2) + modulus*i2
         branch_stress(j, 3) = branch_stress(j, 3) + modulus*i3
         branch_stress(j, 4) = branch_stress(j, 4) + modulus*i4
         energy = energy + weight(j)*modulus/2*(trace(j) - 3)
         power = power + weight(j)*modulus/(2*time)*(square - trace(j)**2/3)
      end do
      if (commit) call update_internal_variables(n, min(ratio, max_step_ratio), c, trace, viscous)
   end subroutine take_branch_step

   !> Advances the viscous tensors of one Maxwell branch at one Gauss point to the end of a step.
   pure subroutine update_internal_variables(n, ratio, c, trace, viscous)
      integer, intent(in) :: n
      !> Length of the step divided by the relaxation time.
      real(wp), intent(in) :: ratio
      real(wp), intent(in) :: c(n, n_symmetric)
      !> Traces of the products of c with the inverses of the viscous tensors within the step: [n].
      real(wp), intent(in) :: trace(n)
      real(wp), intent(inout) :: viscous(n, n_symmetric)
      real(wp) :: determinant(n), root(n), strain_weight(n), mixed(n, n_symmetric)
      real(wp) :: end_weight
      integer :: j

      end_weight = exp(ratio) - 1
      ! The weight grows at the rate tr(Cbar Cv^-1)/3, 1 at small strain: a correction of second order in the step.
      strain_weight = end_weight + (trace/3 - 1)*ratio**2/2
      call mix(n, end_weight, strain_weight, c, viscous, mixed, determinant)
      call get_inverse_cube_root(n, determinant, root)
      do j = 1, n_symmetric
         viscous(:, j) = mixed(:, j)*root
      end do
   end subroutine update_internal_variables

   !> Mixtures of viscous tensor and deformation at one Gauss point, and their determinants, which are near 1.
   pure subroutine mix(n, normalizing_weight, strain_weight, c, viscous, tensor, determinant)
      integer, intent(in) :: n
      !> Weight of the deformation, relative to the viscous tensor, that normalizes the mixture.
      real(wp), intent(in) :: normalizing_weight
      !> Weights of the deformation: [n].
      real(wp), intent(in) :: strain_weight(n)
      real(wp), intent(in) :: c(n, n_symmetric)
      !> Viscous tensors Cv: [n, symmetric].
      real(wp), intent(in) :: viscous(n, n_symmetric)
      !> The mixtures: [n, symmetric].
      real(wp), intent(out) :: tensor(n, n_symmetric)
      !> Their determinants: [n].
      real(wp), intent(out) :: determinant(n)
      real(wp) :: scale
      integer :: i, j

      scale = 1/(1 + normalizing_weight)
      !$omp simd
      do j = 1, n
         do i = 1, n_symmetric
            tensor(j, i) = scale*(viscous(j, i) + strain_weight(j)*c(j, i))
         end do
         determinant(j) = (tensor(j, 1)*tensor(j, 2) - tensor(j, 4)**2)*tensor(j, 3)
      end do
   end subroutine mix

   !> Adds the stresses of all branches at one Gauss point.
   pure subroutine add_stress_at_point(n, isochoric_factor, c, branch_stress, f, cofactor, jacobian, stress)
      integer, intent(in) :: n
      !> Determinants to the power -2/3: [n].
      real(wp), intent(in) :: isochoric_factor(n)
      real(wp), intent(in) :: c(n, n_symmetric)
      !> Sum of moduli times inverses of the viscous tensors, Pa: [n, symmetric].
      real(wp), intent(in) :: branch_stress(n, n_symmetric)
      real(wp), intent(in) :: f(n, n_component)
      !> Their cofactors: [n, component].
      real(wp), intent(in) :: cofactor(n, n_component)
      real(wp), intent(in) :: jacobian(n)
      !> Stresses, Pa: [n, component].
      real(wp), intent(inout) :: stress(n, n_component)
      real(wp) :: factor
      integer :: j

      !$omp simd private(factor)
      do j = 1, n
         associate (p1 => branch_stress(j, 1), p2 => branch_stress(j, 2), p3 => branch_stress(j, 3), p4 => &
            branch_stress(j, 4), scale => isochoric_factor(j))
            factor = -(c(j, 1)*p1 + c(j, 2)*p2 + c(j, 3)*p3 + 2*c(j, 4)*p4)/(3*jacobian(j))
            stress(j, 1) = stress(j, 1) + scale*(f(j, 1)*p1 + f(j, 2)*p4) + factor*cofactor(j, 1)
            stress(j, 2) = stress(j, 2) + scale*(f(j, 1)*p4 + f(j, 2)*p2) + factor*cofactor(j, 2)
            stress(j, 3) = stress(j, 3) + scale*(f(j, 3)*p1 + f(j, 4)*p4) + factor*cofactor(j, 3)
            stress(j, 4) = stress(j, 4) + scale*(f(j, 3)*p4 + f(j, 4)*p2) + factor*cofactor(j, 4)
            stress(j, 5) = stress(j, 5) + scale*f(j, 5)*p3 + factor*cofactor(j, 5)
         end associate
      end do
   end subroutine add_stress_at_point

end module thud_maxwell_branches
