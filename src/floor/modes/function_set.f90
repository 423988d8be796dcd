!> Orthonormal functions of one coordinate, whose products are the shapes in which a plate moves.
module thud_function_set
   use thud_constants, only: pi
   use thud_kinds, only: wp
   use thud_lapack, only: dgetf2, dgetrs, dposv
   use thud_legendre, only: get_gauss_legendre, get_legendre
   use thud_matrix_product, only: get_transposed_product
   implicit none (type, external)
   private

   public :: cosines, function_set_type, get_functions, get_highest_wavenumber
   public :: get_overlap, get_quadrature, new_polynomials, new_splines, point_values, sines

   !> Kinds of functions: sqrt(2/length) sin(i pi x/length) and cos(i pi x/length), i = 1 to count, the deflections and
   !> rotations of simply supported plates, polynomials, splines, and values at points, which have no other values.
   integer, parameter :: sines = 1, cosines = 2, polynomials = 3, splines = 4, point_values = 5

   !> Minimum number of nodes of a spline.
   integer, parameter, public :: min_nodes = 4

   !> Functions that are orthonormal on [0, length].
   type :: function_set_type
      !> Kind of the functions.
      integer :: kind = sines
      !> Length of the interval, m.
      real(wp) :: length = 1.0_wp
      !> Number of functions.
      integer :: count = 0
      !> Polynomials as sums of orthonormal Legendre polynomials: [0:degree, count]. Splines as sums of those that are 1 at
      !> one node and 0 at the others: [count, count]. Values at points: [count, count].
      real(wp), allocatable :: coefficient(:, :)
      !> Nodes of splines, m: [count], and second derivatives there of the splines that are 1 at one node, 1/m2:
      !> [count, count].
      real(wp), allocatable :: node(:), curvature(:, :)
      !> Wavenumber up to which polynomials that are modes of a beam are complete, 1/m.
      real(wp) :: complete = 0.0_wp
   end type function_set_type

contains

   !> Wavenumber up to which sines, or modes of a beam, are complete, 1/m.
   elemental function get_highest_wavenumber(set) result(wavenumber)
      type(function_set_type), intent(in) :: set
      real(wp) :: wavenumber

      wavenumber = set%complete
      if (set%kind == sines) wavenumber = (set%count + 0.5_wp)*pi/set%length
   end function get_highest_wavenumber

   !> Polynomials up to a degree that fulfill constraints: at each position, the derivative of the given order is 0.
   !>
   !> A Householder reflection per constraint maps it to one function, which is removed. Constraints at mirrored positions
   !> are replaced by their sum and difference, so that the functions remain even or odd.
   pure function new_polynomials(length, degree, position, order) result(set)
      !> Length, m.
      real(wp), intent(in) :: length
      !> Degree of the polynomials.
      integer, intent(in) :: degree
      !> Positions of the constraints, m, and orders of derivatives (0 or 1): [n_constraint].
      real(wp), intent(in) :: position(:)
      integer, intent(in) :: order(:)
      type(function_set_type) :: set
      real(wp), allocatable :: constraint(:, :), row(:), reflection(:)
      integer :: i, j, pivot

      set = function_set_type(polynomials, length, degree + 1)
      allocate (set%coefficient(0:degree, degree + 1), source=0.0_wp)
      do i = 0, degree
         set%coefficient(i, i + 1) = 1.0_wp
      end do
      constraint = get_constraints(set, position, order)
      do i = 1, size(constraint, 1)
         row = matmul(constraint(i, :), set%coefficient)
         do pivot = 1, set%count
            if (abs(row(pivot)) > 1.0e-9_wp*maxval(abs(row))) exit
         end do
         reflection = row
         reflection(pivot) = row(pivot) + sign(norm2(row), row(pivot))
         set%coefficient = set%coefficient - spread(matmul(set%coefficient, reflection), 2, set%count) &
            *spread(reflection, 1, degree + 1)*2/dot_product(reflection, reflection)
         set%count = set%count - 1
         set%coefficient = set%coefficient(:, [(j, j=1, pivot - 1), (j, j=pivot + 1, set%count + 1)])
      end do
   end function new_polynomials

   !> Constraints as rows over the functions: [n_constraint, count].
   pure function get_constraints(set, position, order) result(row)
      !> The functions without constraints.
      type(function_set_type), intent(in) :: set
      !> Positions, m, and orders of derivatives: [n_constraint].
      real(wp), intent(in) :: position(:)
      integer, intent(in) :: order(:)
      real(wp), allocatable :: row(:, :)
      logical :: mirrored(size(position))
      integer :: i, j

      allocate (row(size(position), set%count))
      do i = 1, size(position)
         row(i, :) = reshape(get_functions(set, position(i:i), order(i)), [set%count])
      end do
      mirrored = .false.
      do i = 1, size(position)
         do j = i + 1, size(position)
            if (order(i) /= order(j) .or. mirrored(i) .or. mirrored(j)) cycle
            if (abs(position(i) + position(j) - set%length) > 1.0e-9_wp*set%length) cycle
            row([i, j], :) = reshape([row(i, :) + row(j, :), row(i, :) - row(j, :)], [2, set%count], order=[2, 1])
            mirrored([i, j]) = .true.
         end do
      end do
      ! Rounding would mix even and odd functions.
      where (abs(row) < 1.0e-12_wp*spread(maxval(abs(row), dim=2), 2, set%count)) row = 0.0_wp
   end function get_constraints

   !> Cubic splines through nodes, not-a-knot at both ends: they interpolate a function that is sampled at the nodes,
   !> whatever it does at the ends.
   pure subroutine new_splines(node, set, transformation)
      !> Nodes, ascending, from 0 to the length, m: [at least `min_nodes`].
      real(wp), intent(in) :: node(:)
      type(function_set_type), intent(out) :: set
      !> Turns values at the nodes into coefficients of the functions, sqrt(m): [count, count].
      real(wp), allocatable, intent(out) :: transformation(:, :)
      real(wp), allocatable :: gram(:, :), point(:), weight(:), value(:, :)
      integer :: i, n, info

      n = size(node)
      set = function_set_type(splines, node(n), n)
      set%node = node
      set%curvature = get_curvature(node)
      allocate (set%coefficient(n, n), gram(n, n), source=0.0_wp)
      do i = 1, n
         set%coefficient(i, i) = 1.0_wp
      end do
      do i = 1, n - 1
         ! Four points integrate products of two cubic functions exactly.
         call get_quadrature(4, node(i), node(i + 1), point, weight)
         value = get_functions(set, point, 0)
         gram = gram + matmul(transpose(value), spread(weight, 2, n)*value)
      end do
      ! With the Cholesky factor U of the integrals of products, the functions inverse(U**T) N are orthonormal.
      call dposv('U', n, n, gram, n, set%coefficient, n, info)
      do i = 1, n - 1
         gram(i + 1:, i) = 0.0_wp
      end do
      set%coefficient = matmul(set%coefficient, transpose(gram))
      call move_alloc(gram, transformation)
   end subroutine new_splines

   !> Second derivatives at the nodes of the splines that are 1 at one node, 1/m2: [n, n].
   pure function get_curvature(node) result(curvature)
      real(wp), intent(in) :: node(:)
      real(wp) :: curvature(size(node), size(node))
      real(wp) :: system(size(node), size(node))
      integer :: pivot(size(node))
      integer :: i, n, info

      n = size(node)
      system = 0.0_wp
      curvature = 0.0_wp
      do i = 2, n - 1
         associate (before => node(i) - node(i - 1), after => node(i + 1) - node(i))
            system(i, i - 1:i + 1) = [before, 2*(before + after), after]
            curvature(i, i - 1:i + 1) = 6*[1/before, -1/before - 1/after, 1/after]
         end associate
      end do
      ! The third derivative is continuous at the second and at the last but one node.
      system(1, :3) = [node(3) - node(2), node(1) - node(3), node(2) - node(1)]
      system(n, n - 2:) = [node(n) - node(n - 1), node(n - 2) - node(n), node(n - 1) - node(n - 2)]
      call dgetf2(n, n, system, n, pivot, info)
      call dgetrs('N', n, n, system, n, pivot, curvature, n, info)
   end function get_curvature

   !> Splines or their derivatives at positions: [n_position, count].
   pure function get_spline_values(set, position, order) result(value)
      type(function_set_type), intent(in) :: set
      real(wp), intent(in) :: position(:)
      integer, intent(in) :: order
      real(wp) :: value(size(position), set%count)
      real(wp) :: row(set%count), part(2), bend(2)
      integer :: i, k

      do i = 1, size(position)
         k = min(max(count(set%node <= position(i)), 1), set%count - 1)
         associate (h => set%node(k + 1) - set%node(k))
            part(2) = (position(i) - set%node(k))/h
            part(1) = 1 - part(2)
            bend = h**2/6*(part**3 - part)
            if (order == 1) bend = h/6*(3*part**2 - 1)*[-1, 1]
            if (order == 2) bend = part
            if (order == 1) part = [-1, 1]/h
            if (order == 2) part = 0.0_wp
         end associate
         row = matmul(bend, set%curvature(k:k + 1, :))
         row(k:k + 1) = row(k:k + 1) + part
         value(i, :) = matmul(row, set%coefficient)
      end do
   end function get_spline_values

   !> The functions or their derivatives at positions: [n_position, count].
   pure function get_functions(set, position, order) result(value)
      type(function_set_type), intent(in) :: set
      !> Positions, m: [n_position].
      real(wp), intent(in) :: position(:)
      !> Order of the derivative: 0 to 2.
      integer, intent(in) :: order
      !> Values, 1/m**(order + 1/2).
      real(wp) :: value(size(position), set%count)
      real(wp), allocatable :: legendre(:, :, :)
      integer :: i, j

      if (set%kind == point_values) then
         value = set%coefficient
         return
      end if
      if (set%kind == splines) then
         value = get_spline_values(set, position, order)
         return
      end if
      if (set%kind == polynomials) then
         allocate (legendre(0:size(set%coefficient, 1) - 1, size(position), 0:2))
         do i = 1, size(position)
            call get_legendre(2*position(i)/set%length - 1, legendre(:, i, 0), legendre(:, i, 1), legendre(:, i, 2))
         end do
         do j = 0, ubound(legendre, 1)
            legendre(j, :, order) = (2/set%length)**order*sqrt((2*j + 1)/set%length)*legendre(j, :, order)
         end do
         value = get_transposed_product(legendre(:, :, order), set%coefficient)
         return
      end if
      do j = 1, set%count
         associate (k => j*pi/set%length)
            ! A derivative of a sine or cosine advances its phase by a quarter of a turn.
            value(:, j) = sqrt(2/set%length)*k**order*sin(k*position + merge(order, order + 1, set%kind == sines)*pi/2)
         end associate
      end do
   end function get_functions

   !> Points and weights of a quadrature on an interval that integrates products of two functions.
   pure subroutine get_quadrature(count, from, to, point, weight)
      !> Number of points; the number of the functions plus 20 integrates their products to rounding.
      integer, intent(in) :: count
      !> Ends of the interval, m.
      real(wp), intent(in) :: from, to
      !> Points and weights, m: [count].
      real(wp), allocatable, intent(out) :: point(:), weight(:)

      allocate (point(count), weight(count))
      call get_gauss_legendre(point, weight)
      point = from + (to - from)*(point + 1)/2
      weight = weight*(to - from)/2
   end subroutine get_quadrature

   !> Integrals of products of derivatives of two sets over an interval: [first%count, second%count].
   pure function get_overlap(first, first_order, second, second_order, from, to) result(overlap)
      type(function_set_type), intent(in) :: first, second
      !> Orders of the derivatives.
      integer, intent(in) :: first_order, second_order
      !> Ends of the interval, m (default: the whole).
      real(wp), intent(in), optional :: from, to
      !> The integrals, 1/m**(first_order + second_order).
      real(wp) :: overlap(first%count, second%count)
      real(wp), allocatable :: point(:), weight(:)
      real(wp) :: ends(2)
      integer :: i, n, phase

      phase = first_order - second_order + merge(0, 1, first%kind == sines) - merge(0, 1, second%kind == sines)
      if (all([first%kind, second%kind] < polynomials) .and. mod(phase, 2) == 0 .and. .not. present(from)) then
         overlap = 0.0_wp
         do i = 1, min(first%count, second%count)
            overlap(i, i) = merge(1, -1, mod(phase, 4) == 0)*(i*pi/first%length)**(first_order + second_order)
         end do
         return
      end if
      ends = [0.0_wp, first%length]
      if (present(from)) ends(1) = from
      if (present(to)) ends(2) = to
      ! A polynomial may be of a higher degree than there are functions.
      n = first%count + second%count + 20
      if (first%kind == polynomials) n = n + max(size(first%coefficient, 1) - first%count, 0)
      if (second%kind == polynomials) n = n + max(size(second%coefficient, 1) - second%count, 0)
      call get_quadrature(n, ends(1), ends(2), point, weight)
      associate (left => get_functions(first, point, first_order), right => get_functions(second, point, second_order))
         overlap = get_transposed_product(left*spread(weight, 2, first%count), right)
      end associate
   end function get_overlap

end module thud_function_set
