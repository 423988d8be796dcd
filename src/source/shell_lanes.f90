!> The equation of motion of the shell model (see `thud_hollow_sphere`) for many balls side by side, one
!> per lane of the processor's vectors.
!>
!> With the deflection y in diameters 2R and the time in steps h, z = dy/dt, the equation
!> m a = s (M/2R) v**2 - F_B - F_G becomes
!>
!>    dz/dt = s z**2/(1 - y) - y c,   c = K/(1 - y) + A x**(-gamma) - B,   x = (1 - y)**2 (1 + 2y)
!>
!> with K = k h**2/M, A = 2 pi R (p_a + p_g) h**2/M, B = 2 pi R p_a h**2/M; forces are in 2 R M/h**2.
!> x is the ratio of volumes; written as a product it has no cancellation where the shell closes.
module thud_shell_lanes
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: lane_count, shell_lanes_type, state_lanes_type

   !> Balls side by side: several vectors, so that the latency of one is filled by the others, and
   !> few enough that their forces stay in cache.
   integer, parameter :: lane_count = 32

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
      !> Deflection at which the shell closes, 1 - h/R: [lane_count].
      real(wp) :: closing(lane_count)
      !> Unit of the forces, N: [lane_count].
      real(wp) :: force_unit(lane_count)
      !> Factor s of the flux term in the present phase.
      real(wp) :: weight
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

end module thud_shell_lanes
