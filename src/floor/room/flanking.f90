!> Walls below a floor that take energy from it through their junctions and radiate into the room.
module thud_flanking
   use thud_constants, only: pi
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type, list_type, name_length, new_field, only_with
   use thud_kinds, only: wp
   use thud_plate, only: air_type, get_critical_frequency, get_surface_mass, plate_type
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: check_walls, get_junction_rate, get_vibration_reduction, get_wall_fields, get_walls, walls_type

   !> Types of junction: rigid ones, or one given by its vibration reduction index.
   character(len=*), parameter :: junctions(*) = [character(len=5) :: 'cross', 't', 'index']

   !> Reference frequency of the vibration reduction index, Hz (ISO 12354-1).
   real(wp), parameter :: reference_frequency = 1000.0_wp

   !> Walls, each along a part of the floor's edge. Lists have one value for all walls or one for each.
   type :: walls_type
      !> Lengths of the junctions with the floor, m, one per wall.
      type(list_type) :: lengths
      !> Height, m.
      real(wp) :: height = 2.5_wp
      !> Thicknesses, m.
      type(list_type) :: thickness = list_type(count=1, values=0.2_wp)
      !> Densities, kg/m3.
      type(list_type) :: density = list_type(count=1, values=2300.0_wp)
      !> Speeds of longitudinal waves, m/s.
      type(list_type) :: wave_speed = list_type(count=1, values=3500.0_wp)
      !> Internal loss factors.
      type(list_type) :: loss_factor = list_type(count=1, values=0.005_wp)
      !> Rigid junction at which the wall continues above the floor, and the floor continues behind the wall (`cross`) or
      !> does not (`t`), or a junction given by its index (`index`).
      character(len=name_length) :: junction = 'cross'
      !> Vibration reduction indices between floor and walls, dB, for the junction `index`.
      type(list_type) :: index = list_type(count=1, values=10.0_wp)
   end type walls_type

contains

   !> Keys and allowed ranges.
   function get_wall_fields(walls) result(fields)
      !> The walls that the fields read and set.
      type(walls_type), intent(in), target :: walls
      !> One field per component: [8].
      type(field_type), allocatable :: fields(:)

      fields = [ &
         new_field('wall_lengths', walls%lengths, 'm', &
         'lengths of the flanking walls along the floor (default: no walls)', '[0.1, 100]'), &
         only_with('wall_lengths', [ &
         new_field('wall_height', walls%height, 'm', 'height of the walls', '[0.5, 20]'), &
         new_field('wall_thickness', walls%thickness, 'm', 'thickness of the walls: one, or one for each of ' &
         //'wall_lengths', '[0.005, 2]'), &
         new_field('wall_density', walls%density, 'kg/m3', 'density of the walls: one, or one for each', &
         '[10, 20000]'), &
         new_field('wall_wave_speed', walls%wave_speed, 'm/s', &
         'speed of longitudinal waves in the walls: one, or one for each', '[100, 10000]'), &
         new_field('wall_loss_factor', walls%loss_factor, '', &
         'internal loss factor of the walls: one, or one for each', '[0, 1]'), &
         new_field('wall_junction', walls%junction, '', &
         'junction of floor and walls: rigid cross or T, or described by junction_index', choices=junctions)]), &
         only_with('wall_junction', [new_field('junction_index', walls%index, 'dB', &
         'vibration reduction index from floor to wall, for wall_junction index: one, or one for each wall', &
         '[-10, 80]')], junctions(3:))]
   end function get_wall_fields

   !> Checks the numbers of values of the walls.
   subroutine check_walls(walls, error)
      type(walls_type), intent(in) :: walls
      !> Set if a list has neither one value nor one for each wall.
      type(error_type), allocatable, intent(out) :: error
      character(len=16), parameter :: keys(*) = [character(len=16) :: 'wall_thickness', 'wall_density', 'wall_wave_speed', &
         'wall_loss_factor', 'junction_index']
      type(list_type) :: lists(size(keys))
      integer :: i

      if (walls%lengths%count == 0) return
      lists = [walls%thickness, walls%density, walls%wave_speed, walls%loss_factor, walls%index]
      i = findloc(lists%count /= 1 .and. lists%count /= walls%lengths%count, .true., dim=1)
      if (i > 0) error = input_error('has '//to_text(lists(i)%count)//' values; allowed: 1, or 1 for each of the ' &
         //to_text(walls%lengths%count)//' wall_lengths', 'room', trim(keys(i)))
   end subroutine check_walls

   !> The value of a wall in a list of one value for all or one for each.
   elemental function get_value(list, wall) result(value)
      type(list_type), intent(in) :: list
      !> Number of the wall.
      integer, intent(in) :: wall
      real(wp) :: value

      value = list%values(min(wall, list%count))
   end function get_value

   !> The walls as plates: [n_wall].
   pure function get_walls(walls) result(plates)
      type(walls_type), intent(in) :: walls
      type(plate_type), allocatable :: plates(:)
      integer :: i

      allocate (plates(walls%lengths%count))
      do i = 1, size(plates)
         plates(i) = plate_type(length=walls%lengths%values(i), width=walls%height, &
            thickness=get_value(walls%thickness, i), density=get_value(walls%density, i), &
            wave_speed=get_value(walls%wave_speed, i), loss_factor=get_value(walls%loss_factor, i))
      end do
   end function get_walls

   !> Vibration reduction index from floor to a wall (ISO 12354-1 annex E): the given index, or 8.7 + 5.7 M**2 dB for a rigid
   !> cross and 5.7 + 5.7 M**2 dB for a rigid T, M being the decimal logarithm of the mass ratio. The minimum is
   !> 10 lg(l l0 (1/S1 + 1/S2)), l0 = 1 m.
   pure function get_vibration_reduction(walls, floor, wall, number) result(index)
      type(walls_type), intent(in) :: walls
      type(plate_type), intent(in) :: floor, wall
      !> Number of the wall.
      integer, intent(in) :: number
      !> The index, dB.
      real(wp) :: index
      real(wp) :: ratio

      ratio = log10(get_surface_mass(floor)/get_surface_mass(wall))
      select case (walls%junction)
       case ('cross')
         index = 8.7_wp + 5.7_wp*ratio**2
       case ('t')
         index = 5.7_wp + 5.7_wp*ratio**2
       case default
         index = get_value(walls%index, number)
      end select
      index = max(index, 10*log10(wall%length*(1/(floor%length*floor%width) + 1/(wall%length*wall%width))))
   end function get_vibration_reduction

   !> Rate at which energy flows from the floor into a wall.
   !>
   !> The index is K = D + 10 lg(l/sqrt(a1 a2)) with the mean D of the velocity level differences in both directions and
   !> a = pi**2 S eta sqrt(1000 Hz f)/c0 (ISO 12354-1). With D = 5 lg(eta1 eta2/(eta12 eta21)) and n1 eta12 = n2 eta21, the
   !> total loss factors eta1 and eta2 cancel: eta12 = l c0/(pi**2 S1 sqrt(1000 Hz f)) sqrt(fc2/fc1) 10**(-K/10)
   !> (Nightingale and Bosmans 2003).
   elemental function get_junction_rate(floor, wall, air, index, frequency) result(rate)
      type(plate_type), intent(in) :: floor, wall
      type(air_type), intent(in) :: air
      !> Vibration reduction index, dB; frequency, Hz.
      real(wp), intent(in) :: index, frequency
      !> The rate, 1/s.
      real(wp) :: rate

      rate = 2*pi*frequency*wall%length*air%sound_speed &
         /(pi**2*floor%length*floor%width*sqrt(reference_frequency*frequency)) &
         *sqrt(get_critical_frequency(wall, air)/get_critical_frequency(floor, air))*10**(-index/10)
   end function get_junction_rate

end module thud_flanking
