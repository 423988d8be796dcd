!> Legendre polynomials, Legendre functions of the second kind, and Gauss-Legendre quadrature.
module thud_legendre
   use thud_constants, only: pi
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: get_gauss_legendre, get_legendre, get_second_legendre

contains

   !> Legendre polynomials P_0 to P_degree and their first two derivatives.
   pure subroutine get_legendre(x, value, first, second)
      !> Argument in [-1, 1].
      real(wp), intent(in) :: x
      !> P_j(x): [0:degree].
      real(wp), intent(out) :: value(0:)
      !> P_j'(x): [0:degree].
      real(wp), intent(out) :: first(0:)
      !> P_j''(x): [0:degree].
      real(wp), intent(out) :: second(0:)
      integer :: j

      value(0) = 1.0_wp
      first(0) = 0.0_wp
      second(0) = 0.0_wp
      if (ubound(value, 1) == 0) return
      value(1) = x
      first(1) = 1.0_wp
      second(1) = 0.0_wp
      do j = 2, ubound(value, 1)
         value(j) = ((2*j - 1)*x*value(j - 1) - (j - 1)*value(j - 2))/j
         ! P_j' = P_(j-2)' + (2j - 1) P_(j-1), and its derivative: exact at the ends too.
         first(j) = first(j - 2) + (2*j - 1)*value(j - 1)
         second(j) = second(j - 2) + (2*j - 1)*first(j - 1)
      end do
   end subroutine get_legendre

   !> Legendre functions of the second kind, 2 Q_n(z) = integral over [-1, 1] of P_n(x)/(z - x).
   !>
   !> The upward recursion amplifies errors like |P_n(z)|. Sums with the coefficients of a smooth function are not affected,
   !> because these coefficients decrease as fast.
   pure subroutine get_second_legendre(z, second)
      !> Argument in the upper half plane; on [-1, 1] the value just above is returned.
      complex(wp), intent(in) :: z
      !> Q_0(z), Q_1(z), ...: [0:degree].
      complex(wp), intent(out) :: second(0:)
      integer :: n

      second(0) = (log(z + 1) - log(z - 1))/2
      if (ubound(second, 1) == 0) return
      second(1) = z*second(0) - 1
      do n = 2, ubound(second, 1)
         second(n) = ((2*n - 1)*z*second(n - 1) - (n - 1)*second(n - 2))/n
      end do
   end subroutine get_second_legendre

   !> Nodes and weights of Gauss-Legendre quadrature on [-1, 1], by Newton's iteration.
   pure subroutine get_gauss_legendre(node, weight)
      !> Nodes, ascending: [n].
      real(wp), intent(out) :: node(:)
      !> Weights: [n].
      real(wp), intent(out) :: weight(:)
      real(wp), dimension((size(node) + 1)/2) :: x, step, value, previous, before, slope
      integer :: iteration, i, j, n

      ! All nodes in [-1, 0] at once; the others are mirrored.
      n = size(node)
      x = -cos(pi*([(i, i=1, size(x))] - 0.25_wp)/(n + 0.5_wp))
      do iteration = 1, 9
         value = 1.0_wp
         previous = 0.0_wp
         do j = 1, n
            before = previous
            previous = value
            value = ((2*j - 1)*x*previous - (j - 1)*before)/j
         end do
         slope = n*(previous - x*value)/(1 - x**2)
         step = value/slope
         if (maxval(abs(step)) <= epsilon(1.0_wp)) exit
         x = x - step
      end do
      if (mod(n, 2) == 1) x(size(x)) = 0.0_wp
      node(:size(x)) = x
      node(n:n - size(x) + 1:-1) = -x
      weight(:size(x)) = 2/((1 - x**2)*slope**2)
      weight(n:n - size(x) + 1:-1) = weight(:size(x))
   end subroutine get_gauss_legendre

end module thud_legendre
