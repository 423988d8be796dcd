!> Stresses of nearly incompressible rubber at large strain, for the elements of one ring together.
!>
!> Elastic: W = mu/2 [(1 - c)(J^(-2/3) I1 - 3) + c (J^(-4/3) I2 - 3)] + K/2 (theta - 1)**2 with the
!> share c of Mooney and Rivlin and the mean dilatation theta of the element.
!> Viscous: Cauchy stress 2 eta dev D (Kelvin and Voigt), and Maxwell branches with the energy
!> mu_i/2 (tr(Cbar Cv^-1) - 3) and the flow Cv' = (Cbar - tr(Cbar Cv^-1)/3 Cv)/tau_i (Simo and Miehe
!> 1992), stepped in closed form after Shutov, Landgraf and Ihlemann (2013, Comput. Methods Appl. Mech.
!> Eng. 265, 213-225), with exp(step/tau) - 1 for their step/tau, which is exact at small strain: Cv stays
!> symmetric, positive definite and of determinant 1 with any step.
!>
!> Components as in `thud_element_row`.
module thud_rubber
   use thud_element_row, only: n_component, n_point, n_symmetric
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: add_branch_stress, add_viscous_stress, get_elastic_stress, get_inverse_cube_root, get_volume_ratios

   !> Ranges, from 1 and from their middle, in which one iteration and two give all digits of the cube root.
   real(wp), parameter :: near = 0.2_wp, middle = 1.45_wp, far = 1.05_wp

   !> Steps over the relaxation time beyond which a branch has lost its memory.
   real(wp), parameter :: max_steps_over_time = 100.0_wp

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
      !> How many.
      integer, intent(in) :: n
      !> The numbers: [n].
      real(wp), intent(in) :: x(n)
      !> Their roots: [n].
      real(wp), intent(out) :: root(n)
      real(wp) :: rest, n_not_near, n_not_far
      integer :: j, iteration

      ! As sums: gfortran does not vectorise minimum and maximum.
      n_not_near = 0.0_wp
      n_not_far = 0.0_wp
      !$omp simd reduction(+:n_not_near, n_not_far)
      do j = 1, n
         n_not_near = n_not_near + merge(0.0_wp, 1.0_wp, abs(x(j) - 1) <= near)
         n_not_far = n_not_far + merge(0.0_wp, 1.0_wp, abs(x(j) - middle) <= far)
      end do
      ! Polynomials of least error, 3e-5 and 4 %; each iteration raises it to its fourth power.
      if (.not. n_not_near > 0.0_wp) then
         !$omp simd private(rest)
         do j = 1, n
            root(j) = 1.74098956_wp + x(j)*(-1.32838497_wp + x(j)*(0.76697019_wp - x(j)*0.17960475_wp))
            rest = 1 - x(j)*root(j)**3
            root(j) = root(j)*(1 + rest*(1/3.0_wp + rest*(2/9.0_wp + rest*(14/81.0_wp))))
         end do
      else if (.not. n_not_far > 0.0_wp) then
         !$omp simd private(rest)
         do j = 1, n
            root(j) = 1.53872574_wp + x(j)*(-0.64308593_wp + x(j)*0.13116605_wp)
            do iteration = 1, 2
               rest = 1 - x(j)*root(j)**3
               root(j) = root(j)*(1 + rest*(1/3.0_wp + rest*(2/9.0_wp + rest*(14/81.0_wp))))
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
      !> Shear modulus, Pa; part of it with the second invariant; bulk modulus, Pa.
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
      !> Gets the strain energy added, J.
      real(wp), intent(inout) :: energy
      real(wp) :: modulus, invariant, factor, total
      real(wp) :: pressure(n), root(n)
      integer :: c, g, j

      pressure = -volume
      do g = 1, n_point
         pressure = pressure + weight(:, g)*jacobian(:, g)
      end do
      pressure = pressure/volume
      total = bulk_modulus/2*sum(volume*pressure**2)
      pressure = bulk_modulus*pressure
      modulus = shear_modulus*(1 - mooney_share)
      do g = 1, n_point
         call get_inverse_cube_root(n, jacobian(:, g), root)
         !$omp simd private(invariant, factor) reduction(+:total)
         do j = 1, n
            invariant = root(j)**2*(f(j, 1, g)**2 + f(j, 2, g)**2 + f(j, 3, g)**2 + f(j, 4, g)**2 + f(j, 5, g)**2)
            factor = pressure(j) - modulus*invariant/(3*jacobian(j, g))
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
      !> Number of elements.
      integer, intent(in) :: n
      !> Its part of the shear modulus, Pa.
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
      !> Gets the energy added, J.
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

   !> Adds the stresses of Kelvin's and Voigt's viscosity.
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
      !> Gets the power dissipated added, W.
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

   !> Adds the mean stresses of the Maxwell branches over a step, and takes their flow to its end.
   !>
   !> The flow is known at the middles between the instants of the displacements, as velocities are:
   !> the step is of second order. A branch that relaxes within a step is a viscosity.
   pure subroutine add_branch_stress(n, modulus, time, interval, keep, weight, f, cofactor, jacobian, flow, stress, energy, &
      power)
      !> Number of elements.
      integer, intent(in) :: n
      !> Shear moduli of the branches, Pa; relaxation times, s: [n_branch].
      real(wp), intent(in) :: modulus(:), time(:)
      !> Length of the step, s.
      real(wp), intent(in) :: interval
      !> The flow is taken to the end of the step; otherwise it stays, and the stresses are those that the
      !> fastest motion meets, which turns round in each step, and the flow with it.
      logical, intent(in) :: keep
      !> Volumes of the points, undeformed, m3: [n, point].
      real(wp), intent(in) :: weight(n, n_point)
      !> Deformation gradients: [n, component, point].
      real(wp), intent(in) :: f(n, n_component, n_point)
      !> Their cofactors: [n, component, point].
      real(wp), intent(in) :: cofactor(n, n_component, n_point)
      !> Their determinants: [n, point].
      real(wp), intent(in) :: jacobian(n, n_point)
      !> Flow Cv from half a step before to half a step after: [n, symmetric, point, branch].
      real(wp), intent(inout) :: flow(n, n_symmetric, n_point, size(time))
      !> Stresses, Pa: [n, component, point].
      real(wp), intent(inout) :: stress(n, n_component, n_point)
      !> Gets the energy of the branches added, J; gets the power dissipated added, W.
      real(wp), intent(inout) :: energy, power
      real(wp) :: shrink(n)
      real(wp), dimension(n, n_symmetric) :: c, pull
      real(wp), dimension(size(time)) :: ratio, part, effective
      real(wp) :: stored
      integer :: b, g

      ratio = interval/time
      part = get_part_to_mean(ratio)
      effective = modulus
      if (.not. keep) effective = modulus*(1 + tanh(ratio/2))
      do g = 1, n_point
         call get_isochoric(n, f(:, :, g), jacobian(:, g), shrink, c)
         pull = 0.0_wp
         do b = 1, size(time)
            stored = 0.0_wp
            call take_branch_step(n, effective(b), time(b), ratio(b), part(b), keep, weight(:, g), c, flow(:, :, g, b), &
               pull, stored, power)
            ! Of the mean stress: so work, energy and loss of a linear branch add up over the steps.
            energy = energy + stored*(1 + part(b))*(1 + exp(-ratio(b)))/2
         end do
         call add_pull(n, shrink, c, pull, f(:, :, g), cofactor(:, :, g), jacobian(:, g), stress(:, :, g))
      end do
   end subroutine add_branch_stress

   !> Growth exp(t/time) - 1 at the instant t of a step at which a decaying stress equals its mean over
   !> the step: x/(1 - exp(-x)) - 1.
   pure elemental function get_part_to_mean(ratio) result(part)
      !> Length of the step over the relaxation time, x.
      real(wp), intent(in) :: ratio
      real(wp) :: part

      if (ratio < 1.0e-3_wp) then
         ! Series, where the difference would lose digits; off by x**4/720.
         part = ratio/2 + ratio**2/12
      else
         part = ratio/(1 - exp(-ratio)) - 1
      end if
   end function get_part_to_mean

   !> Isochoric right Cauchy-Green tensors at one Gauss point.
   pure subroutine get_isochoric(n, f, jacobian, shrink, c)
      !> Number of elements.
      integer, intent(in) :: n
      !> Deformation gradients: [n, component].
      real(wp), intent(in) :: f(n, n_component)
      !> Their determinants: [n].
      real(wp), intent(in) :: jacobian(n)
      !> Determinants to the power -2/3: [n].
      real(wp), intent(out) :: shrink(n)
      !> The tensors: [n, symmetric].
      real(wp), intent(out) :: c(n, n_symmetric)
      real(wp) :: root(n)
      integer :: j

      call get_inverse_cube_root(n, jacobian, root)
      shrink = root**2
      !$omp simd
      do j = 1, n
         c(j, 1) = shrink(j)*(f(j, 1)**2 + f(j, 3)**2)
         c(j, 2) = shrink(j)*(f(j, 2)**2 + f(j, 4)**2)
         c(j, 3) = shrink(j)*f(j, 5)**2
         c(j, 4) = shrink(j)*(f(j, 1)*f(j, 2) + f(j, 3)*f(j, 4))
      end do
   end subroutine get_isochoric

   !> Adds the pull of one Maxwell branch at one Gauss point, its energy and its loss, and takes its flow to the end of
   !> the step.
   pure subroutine take_branch_step(n, modulus, time, ratio, part, keep, weight, c, flow, pull, energy, power)
      !> Number of elements.
      integer, intent(in) :: n
      !> Shear modulus, Pa; relaxation time, s; length of the step over it.
      real(wp), intent(in) :: modulus, time, ratio
      !> Weight of the deformation beside the flow, for the flow within the step.
      real(wp), intent(in) :: part
      !> The flow is taken to the end of the step; otherwise it stays.
      logical, intent(in) :: keep
      !> Volumes of the points, undeformed, m3: [n].
      real(wp), intent(in) :: weight(n)
      !> Isochoric right Cauchy-Green tensors: [n, symmetric].
      real(wp), intent(in) :: c(n, n_symmetric)
      !> Flow Cv: [n, symmetric].
      real(wp), intent(inout) :: flow(n, n_symmetric)
      !> Gets the modulus times the inverse of the flow within the step added, Pa: [n, symmetric].
      real(wp), intent(inout) :: pull(n, n_symmetric)
      !> Gets the energy added, J; gets the power dissipated added, W.
      real(wp), intent(inout) :: energy, power
      real(wp) :: determinant(n), root(n), share(n), trace(n), tensor(n, n_symmetric)
      real(wp) :: scale, square, i1, i2, i3, i4
      integer :: j

      share = part
      call mix(n, part, share, c, flow, tensor, determinant)
      call get_inverse_cube_root(n, determinant, root)
      !$omp simd private(scale, square, i1, i2, i3, i4) reduction(+:energy, power)
      do j = 1, n
         ! The inverse: adjugate over determinant, with the norm of the tensor removed.
         scale = root(j)**2
         i1 = scale*tensor(j, 2)*tensor(j, 3)
         i2 = scale*tensor(j, 1)*tensor(j, 3)
         i3 = scale*(tensor(j, 1)*tensor(j, 2) - tensor(j, 4)**2)
         i4 = -scale*tensor(j, 4)*tensor(j, 3)
         trace(j) = c(j, 1)*i1 + c(j, 2)*i2 + c(j, 3)*i3 + 2*c(j, 4)*i4
         square = (c(j, 1)*i1 + c(j, 4)*i4)**2 + (c(j, 2)*i2 + c(j, 4)*i4)**2 + (c(j, 3)*i3)**2 &
            + 2*(c(j, 1)*i4 + c(j, 4)*i2)*(c(j, 4)*i1 + c(j, 2)*i4)
         pull(j, 1) = pull(j, 1) + modulus*i1
         pull(j, 2) = pull(j, 2) + modulus*i2
         pull(j, 3) = pull(j, 3) + modulus*i3
         pull(j, 4) = pull(j, 4) + modulus*i4
         energy = energy + weight(j)*modulus/2*(trace(j) - 3)
         power = power + weight(j)*modulus/(2*time)*(square - trace(j)**2/3)
      end do
      if (keep) call let_flow(n, min(ratio, max_steps_over_time), c, trace, flow)
   end subroutine take_branch_step

   !> Takes the flow of one Maxwell branch at one Gauss point to the end of a step.
   pure subroutine let_flow(n, ratio, c, trace, flow)
      !> Number of elements.
      integer, intent(in) :: n
      !> Length of the step over the relaxation time.
      real(wp), intent(in) :: ratio
      !> Isochoric right Cauchy-Green tensors: [n, symmetric].
      real(wp), intent(in) :: c(n, n_symmetric)
      !> Traces of their products with the inverse of the flow Cv within the step: [n].
      real(wp), intent(in) :: trace(n)
      !> Flow Cv: [n, symmetric].
      real(wp), intent(inout) :: flow(n, n_symmetric)
      real(wp) :: determinant(n), root(n), share(n), mixed(n, n_symmetric)
      real(wp) :: growth
      integer :: j

      growth = exp(ratio) - 1
      ! At large strain the rate of the norm, tr(Cbar Cv^-1)/3 - 1, counts too, in the second order of the step.
      share = growth + (trace/3 - 1)*ratio**2/2
      call mix(n, growth, share, c, flow, mixed, determinant)
      call get_inverse_cube_root(n, determinant, root)
      do j = 1, n_symmetric
         flow(:, j) = mixed(:, j)*root
      end do
   end subroutine let_flow

   !> Mixtures of flow and deformation at one Gauss point, and their determinants, which are near 1.
   pure subroutine mix(n, usual_share, share, c, flow, tensor, determinant)
      !> Number of elements.
      integer, intent(in) :: n
      !> Weight of the deformation beside the flow by which the norm is taken off.
      real(wp), intent(in) :: usual_share
      !> Weights of the deformation: [n].
      real(wp), intent(in) :: share(n)
      !> Isochoric right Cauchy-Green tensors: [n, symmetric].
      real(wp), intent(in) :: c(n, n_symmetric)
      !> Flow Cv: [n, symmetric].
      real(wp), intent(in) :: flow(n, n_symmetric)
      !> The mixtures: [n, symmetric].
      real(wp), intent(out) :: tensor(n, n_symmetric)
      !> Their determinants: [n].
      real(wp), intent(out) :: determinant(n)
      real(wp) :: scale
      integer :: i, j

      scale = 1/(1 + usual_share)
      !$omp simd
      do j = 1, n
         do i = 1, n_symmetric
            tensor(j, i) = scale*(flow(j, i) + share(j)*c(j, i))
         end do
         determinant(j) = (tensor(j, 1)*tensor(j, 2) - tensor(j, 4)**2)*tensor(j, 3)
      end do
   end subroutine mix

   !> Adds the stresses of all branches at one Gauss point.
   pure subroutine add_pull(n, shrink, c, pull, f, cofactor, jacobian, stress)
      !> Number of elements.
      integer, intent(in) :: n
      !> Determinants to the power -2/3: [n].
      real(wp), intent(in) :: shrink(n)
      !> Isochoric right Cauchy-Green tensors: [n, symmetric].
      real(wp), intent(in) :: c(n, n_symmetric)
      !> Sum of moduli times inverses of the flow, Pa: [n, symmetric].
      real(wp), intent(in) :: pull(n, n_symmetric)
      !> Deformation gradients: [n, component].
      real(wp), intent(in) :: f(n, n_component)
      !> Their cofactors: [n, component].
      real(wp), intent(in) :: cofactor(n, n_component)
      !> Their determinants: [n].
      real(wp), intent(in) :: jacobian(n)
      !> Stresses, Pa: [n, component].
      real(wp), intent(inout) :: stress(n, n_component)
      real(wp) :: factor
      integer :: j

      !$omp simd private(factor)
      do j = 1, n
         associate (p1 => pull(j, 1), p2 => pull(j, 2), p3 => pull(j, 3), p4 => pull(j, 4), scale => shrink(j))
            factor = -(c(j, 1)*p1 + c(j, 2)*p2 + c(j, 3)*p3 + 2*c(j, 4)*p4)/(3*jacobian(j))
            stress(j, 1) = stress(j, 1) + scale*(f(j, 1)*p1 + f(j, 2)*p4) + factor*cofactor(j, 1)
            stress(j, 2) = stress(j, 2) + scale*(f(j, 1)*p4 + f(j, 2)*p2) + factor*cofactor(j, 2)
            stress(j, 3) = stress(j, 3) + scale*(f(j, 3)*p1 + f(j, 4)*p4) + factor*cofactor(j, 3)
            stress(j, 4) = stress(j, 4) + scale*(f(j, 3)*p4 + f(j, 4)*p2) + factor*cofactor(j, 4)
            stress(j, 5) = stress(j, 5) + scale*f(j, 5)*p3 + factor*cofactor(j, 5)
         end associate
      end do
   end subroutine add_pull

end module thud_rubber
