!> Modes of a floor in sets whose shapes have products with a mean over the strike points above a room.
module thud_coupled_modes
   use thud_floor_modes, only: floor_modes_type
   use thud_function_set, only: get_overlap
   use thud_kinds, only: wp
   use thud_mode_mixing, only: is_identity, mixing_type
   use thud_plate_shapes, only: block_shapes_type, get_integrals, get_merged, get_shapes, overlap_type, shapes_type
   use thud_ritz_system, only: product_type
   implicit none (type, external)
   private

   public :: coupled_modes_type, get_coupled_modes, get_diagonal, new_part, part_type

   !> Orthonormal functions whose product has a smaller integral over a part are orthogonal there, but for rounding.
   real(wp), parameter :: rounding = 1.0e-9_wp

   !> Modes whose products have a smaller mean than this, relative to their squares, are orthogonal.
   real(wp), parameter :: max_overlap = 0.05_wp

   !> Part of the floor above the room.
   type :: part_type
      !> Area, m2, and that of the whole floor.
      real(wp) :: area = 0.0_wp, whole = 0.0_wp
      !> Integrals of products of functions of x and y over the part, of the plate under the source and of the bearing plate;
      !> not allocated for the whole floor, over which functions are orthonormal.
      type(overlap_type) :: struck, bearing
   end type part_type

   !> Modes whose shapes have products with a mean at the strike points.
   type :: coupled_modes_type
      !> Their numbers among those that take part: [n_mode].
      integer, allocatable :: mode(:)
      !> Shapes of the radiating plate.
      type(block_shapes_type) :: radiator
      !> Means G over the strike points, and integrals over the bearing plate and its part above the room, of products of
      !> shapes: [n_mode, n_mode].
      real(wp), allocatable :: drive(:, :), velocity(:, :), above(:, :)
      type(mixing_type) :: mixing
      !> Means of products of different shapes vanish, and losses mix no modes.
      logical :: is_orthogonal = .false.
   end type coupled_modes_type

contains

   !> Part of a floor above a room.
   function new_part(modes, area) result(part)
      type(floor_modes_type), intent(in) :: modes
      !> Its ends along length and width, m.
      real(wp), intent(in) :: area(4)
      type(part_type) :: part

      part%area = (area(2) - area(1))*(area(4) - area(3))
      part%whole = modes%stack%length*modes%stack%width
      if (part%area > part%whole*(1 - 1.0e-9_wp)) return
      associate (displacement => modes%modes%displacement)
         part%struck = new_overlap(displacement(1))
         part%bearing = new_overlap(displacement(modes%stack%bearing))
      end associate
   contains

      !> Integrals over the part.
      function new_overlap(set) result(overlap)
         type(product_type), intent(in) :: set
         type(overlap_type) :: overlap

         allocate (overlap%x, source=get_overlap(set%x, 0, set%x, 0, area(1), area(2)))
         allocate (overlap%y, source=get_overlap(set%y, 0, set%y, 0, area(3), area(4)))
      end function new_overlap
   end function new_part

   !> Modes that take part, in sets whose shapes have products with a mean at the strike points.
   function get_coupled_modes(modes, part, radiator, kept, mixing) result(coupled)
      type(floor_modes_type), intent(in) :: modes
      type(part_type), intent(in) :: part
      !> Shapes of the radiating plate.
      type(shapes_type), intent(in) :: radiator
      !> Numbers of the modes: [n_mode].
      integer, intent(in) :: kept(:)
      type(mixing_type), intent(in) :: mixing
      type(coupled_modes_type), allocatable :: coupled(:)
      type(shapes_type) :: struck, bearing
      integer, allocatable :: set(:), members(:), last(:)
      integer :: i, j, k

      struck = get_shapes(modes, 1, kept)
      bearing = get_shapes(modes, modes%stack%bearing, kept)
      set = get_sets(struck, part%struck)
      allocate (last(0:size(set)), source=0)
      do i = 1, size(set)
         last(i) = last(i - 1) + size(struck%block(i)%coefficient, 2)
      end do
      allocate (coupled(maxval([0, set])))
      do i = 1, size(coupled)
         associate (these => coupled(i))
            members = pack([(k, k=1, size(set))], set == i)
            these%mode = [([(j, j=last(members(k) - 1) + 1, last(members(k)))], k=1, size(members))]
            these%radiator = get_merged(radiator, members)
            these%drive = get_integrals(get_merged(struck, members), struck, part%struck)/part%area
            these%mixing%block = mixing%block(members)
            these%velocity = get_integrals(get_merged(bearing, members), bearing, overlap_type())
            these%above = these%velocity
            if (allocated(part%bearing%x)) these%above = get_integrals(get_merged(bearing, members), bearing, &
               part%bearing)
            these%is_orthogonal = are_orthogonal(these%drive) .and. is_identity(these%mixing)
         end associate
      end do
   end function get_coupled_modes

   !> Whether shapes are orthogonal, from the means of their products.
   pure function are_orthogonal(mean) result(yes)
      real(wp), intent(in) :: mean(:, :)
      logical :: yes
      integer :: i

      yes = .true.
      associate (norm => sqrt(get_diagonal(mean)))
         do i = 2, size(norm)
            yes = yes .and. all(abs(mean(:i - 1, i)) <= max_overlap*norm(i)*norm(:i - 1))
         end do
      end associate
   end function are_orthogonal

   !> Diagonal of a matrix.
   pure function get_diagonal(matrix) result(diagonal)
      real(wp), intent(in) :: matrix(:, :)
      real(wp) :: diagonal(size(matrix, 1))
      integer :: i

      diagonal = [(matrix(i, i), i=1, size(diagonal))]
   end function get_diagonal

   !> Number of the set of each block: blocks with functions that are not orthogonal belong to one. Over the whole floor,
   !> each block has its own: [n_block].
   pure function get_sets(shapes, overlap) result(set)
      type(shapes_type), intent(in) :: shapes
      !> Integrals of products of all functions over the strike points.
      type(overlap_type), intent(in) :: overlap
      integer :: set(size(shapes%block))
      integer :: i, j, n, one, other

      set = [(i, i=1, size(set))]
      if (.not. allocated(overlap%x)) return
      do i = 2, size(set)
         do j = 1, i - 1
            if (set(i) == set(j)) cycle
            if (.not. are_coupled(overlap%x, shapes%x(shapes%block(i)%x), shapes%x(shapes%block(j)%x))) cycle
            if (.not. are_coupled(overlap%y, shapes%y(shapes%block(i)%y), shapes%y(shapes%block(j)%y))) cycle
            one = min(set(i), set(j))
            other = max(set(i), set(j))
            where (set == other) set = one
         end do
      end do
      ! Numbers without gaps.
      n = 0
      do i = 1, size(set)
         if (set(i) /= i) cycle
         n = n + 1
         where (set == i) set = -n
      end do
      set = -set
   end function get_sets

   !> Whether some functions of two lists are not orthogonal.
   pure function are_coupled(overlap, first, second) result(yes)
      !> Integrals of products of all functions.
      real(wp), intent(in) :: overlap(:, :)
      !> Numbers of the functions.
      integer, intent(in) :: first(:), second(:)
      logical :: yes

      yes = any(abs(overlap(first, second)) > rounding)
   end function are_coupled

end module thud_coupled_modes
