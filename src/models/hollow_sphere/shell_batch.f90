!> The equation of motion of the shell model (see `thud_hollow_sphere`) for a batch of balls, one per lane of the processor's
!> vectors.
!>
!> With the deflection y in diameters 2R and the time in steps h, z = dy/dt, the equation
!> m a = s (M/2R) v**2 - F_B - F_G becomes
!>
!>    dz/dt = s z**2/(1 - y) - y c,   c = K/(1 - y) + A x**(-gamma) - B,   x = (1 - y)**2 (1 + 2y)
!>
!> with K = k h**2/M, A = 2 pi R (p_a + p_g) h**2/M, B = 2 pi R p_a h**2/M; forces are in 2 R M/h**2.
!> x is the ratio of volumes; written as a product it has no cancellation where the shell closes.
module thud_shell_batch
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: batch_size, shell_batch_type, state_batch_type

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

   !> States; units are diameters, steps and masses.
   type, bind(c) :: state_batch_type
      !> y: [batch_size].
      real(wp) :: deflection(batch_size)
      !> z: [batch_size].
      real(wp) :: velocity(batch_size)
      !> Impulse on the floor, in units of 2 R M/h: [batch_size].
      real(wp) :: impulse(batch_size)
      !> Energy lost, in units of 4 R**2 M/h**2: [batch_size].
      real(wp) :: loss(batch_size)
   end type state_batch_type

end module thud_shell_batch
