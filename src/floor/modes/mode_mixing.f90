!> Modes of plates whose parts have different losses, as sums of the modes without losses.
!>
!> With real modes of unit mass, stiffness and losses are the matrix A = Omega**2 + i D, where D has terms off the diagonal:
!> a layer transmits force by its losses, too. A = W diag(pole) transpose(W) with transpose(W) W = 1, and the response to
!> forces f at an angular frequency omega is W (pole - omega**2)**(-1) transpose(W) f.
module thud_mode_mixing
   use thud_kinds, only: wp
   use thud_lapack, only: zgeev
   use thud_ritz_system, only: get_ranges, modes_type
   implicit none (type, external)
   private

   public :: diagonalize, get_mixed, get_mixing, get_row, get_unmixed, is_identity, mixing_type

   !> Relative shift of the squared frequencies that separates equal poles; for two equal poles with one shape W does not
   !> exist.
   real(wp), parameter :: separation = 1.0e-9_wp

   !> The matrix W of the modes of one block.
   type :: mixing_block_type
      !> Number of modes.
      integer :: count = 0
      !> The matrix: [count, count]; not allocated if each mode stands for itself.
      complex(wp), allocatable :: weight(:, :)
   end type mixing_block_type

   !> The matrix W of some modes, block after block.
   type :: mixing_type
      type(mixing_block_type), allocatable :: block(:)
   end type mixing_type

contains

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

   !> Mixing of some modes.
   pure function get_mixing(modes, kept) result(mixing)
      type(modes_type), intent(in) :: modes
      !> Numbers of the modes as in `get_ranges`: [n_mode].
      integer, intent(in) :: kept(:)
      type(mixing_type) :: mixing
      integer :: range(2, size(modes%block))
      integer :: i, n

      range = get_ranges(modes, kept)
      allocate (mixing%block(count(range(2, :) > 0)))
      n = 0
      do i = 1, size(modes%block)
         if (range(2, i) == 0) cycle
         n = n + 1
         associate (first => range(1, i), last => range(2, i))
            mixing%block(n)%count = last - first + 1
            if (allocated(modes%block(i)%mixing)) mixing%block(n)%weight = modes%block(i)%mixing(first:last, first:last)
         end associate
      end do
   end function get_mixing

   !> A row of W within the block of its mode.
   pure subroutine get_row(mixing, number, first, weight)
      type(mixing_type), intent(in) :: mixing
      !> Number of the mode.
      integer, intent(in) :: number
      !> Number of the first mode of the block, or of the mode if it stands for itself.
      integer, intent(out) :: first
      !> The row from there on: [count].
      complex(wp), allocatable, intent(out) :: weight(:)
      integer :: i

      first = 1
      i = 1
      do while (number >= first + mixing%block(i)%count)
         first = first + mixing%block(i)%count
         i = i + 1
      end do
      if (allocated(mixing%block(i)%weight)) then
         weight = mixing%block(i)%weight(number - first + 1, :)
      else
         first = number
         weight = [(1.0_wp, 0.0_wp)]
      end if
   end subroutine get_row

   !> Whether each mode stands for itself.
   pure function is_identity(mixing) result(yes)
      type(mixing_type), intent(in) :: mixing
      logical :: yes
      integer :: i

      yes = .not. any([(allocated(mixing%block(i)%weight), i=1, size(mixing%block))])
   end function is_identity

   !> W times a matrix: [n_mode, n].
   pure function get_mixed(mixing, values) result(mixed)
      type(mixing_type), intent(in) :: mixing
      complex(wp), intent(in) :: values(:, :)
      complex(wp) :: mixed(size(values, 1), size(values, 2))

      mixed = get_product(mixing, values, .false.)
   end function get_mixed

   !> The transpose of W times a matrix: [n_mode, n].
   pure function get_unmixed(mixing, values) result(unmixed)
      type(mixing_type), intent(in) :: mixing
      complex(wp), intent(in) :: values(:, :)
      complex(wp) :: unmixed(size(values, 1), size(values, 2))

      unmixed = get_product(mixing, values, .true.)
   end function get_unmixed

   !> W or its transpose times a matrix: [n_mode, n].
   pure function get_product(mixing, values, transposed) result(product)
      type(mixing_type), intent(in) :: mixing
      complex(wp), intent(in) :: values(:, :)
      logical, intent(in) :: transposed
      complex(wp) :: product(size(values, 1), size(values, 2))
      integer :: i, before

      product = values
      before = 0
      do i = 1, size(mixing%block)
         associate (block => mixing%block(i), first => before + 1, last => before + mixing%block(i)%count)
            if (.not. allocated(block%weight)) then
               continue
            else if (transposed) then
               product(first:last, :) = matmul(transpose(block%weight), values(first:last, :))
            else
               product(first:last, :) = matmul(block%weight, values(first:last, :))
            end if
         end associate
         before = before + mixing%block(i)%count
      end do
   end function get_product

end module thud_mode_mixing
