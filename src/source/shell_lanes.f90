!> The equation of motion of the shell model (see `thud_hollow_sphere`) and its Runge-Kutta step for
!> many balls side by side, one per lane of the processor's vectors.
!>
!> With the deflection y in diameters 2R and the time in steps h, z = dy/dt, the equation
!> m a = s (M/2R) v**2 - F_B - F_G becomes
!>
!>    (1 - y) dz/dt = s z**2 - e,   e = y (K + (1 - y) (A x**(-gamma) - B)),   x = (1 - y)**2 (1 + 2y)
!>
!> with K = k h**2/M, A = 2 pi R (p_a + p_g) h**2/M, B = 2 pi R p_a h**2/M; forces are in 2 R M/h**2.
!> x is the ratio of volumes; written as a product it has no cancellation where the shell closes.
!>
!> Powers are slow and a ball moves little from step to step: each lane has an anchor, a deflection
!> whose power is known, and takes the pressures near it from the binomial series about it.
!>
!> All loops are limited by the multiply-add units; a lane's result does not depend on the others.
module thud_shell_lanes
   use thud_kinds, only: wp
   use thud_power, only: not_a_number, raise
   implicit none (type, external)
   private

   public :: anchor_lanes_type, get_forces, get_pressures, lane_count, set_anchors, set_series, shell_lanes_type
   public :: state_lanes_type, take_step

   !> Balls side by side: several vectors, so that the latency of one is filled by the others, and
   !> few enough that their forces stay in cache.
   integer, parameter :: lane_count = 32

   !> Terms of the binomial series.
   integer, parameter :: term_count = 6

   !> Largest |u| that the series (1 + u)**(-gamma) is used for. The first term left out is
   !> c_7 u**7 with c_7 <= 8 for gamma <= 2, and the ratio of later ones is below 2 |u|: less than
   !> 8 (2**-8)**7/(1 - 2**-7) = 1.1e-16, half a unit in the last place.
   real(wp), parameter :: near = 2.0_wp**(-8)

   !> The equations, one lane per ball.
   type :: shell_lanes_type
      !> K, stiffness of the shell: [lane_count].
      real(wp) :: stiffness(lane_count)
      !> A, absolute pressure of the gas in the undeformed ball: [lane_count].
      real(wp) :: gas_pressure(lane_count)
      !> B, pressure of the air: [lane_count].
      real(wp) :: air_pressure(lane_count)
      !> -gamma: [lane_count].
      real(wp) :: exponent(lane_count)
      !> Coefficients of the binomial series: [lane_count, term_count].
      real(wp) :: series(lane_count, term_count)
      !> Deflection at which the shell closes, 1 - h/R: [lane_count].
      real(wp) :: closing(lane_count)
      !> Factor s of the flux term in the present phase: [lane_count].
      real(wp) :: weight(lane_count)
   end type shell_lanes_type

   !> States, in diameters, steps and masses.
   type :: state_lanes_type
      !> y: [lane_count].
      real(wp) :: deflection(lane_count)
      !> z: [lane_count].
      real(wp) :: velocity(lane_count)
      !> Impulse given to the floor over 2 R M/h: [lane_count].
      real(wp) :: impulse(lane_count)
      !> Energy lost over 4 R**2 M/h**2: [lane_count].
      real(wp) :: loss(lane_count)
   end type state_lanes_type

   !> Where the pressure is known.
   type :: anchor_lanes_type
      !> 1/x: [lane_count].
      real(wp) :: inverse(lane_count)
      !> A x**(-gamma): [lane_count].
      real(wp) :: pressure(lane_count)
   end type anchor_lanes_type

contains

   !> Coefficients of (1 + u)**(-gamma) from the exponents.
   pure subroutine set_series(shell)
      !> The equations, their exponents set.
      type(shell_lanes_type), intent(inout) :: shell
      integer :: j

      shell%series(:, 1) = shell%exponent
      do j = 2, term_count
         shell%series(:, j) = shell%series(:, j - 1)*(shell%exponent - (j - 1))/j
      end do
   end subroutine set_series

   !> Elastic force e; private, so that compilers put it into the loops.
   elemental function get_elastic_force(deflection, stiffness, overpressure) result(force)
      !> y.
      real(wp), intent(in) :: deflection
      !> K.
      real(wp), intent(in) :: stiffness
      !> A x**(-gamma) - B.
      real(wp), intent(in) :: overpressure
      !> e.
      real(wp) :: force

      force = deflection*(stiffness + (1 - deflection)*overpressure)
   end function get_elastic_force

   !> Ratio of volumes x.
   elemental function get_ratio(deflection) result(ratio)
      !> y.
      real(wp), intent(in) :: deflection
      !> x.
      real(wp) :: ratio

      ratio = (1 - deflection)*(1 - deflection)*(1 + 2*deflection)
   end function get_ratio

   !> Puts the anchors where the pressure is not a number: everywhere at first, later where the
   !> series did not reach. Pressures outside the domain of the equation stay NaN.
   pure subroutine set_anchors(shell, y, pressure, anchor)
      !> The equations.
      type(shell_lanes_type), intent(in) :: shell
      !> Deflection: [lane_count].
      real(wp), intent(in) :: y(lane_count)
      !> A x**(-gamma): [lane_count].
      real(wp), intent(inout) :: pressure(lane_count)
      !> The anchors.
      type(anchor_lanes_type), intent(inout) :: anchor
      real(wp) :: power(lane_count)
      integer :: i

      call raise(lane_count, get_ratio(y), shell%exponent, power)
      !$omp simd
      do i = 1, lane_count
         if (.not. abs(pressure(i)) <= huge(1.0_wp) .and. y(i) < shell%closing(i)) then
            pressure(i) = shell%gas_pressure(i)*power(i)
            anchor%pressure(i) = pressure(i)
            anchor%inverse(i) = 1/get_ratio(y(i))
         end if
      end do
   end subroutine set_anchors

   !> Pressures of the gas, by the series about the anchors; anchors that are too far are moved.
   pure subroutine get_pressures(shell, y, anchor, pressure)
      !> The equations.
      type(shell_lanes_type), intent(in) :: shell
      !> Deflection: [lane_count].
      real(wp), intent(in) :: y(lane_count)
      !> The anchors.
      type(anchor_lanes_type), intent(inout) :: anchor
      !> A x**(-gamma); NaN outside the domain of the equation: [lane_count].
      real(wp), intent(out) :: pressure(lane_count)
      real(wp) :: u, outside, missed
      integer :: i

      missed = 0.0_wp
      !$omp simd private(u, outside) reduction(+: missed)
      do i = 1, lane_count
         u = get_ratio(y(i))*anchor%inverse(i) - 1
         ! Added, because a choice between the two would not be vectorised.
         outside = merge(0.0_wp, not_a_number, abs(u) <= near .and. y(i) < shell%closing(i))
         pressure(i) = outside + anchor%pressure(i)*(1 + u*(shell%series(i, 1) + u*(shell%series(i, 2) &
            + u*(shell%series(i, 3) + u*(shell%series(i, 4) + u*(shell%series(i, 5) + u*shell%series(i, 6)))))))
         missed = missed + outside
      end do
      if (.not. missed <= 0.0_wp) call set_anchors(shell, y, pressure, anchor)
   end subroutine get_pressures

   !> Forces of the present states.
   pure subroutine get_forces(shell, state, pressure, unit, elastic_force, floor_force)
      !> The equations.
      type(shell_lanes_type), intent(in) :: shell
      !> The states.
      type(state_lanes_type), intent(in) :: state
      !> A x**(-gamma): [lane_count].
      real(wp), intent(in) :: pressure(lane_count)
      !> Unit of the forces, N: [lane_count].
      real(wp), intent(in) :: unit(lane_count)
      !> Force of shell and gas, N: [lane_count].
      real(wp), intent(out) :: elastic_force(lane_count)
      !> Force on the floor, N: [lane_count].
      real(wp), intent(out) :: floor_force(lane_count)
      real(wp) :: force
      integer :: i

      !$omp simd private(force)
      do i = 1, lane_count
         force = get_elastic_force(state%deflection(i), shell%stiffness(i), pressure(i) - shell%air_pressure(i))
         elastic_force(i) = unit(i)*force
         floor_force(i) = unit(i)*(force + (1 - shell%weight(i))*state%velocity(i)**2)
      end do
   end subroutine get_forces

   !> One classical step, or part of one, as `rk4_step`.
   pure subroutine take_step(shell, state, length, start_pressure, anchor, new)
      !> The equations.
      type(shell_lanes_type), intent(in) :: shell
      !> State at the beginning.
      type(state_lanes_type), intent(in) :: state
      !> Length, in whole steps: [lane_count].
      real(wp), intent(in) :: length(lane_count)
      !> A x**(-gamma) at the beginning: [lane_count].
      real(wp), intent(in) :: start_pressure(lane_count)
      !> The anchors.
      type(anchor_lanes_type), intent(inout) :: anchor
      !> State at the end; NaN where a stage has left the domain of the equation.
      type(state_lanes_type), intent(out) :: new
      real(wp), dimension(lane_count) :: half, y2, y3, y4, z2, z3, z4, net1, net2, net3, pressure
      real(wp) :: net4, flux_sum, sixth
      integer :: i

      half = length/2
      call take_stage(shell, state, state%deflection, state%velocity, start_pressure, half, net1, y2, z2)
      call get_pressures(shell, y2, anchor, pressure)
      call take_stage(shell, state, y2, z2, pressure, half, net2, y3, z3)
      call get_pressures(shell, y3, anchor, pressure)
      call take_stage(shell, state, y3, z3, pressure, length, net3, y4, z4)
      call get_pressures(shell, y4, anchor, pressure)
      !$omp simd private(net4, flux_sum, sixth)
      do i = 1, lane_count
         associate (y0 => state%deflection(i), z0 => state%velocity(i), s => shell%weight(i))
            net4 = s*z4(i)**2 - get_elastic_force(y4(i), shell%stiffness(i), pressure(i) - shell%air_pressure(i))
            sixth = length(i)/6
            new%deflection(i) = y0 + sixth*(z0 + 2*(z2(i) + z3(i)) + z4(i))
            ! The velocities of the stages hold the accelerations of those before.
            new%velocity(i) = (z2(i) + 2*z3(i) + z4(i) - z0)/3 + sixth*(net4/(1 - y4(i)))
            ! The floor bears the elastic force and (1 - s) times the flux: flux - net.
            flux_sum = z0**2 + 2*(z2(i)**2 + z3(i)**2) + z4(i)**2
            new%impulse(i) = state%impulse(i) + sixth*(flux_sum - (net1(i) + 2*(net2(i) + net3(i)) + net4))
            flux_sum = z0**3 + 2*(z2(i)**3 + z3(i)**3) + z4(i)**3
            new%loss(i) = state%loss(i) + sixth*((0.5_wp - s)*flux_sum)
         end associate
      end do
   end subroutine take_step

   !> Acceleration of one stage, and the place of the next.
   pure subroutine take_stage(shell, state, y, z, pressure, portion, net, next_y, next_z)
      !> The equations.
      type(shell_lanes_type), intent(in) :: shell
      !> State at the beginning of the step.
      type(state_lanes_type), intent(in) :: state
      !> Deflection of this stage: [lane_count].
      real(wp), intent(in) :: y(lane_count)
      !> Velocity of this stage: [lane_count].
      real(wp), intent(in) :: z(lane_count)
      !> A x**(-gamma) of this stage: [lane_count].
      real(wp), intent(in) :: pressure(lane_count)
      !> How far to go for the next stage, in steps: [lane_count].
      real(wp), intent(in) :: portion(lane_count)
      !> (1 - y) dz/dt of this stage: [lane_count].
      real(wp), intent(out) :: net(lane_count)
      !> Deflection of the next stage: [lane_count].
      real(wp), intent(out) :: next_y(lane_count)
      !> Velocity of the next stage: [lane_count].
      real(wp), intent(out) :: next_z(lane_count)
      integer :: i

      !$omp simd
      do i = 1, lane_count
         net(i) = shell%weight(i)*z(i)**2 &
            - get_elastic_force(y(i), shell%stiffness(i), pressure(i) - shell%air_pressure(i))
         next_z(i) = state%velocity(i) + portion(i)*(net(i)/(1 - y(i)))
         next_y(i) = state%deflection(i) + portion(i)*z(i)
      end do
   end subroutine take_stage

end module thud_shell_lanes
