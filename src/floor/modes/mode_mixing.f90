!> Modes of plates whose parts have different losses, as sums of the modes without losses.
!>
!> With real modes of unit mass, stiffness and losses are the matrix A = Omega**2 + i D, where D has terms off the diagonal:
!> a layer transmits force by its losses, too. A = W diag(pole) transpose(W) with transpose(W) W = 1, and the response to
!> forces f at an angular frequency omega is W (pole - omega**2)**(-1) transpose(W) f.
module thud_mode_mixing
   use thud_kinds, only: wp
   use thud_ritz_system, only: get_ranges, modes_type
   implicit none (type, external)
   private

   public :: diagonalize, get_mixed, get_mixing, get_part, get_unmixed, is_identity, mixing_type

   !> Terms off the diagonal that are smaller than this fraction of the difference of their poles mix no modes.
   real(wp), parameter :: smallest_angle = 2.0e-3_wp

   !> Terms that are smaller than this fraction of the poles are rounding.
   real(wp), parameter :: rounding = 1.0e-9_wp

   !> Smallest difference of the squares of a rotation whose poles coincide, and the change of the terms that keeps it.
   real(wp), parameter :: smallest_root = 1.0e-6_wp, shift = 1.0e-3_wp

   !> Maximum number of rotations of each pair; a few are enough.
   integer, parameter :: max_sweeps = 20

   !> Entries of W below this are left out.
   real(wp), parameter :: smallest_weight = 1.0e-3_wp

   !> The matrix W of some modes, by rows.
   type :: mixing_type
      !> Position of the first entry of each row, and of the one after the last: [n_mode + 1].
      integer, allocatable :: first(:)
      !> Columns and values of the entries.
      integer, allocatable :: column(:)
      complex(wp), allocatable :: weight(:)
   end type mixing_type

contains

   !> Diagonalizes a complex symmetric matrix by rotations (Jacobi), up to terms that matter little.
   subroutine diagonalize(matrix, vectors)
      !> The matrix, then the poles on its diagonal: [n, n].
      complex(wp), intent(inout) :: matrix(:, :)
      !> The matrix W: [n, n].
      complex(wp), intent(out) :: vectors(:, :)
      logical :: is_done
      integer :: i, j, sweep

      vectors = 0.0_wp
      do i = 1, size(matrix, 1)
         vectors(i, i) = 1.0_wp
      end do
      do sweep = 1, max_sweeps
         is_done = .true.
         do j = 2, size(matrix, 1)
            do i = 1, j - 1
               associate (term => abs(matrix(i, j)))
                  if (term <= smallest_angle*abs(matrix(i, i) - matrix(j, j))) cycle
                  if (term <= rounding*(abs(matrix(i, i)) + abs(matrix(j, j)))) cycle
               end associate
               is_done = .false.
               call rotate(i, j)
            end do
         end do
         if (is_done) exit
      end do
   contains

      !> Removes the term of a pair.
      subroutine rotate(i, j)
         integer, intent(in) :: i, j
         complex(wp) :: ratio, root, tangent, cosine
         complex(wp) :: column(size(matrix, 1))

         ratio = (matrix(j, j) - matrix(i, i))/(2*matrix(i, j))
         if (abs(ratio**2 + 1) < smallest_root) then
            ! Two poles that coincide have one shape; a small change separates them.
            matrix(j, j) = matrix(j, j) + 2*shift*matrix(i, j)
            ratio = ratio + shift
         end if
         root = sqrt(ratio**2 + 1)
         if (abs(ratio - root) > abs(ratio + root)) root = -root
         tangent = 1/(ratio + root)
         cosine = 1/sqrt(tangent**2 + 1)
         associate (sine => tangent*cosine)
            column = matrix(:, i)
            matrix(:, i) = cosine*column - sine*matrix(:, j)
            matrix(:, j) = cosine*matrix(:, j) + sine*column
            column = matrix(i, :)
            matrix(i, :) = cosine*column - sine*matrix(j, :)
            matrix(j, :) = cosine*matrix(j, :) + sine*column
            column = vectors(:, i)
            vectors(:, i) = cosine*column - sine*vectors(:, j)
            vectors(:, j) = cosine*vectors(:, j) + sine*column
         end associate
         matrix(i, j) = 0.0_wp
         matrix(j, i) = 0.0_wp
      end subroutine rotate
   end subroutine diagonalize

   !> Mixing of some modes.
   function get_mixing(modes, kept) result(mixing)
      type(modes_type), intent(in) :: modes
      !> Numbers of the modes as in `get_ranges`: [n_mode].
      integer, intent(in) :: kept(:)
      type(mixing_type) :: mixing
      integer :: range(2, size(modes%block))
      integer, allocatable :: column(:)
      complex(wp), allocatable :: weight(:)
      integer :: i, j, k, before, last

      range = get_ranges(modes, kept)
      last = 0
      do i = 1, size(modes%block)
         associate (n => range(2, i) - range(1, i) + 1)
            last = last + merge(n**2, n, allocated(modes%block(i)%mixing))
         end associate
      end do
      allocate (mixing%first(size(kept) + 1), column(last), weight(last))
      before = 0
      last = 0
      do i = 1, size(modes%block)
         if (range(2, i) < range(1, i)) cycle
         associate (block => modes%block(i), n => range(2, i) - range(1, i) + 1)
            do j = 1, n
               mixing%first(before + j) = last + 1
               if (.not. allocated(block%mixing)) then
                  call add_entry(before + j, (1.0_wp, 0.0_wp))
                  cycle
               end if
               do k = 1, n
                  associate (entry => block%mixing(range(1, i) + j - 1, range(1, i) + k - 1))
                     if (abs(entry) > smallest_weight) call add_entry(before + k, entry)
                  end associate
               end do
            end do
            before = before + n
         end associate
      end do
      mixing%first(before + 1) = last + 1
      mixing%column = column(:last)
      mixing%weight = weight(:last)
   contains

      !> Adds an entry to the present row.
      subroutine add_entry(at, value)
         integer, intent(in) :: at
         complex(wp), intent(in) :: value

         last = last + 1
         column(last) = at
         weight(last) = value
      end subroutine add_entry
   end function get_mixing

   !> Mixing of some of the modes, without the others.
   pure function get_part(mixing, numbers) result(part)
      type(mixing_type), intent(in) :: mixing
      !> Numbers of the modes: [n].
      integer, intent(in) :: numbers(:)
      type(mixing_type) :: part
      integer :: at(size(mixing%first) - 1)
      integer :: i, k

      at = 0
      at(numbers) = [(i, i=1, size(numbers))]
      allocate (part%first(size(numbers) + 1), part%column(0), part%weight(0))
      part%first(1) = 1
      do i = 1, size(numbers)
         associate (entries => pack([(k, k=mixing%first(numbers(i)), mixing%first(numbers(i) + 1) - 1)], &
            at(mixing%column(mixing%first(numbers(i)):mixing%first(numbers(i) + 1) - 1)) > 0))
            part%column = [part%column, at(mixing%column(entries))]
            part%weight = [part%weight, mixing%weight(entries)]
         end associate
         part%first(i + 1) = size(part%column) + 1
      end do
   end function get_part

   !> Whether each mode stands for itself.
   pure function is_identity(mixing) result(yes)
      type(mixing_type), intent(in) :: mixing
      logical :: yes

      yes = size(mixing%column) == size(mixing%first) - 1
   end function is_identity

   !> W times a matrix: [n_mode, n].
   pure function get_mixed(mixing, values) result(mixed)
      type(mixing_type), intent(in) :: mixing
      complex(wp), intent(in) :: values(:, :)
      complex(wp) :: mixed(size(values, 1), size(values, 2))
      ! Columns together, for contiguous sums.
      complex(wp), dimension(size(values, 2), size(values, 1)) :: row
      complex(wp) :: total(size(values, 2))
      integer :: i, k

      row = transpose(values)
      do i = 1, size(values, 1)
         total = 0.0_wp
         do k = mixing%first(i), mixing%first(i + 1) - 1
            total = total + mixing%weight(k)*row(:, mixing%column(k))
         end do
         mixed(i, :) = total
      end do
   end function get_mixed

   !> The transpose of W times a matrix: [n_mode, n].
   pure function get_unmixed(mixing, values) result(unmixed)
      type(mixing_type), intent(in) :: mixing
      complex(wp), intent(in) :: values(:, :)
      complex(wp) :: unmixed(size(values, 1), size(values, 2))
      ! Columns together, for contiguous sums.
      complex(wp), dimension(size(values, 2), size(values, 1)) :: row, total
      integer :: i, k

      row = transpose(values)
      total = 0.0_wp
      do i = 1, size(values, 1)
         do k = mixing%first(i), mixing%first(i + 1) - 1
            total(:, mixing%column(k)) = total(:, mixing%column(k)) + mixing%weight(k)*row(:, i)
         end do
      end do
      unmixed = transpose(total)
   end function get_unmixed

end module thud_mode_mixing
