!> Quasi-static compression of the ball, with the finite elements of the impact, between two rigid plates without friction:
!> one at height 0, and one that comes down on the ball.
!>
!> Newton's method finds the nodes in contact on the way (a primal-dual active set): nodes beyond a plate are put on it,
!> nodes that it would have to pull are released. The tangent comes from differences of the forces, in 18 evaluations for any
!> mesh, since nodes three apart share no element.
module thud_pressed_ball
   use thud_ball, only: ball_type
   use thud_elastic_body, only: add_gas_forces, body_state_type, cavity_type, elastic_body_type, get_gas_pressure, &
      get_internal_forces, get_volume, new_elastic_body, no_failure
   use thud_error, only: error_type, numerical_error
   use thud_interrupt, only: check_interrupt
   use thud_kinds, only: wp
   use thud_lapack, only: dgbsv
   use thud_material, only: material_type
   use thud_mesh, only: mesh_type
   use thud_text, only: significant
   implicit none (type, external)
   private

   public :: new_pressed_ball, press, pressed_ball_type

   !> Maximum number of iterations for one approach of the plates, and of halvings of a step that does not converge.
   integer, parameter :: max_iterations = 25, max_halvings = 8

   !> Force on a node that counts as zero, divided by shear modulus times squared wall thickness.
   real(wp), parameter :: balanced = 1.0e-9_wp

   !> Displacement for the differences, as a fraction of the thickness of an element.
   real(wp), parameter :: trial = 1.0e-7_wp

   !> Maximum approach in a step, as a fraction of the wall thickness.
   real(wp), parameter :: max_step = 0.05_wp

   !> The ball; arrays over nodes are [0:n_polar, 0:n_radial, 2].
   type :: pressed_ball_type
      type(elastic_body_type) :: body
      !> Positions relative to the lower plate, m.
      real(wp), allocatable :: position(:, :, :)
      !> Nodes of the outer surface that lie on the lower and on the upper plate: [0:n_polar, 2].
      logical, allocatable :: touches(:, :)
      !> Approach of the plates, m.
      real(wp) :: deflection = 0.0_wp
      !> Force on the plates, N.
      real(wp) :: force = 0.0_wp
      !> Diameter of the undeformed ball, and thickness of an element, m.
      real(wp) :: diameter = 0.0_wp, element_thickness = 0.0_wp
      !> Force on a node that counts as zero, N.
      real(wp) :: tolerance = 0.0_wp
   end type pressed_ball_type

contains

   !> The ball at rest between plates that just touch it. The material has its long-term modulus.
   pure function new_pressed_ball(ball, mesh, material) result(pressed)
      type(ball_type), intent(in) :: ball
      !> Mesh, graded for contacts at both poles.
      type(mesh_type), intent(in) :: mesh
      type(material_type), intent(in) :: material
      type(pressed_ball_type) :: pressed
      type(material_type) :: relaxed
      integer :: n

      n = mesh%n_polar
      relaxed = material
      relaxed%viscosity = 0.0_wp
      relaxed%branch_modulus = material%branch_modulus(:0)
      relaxed%branch_time = material%branch_time(:0)
      pressed%body = new_elastic_body(ball, mesh, relaxed)
      pressed%diameter = 2*ball%outer_radius
      pressed%tolerance = balanced*material%shear_modulus*ball%wall_thickness**2
      pressed%element_thickness = ball%wall_thickness/mesh%n_radial
      allocate (pressed%position(0:n, 0:mesh%n_radial, 2))
      pressed%position(:, :, 1) = pressed%body%mesh%r
      pressed%position(:, :, 2) = pressed%body%mesh%z + ball%outer_radius
      allocate (pressed%touches(0:n, 2), source=.false.)
      pressed%touches(0, 1) = .true.
      pressed%touches(n, 2) = .true.
   end function new_pressed_ball

   !> Moves the plates to an approach.
   subroutine press(pressed, deflection, error)
      type(pressed_ball_type), intent(inout) :: pressed
      !> The approach, at least the present one, m.
      real(wp), intent(in) :: deflection
      !> Set if there is no state of rest, or if none was found.
      type(error_type), allocatable, intent(out) :: error
      type(pressed_ball_type) :: next
      real(wp) :: step
      integer :: halvings
      logical :: converged

      halvings = 0
      do while (pressed%deflection < deflection)
         step = min(deflection - pressed%deflection, &
            max_step*pressed%element_thickness*pressed%body%mesh%n_radial/2**halvings)
         next = pressed
         next%deflection = merge(deflection, pressed%deflection + step, step >= deflection - pressed%deflection)
         call find_rest(next, converged, error)
         if (allocated(error)) return
         if (converged) then
            pressed = next
            halvings = max(0, halvings - 1)
         else
            halvings = halvings + 1
         end if
         ! A node of the lower half of the cavity has reached mid-height.
         if (any(pressed%body%mesh%z(:, 0) < -pressed%element_thickness .and. pressed%position(:, 0, 2) &
            >= (pressed%diameter - pressed%deflection)/2)) then
            error = numerical_error('is too large: at '//significant(pressed%deflection, 3)//' m the walls of the ' &
               //'cavity meet; allowed: less', 'compression', 'max_deflection')
            return
         end if
         if (halvings > max_halvings) then
            error = numerical_error('is too large: no state of rest was found beyond ' &
               //significant(pressed%deflection, 3)//' m; allowed: less, or more polar_elements', 'compression', &
               'max_deflection')
            return
         end if
      end do
   end subroutine press

   !> Newton's method at one approach of the plates.
   subroutine find_rest(pressed, converged, error)
      !> The ball; its positions, those of the previous approach, are the first estimate.
      type(pressed_ball_type), intent(inout) :: pressed
      !> Whether the ball is at rest.
      logical, intent(out) :: converged
      !> Set after an interrupt.
      type(error_type), allocatable, intent(out) :: error
      real(wp), dimension(0:pressed%body%mesh%n_polar, 0:pressed%body%mesh%n_radial, 2) :: force, target, change
      logical :: fixed(0:pressed%body%mesh%n_polar, 0:pressed%body%mesh%n_radial, 2)
      logical :: touching(0:pressed%body%mesh%n_polar, 2)
      integer :: iteration, last
      logical :: failed, same

      last = pressed%body%mesh%n_radial
      converged = .false.
      call get_forces(pressed%body, pressed%position, force, failed)
      if (failed) return
      do iteration = 1, max_iterations
         call check_interrupt(error)
         if (allocated(error)) return
         fixed = .false.
         fixed([0, pressed%body%mesh%n_polar], :, 1) = .true.
         fixed(:, last, 2) = any(pressed%touches, 2)
         target = pressed%position
         where (pressed%touches(:, 1)) target(:, last, 2) = 0.0_wp
         where (pressed%touches(:, 2)) target(:, last, 2) = pressed%diameter - pressed%deflection
         call get_newton_step(pressed, force, fixed, target - pressed%position, change, failed)
         if (failed) return
         pressed%position = pressed%position + change
         call get_forces(pressed%body, pressed%position, force, failed)
         if (failed) return
         associate (z => pressed%position(:, last, 2), top => pressed%diameter - pressed%deflection)
            touching(:, 1) = merge(force(:, last, 2) < pressed%tolerance, z < 0.0_wp, pressed%touches(:, 1))
            touching(:, 2) = merge(force(:, last, 2) > -pressed%tolerance, top - z < 0.0_wp, pressed%touches(:, 2))
         end associate
         same = all(touching .eqv. pressed%touches)
         pressed%touches = touching
         converged = same .and. maxval(abs(force), mask=.not. fixed) < pressed%tolerance
         if (.not. any(touching(:, 1)) .or. .not. any(touching(:, 2))) return
         if (converged) exit
      end do
      pressed%force = -sum(force(:, last, 2), mask=pressed%touches(:, 1))
   end subroutine find_rest

   !> Forces of stress and gas on the nodes.
   pure subroutine get_forces(body, position, force, failed)
      !> The body, without viscosity; unchanged on return.
      type(elastic_body_type), intent(inout) :: body
      !> Positions of the nodes, m.
      real(wp), intent(in), contiguous :: position(0:, 0:, :)
      !> Forces, N.
      real(wp), intent(out), contiguous :: force(0:, 0:, :)
      !> Whether an element is turned inside out or the cavity is closed.
      logical, intent(out) :: failed
      type(body_state_type) :: state

      call get_internal_forces(body, position, 0*position, 1.0_wp, force, state)
      failed = state%failure /= no_failure
   end subroutine get_forces

   !> Change of the positions that balances the forces.
   subroutine get_newton_step(pressed, force, fixed, shift, change, failed)
      type(pressed_ball_type), intent(inout) :: pressed
      !> Forces at the present positions, N.
      real(wp), intent(in) :: force(0:, 0:, :)
      !> Coordinates with prescribed changes, and these changes, m.
      logical, intent(in) :: fixed(0:, 0:, :)
      real(wp), intent(in) :: shift(0:, 0:, :)
      !> Changes of all coordinates, m.
      real(wp), intent(out) :: change(0:, 0:, :)
      !> Whether the tangent is singular or cannot be computed.
      logical, intent(out) :: failed
      real(wp) :: gradient(0:ubound(force, 1), 0:ubound(force, 2), 2)
      real(wp), allocatable :: band(:, :), solution(:, :)
      integer, allocatable :: pivot(:)
      real(wp) :: volume, slope
      integer :: n, width, info

      change = 0.0_wp
      n = size(force)
      ! Nodes of neighboring lines and rings, two coordinates each.
      width = 2*size(force, 2) + 3
      allocate (band(3*width + 1, n), solution(n, 2), pivot(n))
      call get_tangent(pressed, fixed, width, band, failed)
      if (failed) return
      ! The gas couples all nodes of the cavity: its pressure changes with the volume, whose gradient is the force of a unit
      ! pressure.
      gradient = 0.0_wp
      associate (r => pressed%position(:, 0, 1), z => pressed%position(:, 0, 2))
         call add_gas_forces(1.0_wp, r, z, gradient(:, 0, 1), gradient(:, 0, 2))
         volume = get_volume(r, z)
      end associate
      associate (gas => pressed%body%cavity)
         slope = -gas%exponent*(get_gas_pressure(gas, volume) + gas%ambient)/volume
      end associate
      solution(:, 1) = in_order(merge(shift, force, fixed))
      solution(:, 2) = in_order(merge(0.0_wp, gradient, fixed))
      call dgbsv(n, width, width, 2, band, size(band, 1), pivot, solution, n, info)
      failed = info /= 0
      if (failed) return
      ! Sherman-Morrison formula: the tangent is the banded matrix minus slope gradient gradient^T.
      associate (row => in_order(gradient))
         solution(:, 1) = solution(:, 1) + solution(:, 2)*(slope*dot_product(row, solution(:, 1)) &
            /(1 - slope*dot_product(row, solution(:, 2))))
      end associate
      change = reshape(solution(:, 1), shape(change), order=[3, 2, 1])
   end subroutine get_newton_step

   !> Values at the nodes in the order of the unknowns: components, then rings, then lines.
   pure function in_order(field) result(vector)
      !> The values: [0:n_polar, 0:n_radial, 2].
      real(wp), intent(in) :: field(0:, 0:, :)
      !> The same values: [n].
      real(wp) :: vector(size(field))

      vector = reshape(reshape(field, [size(field, 3), size(field, 2), size(field, 1)], order=[3, 2, 1]), [size(field)])
   end function in_order

   !> Negative derivatives of the forces, at constant pressure of the gas.
   subroutine get_tangent(pressed, fixed, width, band, failed)
      type(pressed_ball_type), intent(in) :: pressed
      !> Coordinates with prescribed changes; their rows become those of the unit matrix.
      logical, intent(in) :: fixed(0:, 0:, :)
      !> Number of diagonals on each side.
      integer, intent(in) :: width
      !> The matrix as LAPACK stores bands: [3 width + 1, n].
      real(wp), intent(out) :: band(:, :)
      !> Whether a trial position has no forces.
      logical, intent(out) :: failed
      real(wp), dimension(0:ubound(fixed, 1), 0:ubound(fixed, 2), 2) :: here, there, moved
      type(elastic_body_type) :: body
      real(wp) :: step
      integer :: a, b, c, i, j, k, first, second, row, column

      band = 0.0_wp
      step = trial*pressed%element_thickness
      body = pressed%body
      ! A gas whose pressure does not depend on its volume.
      body%cavity = cavity_type(volume=1.0_wp, exponent=0.0_wp, pressure=get_gas_pressure(pressed%body%cavity, &
         get_volume(pressed%position(:, 0, 1), pressed%position(:, 0, 2))))
      call get_forces(body, pressed%position, here, failed)
      do k = 1, 2
         do first = 0, 2
            do second = 0, 2
               if (failed) return
               moved = pressed%position
               moved(first::3, second::3, k) = moved(first::3, second::3, k) + step
               call get_forces(body, moved, there, failed)
               there = (here - there)/step
               do b = 0, ubound(fixed, 2)
                  do a = 0, ubound(fixed, 1)
                     ! The moved node among the neighbors of this one.
                     j = a - 1 + modulo(first - a + 1, 3)
                     i = b - 1 + modulo(second - b + 1, 3)
                     if (j < 0 .or. j > ubound(fixed, 1) .or. i < 0 .or. i > ubound(fixed, 2)) cycle
                     column = 2*(j*size(fixed, 2) + i) + k
                     do c = 1, 2
                        row = 2*(a*size(fixed, 2) + b) + c
                        band(2*width + 1 + row - column, column) = merge(merge(1.0_wp, 0.0_wp, row == column), &
                           there(a, b, c), fixed(a, b, c))
                     end do
                  end do
               end do
            end do
         end do
      end do
   end subroutine get_tangent

end module thud_pressed_ball
