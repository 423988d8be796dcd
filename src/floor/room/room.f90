!> The room below a floor, the keys of the group `&room`, and the level that an impact causes in it.
module thud_room
   use thud_band, only: band_type
   use thud_ceiling, only: ceiling_type, get_ceiling_fields
   use thud_constants, only: pi
   use thud_energy_flow, only: energy_flow_type, get_fast_level
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type, list_type, name_length, new_field
   use thud_flanking, only: check_walls, get_wall_fields, walls_type
   use thud_kinds, only: wp
   use thud_plate, only: air_type, plate_type
   use thud_rating, only: get_a_weighted_level, get_rated_bands, get_standardization, rating_names
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: add_ratings, box_type, check_below, check_below_subceiling, check_room, finished_room, get_rating_index
   public :: get_room_fields, modal_radiation, new_box, of_thirds, place, positions_of_rating, room_level_type, room_type

   !> A room whose reverberation time contains all its losses, as measured ones do.
   character(len=*), parameter :: finished_room = 'finished'

   !> Radiation factor by the modes of the floor.
   character(len=*), parameter :: modal_radiation = 'modes'

   !> Positions of ball and microphone: those of the standard of the rating, 5 of KS F 2810-2, or 16 even ones.
   character(len=*), parameter :: positions_of_rating = 'rating', standard_positions = 'standard'

   !> Number of overlapping modes of the room above which the sound is statistical.
   real(wp), parameter :: overlap_limit = 3.0_wp

   !> Distance of standard positions from the walls, m, and height of the microphones, m (KS F 2810-2).
   real(wp), parameter :: wall_distance = 0.75_wp, microphone_height = 1.2_wp

   !> Number of standard positions, and of even ones, of ball and of microphone.
   integer, parameter :: n_standard = 5, n_even = 16

   !> Distance of even positions from the walls, m (ISO 16283-2).
   real(wp), parameter :: even_distance = 0.5_wp

   !> Columns of levels at the positions of the rating of octaves, and of the others.
   integer, parameter :: of_octaves = 1, of_thirds = 2

   !> Number of one-third-octave bands in an octave.
   integer, parameter :: bands_per_octave = 3

   !> Height of a room of which neither height nor volume is stated, m.
   real(wp), parameter :: default_height = 2.5_wp

   !> Largest relative difference between a volume and the product of length, width and height.
   real(wp), parameter :: volume_tolerance = 0.01_wp

   !> Relative difference of sides that are equal but for rounding.
   real(wp), parameter :: rounding = 1.0e-9_wp

   !> Smallest volume, m3.
   real(wp), parameter :: min_volume = 1.0_wp

   !> Numbers of reverberation times: one for all bands, one for each octave or each one-third-octave band.
   integer, parameter :: time_counts(3) = [1, 4, 12]

   !> The room.
   type :: room_type
      !> Length and width, m; 0: those of the floor.
      real(wp) :: length = 0.0_wp, width = 0.0_wp
      !> Height, m; 0: the volume divided by the area, or 2.5 m.
      real(wp) :: height = 0.0_wp
      !> Volume, m3; 0: the product of length, width and height.
      real(wp) :: volume = 0.0_wp
      !> Reverberation time, s: one, or one for each octave or one-third-octave band.
      type(list_type) :: reverberation_time = list_type(count=1, values=0.5_wp)
      !> What the reverberation time contains: all losses of the finished room (`finished`), or those of its own without
      !> the flow into floor, walls and ceiling (`bare`).
      character(len=name_length) :: reverberation_of = finished_room
      !> Air in the room.
      type(air_type) :: air
      !> Flanking walls.
      type(walls_type) :: walls
      !> Suspended ceiling.
      type(ceiling_type) :: ceiling
      !> Position of the corner of the room below the floor, m.
      real(wp) :: corner_x = 0.0_wp, corner_y = 0.0_wp
      !> Radiation factor of the floor: by its `modes`, or by `iso_12354`.
      character(len=name_length) :: radiation = modal_radiation
      !> Positions of ball and microphone: those of the rating, `standard` or `even` ones.
      character(len=name_length) :: positions = positions_of_rating
      !> The rating that is asked for, one of `rating_names`.
      character(len=name_length) :: rating = rating_names(2)
      !> Maximum of that rating that is required, dB; 0: none.
      real(wp) :: required = 0.0_wp
   end type room_type

   !> The room as a box, and positions in it.
   type :: box_type
      !> Length, width and height, m.
      real(wp) :: sides(3) = 0.0_wp
      !> Volume, m3, as stated: within 1 % of their product.
      real(wp) :: volume = 0.0_wp
      !> Position of its corner below the floor, m.
      real(wp) :: corner(2) = 0.0_wp
      type(air_type) :: air
      !> One-third-octave bands and the reverberation times in them, s: [n_band].
      type(band_type), allocatable :: bands(:)
      real(wp), allocatable :: reverberation_time(:)
      !> Highest mid frequency of a band whose sound follows from modes, Hz: that above which the modes of the room overlap
      !> so much that its sound is statistical.
      real(wp) :: crossover = 0.0_wp
      !> Positions of the ball on the floor and of the microphone, from the corner of the room, m: [2, n_ball], [3, n_mic].
      real(wp), allocatable :: ball(:, :), microphone(:, :)
   end type box_type

   !> A prediction in one-third-octave bands.
   type :: room_level_type
      !> The one-third-octave bands: [n_band].
      type(band_type), allocatable :: bands(:)
      !> Power into the floor per mean-square force, m/(N s): [n_band].
      real(wp), allocatable :: conductance(:)
      !> The octave levels of the source conform to the standards.
      logical :: source_conforms = .true.
      !> Mass per unit area of the radiating plate, kg/m2.
      real(wp) :: surface_mass = 0.0_wp
      !> The room.
      type(box_type) :: box
      !> Energy that the impact injects into the floor, J: [n_band].
      real(wp), allocatable :: energy(:)
      !> Radiation factor and total loss factor of the floor: [n_band].
      real(wp), allocatable :: radiation_factor(:), loss_factor(:)
      !> Fractions of the energy that enters the room, over all times: from the floor, directly or through a ceiling, and
      !> from each flanking wall: [n_band, 1 + n_wall].
      real(wp), allocatable :: path_share(:, :)
      !> Energies of floor, walls and room after the impact, and the maximum Fast level that follows from them, dB re
      !> 20 uPa: [n_band].
      type(energy_flow_type), allocatable :: flow(:)
      real(wp), allocatable :: statistical_level(:)
      !> Maximum Fast level in the room by modes and energies, dB, energy mean over the positions for the rating of octaves,
      !> and for the others: [n_band, 2].
      real(wp), allocatable :: rated_level(:, :)
      !> That for the rating that is asked for, and its standard uncertainty, dB: [n_band].
      real(wp), allocatable :: level(:), uncertainty(:)
      !> The level with simply supported and with clamped edges, dB: [n_band, 2].
      real(wp), allocatable :: edge_level(:, :)
      !> Number of bands whose level follows from the modes of floor and room; the others are statistical.
      integer :: n_modal = 0
      !> Octave bands and their levels, dB: [n_octave].
      type(band_type), allocatable :: octaves(:)
      real(wp), allocatable :: octave_level(:)
      !> Ratings in the order of `rating_names`, not rounded, dB, and their standard uncertainty, dB.
      real(wp) :: rating(size(rating_names)) = 0.0_wp
      real(wp) :: rating_uncertainty = 0.0_wp
      !> Standard uncertainties that add up to it by their squares, dB: [n_contribution].
      real(wp), allocatable :: contribution(:)
      !> Probability that the requirement of the room is met.
      real(wp) :: probability = 0.0_wp
   end type room_level_type

contains

   !> Keys and allowed ranges of the group `&room`.
   function get_room_fields(room) result(fields)
      !> The room that the fields read and set.
      type(room_type), intent(in), target :: room
      !> One field per component: [n_field].
      type(field_type), allocatable :: fields(:)

      fields = [ &
         new_field('length', room%length, 'm', 'length of the room; 0: that of the floor', '[0, 100]', &
         trait='derived'), &
         new_field('width', room%width, 'm', 'width of the room; 0: that of the floor', '[0, 100]', &
         trait='derived'), &
         new_field('height', room%height, 'm', 'height of the room; 0: from the volume, without it 2.5 m', '[0, 100]', &
         trait='derived'), &
         new_field('volume', room%volume, 'm3', 'volume of the room; 0: length times width times height', '[0, 100000]', &
         trait='derived'), &
         new_field('reverberation_time', room%reverberation_time, 's', 'reverberation time of the room: one, ' &
         //'4 for octaves or 12 for one-third octaves', '[0.05, 20]'), &
         new_field('reverberation_of', room%reverberation_of, '', 'room of the reverberation time: finished, or bare, ' &
         //'without floor, walls and ceiling', choices=[character(len=8) :: finished_room, 'bare']), &
         new_field('air_density', room%air%density, 'kg/m3', 'density of the air', '[0.5, 2]'), &
         new_field('sound_speed', room%air%sound_speed, 'm/s', 'speed of sound in the air', '[200, 500]'), &
         get_wall_fields(room%walls), get_ceiling_fields(room%ceiling), &
         new_field('corner_x', room%corner_x, 'm', 'position of the room along the length of a larger floor', '[0, 100)'), &
         new_field('corner_y', room%corner_y, 'm', 'position of the room along the width of a larger floor', '[0, 100)'), &
         new_field('radiation', room%radiation, '', 'radiation factor of the floor, by its modes or by ISO 12354-1', &
         choices=[character(len=9) :: modal_radiation, 'iso_12354']), &
         new_field('positions', room%positions, '', &
         'positions of ball and microphone: those of the rating, 5 standard ones each (octaves), or 16 even ones each', &
         choices=[character(len=8) :: positions_of_rating, standard_positions, 'even']), &
         new_field('rating', room%rating, '', 'rating that is asked for (KS F ISO 717-2, ISO 717-2, ISO 16283-2)', &
         choices=rating_names), &
         new_field('required', room%required, 'dB', 'maximum of that rating that is required; 0: none', '[0, 200]')]
   end function get_room_fields

   !> Checks the numbers of reverberation times and of values of the walls.
   subroutine check_room(room, error)
      type(room_type), intent(in) :: room
      !> Set if one is not allowed.
      type(error_type), allocatable, intent(out) :: error

      call check_walls(room%walls, error)
      if (allocated(error) .or. any(room%reverberation_time%count == time_counts)) return
      error = input_error('has '//to_text(room%reverberation_time%count)//' values; allowed: 1, one for each of the 4 ' &
         //'octaves from 63 to 500 Hz, or for each of the 12 one-third-octave bands from 50 to 630 Hz', 'room', &
         'reverberation_time')
   end subroutine check_room

   !> The room below a floor as a box, without positions; sides that are not stated are those of the floor.
   pure function new_box(room, plate) result(box)
      type(room_type), intent(in) :: room
      !> The plate that radiates.
      type(plate_type), intent(in) :: plate
      type(box_type) :: box
      integer :: i

      box%sides = [room%length, room%width, room%height]
      if (.not. room%length > 0.0_wp) box%sides(1) = plate%length
      if (.not. room%width > 0.0_wp) box%sides(2) = plate%width
      if (.not. room%height > 0.0_wp) then
         box%sides(3) = default_height
         if (room%volume > 0.0_wp) box%sides(3) = room%volume/product(box%sides(:2))
      end if
      box%volume = room%volume
      if (.not. room%volume > 0.0_wp) box%volume = product(box%sides)
      box%corner = [room%corner_x, room%corner_y]
      box%air = room%air
      box%bands = get_rated_bands('third')
      associate (times => room%reverberation_time, n_band => size(box%bands))
         box%reverberation_time = [(times%values(1 + (i - 1)*times%count/n_band), i=1, n_band)]
      end associate
      ! The overlap is the mode density 4 pi V f**2/c**3 times the bandwidth 2.2/T.
      box%crossover = sqrt(overlap_limit*box%air%sound_speed**3*minval(box%reverberation_time) &
         /(2.2_wp*4*pi*product(box%sides)))
   end function new_box

   !> Places ball and microphone: at the center and four points near the corners (KS F 2810-2), as for the rating of octaves
   !> unless stated otherwise, or at points that fill floor and room evenly (the R2 sequence of Roberts).
   pure subroutine place(room, rating, box)
      !> A room that states the positions, or leaves them to a rating.
      type(room_type), intent(in) :: room
      !> Index of the rating.
      integer, intent(in) :: rating
      type(box_type), intent(inout) :: box
      integer, parameter :: corner(2, n_standard) = reshape([0, 0, -1, -1, 1, -1, -1, 1, 1, 1], [2, n_standard])
      !> Solution of x**3 = x + 1.
      real(wp), parameter :: plastic = 1.32471795724474602596_wp
      real(wp) :: even(3, 2*n_even)
      integer :: i

      if (room%positions == standard_positions .or. room%positions == positions_of_rating .and. rating == of_octaves) then
         box%ball = reshape([(box%sides(:2)/2 + corner(:, i)*(box%sides(:2)/2 - min(wall_distance, box%sides(:2)/4)), &
            i=1, n_standard)], [2, n_standard])
         box%microphone = reshape([(box%ball(:, i), min(microphone_height, box%sides(3)/2), i=1, n_standard)], &
            [3, n_standard])
         return
      end if
      ! Every other point is one of the ball; heights are in another order than the other coordinates.
      associate (distance => min(even_distance, box%sides/4))
         do i = 1, 2*n_even
            even(:, i) = modulo(0.5_wp + [i/plastic, i/plastic**2, 7*(i/2 - 0.5_wp)/n_even], 1.0_wp)
            even(:, i) = distance + (box%sides - 2*distance)*even(:, i)
         end do
      end associate
      box%ball = even(:2, 1::2)
      box%microphone = even(:, 2::2)
   end subroutine place

   !> Checks the dimensions of a room, and that walls and ceiling fit below a floor.
   subroutine check_below(plate, room, error)
      !> The plate that radiates.
      type(plate_type), intent(in) :: plate
      type(room_type), intent(in) :: room
      !> Set if the dimensions contradict each other, the walls are too long, or the cavity above the ceiling is too deep.
      type(error_type), allocatable, intent(out) :: error
      type(box_type) :: box
      real(wp) :: walls

      walls = sum(room%walls%lengths%values(:room%walls%lengths%count))
      box = new_box(room, plate)
      if (abs(product(box%sides) - box%volume) > volume_tolerance*box%volume) error = input_error('length, width and ' &
         //'height, '//to_text(box%sides(1))//' x '//to_text(box%sides(2))//' x '//to_text(box%sides(3))//' m (not ' &
         //'stated: those of the floor), contradict the volume, '//to_text(box%volume)//' m3; allowed: a volume of ' &
         //to_text(product(box%sides))//' m3, or without volume or height', 'room')
      call check_side('length', 'long', 'corner_x', room%corner_x, box%sides(1), plate%length)
      call check_side('width', 'wide', 'corner_y', room%corner_y, box%sides(2), plate%width)
      if (allocated(error)) return
      if (box%volume < min_volume) then
         error = input_error('the volume is '//to_text(box%volume)//' m3; allowed: at least '//to_text(min_volume)//' m3', &
            'room')
      else if (walls > 2*(plate%length + plate%width)*(1 + rounding)) then
         error = input_error('are '//to_text(walls)//' m together, longer than the edges of the floor; allowed: up to ' &
            //to_text(2*(plate%length + plate%width))//' m', 'room', 'wall_lengths')
      else if (room%ceiling%mass > 0.0_wp .and. room%ceiling%depth > box%sides(3)) then
         error = input_error('= '//to_text(room%ceiling%depth)//' m is more than the height of the room; allowed: up to ' &
            //to_text(box%sides(3))//' m', 'room', 'ceiling_depth')
      end if
   contains

      !> Checks that a side of the room lies below the floor.
      subroutine check_side(key, adjective, corner_key, corner, room_side, floor_side)
         !> Key of the side, its adjective, and key of the corner.
         character(len=*), intent(in) :: key, adjective, corner_key
         !> Position of the corner, and sides of room and floor, m.
         real(wp), intent(in) :: corner, room_side, floor_side

         if (allocated(error) .or. corner + room_side <= floor_side*(1 + rounding)) return
         if (corner > 0.0_wp) then
            error = input_error('+ '//key//' = '//to_text(corner + room_side)//' m lies beyond the floor; allowed: up to ' &
               //'its '//key//', '//to_text(floor_side)//' m', 'room', corner_key)
         else
            error = input_error('the room is '//to_text(room_side)//' m '//adjective//', the floor '//to_text(floor_side) &
               //' m: state '//key//' of the floor; allowed: at least '//to_text(room_side)//' m', 'room')
         end if
      end subroutine check_side
   end subroutine check_below

   !> Checks that a room below a subceiling describes nothing that contradicts it.
   subroutine check_below_subceiling(room, error)
      type(room_type), intent(in) :: room
      !> Set if the room has a ceiling of its own, or the radiation factor of one plate.
      type(error_type), allocatable, intent(out) :: error

      if (room%ceiling%mass > 0.0_wp) then
         error = input_error('and subceiling_thickness of the floor describe the same ceiling twice; allowed: one of them', &
            'room', 'ceiling_mass')
      else if (room%radiation /= modal_radiation) then
         error = input_error('= iso_12354 is that of free waves, and a subceiling follows the floor; allowed: modes', &
            'room', 'radiation')
      end if
   end subroutine check_below_subceiling

   !> Adds the levels of octaves and the ratings that follow from the levels of one-third-octave bands.
   !>
   !> The maximum of the sum of bands, whose maxima come at other times, is as much below the sum of their maxima as the
   !> energies say.
   pure subroutine add_ratings(prediction)
      !> A prediction with the levels at the positions for ratings.
      type(room_level_type), intent(inout) :: prediction
      integer :: first, i

      prediction%octaves = get_rated_bands('octave')
      prediction%octave_level = 0*prediction%octaves%nominal
      do i = 1, size(prediction%octaves)
         first = bands_per_octave*(i - 1) + 1
         ! Three thirds with their maxima at the same time are louder than their octave: less by the statistical level of the
         ! simply supported floor, in which edges matter little.
         associate (last => first + bands_per_octave - 1)
            prediction%octave_level(i) = get_sum(prediction%rated_level(first:last, of_octaves)) &
               - (get_sum(prediction%statistical_level(first:last)) - get_fast_level(prediction%flow(first:last)))
         end associate
      end do
      associate (level => prediction%rated_level(:, of_thirds))
         prediction%rating = [get_a_weighted_level('octave', prediction%octave_level), &
            get_a_weighted_level('third', level), get_a_weighted_level('third', level &
            + get_standardization(prediction%box%reverberation_time, prediction%box%volume))]
      end associate
   end subroutine add_ratings

   !> Level of the energy sum of levels, dB.
   pure function get_sum(level) result(total)
      !> The levels, dB: [n].
      real(wp), intent(in) :: level(:)
      real(wp) :: total

      total = 10*log10(sum(10**(level/10)))
   end function get_sum

   !> Index of the rating that is asked for.
   pure function get_rating_index(room) result(number)
      type(room_type), intent(in) :: room
      integer :: number

      number = findloc(rating_names == room%rating, .true., dim=1)
   end function get_rating_index

end module thud_room
