!> Elastic and viscous stresses of nearly incompressible rubber at large strain, for a block of elements.
!>
!> Elastic: W = mu/2 [(1 - c)(tr C - 3) + c (tr C^-1 - 3)] + K/2 (theta - 1)**2 with the isochoric right Cauchy-Green tensor
!> C = J^(-2/3) F^T F, the second-invariant fraction c (Mooney-Rivlin) and the mean dilatation theta of the element. Viscous:
!> Cauchy stress 2 eta dev D (Kelvin-Voigt).
!>
!> Components as in `thud_element_block`. Arithmetic limits the speed; all arrays of a block stay in the first-level cache.
module thud_rubber
   use thud_element_block, only: element_block_type, n_component, n_element, n_lane, n_point, n_symmetric
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: add_viscous_stress, get_elastic_stress, get_inverse_cube_root, get_isochoric, get_jacobians, &
      get_mean_stress, get_nominal_stress

   !> Multiplication takes a fraction of the time of a division.
   real(wp), parameter :: third = 1/3.0_wp
   !> Half-width of the range around 1 in which one iteration gives all digits of the cube root.
   real(wp), parameter :: near = 0.2_wp
   !> Middle and half-width of the range in which two iterations do.
   real(wp), parameter :: middle = 1.45_wp, far = 1.05_wp

contains

   !> Determinants of the deformation gradients.
   pure subroutine get_jacobians(f, jacobian)
      !> Deformation gradients: [n_lane, component].
      real(wp), intent(in) :: f(n_lane, n_component)
      !> Determinants: [n_lane].
      real(wp), intent(out) :: jacobian(n_lane)
      integer :: j

      !$omp simd
      do j = 1, n_lane
         jacobian(j) = (f(j, 1)*f(j, 4) - f(j, 2)*f(j, 3))*f(j, 5)
      end do
   end subroutine get_jacobians

   !> Mean stresses of the elements of a block, and the density of the energy of volume change.
   pure subroutine get_mean_stress(block, bulk_modulus, jacobian, mean_stress, density)
      type(element_block_type), intent(in) :: block
      !> Bulk modulus, Pa.
      real(wp), intent(in) :: bulk_modulus
      !> Determinants of the deformation gradients: [n_lane].
      real(wp), intent(in) :: jacobian(n_lane)
      !> Derivatives of the energy with respect to the mean dilatation, Pa: [n_lane].
      real(wp), intent(out) :: mean_stress(n_lane)
      !> Energies per undeformed volume, J/m3: [n_lane].
      real(wp), intent(out) :: density(n_lane)
      real(wp) :: dilatation
      integer :: g, j

      associate (n => n_element, weight => block%weight)
         !$omp simd private(dilatation)
         do j = 1, n
            dilatation = block%inverse_volume(j)*(weight(j)*(jacobian(j) - 1) + weight(j + n)*(jacobian(j + n) - 1) &
               + weight(j + 2*n)*(jacobian(j + 2*n) - 1) + weight(j + 3*n)*(jacobian(j + 3*n) - 1))
            mean_stress(j) = bulk_modulus*dilatation
            density(j) = bulk_modulus/2*dilatation**2
         end do
         do g = 1, n_point - 1
            mean_stress(g*n + 1:g*n + n) = mean_stress(:n)
            density(g*n + 1:g*n + n) = density(:n)
         end do
      end associate
   end subroutine get_mean_stress

   !> Isochoric right Cauchy-Green tensors.
   pure subroutine get_isochoric(f, jacobian, root, c, inverse)
      !> Deformation gradients: [n_lane, component].
      real(wp), intent(in) :: f(n_lane, n_component)
      !> Their determinants: [n_lane].
      real(wp), intent(in) :: jacobian(n_lane)
      !> Determinants to the power -1/3: [n_lane].
      real(wp), intent(out) :: root(n_lane)
      !> The tensors, and their inverses: [n_lane, symmetric].
      real(wp), intent(out) :: c(n_lane, n_symmetric), inverse(n_lane, n_symmetric)
      real(wp) :: scale, rr, zz, hoop, rz
      integer :: j

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
   end subroutine get_isochoric

   !> x**(-1/3) of positive numbers.
   pure subroutine get_inverse_cube_root(n, x, root)
      !> Number of values.
      integer, intent(in) :: n
      !> The numbers: [n].
      real(wp), intent(in) :: x(n)
      !> Their roots: [n].
      real(wp), intent(out) :: root(n)
      real(wp) :: residual
      integer :: j, iteration

      ! Minimax polynomials with errors of 3e-5 and 4 %; each iteration raises the error to its fourth power.
      if (is_within(n, x, 1.0_wp, near)) then
         !$omp simd private(residual)
         do j = 1, n
            root(j) = 1.74098956_wp + x(j)*(-1.32838497_wp + x(j)*(0.76697019_wp - x(j)*0.17960475_wp))
            residual = 1 - x(j)*root(j)**3
            root(j) = root(j)*(1 + residual*(1/3.0_wp + residual*(2/9.0_wp + residual*(14/81.0_wp))))
         end do
      else if (is_within(n, x, middle, far)) then
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

   !> Whether all numbers lie within a range.
   pure function is_within(n, x, center, half_width) result(yes)
      integer, intent(in) :: n
      !> The numbers: [n].
      real(wp), intent(in) :: x(n)
      real(wp), intent(in) :: center, half_width
      logical :: yes
      real(wp) :: n_outside
      integer :: j

      ! A sum, since gfortran does not vectorize minimum and maximum.
      n_outside = 0.0_wp
      !$omp simd reduction(+:n_outside)
      do j = 1, n
         n_outside = n_outside + merge(0.0_wp, 1.0_wp, abs(x(j) - center) <= half_width)
      end do
      yes = .not. n_outside > 0.0_wp
   end function is_within

   !> Isochoric stresses 2 dW/dC of the elastic solid; adds the density of its energy.
   pure subroutine get_elastic_stress(shear_modulus, mooney_share, c, inverse, isochoric, density)
      !> Shear modulus, Pa; its second-invariant fraction.
      real(wp), intent(in) :: shear_modulus, mooney_share
      !> Isochoric right Cauchy-Green tensors, and their inverses: [n_lane, symmetric].
      real(wp), intent(in) :: c(n_lane, n_symmetric), inverse(n_lane, n_symmetric)
      !> Stresses, Pa: [n_lane, symmetric].
      real(wp), intent(out) :: isochoric(n_lane, n_symmetric)
      !> Energies per undeformed volume, J/m3: [n_lane].
      real(wp), intent(inout) :: density(n_lane)
      real(wp) :: first, second
      integer :: j

      first = shear_modulus*(1 - mooney_share)
      second = shear_modulus*mooney_share
      !$omp simd
      do j = 1, n_lane
         isochoric(j, 1) = first + second*(c(j, 2) + c(j, 3))
         isochoric(j, 2) = first + second*(c(j, 1) + c(j, 3))
         isochoric(j, 3) = first + second*(c(j, 1) + c(j, 2))
         isochoric(j, 4) = -second*c(j, 4)
         density(j) = density(j) + first/2*(c(j, 1) + c(j, 2) + c(j, 3) - 3) &
            + second/2*(inverse(j, 1) + inverse(j, 2) + inverse(j, 3) - 3)
      end do
   end subroutine get_elastic_stress

   !> First Piola-Kirchhoff stresses from isochoric stresses and a mean stress,.
   pure subroutine get_nominal_stress(weight, f, root, c, isochoric, mean_stress, stress)
      !> Volumes of the points, undeformed, m3: [n_lane].
      real(wp), intent(in) :: weight(n_lane)
      !> Deformation gradients: [n_lane, component].
      real(wp), intent(in) :: f(n_lane, n_component)
      !> Their determinants to the power -1/3: [n_lane].
      real(wp), intent(in) :: root(n_lane)
      !> Isochoric right Cauchy-Green tensors: [n_lane, symmetric].
      real(wp), intent(in) :: c(n_lane, n_symmetric)
      !> Isochoric stresses, Pa: [n_lane, symmetric].
      real(wp), intent(in) :: isochoric(n_lane, n_symmetric)
      !> Derivatives of the energy of volume change, Pa: [n_lane].
      real(wp), intent(in) :: mean_stress(n_lane)
      !> Stresses times volumes, N m: [n_lane, component].
      real(wp), intent(out) :: stress(n_lane, n_component)
      real(wp) :: scale, pressure
      integer :: j

      !$omp simd private(scale, pressure)
      do j = 1, n_lane
         associate (s1 => isochoric(j, 1), s2 => isochoric(j, 2), s3 => isochoric(j, 3), s4 => isochoric(j, 4))
            scale = weight(j)*root(j)**2
            pressure = weight(j)*(mean_stress(j) - third*root(j)**3*(c(j, 1)*s1 + c(j, 2)*s2 + c(j, 3)*s3 + 2*c(j, 4)*s4))
            ! The mean stress acts on the cofactors of F.
            stress(j, 1) = scale*(f(j, 1)*s1 + f(j, 2)*s4) + pressure*f(j, 4)*f(j, 5)
            stress(j, 2) = scale*(f(j, 1)*s4 + f(j, 2)*s2) - pressure*f(j, 3)*f(j, 5)
            stress(j, 3) = scale*(f(j, 3)*s1 + f(j, 4)*s4) - pressure*f(j, 2)*f(j, 5)
            stress(j, 4) = scale*(f(j, 3)*s4 + f(j, 4)*s2) + pressure*f(j, 1)*f(j, 5)
            stress(j, 5) = scale*f(j, 5)*s3 + pressure*(f(j, 1)*f(j, 4) - f(j, 2)*f(j, 3))
         end associate
      end do
   end subroutine get_nominal_stress

   !> Adds the first Piola-Kirchhoff stresses of Kelvin-Voigt viscosity.
   pure subroutine add_viscous_stress(viscosity, weight, f, rate, root, stress, power)
      !> Viscosity, Pa s.
      real(wp), intent(in) :: viscosity
      !> Volumes of the points, undeformed, m3: [n_lane].
      real(wp), intent(in) :: weight(n_lane)
      !> Deformation gradients: [n_lane, component].
      real(wp), intent(in) :: f(n_lane, n_component)
      !> Their rates, 1/s: [n_lane, component].
      real(wp), intent(in) :: rate(n_lane, n_component)
      !> Determinants of the deformation gradients to the power -1/3: [n_lane].
      real(wp), intent(in) :: root(n_lane)
      !> Stresses times volumes, N m: [n_lane, component].
      real(wp), intent(inout) :: stress(n_lane, n_component)
      !> Powers dissipated per undeformed volume, W/m3: [n_lane].
      real(wp), intent(inout) :: power(n_lane)
      real(wp) :: k1, k2, k3, k4, k5, rr, zz, hoop, rz, mean, scale
      integer :: j

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
         power(j) = power(j) + scale*(rr**2 + zz**2 + hoop**2 + 2*rz**2)
         scale = weight(j)*scale
         stress(j, 1) = stress(j, 1) + scale*(rr*k1 + rz*k3)
         stress(j, 2) = stress(j, 2) + scale*(rr*k2 + rz*k4)
         stress(j, 3) = stress(j, 3) + scale*(rz*k1 + zz*k3)
         stress(j, 4) = stress(j, 4) + scale*(rz*k2 + zz*k4)
         stress(j, 5) = stress(j, 5) + scale*hoop*k5
      end do
   end subroutine add_viscous_stress

end module thud_rubber
