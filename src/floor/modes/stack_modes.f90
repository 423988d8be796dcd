!> Modes of plates above each other, with ribs and resilient layers, as a Ritz system. The rotations of plates that are not
!> rigid in shear (Mindlin) are static displacements.
module thud_stack_modes
   use thud_constants, only: pi
   use thud_function_set, only: cosines, function_set_type, get_functions, get_highest_wavenumber, get_overlap, &
      new_polynomials, sines
   use thud_kinds, only: wp
   use thud_lapack, only: dposv
   use thud_modes, only: modes_type, product_type
   use thud_plate_stack, only: edge_type, get_counts, get_degree, get_resolved_frequency, has_sines, &
      layer_type, orthotropic_type, plate_stack_type, ribs_type, rigid_support
   use thud_ritz_system, only: add_displacement, add_mass, add_stiffness, ritz_system_type, solve_ritz_system
   implicit none (type, external)
   private

   public :: get_stack_modes

   !> Displacement and rotations of a plate, and numbers of these in the system; 0: no rotations.
   type :: plate_motion_type
      type(product_type) :: deflection, rotation_x, rotation_y
      integer :: w = 0, a = 0, b = 0
   end type plate_motion_type

contains

   !> Modes of a stack. The displacements of the plates are the first ones of the modes, in the same order.
   subroutine get_stack_modes(stack, max_frequency, modes, resolved, failed, lower_limit)
      type(plate_stack_type), intent(in) :: stack
      !> Frequency up to which the modes are wanted, Hz.
      real(wp), intent(in) :: max_frequency
      type(modes_type), intent(out) :: modes
      !> Frequency up to which the functions resolve the waves, Hz: less than the wanted one for large or soft plates, 0 for
      !> those of which they resolve none.
      real(wp), intent(out) :: resolved
      !> The system has no solution.
      logical, intent(out) :: failed
      !> Frequency of the highest modes whose losses may couple them, Hz (default: none).
      real(wp), intent(in), optional :: lower_limit
      real(wp) :: limit
      type(ritz_system_type) :: system
      type(plate_motion_type) :: motion(size(stack%plate))
      integer :: i

      resolved = get_resolved_frequency(stack, max_frequency)
      failed = .not. resolved > 0.0_wp
      if (failed) return
      do i = 1, size(stack%plate)
         motion(i) = new_motion(stack, stack%plate(i), resolved)
         call add_displacement(system, motion(i)%deflection, motion(i)%w)
      end do
      do i = 1, size(stack%plate)
         system%is_bearing = i == stack%bearing
         if (maxval(stack%plate(i)%shear) > 0.0_wp) then
            call add_displacement(system, motion(i)%rotation_x, motion(i)%a)
            call add_displacement(system, motion(i)%rotation_y, motion(i)%b)
            call add_shear_plate(system, stack%plate(i), motion(i))
         else
            call add_thin_plate(system, stack%plate(i), motion(i))
         end if
         call add_edges(system, stack%plate(i), motion(i))
         call add_ribs(system, stack%plate(i), motion(i))
      end do
      system%is_bearing = .false.
      do i = 1, size(stack%plate) - 1
         call add_layer(system, stack%layer(i), motion(i), motion(i + 1))
      end do
      limit = 0.0_wp
      if (present(lower_limit)) limit = 2*pi*lower_limit
      call solve_ritz_system(system, modes, failed, limit)
   end subroutine get_stack_modes

   !> Sums and differences of loads at positions that are symmetric about the middle, so that functions remain even or odd:
   !> an orthogonal matrix, [n_load, n_load].
   pure function get_even_and_odd(n) result(matrix)
      !> Number of loads.
      integer, intent(in) :: n
      real(wp) :: matrix(n, n)
      integer :: i

      matrix = 0.0_wp
      do i = 1, n/2
         matrix([i, n + 1 - i], i) = sqrt(0.5_wp)
         matrix([i, n + 1 - i], n + 1 - i) = [sqrt(0.5_wp), -sqrt(0.5_wp)]
      end do
      if (mod(n, 2) == 1) matrix((n + 1)/2, (n + 1)/2) = 1.0_wp
   end function get_even_and_odd

   !> Functions of the deflection and the rotations of a plate.
   function new_motion(stack, plate, frequency) result(motion)
      type(plate_stack_type), intent(in) :: stack
      type(orthotropic_type), intent(in) :: plate
      !> Frequency up to which waves are resolved, Hz.
      real(wp), intent(in) :: frequency
      type(plate_motion_type) :: motion
      type(function_set_type) :: deflection(2), rotation(2)
      real(wp), allocatable :: lines(:)
      real(wp) :: sides(2)
      integer :: n(2), degree(2)
      logical :: is_thin
      integer :: i

      n = get_counts(stack, plate, frequency)
      is_thin = .not. maxval(plate%shear) > 0.0_wp
      sides = [stack%length, stack%width]
      do i = 1, 2
         if (has_sines(plate, i)) then
            deflection(i) = function_set_type(sines, sides(i), n(i))
            rotation(i) = function_set_type(cosines, sides(i), n(i))
            cycle
         end if
         degree(i) = n(i)
         if (is_thin) degree(i) = get_degree((n(i) + 2)*pi/2)
         lines = spread(0.0_wp, 1, 0)
         if (i == 1 .and. allocated(plate%line_x)) lines = plate%line_x
         if (i == 2 .and. allocated(plate%line_y)) lines = plate%line_y
         associate (edge => plate%edge(2*i - 1:2*i), ends => [0.0_wp, sides(i)])
            associate (fixed => [pack(ends, edge%deflection >= rigid_support), lines], &
               clamped => pack(ends, edge%rotation >= rigid_support))
               deflection(i) = new_polynomials(sides(i), degree(i) + size(fixed) + size(clamped), [fixed, clamped], &
                  [spread(0, 1, size(fixed)), spread(1, 1, size(clamped))])
               rotation(i) = new_polynomials(sides(i), degree(i) + size(clamped), clamped, spread(0, 1, size(clamped)))
            end associate
            if (is_thin) call keep_beam_modes(deflection(i), edge, merge(plate%along, plate%across, i == 1), n(i))
         end associate
      end do
      motion%deflection = product_type(deflection(1), deflection(2))
      motion%rotation_x = product_type(rotation(1), deflection(2), is_static=.true.)
      motion%rotation_y = product_type(deflection(1), rotation(2), is_static=.true.)
   end function new_motion

   !> Replaces polynomials by the lowest modes of a beam, which are far fewer for the same waves.
   !>
   !> What the others would add under forces and moments at the ends is kept, too: at free edges the curvature is not that of
   !> a beam, which its modes approach slowly.
   subroutine keep_beam_modes(set, edge, bending, n)
      type(function_set_type), intent(inout) :: set
      !> Springs at both ends.
      type(edge_type), intent(in) :: edge(2)
      !> Bending stiffness per width, N m.
      real(wp), intent(in) :: bending
      !> Number of modes.
      integer, intent(in) :: n
      real(wp), parameter :: unit(1, 1) = 1.0_wp
      type(ritz_system_type) :: system
      type(modes_type) :: modes
      real(wp), allocatable :: shape(:, :), omega(:), added(:, :)
      logical, allocatable :: kept(:)
      integer, allocatable :: chosen(:)
      logical :: failed
      integer :: i, j, number, order

      call add_displacement(system, product_type(set, function_set_type(cosines, 1.0_wp, 1)), number)
      ! With the mass B per length, angular frequencies are squared wavenumbers.
      call add_stiffness(system, 1, 1, bending, get_overlap(set, 2, set, 2), unit, 0.0_wp)
      call add_mass(system, 1, 1, bending, get_overlap(set, 0, set, 0), unit)
      do order = 0, 1
         call add_ends(system, 1, 1, system%displacement(1), order, merge(edge%deflection, edge%rotation, order == 0))
      end do
      call solve_ritz_system(system, modes, failed, 0.0_wp)
      if (failed) return
      allocate (shape(set%count, set%count), source=0.0_wp)
      allocate (omega(0))
      do i = 1, size(modes%block)
         associate (block => modes%block(i))
            shape(block%shape(1)%x, size(omega) + 1:size(omega) + size(block%omega)) = sqrt(bending) &
               *block%shape(1)%coefficient
            omega = [omega, block%omega]
         end associate
      end do
      set%coefficient = matmul(set%coefficient, shape)
      allocate (kept(set%count), source=.false.)
      do i = 1, n
         j = minloc(omega, dim=1, mask=.not. kept)
         kept(j) = .true.
      end do
      set%complete = sqrt(maxval(omega, mask=kept)) + pi/(2*set%length)
      chosen = pack([(i, i=1, set%count)], kept)
      allocate (added(set%count, 0))
      do order = 0, 1
         call add_deflections(get_functions(set, [0.0_wp, set%length], order), order)
      end do
      added = matmul(set%coefficient, added)
      set%coefficient(:, :n) = set%coefficient(:, chosen)
      set%count = n + size(added, 2)
      set%coefficient(:, n + 1:set%count) = added
      set%coefficient = set%coefficient(:, :set%count)
   contains

      !> Adds the deflections of the other modes under loads, even and odd ones: orthogonal to those that were added, unless
      !> they are too small or depend on them.
      subroutine add_deflections(value, order)
         !> Values of the modes or their derivatives where the loads act: [n_load, n_mode].
         real(wp), intent(in) :: value(:, :)
         !> Order of the derivative.
         integer, intent(in) :: order
         real(wp) :: deflection(size(value, 2), size(value, 1)), rest(size(value, 2))
         integer :: k, repetition

         deflection = matmul(transpose(value), get_even_and_odd(size(value, 1)))
         do k = 1, size(deflection, 2)
            rest = merge(0.0_wp, deflection(:, k)/max(omega, tiny(omega))**2, kept)
            do repetition = 1, 2
               rest = rest - matmul(added, matmul(transpose(added), rest))
            end do
            ! Compared with the deflection of a beam as long as a wave.
            if (norm2(rest) < 1.0e-4_wp*set%complete**(order - 3.5_wp)) cycle
            added = reshape([added, rest/norm2(rest)], [size(added, 1), size(added, 2) + 1])
         end do
      end subroutine add_deflections
   end subroutine keep_beam_modes

   !> Stiffness and mass of a plate that is rigid in shear (Kirchhoff).
   subroutine add_thin_plate(system, plate, motion)
      type(ritz_system_type), intent(inout) :: system
      type(orthotropic_type), intent(in) :: plate
      type(plate_motion_type), intent(in) :: motion

      associate (x => motion%deflection%x, y => motion%deflection%y, w => motion%w, eta => plate%loss_factor)
         call add_stiffness(system, w, w, plate%along, get_overlap(x, 2, x, 2), get_overlap(y, 0, y, 0), eta)
         call add_stiffness(system, w, w, plate%across, get_overlap(x, 0, x, 0), get_overlap(y, 2, y, 2), eta)
         call add_stiffness(system, w, w, plate%coupling, get_overlap(x, 0, x, 2), get_overlap(y, 2, y, 0), eta)
         call add_stiffness(system, w, w, plate%coupling, get_overlap(x, 2, x, 0), get_overlap(y, 0, y, 2), eta)
         call add_stiffness(system, w, w, 4*plate%torsion, get_overlap(x, 1, x, 1), get_overlap(y, 1, y, 1), eta)
         call add_mass(system, w, w, plate%mass, get_overlap(x, 0, x, 0), get_overlap(y, 0, y, 0))
         call add_mass(system, w, w, plate%inertia, get_overlap(x, 1, x, 1), get_overlap(y, 0, y, 0))
         call add_mass(system, w, w, plate%inertia, get_overlap(x, 0, x, 0), get_overlap(y, 1, y, 1))
      end associate
   end subroutine add_thin_plate

   !> Stiffness and mass of a plate with shear (Mindlin): the energy of bending is that of the rotations, the energy of
   !> shear that of slope minus rotation.
   subroutine add_shear_plate(system, plate, motion)
      type(ritz_system_type), intent(inout) :: system
      type(orthotropic_type), intent(in) :: plate
      type(plate_motion_type), intent(in) :: motion

      associate (x => motion%deflection%x, y => motion%deflection%y, turn_x => motion%rotation_x%x, &
         turn_y => motion%rotation_y%y, w => motion%w, a => motion%a, b => motion%b, eta => plate%loss_factor)
         call add_stiffness(system, a, a, plate%along, get_overlap(turn_x, 1, turn_x, 1), get_overlap(y, 0, y, 0), eta)
         call add_stiffness(system, b, b, plate%across, get_overlap(x, 0, x, 0), get_overlap(turn_y, 1, turn_y, 1), eta)
         call add_stiffness(system, a, b, plate%coupling, get_overlap(turn_x, 1, x, 0), get_overlap(y, 0, turn_y, 1), eta)
         call add_stiffness(system, a, a, plate%torsion, get_overlap(turn_x, 0, turn_x, 0), get_overlap(y, 1, y, 1), eta)
         call add_stiffness(system, b, b, plate%torsion, get_overlap(x, 1, x, 1), get_overlap(turn_y, 0, turn_y, 0), eta)
         call add_stiffness(system, a, b, plate%torsion, get_overlap(turn_x, 0, x, 1), get_overlap(y, 1, turn_y, 0), eta)
         associate (s => plate%shear)
            call add_stiffness(system, w, w, s(1), get_overlap(x, 1, x, 1), get_overlap(y, 0, y, 0), eta)
            call add_stiffness(system, a, a, s(1), get_overlap(turn_x, 0, turn_x, 0), get_overlap(y, 0, y, 0), eta)
            call add_stiffness(system, w, a, -s(1), get_overlap(x, 1, turn_x, 0), get_overlap(y, 0, y, 0), eta)
            call add_stiffness(system, w, w, s(2), get_overlap(x, 0, x, 0), get_overlap(y, 1, y, 1), eta)
            call add_stiffness(system, b, b, s(2), get_overlap(x, 0, x, 0), get_overlap(turn_y, 0, turn_y, 0), eta)
            call add_stiffness(system, w, b, -s(2), get_overlap(x, 0, x, 0), get_overlap(y, 1, turn_y, 0), eta)
         end associate
         call add_mass(system, w, w, plate%mass, get_overlap(x, 0, x, 0), get_overlap(y, 0, y, 0))
         call add_mass(system, a, a, plate%inertia, get_overlap(turn_x, 0, turn_x, 0), get_overlap(y, 0, y, 0))
         call add_mass(system, b, b, plate%inertia, get_overlap(x, 0, x, 0), get_overlap(turn_y, 0, turn_y, 0))
      end associate
   end subroutine add_shear_plate

   !> Springs along the edges of a plate that are not rigid. Equal edges are one term, which keeps the symmetry.
   subroutine add_edges(system, plate, motion)
      type(ritz_system_type), intent(inout) :: system
      type(orthotropic_type), intent(in) :: plate
      type(plate_motion_type), intent(in) :: motion
      integer :: i

      do i = 1, 2
         associate (rotation => plate%edge(2*i - 1:2*i)%rotation)
            call add_ends(system, i, motion%w, motion%deflection, 0, plate%edge(2*i - 1:2*i)%deflection)
            if (motion%a == 0) then
               call add_ends(system, i, motion%w, motion%deflection, 1, rotation)
            else if (i == 1) then
               call add_ends(system, i, motion%a, motion%rotation_x, 0, rotation)
            else
               call add_ends(system, i, motion%b, motion%rotation_y, 0, rotation)
            end if
         end associate
      end do
   end subroutine add_edges

   !> Springs along both edges across one direction.
   subroutine add_ends(system, direction, number, shape, order, spring)
      type(ritz_system_type), intent(inout) :: system
      !> 1: edges x = constant, 2: edges y = constant.
      integer, intent(in) :: direction
      !> Number of the displacement and its functions.
      integer, intent(in) :: number
      type(product_type), intent(in) :: shape
      !> Order of the derivative that the springs resist.
      integer, intent(in) :: order
      !> Stiffness per length.
      real(wp), intent(in) :: spring(2)
      real(wp) :: ends(2)
      integer :: i, n

      ends = [0.0_wp, merge(shape%x%length, shape%y%length, direction == 1)]
      n = merge(2, 1, abs(spring(1) - spring(2)) <= 0.0_wp)
      do i = 1, 3 - n
         if (.not. spring(i) < rigid_support) cycle
         associate (at => ends(i:i + n - 1))
            if (direction == 1) then
               call add_stiffness(system, number, number, spring(i), get_point_matrix(shape%x, at, order), &
                  get_overlap(shape%y, 0, shape%y, 0), 0.0_wp)
            else
               call add_stiffness(system, number, number, spring(i), get_overlap(shape%x, 0, shape%x, 0), &
                  get_point_matrix(shape%y, at, order), 0.0_wp)
            end if
         end associate
      end do
   end subroutine add_ends

   !> Sum over positions of products of derivatives of functions: [count, count].
   pure function get_point_matrix(set, position, order) result(matrix)
      type(function_set_type), intent(in) :: set
      !> Positions, m: [n_position].
      real(wp), intent(in) :: position(:)
      !> Order of the derivatives.
      integer, intent(in) :: order
      real(wp) :: matrix(set%count, set%count)

      associate (value => get_functions(set, position, order))
         matrix = matmul(transpose(value), value)
      end associate
   end function get_point_matrix

   !> Stiffness and mass of the ribs of a plate. They turn with torsion and warping, joined to the slope of the deflection by
   !> the static stiffness pi B k of the waves shorter than those of the functions, which end at the wavenumber k: their
   !> curvature jumps at ribs, which the functions approach slowly.
   subroutine add_ribs(system, plate, motion)
      type(ritz_system_type), intent(inout) :: system
      type(orthotropic_type), intent(in) :: plate
      type(plate_motion_type), intent(in) :: motion
      real(wp), allocatable :: slope(:, :), unit(:, :)
      real(wp) :: joint
      integer :: turn

      if (.not. allocated(plate%ribs)) return
      associate (ribs => plate%ribs, w => motion%w, x => motion%deflection%x, y => motion%deflection%y)
         associate (at_ribs => get_point_matrix(y, ribs%position, 0), n => size(ribs%position), eta => ribs%loss_factor)
            call add_stiffness(system, w, w, 1.0_wp, get_beam_stiffness(ribs, x, motion%rotation_x%x), at_ribs, eta)
            call add_mass(system, w, w, ribs%mass, get_overlap(x, 0, x, 0), at_ribs)
            if (.not. ribs%inertia > 0.0_wp) return
            slope = matmul(transpose(get_functions(y, ribs%position, 1)), get_even_and_odd(n))
            unit = matmul(transpose(get_even_and_odd(n)), get_even_and_odd(n))
            joint = pi*plate%across*get_highest_wavenumber(y)
            ! One function for the rotation of each rib.
            call add_displacement(system, product_type(x, function_set_type(cosines, y%length, n)), turn)
            call add_stiffness(system, turn, turn, ribs%torsion, get_overlap(x, 1, x, 1), unit, eta)
            call add_stiffness(system, turn, turn, ribs%warping, get_overlap(x, 2, x, 2), unit, eta)
            call add_mass(system, turn, turn, ribs%inertia, get_overlap(x, 0, x, 0), unit)
            associate (one => get_overlap(x, 0, x, 0), loss => plate%loss_factor)
               call add_stiffness(system, turn, turn, joint, one, unit, loss)
               call add_stiffness(system, w, w, joint, one, matmul(slope, transpose(slope)), loss)
               call add_stiffness(system, w, turn, -joint, one, slope, loss)
            end associate
         end associate
      end associate
   end subroutine add_ribs

   !> Stiffness of a rib over the functions of its deflection. Its rotation (Timoshenko) and the slip of the flange take the
   !> values of least energy.
   function get_beam_stiffness(ribs, deflection, rotation) result(stiffness)
      type(ribs_type), intent(in) :: ribs
      type(function_set_type), intent(in) :: deflection, rotation
      !> The stiffness, N/m times m: [deflection%count, deflection%count].
      real(wp) :: stiffness(deflection%count, deflection%count)
      real(wp), dimension(rotation%count, rotation%count) :: rotated, unit, curved, slipping
      real(wp), dimension(rotation%count, deflection%count) :: coupling, followed
      integer :: info

      unit = get_overlap(rotation, 0, rotation, 0)
      curved = get_overlap(rotation, 1, rotation, 1)
      rotated = ribs%bending*curved + ribs%shear*unit
      ! The functions are orthonormal: of a sine, the flange adds k**2 composite/(1 + slip composite k**2).
      slipping = unit + ribs%slip*ribs%composite*curved
      curved = ribs%composite*curved
      call dposv('U', rotation%count, rotation%count, slipping, rotation%count, curved, rotation%count, info)
      rotated = rotated + curved
      coupling = ribs%shear*get_overlap(rotation, 0, deflection, 1)
      followed = coupling
      call dposv('U', rotation%count, deflection%count, rotated, rotation%count, followed, rotation%count, info)
      stiffness = ribs%shear*get_overlap(deflection, 1, deflection, 1) - matmul(transpose(coupling), followed)
   end function get_beam_stiffness

   !> Springs between two plates.
   subroutine add_layer(system, layer, upper, lower)
      type(ritz_system_type), intent(inout) :: system
      type(layer_type), intent(in) :: layer
      type(plate_motion_type), intent(in) :: upper, lower

      if (layer%stiffness > 0.0_wp) call add_between(layer%stiffness, layer%loss_factor)
      if (allocated(layer%line_y)) call add_between(layer%line_stiffness, layer%line_loss_factor, y=layer%line_y)
   contains

      !> Adds springs at all positions, or along lines y.
      subroutine add_between(stiffness, loss_factor, y)
         real(wp), intent(in) :: stiffness, loss_factor
         real(wp), intent(in), optional :: y(:)

         call add_pair(system, upper, upper, stiffness, loss_factor, y)
         call add_pair(system, lower, lower, stiffness, loss_factor, y)
         call add_pair(system, upper, lower, -stiffness, loss_factor, y)
      end subroutine add_between
   end subroutine add_layer

   !> Stiffness of springs between the deflections of two plates, or of one plate with itself.
   subroutine add_pair(system, first, second, stiffness, loss_factor, y)
      type(ritz_system_type), intent(inout) :: system
      type(plate_motion_type), intent(in) :: first, second
      !> Stiffness per area or per length, and loss factor.
      real(wp), intent(in) :: stiffness, loss_factor
      !> Positions of lines of springs, m (default: everywhere).
      real(wp), intent(in), optional :: y(:)

      call add_stiffness(system, first%w, second%w, stiffness, &
         get_overlap(first%deflection%x, 0, second%deflection%x, 0), &
         get_product(first%deflection%y, second%deflection%y, y), loss_factor)
   end subroutine add_pair

   !> Products of two sets, summed over positions or, without these, integrated: [first%count, second%count].
   pure function get_product(first, second, position) result(matrix)
      type(function_set_type), intent(in) :: first, second
      !> Positions, m.
      real(wp), intent(in), optional :: position(:)
      real(wp) :: matrix(first%count, second%count)

      if (present(position)) then
         matrix = matmul(transpose(get_functions(first, position, 0)), get_functions(second, position, 0))
      else
         matrix = get_overlap(first, 0, second, 0)
      end if
   end function get_product

end module thud_stack_modes
