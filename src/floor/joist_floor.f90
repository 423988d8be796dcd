!> A timber joist floor: sheathing on parallel joists, as an orthotropic plate with smeared joists, and the sheathing
!> between two of them.
module thud_joist_floor
   use thud_constants, only: pi
   use thud_error, only: error_type
   use thud_field, only: field_type, name_length
   use thud_floor_model, only: floor_model_type, reason_length
   use thud_kinds, only: wp
   use thud_modal_receiver, only: new_modal_receiver
   use thud_new_field, only: choice_field, real_field
   use thud_plate, only: air_type, get_resistance, get_surface_mass, get_total_loss, plate_type
   use thud_plate_modes, only: check_inside, check_losses, check_mode_count, far, get_half_waves, get_modal_stiffness, &
      get_shape, mode_limit, rest_corner
   use thud_receiver, only: receiver_type
   implicit none (type, external)
   private

   public :: joist_floor_type

   !> Static compliance of sheathing that runs over many rigid joists, in the middle between two, times B'/spacing**2. One
   !> span alone has 0.01696 (Timoshenko and Woinowsky-Krieger), three 0.01130, five 0.01108, seven 0.01107.
   real(wp), parameter :: local_compliance = 0.01107_wp

   !> Shear modulus of softwood over its modulus of elasticity (EN 338).
   real(wp), parameter :: shear_ratio = 1.0_wp/16

   !> The floor; the defaults are chipboard screwed to softwood joists.
   type, extends(floor_model_type) :: joist_floor_type
      !> Span of the joists and width across them, m.
      real(wp) :: length = 4.0_wp, width = 5.0_wp
      !> Thickness of the sheathing, m; its density, kg/m3; its modulus of elasticity in bending, Pa.
      real(wp) :: sheathing_thickness = 0.022_wp, sheathing_density = 650.0_wp, sheathing_modulus = 3.0e9_wp
      !> Distance between the axes of joists, m.
      real(wp) :: spacing = 0.4_wp
      !> Width and height of a joist, m; its density, kg/m3; its modulus of elasticity, Pa.
      real(wp) :: joist_width = 0.06_wp, joist_height = 0.22_wp, joist_density = 420.0_wp, joist_modulus = 1.1e10_wp
      !> Share of the full composite action of sheathing and joists.
      real(wp) :: connection = 0.1_wp
      !> Loss factor with that of the edges, without radiation.
      real(wp) :: loss_factor = 0.05_wp
      !> Place of the source, over length and width; `sheathing` between two joists, or a `joist`.
      real(wp) :: source_x = 0.5_wp, source_y = 0.5_wp
      character(len=name_length) :: source_on = 'sheathing'
   contains
      procedure, pass(options) :: get_fields
      procedure, pass(options) :: check
      procedure, pass(options) :: get_receiver
      procedure, pass(options) :: get_transfer
      procedure, pass(options) :: get_radiator
      procedure, pass(options) :: get_validity
   end type joist_floor_type

contains

   !> Keys and allowed ranges of the group `&joist_floor`.
   function get_fields(options) result(fields)
      !> The options that the fields read and set.
      class(joist_floor_type), intent(in), target :: options
      !> One field per component, and the points: [17].
      type(field_type), allocatable :: fields(:)

      fields = [ &
         real_field('length', options%length, 'm', 'span of the joists', '[0.5, 100]'), &
         real_field('width', options%width, 'm', 'width of the floor across the joists', '[0.5, 100]'), &
         real_field('sheathing_thickness', options%sheathing_thickness, 'm', 'thickness of the sheathing', '[0.003, 0.3]'), &
         real_field('sheathing_density', options%sheathing_density, 'kg/m3', 'density of the sheathing', '[10, 20000]'), &
         real_field('sheathing_modulus', options%sheathing_modulus, 'Pa', &
         'modulus of elasticity of the sheathing in bending', '[1e7, 1e12]'), &
         real_field('spacing', options%spacing, 'm', 'distance between the axes of two joists', '(joist_width, width)'), &
         real_field('joist_width', options%joist_width, 'm', 'width of a joist', '[0.005, 1]'), &
         real_field('joist_height', options%joist_height, 'm', 'height of a joist', '[0.01, 2]'), &
         real_field('joist_density', options%joist_density, 'kg/m3', 'density of the joists', '[10, 20000]'), &
         real_field('joist_modulus', options%joist_modulus, 'Pa', 'modulus of elasticity of the joists', '[1e7, 1e12]'), &
         real_field('connection', options%connection, '', &
         'composite action of sheathing and joists, from 0, loose, to 1, glued (EN 1995-1-1 annex B)', '[0, 1]'), &
         real_field('loss_factor', options%loss_factor, '', &
         'loss factor of the floor and its edges, without radiation', '(0, 1]'), &
         real_field('source_x', options%source_x, '', 'relative source position along the joists', '(0, 1)'), &
         real_field('source_y', options%source_y, '', 'relative source position across the joists', '(0, 1)'), &
         choice_field('source_on', options%source_on, &
         'impact location: sheathing between joists, or a joist', [character(len=9) :: 'sheathing', 'joist']), &
         options%get_point_fields()]
   end function get_fields

   !> Refuses floors with too many modes.
   subroutine check(options, error)
      class(joist_floor_type), intent(in) :: options
      !> Names the size.
      type(error_type), allocatable, intent(out) :: error

      call check_mode_count('joist_floor', get_smeared(options), error)
   end subroutine check

   !> The orthotropic plate with smeared joists, as thick as the sheathing.
   !>
   !> Along the joists EI of the composite section over the spacing (EN 1995-1-1 annex B, equations B.1 to B.6), across them
   !> the sheathing, H = B' of the sheathing + G J of a joist/(2 spacing) (Timoshenko and Woinowsky-Krieger).
   pure function get_smeared(options) result(plate)
      class(joist_floor_type), intent(in) :: options
      type(plate_type) :: plate
      real(wp) :: across, along, torsion, upper, lower, eccentricity, below, mass

      across = get_sheathing_stiffness(options)
      associate (e => options%joist_modulus, b => options%joist_width, h => options%joist_height, &
         t => options%sheathing_thickness, a => options%spacing)
         upper = options%connection*options%sheathing_modulus*t*a
         lower = e*b*h
         eccentricity = (h + t)/2
         below = upper*eccentricity/(upper + lower)
         along = across + (e*b*h**3/12 + upper*(eccentricity - below)**2 + lower*below**2)/a
         torsion = across + shear_ratio*e*get_torsion_constant(b, h)/(2*a)
         mass = options%sheathing_density*t + options%joist_density*b*h/a
      end associate
      plate = plate_type(length=options%length, width=options%width, thickness=options%sheathing_thickness, &
         density=mass/options%sheathing_thickness, stiffness_ratio=across/along, torsion_ratio=torsion/sqrt(along*across), &
         loss_factor=options%loss_factor, edges='absorption')
      plate%wave_speed = sqrt(12*sqrt(along*across)/mass)/plate%thickness
   end function get_smeared

   !> Bending stiffness of the sheathing over width.
   pure function get_sheathing_stiffness(options) result(stiffness)
      class(joist_floor_type), intent(in) :: options
      !> The stiffness, N m.
      real(wp) :: stiffness

      stiffness = options%sheathing_modulus*options%sheathing_thickness**3/12
   end function get_sheathing_stiffness

   !> Torsion constant of a rectangle, within 0.5 % (Roark).
   pure function get_torsion_constant(width, height) result(constant)
      !> Sides, m.
      real(wp), intent(in) :: width, height
      !> The constant, m4.
      real(wp) :: constant

      associate (short => min(width, height), long => max(width, height))
         constant = long*short**3*(1.0_wp/3 - 0.21_wp*short/long*(1 - (short/long)**4/12))
      end associate
   end function get_torsion_constant

   !> Band in which joists can be smeared.
   subroutine get_validity(options, lowest, highest, reason)
      class(joist_floor_type), intent(in) :: options
      !> Ends of the band, Hz.
      real(wp), intent(out) :: lowest, highest
      !> What ends it.
      character(len=reason_length), intent(out) :: reason

      lowest = 0.0_wp
      highest = get_smeared_limit(options)
      reason = 'half a bending wave of the sheathing is shorter than the spacing of the joists, which cannot be smeared'
   end subroutine get_validity

   !> Frequency at which half a bending wave of the sheathing is as long as the distance between joists.
   pure function get_smeared_limit(options) result(frequency)
      class(joist_floor_type), intent(in) :: options
      !> The frequency, Hz.
      real(wp) :: frequency

      frequency = pi/(2*options%spacing**2) &
         *sqrt(get_sheathing_stiffness(options)/(options%sheathing_density*options%sheathing_thickness))
   end function get_smeared_limit

   !> What a source feels.
   subroutine get_receiver(options, receiver, error)
      class(joist_floor_type), intent(in) :: options
      type(receiver_type), intent(out) :: receiver
      !> The losses are too high.
      type(error_type), allocatable, intent(out) :: error

      call get_point_receiver(options, [options%source_x, options%source_y], .true., receiver, error)
   end subroutine get_receiver

   !> Velocity of another point: on or near a joist, as the smeared plate moves.
   subroutine get_transfer(options, x, y, transfer, error)
      class(joist_floor_type), intent(in) :: options
      !> Place of the point, m.
      real(wp), intent(in) :: x, y
      type(receiver_type), intent(out) :: transfer
      !> The point lies outside, or the losses are too high.
      type(error_type), allocatable, intent(out) :: error

      call check_inside('joist_floor', options%length, options%width, x, y, error)
      if (.not. allocated(error)) call get_point_receiver(options, [x/options%length, y/options%width], .false., transfer, &
         error)
   end subroutine get_transfer

   !> Modes of the smeared plate, across the joists at most as many half waves as there are bays. Under a source on the
   !> sheathing the rest is that of the sheathing between two joists: its static compliance, and the conductance of the
   !> infinite sheathing at high frequencies. Under one on a joist it is that of the smeared plate.
   subroutine get_point_receiver(options, point, under_source, receiver, error)
      class(joist_floor_type), intent(in) :: options
      !> Place of the point, over length and width.
      real(wp), intent(in) :: point(2)
      !> The point is that of the source.
      logical, intent(in) :: under_source
      type(receiver_type), intent(out) :: receiver
      !> There are too many modes, or the losses are too high.
      type(error_type), allocatable, intent(out) :: error
      type(plate_type) :: plate
      integer, allocatable :: m(:), n(:)
      real(wp), allocatable :: omega(:), gain(:), loss_factor(:)
      logical, allocatable :: smeared(:), single(:)
      real(wp) :: rest, corner

      plate = get_smeared(options)
      call check_mode_count('joist_floor', plate, error)
      if (allocated(error)) return
      call get_half_waves(plate, far*mode_limit, m, n)
      omega = sqrt(get_modal_stiffness(plate, m, n)/get_surface_mass(plate))
      smeared = n <= int(options%width/options%spacing)
      single = smeared .and. omega < 2*pi*mode_limit
      gain = 4/(get_surface_mass(plate)*plate%length*plate%width) &
         *get_shape(m, n, [options%source_x, options%source_y])*get_shape(m, n, point)
      loss_factor = get_total_loss(plate, air_type(), pack(omega, single)/(2*pi))
      call check_losses('joist_floor', pack(omega, single), loss_factor, error)
      if (allocated(error)) return
      corner = rest_corner
      if (under_source .and. options%source_on == 'sheathing') then
         rest = get_local_compliance(options)
         corner = get_local_corner(options)
      else
         rest = sum(gain/omega**2, mask=smeared .and. .not. single)
      end if
      call new_modal_receiver(pack(gain, single), pack(omega, single), loss_factor, rest, corner, receiver)
   end subroutine get_point_receiver

   !> Resistance of the infinite sheathing without joists.
   pure function get_sheathing_resistance(options) result(resistance)
      class(joist_floor_type), intent(in) :: options
      !> The resistance, N s/m.
      real(wp) :: resistance

      resistance = 8*sqrt(get_sheathing_stiffness(options)*options%sheathing_density*options%sheathing_thickness)
   end function get_sheathing_resistance

   !> Static compliance of the sheathing between two joists.
   pure function get_local_compliance(options) result(compliance)
      class(joist_floor_type), intent(in) :: options
      !> The compliance, m/N.
      real(wp) :: compliance

      compliance = local_compliance*options%spacing**2/get_sheathing_stiffness(options)
   end function get_local_compliance

   !> Corner above which the sheathing between two joists is infinite, 0.8 times the limit of the smeared plate.
   pure function get_local_corner(options) result(corner)
      class(joist_floor_type), intent(in) :: options
      !> The corner, rad/s.
      real(wp) :: corner

      corner = 1/(get_sheathing_resistance(options)*sqrt(2.0_wp)*get_local_compliance(options))
   end function get_local_corner

   !> The smeared plate, which gets what it gets as an infinite one and what the sheathing gets between joists.
   subroutine get_radiator(options, frequency, plate, conductance, error)
      class(joist_floor_type), intent(in) :: options
      !> Frequencies, Hz: [n].
      real(wp), intent(in) :: frequency(:)
      type(plate_type), intent(out) :: plate
      !> The power over the mean square of the force, m/(N s): [n].
      real(wp), intent(out) :: conductance(:)
      !> Never.
      type(error_type), allocatable, intent(out) :: error

      plate = get_smeared(options)
      conductance = 1/get_resistance(plate)
      if (options%source_on == 'sheathing') conductance = conductance + 1/(get_sheathing_resistance(options) &
         *(1 + (get_local_corner(options)/(2*pi*frequency))**4))
   end subroutine get_radiator

end module thud_joist_floor
