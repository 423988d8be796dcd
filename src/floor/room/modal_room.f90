!> Sound in a rectangular room below a floor, from the modes of floor and room, for positions of source and microphone.
!>
!> The floor is part of the ceiling, the walls are rigid; the reverberation time gives the losses of the room's modes. The
!> velocity of the floor drives the air; the air acts back on the floor only by the loss factor of the floor.
module thud_modal_room
   use thud_band, only: band_type
   use thud_constants, only: pi
   use thud_energy_flow, only: decay_of_60_db, fast_time, reference_pressure
   use thud_floor_modes, only: floor_modes_type, get_poles, get_selected_modes
   use thud_function_set, only: function_set_type, get_functions, get_quadrature
   use thud_injected_energy, only: get_spectrum
   use thud_kinds, only: wp
   use thud_matrix_product, only: get_transposed_product
   use thud_modes, only: are_mixed, get_mixed, get_mode_sums, get_mode_values
   use thud_room, only: box_type
   use thud_transform, only: get_signal
   implicit none (type, external)
   private

   public :: get_highest_frequency, get_modal_room, modal_room_type

   !> Frequency of the highest modes of the room over the upper edge of the highest band: at a quiet position, modes above
   !> the band add up to 0.5 dB.
   real(wp), parameter :: room_ratio = 2.0_wp

   !> Frequency of the highest modes of the floor over that of the room: higher ones answer with their compliance.
   real(wp), parameter :: floor_ratio = 2.0_wp

   !> Samples per second over the frequency of the highest modes.
   real(wp), parameter :: sample_ratio = 2.56_wp

   !> Maximum number of modes of the room times frequencies: time.
   real(wp), parameter :: max_values = 3.5e7_wp

   !> Number of frequencies whose answers of the room are in memory at once.
   integer, parameter :: chunk_size = 64

   !> Levels at positions.
   type :: modal_room_type
      !> Number of bands, from the lowest, in which the sound is modal.
      integer :: n_band = 0
      !> Maximum Fast levels, dB re 20 uPa: [n_band, n_microphone, n_ball].
      real(wp), allocatable :: level(:, :, :)
      !> Energy mean over the positions, dB, and standard deviation of their levels, dB, without balls on rigid supports:
      !> [n_band].
      real(wp), allocatable :: mean(:), spread(:)
      !> Sound pressure, Pa: [n_sample, n_microphone, n_ball], at this many samples per second.
      real(wp), allocatable :: pressure(:, :, :)
      real(wp) :: sample_rate = 0.0_wp
      !> Energy into and lost by the modes of floor and room for each ball, J: [n_ball, 2].
      real(wp), allocatable :: floor_energy(:, :), room_energy(:, :)
      !> Number of modes of floor and room.
      integer :: floor_modes = 0, room_modes = 0
   end type modal_room_type

   !> Pairs of half waves and modes of the floor that are coupled with them.
   type :: group_type
      !> Indices of the pairs and of the modes: [n_pair], [n_mode].
      integer, allocatable :: pair(:), mode(:)
      !> Real and imaginary parts of their coupling, m2/sqrt(kg); only mixed modes have imaginary ones: [n_mode, n_pair].
      real(wp), allocatable :: real_part(:, :), imaginary_part(:, :)
   end type group_type

   !> Floor, room and positions.
   type :: coupled_type
      type(floor_modes_type) :: floor
      !> Squared angular frequencies of the floor's modes with their losses, rad2/s2, and shapes at the balls, 1/sqrt(kg):
      !> [n_mode], [n_mode, n_ball].
      complex(wp), allocatable :: pole(:), gain(:, :)
      !> Decay of the energy of a mode with a dashpot, angular frequency times loss factor, 1/s: [n_mode].
      real(wp), allocatable :: decay(:)
      type(box_type) :: box
      !> Frequency of the highest modes of the room, Hz.
      real(wp) :: highest = 0.0_wp
      !> Half waves along length and width: [n_pair].
      integer, allocatable :: lx(:), ly(:)
      !> What is coupled, by the parities of the half waves.
      type(group_type) :: group(4)
   end type coupled_type

   !> Answers of the room to the volume flow into a pair of half waves along length and width, at some frequencies.
   type :: answers_type
      !> Sound pressure at the microphones, Pa s/m3: [n_microphone, n_pair, n_line].
      complex(wp), allocatable :: pressure(:, :, :)
      !> Power into the room and its losses per mean-square flow, Pa s/m3: [n_pair, n_line].
      real(wp), allocatable :: input(:, :), loss(:, :)
      !> Number of modes of the room.
      integer :: n_mode = 0
   end type answers_type

contains

   !> Frequency of the highest modes of a floor that take part, Hz; 0 if no band is modal.
   pure function get_highest_frequency(box) result(frequency)
      type(box_type), intent(in) :: box
      real(wp) :: frequency

      frequency = floor_ratio*room_ratio*maxval([0.0_wp, pack(box%bands%upper, box%bands%center <= box%crossover)])
   end function get_highest_frequency

   !> Levels at positions for a force on the floor.
   subroutine get_modal_room(modes, box, force, sample_rate, with_details, room)
      type(floor_modes_type), intent(in) :: modes
      type(box_type), intent(in) :: box
      !> Force on the floor, N: [n_force], and samples per second, Hz.
      real(wp), intent(in) :: force(:)
      real(wp), intent(in) :: sample_rate
      !> Also return the sound pressure and the energies.
      logical, intent(in) :: with_details
      type(modal_room_type), intent(out) :: room
      type(coupled_type) :: coupled
      real(wp), allocatable :: omega(:), frequency(:)
      complex(wp), allocatable :: spectrum(:), sound(:, :, :)
      integer, allocatable :: moving(:)
      real(wp) :: duration, slowest
      integer :: i, j, n_sample, n_line, n_ball, n_microphone

      coupled%box = box
      n_ball = size(box%ball, 2)
      n_microphone = size(box%microphone, 2)
      ! Bands that the modes of the floor do not reach are statistical.
      room%n_band = count(box%bands%center <= box%crossover .and. 2*pi*box%bands%upper <= modes%limit)
      do
         if (room%n_band == 0) exit
         coupled%highest = room_ratio*box%bands(room%n_band)%upper
         coupled%floor = get_selected_modes(modes, modes%omega < min(floor_ratio*2*pi*coupled%highest, modes%limit))
         ! A floor without modes there answers with its compliance only, which nothing here contains.
         if (size(coupled%floor%omega) == 0) then
            room%n_band = 0
            exit
         end if
         coupled%pole = get_poles(coupled%floor)
         omega = sqrt(max(coupled%pole%re, tiny(1.0_wp)))
         coupled%decay = coupled%pole%im/omega
         slowest = max(minval(coupled%decay), 1.0_wp)
         ! Modes far below the bands ring longest, but the filters of the bands remove them.
         if (.not. with_details) slowest = max(minval(coupled%decay, omega > pi*box%bands(1)%lower), slowest)
         duration = 0.5_wp + decay_of_60_db/min(slowest, decay_of_60_db/maxval(box%reverberation_time))
         n_line = int(coupled%highest*duration)
         ! The number of modes of the room is about that of the half waves in an eighth of an ellipsoid.
         if (pi/6*product(2*coupled%highest/box%air%sound_speed*box%sides + 1)*n_line <= max_values) exit
         room%n_band = room%n_band - 1
      end do
      allocate (room%level(room%n_band, n_microphone, n_ball))
      allocate (room%mean(room%n_band), room%spread(room%n_band))
      allocate (room%floor_energy(n_ball, 2), room%room_energy(n_ball, 2), source=0.0_wp)
      if (room%n_band == 0) return
      n_sample = 128*ceiling(sample_ratio*coupled%highest*duration/128)
      room%sample_rate = n_sample/duration
      room%floor_modes = size(coupled%pole)
      frequency = [(i, i=1, n_line)]/duration
      spectrum = get_spectrum(force(:findloc(abs(force) > 0.0_wp, .true., dim=1, back=.true.)), sample_rate, frequency)
      coupled%gain = get_mode_values(coupled%floor%modes, 1, box%corner(1) + box%ball(1, :), &
         box%corner(2) + box%ball(2, :))
      ! Balls on a rigid support move nothing: nobody drops them there.
      moving = pack([(j, j=1, n_ball)], maxval(abs(coupled%gain), dim=1) > 1.0e-6_wp*maxval(abs(coupled%gain)))
      coupled%gain = get_mixed(coupled%floor%modes%block, coupled%gain, is_transposed=.true.)
      call couple(coupled)
      call get_sound(coupled, frequency, spectrum, with_details, sound, room)
      call get_levels(box%bands(:room%n_band), frequency, sound*room%sample_rate, room%sample_rate, n_sample, room%level)
      if (with_details) then
         allocate (room%pressure(n_sample, n_microphone, n_ball))
         do j = 1, n_ball
            do i = 1, n_microphone
               call get_signal([(0.0_wp, 0.0_wp), sound(:, i, j)*room%sample_rate], room%pressure(:, i, j))
            end do
         end do
      end if
      do i = 1, room%n_band
         associate (level => room%level(i, :, moving))
            room%mean(i) = 10*log10(sum(10**(level/10))/size(level))
            room%spread(i) = sqrt(sum((level - sum(level)/size(level))**2)/size(level))
         end associate
      end do
   end subroutine get_modal_room

   !> Adds the half waves of the room and the modes of the floor that are coupled with them.
   subroutine couple(coupled)
      !> Box, floor and highest frequency are set.
      type(coupled_type), intent(inout) :: coupled
      complex(wp), allocatable :: coupling(:, :)
      integer :: n(2)
      integer :: i, k

      associate (box => coupled%box, modes => coupled%floor%modes, plate => coupled%floor%stack%radiator)
         n = int(2*coupled%highest*box%sides(1:2)/box%air%sound_speed)
         coupled%lx = [((i, i=0, n(1)), k=0, n(2))]
         coupled%ly = [((k, i=0, n(1)), k=0, n(2))]
         associate (inside => get_mode_frequency(box, coupled%lx, coupled%ly, 0) <= coupled%highest)
            coupled%lx = pack(coupled%lx, inside)
            coupled%ly = pack(coupled%ly, inside)
         end associate
         associate (lx => coupled%lx, ly => coupled%ly, set => modes%displacement(plate))
            associate (along => get_line_coupling(set%x, box%corner(1), box%sides(1), maxval(lx)), &
               across => get_line_coupling(set%y, box%corner(2), box%sides(2), maxval(ly)))
               coupling = get_mixed(modes%block, cmplx(get_mode_sums(modes, plate, along(lx + 1, :), across(ly + 1, :)), &
                  kind=wp), is_transposed=.true.)
            end associate
            do i = 1, 4
               associate (group => coupled%group(i))
                  group%pair = pack([(k, k=1, size(lx))], 2*mod(lx, 2) + mod(ly, 2) == i - 1)
                  group%mode = pack([(k, k=1, size(coupling, 1))], &
                     maxval(abs(coupling(:, group%pair)), dim=2) > 1.0e-12_wp*maxval(abs(coupling)))
                  group%real_part = real(coupling(group%mode, group%pair), wp)
                  group%imaginary_part = aimag(coupling(group%mode, group%pair))
               end associate
            end do
         end associate
      end associate
   end subroutine couple

   !> Spectra of the sound at the microphones, and energies of floor and room (Parseval).
   subroutine get_sound(coupled, frequency, spectrum, with_energies, sound, room)
      type(coupled_type), intent(in) :: coupled
      !> Frequencies in equal steps, Hz, and Fourier transform of the force, N s: [n_line].
      real(wp), intent(in) :: frequency(:)
      complex(wp), intent(in) :: spectrum(:)
      !> Also compute the energies.
      logical, intent(in) :: with_energies
      !> Spectra of the sound pressure, Pa s: [n_line, n_microphone, n_ball].
      complex(wp), allocatable, intent(out) :: sound(:, :, :)
      type(modal_room_type), intent(inout) :: room
      complex(wp), allocatable :: response(:, :), flow(:, :)
      type(answers_type) :: answers
      integer :: before, i, n, n_ball

      n_ball = size(coupled%gain, 2)
      allocate (sound(size(frequency), size(coupled%box%microphone, 2), n_ball))
      do before = 0, size(frequency) - 1, chunk_size
         n = min(chunk_size, size(frequency) - before)
         associate (lines => frequency(before + 1:before + n), force => spectrum(before + 1:before + n))
            call get_answers(coupled, lines, answers)
            response = get_responses(coupled, lines, force)
            flow = get_flow(coupled, response)
            do i = 1, n
               associate (here => flow(:, n_ball*(i - 1) + 1:n_ball*i))
                  sound(before + i, :, :) = matmul(answers%pressure(:, :, i), here)
                  if (.not. with_energies) cycle
                  room%room_energy(:, 1) = room%room_energy(:, 1) &
                     + 2*frequency(1)*matmul(answers%input(:, i), here%re**2 + here%im**2)
                  room%room_energy(:, 2) = room%room_energy(:, 2) &
                     + 2*frequency(1)*matmul(answers%loss(:, i), here%re**2 + here%im**2)
               end associate
            end do
            if (with_energies) room%floor_energy = room%floor_energy &
               + 2*frequency(1)*get_floor_energies(coupled, lines, force, response)
         end associate
      end do
      room%room_modes = answers%n_mode
   end subroutine get_sound

   !> Velocities of modes per unit of their shape under the force, m s/(s sqrt(kg)): [n_mode, n_line].
   pure function get_responses(coupled, frequency, force) result(response)
      type(coupled_type), intent(in) :: coupled
      !> Frequencies, Hz, and spectrum of the force there, N s: [n_line].
      real(wp), intent(in) :: frequency(:)
      complex(wp), intent(in) :: force(:)
      complex(wp) :: response(size(coupled%pole), size(frequency))
      complex(wp) :: difference(size(coupled%pole))
      integer :: i

      do i = 1, size(frequency)
         associate (w => 2*pi*frequency(i))
            difference = conjg(get_stiffness(coupled, w)) - w**2
            response(:, i) = force(i)*cmplx(0.0_wp, w, wp)*difference/(difference%re**2 + difference%im**2)
         end associate
      end do
   end function get_responses

   !> Stiffness of modes with their losses at an angular frequency, rad2/s2: [n_mode]. Modes that are not mixed have
   !> dashpots, whose sound is causal; others have the complex stiffness that mixes them.
   pure function get_stiffness(coupled, omega) result(stiffness)
      type(coupled_type), intent(in) :: coupled
      !> The angular frequency, rad/s.
      real(wp), intent(in) :: omega
      complex(wp) :: stiffness(size(coupled%pole))

      stiffness = coupled%pole
      if (.not. are_mixed(coupled%floor%modes%block)) stiffness%im = omega*coupled%decay
   end function get_stiffness

   !> Volume flow into the pairs of half waves for each ball, frequency after frequency, m3/s per Hz:
   !> [n_pair, n_ball*n_line].
   pure function get_flow(coupled, response) result(flow)
      type(coupled_type), intent(in) :: coupled
      !> Velocities of the modes per unit of their shape under the force: [n_mode, n_line].
      complex(wp), intent(in) :: response(:, :)
      complex(wp), allocatable :: flow(:, :)
      complex(wp), allocatable :: velocity(:, :)
      logical :: is_mixed
      integer :: i, j, k, n_ball

      is_mixed = are_mixed(coupled%floor%modes%block)
      n_ball = size(coupled%gain, 2)
      allocate (flow(size(coupled%lx), n_ball*size(response, 2)))
      do k = 1, size(coupled%group)
         associate (group => coupled%group(k))
            allocate (velocity(size(group%mode), size(flow, 2)))
            do i = 1, size(response, 2)
               do j = 1, n_ball
                  velocity(:, n_ball*(i - 1) + j) = coupled%gain(group%mode, j)*response(group%mode, i)
               end do
            end do
            flow(group%pair, :) = cmplx(get_transposed_product(group%real_part, velocity%re), &
               get_transposed_product(group%real_part, velocity%im), wp)
            if (is_mixed) flow(group%pair, :) = flow(group%pair, :) + cmplx( &
               -get_transposed_product(group%imaginary_part, velocity%im), &
               get_transposed_product(group%imaginary_part, velocity%re), wp)
            deallocate (velocity)
         end associate
      end do
   end function get_flow

   !> Sums over frequencies of the powers into the floor and lost by it per mean-square force, J s: [n_ball, 2].
   pure function get_floor_energies(coupled, frequency, force, response) result(energy)
      type(coupled_type), intent(in) :: coupled
      !> Frequencies, Hz, and spectrum of the force there, N s: [n_line].
      real(wp), intent(in) :: frequency(:)
      complex(wp), intent(in) :: force(:)
      !> Velocities of the modes per unit of their shape under the force: [n_mode, n_line].
      complex(wp), intent(in) :: response(:, :)
      real(wp) :: energy(size(coupled%gain, 2), 2)
      complex(wp), dimension(size(coupled%pole), size(coupled%gain, 2)) :: stressed, velocity
      integer :: i, j

      associate (gain => coupled%gain, blocks => coupled%floor%modes%block)
         energy(:, 1) = real(matmul(matmul(response, conjg(force)), gain**2), wp)
         ! Velocities u have the losses Im(u* A u)/w with the stiffness A of `thud_modes`.
         energy(:, 2) = 0.0_wp
         do i = 1, size(frequency)
            velocity = gain*spread(response(:, i), 2, size(gain, 2))
            stressed = get_mixed(blocks, spread(get_stiffness(coupled, 2*pi*frequency(i)), 2, size(gain, 2))*velocity, &
               is_transposed=.false.)
            velocity = get_mixed(blocks, velocity, is_transposed=.false.)
            do j = 1, size(gain, 2)
               energy(j, 2) = energy(j, 2) + aimag(dot_product(velocity(:, j), stressed(:, j)))/(2*pi*frequency(i))
            end do
         end do
      end associate
   end function get_floor_energies

   !> Natural frequency of a mode of the room, Hz.
   elemental function get_mode_frequency(box, lx, ly, lz) result(frequency)
      type(box_type), intent(in) :: box
      !> Half waves along the sides.
      integer, intent(in) :: lx, ly, lz
      real(wp) :: frequency

      frequency = box%air%sound_speed/2*norm2([lx, ly, lz]/box%sides)
   end function get_mode_frequency

   !> cos(l pi x) of half waves l at relative positions x: [n_half_wave, n_position].
   pure function get_cosines(half_waves, position) result(cosine)
      integer, intent(in) :: half_waves(:)
      real(wp), intent(in) :: position(:)
      real(wp) :: cosine(size(half_waves), size(position))

      cosine = cos(pi*spread(real(half_waves, wp), 2, size(position))*spread(position, 1, size(half_waves)))
   end function get_cosines

   !> Integrals of functions times cos(l pi x/side) over a side of the room, sqrt(m): [last + 1, count].
   pure function get_line_coupling(set, corner, side, last) result(coupling)
      type(function_set_type), intent(in) :: set
      !> Beginning of the side and its length, m.
      real(wp), intent(in) :: corner, side
      !> Largest number of half waves.
      integer, intent(in) :: last
      real(wp), allocatable :: coupling(:, :)
      real(wp), allocatable :: point(:), weight(:)
      integer :: i

      call get_quadrature(set%count + 20 + 2*last, corner, corner + side, point, weight)
      coupling = matmul(get_cosines([(i, i=0, last)], (point - corner)/side), &
         get_functions(set, point, 0)*spread(weight, 2, set%count))
   end function get_line_coupling

   !> Answers to the volume flow into pairs of half waves: sums over the half waves along the height of the amplitudes
   !> rho0 c0**2/(V norm) i w/(w_r**2 - w**2 + i w 6 ln 10/T).
   subroutine get_answers(coupled, frequency, answers)
      type(coupled_type), intent(in) :: coupled
      !> Frequencies, Hz: [n_line].
      real(wp), intent(in) :: frequency(:)
      type(answers_type), intent(out) :: answers
      real(wp), allocatable :: shape(:, :)
      complex(wp) :: amplitude(size(frequency)), pressure(size(frequency), size(coupled%box%microphone, 2))
      real(wp) :: natural, decay, stiffness
      integer :: i, j, k, n

      n = size(coupled%box%microphone, 2)
      associate (box => coupled%box, lx => coupled%lx, ly => coupled%ly, w => 2*pi*frequency, &
         height => coupled%box%microphone(3, :)/coupled%box%sides(3))
         allocate (answers%pressure(n, size(lx), size(frequency)))
         allocate (answers%input(size(lx), size(frequency)), answers%loss(size(lx), size(frequency)), source=0.0_wp)
         shape = get_cosines(lx, box%microphone(1, :)/box%sides(1))*get_cosines(ly, box%microphone(2, :)/box%sides(2))
         do i = 1, size(lx)
            k = 0
            pressure = 0.0_wp
            do
               natural = get_mode_frequency(box, lx(i), ly(i), k)
               if (natural > coupled%highest) exit
               answers%n_mode = answers%n_mode + 1
               ! The reverberation time of the nearest band.
               decay = decay_of_60_db/box%reverberation_time(minloc(abs(log(max(natural, 1.0_wp)/box%bands%center)), dim=1))
               ! rho0 c0**2/(V norm), Pa/m3: the norm is the mean-square shape.
               stiffness = box%air%density*box%air%sound_speed**2/product(box%sides)*2**count([lx(i), ly(i), k] > 0)
               amplitude = stiffness*cmplx(0.0_wp, w, wp)/cmplx((2*pi*natural)**2 - w**2, w*decay, wp)
               answers%input(i, :) = answers%input(i, :) + amplitude%re
               answers%loss(i, :) = answers%loss(i, :) + (amplitude%re**2 + amplitude%im**2)*decay/stiffness
               ! The floor is at the top of the room: the shape cos(k pi z/H) has the sign (-1)**k there.
               do j = 1, n
                  pressure(:, j) = pressure(:, j) + (-1)**k*cos(k*pi*height(j))*shape(i, j)*amplitude
               end do
               k = k + 1
            end do
            answers%pressure(:, i, :) = transpose(pressure)
         end do
      end associate
   end subroutine get_answers

   !> Maximum Fast levels of sounds in bands.
   subroutine get_levels(bands, frequency, sound, sample_rate, n_sample, level)
      type(band_type), intent(in) :: bands(:)
      !> Frequencies, Hz: [n_line].
      real(wp), intent(in) :: frequency(:)
      !> Spectra, Pa: [n_line, n_microphone, n_ball].
      complex(wp), intent(in) :: sound(:, :, :)
      real(wp), intent(in) :: sample_rate
      integer, intent(in) :: n_sample
      !> The levels, dB: [n_band, n_microphone, n_ball].
      real(wp), intent(out) :: level(:, :, :)
      complex(wp) :: s(size(frequency)), transfer(size(frequency)), filtered(0:size(frequency))
      real(wp) :: signal(n_sample)
      real(wp) :: mean, largest, decay
      integer :: i, j, k, l

      decay = exp(-1/(sample_rate*fast_time))
      filtered(0) = 0.0_wp
      do i = 1, size(bands)
         ! Butterworth filters of third order with the exact edges (class 1 of IEC 61260-1).
         associate (low => bands(i)%lower, high => bands(i)%upper)
            s = cmplx(0.0_wp, (frequency - low*high/frequency)/(high - low), wp)
            transfer = 1/((s + 1)*(s**2 + s + 1))
         end associate
         do j = 1, size(sound, 3)
            do k = 1, size(sound, 2)
               filtered(1:) = sound(:, k, j)*transfer
               call get_signal(filtered, signal)
               mean = 0.0_wp
               largest = tiny(largest)
               do l = 1, n_sample
                  mean = decay*mean + (1 - decay)*signal(l)**2
                  largest = max(largest, mean)
               end do
               level(i, k, j) = 10*log10(largest/reference_pressure**2)
            end do
         end do
      end do
   end subroutine get_levels

end module thud_modal_room
