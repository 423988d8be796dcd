!> The Runge-Kutta step of `thud_shell_batch` with forces from Taylor series.
!>
!> Powers and quotients are slow, and a ball moves little in a step: c and 1/(1 - y) are expanded about a deflection, the
!> expansion point of the ball, and only multiplications and additions are needed while the ball stays near this point.
!>
!> Coefficients: x is a cubic with a double root at 1 and a single root at -1/2. From its three Taylor coefficients, J. C. P.
!> Miller's recurrence gives A x**(-gamma) = sum p_n d**n, where d is the distance from the expansion point; 1/(1 - y) is a
!> geometric series.
!>
!> Omitted terms: the nearest root has the distance rho = min(1 - y, 1/2 + y). The coefficients of x**(-gamma)/x_0**(-gamma)
!> are at most those of (1 - d/rho)**(-3 gamma), hence for gamma <= 2 those of (1 - d/rho)**(-6), which are
!> binomial(n + 5, 5)/rho**n. The first omitted term, n = 8, is at most 1287 near**8 (see `near`), and the ratio of
!> successive later terms is below 14/9 near: in total the omitted terms are at most 4.7e-12 of the pressure. For gamma = 1.4
!> this bound is 7.6e-13. In the inner part of the reach, where balls dropped from 1 m stay at the default step, it is
!> 1.3e-14.
module thud_shell_series
   use thud_kinds, only: wp
   use thud_power, only: not_a_number, vector_power
   use thud_shell_batch, only: batch_size, shell_batch_type, state_batch_type
   implicit none (type, external)
   private

   public :: expand_series, get_flows, series_batch_type, series_steps, take_step, will_last

   !> Highest power of the series.
   integer, parameter :: degree = 7

   !> Maximum distance at which a series is used, as a fraction of the distance to the nearest root of x.
   real(wp), parameter :: near = 1.0_wp/64

   !> A series is kept as long as its ball will stay within this fraction of the reach until the next check.
   real(wp), parameter :: inner = 0.6_wp

   !> Steps between two checks of the series; with the default step, a ball dropped from 2.7 m stays in reach for that long.
   integer, parameter :: series_steps = 16

   !> The series.
   type, bind(c) :: series_batch_type
      !> Deflection about which a ball is expanded: [batch_size].
      real(wp) :: expansion_point(batch_size)
      !> Distance from the expansion point up to which the series is used: [batch_size].
      real(wp) :: reach(batch_size)
      !> 1/(1 - y) at the expansion point: [batch_size].
      real(wp) :: inverse(batch_size)
      !> Coefficients of c: [batch_size, 0:degree].
      real(wp) :: term(batch_size, 0:degree)
   end type series_batch_type

contains

   !> Whether a ball stays in the inner part of the reach of its series for the next `series_steps`.
   elemental function will_last(expansion_point, reach, deflection, velocity) result(lasts)
      real(wp), intent(in) :: expansion_point
      !> Reach of the series; y; z.
      real(wp), intent(in) :: reach, deflection, velocity
      logical :: lasts

      lasts = max(abs(deflection - expansion_point), abs(deflection + series_steps*velocity - expansion_point)) <= &
         inner*reach
   end function will_last

   !> Expands the series about the middle of the path of the next steps; the present deflection stays in reach.
   pure subroutine expand_series(shell, state, wanted, series)
      type(shell_batch_type), intent(in) :: shell
      type(state_batch_type), intent(in) :: state
      !> Whether to expand the ball again: [batch_size].
      logical, intent(in) :: wanted(batch_size)
      type(series_batch_type), intent(inout) :: series
      real(wp), dimension(batch_size) :: expansion_point, inverse, power
      real(wp) :: term(batch_size, 0:degree)
      real(wp) :: x1, x2, x3, lead, p0, p1, p2, p3, p4, p5, p6, p7
      integer :: i

      !$omp simd private(lead)
      do i = 1, batch_size
         associate (y => state%deflection(i), z => state%velocity(i))
            lead = min(max(0.5_wp*series_steps*abs(z), 0.5_wp*get_reach(y)), 0.9_wp*get_reach(y), &
               0.4_wp*(shell%closing(i) - y))
            expansion_point(i) = y + sign(lead, z)
         end associate
      end do
      call vector_power(batch_size, get_ratio(expansion_point), shell%exponent, power)
      !$omp simd private(x1, x2, x3, p0, p1, p2, p3, p4, p5, p6, p7)
      do i = 1, batch_size
         inverse(i) = 1/(1 - expansion_point(i))
         associate (e => shell%exponent(i), r => inverse(i), k => shell%stiffness(i))
            ! Taylor coefficients of x divided by x.
            x3 = 2/get_ratio(expansion_point(i))
            x1 = -3*expansion_point(i)*(1 - expansion_point(i))*x3
            x2 = (3*expansion_point(i) - 1.5_wp)*x3
            p0 = shell%gas_pressure(i)*power(i)
            p1 = e*x1*p0
            p2 = ((e - 1)*x1*p1 + 2*e*x2*p0)*(1/2.0_wp)
            p3 = ((e - 2)*x1*p2 + (2*e - 1)*x2*p1 + 3*e*x3*p0)*(1/3.0_wp)
            p4 = ((e - 3)*x1*p3 + (2*e - 2)*x2*p2 + (3*e - 1)*x3*p1)*(1/4.0_wp)
            p5 = ((e - 4)*x1*p4 + (2*e - 3)*x2*p3 + (3*e - 2)*x3*p2)*(1/5.0_wp)
            p6 = ((e - 5)*x1*p5 + (2*e - 4)*x2*p4 + (3*e - 3)*x3*p3)*(1/6.0_wp)
            p7 = ((e - 6)*x1*p6 + (2*e - 5)*x2*p5 + (3*e - 4)*x3*p4)*(1/7.0_wp)
            term(i, 0) = r*k + p0 - shell%air_pressure(i)
            term(i, 1) = r**2*k + p1
            term(i, 2) = r**3*k + p2
            term(i, 3) = r**4*k + p3
            term(i, 4) = r**5*k + p4
            term(i, 5) = r**6*k + p5
            term(i, 6) = r**7*k + p6
            term(i, 7) = r**8*k + p7
         end associate
      end do
      do i = 0, degree
         series%term(:, i) = merge(term(:, i), series%term(:, i), wanted)
      end do
      series%expansion_point = merge(expansion_point, series%expansion_point, wanted)
      series%inverse = merge(inverse, series%inverse, wanted)
      series%reach = merge(min(get_reach(expansion_point), shell%closing - expansion_point), series%reach, wanted)
   end subroutine expand_series

   !> Ratio of volumes x; private like the functions below, so that compilers inline them in the loops.
   elemental function get_ratio(deflection) result(ratio)
      !> y.
      real(wp), intent(in) :: deflection
      real(wp) :: ratio

      ratio = (1 - deflection)*(1 - deflection)*(1 + 2*deflection)
   end function get_ratio

   !> Distance from an expansion point up to which its series is used.
   elemental function get_reach(deflection) result(reach)
      real(wp), intent(in) :: deflection
      real(wp) :: reach

      reach = near*min(1 - deflection, 0.5_wp + deflection)
   end function get_reach

   !> Deceleration y c due to shell and gas.
   elemental function get_deceleration(y, d, c0, c1, c2, c3, c4, c5, c6, c7) result(deceleration)
      !> y, the distance from the expansion point, and the terms of the series.
      real(wp), intent(in) :: y, d, c0, c1, c2, c3, c4, c5, c6, c7
      real(wp) :: deceleration

      deceleration = y*(c0 + d*(c1 + d*(c2 + d*(c3 + d*(c4 + d*(c5 + d*(c6 + d*c7)))))))
   end function get_deceleration

   !> Acceleration z**2/(1 - y) due to the flux for s = 1, with eight terms of the geometric series as a product.
   elemental function get_flux_acceleration(z, d, inverse) result(acceleration)
      !> z, the distance from the expansion point, and 1/(1 - y) at this point.
      real(wp), intent(in) :: z, d, inverse
      !> z**2/(1 - y).
      real(wp) :: acceleration
      real(wp) :: q, square

      q = inverse*d
      square = q*q
      acceleration = z*z*inverse
      acceleration = acceleration + acceleration*q
      acceleration = acceleration + acceleration*square
      acceleration = acceleration + acceleration*(square*square)
   end function get_flux_acceleration

   !> Force on the floor, dissipated power, and their rates of change.
   pure subroutine get_flows(shell, series, state, force, force_rate, power, power_rate)
      type(shell_batch_type), intent(in) :: shell
      !> The series; the states are in reach.
      type(series_batch_type), intent(in) :: series
      type(state_batch_type), intent(in) :: state
      !> Force on the floor: [batch_size].
      real(wp), intent(out) :: force(batch_size)
      !> Rate of the force: [batch_size].
      real(wp), intent(out) :: force_rate(batch_size)
      !> Dissipated power: [batch_size].
      real(wp), intent(out) :: power(batch_size)
      !> Rate of the dissipated power: [batch_size].
      real(wp), intent(out) :: power_rate(batch_size)
      real(wp), dimension(batch_size) :: d, c, c_rate, a
      integer :: n

      associate (y => state%deflection, z => state%velocity, s => shell%weight)
         d = y - series%expansion_point
         c = 0.0_wp
         c_rate = 0.0_wp
         do n = degree, 0, -1
            c_rate = c_rate*d + c
            c = c*d + series%term(:, n)
         end do
         a = s*get_flux_acceleration(z, d, series%inverse) - y*c
         force = y*(1 - y)*c + (1 - s)*z**2
         force_rate = z*((1 - 2*y)*c + y*(1 - y)*c_rate) + 2*(1 - s)*z*a
         power = (0.5_wp - s)*z**3
         power_rate = 3*(0.5_wp - s)*z**2*a
      end associate
   end subroutine get_flows

   !> Whole or shortened step of `rk4_step`, with the forces at its beginning; adds these to the sums of impulse and loss.
   pure subroutine take_step(shell, series, state, length, new, elastic_force, floor_force, missed)
      type(shell_batch_type), intent(in) :: shell
      type(series_batch_type), intent(in) :: series
      type(state_batch_type), intent(in) :: state
      !> Length of the step, in whole steps: [batch_size].
      real(wp), intent(in) :: length(batch_size)
      !> State at the end; the velocity is NaN if a stage was out of reach.
      type(state_batch_type), intent(inout) :: new
      !> Force of shell and gas, N: [batch_size].
      real(wp), intent(out) :: elastic_force(batch_size)
      !> Force on the floor, N: [batch_size].
      real(wp), intent(out) :: floor_force(batch_size)
      !> Whether a ball was out of reach.
      logical, intent(out) :: missed
      real(wp) :: half, sixth, y2, y3, y4, z2, z3, z4, d1, d2, d3, d4, a1, a2, a3, a4, elastic, total, outside, outsides
      integer :: i

      outsides = 0.0_wp
      if (abs(shell%weight) > 0.0_wp) then
         !$omp simd private(half, sixth, y2, y3, y4, z2, z3, z4, d1, d2, d3, d4, a1, a2, a3, a4, elastic, total, outside) &
         !$omp& reduction(+: outsides)
         do i = 1, batch_size
            associate (y => state%deflection(i), z => state%velocity(i), s => shell%weight, h => length(i), &
               point => series%expansion_point(i), inverse => series%inverse(i), c0 => series%term(i, 0), c1 => &
               series%term(i, 1), &
               c2 => series%term(i, 2), c3 => series%term(i, 3), c4 => series%term(i, 4), c5 => series%term(i, 5), &
               c6 => series%term(i, 6), c7 => series%term(i, 7))
               half = h/2
               d1 = y - point
               a1 = s*get_flux_acceleration(z, d1, inverse) - get_deceleration(y, d1, c0, c1, c2, c3, c4, c5, c6, c7)
               y2 = y + half*z
               z2 = z + half*a1
               d2 = y2 - point
               a2 = s*get_flux_acceleration(z2, d2, inverse) - get_deceleration(y2, d2, c0, c1, c2, c3, c4, c5, c6, c7)
               y3 = y + half*z2
               z3 = z + half*a2
               d3 = y3 - point
               a3 = s*get_flux_acceleration(z3, d3, inverse) - get_deceleration(y3, d3, c0, c1, c2, c3, c4, c5, c6, c7)
               y4 = y + h*z3
               z4 = z + h*a3
               d4 = y4 - point
               a4 = s*get_flux_acceleration(z4, d4, inverse) - get_deceleration(y4, d4, c0, c1, c2, c3, c4, c5, c6, c7)

               ! Added, since a branch would not be vectorized.
               outside = merge(0.0_wp, not_a_number, max(max(abs(d1), abs(d2)), max(abs(d3), abs(d4))) <= series%reach(i))
               outsides = outsides + outside
               sixth = h*(1/6.0_wp)
               new%deflection(i) = y + sixth*(z + 2*(z2 + z3) + z4)
               new%velocity(i) = z + sixth*(a1 + 2*(a2 + a3) + a4) + outside
               elastic = (1 - y)*get_deceleration(y, d1, c0, c1, c2, c3, c4, c5, c6, c7)
               total = elastic + (1 - s)*(z*z)
               new%impulse(i) = state%impulse(i) + total
               new%loss(i) = state%loss(i) + (0.5_wp - s)*(z*z*z)
               elastic_force(i) = shell%force_unit(i)*elastic
               floor_force(i) = shell%force_unit(i)*total
            end associate
         end do
      else
         ! The same without the flux, which gfortran would otherwise compute for s = 0 too.
         !$omp simd private(half, sixth, y2, y3, y4, z2, z3, z4, d1, d2, d3, d4, a1, a2, a3, a4, elastic, total, outside) &
         !$omp& reduction(+: outsides)
         do i = 1, batch_size
            associate (y => state%deflection(i), z => state%velocity(i), h => length(i), &
               point => series%expansion_point(i), c0 => series%term(i, 0), c1 => series%term(i, 1), &
               c2 => series%term(i, 2), c3 => series%term(i, 3), c4 => series%term(i, 4), c5 => series%term(i, 5), &
               c6 => series%term(i, 6), c7 => series%term(i, 7))
               half = h/2
               d1 = y - point
               a1 = -get_deceleration(y, d1, c0, c1, c2, c3, c4, c5, c6, c7)
               y2 = y + half*z
               z2 = z + half*a1
               d2 = y2 - point
               a2 = -get_deceleration(y2, d2, c0, c1, c2, c3, c4, c5, c6, c7)
               y3 = y + half*z2
               z3 = z + half*a2
               d3 = y3 - point
               a3 = -get_deceleration(y3, d3, c0, c1, c2, c3, c4, c5, c6, c7)
               y4 = y + h*z3
               z4 = z + h*a3
               d4 = y4 - point
               a4 = -get_deceleration(y4, d4, c0, c1, c2, c3, c4, c5, c6, c7)

               outside = merge(0.0_wp, not_a_number, max(max(abs(d1), abs(d2)), max(abs(d3), abs(d4))) <= series%reach(i))
               outsides = outsides + outside
               sixth = h*(1/6.0_wp)
               new%deflection(i) = y + sixth*(z + 2*(z2 + z3) + z4)
               new%velocity(i) = z + sixth*(a1 + 2*(a2 + a3) + a4) + outside
               elastic = (1 - y)*get_deceleration(y, d1, c0, c1, c2, c3, c4, c5, c6, c7)
               total = elastic + z*z
               new%impulse(i) = state%impulse(i) + total
               new%loss(i) = state%loss(i) + 0.5_wp*(z*z*z)
               elastic_force(i) = shell%force_unit(i)*elastic
               floor_force(i) = shell%force_unit(i)*total
            end associate
         end do
      end if
      missed = .not. outsides <= 0.0_wp
   end subroutine take_step

end module thud_shell_series
