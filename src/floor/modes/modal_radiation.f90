!> Radiation of the modes of a floor into the room below: a baffled plate, by an integral over wavenumbers.
!>
!> The power of a velocity v with the transform V over the plate is rho0 c0 k0/(4 pi**2) times the integral of |V|**2/kz over
!> the wavenumbers below that of sound, k0 (Williams, *Fourier Acoustics*). It contains the cross terms of all modes.
module thud_modal_radiation
   use thud_band, only: band_type
   use thud_constants, only: pi
   use thud_floor_modes, only: floor_modes_type
   use thud_function_set, only: function_set_type, get_functions, get_quadrature
   use thud_kinds, only: wp
   use thud_lapack, only: dgemm
   use thud_plate, only: air_type, get_plate_radiation, get_resistance, get_surface_mass, get_total_loss, plate_type
   use thud_ritz_system, only: get_mode_values
   implicit none (type, external)
   private

   public :: get_modal_radiation, get_strike_points, modal_radiation_type

   !> Number of strike points over which floors are averaged whose modes have no orthogonal shapes under the source.
   integer, parameter :: n_strike = 16

   !> Number of wavenumbers of sound per band, at which the transforms are computed.
   integer, parameter :: n_wavenumber = 3

   !> Minimum and maximum number of frequencies per wavenumber, and number of modes in a band from which the minimum is
   !> enough.
   integer, parameter :: min_frequencies = 3, max_frequencies = 12, many_modes = 40

   !> Modes up to this ratio of frequencies take part in a band, and all modes up to this angular frequency, rad/s.
   real(wp), parameter :: max_ratio = 2.5_wp, min_highest = 2*pi*500.0_wp

   !> Number of modes above which only those within a ratio of frequencies to the band take part.
   integer, parameter :: max_modes = 2000
   real(wp), parameter :: near_ratio = 1.3_wp

   !> Maximum number of directions of a quadrature: on large floors, the mean over many modes needs no more.
   integer, parameter :: max_directions = 40

   !> Parity of a product of functions about the center: even or odd in x and in y.
   integer, parameter :: n_parity = 4

   !> Answer of a floor to a force at its mean position, per band.
   type :: modal_radiation_type
      !> Radiation factor: power over rho0 c0 times area times mean-square velocity: [n_band].
      real(wp), allocatable :: radiation_factor(:)
      !> Power that the radiating plate dissipates per mean-square force, m/(N s): [n_band].
      real(wp), allocatable :: conductance(:)
      !> Power that it radiates to one side per mean-square force, m/(N s): [n_band].
      real(wp), allocatable :: radiated(:)
   end type modal_radiation_type

   !> Transforms of the modes at some wavenumbers.
   type :: transforms_type
      !> Weights of the integral over wavenumbers, 1/m: [n_wave].
      real(wp), allocatable :: weight(:)
      !> Transforms, m2/sqrt(kg): [n_wave, n_mode, n_parity].
      real(wp), allocatable :: value(:, :, :)
      !> Whether a mode has such a part: [n_mode, n_parity].
      logical, allocatable :: is_present(:, :)
   end type transforms_type

contains

   !> Radiation of a floor in bands, averaged over strike points and over the frequencies of each band. Averaged over all
   !> strike points, the cross terms of orthogonal modes vanish. In bands beyond the modes the plate takes their place.
   subroutine get_modal_radiation(modes, plate, air, bands, area, radiation, stated_strike)
      type(floor_modes_type), intent(in) :: modes
      !> The radiating plate, with its mass and total losses.
      type(plate_type), intent(in) :: plate
      type(air_type), intent(in) :: air
      !> The bands: [n_band].
      type(band_type), intent(in) :: bands(:)
      !> Ends of the part of the plate above the room along length and width, m: [4].
      real(wp), intent(in) :: area(4)
      type(modal_radiation_type), intent(out) :: radiation
      !> Strike points, relative to length and width (default: a mean over the floor): [2, n].
      real(wp), intent(in), optional :: stated_strike(:, :)
      real(wp), allocatable :: strike(:, :), all_drives(:, :), drive(:, :)
      integer, allocatable :: kept(:)
      real(wp) :: power, velocity, total
      integer :: i, k

      allocate (radiation%radiation_factor(size(bands)), radiation%conductance(size(bands)))
      allocate (radiation%radiated(size(bands)))
      if (present(stated_strike) .or. .not. modes%is_orthogonal) then
         if (present(stated_strike)) then
            strike = stated_strike
         else
            call get_strike_points(n_strike, strike)
         end if
         call get_mode_values(modes%modes, 1, modes%stack%length*strike(1, :), modes%stack%width*strike(2, :), all_drives)
      end if
      do i = 1, size(bands)
         kept = pack([(k, k=1, size(modes%omega))], &
            modes%omega < min(modes%limit, max(max_ratio*2*pi*bands(i)%upper, min_highest)))
         ! Of so many modes, those far from the band matter little.
         if (size(kept) > max_modes) kept = pack(kept, modes%omega(kept) > 2*pi*bands(i)%lower/near_ratio &
            .and. modes%omega(kept) < 2*pi*bands(i)%upper*near_ratio)
         if (allocated(all_drives)) drive = all_drives(kept, :)
         call add_band(modes, kept, air, bands(i), area, power, velocity, total, drive)
         if (.not. velocity > 0.0_wp .or. 2*pi*bands(i)%upper > modes%known_limit) then
            ! A plate without modes there, or without known ones.
            radiation%radiation_factor(i) = get_plate_radiation(plate, air, bands(i)%center)
            radiation%conductance(i) = 1/get_resistance(plate)
            radiation%radiated(i) = 0.0_wp
            cycle
         end if
         radiation%radiation_factor(i) = power/velocity
         radiation%radiated(i) = air%density*air%sound_speed*power/total
         radiation%conductance(i) = velocity/total*get_surface_mass(plate)*2*pi*bands(i)%center &
            *get_total_loss(plate, air, bands(i)%center)
      end do
   end subroutine get_modal_radiation

   !> Sums of a band over its frequencies: over the strike points with the cross terms of the modes or, without strike
   !> points, the mean over all of them for modes that are orthogonal.
   subroutine add_band(modes, kept, air, band, area, power, velocity, total, drive)
      type(floor_modes_type), intent(in) :: modes
      !> Numbers of the modes: [n_mode].
      integer, intent(in) :: kept(:)
      type(air_type), intent(in) :: air
      type(band_type), intent(in) :: band
      real(wp), intent(in) :: area(4)
      !> Sums of radiated power over rho0 c0 and of the squared velocity times area, m4/s2, and of their weights.
      real(wp), intent(out) :: power, velocity, total
      !> Shapes at the strike points, 1/sqrt(kg): [n_mode, n_strike].
      real(wp), intent(in), optional :: drive(:, :)
      type(transforms_type) :: transforms
      complex(wp), allocatable :: amplitude(:, :)
      real(wp), allocatable :: square(:), resistance(:), response(:)
      real(wp) :: omega(size(kept)), loss_factor(size(kept)), edge(2)
      real(wp) :: ratio, frequency, w
      integer :: j, l, n

      power = 0.0_wp
      velocity = 0.0_wp
      total = 0.0_wp
      omega = modes%omega(kept)
      loss_factor = modes%loss_factor(kept)
      if (.not. present(drive)) square = get_square_shapes(modes, kept)
      ratio = (band%upper/band%lower)**(1.0_wp/n_wavenumber)
      n = get_frequency_count(omega, loss_factor, band, ratio)
      do j = 1, n_wavenumber
         edge = band%lower*ratio**[j - 1, j]
         call get_transforms(modes, kept, area, 2*pi*sqrt(product(edge))/air%sound_speed, transforms)
         if (.not. present(drive)) resistance = matmul(transforms%weight, sum(transforms%value**2, dim=3))
         do l = 1, n
            ! Geometric steps, whose widths are proportional to the frequency.
            frequency = edge(1)*ratio**((l - 0.5_wp)/n)
            w = 2*pi*frequency
            if (present(drive)) then
               amplitude = spread(cmplx(0.0_wp, w, wp)/cmplx(omega**2 - w**2, w*omega*loss_factor, wp), 2, &
                  size(drive, 2))*drive
               power = power + frequency*get_power(transforms, amplitude)
               velocity = velocity + frequency*get_square_velocity(modes, kept, amplitude)
               total = total + frequency*size(drive, 2)
            else
               response = square*w**2/((omega**2 - w**2)**2 + (w*omega*loss_factor)**2)
               power = power + frequency*sum(response*resistance)
               velocity = velocity + frequency*sum(response*square)
               total = total + frequency*modes%stack%length*modes%stack%width
            end if
         end do
      end do
   end subroutine add_band

   !> Relative positions that fill a floor evenly (the R2 sequence of Roberts): [2, n].
   pure subroutine get_strike_points(n, strike)
      integer, intent(in) :: n
      real(wp), allocatable, intent(out) :: strike(:, :)
      !> Solution of x**3 = x + 1.
      real(wp), parameter :: plastic = 1.32471795724474602596_wp
      integer :: i

      allocate (strike(2, n))
      do i = 1, n
         strike(:, i) = modulo(0.5_wp + i/plastic**[1, 2], 1.0_wp)
      end do
   end subroutine get_strike_points

   !> Number of frequencies per wavenumber that resolve the resonances in a band: two per half-power width.
   pure function get_frequency_count(omega, loss_factor, band, ratio) result(n)
      !> Angular frequencies, rad/s, and loss factors of the modes: [n_mode].
      real(wp), intent(in) :: omega(:), loss_factor(:)
      type(band_type), intent(in) :: band
      !> Ratio of the frequencies per wavenumber.
      real(wp), intent(in) :: ratio
      integer :: n
      logical :: in_band(size(omega))

      in_band = omega > 2*pi*band%lower/ratio .and. omega < 2*pi*band%upper*ratio
      n = min_frequencies
      ! Many modes make a smooth mean without resolved resonances.
      if (count(in_band) < many_modes) n = min(max(ceiling(2*log(ratio)/max(minval(loss_factor, mask=in_band), &
         1.0e-3_wp)), min_frequencies), max_frequencies)
   end function get_frequency_count

   !> Transforms of the modes at the wavenumbers of sound.
   subroutine get_transforms(modes, kept, area, wavenumber, transforms)
      type(floor_modes_type), intent(in) :: modes
      !> Numbers of the modes: [n_mode].
      integer, intent(in) :: kept(:)
      real(wp), intent(in) :: area(4)
      !> Wavenumber of sound, 1/m.
      real(wp), intent(in) :: wavenumber
      type(transforms_type), intent(out) :: transforms
      real(wp), allocatable :: theta(:), theta_weight(:), phi(:), phi_weight(:), kx(:), ky(:)
      real(wp), allocatable :: wave_x(:, :, :), wave_y(:, :, :), product(:, :)
      integer, allocatable :: in_block(:)
      integer :: i, j, k, p, n, n_wave, first

      ! A quadrant is enough: squares of the four parities add up. Products of two transforms are resolved.
      n = min(6 + int(wavenumber*max(area(2) - area(1), area(4) - area(3))/2), max_directions)
      call get_quadrature(n, 0.0_wp, pi/2, theta, theta_weight)
      call get_quadrature(n, 0.0_wp, pi/2, phi, phi_weight)
      kx = [((wavenumber*sin(theta(i))*cos(phi(j)), i=1, n), j=1, n)]
      ky = [((wavenumber*sin(theta(i))*sin(phi(j)), i=1, n), j=1, n)]
      ! d2k/kz = k0 sin(theta) dtheta dphi; k0/(4 pi**2) makes it a radiation factor times an area.
      transforms%weight = 4*(wavenumber/(2*pi))**2*[((theta_weight(i)*sin(theta(i))*phi_weight(j), i=1, n), j=1, n)]
      n_wave = size(kx)
      associate (radiator => modes%modes%displacement(modes%stack%radiator))
         call get_waves(radiator%x, area(1:2), kx, wave_x)
         call get_waves(radiator%y, area(3:4), ky, wave_y)
      end associate
      allocate (transforms%value(n_wave, size(kept), n_parity), source=0.0_wp)
      allocate (transforms%is_present(size(kept), n_parity), source=.false.)
      first = 0
      n = 0
      do i = 1, size(modes%modes%block)
         if (n == size(kept)) exit
         associate (block => modes%modes%block(i))
            in_block = get_in_block(kept, n, first, size(block%omega))
            first = first + size(block%omega)
            if (size(in_block) == 0) cycle
            associate (shape => block%shape(modes%stack%radiator))
               do p = 1, n_parity
                  associate (x => wave_x(:, shape%x, 1 + (p - 1)/2), y => wave_y(:, shape%y, 1 + mod(p - 1, 2)))
                     if (maxval(abs(x))*maxval(abs(y)) < 1.0e-10_wp) cycle
                     allocate (product(n_wave, size(x, 2)*size(y, 2)))
                     do j = 1, size(y, 2)
                        do k = 1, size(x, 2)
                           product(:, (j - 1)*size(x, 2) + k) = x(:, k)*y(:, j)
                        end do
                     end do
                     transforms%value(:, n + 1:n + size(in_block), p) = &
                        get_matrix_product(product, shape%coefficient(:, in_block))
                     transforms%is_present(n + 1:n + size(in_block), p) = .true.
                     deallocate (product)
                  end associate
               end do
            end associate
            n = n + size(in_block)
         end associate
      end do
   end subroutine get_transforms

   !> Product of two matrices, by BLAS.
   pure function get_matrix_product(left, right) result(product)
      real(wp), intent(in) :: left(:, :), right(:, :)
      real(wp) :: product(size(left, 1), size(right, 2))

      product = 0.0_wp
      call dgemm('N', 'N', size(left, 1), size(right, 2), size(left, 2), 1.0_wp, left, size(left, 1), right, &
         size(right, 1), 0.0_wp, product, size(left, 1))
   end function get_matrix_product

   !> Cosine and sine transforms of functions about the center of an interval: [n_wave, count, 2].
   pure subroutine get_waves(set, ends, wavenumber, wave)
      type(function_set_type), intent(in) :: set
      !> Ends of the interval, m: [2].
      real(wp), intent(in) :: ends(2)
      !> Wavenumbers, 1/m: [n_wave].
      real(wp), intent(in) :: wavenumber(:)
      real(wp), allocatable, intent(out) :: wave(:, :, :)
      real(wp), allocatable :: point(:), weight(:), function_value(:, :), phase(:, :)

      call get_quadrature(set%count + 20 + int(maxval(wavenumber)*(ends(2) - ends(1))/2), ends(1), ends(2), point, weight)
      allocate (function_value, source=get_functions(set, point, 0)*spread(weight, 2, set%count))
      allocate (phase, source=spread(wavenumber, 2, size(point))*spread(point - sum(ends)/2, 1, size(wavenumber)))
      allocate (wave(size(wavenumber), set%count, 2))
      wave(:, :, 1) = get_matrix_product(cos(phase), function_value)
      wave(:, :, 2) = get_matrix_product(sin(phase), function_value)
   end subroutine get_waves

   !> Radiated power over rho0 c0, summed over the strike points, m4/s2.
   function get_power(transforms, amplitude) result(power)
      type(transforms_type), intent(in) :: transforms
      !> Amplitudes of the modes: [n_mode, n_strike].
      complex(wp), intent(in) :: amplitude(:, :)
      real(wp) :: power
      integer, allocatable :: present_modes(:)
      integer :: p, k

      power = 0.0_wp
      do p = 1, n_parity
         present_modes = pack([(k, k=1, size(amplitude, 1))], transforms%is_present(:, p))
         if (size(present_modes) == 0) cycle
         associate (value => transforms%value(:, present_modes, p), part => amplitude(present_modes, :))
            power = power + sum(matmul(transforms%weight, get_matrix_product(value, real(part, wp))**2 &
               + get_matrix_product(value, aimag(part))**2))
         end associate
      end do
   end function get_power

   !> Numbers of the next modes within their block.
   pure function get_in_block(kept, n_before, first, count) result(in_block)
      !> Numbers of the modes, ascending: [n_mode].
      integer, intent(in) :: kept(:)
      !> Number of modes in blocks before this one, of those kept and of all; number of modes of the block.
      integer, intent(in) :: n_before, first, count
      integer, allocatable :: in_block(:)
      integer :: n

      n = n_before
      do
         if (n == size(kept)) exit
         if (kept(n + 1) > first + count) exit
         n = n + 1
      end do
      in_block = kept(n_before + 1:n) - first
   end function get_in_block

   !> Integral of the squared velocity of the radiating plate, summed over the strike points, m4/s2.
   function get_square_velocity(modes, kept, amplitude) result(total)
      type(floor_modes_type), intent(in) :: modes
      integer, intent(in) :: kept(:)
      complex(wp), intent(in) :: amplitude(:, :)
      real(wp) :: total
      integer, allocatable :: in_block(:)
      integer :: i, first, n

      total = 0.0_wp
      first = 0
      n = 0
      do i = 1, size(modes%modes%block)
         if (n == size(kept)) exit
         associate (block => modes%modes%block(i))
            in_block = get_in_block(kept, n, first, size(block%omega))
            first = first + size(block%omega)
            if (size(in_block) == 0) cycle
            ! The functions are orthonormal.
            associate (shape => block%shape(modes%stack%radiator)%coefficient(:, in_block), &
               part => amplitude(n + 1:n + size(in_block), :))
               total = total + sum(get_matrix_product(shape, real(part, wp))**2 + get_matrix_product(shape, aimag(part))**2)
            end associate
            n = n + size(in_block)
         end associate
      end do
   end function get_square_velocity

   !> Integrals of the squared shapes of the radiating plate, m2/kg: [n_mode].
   function get_square_shapes(modes, kept) result(square)
      type(floor_modes_type), intent(in) :: modes
      integer, intent(in) :: kept(:)
      real(wp) :: square(size(kept))
      integer, allocatable :: in_block(:)
      integer :: i, first, n

      first = 0
      n = 0
      do i = 1, size(modes%modes%block)
         if (n == size(kept)) exit
         associate (block => modes%modes%block(i))
            in_block = get_in_block(kept, n, first, size(block%omega))
            first = first + size(block%omega)
            if (size(in_block) == 0) cycle
            square(n + 1:n + size(in_block)) = &
               sum(block%shape(modes%stack%radiator)%coefficient(:, in_block)**2, dim=1)
            n = n + size(in_block)
         end associate
      end do
   end function get_square_shapes

end module thud_modal_radiation
