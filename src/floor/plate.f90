!> A homogeneous rectangular plate, isotropic or orthotropic: resistance if infinite, radiation and losses (ISO 12354-1).
module thud_plate
   use thud_constants, only: pi
   use thud_field, only: field_type, name_length, new_field
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: air_type, get_bending_stiffness, get_critical_frequency, get_mode_density, get_plate_fields
   public :: get_plate_radiation, get_radiation_factor, get_resistance, get_surface_mass, get_thin_limit
   public :: get_total_loss, plate_type

   !> Number of wave directions of an orthotropic plate; the mean of their radiation factors errs by 2 %.
   integer, parameter :: n_direction = 64

   !> Mean absorption coefficient of the edges of a slab in a building: the one of the worked example of ISO 12354, whose
   !> floor (220 mm of concrete, 5 m x 4 m) loses as much in each one-third-octave band from 50 to 630 Hz within 0.3 %.
   real(wp), parameter :: building_absorption = 0.148_wp

   !> Air in the rooms.
   type :: air_type
      !> Density, kg/m3.
      real(wp) :: density = 1.2_wp
      !> Speed of sound, m/s.
      real(wp) :: sound_speed = 343.0_wp
   end type air_type

   !> A plate; the defaults are a concrete floor in a building.
   type :: plate_type
      !> Length and width, m.
      real(wp) :: length = 5.0_wp, width = 4.0_wp
      !> Thickness, m.
      real(wp) :: thickness = 0.18_wp
      !> Density, kg/m3.
      real(wp) :: density = 2300.0_wp
      !> Speed of longitudinal waves in the plate, m/s; for an orthotropic plate, the speed that belongs to the geometric
      !> mean of both bending stiffnesses.
      real(wp) :: wave_speed = 3500.0_wp
      !> Ratio of the bending stiffness along the width to that along the length.
      real(wp) :: stiffness_ratio = 1.0_wp
      !> Ratio of the twisting stiffness H to the geometric mean of both bending stiffnesses.
      real(wp) :: torsion_ratio = 1.0_wp
      !> Internal loss factor.
      real(wp) :: loss_factor = 0.005_wp
      !> Losses at the edges: `building`, `laboratory`, or `absorption` for given absorption coefficients.
      character(len=name_length) :: edges = 'building'
      !> Sum over the edges of length times absorption coefficient, m.
      real(wp) :: edge_absorption = 0.0_wp
      !> Total loss factors that are known at frequencies, Hz, and replace the sum of losses: [n].
      real(wp), allocatable :: known_frequency(:), known_loss(:)
   end type plate_type

   !> Range of frequencies over which known loss factors are averaged, as a ratio to its middle: a one-third octave.
   real(wp), parameter :: averaged_ratio = 2**(1.0_wp/6)

contains

   !> Keys and allowed ranges of the group `&plate`.
   function get_plate_fields(plate, is_optional) result(fields)
      !> The plate that the fields read and set.
      type(plate_type), intent(in), target :: plate
      !> A thickness of 0 means that there is no plate.
      logical, intent(in) :: is_optional
      !> One field per key: [10].
      type(field_type), allocatable :: fields(:)

      fields = [ &
         new_field('length', plate%length, 'm', 'length of the floor', '[0.5, 100]'), &
         new_field('width', plate%width, 'm', 'width of the floor', '[0.5, 100]'), &
         new_field('thickness', plate%thickness, 'm', 'thickness of the floor', '[0.001, 2]'), &
         new_field('density', plate%density, 'kg/m3', 'density of the floor', '[10, 20000]'), &
         new_field('wave_speed', plate%wave_speed, 'm/s', 'speed of longitudinal waves in the floor', '[100, 10000]'), &
         new_field('stiffness_ratio', plate%stiffness_ratio, '', &
         'ratio of the bending stiffness along the width to that along the length', '[0.0001, 10000]'), &
         new_field('torsion_ratio', plate%torsion_ratio, '', &
         'ratio of the twisting stiffness to the geometric mean of both bending stiffnesses', '[0, 1]'), &
         new_field('loss_factor', plate%loss_factor, '', 'internal loss factor of the floor', '[0, 1]'), &
         new_field('edges', plate%edges, '', 'losses at the edges of the floor', &
         choices=[character(len=10) :: 'building', 'laboratory', 'absorption']), &
         new_field('edge_absorption', plate%edge_absorption, 'm', &
         'sum of edge lengths times absorption coefficients, for absorption', '[0, 1000]')]
      if (is_optional) fields(3) = new_field('thickness', plate%thickness, 'm', &
         'thickness of the plate that radiates into a room; 0: none', '[0, 2]')
   end function get_plate_fields

   !> Mass per unit area, kg/m2.
   elemental function get_surface_mass(plate) result(mass)
      type(plate_type), intent(in) :: plate
      real(wp) :: mass

      mass = plate%density*plate%thickness
   end function get_surface_mass

   !> Bending stiffness per unit width, B' = m'' c_L**2 h**2/12, the geometric mean of both directions.
   elemental function get_bending_stiffness(plate) result(stiffness)
      type(plate_type), intent(in) :: plate
      !> The stiffness, N m.
      real(wp) :: stiffness

      stiffness = get_surface_mass(plate)*(plate%wave_speed*plate%thickness)**2/12
   end function get_bending_stiffness

   !> Resistance of the infinite plate, 8 sqrt(B' m'') M with a mean M over the directions.
   elemental function get_resistance(plate) result(resistance)
      type(plate_type), intent(in) :: plate
      !> The resistance, N s/m.
      real(wp) :: resistance

      resistance = 8*sqrt(get_bending_stiffness(plate)*get_surface_mass(plate))*get_directional_mean(plate%torsion_ratio)
   end function get_resistance

   !> Mean M over the directions of an orthotropic plate: Z = 8 sqrt(B' m'') M, mode density S/2 sqrt(m''/B')/M.
   !>
   !> 1/Z = 1/(4 pi sqrt(m'')) integral over 0 to pi/2 of (Bx cos**4 + 2 H cos**2 sin**2 + By sin**4)**(-1/2), a complete
   !> elliptic integral: M = agm(1, sqrt((1 + H/sqrt(Bx By))/2)).
   elemental function get_directional_mean(torsion_ratio) result(mean)
      !> H/sqrt(Bx By).
      real(wp), intent(in) :: torsion_ratio
      real(wp) :: mean
      real(wp) :: geometric, next
      integer :: i

      mean = 1.0_wp
      geometric = sqrt((1 + torsion_ratio)/2)
      ! The start is at least 0.7: four steps converge to rounding.
      do i = 1, 4
         next = (mean + geometric)/2
         geometric = sqrt(mean*geometric)
         mean = next
      end do
   end function get_directional_mean

   !> Critical frequency, c0**2/(2 pi) sqrt(m''/B'); ISO 12354 rounds it to c0**2/(1.8 c_L h).
   elemental function get_critical_frequency(plate, air) result(frequency)
      type(plate_type), intent(in) :: plate
      type(air_type), intent(in) :: air
      !> The frequency, Hz.
      real(wp) :: frequency

      frequency = air%sound_speed**2/(2*pi)*sqrt(get_surface_mass(plate)/get_bending_stiffness(plate))
   end function get_critical_frequency

   !> Frequency at which bending waves are six thicknesses long. Above it, the wave speed of thin-plate theory errs by more
   !> than a tenth (Cremer, Heckl and Petersson, *Structure-Borne Sound*). The stiffer direction decides.
   elemental function get_thin_limit(plate) result(frequency)
      type(plate_type), intent(in) :: plate
      !> The frequency, Hz.
      real(wp) :: frequency
      real(wp) :: stiffness

      stiffness = get_bending_stiffness(plate)*sqrt(max(plate%stiffness_ratio, 1/plate%stiffness_ratio))
      frequency = (2*pi/(6*plate%thickness))**2*sqrt(stiffness/get_surface_mass(plate))/(2*pi)
   end function get_thin_limit

   !> Bending modes per hertz, S/2 sqrt(m''/B')/M.
   elemental function get_mode_density(plate) result(density)
      type(plate_type), intent(in) :: plate
      !> Modes per hertz, s.
      real(wp) :: density

      density = plate%length*plate%width/2*sqrt(get_surface_mass(plate)/get_bending_stiffness(plate)) &
         /get_directional_mean(plate%torsion_ratio)
   end function get_mode_density

   !> Radiation factor of an isotropic plate for free waves, at most 2 (ISO 12354-1 annex B).
   elemental function get_radiation_factor(frequency, critical, length, width, sound_speed) result(sigma)
      !> Frequency and critical frequency, Hz.
      real(wp), intent(in) :: frequency, critical
      !> Sides of the plate, m; speed of sound, m/s.
      real(wp), intent(in) :: length, width, sound_speed
      real(wp) :: sigma
      real(wp) :: first, above, plate_modes, diffuse, edge, corner, lambda

      associate (f => frequency, c0 => sound_speed, area => length*width, perimeter => 2*(length + width))
         first = c0**2/(4*critical)*(1/length**2 + 1/width**2)
         above = 2.0_wp
         if (f > critical) above = min(2.0_wp, 1/sqrt(1 - critical/f))
         plate_modes = 4*area*(f/c0)**2
         diffuse = sqrt(2*pi*f*(length + width)/(16*c0))
         if (first > critical/2) then
            sigma = diffuse
            if (f < critical) sigma = min(sigma, plate_modes)
            if (f > critical) sigma = min(sigma, above)
         else if (f >= critical) then
            sigma = above
         else
            lambda = sqrt(f/critical)
            edge = ((1 - lambda**2)*log((1 + lambda)/(1 - lambda)) + 2*lambda)/(4*pi**2*(1 - lambda**2)**1.5_wp)
            corner = 0.0_wp
            if (f <= critical/2) corner = 8*c0**2*(1 - 2*lambda**2)/(critical**2*pi**4*area*lambda*sqrt(1 - lambda**2))
            sigma = perimeter/area*(c0/critical)*edge + corner
            if (f < first .and. first < critical/2) sigma = min(sigma, plate_modes)
         end if
         sigma = min(sigma, 2.0_wp)
      end associate
   end function get_radiation_factor

   !> Radiation factor of a plate, averaged over its free waves.
   !>
   !> In each direction the plate radiates like the isotropic plate with the stiffness
   !> Bx cos**4 + 2 H cos**2 sin**2 + By sin**4. All modes have the same energy, and the number of modes per angle is
   !> proportional to 1/sqrt(stiffness). With tan(theta) = (Bx/By)**(1/4) tan(phi) this number is
   !> (cos**4 + 2 H/B' cos**2 sin**2 + sin**4)**(-1/2) per phi, which is smooth.
   elemental function get_plate_radiation(plate, air, frequency) result(sigma)
      type(plate_type), intent(in) :: plate
      type(air_type), intent(in) :: air
      !> Frequency, Hz.
      real(wp), intent(in) :: frequency
      !> The factor, at most 2.
      real(wp) :: sigma
      real(wp), dimension(n_direction) :: cos_squared, sin_squared, slowness, critical
      real(wp) :: mean, stretch
      integer :: i

      mean = get_critical_frequency(plate, air)
      if (all(abs([plate%stiffness_ratio, plate%torsion_ratio] - 1) <= 0.0_wp)) then
         sigma = get_radiation_factor(frequency, mean, plate%length, plate%width, air%sound_speed)
         return
      end if
      cos_squared = [(cos((i - 0.5_wp)*pi/(2*n_direction))**2, i=1, n_direction)]
      sin_squared = 1 - cos_squared
      stretch = plate%stiffness_ratio**0.25_wp
      slowness = 1/sqrt(cos_squared**2 + 2*plate%torsion_ratio*cos_squared*sin_squared + sin_squared**2)
      critical = mean*(cos_squared*stretch + sin_squared/stretch)*slowness
      sigma = sum(slowness*get_radiation_factor(frequency, critical, plate%length, plate%width, air%sound_speed)) &
         /sum(slowness)
   end function get_plate_radiation

   !> Total loss factor: internal, radiation of both sides, edges (ISO 12354-1 annex C).
   elemental function get_total_loss(plate, air, frequency, radiation_factor) result(loss_factor)
      type(plate_type), intent(in) :: plate
      type(air_type), intent(in) :: air
      !> Frequency, Hz.
      real(wp), intent(in) :: frequency
      !> Mean radiation factor of both sides (default: that of free waves).
      real(wp), intent(in), optional :: radiation_factor
      real(wp) :: loss_factor
      real(wp) :: sigma, absorption

      if (allocated(plate%known_loss)) then
         loss_factor = get_known_loss(plate, frequency)
         return
      end if
      if (plate%edges == 'laboratory') then
         ! The laboratory loss includes radiation.
         loss_factor = plate%loss_factor + get_surface_mass(plate)/(485*sqrt(frequency))
         return
      end if
      absorption = plate%edge_absorption
      if (plate%edges == 'building') absorption = building_absorption*2*(plate%length + plate%width)
      if (present(radiation_factor)) then
         sigma = radiation_factor
      else
         sigma = get_plate_radiation(plate, air, frequency)
      end if
      loss_factor = plate%loss_factor &
         + 2*air%density*air%sound_speed*sigma/(2*pi*frequency*get_surface_mass(plate)) &
         + air%sound_speed/(pi**2*plate%length*plate%width*sqrt(frequency*get_critical_frequency(plate, air))) &
         *absorption
   end function get_total_loss

   !> Mean of the known total loss factors around a frequency, or the nearest one.
   pure function get_known_loss(plate, frequency) result(loss_factor)
      type(plate_type), intent(in) :: plate
      !> Frequency, Hz.
      real(wp), intent(in) :: frequency
      real(wp) :: loss_factor

      associate (ratio => plate%known_frequency/frequency)
         associate (near => ratio > 1/averaged_ratio .and. ratio < averaged_ratio)
            if (any(near)) then
               loss_factor = sum(plate%known_loss, mask=near)/count(near)
            else
               loss_factor = plate%known_loss(minloc(abs(log(ratio)), dim=1))
            end if
         end associate
      end associate
   end function get_known_loss

end module thud_plate
