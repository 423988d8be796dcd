!> Level of an impact in the room below a floor, by transient statistical energy analysis in one-third-octave bands: the
!> force injects energy into the floor, the floor radiates into the room, and the Fast detector shows the level.
module thud_room
   use thud_band, only: band_type
   use thud_ceiling, only: ceiling_type, get_cavity_mode_density, get_ceiling_fields, get_forced_velocity_ratio, get_mass_law
   use thud_constants, only: pi
   use thud_energy_flow, only: add_subsystem, connect, energy_flow_type, get_loss_matrix, new_energy_flow
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type, list_type, name_length
   use thud_flanking, only: check_walls, get_junction_rate, get_vibration_reduction, get_wall_fields, get_walls, &
      walls_type
   use thud_kinds, only: wp
   use thud_lapack, only: dgetf2, dgetrs
   use thud_modal_radiation, only: modal_radiation_type
   use thud_new_field, only: choice_field, list_field, real_field
   use thud_plate, only: air_type, get_mode_density, get_plate_radiation, get_surface_mass, get_total_loss, plate_type
   use thud_rating, only: get_a_weighted_level, get_rated_bands, get_standardization, rating_names
   use thud_text, only: to_text
   use thud_transient_energy, only: get_fast_maximum
   implicit none (type, external)
   private

   public :: add_ratings, band_record_type, check_below, check_below_subceiling, check_room, get_band_records
   public :: get_completed_room, get_rating_index, get_reverberation_times, get_room_bands, get_room_fields, get_room_level
   public :: modal_radiation, positions_of_rating, room_level_type, room_type, use_standard_positions

   !> A room whose reverberation time contains all its losses, as measured ones do.
   character(len=*), parameter :: finished_room = 'finished'

   !> Radiation factor by the modes of the floor.
   character(len=*), parameter :: modal_radiation = 'modes'

   !> Positions of ball and microphone: those of the standard of the rating, 5 of KS F 2810-2, or 16 even ones.
   character(len=*), parameter :: positions_of_rating = 'rating', standard_positions = 'standard'

   !> Band sets of a prediction.
   character(len=*), parameter :: third_set = 'third', octave_set = 'octave'

   !> Number of one-third-octave bands in an octave.
   integer, parameter :: bands_per_octave = 3

   !> Reference sound pressure, Pa.
   real(wp), parameter :: reference_pressure = 2.0e-5_wp

   !> Natural logarithm of an energy decay of 60 dB.
   real(wp), parameter :: decay_of_60_db = 6*log(10.0_wp)

   !> Least ratio of the energies of the modes above the room to those of the modes beyond it.
   real(wp), parameter :: min_energy_ratio = 1.02_wp

   !> Height of a room of which neither height nor volume is stated, m.
   real(wp), parameter :: default_height = 2.5_wp

   !> Largest relative difference between a volume and the product of length, width and height.
   real(wp), parameter :: volume_tolerance = 0.01_wp

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
      !> Volume of the room, m3, and its length, width and height, m.
      real(wp) :: volume = 0.0_wp
      real(wp) :: sides(3) = 0.0_wp
      !> Energy that the impact injects into the floor, J: [n_band].
      real(wp), allocatable :: energy(:)
      !> Radiation factor and total loss factor of the floor: [n_band].
      real(wp), allocatable :: radiation_factor(:), loss_factor(:)
      !> Reverberation time of the room, s: [n_band].
      real(wp), allocatable :: reverberation_time(:)
      !> Fractions of the energy that enters the room, over all times: from the floor, directly or through a ceiling, and
      !> from each flanking wall: [n_band, 1 + n_wall].
      real(wp), allocatable :: path_share(:, :)
      !> Maximum Fast level in the room, dB re 20 uPa, energy mean over the positions for the rating of octaves, and for the
      !> others: [n_band, 2].
      real(wp), allocatable :: rated_level(:, :)
      !> That for the rating that is asked for, and its standard uncertainty, dB: [n_band].
      real(wp), allocatable :: level(:), uncertainty(:)
      !> The level with simply supported and with clamped edges, dB: [n_band, 2].
      real(wp), allocatable :: edge_level(:, :)
      !> Number of bands whose level follows from the modes of floor and room; the others are statistical.
      integer :: n_modal = 0
      !> Frequency at which three modes of the room overlap, Hz.
      real(wp) :: crossover = 0.0_wp
      !> Octave bands, their levels, dB, and what the energy sum of the levels of their one-third-octave bands exceeds them,
      !> dB, as these have their maxima at other times: [n_octave].
      type(band_type), allocatable :: octaves(:)
      real(wp), allocatable :: octave_level(:), octave_excess(:)
      !> Ratings in the order of `rating_names`, not rounded, dB, and their standard uncertainty, dB.
      real(wp) :: rating(size(rating_names)) = 0.0_wp
      real(wp) :: rating_uncertainty = 0.0_wp
      !> Standard uncertainties that add up to it by their squares, dB: [n_contribution].
      real(wp), allocatable :: contribution(:)
      !> Probability that the requirement of the room is met.
      real(wp) :: probability = 0.0_wp
   end type room_level_type

   !> A quantity of a prediction in its bands.
   type :: band_record_type
      character(len=name_length) :: name
      !> Unit, empty for ratios.
      character(len=8) :: unit
      !> Values: [n_band].
      real(wp), allocatable :: values(:)
   end type band_record_type

   !> Energies of the subsystems in one band, dE/dt = -A E, and their weights in the detector.
   type :: band_energies_type
      !> A, 1/s: [n, n].
      real(wp), allocatable :: loss_matrix(:, :)
      !> Initial energies, J, and squared sound pressure per energy, Pa2/J: [n].
      real(wp), allocatable :: initial_energy(:), weight(:)
      !> Rates at which energy flows from them into the room, 1/s; those of the floor, the walls and then others: [n].
      real(wp), allocatable :: into_room(:)
   end type band_energies_type

contains

   !> Keys and allowed ranges of the group `&room`.
   function get_room_fields(room) result(fields)
      !> The room that the fields read and set.
      type(room_type), intent(in), target :: room
      !> One field per component: [n_field].
      type(field_type), allocatable :: fields(:)

      fields = [ &
         real_field('length', room%length, 'm', 'length of the room; 0: that of the floor', '[0, 100]', &
         derived_at_zero=.true.), &
         real_field('width', room%width, 'm', 'width of the room; 0: that of the floor', '[0, 100]', &
         derived_at_zero=.true.), &
         real_field('height', room%height, 'm', 'height of the room; 0: from the volume, without it 2.5 m', '[0, 100]', &
         derived_at_zero=.true.), &
         real_field('volume', room%volume, 'm3', 'volume of the room; 0: length times width times height', '[0, 100000]', &
         derived_at_zero=.true.), &
         list_field('reverberation_time', room%reverberation_time, 's', 'reverberation time of the room: one, ' &
         //'4 for octaves or 12 for one-third octaves', '[0.05, 20]'), &
         choice_field('reverberation_of', room%reverberation_of, 'room of the reverberation time: finished, or bare, ' &
         //'without floor, walls and ceiling', [character(len=8) :: finished_room, 'bare']), &
         real_field('air_density', room%air%density, 'kg/m3', 'density of the air', '[0.5, 2]'), &
         real_field('sound_speed', room%air%sound_speed, 'm/s', 'speed of sound in the air', '[200, 500]'), &
         get_wall_fields(room%walls), get_ceiling_fields(room%ceiling), &
         real_field('corner_x', room%corner_x, 'm', 'position of the room along the length of a larger floor', '[0, 100)'), &
         real_field('corner_y', room%corner_y, 'm', 'position of the room along the width of a larger floor', '[0, 100)'), &
         choice_field('radiation', room%radiation, 'radiation factor of the floor, by its modes or by ISO 12354-1', &
         [character(len=9) :: modal_radiation, 'iso_12354']), &
         choice_field('positions', room%positions, &
         'positions of ball and microphone: those of the rating, 5 standard ones each (octaves), or 16 even ones each', &
         [character(len=8) :: positions_of_rating, standard_positions, 'even']), &
         choice_field('rating', room%rating, 'rating that is asked for (KS F ISO 717-2, ISO 717-2, ISO 16283-2)', &
         rating_names), &
         real_field('required', room%required, 'dB', 'maximum of that rating that is required; 0: none', '[0, 200]')]
   end function get_room_fields

   !> Checks the numbers of reverberation times and of values of the walls.
   subroutine check_room(room, error)
      type(room_type), intent(in) :: room
      !> Set if one is not allowed.
      type(error_type), allocatable, intent(out) :: error

      call check_walls(room%walls, error)
      if (allocated(error) .or. any(room%reverberation_time%count == time_counts)) return
      error = input_error('&room: reverberation_time has '//to_text(room%reverberation_time%count)//' values; allowed: ' &
         //'1, one for each of the 4 octaves from 63 to 500 Hz, or for each of the 12 one-third-octave bands from 50 to ' &
         //'630 Hz')
   end subroutine check_room

   !> The room with the dimensions that are not stated.
   elemental function get_completed_room(room, plate) result(completed)
      type(room_type), intent(in) :: room
      !> The plate that radiates.
      type(plate_type), intent(in) :: plate
      type(room_type) :: completed

      completed = room
      if (.not. room%length > 0.0_wp) completed%length = plate%length
      if (.not. room%width > 0.0_wp) completed%width = plate%width
      associate (area => completed%length*completed%width)
         if (.not. room%height > 0.0_wp) then
            completed%height = default_height
            if (room%volume > 0.0_wp) completed%height = room%volume/area
         end if
         if (.not. room%volume > 0.0_wp) completed%volume = area*completed%height
      end associate
   end function get_completed_room

   !> Checks the dimensions of a room, and that walls and ceiling fit below a floor.
   subroutine check_below(plate, room, error)
      !> The plate that radiates.
      type(plate_type), intent(in) :: plate
      type(room_type), intent(in) :: room
      !> Set if the dimensions contradict each other, the walls are too long, or the cavity above the ceiling is too deep.
      type(error_type), allocatable, intent(out) :: error
      type(room_type) :: completed
      real(wp) :: walls, product

      walls = sum(room%walls%lengths%values(:room%walls%lengths%count))
      completed = get_completed_room(room, plate)
      product = completed%length*completed%width*completed%height
      if (abs(product - completed%volume) > volume_tolerance*completed%volume) then
         error = input_error('&room: length, width and height, '//to_text(completed%length)//' x ' &
            //to_text(completed%width)//' x '//to_text(completed%height)//' m (not stated: those of the floor), ' &
            //'contradict the volume, '//to_text(completed%volume)//' m3; allowed: a volume of ' &
            //to_text(product)//' m3, or without volume or height')
      else if (.not. room%corner_x > 0.0_wp .and. completed%length > plate%length*(1 + 1.0e-9_wp)) then
         error = get_side_error('length', 'long', completed%length, plate%length)
      else if (.not. room%corner_y > 0.0_wp .and. completed%width > plate%width*(1 + 1.0e-9_wp)) then
         error = get_side_error('width', 'wide', completed%width, plate%width)
      else if (room%corner_x + completed%length > plate%length*(1 + 1.0e-9_wp)) then
         error = input_error('&room: corner_x + length = '//to_text(room%corner_x + completed%length)//' m lies beyond ' &
            //'the floor; allowed: up to its length, '//to_text(plate%length)//' m')
      else if (room%corner_y + completed%width > plate%width*(1 + 1.0e-9_wp)) then
         error = input_error('&room: corner_y + width = '//to_text(room%corner_y + completed%width)//' m lies beyond the ' &
            //'floor; allowed: up to its width, '//to_text(plate%width)//' m')
      else if (completed%volume < min_volume) then
         error = input_error('&room: the volume is '//to_text(completed%volume)//' m3; allowed: at least ' &
            //to_text(min_volume)//' m3')
      else if (walls > 2*(plate%length + plate%width)*(1 + 1.0e-9_wp)) then
         error = input_error('&room: wall_lengths are '//to_text(walls)//' m together, longer than the edges of the ' &
            //'floor; allowed: up to '//to_text(2*(plate%length + plate%width))//' m')
      else if (room%ceiling%mass > 0.0_wp .and. room%ceiling%depth > completed%height) then
         error = input_error('&room: ceiling_depth = '//to_text(room%ceiling%depth)//' m is more than the height of the ' &
            //'room; allowed: up to '//to_text(completed%height)//' m')
      end if
   end subroutine check_below

   !> Error of a room that is larger than its floor.
   function get_side_error(key, adjective, room_side, floor_side) result(error)
      !> Key of the side, and its adjective.
      character(len=*), intent(in) :: key, adjective
      !> Sides of room and floor, m.
      real(wp), intent(in) :: room_side, floor_side
      type(error_type) :: error

      error = input_error('&room: the room is '//to_text(room_side)//' m '//adjective//', the floor '//to_text(floor_side) &
         //' m: state '//key//' of the floor; allowed: at least '//to_text(room_side)//' m')
   end function get_side_error

   !> Checks that a room below a subceiling describes nothing that contradicts it.
   subroutine check_below_subceiling(room, error)
      type(room_type), intent(in) :: room
      !> Set if the room has a ceiling of its own, or the radiation factor of one plate.
      type(error_type), allocatable, intent(out) :: error

      if (room%ceiling%mass > 0.0_wp) then
         error = input_error('&room: ceiling_mass and subceiling_thickness of the floor describe the same ceiling twice; ' &
            //'allowed: one of them')
      else if (room%radiation /= modal_radiation) then
         error = input_error('&room: radiation = iso_12354 is that of free waves, and a subceiling follows the floor; ' &
            //'allowed: modes')
      end if
   end subroutine check_below_subceiling

   !> One-third-octave bands of a prediction: those of the rating.
   subroutine get_room_bands(bands, error)
      !> The one-third-octave bands: [n_band].
      type(band_type), allocatable, intent(out) :: bands(:)
      !> Never set.
      type(error_type), allocatable, intent(out) :: error

      bands = get_rated_bands(third_set)
   end subroutine get_room_bands

   !> Statistical level in the room.
   !>
   !> The floor takes the energy E = integral 2 |F|**2 Re Y df in each band, with Re Y averaged over positions. The energy
   !> is injected instantaneously: a contact of 20 ms is short compared with the detector's time constant.
   subroutine get_room_level(plate, radiation, stated_room, bands, force_level, prediction)
      !> The plate that radiates.
      type(plate_type), intent(in) :: plate
      !> Its conductance, radiation factors and energy beyond the room: [n_band].
      type(modal_radiation_type), intent(in) :: radiation
      type(room_type), intent(in) :: stated_room
      !> Bands from `get_room_bands`: [n_band].
      type(band_type), intent(in) :: bands(:)
      !> Force exposure levels of the force on the floor, dB: [n_band].
      real(wp), intent(in) :: force_level(:)
      type(room_level_type), intent(out) :: prediction
      type(band_energies_type) :: energies(size(bands))
      type(room_type) :: room
      real(wp) :: maximum(size(bands))
      integer :: i

      room = get_completed_room(stated_room, plate)
      prediction%bands = bands
      prediction%conductance = radiation%conductance
      prediction%surface_mass = get_surface_mass(plate)
      prediction%volume = room%volume
      prediction%sides = [room%length, room%width, room%height]
      prediction%energy = 10**(force_level/10)*radiation%conductance
      prediction%radiation_factor = radiation%radiation_factor
      prediction%loss_factor = get_total_loss(plate, room%air, bands%center, &
         (radiation%radiation_factor + radiation%upper_factor)/2)
      prediction%reverberation_time = get_reverberation_times(room, size(bands))
      allocate (prediction%path_share(size(bands), 1 + room%walls%lengths%count))
      do i = 1, size(bands)
         energies(i) = get_band_energies(plate, radiation, room, prediction, i)
         call get_fast_maximum(energies(i)%loss_matrix, energies(i)%initial_energy, energies(i)%weight, maximum(i))
         prediction%path_share(i, :) = get_path_shares(energies(i), size(prediction%path_share, 2))
      end do
      prediction%level = 10*log10(maximum/reference_pressure**2)
      prediction%rated_level = spread(prediction%level, 2, 2)
      call add_octaves(energies, prediction)
      call add_ratings(prediction)
   end subroutine get_room_level

   !> Adds the levels of octaves and the ratings that follow from the levels of one-third-octave bands.
   pure subroutine add_ratings(prediction)
      !> A prediction with the levels at the positions for ratings.
      type(room_level_type), intent(inout) :: prediction

      prediction%octave_level = get_octave_sums(prediction%rated_level(:, 1)) - prediction%octave_excess
      associate (level => prediction%rated_level(:, 2))
         prediction%rating = [get_a_weighted_level(octave_set, prediction%octave_level), &
            get_a_weighted_level(third_set, level), get_a_weighted_level(third_set, level &
            + get_standardization(prediction%reverberation_time, prediction%volume))]
      end associate
   end subroutine add_ratings

   !> Levels of the energy sums of the one-third-octave bands of each octave, dB: [n_octave].
   pure function get_octave_sums(level) result(octave_level)
      !> Levels of the one-third-octave bands, dB: [n_band].
      real(wp), intent(in) :: level(:)
      real(wp) :: octave_level(size(level)/bands_per_octave)

      octave_level = 10*log10(sum(reshape(10**(level/10), [bands_per_octave, size(octave_level)]), dim=1))
   end function get_octave_sums

   !> The quantities of a prediction in its bands, for all that writes them.
   pure function get_band_records(prediction) result(records)
      type(room_level_type), intent(in) :: prediction
      type(band_record_type), allocatable :: records(:)

      records = [ &
         band_record_type('level', 'dB', prediction%level), &
         band_record_type('uncertainty', 'dB', prediction%uncertainty), &
         band_record_type('simple_level', 'dB', prediction%edge_level(:, 1)), &
         band_record_type('clamped_level', 'dB', prediction%edge_level(:, 2)), &
         band_record_type('energy', 'J', prediction%energy), &
         band_record_type('conductance', 's/kg', prediction%conductance), &
         band_record_type('radiation_factor', '', prediction%radiation_factor), &
         band_record_type('loss_factor', '', prediction%loss_factor), &
         band_record_type('reverberation_time', 's', prediction%reverberation_time)]
   end function get_band_records

   !> Index of the rating that is asked for.
   pure function get_rating_index(room) result(number)
      type(room_type), intent(in) :: room
      integer :: number

      number = findloc(rating_names == room%rating, .true., dim=1)
   end function get_rating_index

   !> Whether ball and microphone have the standard positions for a rating: unless stated, for the octaves of KS F 2810-2.
   pure function use_standard_positions(room, rating) result(yes)
      type(room_type), intent(in) :: room
      !> Index of the rating.
      integer, intent(in) :: rating
      logical :: yes

      yes = room%positions == standard_positions &
         .or. room%positions == positions_of_rating .and. rating_names(rating) == 'octaves'
   end function use_standard_positions

   !> What the energy sums of one-third-octave bands exceed the levels of octaves by. The detector is linear in the energies,
   !> so an octave needs the sum of the energies of its one-third-octave bands; the maximum of the sum is at most the sum of
   !> the maxima.
   subroutine add_octaves(energies, prediction)
      !> Energies of the one-third-octave bands, three for each octave: [n_band].
      type(band_energies_type), intent(in) :: energies(:)
      !> Prediction with statistical levels.
      type(room_level_type), intent(inout) :: prediction
      real(wp), allocatable :: loss_matrix(:, :), initial_energy(:), weight(:), sums(:)
      real(wp) :: maximum
      integer :: i, j, n, at

      prediction%octaves = get_rated_bands(octave_set)
      n = size(energies(1)%initial_energy)
      allocate (prediction%octave_excess(size(prediction%octaves)))
      sums = get_octave_sums(prediction%level)
      allocate (initial_energy(bands_per_octave*n), weight(bands_per_octave*n))
      do i = 1, size(prediction%octaves)
         allocate (loss_matrix(bands_per_octave*n, bands_per_octave*n), source=0.0_wp)
         do j = 1, bands_per_octave
            at = (j - 1)*n
            associate (third => energies(bands_per_octave*(i - 1) + j))
               loss_matrix(at + 1:at + n, at + 1:at + n) = third%loss_matrix
               initial_energy(at + 1:at + n) = third%initial_energy
               weight(at + 1:at + n) = third%weight
            end associate
         end do
         call get_fast_maximum(loss_matrix, initial_energy, weight, maximum)
         prediction%octave_excess(i) = sums(i) - 10*log10(maximum/reference_pressure**2)
         deallocate (loss_matrix)
      end do
   end subroutine add_octaves

   !> Energies of a band: floor, walls, room, ceiling cavity and the floor beyond the room, with the flows between them.
   !>
   !> A plate loses omega eta in total; it radiates rho0 c0 sigma/m'' into the room, and to the other side by the factor
   !> there. The room loses 6 ln 10/T, which contains the flow back into the plates in a finished room and excludes it in a
   !> bare one.
   !>
   !> Energy flows from the floor above the room to the floor beyond it at the rate that gives, with the losses of both and a
   !> steady force, their energies by the modes.
   !>
   !> With a ceiling of transmission t, a fraction of the floor's radiation reaches the room through the stiffness of the
   !> air. Of the rest, t**2 reaches the room directly and 1 - t**2 the cavity, from which sound leaves through the ceiling
   !> (Craik and Smith 2000). The cavity receives t (1 - t) of the sound that the room sends to the ceiling. A ceiling
   !> without mass, t = 1, has no effect.
   pure function get_band_energies(floor, radiation, room, prediction, band) result(energies)
      !> The whole floor.
      type(plate_type), intent(in) :: floor
      type(modal_radiation_type), intent(in) :: radiation
      type(room_type), intent(in) :: room
      !> Prediction with reverberation times, energies and radiation factors.
      type(room_level_type), intent(in) :: prediction
      !> Index of the band.
      integer, intent(in) :: band
      type(band_energies_type) :: energies
      type(energy_flow_type) :: flow
      type(plate_type) :: plates(1 + room%walls%lengths%count)
      real(wp), dimension(size(plates)) :: radiated
      type(plate_type) :: plate
      real(wp) :: decay, transmission, forced, free, beyond, density
      integer :: i, at_room, at_cavity

      ! The part above the room.
      plate = floor
      plate%length = min(room%length, floor%length)
      plate%width = min(room%width, floor%width)
      plates = [plate, get_walls(room%walls)]
      at_room = size(plates) + 1
      at_cavity = at_room + 1
      associate (f => prediction%bands(band)%center, third => prediction%bands(band), air => room%air, &
         ceiling => room%ceiling, area => plate%length*plate%width)
         radiated = air%density*air%sound_speed/get_surface_mass(plates) &
            *[prediction%radiation_factor(band), get_plate_radiation(plates(2:), air, f)]
         decay = decay_of_60_db/prediction%reverberation_time(band)
         flow = new_energy_flow([get_mode_density(plates), get_room_mode_density(room, f)], &
            [2*pi*f*[prediction%loss_factor(band), get_total_loss(plates(2:), air, f)], decay], &
            [2*pi*f*plates%loss_factor + radiated*[radiation%upper_factor(band)/radiation%radiation_factor(band), &
            spread(1.0_wp, 1, size(plates) - 1)], merge(0.0_wp, decay, room%reverberation_of == finished_room)])
         if (ceiling%mass > 0.0_wp) then
            transmission = get_mass_law(ceiling, air, f)
            forced = get_forced_velocity_ratio(ceiling, air, prediction%radiation_factor(band), third%lower, third%upper)
            free = max(1 - forced, 0.0_wp)
            call add_subsystem(flow, get_cavity_mode_density(ceiling, air, area, f), 2*pi*f*ceiling%loss_factor)
            call connect(flow, 1, at_cavity, radiated(1)*free*(1 - transmission**2))
            call connect(flow, at_room, at_cavity, &
               air%sound_speed*area*transmission*(1 - transmission)/(4*room%volume))
            call connect(flow, 1, at_room, radiated(1)*(forced + free*transmission**2))
         else
            call connect(flow, 1, at_room, radiated(1))
         end if
         do i = 2, size(plates)
            call connect(flow, i, at_room, radiated(i))
            call connect(flow, 1, i, get_junction_rate(plate, plates(i), air, &
               get_vibration_reduction(room%walls, plate, plates(i), i - 1), f))
         end do
         if (plate%length*plate%width < floor%length*floor%width*(1 - 1.0e-9_wp)) then
            associate (loss => 2*pi*f*prediction%loss_factor(band), above => get_mode_density(plate), &
               ratio => radiation%energy_beyond(band))
               ! At most almost equal energies of all modes: with few modes, more energy may lie beyond the room.
               density = max(get_mode_density(floor) - above, min_energy_ratio*ratio*above)
               beyond = loss*ratio/(1 - ratio*above/density)
               call add_subsystem(flow, density, loss)
               call connect(flow, 1, size(flow%internal_loss), beyond)
               flow%total(1) = flow%total(1) + beyond
            end associate
         end if
         ! The decay of a finished room contains what it loses to floor and walls.
         if (room%reverberation_of == finished_room) then
            associate (leaving => flow%rate(:, at_room))
               leaving = leaving*min(1.0_wp, decay/max(sum(leaving), tiny(decay)))
            end associate
         end if
         allocate (energies%loss_matrix, source=get_loss_matrix(flow))
         allocate (energies%initial_energy(size(flow%internal_loss)), energies%weight(size(flow%internal_loss)), &
            source=0.0_wp)
         energies%initial_energy(1) = prediction%energy(band)
         allocate (energies%into_room, source=flow%rate(at_room, :))
         energies%weight(at_room) = air%density*air%sound_speed**2/room%volume
      end associate
   end function get_band_energies

   !> Fractions of the energy that enters the room by each path: [n_path].
   !>
   !> With dE/dt = -A E the integrals of the energies over time are A**-1 E(0).
   pure function get_path_shares(energies, n_path) result(share)
      type(band_energies_type), intent(in) :: energies
      !> Number of paths: the floor and the walls. What else radiates, a ceiling's cavity, belongs to the floor.
      integer, intent(in) :: n_path
      real(wp) :: share(n_path)
      real(wp) :: matrix(size(energies%initial_energy), size(energies%initial_energy))
      real(wp) :: integral(size(energies%initial_energy), 1)
      integer :: pivot(size(energies%initial_energy))
      integer :: n, info

      n = size(energies%initial_energy)
      matrix = energies%loss_matrix
      integral(:, 1) = energies%initial_energy
      call dgetf2(n, n, matrix, n, pivot, info)
      call dgetrs('N', n, 1, matrix, n, pivot, integral, n, info)
      integral(:, 1) = energies%into_room*integral(:, 1)
      share = integral(:n_path, 1)
      share(1) = share(1) + sum(integral(n_path + 1:, 1))
      share = share/sum(share)
   end function get_path_shares

   !> Modes of a room per hertz, s.
   elemental function get_room_mode_density(room, frequency) result(density)
      type(room_type), intent(in) :: room
      !> Frequency, Hz.
      real(wp), intent(in) :: frequency
      real(wp) :: density

      density = 4*pi*room%volume*frequency**2/room%air%sound_speed**3
   end function get_room_mode_density

   !> Reverberation times of the bands, s: [n_band].
   pure function get_reverberation_times(room, n_band) result(times)
      type(room_type), intent(in) :: room
      integer, intent(in) :: n_band
      real(wp) :: times(n_band)
      integer :: i

      associate (stated => room%reverberation_time)
         times = [(stated%values(1 + (i - 1)*stated%count/n_band), i=1, n_band)]
      end associate
   end function get_reverberation_times

end module thud_room
