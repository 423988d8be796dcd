!> Two plates with a resilient layer between them: the power that the motion of the lower plate dissipates.
module thud_double_plate
   use thud_constants, only: pi
   use thud_kinds, only: wp
   use thud_plate, only: air_type, get_bending_stiffness, get_surface_mass, get_total_loss, plate_type
   implicit none (type, external)
   private

   public :: double_plate_type, get_lower_conductance

   !> Both plates and the layer.
   type :: double_plate_type
      !> Plate under the source, and plate above the room, of equal length and width.
      type(plate_type) :: upper, lower
      !> Dynamic stiffness of the layer per unit area, N/m3, and its loss factor.
      real(wp) :: layer_stiffness = 0.0_wp, layer_loss = 0.0_wp
      !> Air that the lower plate radiates into.
      type(air_type) :: air
   end type double_plate_type

contains

   !> Power omega eta2 m2 <v2**2> of the lower plate per mean-square force on the upper plate, for infinite plates and a
   !> layer without bending stiffness (Cremer, Heckl and Petersson, *Structure-Borne Sound*). It stands for the mean-square
   !> velocity, which radiates; the potential energy, and with it the power dissipated, differs by up to 4 dB.
   !>
   !> With the wavenumber k and u = k**2, the response of the lower plate is h2 = s/(B1 B2 (u**2 - q1) (u**2 - q2)) with the
   !> roots q of the determinant. The power is omega**3 eta2 m2/(4 pi) integral of |h2|**2 du, solved by partial fractions
   !> with integral du/(u**2 - q) = pi/(2 sqrt(-q)).
   elemental function get_lower_conductance(floor, frequency) result(conductance)
      type(double_plate_type), intent(in) :: floor
      !> Frequency, Hz.
      real(wp), intent(in) :: frequency
      !> The conductance, m/(N s).
      real(wp) :: conductance
      complex(wp) :: root(4)
      complex(wp) :: b1, b2, s, c1, c2, half, term, total
      real(wp) :: omega
      integer :: i, j

      omega = 2*pi*frequency
      b1 = get_bending_stiffness(floor%upper)*cmplx(1.0_wp, floor%upper%loss_factor, wp)
      b2 = get_bending_stiffness(floor%lower)*cmplx(1.0_wp, get_total_loss(floor%lower, floor%air, frequency), wp)
      s = floor%layer_stiffness*cmplx(1.0_wp, floor%layer_loss, wp)
      c1 = (s - get_surface_mass(floor%upper)*omega**2)/b1
      c2 = (s - get_surface_mass(floor%lower)*omega**2)/b2
      half = sqrt(((c1 - c2)/2)**2 + s**2/(b1*b2))
      root(1:2) = -(c1 + c2)/2 + [half, -half]
      root(3:4) = conjg(root(1:2))
      total = 0.0_wp
      do i = 1, 4
         term = 1/sqrt(-root(i))
         do j = 1, 4
            if (j /= i) term = term/(root(i) - root(j))
         end do
         total = total + term
      end do
      conductance = omega**3*b2%im/b2%re*get_surface_mass(floor%lower)*abs(s/(b1*b2))**2/8*real(total)
   end function get_lower_conductance

end module thud_double_plate
