!> Radiation of the modes of a floor into the room below: a baffled plate, by an integral over wavenumbers.
!>
!> The power of a velocity v with the transform V over the plate is rho0 c0 k0/(4 pi**2) times the integral of |V|**2/kz over
!> the wavenumbers below that of sound, k0 (Williams, *Fourier Acoustics*). It contains the cross terms of all modes.
!>
!> The mean over all strike points of an area is exact: with the velocities r of the modes per unit of their force, and G the
!> means of the products of their shapes at the strike points, the power is the double sum of r_k conj(r_l) G_kl R_kl, where
!> R holds the powers of pairs of modes.
module thud_modal_radiation
   use thud_band, only: band_type
   use thud_constants, only: pi
   use thud_coupled_modes, only: coupled_modes_type, get_coupled_modes, get_diagonal, new_part, part_type
   use thud_floor_modes, only: floor_modes_type, get_poles
   use thud_kinds, only: wp
   use thud_mode_mixing, only: get_mixed, get_mixing, get_row, get_unmixed, is_identity, mixing_type
   use thud_plate, only: air_type, get_plate_radiation, get_resistance, get_surface_mass, get_total_loss, plate_type
   use thud_plate_shapes, only: get_coefficients, get_shapes, get_squares, get_weighted, shapes_type
   use thud_ritz_system, only: get_mode_values
   use thud_wave_transforms, only: get_pair_powers, get_powers, get_some, get_transforms, new_wave_series, &
      transforms_type, wave_series_type
   implicit none (type, external)
   private

   public :: get_modal_radiation, get_strike_points, modal_radiation_type

   !> Number of wavenumbers of sound per band, at which the transforms are computed.
   integer, parameter :: n_wavenumber = 3

   !> Smallest loss factor and angular frequency, rad/s, of a mode: without losses a resonance has no mean.
   real(wp), parameter :: min_loss_factor = 1.0e-6_wp, min_omega = 1.0_wp

   !> Relative error of mean squares by the amplitudes that represent them.
   real(wp), parameter :: mean_error = 1.0e-4_wp

   !> Modes up to this ratio of frequencies take part in a band, and all modes up to this angular frequency, rad/s.
   real(wp), parameter :: max_ratio = 2.5_wp, min_highest = 2*pi*500.0_wp

   !> Number of modes, and of modes that strikes on a part of the floor couple, above which only those within a ratio of
   !> frequencies to the band take part.
   integer, parameter :: max_modes = 2000, max_coupled = 200
   real(wp), parameter :: near_ratio = 1.3_wp

   !> Answer of a floor to a force at its mean position above the room, per band.
   type :: modal_radiation_type
      !> Radiation factor of the part above the room: power over rho0 c0 times area times mean-square velocity there:
      !> [n_band].
      real(wp), allocatable :: radiation_factor(:)
      !> The same of its upper side: [n_band].
      real(wp), allocatable :: upper_factor(:)
      !> Power that the bearing plate dissipates per mean-square force, m/(N s): [n_band].
      real(wp), allocatable :: conductance(:)
      !> Power that the floor radiates into the room per mean-square force, m/(N s): [n_band].
      real(wp), allocatable :: radiated(:)
      !> Energy of the bearing plate beyond the room over that above the room: [n_band].
      real(wp), allocatable :: energy_beyond(:)
   end type modal_radiation_type

   !> Integrals over angular frequencies: radiated power over rho0 c0, squared velocity times area of the bearing plate and
   !> of its part above the room, m4/s2 rad/s, and 1, rad/s.
   type :: sums_type
      real(wp) :: power = 0.0_wp, velocity = 0.0_wp, above = 0.0_wp, width = 0.0_wp
   end type sums_type

contains

   !> Radiation of a floor in bands, averaged over the strike points above the room and over the frequencies of each band. In
   !> bands beyond the modes the plate takes their place.
   subroutine get_modal_radiation(modes, plate, air, bands, area, radiation, stated_strike)
      type(floor_modes_type), intent(in) :: modes
      !> The bearing plate, with its mass and total losses.
      type(plate_type), intent(in) :: plate
      type(air_type), intent(in) :: air
      !> The bands: [n_band].
      type(band_type), intent(in) :: bands(:)
      !> Ends of the part of the plate above the room along length and width, m: [4].
      real(wp), intent(in) :: area(4)
      type(modal_radiation_type), intent(out) :: radiation
      !> Strike points, relative to length and width (default: the mean over the part above the room): [2, n].
      real(wp), intent(in), optional :: stated_strike(:, :)
      type(wave_series_type) :: along, across
      type(shapes_type) :: radiator
      type(part_type) :: part
      type(sums_type) :: sums
      real(wp), allocatable :: drive(:, :)
      complex(wp), allocatable :: pole(:)
      type(mixing_type) :: mixing
      integer, allocatable :: kept(:)
      real(wp) :: highest
      logical :: couples_all
      integer :: i

      allocate (radiation%radiation_factor(size(bands)), radiation%conductance(size(bands)))
      allocate (radiation%radiated(size(bands)), radiation%energy_beyond(size(bands)))
      allocate (radiation%upper_factor(size(bands)))
      if (size(bands) == 0) return
      highest = 2*pi*maxval(bands%upper)/air%sound_speed
      part = new_part(modes, area)
      couples_all = all([area(2) - area(1), area(4) - area(3)] &
         < [modes%stack%length, modes%stack%width]*(1 - 1.0e-9_wp))
      associate (displacement => modes%modes%displacement(modes%stack%radiator))
         along = new_wave_series(displacement%x, area(1:2), highest)
         across = new_wave_series(displacement%y, area(3:4), highest)
      end associate
      do i = 1, size(bands)
         kept = get_participating(modes, bands(i), merge(max_coupled, max_modes, couples_all))
         pole = get_poles(modes, kept)
         pole%re = max(pole%re, min_omega**2)
         pole%im = max(pole%im, min_loss_factor*pole%re)
         mixing = get_mixing(modes%modes, kept)
         radiator = get_shapes(modes, modes%stack%radiator, kept)
         if (present(stated_strike)) then
            call get_mode_values(modes%modes, 1, modes%stack%length*stated_strike(1, :), &
               modes%stack%width*stated_strike(2, :), drive, kept)
            call add_strikes(radiator, get_shapes(modes, modes%stack%bearing, kept), part, pole, mixing, drive, air, &
               bands(i), get_some(along, radiator%x), get_some(across, radiator%y), sums)
         else
            call add_modes(get_coupled_modes(modes, part, radiator, kept, mixing), pole, air, bands(i), &
               get_some(along, radiator%x), get_some(across, radiator%y), sums)
         end if
         if (.not. sums%above > 0.0_wp .or. 2*pi*bands(i)%upper > min(modes%known_limit, modes%limit)) then
            ! A plate without modes there, or without resolved or known ones.
            radiation%radiation_factor(i) = get_plate_radiation(plate, air, bands(i)%center)
            radiation%conductance(i) = 1/get_resistance(plate)
            radiation%radiated(i) = 0.0_wp
            radiation%energy_beyond(i) = part%whole/part%area - 1
            cycle
         end if
         radiation%radiation_factor(i) = sums%power/sums%above
         radiation%radiated(i) = air%density*air%sound_speed*sums%power/sums%width
         radiation%energy_beyond(i) = sums%velocity/sums%above - 1
         ! The modes have these losses.
         radiation%conductance(i) = sums%velocity/sums%width*get_surface_mass(plate)*2*pi*bands(i)%center &
            *get_total_loss(plate, air, bands(i)%center)
      end do
      radiation%upper_factor = radiation%radiation_factor
      ! The upper side of a floor with a subceiling is that of the bearing plate.
      if (modes%stack%radiator /= modes%stack%bearing) radiation%upper_factor = get_plate_radiation(plate, air, bands%center)
   end subroutine get_modal_radiation

   !> Numbers of the modes that take part in a band: all up to `max_ratio`, or, if these are too many, those near the band.
   !> Modes of plates above each other with one number of half waves stay together, as their motions cancel.
   pure function get_participating(modes, band, max_count) result(kept)
      type(floor_modes_type), intent(in) :: modes
      type(band_type), intent(in) :: band
      !> Number of modes above which fewer take part.
      integer, intent(in) :: max_count
      integer, allocatable :: kept(:)
      logical :: is_kept(size(modes%omega))
      integer :: i, k, n

      is_kept = modes%omega < min(modes%limit, max(max_ratio*2*pi*band%upper, min_highest))
      if (count(is_kept) > max_count) then
         is_kept = is_kept .and. modes%omega > 2*pi*band%lower/near_ratio .and. modes%omega < 2*pi*band%upper*near_ratio
         n = 0
         do i = 1, size(modes%modes%block)
            associate (n_mode => size(modes%modes%block(i)%omega))
               if (n_mode <= size(modes%stack%plate)) is_kept(n + 1:n + n_mode) = any(is_kept(n + 1:n + n_mode)) &
                  .and. modes%omega(n + 1:n + n_mode) < modes%limit
               n = n + n_mode
            end associate
         end do
      end if
      kept = pack([(k, k=1, size(is_kept))], is_kept)
   end function get_participating

   !> Integrals over the frequencies of a band and means over strike points, with the cross terms of the modes.
   subroutine add_strikes(radiator, bearing, part, pole, mixing, drive, air, band, along, across, sums)
      !> Shapes of the radiating and of the bearing plate.
      type(shapes_type), intent(in) :: radiator, bearing
      type(part_type), intent(in) :: part
      !> Squared angular frequencies with their losses, omega**2 (1 + i eta), rad2/s2: [n_mode].
      complex(wp), intent(in) :: pole(:)
      type(mixing_type), intent(in) :: mixing
      !> Shapes at the strike points, 1/sqrt(kg): [n_mode, n_strike].
      real(wp), intent(in) :: drive(:, :)
      type(air_type), intent(in) :: air
      type(band_type), intent(in) :: band
      !> Transforms of the functions of x and of y.
      type(wave_series_type), intent(in) :: along, across
      type(sums_type), intent(out) :: sums
      type(transforms_type) :: transforms
      real(wp), allocatable :: amplitude(:, :), coefficient(:, :), weight(:, :)
      real(wp) :: edge(2)
      integer :: j, k

      weight = reshape([get_squares(radiator), get_squares(bearing)], [size(pole), 2])
      do j = 1, n_wavenumber
         edge = get_interval(band, j)
         call get_amplitudes(pole, mixing, drive, weight, 2*pi*edge, amplitude)
         sums%width = sums%width + 2*pi*(edge(2) - edge(1))*size(drive, 2)
         ! The functions are orthonormal.
         call get_coefficients(bearing, amplitude, coefficient)
         sums%velocity = sums%velocity + sum(coefficient**2)
         sums%above = sums%above + sum(coefficient*get_weighted(coefficient, bearing%x, bearing%y, part%bearing))
         call get_coefficients(radiator, amplitude, coefficient)
         transforms = get_transforms(along, across, 2*pi*sqrt(product(edge))/air%sound_speed)
         sums%power = sums%power + sum(get_powers(transforms, [(k, k=1, size(radiator%x))], [(k, k=1, size(radiator%y))], &
            coefficient))
      end do
   end subroutine add_strikes

   !> Amplitudes of the modes whose squares and products add up to those of the responses to forces, integrated over
   !> frequencies.
   !>
   !> With r_k = omega/(pole_k - omega**2), the integral of r_k conjg(r_l) is (F_k - conjg(F_l))/(conjg(pole_l) - pole_k), F
   !> being that of pole/(pole - omega**2). The amplitudes are the columns of a Cholesky factor of these integrals, the
   !> largest rest first, until the rest matters no more: far from their resonances, modes move alike at all frequencies.
   subroutine get_amplitudes(pole, mixing, drive, weight, edge, amplitude)
      !> Squared angular frequencies with their losses, rad2/s2: [n_mode].
      complex(wp), intent(in) :: pole(:)
      type(mixing_type), intent(in) :: mixing
      !> Shapes under the forces, 1/sqrt(kg): [n_mode, n_force].
      real(wp), intent(in) :: drive(:, :)
      !> Weights of the squared amplitudes in the sums that are wanted: [n_mode, n_sum].
      real(wp), intent(in) :: weight(:, :)
      !> Lowest and highest angular frequency, rad/s.
      real(wp), intent(in) :: edge(2)
      !> The amplitudes, (rad/s)**(1/2) m/(N s) sqrt(kg): [n_mode, n].
      real(wp), allocatable, intent(out) :: amplitude(:, :)
      complex(wp) :: integral(size(pole)), gain(size(pole), size(drive, 2))
      real(wp), dimension(size(pole)) :: rest, share
      real(wp), allocatable :: factor(:, :)
      integer :: j, k, n

      integral = get_integral(pole, edge(1), edge(2))
      gain = get_unmixed(mixing, cmplx(drive, kind=wp))
      rest = [(get_square(j), j=1, size(pole))]
      share = 0.0_wp
      do k = 1, size(weight, 2)
         share = share + weight(:, k)/max(sum(weight(:, k)*rest), tiny(1.0_wp))
      end do
      allocate (factor(size(pole), size(pole)))
      n = 0
      do while (n < size(pole))
         if (sum(share*rest) <= mean_error) exit
         j = maxloc(share*rest, dim=1)
         factor(:, n + 1) = (get_products(j) - matmul(factor(:, :n), factor(j, :n)))/sqrt(rest(j))
         n = n + 1
         rest = max(rest - factor(:, n)**2, 0.0_wp)
         rest(j) = 0.0_wp
      end do
      amplitude = factor(:, :n)
   contains

      !> Integral of the squared response of a mode.
      pure function get_square(number) result(square)
         integer, intent(in) :: number
         real(wp) :: square
         complex(wp), allocatable :: weight(:)
         integer :: k, first

         call get_row(mixing, number, first, weight)
         associate (of => [(k, k=first, first + size(weight) - 1)])
            square = real(sum([(weight(k)*sum(get_cross_integrals(of(k), of)*conjg(weight) &
               *matmul(conjg(gain(of, :)), gain(of(k), :))), k=1, size(weight))]), wp)
         end associate
      end function get_square

      !> Integrals of the products of the responses of all modes with that of one: [n_mode].
      pure function get_products(number) result(product)
         integer, intent(in) :: number
         real(wp) :: product(size(pole))
         complex(wp) :: unmixed(size(pole), 1)
         complex(wp), allocatable :: weight(:)
         integer :: i, k, first

         call get_row(mixing, number, first, weight)
         unmixed = 0.0_wp
         do k = 1, size(weight)
            associate (l => first + k - 1)
               unmixed(:, 1) = unmixed(:, 1) + conjg(weight(k)*get_cross_integrals(l, [(i, i=1, size(pole))])) &
                  *matmul(gain, conjg(gain(l, :)))
            end associate
         end do
         product = real(reshape(get_mixed(mixing, unmixed), [size(pole)]), wp)
      end function get_products

      !> Integrals of r_k conjg(r_l) of one mode k and others l.
      pure function get_cross_integrals(one, others) result(cross)
         integer, intent(in) :: one
         integer, intent(in) :: others(:)
         complex(wp) :: cross(size(others))

         cross = (integral(one) - conjg(integral(others)))/(conjg(pole(others)) - pole(one))
      end function get_cross_integrals
   end subroutine get_amplitudes

   !> Integral of pole/(pole - omega**2) over angular frequencies.
   elemental function get_integral(pole, low, high) result(integral)
      !> Squared angular frequency with its losses, rad2/s2.
      complex(wp), intent(in) :: pole
      !> Limits, rad/s.
      real(wp), intent(in) :: low, high
      complex(wp) :: integral

      associate (root => sqrt(pole))
         integral = root/2*(log((root + high)/(root + low)) - log((root - high)/(root - low)))
      end associate
   end function get_integral

   !> Lowest and highest frequency of one of `n_wavenumber` parts of a band, Hz.
   pure function get_interval(band, number) result(edge)
      type(band_type), intent(in) :: band
      integer, intent(in) :: number
      real(wp) :: edge(2)

      edge = band%lower*(band%upper/band%lower)**([number - 1, number]/real(n_wavenumber, wp))
   end function get_interval

   !> Integrals over the frequencies of a band, averaged over the strike points.
   subroutine add_modes(coupled, pole, air, band, along, across, sums)
      type(coupled_modes_type), intent(in) :: coupled(:)
      !> Squared angular frequencies with their losses, rad2/s2: [n_mode].
      complex(wp), intent(in) :: pole(:)
      type(air_type), intent(in) :: air
      type(band_type), intent(in) :: band
      !> Transforms of the functions of x and of y.
      type(wave_series_type), intent(in) :: along, across
      type(sums_type), intent(out) :: sums
      type(transforms_type) :: transforms
      real(wp), allocatable :: response(:, :)
      real(wp) :: edge(2)
      integer :: i, j

      do j = 1, n_wavenumber
         edge = get_interval(band, j)
         sums%width = sums%width + 2*pi*(edge(2) - edge(1))
         transforms = get_transforms(along, across, 2*pi*sqrt(product(edge))/air%sound_speed)
         do i = 1, size(coupled)
            associate (these => coupled(i))
               response = get_responses(pole(these%mode), these%mixing, these%drive, 2*pi*edge)
               sums%velocity = sums%velocity + sum(response*these%velocity)
               sums%above = sums%above + sum(response*these%above)
               if (these%is_orthogonal) then
                  sums%power = sums%power + sum(get_diagonal(response) &
                     *get_powers(transforms, these%radiator%x, these%radiator%y, these%radiator%coefficient))
               else
                  sums%power = sums%power + sum(response*get_pair_powers(transforms, these%radiator))
               end if
            end associate
         end do
      end do
   end subroutine add_modes

   !> Integrals over frequencies and means over strike points of products of the responses of modes, rad/s (m/(N s))**2 kg:
   !> [n_mode, n_mode].
   pure function get_responses(pole, mixing, drive, edge) result(response)
      !> Squared angular frequencies with their losses, rad2/s2: [n_mode].
      complex(wp), intent(in) :: pole(:)
      type(mixing_type), intent(in) :: mixing
      !> Means of products of shapes over the strike points, 1/kg: [n_mode, n_mode].
      real(wp), intent(in) :: drive(:, :)
      !> Lowest and highest angular frequency, rad/s.
      real(wp), intent(in) :: edge(2)
      real(wp) :: response(size(pole), size(pole))
      complex(wp) :: integral(size(pole)), product(size(pole), size(pole))
      integer :: i

      integral = get_integral(pole, edge(1), edge(2))
      do i = 1, size(pole)
         product(:, i) = (integral - conjg(integral(i)))/(conjg(pole(i)) - pole)
      end do
      if (is_identity(mixing)) then
         response = drive*real(product, wp)
         return
      end if
      ! With the matrix W: W (product * (W' G W)) W', where ' is the conjugate transpose.
      product = product*get_unmixed(mixing, get_hermitian(get_unmixed(mixing, cmplx(drive, kind=wp))))
      response = real(get_mixed(mixing, get_hermitian(get_mixed(mixing, product))), wp)
   end function get_responses

   !> Conjugate transpose of a matrix.
   pure function get_hermitian(matrix) result(transposed)
      complex(wp), intent(in) :: matrix(:, :)
      complex(wp) :: transposed(size(matrix, 2), size(matrix, 1))

      transposed = conjg(transpose(matrix))
   end function get_hermitian

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

end module thud_modal_radiation
