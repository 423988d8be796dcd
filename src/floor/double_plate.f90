!> Two plates with a resilient layer and bridges between them: the power into the lower plate.
module thud_double_plate
   use thud_constants, only: pi
   use thud_kinds, only: wp
   use thud_plate, only: air_type, get_bending_stiffness, get_mode_density, get_resistance, get_surface_mass, &
      get_total_loss, plate_type
   implicit none (type, external)
   private

   public :: double_plate_type, get_bridge_conductance, get_lower_conductance

   !> Both plates and the layer.
   type :: double_plate_type
      !> Plate under the source, and plate above the room, of equal length and width.
      type(plate_type) :: upper, lower
      !> Dynamic stiffness of the layer per unit area, N/m3, and its loss factor.
      real(wp) :: layer_stiffness = 0.0_wp, layer_loss = 0.0_wp
      !> Number of bridges, and stiffness of one, N/m.
      integer :: bridge_count = 0
      real(wp) :: bridge_stiffness = 0.0_wp
      !> Air that the lower plate radiates into.
      type(air_type) :: air
   end type double_plate_type

contains

   !> Power into the lower plate per mean-square force on the upper plate, for infinite plates and a layer without bending
   !> stiffness (Cremer, Heckl and Petersson, *Structure-Borne Sound*).
   !>
   !> With the wavenumber k and u = k**2, the response of the lower plate is h2 = s/(B1 B2 (u**2 - q1) (u**2 - q2)) with the
   !> roots q of the determinant. The plate dissipates omega Im B2/(4 pi) integral of u**2 |h2|**2 du, solved by partial
   !> fractions with integral du/(u**2 - q) = pi/(2 sqrt(-q)). It dissipates all power that it receives.
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
         term = root(i)/sqrt(-root(i))
         do j = 1, 4
            if (j /= i) term = term/(root(i) - root(j))
         end do
         total = total + term
      end do
      conductance = omega*b2%im*abs(s/(b1*b2))**2/8*real(total)
   end function get_lower_conductance

   !> Power into the lower plate through bridges per mean-square force on the upper plate (Cremer, Heckl and Petersson).
   !>
   !> Bridges that are farther apart than half a bending wave of the upper plate act one by one. It receives 1/Z1, which it
   !> and the layer dissipate and the bridges transmit: with its velocity v, a bridge exerts the force v/(1/Z1 + 1/Z2 +
   !> i w/k) on the lower plate. Plates are infinite in Z1 and Z2, the sound field of the upper plate is diffuse, and as much
   !> energy flows back as makes that of all modes equal if nothing is dissipated. Below the resonance f0 of the plates on
   !> the layer both move together: the factor 1/(1 + (f0/f)**4).
   !>
   !> Closer ones act together, like a layer of their stiffness per area: stiff ones make one plate of both.
   elemental function get_bridge_conductance(floor, frequency) result(conductance)
      type(double_plate_type), intent(in) :: floor
      !> Frequency, Hz.
      real(wp), intent(in) :: frequency
      !> The conductance, m/(N s).
      real(wp) :: conductance
      real(wp) :: omega, transmitted, returned, resonance, separate, ratio
      real(wp) :: dissipated(2)
      type(double_plate_type) :: joined

      conductance = 0.0_wp
      if (floor%bridge_count == 0) return
      omega = 2*pi*frequency
      associate (z1 => get_resistance(floor%upper), z2 => get_resistance(floor%lower), k => floor%bridge_stiffness, &
         area => floor%upper%length*floor%upper%width)
         ! Powers per mean-square velocity of each plate.
         dissipated(1) = area*(omega*floor%upper%loss_factor*get_surface_mass(floor%upper) &
            + floor%layer_stiffness*floor%layer_loss/omega)
         dissipated(2) = area*omega*get_total_loss(floor%lower, floor%air, frequency)*get_surface_mass(floor%lower)
         transmitted = floor%bridge_count/z2/((1/z1 + 1/z2)**2 + (omega/k)**2)
         returned = transmitted*get_mode_density(floor%upper)/get_mode_density(floor%lower) &
            *get_surface_mass(floor%lower)/get_surface_mass(floor%upper)
         resonance = sqrt(floor%layer_stiffness*(1/get_surface_mass(floor%upper) + 1/get_surface_mass(floor%lower)))
         separate = transmitted/(dissipated(1)*(1 + returned/dissipated(2)) + transmitted)/z1/(1 + (resonance/omega)**4)
         ! Distance of the bridges over half a bending wave, squared.
         ratio = area/floor%bridge_count*omega*sqrt(get_surface_mass(floor%upper)/get_bending_stiffness(floor%upper))/pi**2
         joined = floor
         joined%layer_stiffness = floor%layer_stiffness + floor%bridge_count*k/area
         conductance = (ratio**2*separate + get_lower_conductance(joined, frequency) &
            - get_lower_conductance(floor, frequency))/(1 + ratio**2)
      end associate
   end function get_bridge_conductance

end module thud_double_plate
