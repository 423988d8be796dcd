!> Level of an impact in the room below a floor, by transient statistical energy analysis in thirds: the force gives
!> energy to the floor, the floor radiates into the room, both decay, and the Fast detector shows its maximum.
module thud_room
   use thud_band, only: band_type
   use thud_constants, only: pi
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type, list_type
   use thud_kinds, only: wp
   use thud_new_field, only: list_field, real_field
   use thud_plate, only: air_type, get_critical_frequency, get_mode_density, get_radiation_factor, get_surface_mass, &
      get_total_loss, plate_type
   use thud_rating, only: find_rated_bands, get_a_weighted_level
   use thud_text, only: to_text
   use thud_transient_energy, only: get_fast_maximum
   implicit none (type, external)
   private

   public :: check_room, few_modes, get_room_bands, get_room_fields, get_room_level, room_level_type, room_type

   !> Set of bands of a prediction.
   character(len=*), parameter :: room_set = 'third'

   !> Reference of sound pressure, Pa.
   real(wp), parameter :: reference_pressure = 2.0e-5_wp

   !> Attenuation of a reverberation time, 60 dB in neper of energy.
   real(wp), parameter :: decay_of_60_db = 6*log(10.0_wp)

   !> Modes of a third below which its statistical answer is doubtful.
   real(wp), parameter :: few_modes = 5.0_wp

   !> The room.
   type :: room_type
      !> Volume, m3.
      real(wp) :: volume = 50.0_wp
      !> Reverberation time, s.
      real(wp) :: reverberation_time = 0.5_wp
      !> The same for each third, s.
      type(list_type) :: reverberation_times
      !> Its air.
      type(air_type) :: air
   end type room_type

   !> A prediction, by thirds.
   type :: room_level_type
      !> The thirds: [n_band].
      type(band_type), allocatable :: bands(:)
      !> Power that a force of unit mean square gives to the floor, m/(N s): [n_band].
      real(wp), allocatable :: conductance(:)
      !> Energy that the impact gives to the floor, J: [n_band].
      real(wp), allocatable :: energy(:)
      !> Radiation factor and total loss factor of the floor: [n_band].
      real(wp), allocatable :: radiation_factor(:), loss_factor(:)
      !> Reverberation time of the room, s: [n_band].
      real(wp), allocatable :: reverberation_time(:)
      !> Modes of the floor and of the room in the third: [n_band].
      real(wp), allocatable :: floor_modes(:), room_modes(:)
      !> Maximum Fast level in the room, dB re 20 uPa, and its time after the impact, s: [n_band].
      real(wp), allocatable :: level(:), time(:)
      !> A-weighted maximum level, dB (ISO 717-2 annex D).
      real(wp) :: a_weighted = 0.0_wp
   end type room_level_type

contains

   !> Keys and allowed ranges of the group `&room`.
   function get_room_fields(room) result(fields)
      !> The room that the fields read and set.
      type(room_type), intent(in), target :: room
      !> One field per component: [5].
      type(field_type), allocatable :: fields(:)

      fields = [ &
         real_field('volume', room%volume, 'm3', 'volume of the room', '[1, 100000]'), &
         real_field('reverberation_time', room%reverberation_time, 's', 'reverberation time of the room', '[0.05, 20]'), &
         list_field('reverberation_times', room%reverberation_times, 's', &
         'the same for each third from 50 to 630 Hz', '[0.05, 20]'), &
         real_field('air_density', room%air%density, 'kg/m3', 'density of the air', '[0.5, 2]'), &
         real_field('sound_speed', room%air%sound_speed, 'm/s', 'speed of sound in the air', '[200, 500]')]
   end function get_room_fields

   !> Refuses reverberation times of other bands.
   subroutine check_room(room, error)
      type(room_type), intent(in) :: room
      !> Names the number of values.
      type(error_type), allocatable, intent(out) :: error
      type(band_type), allocatable :: bands(:)

      call get_room_bands(bands, error)
      if (any(room%reverberation_times%count == [0, size(bands)])) return
      error = input_error('&room: reverberation_times has '//to_text(room%reverberation_times%count) &
         //' values; allowed: '//to_text(size(bands))//', one for each third from 50 to 630 Hz')
   end subroutine check_room

   !> Thirds of a prediction: those of the rating.
   subroutine get_room_bands(bands, error)
      !> The thirds: [n_band].
      type(band_type), allocatable, intent(out) :: bands(:)
      !> Never.
      type(error_type), allocatable, intent(out) :: error

      call find_rated_bands(room_set, bands, error)
   end subroutine get_room_bands

   !> Predicts the level in the room.
   !>
   !> The floor takes E = integral F**2 dt times the conductance per band. The energy is given at once: a contact of
   !> 20 ms is short against the detector. The energies obey (physics of subsystems)
   !> E1' = -a1 E1 + a21 E2, E2' = a12 E1 - (a2 + a21) E2 with a1 = omega eta, a12 = rho0 c0 sigma/m'',
   !> a21 = a12 n1/n2 by reciprocity, a2 = 6 ln 10/T.
   pure subroutine get_room_level(plate, conductance, room, bands, force_level, prediction)
      !> The plate that radiates.
      type(plate_type), intent(in) :: plate
      !> Power that a force of unit mean square on the floor gives to it, m/(N s): [n_band].
      real(wp), intent(in) :: conductance(:)
      type(room_type), intent(in) :: room
      !> Thirds from `get_room_bands`: [n_band].
      type(band_type), intent(in) :: bands(:)
      !> Force exposure levels of the force on the floor, dB: [n_band].
      real(wp), intent(in) :: force_level(:)
      type(room_level_type), intent(out) :: prediction
      real(wp) :: loss(2, 2)
      real(wp) :: critical, radiated, back, maximum, flow
      real(wp) :: width(size(bands))
      integer :: i

      critical = get_critical_frequency(plate, room%air)
      width = bands%upper - bands%lower
      prediction%bands = bands
      prediction%conductance = conductance
      prediction%energy = 10**(force_level/10)*conductance
      prediction%radiation_factor = get_radiation_factor(bands%centre, critical, plate%length, plate%width, &
         room%air%sound_speed)
      prediction%loss_factor = get_total_loss(plate, room%air, bands%centre)
      allocate (prediction%reverberation_time(size(bands)), source=room%reverberation_time)
      if (room%reverberation_times%count > 0) prediction%reverberation_time = room%reverberation_times%values(:size(bands))
      prediction%floor_modes = get_mode_density(plate)*width
      prediction%room_modes = 4*pi*room%volume*bands%centre**2/room%air%sound_speed**3*width
      allocate (prediction%level(size(bands)), prediction%time(size(bands)))
      associate (rho_c => room%air%density*room%air%sound_speed)
         do i = 1, size(bands)
            radiated = rho_c*prediction%radiation_factor(i)/get_surface_mass(plate)
            back = radiated*prediction%floor_modes(i)/prediction%room_modes(i)
            loss(:, 1) = [2*pi*bands(i)%centre*prediction%loss_factor(i), -radiated]
            loss(:, 2) = [-back, decay_of_60_db/prediction%reverberation_time(i) + back]
            flow = rho_c*room%air%sound_speed/room%volume
            call get_fast_maximum(loss, [prediction%energy(i), 0.0_wp], [0.0_wp, flow], maximum, prediction%time(i))
            prediction%level(i) = 10*log10(maximum/reference_pressure**2)
         end do
      end associate
      prediction%a_weighted = get_a_weighted_level(room_set, prediction%level)
   end subroutine get_room_level

end module thud_room
