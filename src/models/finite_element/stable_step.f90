!> The stability limit of the central differences, in closed form.
!>
!> With velocities half a step behind, the step dt is stable while dt**2 k + 2 dt c <= 4 for the largest eigenvalues k and c
!> of stiffness and viscosity over mass. The volume of an element with the edge vectors a and b through its middle resists
!> with at most 4 (M/rho) (a**2 + b**2)/(a x b)**2, the greatest of compression waves along both (Flanagan and Belytschko
!> 1981, Int. J. Numer. Methods Eng. 17, 679-706), for the modulus M of such waves; the largest over the elements bounds the
!> body. The springs of the floor under a node add to it (Weyl).
module thud_stable_step
   use thud_floor_contact, only: floor_contact_type, get_contact_stiffness
   use thud_kinds, only: wp
   use thud_material, only: material_type
   use thud_nodal_areas, only: get_nodal_areas
   implicit none (type, external)
   private

   public :: get_stable_interval

contains

   !> Lower bound of the longest stable step, s.
   pure function get_stable_interval(r, z, material, contact) result(interval)
      !> Positions of the nodes, m: [0:n_polar, 0:n_radial].
      real(wp), intent(in) :: r(0:, 0:), z(0:, 0:)
      type(material_type), intent(in) :: material
      type(floor_contact_type), intent(in) :: contact
      real(wp) :: interval
      real(wp) :: shape, modulus, springs
      integer :: last

      last = ubound(r, 2)
      shape = 4*get_largest_shape(r, z)/material%density
      springs = maxval(2*get_contact_stiffness(contact, r(:, last))/(material%density*get_nodal_areas(r(:, last), &
         z(:, last))*hypot(r(:, last) - r(:, last - 1), z(:, last) - z(:, last - 1))))
      modulus = material%bulk_modulus + 4*material%shear_modulus/3
      associate (branches => material%branch_modulus, viscous => 4*material%viscosity/3*shape)
         interval = limit(modulus + 4*sum(branches)/3, viscous)
         ! In the fastest motion, strains and the viscous tensors of fast branches change sign in each step.
         interval = limit(modulus + 4*sum(branches*(1 + tanh(interval/(2*material%branch_time))))/3, viscous)
      end associate

   contains

      !> The step at which dt**2 k + 2 dt c = 4.
      pure function limit(modulus, viscous) result(step)
         !> Modulus of compression waves, Pa; eigenvalue of viscosity, 1/s.
         real(wp), intent(in) :: modulus, viscous
         real(wp) :: step

         step = 4/(viscous + sqrt(viscous**2 + 4*(modulus*shape + springs)))
      end function limit

   end function get_stable_interval

   !> Largest sum of the squared reciprocal edge vectors of an element, 1/m2.
   pure function get_largest_shape(r, z) result(largest)
      !> Positions of the nodes, m: [0:n_polar, 0:n_radial].
      real(wp), intent(in) :: r(0:, 0:), z(0:, 0:)
      real(wp) :: largest
      real(wp) :: along(2), through(2)
      integer :: i, j

      largest = 0.0_wp
      do i = 1, ubound(r, 2)
         do j = 1, ubound(r, 1)
            associate (now => [r(j, i), z(j, i)], before => [r(j - 1, i), z(j - 1, i)], below => [r(j, i - 1), &
               z(j, i - 1)], diagonal => [r(j - 1, i - 1), z(j - 1, i - 1)])
               along = (now - before + below - diagonal)/2
               through = (now - below + before - diagonal)/2
            end associate
            largest = max(largest, (sum(along**2) + sum(through**2))/(along(1)*through(2) - along(2)*through(1))**2)
         end do
      end do
   end function get_largest_shape

end module thud_stable_step
