!> Sound in a rectangular room below a floor, from the modes of floor and room, for positions of source and microphone.
!>
!> The floor is part of the ceiling, the walls are rigid; the reverberation time gives the losses of the room's modes. The
!> velocity of the floor drives the air; the air acts back on the floor only by the loss factor of the floor.
module thud_modal_room
   use thud_band, only: band_type
   use thud_constants, only: pi
   use thud_floor_modes, only: floor_modes_type
   use thud_function_set, only: function_set_type, get_functions, get_quadrature
   use thud_kinds, only: wp
   use thud_plate, only: air_type
   use thud_ritz_system, only: get_mode_values
   use thud_transform, only: get_signal
   implicit none (type, external)
   private

   public :: box_type, get_crossover, get_highest_frequency, get_modal_room, get_standard_positions, modal_room_type
   public :: n_standard

   !> Number of overlapping modes of the room above which the sound is statistical.
   real(wp), parameter :: overlap_limit = 3.0_wp

   !> Frequency of the highest modes of the room over the upper edge of the highest band: at a quiet position, modes above
   !> the band add up to 0.5 dB.
   real(wp), parameter :: room_ratio = 2.0_wp

   !> Frequency of the highest modes of the floor over that of the room: higher ones answer with their compliance.
   real(wp), parameter :: floor_ratio = 2.0_wp

   !> Samples per second over the frequency of the highest modes.
   real(wp), parameter :: sample_ratio = 2.56_wp

   !> Maximum number of modes of the room times frequencies: memory and time.
   real(wp), parameter :: max_values = 1.0e7_wp

   !> Time constant of the Fast detector, s; reference sound pressure, Pa.
   real(wp), parameter :: time_constant = 0.125_wp, reference_pressure = 2.0e-5_wp

   !> Number of standard positions.
   integer, parameter :: n_standard = 5

   !> Distance of standard positions from the walls, m, and height of the microphones, m (KS F 2810-2).
   real(wp), parameter :: wall_distance = 0.75_wp, microphone_height = 1.2_wp

   !> The room.
   type :: box_type
      !> Length, width and height, m.
      real(wp) :: sides(3) = 0.0_wp
      !> Position of its corner below the floor, m.
      real(wp) :: corner(2) = 0.0_wp
      type(air_type) :: air
      !> One-third-octave bands and the reverberation times in them, s: [n_band].
      type(band_type), allocatable :: bands(:)
      real(wp), allocatable :: reverberation_time(:)
   end type box_type

   !> Levels at positions.
   type :: modal_room_type
      !> Number of bands, from the lowest, in which the sound is modal.
      integer :: n_band = 0
      !> Maximum Fast levels, dB re 20 uPa: [n_band, n_microphone, n_ball].
      real(wp), allocatable :: level(:, :, :)
      !> Energy mean over the positions, dB, standard deviation of the levels, and that of their mean, dB: [n_band].
      real(wp), allocatable :: mean(:), spread(:), mean_spread(:)
      !> Sound pressure, Pa: [n_sample, n_microphone, n_ball], at this many samples per second.
      real(wp), allocatable :: pressure(:, :, :)
      real(wp) :: sample_rate = 0.0_wp
      !> Energy into and lost by the modes of floor and room for each ball, J: [n_ball].
      real(wp), allocatable :: floor_input(:), floor_loss(:), room_input(:), room_loss(:)
      !> Number of modes of floor and room.
      integer :: floor_modes = 0, room_modes = 0
   end type modal_room_type

contains

   !> Frequency above which the modes of a room overlap so much that its sound is statistical, Hz: the overlap is the mode
   !> density 4 pi V f**2/c**3 times the bandwidth 2.2/T.
   pure function get_crossover(box) result(frequency)
      type(box_type), intent(in) :: box
      real(wp) :: frequency

      frequency = sqrt(overlap_limit*box%air%sound_speed**3*minval(box%reverberation_time) &
         /(2.2_wp*4*pi*product(box%sides)))
   end function get_crossover

   !> Frequency of the highest modes of a floor that take part, Hz.
   pure function get_highest_frequency(box) result(frequency)
      type(box_type), intent(in) :: box
      real(wp) :: frequency

      ! The upper edge of the band at the crossover lies at most a third of an octave above.
      frequency = floor_ratio*room_ratio*2**(1.0_wp/3)*get_crossover(box)
   end function get_highest_frequency

   !> Standard positions: center and four points near the corners (KS F 2810-2).
   pure subroutine get_standard_positions(box, ball, microphone)
      type(box_type), intent(in) :: box
      !> Positions of the ball, from the corner of the room, m: [2, 5].
      real(wp), intent(out) :: ball(2, n_standard)
      !> Positions of the microphone, m: [3, 5].
      real(wp), intent(out) :: microphone(3, n_standard)
      real(wp), parameter :: corner(2, n_standard) = reshape([0, 0, -1, -1, 1, -1, -1, 1, 1, 1], [2, n_standard])
      integer :: i

      do i = 1, 2
         ball(i, :) = box%sides(i)/2 + corner(i, :)*(box%sides(i)/2 - min(wall_distance, box%sides(i)/4))
      end do
      microphone(1:2, :) = ball
      microphone(3, :) = min(microphone_height, box%sides(3)/2)
   end subroutine get_standard_positions

   !> Levels at positions for a force on the floor.
   subroutine get_modal_room(modes, box, force, sample_rate, ball, microphone, with_pressure, room, max_frequency)
      type(floor_modes_type), intent(in) :: modes
      type(box_type), intent(in) :: box
      !> Force on the floor, N: [n_force], and samples per second, Hz.
      real(wp), intent(in) :: force(:)
      real(wp), intent(in) :: sample_rate
      !> Positions of the ball on the floor and of the microphone, from the corner of the room, m: [2, n_ball], [3, n_mic].
      real(wp), intent(in) :: ball(:, :), microphone(:, :)
      !> Also return the sound pressure.
      logical, intent(in) :: with_pressure
      type(modal_room_type), intent(out) :: room
      !> Highest mid frequency of a band, Hz (default: the crossover).
      real(wp), intent(in), optional :: max_frequency
      real(wp), allocatable :: omega(:), decay(:), drive(:, :), coupling(:, :), signal(:), frequency(:), shape_x(:, :)
      real(wp), allocatable :: shape_y(:, :)
      complex(wp), allocatable :: spectrum(:), velocity(:, :), flow(:, :), answer(:, :, :), sound(:, :)
      integer, allocatable :: lx(:), ly(:)
      logical, allocatable :: kept(:)
      real(wp) :: highest, duration, step
      integer :: i, j, n_sample, n_line, n_pair

      room%n_band = count(box%bands%center <= get_crossover(box))
      if (present(max_frequency)) room%n_band = count(box%bands%center <= max_frequency)
      room%n_band = min(room%n_band, count(2*pi*box%bands%upper <= modes%known_limit))
      do
         if (room%n_band == 0) exit
         highest = room_ratio*box%bands(room%n_band)%upper
         kept = modes%omega < min(floor_ratio*2*pi*highest, modes%limit)
         ! A floor without modes there answers with its compliance only, which nothing here contains.
         if (.not. any(kept)) then
            room%n_band = 0
            exit
         end if
         omega = pack(modes%omega, kept)
         decay = omega*pack(modes%loss_factor, kept)
         duration = 0.5_wp + 6*log(10.0_wp)/min(max(minval(decay), 1.0_wp), 6*log(10.0_wp)/maxval(box%reverberation_time))
         n_line = int(highest*duration)
         if (get_room_mode_count(box, highest)*n_line <= max_values) exit
         room%n_band = room%n_band - 1
      end do
      allocate (room%level(room%n_band, size(microphone, 2), size(ball, 2)))
      allocate (room%mean(room%n_band), room%spread(room%n_band), room%mean_spread(room%n_band))
      allocate (room%floor_input(size(ball, 2)), room%floor_loss(size(ball, 2)), room%room_input(size(ball, 2)), &
         room%room_loss(size(ball, 2)))
      if (room%n_band == 0) return
      n_sample = 128*ceiling(sample_ratio*highest*duration/128)
      room%sample_rate = n_sample/duration
      step = 1/duration
      frequency = step*[(i, i=1, n_line)]
      spectrum = get_spectrum(force, sample_rate, frequency)
      call get_pairs(box, highest, lx, ly)
      n_pair = size(lx)
      call get_coupling(modes, box, kept, lx, ly, coupling)
      call get_mode_values(modes%modes, 1, box%corner(1) + ball(1, :), box%corner(2) + ball(2, :), drive)
      drive = drive(pack([(i, i=1, size(kept))], kept), :)
      shape_x = get_cosines(lx, microphone(1, :)/box%sides(1))
      shape_y = get_cosines(ly, microphone(2, :)/box%sides(2))
      room%floor_modes = size(omega)
      call get_answers(box, lx, ly, highest, frequency, microphone(3, :)/box%sides(3), answer, room%room_modes)
      if (with_pressure) allocate (room%pressure(n_sample, size(microphone, 2), size(ball, 2)))
      allocate (signal(n_sample), velocity(size(omega), n_line), sound(n_line, size(microphone, 2)))
      do j = 1, size(ball, 2)
         associate (w => 2*pi*frequency)
            do i = 1, n_line
               velocity(:, i) = drive(:, j)*spectrum(i)*cmplx(0.0_wp, w(i), wp)/cmplx(omega**2 - w(i)**2, w(i)*decay, wp)
            end do
         end associate
         ! Volume flow into the shapes of the room, m3/s per Hz: [n_pair, n_line].
         flow = matmul(coupling, velocity)
         room%floor_input(j) = 2*step*sum(real(matmul(drive(:, j), velocity)*conjg(spectrum), wp))
         room%floor_loss(j) = 2*step*sum(decay*sum(abs(velocity)**2, dim=2))
         call add_room_energies(box, lx, ly, highest, frequency, flow, step, room%room_input(j), room%room_loss(j))
         do i = 1, size(microphone, 2)
            sound(:, i) = sum(spread(shape_x(:, i)*shape_y(:, i), 2, n_line)*flow*answer(:, :, i), dim=1)
            call add_levels(box%bands(:room%n_band), frequency, sound(:, i)*room%sample_rate, room%sample_rate, signal, &
               room%level(:, i, j))
            if (with_pressure) call get_signal([(0.0_wp, 0.0_wp), sound(:, i)*room%sample_rate], room%pressure(:, i, j))
         end do
      end do
      do i = 1, room%n_band
         associate (level => room%level(i, :, :))
            room%mean(i) = 10*log10(sum(10**(level/10))/size(level))
            room%spread(i) = sqrt(get_variance(reshape(level, [size(level)])))
            ! Balls and microphones are samples of their own.
            associate (n_microphone => size(level, 1), n_ball => size(level, 2))
               room%mean_spread(i) = sqrt(get_variance(sum(level, dim=1)/n_microphone)/n_ball &
                  + get_variance(sum(level, dim=2)/n_ball)/n_microphone)
            end associate
         end associate
      end do
   end subroutine get_modal_room

   !> Mean-square deviation from the mean.
   pure function get_variance(values) result(variance)
      real(wp), intent(in) :: values(:)
      real(wp) :: variance

      variance = sum((values - sum(values)/size(values))**2)/size(values)
   end function get_variance

   !> Number of modes of a room below a frequency, about.
   pure function get_room_mode_count(box, frequency) result(count)
      type(box_type), intent(in) :: box
      real(wp), intent(in) :: frequency
      real(wp) :: count

      associate (k => 2*frequency/box%air%sound_speed)
         count = pi/6*product(box%sides*k + 1)
      end associate
   end function get_room_mode_count

   !> Fourier transform of a force, N s, at frequencies in equal steps.
   pure function get_spectrum(force, sample_rate, frequency) result(spectrum)
      real(wp), intent(in) :: force(:)
      real(wp), intent(in) :: sample_rate
      !> Frequencies, Hz, multiples of the first one: [n].
      real(wp), intent(in) :: frequency(:)
      complex(wp) :: spectrum(size(frequency))
      complex(wp) :: turn, phase
      integer :: i, k, last

      last = findloc(abs(force) > 0.0_wp, .true., dim=1, back=.true.)
      spectrum = 0.0_wp
      do i = 1, last
         turn = exp(cmplx(0.0_wp, -2*pi*frequency(1)*(i - 1)/sample_rate, wp))
         phase = force(i)/sample_rate
         do k = 1, size(frequency)
            phase = phase*turn
            spectrum(k) = spectrum(k) + phase
         end do
      end do
   end function get_spectrum

   !> Pairs of half waves along length and width of a room's modes below a frequency.
   pure subroutine get_pairs(box, highest, lx, ly)
      type(box_type), intent(in) :: box
      real(wp), intent(in) :: highest
      integer, allocatable, intent(out) :: lx(:), ly(:)
      integer :: n(2)
      integer :: i, j

      n = int(2*highest*box%sides(1:2)/box%air%sound_speed)
      lx = [((i, i=0, n(1)), j=0, n(2))]
      ly = [((j, i=0, n(1)), j=0, n(2))]
      associate (inside => get_mode_frequency(box, lx, ly, 0) <= highest)
         lx = pack(lx, inside)
         ly = pack(ly, inside)
      end associate
   end subroutine get_pairs

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

   !> Integrals over the ceiling of the shapes of the radiating plate times those of the room, m2/sqrt(kg): [n_pair, n_mode].
   subroutine get_coupling(modes, box, kept, lx, ly, coupling)
      type(floor_modes_type), intent(in) :: modes
      type(box_type), intent(in) :: box
      logical, intent(in) :: kept(:)
      integer, intent(in) :: lx(:), ly(:)
      real(wp), allocatable, intent(out) :: coupling(:, :)
      real(wp), allocatable :: along(:, :), across(:, :), product(:, :)
      integer, allocatable :: in_block(:)
      integer :: i, j, k, first, n

      associate (radiator => modes%modes%displacement(modes%stack%radiator))
         along = get_line_coupling(radiator%x, box%corner(1), box%sides(1), maxval(lx))
         across = get_line_coupling(radiator%y, box%corner(2), box%sides(2), maxval(ly))
      end associate
      allocate (coupling(size(lx), count(kept)))
      first = 0
      n = 0
      do i = 1, size(modes%modes%block)
         associate (block => modes%modes%block(i))
            in_block = pack([(k, k=1, size(block%omega))], kept(first + 1:first + size(block%omega)))
            first = first + size(block%omega)
            if (size(in_block) == 0) cycle
            associate (shape => block%shape(modes%stack%radiator))
               allocate (product(size(lx), size(shape%x)*size(shape%y)))
               do j = 1, size(shape%y)
                  do k = 1, size(shape%x)
                     product(:, (j - 1)*size(shape%x) + k) = along(lx + 1, shape%x(k))*across(ly + 1, shape%y(j))
                  end do
               end do
               coupling(:, n + 1:n + size(in_block)) = matmul(product, shape%coefficient(:, in_block))
               deallocate (product)
            end associate
            n = n + size(in_block)
         end associate
      end do
   end subroutine get_coupling

   !> Integrals of functions times cos(l pi x/side) over a side of the room, sqrt(m): [0:last, count].
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

   !> Reverberation time at a frequency: that of the nearest band, s.
   pure function get_reverberation_time(box, frequency) result(time)
      type(box_type), intent(in) :: box
      real(wp), intent(in) :: frequency
      real(wp) :: time

      time = box%reverberation_time(minloc(abs(log(max(frequency, 1.0_wp)/box%bands%center)), dim=1))
   end function get_reverberation_time

   !> Sound pressure at microphones per volume flow into a pair of half waves, Pa s/m3, without the shapes along length and
   !> width: the sum over the half waves along the height of rho0 c0**2/(V norm) i w/(w_r**2 - w**2 + i w 6 ln 10/T).
   subroutine get_answers(box, lx, ly, highest, frequency, height, answer, n_mode)
      type(box_type), intent(in) :: box
      integer, intent(in) :: lx(:), ly(:)
      !> Frequency of the highest modes, Hz.
      real(wp), intent(in) :: highest
      !> Frequencies, Hz: [n_line].
      real(wp), intent(in) :: frequency(:)
      !> Relative heights of the microphones: [n_microphone].
      real(wp), intent(in) :: height(:)
      !> The pressure: [n_pair, n_line, n_microphone].
      complex(wp), allocatable, intent(out) :: answer(:, :, :)
      !> Number of modes of the room.
      integer, intent(out) :: n_mode
      complex(wp) :: resonance(size(frequency))
      real(wp) :: natural
      integer :: i, j, k

      allocate (answer(size(lx), size(frequency), size(height)))
      answer = 0.0_wp
      n_mode = 0
      do i = 1, size(lx)
         k = 0
         do
            natural = get_mode_frequency(box, lx(i), ly(i), k)
            if (natural > highest) exit
            n_mode = n_mode + 1
            resonance = get_resonance(box, lx(i), ly(i), k, frequency)
            ! The floor is at the top of the room: the shape cos(k pi z/H) has the sign (-1)**k there.
            do j = 1, size(height)
               answer(i, :, j) = answer(i, :, j) + (-1)**k*cos(k*pi*height(j))*resonance
            end do
            k = k + 1
         end do
      end do
   end subroutine get_answers

   !> Amplitude of a mode of the room per volume flow into it, Pa s/m3: [n_line].
   pure function get_resonance(box, lx, ly, lz, frequency) result(resonance)
      type(box_type), intent(in) :: box
      integer, intent(in) :: lx, ly, lz
      real(wp), intent(in) :: frequency(:)
      complex(wp) :: resonance(size(frequency))
      real(wp) :: natural

      natural = get_mode_frequency(box, lx, ly, lz)
      associate (w => 2*pi*frequency, decay => 6*log(10.0_wp)/get_reverberation_time(box, natural))
         resonance = get_modal_stiffness(box, lx, ly, lz)*cmplx(0.0_wp, w, wp)/cmplx((2*pi*natural)**2 - w**2, w*decay, wp)
      end associate
   end function get_resonance

   !> rho0 c0**2/(V norm) of a mode of the room with its mean-square shape as norm, Pa/m3.
   pure function get_modal_stiffness(box, lx, ly, lz) result(stiffness)
      type(box_type), intent(in) :: box
      integer, intent(in) :: lx, ly, lz
      real(wp) :: stiffness

      stiffness = box%air%density*box%air%sound_speed**2/product(box%sides)*2**count([lx, ly, lz] > 0)
   end function get_modal_stiffness

   !> Energy into the modes of the room, and their losses, J (Parseval).
   subroutine add_room_energies(box, lx, ly, highest, frequency, flow, step, input, loss)
      type(box_type), intent(in) :: box
      integer, intent(in) :: lx(:), ly(:)
      real(wp), intent(in) :: highest
      real(wp), intent(in) :: frequency(:)
      !> Volume flow into pairs of half waves: [n_pair, n_line].
      complex(wp), intent(in) :: flow(:, :)
      !> Distance of the frequencies, Hz.
      real(wp), intent(in) :: step
      real(wp), intent(out) :: input, loss
      complex(wp) :: pressure(size(frequency))
      real(wp) :: natural
      integer :: i, k

      input = 0.0_wp
      loss = 0.0_wp
      do i = 1, size(lx)
         k = 0
         do
            natural = get_mode_frequency(box, lx(i), ly(i), k)
            if (natural > highest) exit
            pressure = get_resonance(box, lx(i), ly(i), k, frequency)*flow(i, :)
            input = input + 2*step*sum(real(pressure*conjg(flow(i, :)), wp))
            loss = loss + 2*step*sum(abs(pressure)**2)*6*log(10.0_wp)/get_reverberation_time(box, natural) &
               /get_modal_stiffness(box, lx(i), ly(i), k)
            k = k + 1
         end do
      end do
   end subroutine add_room_energies

   !> Maximum Fast levels of a sound in bands.
   subroutine add_levels(bands, frequency, sound, sample_rate, signal, level)
      type(band_type), intent(in) :: bands(:)
      !> Frequencies, Hz, and spectrum, Pa: [n_line].
      real(wp), intent(in) :: frequency(:)
      complex(wp), intent(in) :: sound(:)
      real(wp), intent(in) :: sample_rate
      !> Workspace: [n_sample].
      real(wp), intent(inout) :: signal(:)
      !> The levels, dB: [n_band].
      real(wp), intent(out) :: level(:)
      real(wp) :: mean, largest, decay
      integer :: i, k

      decay = exp(-1/(sample_rate*time_constant))
      do i = 1, size(bands)
         call get_signal([(0.0_wp, 0.0_wp), sound*get_filter(bands(i), frequency)], signal)
         mean = 0.0_wp
         largest = tiny(largest)
         do k = 1, size(signal)
            mean = decay*mean + (1 - decay)*signal(k)**2
            largest = max(largest, mean)
         end do
         level(i) = 10*log10(largest/reference_pressure**2)
      end do
   end subroutine add_levels

   !> Transfer function of a band filter: Butterworth of third order with the exact edges (class 1 of IEC 61260-1).
   pure function get_filter(band, frequency) result(transfer)
      type(band_type), intent(in) :: band
      real(wp), intent(in) :: frequency(:)
      complex(wp) :: transfer(size(frequency))
      complex(wp) :: s(size(frequency))

      s = cmplx(0.0_wp, (frequency - band%lower*band%upper/frequency)/(band%upper - band%lower), wp)
      transfer = 1/((s + 1)*(s**2 + s + 1))
   end function get_filter

end module thud_modal_room
