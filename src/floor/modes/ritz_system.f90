!> Modes by the Ritz method: displacements are sums of products of functions of x and of y, and an energy is a product of two
!> derivatives, integrated over x and y: a product of a matrix in x and one in y.
!>
!> The matrices couple only some functions (of the same number for simply supported plates, of the same symmetry for
!> symmetric ones). The system falls into blocks of functions that are coupled, which are solved one by one.
module thud_ritz_system
   use thud_function_set, only: function_set_type, get_functions, get_overlap
   use thud_kinds, only: wp
   use thud_lapack, only: dposv, dsygvd
   use thud_matrix_product, only: get_product, get_transposed_product
   use thud_modes, only: mode_block_type, modes_type, product_type
   implicit none (type, external)
   private

   public :: add_energies, add_term, energy_type, ritz_system_type, solve_ritz_system, term_type

   !> A matrix entry below this fraction of the largest one in its row or column is rounding.
   real(wp), parameter :: rounding = 1.0e-11_wp

   !> The integral of half the product of two derivatives. Between different displacements, the transposed product is
   !> included.
   type :: energy_type
      !> Factor of the product: the energy is in J.
      real(wp) :: factor = 0.0_wp
      !> Indices of the displacements.
      integer :: row = 0, column = 0
      !> Orders of their derivatives in x and y.
      integer :: row_order(2) = 0, column_order(2) = 0
      !> A kinetic energy, of velocities.
      logical :: is_mass = .false.
   end type energy_type

   !> A part of the energy: half the double sum of coefficients times x times y.
   type :: term_type
      !> Numbers of the displacements.
      integer :: row = 0, column = 0
      !> Matrices over their functions of x and y: [n_row, n_column].
      real(wp), allocatable :: x(:, :), y(:, :)
      !> Loss factor, of stiffnesses.
      real(wp) :: loss_factor = 0.0_wp
      !> The energy belongs to the bearing plate.
      logical :: in_bearing = .false.
   end type term_type

   !> Displacements and their energies.
   type :: ritz_system_type
      type(product_type), allocatable :: displacement(:)
      type(term_type), allocatable :: stiffness(:), mass(:)
      !> The stiffnesses that are added now belong to the bearing plate.
      logical :: is_bearing = .false.
   end type ritz_system_type

   !> Indices of the functions of one displacement in one group.
   type :: members_type
      integer, allocatable :: index(:)
   end type members_type

contains

   !> Adds energies that are integrated over x and y, or over one of them and summed over positions in the other one.
   subroutine add_energies(system, energies, loss_factor, direction, at)
      !> The system with its displacements.
      type(ritz_system_type), intent(inout) :: system
      type(energy_type), intent(in) :: energies(:)
      !> Loss factor of the stiffnesses.
      real(wp), intent(in) :: loss_factor
      !> Direction of the sum (1: x, 2: y; default: none), and positions, m.
      integer, intent(in), optional :: direction
      real(wp), intent(in), optional :: at(:)
      type(term_type) :: term
      integer :: i, summed

      summed = 0
      if (present(direction)) summed = direction
      do i = 1, size(energies)
         associate (e => energies(i))
            if (.not. abs(e%factor) > 0.0_wp) cycle
            term = term_type(e%row, e%column, loss_factor=loss_factor, in_bearing=system%is_bearing)
            associate (row => system%displacement(e%row), column => system%displacement(e%column))
               term%x = e%factor*get_products(row%x, e%row_order(1), column%x, e%column_order(1), 1)
               term%y = get_products(row%y, e%row_order(2), column%y, e%column_order(2), 2)
            end associate
            if (e%is_mass) call add_term(system%mass, term)
            if (.not. e%is_mass) call add_term(system%stiffness, term)
         end associate
      end do
   contains

      !> Integrals or sums of products of derivatives.
      function get_products(first, first_order, second, second_order, along) result(products)
         type(function_set_type), intent(in) :: first, second
         integer, intent(in) :: first_order, second_order
         !> Direction of the functions.
         integer, intent(in) :: along
         real(wp) :: products(first%count, second%count)

         if (along == summed) then
            products = matmul(transpose(get_functions(first, at, first_order)), get_functions(second, at, second_order))
         else
            products = get_overlap(first, first_order, second, second_order)
         end if
      end function get_products
   end subroutine add_energies

   !> Adds a term.
   subroutine add_term(terms, term)
      type(term_type), allocatable, intent(inout) :: terms(:)
      type(term_type), intent(in) :: term

      if (.not. allocated(terms)) allocate (terms(0))
      terms = [terms, term]
   end subroutine add_term

   !> Solves a system for all its modes.
   subroutine solve_ritz_system(system, modes, failed, lower_limit)
      type(ritz_system_type), intent(in) :: system
      type(modes_type), intent(out) :: modes
      !> A mass or the stiffness of a static displacement is not positive.
      logical, intent(out) :: failed
      !> Angular frequency of the highest of the lower modes, rad/s.
      real(wp), intent(in) :: lower_limit
      type(members_type), allocatable :: x(:, :), y(:, :)
      integer :: i, j, n

      failed = .false.
      x = get_members(get_groups(system, 1), system%displacement%x%count)
      y = get_members(get_groups(system, 2), system%displacement%y%count)
      allocate (modes%displacement, source=system%displacement)
      allocate (modes%block(count([((has_mass(x(:, i), y(:, j)), i=1, size(x, 2)), j=1, size(y, 2))])))
      n = 0
      do i = 1, size(x, 2)
         do j = 1, size(y, 2)
            if (.not. has_mass(x(:, i), y(:, j))) cycle
            n = n + 1
            call solve_block(system, x(:, i), y(:, j), modes%block(n), failed, lower_limit)
            if (failed) return
         end do
      end do
   contains

      !> Whether some products of functions have mass.
      pure function has_mass(x, y) result(yes)
         type(members_type), intent(in) :: x(:), y(:)
         logical :: yes
         integer :: i

         yes = any([(size(x(i)%index)*size(y(i)%index) > 0, i=1, size(x))] .and. .not. system%displacement%is_static)
      end function has_mass
   end subroutine solve_ritz_system

   !> Index of the group of each function of one coordinate, in the order of displacements and their functions. Functions of
   !> different groups are not coupled.
   function get_groups(system, direction) result(group)
      type(ritz_system_type), intent(in) :: system
      !> 1: functions of x, 2: of y.
      integer, intent(in) :: direction
      integer, allocatable :: group(:)
      integer, allocatable :: first(:), before(:)
      logical, allocatable :: is_coupled(:, :)
      integer :: i, k, n

      if (direction == 1) first = get_first(system%displacement%x%count)
      if (direction == 2) first = get_first(system%displacement%y%count)
      n = first(size(first)) - 1
      allocate (is_coupled(n, n), source=.false.)
      do i = 1, size(system%stiffness)
         call couple(system%stiffness(i))
      end do
      do i = 1, size(system%mass)
         call couple(system%mass(i))
      end do
      ! Each group takes the index of its first function; then without gaps.
      group = [(i, i=1, n)]
      do
         before = group
         do i = 1, n
            where (is_coupled(:, i)) group = min(group, group(i))
            group(i) = minval(group, mask=is_coupled(:, i))
         end do
         if (all(group == before)) exit
      end do
      before = group
      do i = 1, n
         group(i) = count([(before(k) == k, k=1, before(i))])
      end do
   contains

      !> Marks the functions that a term couples.
      subroutine couple(term)
         type(term_type), intent(in) :: term
         real(wp) :: matrix(merge(size(term%x, 1), size(term%y, 1), direction == 1), &
            merge(size(term%x, 2), size(term%y, 2), direction == 1))
         integer :: k, l

         if (direction == 1) matrix = abs(term%x)
         if (direction == 2) matrix = abs(term%y)
         associate (row_scale => maxval(matrix, dim=2), column_scale => maxval(matrix, dim=1))
            do l = 1, size(matrix, 2)
               do k = 1, size(matrix, 1)
                  if (.not. matrix(k, l) > rounding*max(row_scale(k), column_scale(l))) cycle
                  is_coupled(first(term%row) + k - 1, first(term%column) + l - 1) = .true.
                  is_coupled(first(term%column) + l - 1, first(term%row) + k - 1) = .true.
               end do
            end do
         end associate
      end subroutine couple
   end function get_groups

   !> Functions of each displacement in each group: [n_displacement, n_group].
   pure function get_members(group, count) result(members)
      !> Groups of the functions, in the order of displacements.
      integer, intent(in) :: group(:)
      !> Number of functions of each displacement.
      integer, intent(in) :: count(:)
      type(members_type) :: members(size(count), maxval(group))
      integer :: first(size(count) + 1)
      integer :: i, k, p

      first = get_first(count)
      do k = 1, size(members, 2)
         do p = 1, size(count)
            members(p, k)%index = pack([(i, i=1, count(p))], group(first(p):first(p + 1) - 1) == k)
         end do
      end do
   end function get_members

   !> First of the numbers of each part, and the one after the last: [size(count) + 1].
   pure function get_first(count) result(first)
      !> Sizes of the parts.
      integer, intent(in) :: count(:)
      integer :: first(size(count) + 1)
      integer :: i

      first(1) = 1
      do i = 1, size(count)
         first(i + 1) = first(i) + count(i)
      end do
   end function get_first

   !> Modes of the functions of one group in x and one in y.
   subroutine solve_block(system, x, y, block, failed, lower_limit)
      type(ritz_system_type), intent(in) :: system
      !> Functions of x and of y in the block: [n_displacement].
      type(members_type), intent(in) :: x(:), y(:)
      type(mode_block_type), intent(out) :: block
      logical, intent(out) :: failed
      !> Angular frequency of the highest of the lower modes, rad/s.
      real(wp), intent(in) :: lower_limit
      real(wp), allocatable :: stiffness(:, :), mass(:, :), omega(:), transformation(:, :)
      integer, allocatable :: first(:), dynamic(:), static(:)
      logical, allocatable :: follows(:)
      integer :: i, p, n

      failed = .false.
      associate (displacement => system%displacement)
         n = size(displacement)
         allocate (block%shape(n))
         do p = 1, n
            block%shape(p)%x = x(p)%index
            block%shape(p)%y = y(p)%index
         end do
         first = get_first([(size(block%shape(p)%x)*size(block%shape(p)%y), p=1, n)])
         follows = [(spread(displacement(p)%is_static, 1, first(p + 1) - first(p)), p=1, n)]
         static = pack([(i, i=1, size(follows))], follows)
         dynamic = pack([(i, i=1, size(follows))], .not. follows)
      end associate
      associate (terms => system%stiffness)
         call assemble(terms, spread(1.0_wp, 1, size(terms)), block, first, stiffness)
      end associate
      call assemble(system%mass, spread(1.0_wp, 1, size(system%mass)), block, first, mass)
      if (size(static) > 0) then
         call get_static_part(dynamic, static, stiffness, transformation, failed)
         if (failed) return
         ! The forces on the static coefficients vanish.
         stiffness = get_product(stiffness(dynamic, :), transformation)
         mass = get_condensed(mass)
      end if
      call get_eigenmodes(stiffness, mass, omega, failed)
      if (failed) return
      ! `stiffness` contains the shapes now. Without stiffness and losses, a mode moves as a rigid body.
      block%omega = omega
      associate (terms => system%stiffness)
         call get_part(terms%loss_factor, block%loss_factor, block%damping)
         call get_part(merge(1.0_wp, 0.0_wp, terms%in_bearing), block%bearing_share, block%bearing)
      end associate
      i = 0
      do p = 1, n
         if (system%displacement(p)%is_static) cycle
         associate (count => first(p + 1) - first(p))
            block%shape(p)%coefficient = stiffness(i + 1:i + count, :)
            i = i + count
         end associate
      end do
   contains

      !> Matrix of the dynamic coefficients from that of all.
      function get_condensed(matrix) result(condensed)
         real(wp), intent(in) :: matrix(:, :)
         real(wp) :: condensed(size(dynamic), size(dynamic))

         condensed = get_transposed_product(transformation, get_product(matrix, transformation))
      end function get_condensed

      !> Weighted sum of the stiffnesses.
      subroutine get_part(weight, share, part)
         !> Weights of the stiffnesses.
         real(wp), intent(in) :: weight(:)
         !> Its energy in each mode, over that of all stiffnesses: [n_mode].
         real(wp), allocatable, intent(out) :: share(:)
         !> The sum: [n, n]; not allocated if all weights are equal, or if there are no two modes to couple.
         real(wp), allocatable, intent(out) :: part(:, :)
         real(wp), allocatable :: matrix(:, :)
         integer :: n

         share = spread(weight(1), 1, size(omega))
         if (any(abs(weight - weight(1)) > 0.0_wp)) then
            call assemble(system%stiffness, weight, block, first, matrix)
            if (size(static) > 0) matrix = get_condensed(matrix)
            matrix = get_product(matrix, stiffness)
            share = sum(stiffness*matrix, dim=1)/max(omega**2, tiny(omega))
            n = count(omega < lower_limit)
            if (n > 1) part = get_transposed_product(stiffness(:, :n), matrix(:, :n))
         end if
         where (omega <= 0.0_wp) share = 0.0_wp
      end subroutine get_part
   end subroutine solve_block

   !> Matrix of a block.
   subroutine assemble(terms, weight, block, first, matrix)
      type(term_type), intent(in) :: terms(:)
      !> Factors of the terms.
      real(wp), intent(in) :: weight(:)
      type(mode_block_type), intent(in) :: block
      !> First coefficient of each displacement, and the one after the last.
      integer, intent(in) :: first(:)
      !> The matrix: [n, n].
      real(wp), allocatable, intent(out) :: matrix(:, :)
      real(wp), allocatable :: x(:, :)
      real(wp) :: factor
      integer :: i, j, k, l, at_row, at_column

      allocate (matrix(first(size(first)) - 1, first(size(first)) - 1), source=0.0_wp)
      do i = 1, size(terms)
         if (.not. abs(weight(i)) > 0.0_wp) cycle
         associate (row => block%shape(terms(i)%row), column => block%shape(terms(i)%column))
            x = terms(i)%x(row%x, column%x)
            do l = 1, size(column%y)
               do k = 1, size(row%y)
                  factor = weight(i)*terms(i)%y(row%y(k), column%y(l))
                  ! Many functions are orthogonal.
                  if (.not. abs(factor) > 0.0_wp) cycle
                  at_row = first(terms(i)%row) + (k - 1)*size(row%x)
                  do j = 1, size(column%x)
                     at_column = first(terms(i)%column) + (l - 1)*size(column%x) + j - 1
                     associate (entries => matrix(at_row:at_row + size(row%x) - 1, at_column))
                        entries = entries + factor*x(:, j)
                        if (terms(i)%row /= terms(i)%column) matrix(at_column, at_row:at_row + size(row%x) - 1) = entries
                     end associate
                  end do
               end do
            end do
         end associate
      end do
   end subroutine assemble

   !> All coefficients for those of the dynamic displacements: the static ones take the values of least energy.
   subroutine get_static_part(dynamic, static, stiffness, transformation, failed)
      !> Numbers of the coefficients.
      integer, intent(in) :: dynamic(:), static(:)
      !> Stiffness of all coefficients: [n, n].
      real(wp), intent(in) :: stiffness(:, :)
      !> All coefficients, one column for each dynamic one: [n, n_dynamic].
      real(wp), allocatable, intent(out) :: transformation(:, :)
      !> The stiffness of the static coefficients is not positive.
      logical, intent(out) :: failed
      real(wp), allocatable :: followed(:, :), static_stiffness(:, :)
      integer, allocatable :: stiff(:)
      integer :: i, info

      stiff = pack(static, [(stiffness(static(i), static(i)) > 0.0_wp, i=1, size(static))])
      static_stiffness = stiffness(stiff, stiff)
      followed = -stiffness(stiff, dynamic)
      call dposv('U', size(stiff), size(dynamic), static_stiffness, max(1, size(stiff)), followed, max(1, size(stiff)), info)
      failed = info /= 0
      if (failed) return
      allocate (transformation(size(stiffness, 1), size(dynamic)), source=0.0_wp)
      do i = 1, size(dynamic)
         transformation(dynamic(i), i) = 1.0_wp
      end do
      transformation(stiff, :) = followed
   end subroutine get_static_part

   !> Angular frequencies and shapes; the shapes replace the stiffness.
   subroutine get_eigenmodes(stiffness, mass, omega, failed)
      !> Stiffness, then shapes, one per column: [n, n].
      real(wp), intent(inout) :: stiffness(:, :)
      real(wp), intent(inout) :: mass(:, :)
      !> Angular frequencies, ascending, rad/s: [n].
      real(wp), allocatable, intent(out) :: omega(:)
      !> The mass is not positive.
      logical, intent(out) :: failed
      real(wp), allocatable :: work(:)
      integer, allocatable :: whole_work(:)
      integer :: n, info

      n = size(mass, 1)
      allocate (omega(n))
      if (n == 1) then
         failed = .not. mass(1, 1) > 0.0_wp
         if (failed) return
         omega = sqrt(max(stiffness(1, 1)/mass(1, 1), 0.0_wp))
         stiffness = 1/sqrt(mass)
         return
      end if
      allocate (work(1 + 6*n + 2*n**2), whole_work(3 + 5*n))
      call dsygvd(1, 'V', 'U', n, stiffness, n, mass, n, omega, work, size(work), whole_work, size(whole_work), info)
      failed = info /= 0
      omega = sqrt(max(omega, 0.0_wp))
   end subroutine get_eigenmodes

end module thud_ritz_system
