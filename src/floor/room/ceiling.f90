!> A light ceiling without rigid connection to the floor: its mass on the cavity's stiffness, and the sound in the cavity.
module thud_ceiling
   use thud_constants, only: pi
   use thud_field, only: field_type, new_field, only_with
   use thud_kinds, only: wp
   use thud_plate, only: air_type
   implicit none (type, external)
   private

   public :: ceiling_type, get_cavity_mode_density, get_ceiling_fields, get_forced_velocity_ratio, get_mass_law

   !> A ceiling; a mass of 0 means no ceiling.
   type :: ceiling_type
      !> Mass per unit area, kg/m2.
      real(wp) :: mass = 0.0_wp
      !> Depth of the cavity above it, m.
      real(wp) :: depth = 0.1_wp
      !> Loss factor of the cavity, high with absorber in it.
      real(wp) :: loss_factor = 0.3_wp
   end type ceiling_type

contains

   !> Keys and allowed ranges.
   function get_ceiling_fields(ceiling) result(fields)
      !> The ceiling that the fields read and set.
      type(ceiling_type), intent(in), target :: ceiling
      !> One field per component: [3].
      type(field_type), allocatable :: fields(:)

      fields = [ &
         new_field('ceiling_mass', ceiling%mass, 'kg/m2', 'mass per unit area of a suspended ceiling; 0: none', &
         '[0, 200]'), &
         only_with('ceiling_mass', [ &
         new_field('ceiling_depth', ceiling%depth, 'm', 'depth of the air cavity above the ceiling', '[0.01, 2]'), &
         new_field('ceiling_loss_factor', ceiling%loss_factor, '', 'loss factor of the ceiling cavity', '[0.001, 1]')])]
   end function get_ceiling_fields

   !> Ratio of the squared velocity of the ceiling to that of the floor, averaged over a band. The floor drives the ceiling
   !> through the stiffness of the air; the ceiling's mass and its radiation resistance rho0 c0 sigma oppose the motion:
   !> abs((1 + i eta)/(1 + i eta + i k depth sigma - (f/f0)**2))**2, f0 = sqrt(rho0 c0**2/(depth mass))/(2 pi)
   !> (eta: loss factor, sigma: radiation factor, k: wavenumber in air).
   elemental function get_forced_velocity_ratio(ceiling, air, radiation_factor, lower, upper) result(ratio)
      type(ceiling_type), intent(in) :: ceiling
      type(air_type), intent(in) :: air
      !> Radiation factor of floor and ceiling.
      real(wp), intent(in) :: radiation_factor
      !> Edges of the band, Hz.
      real(wp), intent(in) :: lower, upper
      real(wp) :: ratio
      complex(wp) :: b
      real(wp) :: period, damping

      ! The smallest number replaces a product of depth and mass that underflows.
      period = 2*pi*sqrt(max(ceiling%depth*ceiling%mass/(air%density*air%sound_speed**2), tiny(1.0_wp)))
      damping = ceiling%loss_factor + 2*pi*sqrt(lower*upper)*ceiling%depth*radiation_factor/air%sound_speed
      associate (low => lower*period, high => upper*period)
         ! 1/((1 - x**2)**2 + damping**2) = Im(1/(b**2 - x**2))/damping with b**2 = 1 - i damping, and
         ! atanh(high/b) - atanh(low/b) = atanh((high - low) b/(b**2 - low high)) without a multiple of i pi, because the
         ! imaginary parts of both lie between 0 and pi/2.
         b = sqrt(cmplx(1.0_wp, -damping, wp))
         ratio = (1 + ceiling%loss_factor**2)/(damping*(high - low))*aimag(atanh((high - low)*b/(b**2 - low*high))/b)
      end associate
   end function get_forced_velocity_ratio

   !> Modes per hertz of the cavity: lateral modes for each number of half waves that fits across its depth.
   elemental function get_cavity_mode_density(ceiling, air, area, frequency) result(density)
      type(ceiling_type), intent(in) :: ceiling
      type(air_type), intent(in) :: air
      !> Area of the ceiling, m2; frequency, Hz.
      real(wp), intent(in) :: area, frequency
      !> Modes per hertz, s.
      real(wp) :: density

      density = 2*pi*area*frequency/air%sound_speed**2*(1 + int(2*ceiling%depth*frequency/air%sound_speed))
   end function get_cavity_mode_density

   !> Transmission coefficient of the ceiling by its mass: 5 dB above that of normal incidence for a heavy ceiling (field
   !> incidence), 1 for a ceiling without mass.
   elemental function get_mass_law(ceiling, air, frequency) result(transmission)
      type(ceiling_type), intent(in) :: ceiling
      type(air_type), intent(in) :: air
      !> Frequency, Hz.
      real(wp), intent(in) :: frequency
      real(wp) :: transmission

      transmission = 1/(1 + (pi*frequency*ceiling%mass/(air%density*air%sound_speed))**2/sqrt(10.0_wp))
   end function get_mass_law

end module thud_ceiling
