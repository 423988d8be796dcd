!> Powers of whole arrays, as straight-line arithmetic that vectorizes: the intrinsic `**` calls
!> the mathematical library for one number at a time.
!>
!> base = 2**k m with m in [sqrt(1/2), sqrt(2)); with s = (m - 1)/(m + 1)
!>
!>    log2(base) = k + 2/ln 2 (s + s**3/3 + ... + s**19/19),       s**2 <= (3 - sqrt 8)**2 = 0.0295
!>    t = exponent log2(base) = n + r,                              |r| <= 1/2
!>    base**exponent = 2**n (1 + r ln 2 + ... + (r ln 2)**13/13!)
!>
!> Bound of the relative error, with u = 2**(-53). Both series are Taylor series; their remainders are less than
!> s**20/(21 (1 - s**2)) = 2.3e-17 < 0.3 u of the logarithm and (ln(2)/2)**14/14! exp(ln(2)/2) = 6e-18 < 0.1 u of the power.
!> m - 1 is exact, so s errs by 2 u (sum, quotient), the series in s**2 by 2.2 u (rounded coefficients, the last sum; the
!> rest is scaled down by s**2), their product by one more: 5.5 u. Adding k and multiplying by the exponent add u each: t
!> errs by 7.5 u |t|, the power by ln 2 times that. n and r are exact. The last series has positive terms for r > 0 and errs
!> by 3 u for either sign; its scaling is exact. The sum is (5.2 |t| + 3) u.
module thud_power
   use, intrinsic :: iso_fortran_env, only: int64
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: not_a_number, vector_power

   !> Natural logarithm of 2.
   real(wp), parameter :: ln2 = log(2.0_wp)

   !> Highest degrees of the series of the logarithm, in s**2, and of the power of 2.
   integer, parameter :: log_degree = 9, exp_degree = 13

   !> Coefficients of the series of the logarithm in s**2, 2/(ln 2 (2j + 1)): [0:log_degree].
   real(wp), parameter :: a(0:log_degree) = 2/(ln2*[1.0_wp, 3.0_wp, 5.0_wp, 7.0_wp, 9.0_wp, 11.0_wp, 13.0_wp, 15.0_wp, &
      17.0_wp, 19.0_wp])

   !> Coefficients of the series of the power of 2, (ln 2)**j/j!: [0:exp_degree].
   real(wp), parameter :: b(0:exp_degree) = [1.0_wp, ln2, ln2**2/2, ln2**3/6, ln2**4/24, ln2**5/120, ln2**6/720, &
      ln2**7/5040, ln2**8/40320, ln2**9/362880, ln2**10/3628800, ln2**11/39916800, ln2**12/479001600, &
      ln2**13/6227020800.0_wp]

   !> Bits of sqrt(1/2), rounded.
   integer(int64), parameter :: root_bits = int(z'3FE6A09E667F3BCD', int64)

   !> Number of mantissa bits of a real number.
   integer, parameter :: mantissa = 52

   !> Offset of the exponent k that keeps it positive.
   integer, parameter :: offset = 1024

   !> A number whose last bit has the value 1: its mantissa converts integers below 2**51 to real numbers.
   real(wp), parameter :: counter = 2.0_wp**mantissa

   !> The same for integers of either sign, and for rounding to them.
   real(wp), parameter :: rounder = 1.5_wp*2.0_wp**mantissa

   !> Result for a base that is not positive.
   real(wp), parameter :: not_a_number = transfer(int(z'7FF8000000000000', int64), 1.0_wp)

contains

   !> Powers base**exponent; NaN if the base is not positive. Limited by the throughput of the multiply-add units.
   pure subroutine vector_power(n, base, exponent, power)
      !> Length of the arrays; if it is a multiple of the vector length, all elements pass through the same code.
      integer, intent(in) :: n
      !> The bases, normal numbers: [n].
      real(wp), intent(in) :: base(n)
      !> The exponents; |exponent log2(base)| <= 1000: [n].
      real(wp), intent(in) :: exponent(n)
      !> The powers: [n].
      real(wp), intent(out) :: power(n)
      integer(int64) :: bits, shifted
      real(wp) :: m, s, q, t, whole, r, value
      integer :: i

      !$omp simd private(bits, shifted, m, s, q, t, whole, r, value)
      do i = 1, n
         bits = transfer(base(i), bits)
         ! The exponent k, counted from sqrt(1/2), plus the offset.
         shifted = shiftr(bits - root_bits + shiftl(int(offset, int64), mantissa), mantissa)
         m = transfer(bits - shiftl(shifted, mantissa) + shiftl(int(offset, int64), mantissa), m)
         s = (m - 1)/(m + 1)
         q = s*s
         t = a(0) + q*(a(1) + q*(a(2) + q*(a(3) + q*(a(4) + q*(a(5) + q*(a(6) + q*(a(7) + q*(a(8) + q*a(9)))))))))
         whole = transfer(ior(shifted, transfer(counter, bits)), m) - (counter + offset)
         t = exponent(i)*(whole + s*t)
         whole = t + rounder
         r = t - (whole - rounder)
         value = b(0) + r*(b(1) + r*(b(2) + r*(b(3) + r*(b(4) + r*(b(5) + r*(b(6) + r*(b(7) + r*(b(8) + r*(b(9) &
            + r*(b(10) + r*(b(11) + r*(b(12) + r*b(13)))))))))))))
         value = transfer(transfer(value, bits) + shiftl(transfer(whole, bits), mantissa), value)
         power(i) = merge(value, not_a_number, base(i) > 0.0_wp)
      end do
   end subroutine vector_power

end module thud_power
