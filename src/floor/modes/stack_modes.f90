!> Modes of plates above each other, with ribs and resilient layers, as a Ritz system. The rotations of plates that are not
!> rigid in shear (Mindlin) are static displacements.
module thud_stack_modes
   use thud_constants, only: pi
   use thud_function_set, only: cosines, function_set_type, get_functions, get_highest_wavenumber, get_overlap, &
      new_polynomials, point_values, sines
   use thud_kinds, only: wp
   use thud_lapack, only: dposv
   use thud_modes, only: modes_type, product_type
   use thud_plate_stack, only: edge_type, get_counts, get_degree, get_lines, get_resolved_frequency, has_shear, &
      has_sines, orthotropic_type, plate_stack_type, ribs_type, rigid_support
   use thud_ritz_system, only: add_energies, add_term, energy_type, ritz_system_type, solve_ritz_system, term_type
   implicit none (type, external)
   private

   public :: get_stack_modes

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
      !> Frequency of the highest modes whose losses may couple them, Hz.
      real(wp), intent(in) :: lower_limit
      type(ritz_system_type) :: system
      type(product_type) :: products(3, size(stack%plate))
      integer :: index(3)
      integer :: i

      resolved = get_resolved_frequency(stack, max_frequency)
      failed = .not. resolved > 0.0_wp
      if (failed) return
      do i = 1, size(stack%plate)
         products(:, i) = get_products(stack, stack%plate(i), resolved)
      end do
      system%displacement = products(1, :)
      do i = 1, size(stack%plate)
         system%is_bearing = i == stack%bearing
         index = [i, 0, 0]
         if (has_shear(stack%plate(i))) then
            index(2:) = size(system%displacement) + [1, 2]
            system%displacement = [system%displacement, products(2:, i)]
         end if
         call add_plate(system, stack%plate(i), index)
         if (allocated(stack%plate(i)%ribs)) call add_ribs(system, stack%plate(i), stack%plate(i)%ribs, i, products(2, i)%x)
      end do
      system%is_bearing = .false.
      do i = 1, size(stack%plate) - 1
         associate (layer => stack%layer(i))
            call add_energies(system, get_springs(layer%stiffness), layer%loss_factor)
            if (allocated(layer%line_y)) call add_energies(system, get_springs(layer%line_stiffness), &
               layer%line_loss_factor, 2, layer%line_y)
         end associate
      end do
      call solve_ritz_system(system, modes, failed, 2*pi*lower_limit)
   contains

      !> Energies of springs between a plate and the next one.
      function get_springs(stiffness) result(energies)
         real(wp), intent(in) :: stiffness
         type(energy_type) :: energies(3)

         energies = [energy_type(stiffness, i, i), energy_type(stiffness, i + 1, i + 1), &
            energy_type(-stiffness, i, i + 1)]
      end function get_springs
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

   !> Functions of the deflection of a plate and of its rotations along x and y.
   function get_products(stack, plate, frequency) result(products)
      type(plate_stack_type), intent(in) :: stack
      type(orthotropic_type), intent(in) :: plate
      !> Frequency up to which waves are resolved, Hz.
      real(wp), intent(in) :: frequency
      type(product_type) :: products(3)
      type(function_set_type) :: deflection(2), rotation(2)
      real(wp), allocatable :: lines(:)
      real(wp) :: sides(2)
      integer :: n(2), degree(2)
      logical :: is_thin
      integer :: i

      n = get_counts(stack, plate, frequency)
      is_thin = .not. has_shear(plate)
      sides = [stack%length, stack%width]
      do i = 1, 2
         if (has_sines(plate, i)) then
            deflection(i) = function_set_type(sines, sides(i), n(i))
            rotation(i) = function_set_type(cosines, sides(i), n(i))
            cycle
         end if
         degree(i) = n(i)
         if (is_thin) degree(i) = get_degree((n(i) + 2)*pi/2)
         lines = get_lines(plate, i)
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
      products(1) = product_type(deflection(1), deflection(2))
      products(2) = product_type(rotation(1), deflection(2), is_static=.true.)
      products(3) = product_type(deflection(1), rotation(2), is_static=.true.)
   end function get_products

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
      type(ritz_system_type) :: system
      type(modes_type) :: modes
      real(wp), allocatable :: shape(:, :), omega(:), added(:, :)
      logical, allocatable :: kept(:)
      integer, allocatable :: chosen(:)
      logical :: failed
      integer :: i, j, order

      ! gfortran 12 does not free array constructors of types with allocatable components.
      allocate (system%displacement(1))
      system%displacement(1)%x = set
      system%displacement(1)%y = function_set_type(cosines, 1.0_wp, 1)
      ! With the mass B per length, angular frequencies are squared wavenumbers.
      call add_energies(system, [energy_type(bending, 1, 1, [2, 0], [2, 0]), energy_type(bending, 1, 1, is_mass=.true.)], &
         0.0_wp)
      call add_ends(system, 1, 1, 0, edge%deflection)
      call add_ends(system, 1, 1, 1, edge%rotation)
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

   !> Energies of a plate and of the springs along its edges. Of a plate with shear (Mindlin), the energy of bending is that
   !> of the rotations, the energy of shear that of slope minus rotation; otherwise (Kirchhoff) rotations are slopes.
   subroutine add_plate(system, plate, index)
      type(ritz_system_type), intent(inout) :: system
      type(orthotropic_type), intent(in) :: plate
      !> Indices of the deflection and the rotations, 0 for a plate that is rigid in shear.
      integer, intent(in) :: index(3)
      integer :: i, w, a, b

      w = index(1)
      a = index(2)
      b = index(3)
      associate (along => plate%along, across => plate%across, coupling => plate%coupling, torsion => plate%torsion, &
         inertia => plate%inertia, s => plate%shear)
         call add_energies(system, [energy_type(plate%mass, w, w, is_mass=.true.)], 0.0_wp)
         if (a == 0) then
            call add_energies(system, [ &
               energy_type(along, w, w, [2, 0], [2, 0]), energy_type(across, w, w, [0, 2], [0, 2]), &
               energy_type(coupling, w, w, [0, 2], [2, 0]), energy_type(coupling, w, w, [2, 0], [0, 2]), &
               energy_type(4*torsion, w, w, [1, 1], [1, 1]), &
               energy_type(inertia, w, w, [1, 0], [1, 0], is_mass=.true.), &
               energy_type(inertia, w, w, [0, 1], [0, 1], is_mass=.true.)], plate%loss_factor)
         else
            call add_energies(system, [ &
               energy_type(along, a, a, [1, 0], [1, 0]), energy_type(across, b, b, [0, 1], [0, 1]), &
               energy_type(coupling, a, b, [1, 0], [0, 1]), &
               energy_type(torsion, a, a, [0, 1], [0, 1]), energy_type(torsion, b, b, [1, 0], [1, 0]), &
               energy_type(torsion, a, b, [0, 1], [1, 0]), &
               energy_type(s(1), w, w, [1, 0], [1, 0]), energy_type(s(1), a, a), energy_type(-s(1), w, a, [1, 0]), &
               energy_type(s(2), w, w, [0, 1], [0, 1]), energy_type(s(2), b, b), energy_type(-s(2), w, b, [0, 1]), &
               energy_type(inertia, a, a, is_mass=.true.), energy_type(inertia, b, b, is_mass=.true.)], plate%loss_factor)
         end if
      end associate
      do i = 1, 2
         associate (edges => plate%edge(2*i - 1:2*i))
            call add_ends(system, i, w, 0, edges%deflection)
            call add_ends(system, i, merge(w, index(i + 1), a == 0), merge(1, 0, a == 0), edges%rotation)
         end associate
      end do
   end subroutine add_plate

   !> Springs along both edges across one direction that are not rigid. Equal edges are one term, which keeps the symmetry.
   subroutine add_ends(system, direction, index, order, spring)
      type(ritz_system_type), intent(inout) :: system
      !> 1: edges x = constant, 2: edges y = constant.
      integer, intent(in) :: direction
      !> Index of the displacement, and order of the derivative that the springs resist.
      integer, intent(in) :: index, order
      !> Stiffness per length.
      real(wp), intent(in) :: spring(2)
      real(wp) :: ends(2)
      integer :: orders(2)
      integer :: i, n

      associate (displacement => system%displacement(index))
         ends = [0.0_wp, merge(displacement%x%length, displacement%y%length, direction == 1)]
      end associate
      orders = 0
      orders(direction) = order
      n = merge(2, 1, abs(spring(1) - spring(2)) <= 0.0_wp)
      do i = 1, 3 - n
         if (spring(i) < rigid_support) call add_energies(system, &
            [energy_type(spring(i), index, index, orders, orders)], 0.0_wp, direction, ends(i:i + n - 1))
      end do
   end subroutine add_ends

   !> Energies of the ribs of a plate. They turn with torsion and warping, joined to the slope of the deflection by the
   !> static stiffness pi B k of the waves shorter than those of the functions, which end at the wavenumber k: their
   !> curvature jumps at ribs, which the functions approach slowly.
   subroutine add_ribs(system, plate, ribs, w, rotation)
      type(ritz_system_type), intent(inout) :: system
      type(orthotropic_type), intent(in) :: plate
      type(ribs_type), intent(in) :: ribs
      !> Index of the deflection.
      integer, intent(in) :: w
      !> Functions of the rotation along the ribs.
      type(function_set_type), intent(in) :: rotation
      type(function_set_type) :: x, y
      type(product_type), allocatable :: displacement(:)
      real(wp) :: joint
      integer :: n, turn

      x = system%displacement(w)%x
      y = system%displacement(w)%y
      associate (at_ribs => get_functions(y, ribs%position, 0))
         call add_term(system%stiffness, term_type(w, w, get_beam_stiffness(ribs, x, rotation), &
            matmul(transpose(at_ribs), at_ribs), ribs%loss_factor, system%is_bearing))
      end associate
      call add_energies(system, [energy_type(ribs%mass, w, w, is_mass=.true.)], 0.0_wp, 2, ribs%position)
      if (.not. ribs%inertia > 0.0_wp) return
      ! One function for the rotation of each rib.
      n = size(ribs%position)
      turn = size(system%displacement) + 1
      allocate (displacement(turn))
      displacement(:turn - 1) = system%displacement
      displacement(turn)%x = x
      displacement(turn)%y = function_set_type(point_values, y%length, n, get_even_and_odd(n))
      call move_alloc(displacement, system%displacement)
      call add_energies(system, [energy_type(ribs%torsion, turn, turn, [1, 0], [1, 0]), &
         energy_type(ribs%warping, turn, turn, [2, 0], [2, 0]), energy_type(ribs%inertia, turn, turn, is_mass=.true.)], &
         ribs%loss_factor, 2, ribs%position)
      joint = pi*plate%across*get_highest_wavenumber(y)
      call add_energies(system, [energy_type(joint, turn, turn), energy_type(joint, w, w, [0, 1], [0, 1]), &
         energy_type(-joint, w, turn, [0, 1])], plate%loss_factor, 2, ribs%position)
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

end module thud_stack_modes
