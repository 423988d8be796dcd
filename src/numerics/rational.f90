!> Rational functions of frequency, d + sum of r_k/(s - p_k), with real coefficients: their real state space and zeros.
!>
!> Of a pair of conjugate poles only the pole with positive imaginary part is stored, with twice its residue.
module thud_rational
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use thud_kinds, only: wp
   use thud_lapack, only: dgeev
   implicit none (type, external)
   private

   public :: get_basis, get_coefficients, get_eigenvalues, get_order, get_residues, get_state_input, get_state_matrix

contains

   !> Number of poles; a conjugate pair has two.
   pure function get_order(pole) result(order)
      !> Poles: [n].
      complex(wp), intent(in) :: pole(:)
      integer :: order

      order = size(pole) + count(pole%im > 0.0_wp)
   end function get_order

   !> Basis functions of a rational function with real coefficients: 1/(s - p) for a real pole, 1/(s - p) + 1/(s - p*) and
   !> i/(s - p) - i/(s - p*) for a pair, and finally 1.
   pure subroutine get_basis(pole, s, basis)
      !> Poles: [n].
      complex(wp), intent(in) :: pole(:)
      !> Complex frequencies: [n_frequency].
      complex(wp), intent(in) :: s(:)
      !> The functions: [n_frequency, order + 1].
      complex(wp), allocatable, intent(out) :: basis(:, :)
      complex(wp), parameter :: i = (0.0_wp, 1.0_wp)
      integer :: j, k

      allocate (basis(size(s), get_order(pole) + 1))
      j = 0
      do k = 1, size(pole)
         j = j + 1
         basis(:, j) = 1/(s - pole(k))
         if (.not. pole(k)%im > 0.0_wp) cycle
         basis(:, j + 1) = i*basis(:, j) - i/(s - conjg(pole(k)))
         basis(:, j) = basis(:, j) + 1/(s - conjg(pole(k)))
         j = j + 1
      end do
      basis(:, j + 1) = 1.0_wp
   end subroutine get_basis

   !> Residues from the coefficients of the basis, doubled for pairs: [n].
   pure function get_residues(pole, coefficient) result(residue)
      !> Poles: [n].
      complex(wp), intent(in) :: pole(:)
      !> Coefficients of the basis: [order].
      real(wp), intent(in) :: coefficient(:)
      complex(wp) :: residue(size(pole))
      integer :: j, k

      j = 0
      do k = 1, size(pole)
         j = j + 1
         residue(k) = coefficient(j)
         if (.not. pole(k)%im > 0.0_wp) cycle
         residue(k) = 2*cmplx(coefficient(j), coefficient(j + 1), wp)
         j = j + 1
      end do
   end function get_residues

   !> Coefficients of the basis from residues: [order].
   pure function get_coefficients(pole, residue) result(coefficient)
      !> Poles, and residues, doubled for pairs: [n].
      complex(wp), intent(in) :: pole(:), residue(:)
      real(wp), allocatable :: coefficient(:)
      integer :: j, k

      allocate (coefficient(get_order(pole)))
      j = 0
      do k = 1, size(pole)
         j = j + 1
         coefficient(j) = residue(k)%re
         if (.not. pole(k)%im > 0.0_wp) cycle
         coefficient(j:j + 1) = [residue(k)%re, residue(k)%im]/2
         j = j + 1
      end do
   end function get_coefficients

   !> Real matrix A of the state space x' = A x + b u; its eigenvalues are the poles.
   pure function get_state_matrix(pole) result(matrix)
      !> Poles: [n].
      complex(wp), intent(in) :: pole(:)
      !> The matrix: [order, order].
      real(wp), allocatable :: matrix(:, :)
      integer :: j, k

      allocate (matrix(get_order(pole), get_order(pole)))
      matrix = 0.0_wp
      j = 0
      do k = 1, size(pole)
         j = j + 1
         matrix(j, j) = pole(k)%re
         if (.not. pole(k)%im > 0.0_wp) cycle
         matrix(j, j + 1) = pole(k)%im
         matrix(j + 1, j) = -pole(k)%im
         matrix(j + 1, j + 1) = pole(k)%re
         j = j + 1
      end do
   end function get_state_matrix

   !> Input vector b of this state space; its output vector has the coefficients of the basis.
   pure function get_state_input(pole) result(input)
      !> Poles: [n].
      complex(wp), intent(in) :: pole(:)
      !> The vector: [order].
      real(wp), allocatable :: input(:)
      integer :: j, k

      allocate (input(get_order(pole)))
      j = 0
      do k = 1, size(pole)
         j = j + 1
         input(j) = 1.0_wp
         if (.not. pole(k)%im > 0.0_wp) cycle
         input(j:j + 1) = [2.0_wp, 0.0_wp]
         j = j + 1
      end do
   end function get_state_input

   !> Eigenvalues of a real matrix.
   pure subroutine get_eigenvalues(matrix, eigenvalue, failed)
      !> The matrix: [n, n].
      real(wp), intent(in) :: matrix(:, :)
      !> The eigenvalues: [n].
      complex(wp), intent(out) :: eigenvalue(:)
      !> True if the matrix is not finite or LAPACK does not find the eigenvalues.
      logical, intent(out) :: failed
      real(wp) :: copy(size(matrix, 1), size(matrix, 1)), wr(size(matrix, 1)), wi(size(matrix, 1))
      real(wp) :: left_vector(1, 1), right_vector(1, 1), work(16*size(matrix, 1))
      integer :: info

      eigenvalue = 0.0_wp
      failed = .not. all(ieee_is_finite(matrix))
      if (failed) return
      copy = matrix
      call dgeev('N', 'N', size(wr), copy, size(wr), wr, wi, left_vector, 1, right_vector, 1, work, size(work), info)
      eigenvalue = cmplx(wr, wi, wp)
      failed = info /= 0
   end subroutine get_eigenvalues

end module thud_rational
