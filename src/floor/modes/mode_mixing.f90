!> Modes of plates whose parts have different losses, as sums of the modes without losses.
!>
!> With real modes of unit mass, stiffness and losses are the matrix A = Omega**2 + i D, where D has terms off the diagonal:
!> a layer transmits force by its losses, too. A = W diag(pole) transpose(W) with transpose(W) W = 1, and the response to
!> forces f at an angular frequency omega is W (pole - omega**2)**(-1) transpose(W) f.
module thud_mode_mixing
   use thud_kinds, only: wp
   use thud_lapack, only: zgeev
   use thud_modes, only: mode_block_type
   implicit none (type, external)
   private

   public :: are_mixed, diagonalize, get_mixed, get_unmixed

   !> Relative shift of the squared frequencies that separates equal poles; for two equal poles with one shape W does not
   !> exist.
   real(wp), parameter :: separation = 1.0e-9_wp

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

   !> Whether losses mix some modes.
   pure function are_mixed(blocks) result(yes)
      type(mode_block_type), intent(in) :: blocks(:)
      logical :: yes
      integer :: i

      yes = any([(allocated(blocks(i)%mixing), i=1, size(blocks))])
   end function are_mixed

   !> W times a matrix: [n_mode, n].
   pure function get_mixed(blocks, values) result(mixed)
      type(mode_block_type), intent(in) :: blocks(:)
      complex(wp), intent(in) :: values(:, :)
      complex(wp) :: mixed(size(values, 1), size(values, 2))
      integer :: i, n

      mixed = values
      n = 0
      do i = 1, size(blocks)
         associate (last => n + size(blocks(i)%omega))
            if (allocated(blocks(i)%mixing)) mixed(n + 1:last, :) = matmul(blocks(i)%mixing, values(n + 1:last, :))
            n = last
         end associate
      end do
   end function get_mixed

   !> The transpose of W times a matrix: [n_mode, n].
   pure function get_unmixed(blocks, values) result(unmixed)
      type(mode_block_type), intent(in) :: blocks(:)
      complex(wp), intent(in) :: values(:, :)
      complex(wp) :: unmixed(size(values, 1), size(values, 2))
      integer :: i, n

      unmixed = values
      n = 0
      do i = 1, size(blocks)
         associate (last => n + size(blocks(i)%omega))
            if (allocated(blocks(i)%mixing)) unmixed(n + 1:last, :) = matmul(transpose(blocks(i)%mixing), &
               values(n + 1:last, :))
            n = last
         end associate
      end do
   end function get_unmixed

end module thud_mode_mixing
