!> Modes of plates, block after block, and their shapes: sums of products of functions of x and of y.
!>
!> Modes of plates whose parts have different losses are sums of the modes without losses. With real modes of unit mass,
!> stiffness and losses are the matrix A = Omega**2 + i D, where D has terms off the diagonal: a layer transmits force by its
!> losses, too. A = W diag(pole) transpose(W) with transpose(W) W = 1, and the response to forces f at an angular frequency
!> omega is W (pole - omega**2)**(-1) transpose(W) f.
module thud_modes
   use thud_function_set, only: function_set_type, get_functions
   use thud_kinds, only: wp
   use thud_lapack, only: zgeev
   use thud_matrix_product, only: get_product, get_transposed_product
   implicit none (type, external)
   private

   public :: are_mixed, diagonalize, get_integrals, get_merged_shape, get_mixed, get_mode_sums, get_mode_values
   public :: get_some_modes
   public :: mode_block_type, modes_type, overlap_type, product_type, shape_type

   !> Relative shift of the squared frequencies that separates equal poles; for two equal poles with one shape W does not
   !> exist.
   real(wp), parameter :: separation = 1.0e-9_wp

   !> Functions of x and y whose products make up a displacement or a rotation.
   type :: product_type
      type(function_set_type) :: x, y
      !> The displacement has no mass; it follows the others statically.
      logical :: is_static = .false.
   end type product_type

   !> One displacement in some modes.
   type :: shape_type
      !> Indices of the functions of x and y: [n_x], [n_y].
      integer, allocatable :: x(:), y(:)
      !> Coefficients of their products, x first: [n_x*n_y, n_mode].
      real(wp), allocatable :: coefficient(:, :)
   end type shape_type

   !> Modes of a block, normalized to a modal mass of 1 kg.
   type :: mode_block_type
      !> Angular frequencies, ascending, rad/s, loss factors, and fractions of the energy in the bearing plate: [n_mode].
      real(wp), allocatable :: omega(:), loss_factor(:), bearing_share(:)
      !> Stiffness times loss factor, and stiffness of the bearing plate, rad2/s2, of the lower modes: [n, n]; not allocated
      !> if all parts have one loss factor, and if all belong to the bearing plate.
      real(wp), allocatable :: damping(:, :), bearing(:, :)
      !> Squared angular frequencies with their losses, rad2/s2, of modes with losses as sums of these modes, and the matrix
      !> W of the sums: [n_mode], [n_mode, n_mode]; not allocated if the modes remain as they are.
      complex(wp), allocatable :: pole(:), mixing(:, :)
      !> Shapes of the displacements; not allocated for static ones: [n_displacement].
      type(shape_type), allocatable :: shape(:)
   end type mode_block_type

   !> Modes of a system, block after block.
   type :: modes_type
      type(product_type), allocatable :: displacement(:)
      type(mode_block_type), allocatable :: block(:)
   end type modes_type

   !> Integrals over an area of products of functions of x and of those of y: [n_x, n_x], [n_y, n_y]; not allocated for the
   !> whole plate, over which functions are orthonormal.
   type :: overlap_type
      real(wp), allocatable :: x(:, :), y(:, :)
   end type overlap_type

contains

   !> Some of the modes, in the same order.
   pure function get_some_modes(modes, is_kept) result(some)
      type(modes_type), intent(in) :: modes
      !> Whether a mode is one of them: [n_mode].
      logical, intent(in) :: is_kept(:)
      type(modes_type) :: some
      integer, allocatable :: kept(:)
      integer :: last(0:size(modes%block))
      integer :: i, j, k, n

      last(0) = 0
      do i = 1, size(modes%block)
         last(i) = last(i - 1) + size(modes%block(i)%omega)
      end do
      some%displacement = modes%displacement
      allocate (some%block(count([(any(is_kept(last(i - 1) + 1:last(i))), i=1, size(modes%block))])))
      n = 0
      do i = 1, size(modes%block)
         kept = pack([(k, k=1, last(i) - last(i - 1))], is_kept(last(i - 1) + 1:last(i)))
         if (size(kept) == 0) cycle
         n = n + 1
         associate (block => modes%block(i), part => some%block(n))
            part%omega = block%omega(kept)
            part%loss_factor = block%loss_factor(kept)
            part%bearing_share = block%bearing_share(kept)
            if (allocated(block%pole)) part%pole = block%pole(kept)
            if (allocated(block%mixing)) part%mixing = block%mixing(kept, kept)
            allocate (part%shape(size(block%shape)))
            do j = 1, size(block%shape)
               part%shape(j)%x = block%shape(j)%x
               part%shape(j)%y = block%shape(j)%y
               if (allocated(block%shape(j)%coefficient)) part%shape(j)%coefficient = block%shape(j)%coefficient(:, kept)
            end do
         end associate
      end do
   end function get_some_modes

   !> Values of a displacement of modes at points, 1/sqrt(kg): [n_mode, n_point].
   function get_mode_values(modes, displacement, x, y) result(value)
      type(modes_type), intent(in) :: modes
      !> Index of the displacement.
      integer, intent(in) :: displacement
      !> Coordinates of the points, m: [n_point].
      real(wp), intent(in) :: x(:), y(:)
      real(wp), allocatable :: value(:, :)

      associate (set => modes%displacement(displacement))
         value = get_mode_sums(modes, displacement, get_functions(set%x, x, 0), get_functions(set%y, y, 0))
      end associate
   end function get_mode_values

   !> Sums of products of values of the functions of x and y, with the coefficients of modes: [n_mode, n_value].
   function get_mode_sums(modes, displacement, along, across) result(sums)
      type(modes_type), intent(in) :: modes
      !> Index of the displacement.
      integer, intent(in) :: displacement
      !> Values of the functions of x and of those of y: [n_value, n_function].
      real(wp), intent(in) :: along(:, :), across(:, :)
      real(wp), allocatable :: sums(:, :)
      real(wp), allocatable :: product(:, :)
      integer :: i, j, k, l, n

      allocate (sums(sum([(size(modes%block(i)%omega), i=1, size(modes%block))]), size(along, 1)))
      n = 0
      do i = 1, size(modes%block)
         associate (shape => modes%block(i)%shape(displacement), n_mode => size(modes%block(i)%omega))
            allocate (product(size(shape%x)*size(shape%y), size(along, 1)))
            do j = 1, size(along, 1)
               do k = 1, size(shape%y)
                  do l = 1, size(shape%x)
                     product((k - 1)*size(shape%x) + l, j) = along(j, shape%x(l))*across(j, shape%y(k))
                  end do
               end do
            end do
            sums(n + 1:n + n_mode, :) = get_transposed_product(shape%coefficient, product)
            deallocate (product)
            n = n + n_mode
         end associate
      end do
   end function get_mode_sums

   !> A displacement in the modes of several blocks.
   pure function get_merged_shape(modes, displacement, members) result(merged)
      type(modes_type), intent(in) :: modes
      !> Index of the displacement.
      integer, intent(in) :: displacement
      !> Indices of the blocks.
      integer, intent(in) :: members(:)
      type(shape_type) :: merged
      integer, allocatable :: at_x(:), at_y(:)
      integer :: i, k, l, n

      if (size(members) == 1) then
         merged = modes%block(members(1))%shape(displacement)
         return
      end if
      associate (set => modes%displacement(displacement))
         allocate (at_x(set%x%count), at_y(set%y%count), source=0)
      end associate
      n = 0
      do i = 1, size(members)
         associate (shape => modes%block(members(i))%shape(displacement))
            at_x(shape%x) = 1
            at_y(shape%y) = 1
            n = n + size(shape%coefficient, 2)
         end associate
      end do
      merged%x = pack([(k, k=1, size(at_x))], at_x == 1)
      merged%y = pack([(k, k=1, size(at_y))], at_y == 1)
      ! Positions of the functions among those of the merged shape.
      at_x(merged%x) = [(k, k=1, size(merged%x))]
      at_y(merged%y) = [(k, k=1, size(merged%y))]
      allocate (merged%coefficient(size(merged%x)*size(merged%y), n), source=0.0_wp)
      n = 0
      do i = 1, size(members)
         associate (shape => modes%block(members(i))%shape(displacement))
            associate (n_mode => size(shape%coefficient, 2), at => [((at_x(shape%x(l)) + (at_y(shape%y(k)) - 1) &
               *size(merged%x), l=1, size(shape%x)), k=1, size(shape%y))])
               merged%coefficient(at, n + 1:n + n_mode) = shape%coefficient
               n = n + n_mode
            end associate
         end associate
      end do
   end function get_merged_shape

   !> Integrals over an area of products of the shapes of modes, m2/kg: [n_mode, n_mode].
   pure function get_integrals(shape, overlap) result(integral)
      type(shape_type), intent(in) :: shape
      !> Integrals of products of all functions over the area.
      type(overlap_type), intent(in) :: overlap
      real(wp) :: integral(size(shape%coefficient, 2), size(shape%coefficient, 2))
      real(wp) :: weighted(size(shape%coefficient, 1), size(shape%coefficient, 2))
      integer :: i

      weighted = shape%coefficient
      if (allocated(overlap%x)) then
         associate (n_x => size(shape%x), n_y => size(shape%y))
            do i = 1, size(weighted, 2)
               weighted(:, i) = reshape(get_product(get_product(overlap%x(shape%x, shape%x), &
                  reshape(weighted(:, i), [n_x, n_y])), overlap%y(shape%y, shape%y)), [n_x*n_y])
            end do
         end associate
      end if
      integral = get_transposed_product(shape%coefficient, weighted)
   end function get_integrals

   !> Diagonalizes a complex symmetric matrix.
   subroutine diagonalize(matrix, pole, vectors, failed)
      !> The matrix: [n, n].
      complex(wp), intent(in) :: matrix(:, :)
      !> The poles, by their real parts: [n].
      complex(wp), intent(out) :: pole(:)
      !> The matrix W: [n, n].
      complex(wp), intent(out) :: vectors(:, :)
      !> The iteration did not converge.
      logical, intent(out) :: failed
      complex(wp) :: separated(size(pole), size(pole)), none(1, 1), work(33*size(pole))
      real(wp) :: real_work(2*size(pole))
      integer :: i, j, n, info

      n = size(pole)
      separated = matrix
      do i = 1, n
         separated(i, i) = matrix(i, i)*(1 + separation*i/n)
      end do
      call zgeev('N', 'V', n, separated, n, pole, none, 1, vectors, n, work, size(work), real_work, info)
      failed = info /= 0
      if (failed) return
      ! In the order of the modes, which ascends.
      do i = 1, n
         j = i - 1 + minloc(pole(i:)%re, dim=1)
         pole([i, j]) = pole([j, i])
         vectors(:, [i, j]) = vectors(:, [j, i])
         vectors(:, i) = vectors(:, i)/sqrt(sum(vectors(:, i)**2))
      end do
   end subroutine diagonalize

   !> Whether losses mix some modes.
   pure function are_mixed(blocks) result(yes)
      type(mode_block_type), intent(in) :: blocks(:)
      logical :: yes
      integer :: i

      yes = any([(allocated(blocks(i)%mixing), i=1, size(blocks))])
   end function are_mixed

   !> W or its transpose times a matrix: [n_mode, n].
   pure function get_mixed(blocks, values, is_transposed) result(mixed)
      type(mode_block_type), intent(in) :: blocks(:)
      complex(wp), intent(in) :: values(:, :)
      logical, intent(in) :: is_transposed
      complex(wp) :: mixed(size(values, 1), size(values, 2))
      integer :: i, last, n

      mixed = values
      last = 0
      do i = 1, size(blocks)
         n = last
         last = n + size(blocks(i)%omega)
         if (.not. allocated(blocks(i)%mixing)) cycle
         if (is_transposed) mixed(n + 1:last, :) = matmul(transpose(blocks(i)%mixing), values(n + 1:last, :))
         if (.not. is_transposed) mixed(n + 1:last, :) = matmul(blocks(i)%mixing, values(n + 1:last, :))
      end do
   end function get_mixed

end module thud_modes
