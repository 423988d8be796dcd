!> A floating plate on a resilient layer, on any plate: its keys, and the power that it lets through.
module thud_screed
   use thud_constants, only: pi
   use thud_field, only: field_type, new_field, only_with
   use thud_kinds, only: wp
   use thud_plate, only: air_type, get_bending_stiffness, get_surface_mass, get_total_loss, plate_type
   implicit none (type, external)
   private

   public :: get_lower_conductance, get_screed_fields, get_screed_plate, screed_type

   !> The floating plate, simply supported; no thickness means none. The other defaults are those of a cement screed on
   !> mineral wool.
   type :: screed_type
      !> Thickness, m; density, kg/m3; longitudinal wave speed, m/s; loss factor.
      real(wp) :: thickness = 0.0_wp, density = 2000.0_wp, wave_speed = 3500.0_wp, loss_factor = 0.03_wp
      !> Dynamic stiffness of the layer per unit area, N/m3, and its loss factor.
      real(wp) :: layer_stiffness = 1.0e7_wp, layer_loss_factor = 0.1_wp
   end type screed_type

contains

   !> Keys and allowed ranges.
   function get_screed_fields(screed) result(fields)
      !> The plate that the fields read and set.
      type(screed_type), intent(in), target :: screed
      type(field_type), allocatable :: fields(:)

      fields = [ &
         new_field('screed_thickness', screed%thickness, 'm', 'thickness of a floating plate; 0: none', '[0, 0.5]'), &
         only_with('screed_thickness', [ &
         new_field('screed_density', screed%density, 'kg/m3', 'density of the floating plate', '[10, 20000]'), &
         new_field('screed_wave_speed', screed%wave_speed, 'm/s', &
         'speed of longitudinal waves in the floating plate', '[100, 10000]'), &
         new_field('screed_loss_factor', screed%loss_factor, '', 'loss factor of the floating plate', '[0, 1]'), &
         new_field('layer_stiffness', screed%layer_stiffness, 'N/m3', &
         'dynamic stiffness of the resilient layer per unit area (ISO 9052-1)', '[1e4, 1e12]'), &
         new_field('layer_loss_factor', screed%layer_loss_factor, '', 'loss factor of the resilient layer', '[0, 1]')])]
   end function get_screed_fields

   !> The floating plate on another plate.
   elemental function get_screed_plate(screed, below) result(plate)
      type(screed_type), intent(in) :: screed
      type(plate_type), intent(in) :: below
      type(plate_type) :: plate

      plate = plate_type(length=below%length, width=below%width, thickness=screed%thickness, density=screed%density, &
         wave_speed=screed%wave_speed, loss_factor=screed%loss_factor)
   end function get_screed_plate

   !> Power omega eta2 m2 <v2**2> of the lower plate per mean-square force on the floating plate, for infinite plates and a
   !> layer without bending stiffness (Cremer, Heckl and Petersson, *Structure-Borne Sound*). It stands for the mean-square
   !> velocity, which radiates; the potential energy, and with it the power dissipated, differs by up to 4 dB.
   !>
   !> With the wavenumber k and u = k**2, the response of the lower plate is h2 = s/(B1 B2 (u**2 - q1) (u**2 - q2)) with the
   !> roots q of the determinant. The power is omega**3 eta2 m2/(4 pi) integral of |h2|**2 du, solved by partial fractions
   !> with integral du/(u**2 - q) = pi/(2 sqrt(-q)).
   elemental function get_lower_conductance(screed, lower, air, frequency) result(conductance)
      type(screed_type), intent(in) :: screed
      !> The plate below, and the air that it radiates into.
      type(plate_type), intent(in) :: lower
      type(air_type), intent(in) :: air
      !> Frequency, Hz.
      real(wp), intent(in) :: frequency
      !> The conductance, m/(N s).
      real(wp) :: conductance
      type(plate_type) :: upper
      complex(wp) :: root(4)
      complex(wp) :: b1, b2, s, c1, c2, half, term, total
      real(wp) :: omega
      integer :: i, j

      omega = 2*pi*frequency
      upper = get_screed_plate(screed, lower)
      b1 = get_bending_stiffness(upper)*cmplx(1.0_wp, upper%loss_factor, wp)
      b2 = get_bending_stiffness(lower)*cmplx(1.0_wp, get_total_loss(lower, air, frequency), wp)
      s = screed%layer_stiffness*cmplx(1.0_wp, screed%layer_loss_factor, wp)
      c1 = (s - get_surface_mass(upper)*omega**2)/b1
      c2 = (s - get_surface_mass(lower)*omega**2)/b2
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
      conductance = omega**3*b2%im/b2%re*get_surface_mass(lower)*abs(s/(b1*b2))**2/8*real(total)
   end function get_lower_conductance

end module thud_screed
