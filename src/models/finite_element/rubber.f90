!> Stresses of nearly incompressible rubber at large strain, for a block of elements.
!>
!> Elastic: W = mu/2 [(1 - c)(tr C - 3) + c (tr C^-1 - 3)] + K/2 (theta - 1)**2 with the isochoric right Cauchy-Green tensor
!> C = J^(-2/3) F^T F, the second-invariant fraction c (Mooney-Rivlin) and the mean dilatation theta of the element. Viscous:
!> Cauchy stress 2 eta dev D (Kelvin-Voigt).
!>
!> A Maxwell branch has the energy mu_i/2 (tr(C Cv^-1) - 3) and the viscous flow Cv' = (C - tr(C Cv^-1)/3 Cv)/tau_i (Simo and
!> Miehe 1992). Steps are in closed form after Shutov, Landgraf and Ihlemann (2013, Comput. Methods Appl. Mech. Eng. 265,
!> 213-225), with exp(step/tau) - 1 in place of their step/tau, which is exact at small strain. Cv stays symmetric, positive
!> definite and of determinant 1 with any step. The viscous tensors are known at the midpoints between the instants of the
!> displacements, as velocities are: the step is of second order. A branch that relaxes within a step acts as a viscosity.
!>
!> Components as in `thud_element_block`. Arithmetic limits the speed; all arrays of a block stay in the first-level cache.
module thud_rubber
   use thud_element_block, only: element_block_type, n_component, n_element, n_lane, n_point, n_symmetric
   use thud_kinds, only: wp
   use thud_material, only: material_type
   implicit none (type, external)
   private

   public :: add_branch_stress, add_viscous_stress, branch_step_type, get_inverse_cube_root, new_branch_step
   public :: set_elastic_stress, set_nominal_stress, set_strain, strain_type, stress_type

   !> Multiplication takes a fraction of the time of a division.
   real(wp), parameter :: third = 1/3.0_wp
   !> Middle and half-width of the range in which two iterations give all digits of the cube root.
   real(wp), parameter :: middle = 1.45_wp, half_width = 1.05_wp
   !> Distance from 1 within which the series of the cube root has all digits.
   real(wp), parameter :: near_1 = 1.0e-3_wp

   !> Length of a step divided by the relaxation time beyond which a branch has lost its memory.
   real(wp), parameter :: max_step_ratio = 100.0_wp

   !> Strains at the points of a block.
   type :: strain_type
      !> Deformation gradients F, and their rates, 1/s: [n_lane, component].
      real(wp) :: f(n_lane, n_component), rate(n_lane, n_component)
      !> Determinants J of F, and J**(-1/3): [n_lane].
      real(wp) :: jacobian(n_lane), root(n_lane)
      !> Isochoric right Cauchy-Green tensors C, and their inverses: [n_lane, symmetric].
      real(wp) :: c(n_lane, n_symmetric), inverse(n_lane, n_symmetric)
   end type strain_type

   !> Stresses at the points of a block.
   type :: stress_type
      !> Isochoric stresses 2 dW/dC, Pa: [n_lane, symmetric].
      real(wp) :: isochoric(n_lane, n_symmetric)
      !> Derivatives of the energy with respect to the mean dilatation, Pa: [n_lane].
      real(wp) :: mean(n_lane)
      !> First Piola-Kirchhoff stresses times undeformed volumes, N m: [n_lane, component].
      real(wp) :: nominal(n_lane, n_component)
      !> Energies, J/m3, and dissipated powers, W/m3, per undeformed volume: [n_lane].
      real(wp) :: density(n_lane), power(n_lane)
   end type stress_type

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

   !> Sets the strains of the deformation gradients.
   pure subroutine set_strain(strain)
      !> The gradients are set.
      type(strain_type), intent(inout) :: strain
      real(wp) :: scale, rr, zz, hoop, rz
      integer :: j

      associate (f => strain%f, jacobian => strain%jacobian, root => strain%root, c => strain%c, inverse => strain%inverse)
         !$omp simd
         do j = 1, n_lane
            jacobian(j) = (f(j, 1)*f(j, 4) - f(j, 2)*f(j, 3))*f(j, 5)
         end do
         call get_inverse_cube_root(n_lane, jacobian, root)
         !$omp simd private(scale, rr, zz, hoop, rz)
         do j = 1, n_lane
            scale = root(j)**2
            rr = scale*(f(j, 1)**2 + f(j, 3)**2)
            zz = scale*(f(j, 2)**2 + f(j, 4)**2)
            hoop = scale*f(j, 5)**2
            rz = scale*(f(j, 1)*f(j, 2) + f(j, 3)*f(j, 4))
            c(j, 1) = rr
            c(j, 2) = zz
            c(j, 3) = hoop
            c(j, 4) = rz
            ! The determinant is 1.
            inverse(j, 1) = zz*hoop
            inverse(j, 2) = rr*hoop
            inverse(j, 3) = rr*zz - rz**2
            inverse(j, 4) = -rz*hoop
         end do
      end associate
   end subroutine set_strain

   !> x**(-1/3) of positive numbers.
   pure subroutine get_inverse_cube_root(n, x, root)
      !> Number of values.
      integer, intent(in) :: n
      !> The numbers: [n].
      real(wp), intent(in) :: x(n)
      !> Their roots: [n].
      real(wp), intent(out) :: root(n)
      real(wp) :: residual, n_outside
      integer :: j, iteration

      ! A minimax polynomial with an error of 4 %; each iteration raises the error to its fourth power. The numbers outside
      ! its range are counted by a sum, since gfortran does not vectorize minimum and maximum.
      n_outside = 0.0_wp
      !$omp simd private(residual) reduction(+:n_outside)
      do j = 1, n
         root(j) = 1.53872574_wp + x(j)*(-0.64308593_wp + x(j)*0.13116605_wp)
         do iteration = 1, 2
            residual = 1 - x(j)*root(j)**3
            root(j) = root(j)*(1 + residual*(1/3.0_wp + residual*(2/9.0_wp + residual*(14/81.0_wp))))
         end do
         n_outside = n_outside + merge(0.0_wp, 1.0_wp, abs(x(j) - middle) <= half_width)
      end do
      if (n_outside > 0.0_wp) root = x**(-1.0_wp/3.0_wp)
   end subroutine get_inverse_cube_root

   !> Sets the isochoric and mean stresses and the energies of the elastic solid, without dissipation.
   pure subroutine set_elastic_stress(block, material, strain, stress)
      type(element_block_type), intent(in) :: block
      !> Its moduli are used.
      type(material_type), intent(in) :: material
      type(strain_type), intent(in) :: strain
      type(stress_type), intent(out) :: stress
      real(wp) :: dilatation, first, second
      integer :: g, j

      associate (n => n_element, weight => block%weight, jacobian => strain%jacobian)
         !$omp simd private(dilatation)
         do j = 1, n
            dilatation = block%inverse_volume(j)*(weight(j)*(jacobian(j) - 1) + weight(j + n)*(jacobian(j + n) - 1) &
               + weight(j + 2*n)*(jacobian(j + 2*n) - 1) + weight(j + 3*n)*(jacobian(j + 3*n) - 1))
            stress%mean(j) = material%bulk_modulus*dilatation
            stress%density(j) = material%bulk_modulus/2*dilatation**2
         end do
         do g = 1, n_point - 1
            stress%mean(g*n + 1:g*n + n) = stress%mean(:n)
            stress%density(g*n + 1:g*n + n) = stress%density(:n)
         end do
      end associate
      first = material%shear_modulus*(1 - material%mooney_share)
      second = material%shear_modulus*material%mooney_share
      associate (c => strain%c, inverse => strain%inverse)
         !$omp simd
         do j = 1, n_lane
            stress%isochoric(j, 1) = first + second*(c(j, 2) + c(j, 3))
            stress%isochoric(j, 2) = first + second*(c(j, 1) + c(j, 3))
            stress%isochoric(j, 3) = first + second*(c(j, 1) + c(j, 2))
            stress%isochoric(j, 4) = -second*c(j, 4)
            stress%density(j) = stress%density(j) + first/2*(c(j, 1) + c(j, 2) + c(j, 3) - 3) &
               + second/2*(inverse(j, 1) + inverse(j, 2) + inverse(j, 3) - 3)
            stress%power(j) = 0.0_wp
         end do
      end associate
   end subroutine set_elastic_stress

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
   pure subroutine add_branch_stress(step, strain, viscous, stress)
      type(branch_step_type), intent(in) :: step
      type(strain_type), intent(in) :: strain
      !> Viscous tensors Cv, advanced from half a step before to half a step after: [n_lane, symmetric].
      real(wp), intent(inout) :: viscous(n_lane, n_symmetric)
      type(stress_type), intent(inout) :: stress
      real(wp), dimension(n_lane, n_symmetric) :: adjugate
      real(wp), dimension(n_lane) :: root, trace_of_inverse
      real(wp) :: distance, norm, end_norm, rr, zz, hoop, rz, determinant, scale, factor, trace, weight
      integer :: j

      associate (c => strain%c, inverse => strain%inverse)
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
            stress%isochoric(j, 1) = stress%isochoric(j, 1) + factor*adjugate(j, 1)
            stress%isochoric(j, 2) = stress%isochoric(j, 2) + factor*adjugate(j, 2)
            stress%isochoric(j, 3) = stress%isochoric(j, 3) + factor*adjugate(j, 3)
            stress%isochoric(j, 4) = stress%isochoric(j, 4) - factor*adjugate(j, 4)
            trace = scale**2*(c(j, 1)*adjugate(j, 1) + c(j, 2)*adjugate(j, 2) + c(j, 3)*adjugate(j, 3) &
               - 2*c(j, 4)*adjugate(j, 4))
            stress%density(j) = stress%density(j) + step%stiffness*(trace - 3)
            ! The square of the deviator of C Cv^-1, by its first and second invariants.
            stress%power(j) = stress%power(j) + step%power_factor*(third*trace**2 - scale*trace_of_inverse(j))
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
      end associate
      if (distance <= near_1**2) return
      call get_inverse_cube_root(n_lane, get_determinants(viscous), root)
      do j = 1, n_symmetric
         viscous(:, j) = root*viscous(:, j)
      end do
   end subroutine add_branch_stress

   !> x**(-1/3) of a number within `near_1` of 1, by a series.
   pure function get_root_near_1(x) result(root)
      real(wp), intent(in) :: x
      real(wp) :: root

      associate (y => 1 - x)
         root = 1 + y*(1/3.0_wp + y*(2/9.0_wp + y*(14/81.0_wp + y*(35/243.0_wp))))
      end associate
   end function get_root_near_1

   !> Determinants of symmetric tensors.
   pure function get_determinants(tensor) result(determinant)
      !> The tensors: [n_lane, symmetric].
      real(wp), intent(in) :: tensor(n_lane, n_symmetric)
      !> Their determinants: [n_lane].
      real(wp) :: determinant(n_lane)

      determinant = tensor(:, 3)*(tensor(:, 1)*tensor(:, 2) - tensor(:, 4)**2)
   end function get_determinants

   !> Sets the nominal stresses by the isochoric and the mean stresses.
   pure subroutine set_nominal_stress(weight, strain, stress)
      !> Volumes of the points, undeformed, m3: [n_lane].
      real(wp), intent(in) :: weight(n_lane)
      type(strain_type), intent(in) :: strain
      type(stress_type), intent(inout) :: stress
      real(wp) :: scale, pressure, s1, s2, s3, s4
      integer :: j

      associate (f => strain%f, root => strain%root, c => strain%c)
         !$omp simd private(scale, pressure, s1, s2, s3, s4)
         do j = 1, n_lane
            s1 = stress%isochoric(j, 1)
            s2 = stress%isochoric(j, 2)
            s3 = stress%isochoric(j, 3)
            s4 = stress%isochoric(j, 4)
            scale = weight(j)*root(j)**2
            pressure = weight(j)*(stress%mean(j) - third*root(j)**3*(c(j, 1)*s1 + c(j, 2)*s2 + c(j, 3)*s3 + 2*c(j, 4)*s4))
            ! The mean stress acts on the cofactors of F.
            stress%nominal(j, 1) = scale*(f(j, 1)*s1 + f(j, 2)*s4) + pressure*f(j, 4)*f(j, 5)
            stress%nominal(j, 2) = scale*(f(j, 1)*s4 + f(j, 2)*s2) - pressure*f(j, 3)*f(j, 5)
            stress%nominal(j, 3) = scale*(f(j, 3)*s1 + f(j, 4)*s4) - pressure*f(j, 2)*f(j, 5)
            stress%nominal(j, 4) = scale*(f(j, 3)*s4 + f(j, 4)*s2) + pressure*f(j, 1)*f(j, 5)
            stress%nominal(j, 5) = scale*f(j, 5)*s3 + pressure*(f(j, 1)*f(j, 4) - f(j, 2)*f(j, 3))
         end do
      end associate
   end subroutine set_nominal_stress

   !> Adds the nominal stresses of Kelvin-Voigt viscosity.
   pure subroutine add_viscous_stress(viscosity, weight, strain, stress)
      !> Viscosity, Pa s.
      real(wp), intent(in) :: viscosity
      !> Volumes of the points, undeformed, m3: [n_lane].
      real(wp), intent(in) :: weight(n_lane)
      !> Gradients, rates and roots are used.
      type(strain_type), intent(in) :: strain
      type(stress_type), intent(inout) :: stress
      real(wp) :: k1, k2, k3, k4, k5, rr, zz, hoop, rz, mean, scale
      integer :: j

      associate (f => strain%f, rate => strain%rate, root => strain%root)
         !$omp simd private(k1, k2, k3, k4, k5, rr, zz, hoop, rz, mean, scale)
         do j = 1, n_lane
            ! Cofactors of F; the products are J times the rate of strain.
            k1 = f(j, 4)*f(j, 5)
            k2 = -f(j, 3)*f(j, 5)
            k3 = -f(j, 2)*f(j, 5)
            k4 = f(j, 1)*f(j, 5)
            k5 = f(j, 1)*f(j, 4) - f(j, 2)*f(j, 3)
            rr = rate(j, 1)*k1 + rate(j, 2)*k2
            zz = rate(j, 3)*k3 + rate(j, 4)*k4
            hoop = rate(j, 5)*k5
            rz = (rate(j, 1)*k3 + rate(j, 2)*k4 + rate(j, 3)*k1 + rate(j, 4)*k2)/2
            mean = third*(rr + zz + hoop)
            rr = rr - mean
            zz = zz - mean
            hoop = hoop - mean
            scale = 2*viscosity*root(j)**3
            stress%power(j) = stress%power(j) + scale*(rr**2 + zz**2 + hoop**2 + 2*rz**2)
            scale = weight(j)*scale
            stress%nominal(j, 1) = stress%nominal(j, 1) + scale*(rr*k1 + rz*k3)
            stress%nominal(j, 2) = stress%nominal(j, 2) + scale*(rr*k2 + rz*k4)
            stress%nominal(j, 3) = stress%nominal(j, 3) + scale*(rz*k1 + zz*k3)
            stress%nominal(j, 4) = stress%nominal(j, 4) + scale*(rz*k2 + zz*k4)
            stress%nominal(j, 5) = stress%nominal(j, 5) + scale*hoop*k5
         end do
      end associate
   end subroutine add_viscous_stress

end module thud_rubber
