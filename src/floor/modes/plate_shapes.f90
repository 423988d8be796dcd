!> Shapes of a plate in the modes of a floor, as sums of products of functions of x and of y.
module thud_plate_shapes
   use thud_floor_modes, only: floor_modes_type
   use thud_kinds, only: wp
   use thud_matrix_product, only: get_product, get_transposed_product
   use thud_ritz_system, only: get_ranges
   implicit none (type, external)
   private

   public :: block_shapes_type, overlap_type, shapes_type
   public :: get_coefficients, get_integrals, get_merged, get_shapes, get_some_coefficients, get_squares, get_weighted

   !> Integrals over an area of products of functions of x and of those of y: [n_x, n_x], [n_y, n_y].
   type :: overlap_type
      real(wp), allocatable :: x(:, :), y(:, :)
   end type overlap_type

   !> Shapes of some modes in a block.
   type :: block_shapes_type
      !> Positions of the functions in the lists of all shapes: [n_x], [n_y].
      integer, allocatable :: x(:), y(:)
      !> Coefficients of their products, x first: [n_x*n_y, n_mode].
      real(wp), allocatable :: coefficient(:, :)
   end type block_shapes_type

   !> Shapes of the radiating plate in some modes, and numbers of all functions of x and of y in them.
   type :: shapes_type
      integer, allocatable :: x(:), y(:)
      type(block_shapes_type), allocatable :: block(:)
   end type shapes_type

contains

   !> Shapes of a plate in some modes.
   pure function get_shapes(modes, plate, kept) result(shapes)
      type(floor_modes_type), intent(in) :: modes
      !> Number of the plate.
      integer, intent(in) :: plate
      !> Numbers of the modes, block after block: [n_mode].
      integer, intent(in) :: kept(:)
      type(shapes_type) :: shapes
      integer :: range(2, size(modes%modes%block))
      integer, allocatable :: position_x(:), position_y(:)
      integer :: i, n

      range = get_ranges(modes%modes, kept)
      associate (displacement => modes%modes%displacement(plate))
         allocate (position_x(displacement%x%count), position_y(displacement%y%count), source=0)
      end associate
      do i = 1, size(range, 2)
         if (range(2, i) == 0) cycle
         associate (shape => modes%modes%block(i)%shape(plate))
            position_x(shape%x) = 1
            position_y(shape%y) = 1
         end associate
      end do
      call number_marked(position_x, shapes%x)
      call number_marked(position_y, shapes%y)
      allocate (shapes%block(count(range(2, :) > 0)))
      n = 0
      do i = 1, size(range, 2)
         if (range(2, i) == 0) cycle
         n = n + 1
         associate (shape => modes%modes%block(i)%shape(plate))
            shapes%block(n) = block_shapes_type(position_x(shape%x), position_y(shape%y), &
               shape%coefficient(:, range(1, i):range(2, i)))
         end associate
      end do
   end function get_shapes

   !> Numbers of marked functions, and the position of each among them in place of its mark.
   pure subroutine number_marked(position, number)
      !> 1 for a marked function, else 0; then the positions: [n_function].
      integer, intent(inout) :: position(:)
      !> The numbers: [n_marked].
      integer, allocatable, intent(out) :: number(:)
      integer :: k

      number = pack([(k, k=1, size(position))], position == 1)
      position(number) = [(k, k=1, size(number))]
   end subroutine number_marked

   !> Shapes of several blocks as those of one.
   pure function get_merged(shapes, members) result(merged)
      type(shapes_type), intent(in) :: shapes
      !> Numbers of the blocks.
      integer, intent(in) :: members(:)
      type(block_shapes_type) :: merged
      integer, allocatable :: at_x(:), at_y(:)
      integer :: i, n

      if (size(members) == 1) then
         merged = shapes%block(members(1))
         return
      end if
      allocate (at_x(size(shapes%x)), at_y(size(shapes%y)), source=0)
      n = 0
      do i = 1, size(members)
         associate (block => shapes%block(members(i)))
            at_x(block%x) = 1
            at_y(block%y) = 1
            n = n + size(block%coefficient, 2)
         end associate
      end do
      call number_marked(at_x, merged%x)
      call number_marked(at_y, merged%y)
      allocate (merged%coefficient(size(merged%x)*size(merged%y), n), source=0.0_wp)
      n = 0
      do i = 1, size(members)
         associate (block => shapes%block(members(i)), n_mode => size(shapes%block(members(i))%coefficient, 2))
            merged%coefficient(get_positions(at_x(block%x), at_y(block%y), size(merged%x)), n + 1:n + n_mode) = &
               block%coefficient
            n = n + n_mode
         end associate
      end do
   end function get_merged

   !> Coefficients of the functions of all shapes, those of x first: [n_x*n_y, n_column].
   pure subroutine get_coefficients(shapes, amplitude, coefficient)
      type(shapes_type), intent(in) :: shapes
      !> Amplitudes of the modes: [n_mode, n_column].
      real(wp), intent(in) :: amplitude(:, :)
      real(wp), allocatable, intent(out) :: coefficient(:, :)
      integer :: i, n

      allocate (coefficient(size(shapes%x)*size(shapes%y), size(amplitude, 2)), source=0.0_wp)
      n = 0
      do i = 1, size(shapes%block)
         associate (block => shapes%block(i), n_mode => size(shapes%block(i)%coefficient, 2))
            coefficient(get_positions(block%x, block%y, size(shapes%x)), :) = &
               get_product(block%coefficient, amplitude(n + 1:n + n_mode, :))
            n = n + n_mode
         end associate
      end do
   end subroutine get_coefficients

   !> Coefficients of some of the functions: [n_in_x, n_in_y*n_column].
   pure function get_some_coefficients(coefficient, n_x, in_x, in_y) result(some)
      !> Coefficients of the products, x first: [n_x*n_y, n_column].
      real(wp), intent(in) :: coefficient(:, :)
      !> Number of the functions of x.
      integer, intent(in) :: n_x
      !> Positions of the functions in the lists of x and of y.
      integer, intent(in) :: in_x(:), in_y(:)
      real(wp) :: some(size(in_x), size(in_y)*size(coefficient, 2))

      some = reshape(coefficient(get_positions(in_x, in_y, n_x), :), shape(some))
   end function get_some_coefficients

   !> Positions of the products of some functions among those of all, x first: [n_x*n_y].
   pure function get_positions(x, y, n_x) result(position)
      !> Numbers of the functions of x and of y, and number of all functions of x.
      integer, intent(in) :: x(:), y(:)
      integer, intent(in) :: n_x
      integer :: position(size(x)*size(y))
      integer :: k, l

      position = [((x(l) + (y(k) - 1)*n_x, l=1, size(x)), k=1, size(y))]
   end function get_positions

   !> Integrals of the squared shapes over the plate, m2/kg: [n_mode].
   pure function get_squares(shapes) result(square)
      type(shapes_type), intent(in) :: shapes
      real(wp), allocatable :: square(:)
      integer :: i

      square = [(sum(shapes%block(i)%coefficient**2, dim=1), i=1, size(shapes%block))]
   end function get_squares

   !> Integrals of products of shapes over an area, m2/kg: [n_mode, n_mode].
   pure function get_integrals(block, shapes, overlap) result(integral)
      type(block_shapes_type), intent(in) :: block
      !> The shapes to whose functions the block refers.
      type(shapes_type), intent(in) :: shapes
      !> Integrals of products of functions over the area, for the whole floor not allocated.
      type(overlap_type), intent(in) :: overlap
      real(wp), allocatable :: integral(:, :)

      integral = get_transposed_product(block%coefficient, get_weighted(block%coefficient, shapes%x(block%x), &
         shapes%y(block%y), overlap))
   end function get_integrals

   !> Coefficients of shapes times the integrals of products of their functions: [n_x*n_y, n_column].
   pure function get_weighted(coefficient, x, y, overlap) result(weighted)
      !> Coefficients of the products, x first: [n_x*n_y, n_column].
      real(wp), intent(in) :: coefficient(:, :)
      !> Numbers of the functions of x and y.
      integer, intent(in) :: x(:), y(:)
      type(overlap_type), intent(in) :: overlap
      real(wp), allocatable :: weighted(:, :)
      integer :: i

      weighted = coefficient
      if (.not. allocated(overlap%x)) return
      do i = 1, size(coefficient, 2)
         weighted(:, i) = reshape(get_product(get_product(overlap%x(x, x), reshape(coefficient(:, i), [size(x), size(y)])), &
            overlap%y(y, y)), [size(x)*size(y)])
      end do
   end function get_weighted

end module thud_plate_shapes
