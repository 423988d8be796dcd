!> Elastic and viscous stresses of nearly incompressible rubber at large strain, for the elements of one ring together.
!>
!> Elastic: W = mu/2 [(1 - c)(J^(-2/3) I1 - 3) + c (J^(-4/3) I2 - 3)] + K/2 (theta - 1)**2 with the second-invariant fraction
!> c (Mooney-Rivlin) and the mean dilatation theta of the element. Viscous: Cauchy stress 2 eta dev D (Kelvin-Voigt).
!>
!> Components as in `thud_element_row`.
module thud_rubber
   use thud_element_row, only: n_component, n_point, n_symmetric
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: add_viscous_stress, get_elastic_stress, get_inverse_cube_root, get_volume_ratios

   !> Half-width of the range around 1 in which one iteration gives all digits of the cube root.
   real(wp), parameter :: near = 0.2_wp
   !> Middle and half-width of the range in which two iterations do.
   real(wp), parameter :: middle = 1.45_wp, far = 1.05_wp

contains

   !> Cofactors of the deformation gradient, J F^-T, and its determinant J.
   pure subroutine get_volume_ratios(n, f, cofactor, jacobian)
      !> Number of elements.
      integer, intent(in) :: n
      !> Deformation gradients: [n, component, point].
      real(wp), intent(in) :: f(n, n_component, n_point)
      !> Cofactors: [n, component, point].
      real(wp), intent(out) :: cofactor(n, n_component, n_point)
      !> Determinants: [n, point].
      real(wp), intent(out) :: jacobian(n, n_point)
      integer :: g, j

      do g = 1, n_point
         !$omp simd
         do j = 1, n
            cofactor(j, 1, g) = f(j, 4, g)*f(j, 5, g)
            cofactor(j, 2, g) = -f(j, 3, g)*f(j, 5, g)
            cofactor(j, 3, g) = -f(j, 2, g)*f(j, 5, g)
            cofactor(j, 4, g) = f(j, 1, g)*f(j, 5, g)
            cofactor(j, 5, g) = f(j, 1, g)*f(j, 4, g) - f(j, 2, g)*f(j, 3, g)
            jacobian(j, g) = cofactor(j, 5, g)*f(j, 5, g)
         end do
      end do
   end subroutine get_volume_ratios

   !> x**(-1/3) of positive numbers.
   pure subroutine get_inverse_cube_root(n, x, root)
      !> Number of values.
      integer, intent(in) :: n
      !> The numbers: [n].
      real(wp), intent(in) :: x(n)
      !> Their roots: [n].
      real(wp), intent(out) :: root(n)
      real(wp) :: residual, n_not_near, n_not_far
      integer :: j, iteration

      ! Counted by sums: gfortran does not vectorize minimum and maximum.
      n_not_near = 0.0_wp
      n_not_far = 0.0_wp
      !$omp simd reduction(+:n_not_near, n_not_far)
      do j = 1, n
         n_not_near = n_not_near + merge(0.0_wp, 1.0_wp, abs(x(j) - 1) <= near)
         n_not_far = n_not_far + merge(0.0_wp, 1.0_wp, abs(x(j) - middle) <= far)
      end do
      ! Minimax polynomials with errors of 3e-5 and 4 %; each iteration raises the error to its fourth power.
      if (.not. n_not_near > 0.0_wp) then
         !$omp simd private(residual)
         do j = 1, n
            root(j) = 1.74098956_wp + x(j)*(-1.32838497_wp + x(j)*(0.76697019_wp - x(j)*0.17960475_wp))
            residual = 1 - x(j)*root(j)**3
            root(j) = root(j)*(1 + residual*(1/3.0_wp + residual*(2/9.0_wp + residual*(14/81.0_wp))))
         end do
      else if (.not. n_not_far > 0.0_wp) then
         !$omp simd private(residual)
         do j = 1, n
            root(j) = 1.53872574_wp + x(j)*(-0.64308593_wp + x(j)*0.13116605_wp)
            do iteration = 1, 2
               residual = 1 - x(j)*root(j)**3
               root(j) = root(j)*(1 + residual*(1/3.0_wp + residual*(2/9.0_wp + residual*(14/81.0_wp))))
            end do
         end do
      else
         root = x**(-1.0_wp/3.0_wp)
      end if
   end subroutine get_inverse_cube_root

   !> First Piola-Kirchhoff stresses of the elastic solid.
   pure subroutine get_elastic_stress(n, shear_modulus, mooney_share, bulk_modulus, weight, volume, f, cofactor, jacobian, &
      stress, energy)
      !> Number of elements.
      integer, intent(in) :: n
      !> Shear modulus, Pa; its second-invariant fraction; bulk modulus, Pa.
      real(wp), intent(in) :: shear_modulus, mooney_share, bulk_modulus
      !> Volumes of the points, undeformed, m3: [n, point].
      real(wp), intent(in) :: weight(n, n_point)
      !> Volumes of the elements, undeformed, m3: [n].
      real(wp), intent(in) :: volume(n)
      !> Deformation gradients: [n, component, point].
      real(wp), intent(in) :: f(n, n_component, n_point)
      !> Their cofactors: [n, component, point].
      real(wp), intent(in) :: cofactor(n, n_component, n_point)
      !> Their determinants: [n, point].
      real(wp), intent(in) :: jacobian(n, n_point)
      !> Stresses, Pa: [n, component, point].
      real(wp), intent(out) :: stress(n, n_component, n_point)
      !> Sum to which the strain energy is added, J.
      real(wp), intent(inout) :: energy
      real(wp) :: modulus, invariant, factor, total
      real(wp) :: mean_stress(n), root(n)
      integer :: c, g, j

      ! Holds the mean dilatations of the elements until it is multiplied by the bulk modulus.
      mean_stress = -volume
      do g = 1, n_point
         mean_stress = mean_stress + weight(:, g)*jacobian(:, g)
      end do
      mean_stress = mean_stress/volume
      total = bulk_modulus/2*sum(volume*mean_stress**2)
      mean_stress = bulk_modulus*mean_stress
      modulus = shear_modulus*(1 - mooney_share)
      do g = 1, n_point
         call get_inverse_cube_root(n, jacobian(:, g), root)
         !$omp simd private(invariant, factor) reduction(+:total)
         do j = 1, n
            invariant = root(j)**2*(f(j, 1, g)**2 + f(j, 2, g)**2 + f(j, 3, g)**2 + f(j, 4, g)**2 + f(j, 5, g)**2)
            factor = mean_stress(j) - modulus*invariant/(3*jacobian(j, g))
            do c = 1, n_component
               stress(j, c, g) = modulus*root(j)**2*f(j, c, g) + factor*cofactor(j, c, g)
            end do
            total = total + weight(j, g)*modulus/2*(invariant - 3)
         end do
         if (mooney_share > 0.0_wp) call add_second_invariant(n, shear_modulus*mooney_share, weight(:, g), f(:, :, g), &
            cofactor(:, :, g), jacobian(:, g), root, stress(:, :, g), total)
      end do
      energy = energy + total
   end subroutine get_elastic_stress

   !> Adds the stresses of the second invariant, modulus/2 (J^(-4/3) I2 - 3), at one Gauss point.
   pure subroutine add_second_invariant(n, modulus, weight, f, cofactor, jacobian, root, stress, energy)
      integer, intent(in) :: n
      !> Second-invariant part of the shear modulus, Pa.
      real(wp), intent(in) :: modulus
      !> Volumes of the points, undeformed, m3: [n].
      real(wp), intent(in) :: weight(n)
      !> Deformation gradients: [n, component].
      real(wp), intent(in) :: f(n, n_component)
      !> Their cofactors: [n, component].
      real(wp), intent(in) :: cofactor(n, n_component)
      !> Their determinants: [n].
      real(wp), intent(in) :: jacobian(n)
      !> Determinants to the power -1/3: [n].
      real(wp), intent(in) :: root(n)
      !> Stresses, Pa: [n, component].
      real(wp), intent(inout) :: stress(n, n_component)
      !> Sum to which the energy is added, J.
      real(wp), intent(inout) :: energy
      real(wp) :: first, second, scale, volumetric
      real(wp) :: c(n_symmetric)
      integer :: j

      !$omp simd private(c, first, second, scale, volumetric) reduction(+:energy)
      do j = 1, n
         c = [f(j, 1)**2 + f(j, 3)**2, f(j, 2)**2 + f(j, 4)**2, f(j, 5)**2, f(j, 1)*f(j, 2) + f(j, 3)*f(j, 4)]
         first = c(1) + c(2) + c(3)
         second = (c(1) + c(2))*c(3) + c(1)*c(2) - c(4)**2
         scale = modulus*root(j)**4
         volumetric = -2*scale*second/(3*jacobian(j))
         stress(j, 1) = stress(j, 1) + scale*((first - c(1))*f(j, 1) - c(4)*f(j, 2)) + volumetric*cofactor(j, 1)
         stress(j, 2) = stress(j, 2) + scale*((first - c(2))*f(j, 2) - c(4)*f(j, 1)) + volumetric*cofactor(j, 2)
         stress(j, 3) = stress(j, 3) + scale*((first - c(1))*f(j, 3) - c(4)*f(j, 4)) + volumetric*cofactor(j, 3)
         stress(j, 4) = stress(j, 4) + scale*((first - c(2))*f(j, 4) - c(4)*f(j, 3)) + volumetric*cofactor(j, 4)
         stress(j, 5) = stress(j, 5) + scale*(first - c(3))*f(j, 5) + volumetric*cofactor(j, 5)
         energy = energy + weight(j)*(scale*second - 3*modulus)/2
      end do
   end subroutine add_second_invariant

   !> Adds the stresses of Kelvin-Voigt viscosity.
   pure subroutine add_viscous_stress(n, viscosity, weight, rate, cofactor, jacobian, stress, power)
      !> Number of elements.
      integer, intent(in) :: n
      !> Viscosity, Pa s.
      real(wp), intent(in) :: viscosity
      !> Volumes of the points, undeformed, m3: [n, point].
      real(wp), intent(in) :: weight(n, n_point)
      !> Rates of the deformation gradients, 1/s: [n, component, point].
      real(wp), intent(in) :: rate(n, n_component, n_point)
      !> Cofactors of the deformation gradients: [n, component, point].
      real(wp), intent(in) :: cofactor(n, n_component, n_point)
      !> Their determinants: [n, point].
      real(wp), intent(in) :: jacobian(n, n_point)
      !> Stresses, Pa: [n, component, point].
      real(wp), intent(inout) :: stress(n, n_component, n_point)
      !> Sum to which the dissipated power is added, W.
      real(wp), intent(inout) :: power
      real(wp) :: rr, zz, hoop, rz, mean, scale, total
      integer :: g, j

      total = 0.0_wp
      do g = 1, n_point
         !$omp simd private(rr, zz, hoop, rz, mean, scale) reduction(+:total)
         do j = 1, n
            scale = 2*viscosity/jacobian(j, g)
            rr = rate(j, 1, g)*cofactor(j, 1, g) + rate(j, 2, g)*cofactor(j, 2, g)
            zz = rate(j, 3, g)*cofactor(j, 3, g) + rate(j, 4, g)*cofactor(j, 4, g)
            hoop = rate(j, 5, g)*cofactor(j, 5, g)
            rz = scale/2*(rate(j, 1, g)*cofactor(j, 3, g) + rate(j, 2, g)*cofactor(j, 4, g) &
               + rate(j, 3, g)*cofactor(j, 1, g) + rate(j, 4, g)*cofactor(j, 2, g))
            mean = (rr + zz + hoop)/3
            rr = scale*(rr - mean)
            zz = scale*(zz - mean)
            hoop = scale*(hoop - mean)
            stress(j, 1, g) = stress(j, 1, g) + rr*cofactor(j, 1, g) + rz*cofactor(j, 3, g)
            stress(j, 2, g) = stress(j, 2, g) + rr*cofactor(j, 2, g) + rz*cofactor(j, 4, g)
            stress(j, 3, g) = stress(j, 3, g) + rz*cofactor(j, 1, g) + zz*cofactor(j, 3, g)
            stress(j, 4, g) = stress(j, 4, g) + rz*cofactor(j, 2, g) + zz*cofactor(j, 4, g)
            stress(j, 5, g) = stress(j, 5, g) + hoop*cofactor(j, 5, g)
            total = total + weight(j, g)*jacobian(j, g)*(rr**2 + zz**2 + hoop**2 + 2*rz**2)
         end do
      end do
      power = power + total/(2*viscosity)
   end subroutine add_viscous_stress

end module thud_rubber
