!> The gas in the ball: adiabatic, of uniform pressure, in the volume inside the deformed inner surface.
module thud_cavity
   use thud_ball, only: ball_type
   use thud_constants, only: pi
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: add_gas_forces, cavity_type, get_gas_energy, get_gas_pressure, get_volume, new_cavity

   !> The gas at first touch.
   type :: cavity_type
      !> Volume, m3.
      real(wp) :: volume = 0.0_wp
      !> Pressure in the undeformed ball, Pa.
      real(wp) :: pressure = 0.0_wp
      !> Pressure of the air around the ball, Pa.
      real(wp) :: ambient = 0.0_wp
      !> Ratio of specific heats.
      real(wp) :: exponent = 1.0_wp
   end type cavity_type

contains

   !> The gas of a ball.
   pure function new_cavity(ball, r, z) result(cavity)
      type(ball_type), intent(in) :: ball
      !> Distances of the nodes of the inner surface from the axis, undeformed, m: [0:n].
      real(wp), intent(in) :: r(0:)
      !> Their heights, m: [0:n].
      real(wp), intent(in) :: z(0:)
      type(cavity_type) :: cavity

      cavity%volume = get_volume(r, z)
      cavity%pressure = ball%ambient_pressure + ball%gauge_pressure
      cavity%ambient = ball%ambient_pressure
      cavity%exponent = ball%heat_capacity_ratio
   end function new_cavity

   !> Volume inside a surface of frustums, m3.
   pure function get_volume(r, z) result(volume)
      !> Distances of the nodes from the axis, m: [0:n].
      real(wp), intent(in) :: r(0:)
      !> Heights of the nodes, from the lowest to the highest pole, m: [0:n].
      real(wp), intent(in) :: z(0:)
      real(wp) :: volume
      integer :: n

      n = ubound(r, 1)
      volume = pi/3*sum((r(:n - 1)**2 + r(:n - 1)*r(1:) + r(1:)**2)*(z(1:) - z(:n - 1)))
   end function get_volume

   !> Overpressure of the gas.
   pure function get_gas_pressure(cavity, volume) result(pressure)
      type(cavity_type), intent(in) :: cavity
      !> Volume, above 0, m3.
      real(wp), intent(in) :: volume
      !> Pressure above that of the air around the ball, Pa.
      real(wp) :: pressure

      pressure = cavity%pressure*(cavity%volume/volume)**cavity%exponent - cavity%ambient
   end function get_gas_pressure

   !> Work that changes the volume from that at first touch, done on the gas and on the air around the ball, J.
   pure function get_gas_energy(cavity, volume) result(energy)
      type(cavity_type), intent(in) :: cavity
      !> Volume, above 0, m3.
      real(wp), intent(in) :: volume
      real(wp) :: energy
      real(wp) :: ratio

      ratio = cavity%volume/volume
      associate (power => cavity%exponent - 1)
         if (power > 1.0e-6_wp) then
            energy = cavity%pressure*cavity%volume*(ratio**power - 1)/power
         else
            energy = cavity%pressure*cavity%volume*log(ratio)
         end if
      end associate
      energy = energy + cavity%ambient*(volume - cavity%volume)
   end function get_gas_energy

   !> Adds the forces of an overpressure: its product with the gradient of the volume.
   pure subroutine add_gas_forces(pressure, r, z, force_r, force_z)
      !> Overpressure, Pa.
      real(wp), intent(in) :: pressure
      !> Distances of the nodes of the inner surface from the axis, m: [0:n].
      real(wp), intent(in) :: r(0:)
      !> Their heights, m: [0:n].
      real(wp), intent(in) :: z(0:)
      !> Forces outwards, N: [0:n].
      real(wp), intent(inout) :: force_r(0:)
      !> Forces upwards, N: [0:n].
      real(wp), intent(inout) :: force_z(0:)
      real(wp) :: scale, area
      integer :: j

      scale = pressure*pi/3
      do j = 1, ubound(r, 1)
         area = r(j - 1)**2 + r(j - 1)*r(j) + r(j)**2
         force_z(j - 1) = force_z(j - 1) - scale*area
         force_z(j) = force_z(j) + scale*area
         force_r(j - 1) = force_r(j - 1) + scale*(2*r(j - 1) + r(j))*(z(j) - z(j - 1))
         force_r(j) = force_r(j) + scale*(2*r(j) + r(j - 1))*(z(j) - z(j - 1))
      end do
   end subroutine add_gas_forces

end module thud_cavity
