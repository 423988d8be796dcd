!> Modes by the Ritz method: displacements are sums of products of functions of x and of y, energies are sums of products
!> of matrices in x and in y.
!>
!> The matrices couple only some functions (of the same number for simply supported plates, of the same symmetry for
!> symmetric ones). The system falls into blocks of functions that are coupled, which are solved one by one.
module thud_ritz_system
   use thud_kinds, only: wp
   use thud_lapack, only: dposv, dsygvd
   use thud_matrix_product, only: get_product, get_transposed_product
   use thud_modes, only: mode_block_type, modes_type, product_type
   implicit none (type, external)
   private

   public :: add_displacement, add_mass, add_stiffness, ritz_system_type, solve_ritz_system

   !> A matrix entry below this fraction of the largest one in its row or column is rounding.
   real(wp), parameter :: rounding = 1.0e-11_wp

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

   !> Numbers of the functions of one displacement in one group.
   type :: members_type
      integer, allocatable :: number(:)
   end type members_type

contains

   !> Adds a displacement and returns its number.
   subroutine add_displacement(system, displacement, number)
      type(ritz_system_type), intent(inout) :: system
      type(product_type), intent(in) :: displacement
      integer, intent(out) :: number

      if (.not. allocated(system%displacement)) allocate (system%displacement(0))
      system%displacement = [system%displacement, displacement]
      number = size(system%displacement)
   end subroutine add_displacement

   !> Adds a stiffness: an energy of half the double sum over the coefficients of two displacements. Between different
   !> displacements, the transposed stiffness is included.
   subroutine add_stiffness(system, row, column, stiffness, x, y, loss_factor)
      type(ritz_system_type), intent(inout) :: system
      integer, intent(in) :: row, column
      !> Factor of the matrices: the energy is in J.
      real(wp), intent(in) :: stiffness
      real(wp), intent(in) :: x(:, :), y(:, :)
      real(wp), intent(in) :: loss_factor

      if (.not. allocated(system%stiffness)) allocate (system%stiffness(0))
      if (.not. abs(stiffness) > 0.0_wp) return
      system%stiffness = [system%stiffness, term_type(row, column, stiffness*x, y, loss_factor, system%is_bearing)]
   end subroutine add_stiffness

   !> Adds a mass; as `add_stiffness`.
   subroutine add_mass(system, row, column, mass, x, y)
      type(ritz_system_type), intent(inout) :: system
      integer, intent(in) :: row, column
      real(wp), intent(in) :: mass
      real(wp), intent(in) :: x(:, :), y(:, :)

      if (.not. allocated(system%mass)) allocate (system%mass(0))
      if (.not. abs(mass) > 0.0_wp) return
      system%mass = [system%mass, term_type(row, column, mass*x, y)]
   end subroutine add_mass

   !> Solves a system for all its modes.
   subroutine solve_ritz_system(system, modes, failed, lower_limit)
      type(ritz_system_type), intent(in) :: system
      type(modes_type), intent(out) :: modes
      !> A mass or the stiffness of a static displacement is not positive.
      logical, intent(out) :: failed
      !> Angular frequency of the highest of the lower modes, rad/s.
      real(wp), intent(in) :: lower_limit
      integer, allocatable :: group_x(:), group_y(:)
      type(members_type), allocatable :: x(:, :), y(:, :)
      integer :: i, j, n

      failed = .false.
      call find_groups(system, .true., group_x)
      call find_groups(system, .false., group_y)
      x = get_members(group_x, system%displacement%x%count)
      y = get_members(group_y, system%displacement%y%count)
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

         yes = any([(size(x(i)%number)*size(y(i)%number) > 0, i=1, size(x))] .and. .not. system%displacement%is_static)
      end function has_mass
   end subroutine solve_ritz_system

   !> Number of the group of each function of one coordinate; functions of different groups are not coupled.
   subroutine find_groups(system, along_x, group)
      type(ritz_system_type), intent(in) :: system
      !> Functions of x, otherwise of y.
      logical, intent(in) :: along_x
      !> Numbers from 1, in the order of displacements and their functions.
      integer, allocatable, intent(out) :: group(:)
      integer, allocatable :: first(:), root(:)
      integer :: i, n

      associate (displacement => system%displacement)
         if (along_x) then
            first = get_first(displacement%x%count)
         else
            first = get_first(displacement%y%count)
         end if
      end associate
      n = first(size(first)) - 1
      root = [(i, i=1, n)]
      do i = 1, size(system%stiffness)
         call merge_terms(system%stiffness(i))
      end do
      do i = 1, size(system%mass)
         call merge_terms(system%mass(i))
      end do
      allocate (group(n), source=0)
      n = 0
      do i = 1, size(group)
         if (root(i) == i) then
            n = n + 1
            group(i) = n
         end if
      end do
      do i = 1, size(group)
         group(i) = group(get_root(i))
      end do
   contains

      !> Merges the groups of functions that a term couples.
      subroutine merge_terms(term)
         type(term_type), intent(in) :: term
         real(wp), allocatable :: matrix(:, :), row_scale(:), column_scale(:)
         integer :: k, l

         if (along_x) then
            allocate (matrix, source=abs(term%x))
         else
            allocate (matrix, source=abs(term%y))
         end if
         row_scale = maxval(matrix, dim=2)
         column_scale = maxval(matrix, dim=1)
         do l = 1, size(matrix, 2)
            do k = 1, size(matrix, 1)
               if (matrix(k, l) > rounding*max(row_scale(k), column_scale(l))) then
                 call merge_functions(first(term%row) + k - 1, first(term%column) + l - 1)
               end if
            end do
         end do
      end subroutine merge_terms

      !> Merges the groups of two functions.
      subroutine merge_functions(one, other)
         integer, intent(in) :: one, other
         integer :: roots(2)

         roots = [get_root(one), get_root(other)]
         root(maxval(roots)) = minval(roots)
      end subroutine merge_functions

      !> First function of the group of a function.
      function get_root(number) result(found)
         integer, intent(in) :: number
         integer :: found

         found = number
         do while (root(found) /= found)
            root(found) = root(root(found))
            found = root(found)
         end do
      end function get_root
   end subroutine find_groups

   !> Functions of each displacement in each group: [n_displacement, n_group].
   pure function get_members(group, count) result(members)
      !> Groups of the functions, in the order of displacements.
      integer, intent(in) :: group(:)
      !> Number of functions of each displacement.
      integer, intent(in) :: count(:)
      type(members_type) :: members(size(count), maxval(group))
      integer :: i, k, p

      i = 0
      do p = 1, size(count)
         do k = 1, size(members, 2)
            allocate (members(p, k)%number(0))
         end do
         do k = 1, count(p)
            members(p, group(i + k))%number = [members(p, group(i + k))%number, k]
         end do
         i = i + count(p)
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
      integer :: i, p, n

      failed = .false.
      associate (displacement => system%displacement)
         n = size(displacement)
         allocate (block%shape(n))
         do p = 1, n
            block%shape(p)%x = x(p)%number
            block%shape(p)%y = y(p)%number
         end do
         first = get_first([(size(block%shape(p)%x)*size(block%shape(p)%y), p=1, n)])
         allocate (dynamic(0), static(0))
         do p = 1, n
            if (displacement(p)%is_static) then
               static = [static, (i, i=first(p), first(p + 1) - 1)]
            else
               dynamic = [dynamic, (i, i=first(p), first(p + 1) - 1)]
            end if
         end do
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
         call condense(mass)
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

      !> Replaces a matrix of all coefficients by that of the dynamic ones.
      subroutine condense(matrix)
         real(wp), allocatable, intent(inout) :: matrix(:, :)

         matrix = get_transposed_product(transformation, get_product(matrix, transformation))
      end subroutine condense

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
            if (size(static) > 0) call condense(matrix)
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
      real(wp) :: factor
      integer :: h, i, j, k, l, p, q, at_row, at_column

      allocate (matrix(first(size(first)) - 1, first(size(first)) - 1), source=0.0_wp)
      do i = 1, size(terms)
         p = terms(i)%row
         q = terms(i)%column
         if (.not. abs(weight(i)) > 0.0_wp) cycle
         associate (row => block%shape(p), column => block%shape(q))
            do l = 1, size(column%y)
               do k = 1, size(row%y)
                  factor = weight(i)*terms(i)%y(row%y(k), column%y(l))
                  ! Many functions are orthogonal.
                  if (.not. abs(factor) > 0.0_wp) cycle
                  at_row = first(p) + (k - 1)*size(row%x) - 1
                  do j = 1, size(column%x)
                     at_column = first(q) + (l - 1)*size(column%x) + j - 1
                     do h = 1, size(row%x)
                        matrix(at_row + h, at_column) = matrix(at_row + h, at_column) &
                           + factor*terms(i)%x(row%x(h), column%x(j))
                     end do
                     if (p /= q) matrix(at_column, at_row + 1:at_row + size(row%x)) = &
                        matrix(at_row + 1:at_row + size(row%x), at_column)
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
