!> The equation of motion of the shell model (see `thud_hollow_sphere`) for a batch of balls, one per lane of the processor's
!> vectors, and its Runge-Kutta step with forces from Taylor series.
!>
!> With the deflection y in diameters 2R and the time in steps h, z = dy/dt, the equation
!> m a = s (M/2R) v**2 - F_B - F_G becomes
!>
!>    dz/dt = s z**2/(1 - y) - y c,   c = K/(1 - y) + A x**(-gamma) - B,   x = (1 - y)**2 (1 + 2y)
!>
!> with K = k h**2/M, A = 2 pi R (p_a + p_g) h**2/M, B = 2 pi R p_a h**2/M; forces are in 2 R M/h**2.
!> x is the ratio of volumes; written as a product it has no cancellation where the shell closes.
!>
!> Powers and quotients are slow, and a ball moves little in a step: c and 1/(1 - y) are expanded about a deflection, the
!> expansion point of the ball, and only multiplications and additions are needed while the ball stays near this point.
!>
!> Powers: from one expansion point to the next x changes by less than 10 %, so that 18 terms of the binomial series of the
!> quotient leave 1e-17 of x**(-gamma). The first series has y = 0 before it, where x = 1.
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
   use thud_constants, only: not_a_number
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: batch_size, expand_series, series_batch_type, series_steps, shell_batch_type
   public :: state_batch_type, take_step

   !> Balls of a batch: several vectors, so that the latency of one is filled by the others, and few enough that the forces
   !> of all balls stay in cache.
   integer, parameter :: batch_size = 32

   !> The equations, one ball per lane.
   type, bind(c) :: shell_batch_type
      !> K, stiffness of the shell: [batch_size].
      real(wp) :: stiffness(batch_size)
      !> A, absolute pressure of the gas in the undeformed ball: [batch_size].
      real(wp) :: gas_pressure(batch_size)
      !> B, pressure of the air: [batch_size].
      real(wp) :: air_pressure(batch_size)
      !> -gamma: [batch_size].
      real(wp) :: exponent(batch_size)
      !> Deflection at which the shell closes, 1 - (wall thickness)/R: [batch_size].
      real(wp) :: closing(batch_size)
      !> Unit of the forces, N: [batch_size].
      real(wp) :: force_unit(batch_size)
      !> Factor s of the flux term in the present phase.
      real(wp) :: weight
   end type shell_batch_type

   !> States; units are diameters and steps.
   type, bind(c) :: state_batch_type
      !> y: [batch_size].
      real(wp) :: deflection(batch_size)
      !> z: [batch_size].
      real(wp) :: velocity(batch_size)
   end type state_batch_type

   !> Highest power of the series.
   integer, parameter :: degree = 7

   !> Terms of the binomial series.
   integer, parameter :: binomial_terms = 18

   !> Maximum distance at which a series is used, as a fraction of the distance to the nearest root of x.
   real(wp), parameter :: near = 1.0_wp/64

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
      !> A x**(-gamma) at the expansion point: [batch_size].
      real(wp) :: pressure(batch_size)
      !> Coefficients of c: [batch_size, 0:degree].
      real(wp) :: term(batch_size, 0:degree)
   end type series_batch_type

contains

   !> Expands the series about the middle of the path of the next steps; the present deflection stays in reach. Point and
   !> pressure of the series before must be set, those of a new ball at y = 0.
   pure subroutine expand_series(shell, state, wanted, series)
      type(shell_batch_type), intent(in) :: shell
      type(state_batch_type), intent(in) :: state
      !> Whether to expand the ball again: [batch_size].
      logical, intent(in) :: wanted(batch_size)
      type(series_batch_type), intent(inout) :: series
      real(wp), dimension(batch_size) :: expansion_point, inverse, change, power, spring, x1, x2, x3
      real(wp) :: p(batch_size, -2:degree)
      real(wp) :: lead
      integer :: i, n

      !$omp simd private(lead)
      do i = 1, batch_size
         associate (y => state%deflection(i), z => state%velocity(i))
            lead = min(max(0.5_wp*series_steps*abs(z), 0.5_wp*get_reach(y)), 0.9_wp*get_reach(y), &
               0.4_wp*(shell%closing(i) - y))
            expansion_point(i) = y + sign(lead, z)
         end associate
      end do
      change = get_ratio(expansion_point)/get_ratio(series%expansion_point) - 1
      power = 1.0_wp
      do n = binomial_terms - 1, 0, -1
         power = 1 + power*change*((shell%exponent - n)*(1.0_wp/(n + 1)))
      end do
      inverse = 1/(1 - expansion_point)
      ! Taylor coefficients of x divided by x.
      x3 = 2/get_ratio(expansion_point)
      x1 = -3*expansion_point*(1 - expansion_point)*x3
      x2 = (3*expansion_point - 1.5_wp)*x3
      p(:, :-1) = 0.0_wp
      p(:, 0) = series%pressure*power
      spring = inverse*shell%stiffness
      series%term(:, 0) = merge(spring + p(:, 0) - shell%air_pressure, series%term(:, 0), wanted)
      do n = 1, degree
         spring = spring*inverse
         associate (e => shell%exponent)
            p(:, n) = ((e - (n - 1))*x1*p(:, n - 1) + (2*e - (n - 2))*x2*p(:, n - 2) + (3*e - (n - 3))*x3*p(:, n - 3)) &
               *(1.0_wp/n)
         end associate
         series%term(:, n) = merge(spring + p(:, n), series%term(:, n), wanted)
      end do
      series%expansion_point = merge(expansion_point, series%expansion_point, wanted)
      series%inverse = merge(inverse, series%inverse, wanted)
      series%pressure = merge(p(:, 0), series%pressure, wanted)
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

   !> Acceleration of a ball, with or without the flux.
   elemental function get_acceleration(with_flux, s, y, z, d, inverse, c0, c1, c2, c3, c4, c5, c6, c7) result(acceleration)
      logical, intent(in) :: with_flux
      !> s, y, z, and the arguments of `get_flux_acceleration` and `get_deceleration`.
      real(wp), intent(in) :: s, y, z, d, inverse, c0, c1, c2, c3, c4, c5, c6, c7
      real(wp) :: acceleration

      acceleration = -get_deceleration(y, d, c0, c1, c2, c3, c4, c5, c6, c7)
      if (with_flux) acceleration = acceleration + s*get_flux_acceleration(z, d, inverse)
   end function get_acceleration

   !> Whole or shortened step of `rk4_step`, with the forces at its beginning.
   pure subroutine take_step(shell, series, state, length, new, elastic_force, floor_force)
      type(shell_batch_type), intent(in) :: shell
      type(series_batch_type), intent(in) :: series
      type(state_batch_type), intent(in) :: state
      !> Length of the step, in whole steps: [batch_size].
      real(wp), intent(in) :: length(batch_size)
      !> State at the end; NaN if a stage was out of reach.
      type(state_batch_type), intent(inout) :: new
      !> Force of shell and gas, N: [batch_size].
      real(wp), intent(out) :: elastic_force(batch_size)
      !> Force on the floor, N: [batch_size].
      real(wp), intent(out) :: floor_force(batch_size)

      real(wp) :: half, sixth, y2, y3, y4, z2, z3, z4, d1, d2, d3, d4, a1, a2, a3, a4, elastic, outside
      logical :: with_flux
      integer :: i

      ! gfortran makes a second loop without the flux (`max-unswitch-insns`), which it would otherwise compute for s = 0 too.
      with_flux = abs(shell%weight) > 0.0_wp
      !$omp simd private(half, sixth, y2, y3, y4, z2, z3, z4, d1, d2, d3, d4, a1, a2, a3, a4, elastic, outside)
      do i = 1, batch_size
         associate (y => state%deflection(i), z => state%velocity(i), s => shell%weight, h => length(i), &
            point => series%expansion_point(i), r => series%inverse(i), &
            c0 => series%term(i, 0), c1 => series%term(i, 1), c2 => series%term(i, 2), c3 => series%term(i, 3), &
            c4 => series%term(i, 4), c5 => series%term(i, 5), c6 => series%term(i, 6), c7 => series%term(i, 7))
            half = h/2
            d1 = y - point
            a1 = get_acceleration(with_flux, s, y, z, d1, r, c0, c1, c2, c3, c4, c5, c6, c7)
            y2 = y + half*z
            z2 = z + half*a1
            d2 = y2 - point
            a2 = get_acceleration(with_flux, s, y2, z2, d2, r, c0, c1, c2, c3, c4, c5, c6, c7)
            y3 = y + half*z2
            z3 = z + half*a2
            d3 = y3 - point
            a3 = get_acceleration(with_flux, s, y3, z3, d3, r, c0, c1, c2, c3, c4, c5, c6, c7)
            y4 = y + h*z3
            z4 = z + h*a3
            d4 = y4 - point
            a4 = get_acceleration(with_flux, s, y4, z4, d4, r, c0, c1, c2, c3, c4, c5, c6, c7)

            ! Added, since a branch would not be vectorized.
            outside = merge(0.0_wp, not_a_number, max(max(abs(d1), abs(d2)), max(abs(d3), abs(d4))) <= series%reach(i))
            sixth = h*(1/6.0_wp)
            new%deflection(i) = y + sixth*(z + 2*(z2 + z3) + z4) + outside
            new%velocity(i) = z + sixth*(a1 + 2*(a2 + a3) + a4) + outside
            elastic = (1 - y)*get_deceleration(y, d1, c0, c1, c2, c3, c4, c5, c6, c7)
            elastic_force(i) = shell%force_unit(i)*elastic
            floor_force(i) = shell%force_unit(i)*(elastic + (1 - s)*(z*z))
         end associate
      end do
   end subroutine take_step

end module thud_shell_series
