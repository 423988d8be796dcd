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
   use thud_floor_modes, only: floor_modes_type, get_poles, get_selected_modes
   use thud_function_set, only: get_overlap
   use thud_kinds, only: wp
   use thud_lapack, only: dpstrf
   use thud_matrix_product, only: get_product
   use thud_modes, only: are_mixed, get_integrals, get_merged_shape, get_mixed, get_mode_values, mode_block_type, &
      modes_type, overlap_type, product_type, shape_type
   use thud_plate, only: air_type, get_plate_radiation, get_resistance, get_surface_mass, get_total_loss, plate_type
   use thud_wave_transforms, only: get_powers, get_transforms, new_wave_series, transforms_type, wave_series_type
   implicit none (type, external)
   private

   public :: get_modal_radiation, modal_radiation_type

   !> Number of wavenumbers of sound per band, at which the transforms are computed.
   integer, parameter :: n_wavenumber = 3

   !> Smallest loss factor and angular frequency, rad/s, of a mode: without losses a resonance has no mean.
   real(wp), parameter :: min_loss_factor = 1.0e-6_wp, min_omega = 1.0_wp

   !> Modes up to this ratio of frequencies take part in a band, and all modes up to this angular frequency, rad/s.
   real(wp), parameter :: max_ratio = 2.5_wp, min_highest = 2*pi*500.0_wp

   !> Number of modes, and of modes that strikes on a part of the floor couple, above which only those within a ratio of
   !> frequencies to the band take part.
   integer, parameter :: max_modes = 2000, max_coupled = 200
   real(wp), parameter :: near_ratio = 1.3_wp

   !> Orthonormal functions whose product has a smaller integral over a part are orthogonal there, but for rounding.
   real(wp), parameter :: rounding = 1.0e-9_wp

   !> Modes whose products have a smaller mean than this, relative to their squares, are orthogonal.
   real(wp), parameter :: max_overlap = 0.05_wp

   !> Answer of a floor in a band to a force at its mean position above the room.
   type :: modal_radiation_type
      !> Radiation factor of the part above the room: power over rho0 c0 times area times mean-square velocity there.
      real(wp) :: radiation_factor = 0.0_wp
      !> The same of its upper side.
      real(wp) :: upper_factor = 0.0_wp
      !> Power that the bearing plate dissipates per mean-square force, m/(N s).
      real(wp) :: conductance = 0.0_wp
      !> Power that the floor radiates into the room per mean-square force, m/(N s).
      real(wp) :: radiated = 0.0_wp
      !> Energy of the bearing plate beyond the room over that above the room.
      real(wp) :: energy_beyond = 0.0_wp
   end type modal_radiation_type

   !> Part of the floor above the room.
   type :: part_type
      !> Area, m2.
      real(wp) :: area = 0.0_wp
      !> Integrals over the part, of the plate under the source and of the bearing plate.
      type(overlap_type) :: struck, bearing
   end type part_type

   !> Modes whose shapes have products with a mean at the strike points.
   type :: coupled_modes_type
      type(mode_block_type), allocatable :: block(:)
      !> Squared angular frequencies with their losses, omega**2 (1 + i eta), rad2/s2: [n_mode].
      complex(wp), allocatable :: pole(:)
      !> Shapes of the radiating plate.
      type(shape_type) :: radiator
      !> Means G over the strike points, and integrals over the bearing plate and its part above the room, of products of
      !> shapes: [n_mode, n_mode].
      real(wp), allocatable :: drive(:, :), velocity(:, :), above(:, :)
      !> Means of products of different shapes vanish, and losses mix no modes.
      logical :: is_orthogonal = .false.
   end type coupled_modes_type

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
      !> Opposite corners of the part of the plate above the room, along length and width, m: [2, 2].
      real(wp), intent(in) :: area(2, 2)
      !> The answers: [n_band].
      type(modal_radiation_type), intent(out) :: radiation(:)
      !> Strike points, relative to length and width (default: the mean over the part above the room): [2, n].
      real(wp), intent(in), optional :: stated_strike(:, :)
      type(floor_modes_type) :: selected
      real(wp), allocatable :: strike(:, :)
      type(wave_series_type) :: along, across
      type(part_type) :: part
      real(wp) :: highest
      integer :: i, max_count

      if (size(bands) == 0) return
      ! gfortran 12 reads the bounds of an absent array when it passes it on.
      if (present(stated_strike)) strike = stated_strike
      highest = 2*pi*maxval(bands%upper)/air%sound_speed
      part = new_part(modes, area)
      max_count = max_modes
      if (all(area(:, 2) - area(:, 1) < [modes%stack%length, modes%stack%width]*(1 - 1.0e-9_wp))) max_count = max_coupled
      associate (displacement => modes%modes%displacement(modes%stack%radiator))
         along = new_wave_series(displacement%x, area(1, :), highest)
         across = new_wave_series(displacement%y, area(2, :), highest)
      end associate
      do i = 1, size(bands)
         selected = get_selected_modes(modes, take_part(modes, bands(i), max_count))
         radiation(i) = get_mean_radiation(get_coupled_modes(selected, part, strike), plate, air, bands(i), along, across)
         ! A plate without modes there, or without resolved or known ones.
         if (.not. radiation(i)%radiation_factor > 0.0_wp .or. 2*pi*bands(i)%upper > modes%limit) then
            radiation(i) = modal_radiation_type(radiation_factor=get_plate_radiation(plate, air, bands(i)%center), &
               conductance=1/get_resistance(plate), energy_beyond=modes%stack%length*modes%stack%width/part%area - 1)
         end if
      end do
      radiation%upper_factor = radiation%radiation_factor
      ! The upper side of a floor with a subceiling is that of the bearing plate.
      if (modes%stack%radiator /= modes%stack%bearing) radiation%upper_factor = get_plate_radiation(plate, air, bands%center)
   end subroutine get_modal_radiation

   !> Whether modes take part in a band: all up to `max_ratio`, or, if these are too many, those near the band. Modes of
   !> plates above each other with one number of half waves stay together, as their motions cancel.
   pure function take_part(modes, band, max_count) result(yes)
      type(floor_modes_type), intent(in) :: modes
      type(band_type), intent(in) :: band
      !> Number of modes above which fewer take part.
      integer, intent(in) :: max_count
      logical :: yes(size(modes%omega))
      integer :: i, n

      yes = modes%omega < min(modes%limit, max(max_ratio*2*pi*band%upper, min_highest))
      if (count(yes) <= max_count) return
      yes = yes .and. modes%omega > 2*pi*band%lower/near_ratio .and. modes%omega < 2*pi*band%upper*near_ratio
      n = 0
      do i = 1, size(modes%modes%block)
         associate (n_mode => size(modes%modes%block(i)%omega))
            if (n_mode <= size(modes%stack%plate)) yes(n + 1:n + n_mode) = any(yes(n + 1:n + n_mode)) &
               .and. modes%omega(n + 1:n + n_mode) < modes%limit
            n = n + n_mode
         end associate
      end do
   end function take_part

   !> Part of a floor above a room.
   function new_part(modes, area) result(part)
      type(floor_modes_type), intent(in) :: modes
      !> Its opposite corners along length and width, m: [2, 2].
      real(wp), intent(in) :: area(2, 2)
      type(part_type) :: part

      part%area = product(area(:, 2) - area(:, 1))
      if (part%area > modes%stack%length*modes%stack%width*(1 - 1.0e-9_wp)) return
      associate (displacement => modes%modes%displacement)
         part%struck = new_overlap(displacement(1))
         part%bearing = new_overlap(displacement(modes%stack%bearing))
      end associate
   contains

      !> Integrals over the part.
      function new_overlap(set) result(overlap)
         type(product_type), intent(in) :: set
         type(overlap_type) :: overlap

         allocate (overlap%x, source=get_overlap(set%x, 0, set%x, 0, area(1, 1), area(1, 2)))
         allocate (overlap%y, source=get_overlap(set%y, 0, set%y, 0, area(2, 1), area(2, 2)))
      end function new_overlap
   end function new_part

   !> Modes in sets whose shapes have products with a mean at the strike points.
   function get_coupled_modes(modes, part, stated_strike) result(coupled)
      type(floor_modes_type), intent(in) :: modes
      type(part_type), intent(in) :: part
      !> Strike points, relative to length and width (default: the mean over the part): [2, n].
      real(wp), intent(in), optional :: stated_strike(:, :)
      type(coupled_modes_type), allocatable :: coupled(:)
      type(shape_type) :: bearing
      complex(wp), allocatable :: pole(:)
      integer, allocatable :: set(:), members(:)
      integer :: last(0:size(modes%modes%block))
      integer :: i, j, k

      pole = get_poles(modes)
      pole%re = max(pole%re, min_omega**2)
      pole%im = max(pole%im, min_loss_factor*pole%re)
      last(0) = 0
      do i = 1, size(modes%modes%block)
         last(i) = last(i - 1) + size(modes%modes%block(i)%omega)
      end do
      if (present(stated_strike)) then
         set = spread(1, 1, size(modes%modes%block))
      else
         set = get_sets(modes%modes, part%struck)
      end if
      allocate (coupled(maxval([0, set])))
      do i = 1, size(coupled)
         members = pack([(k, k=1, size(set))], set == i)
         bearing = get_merged_shape(modes%modes, modes%stack%bearing, members)
         associate (these => coupled(i))
            these%block = modes%modes%block(members)
            these%pole = pole([([(j, j=last(members(k) - 1) + 1, last(members(k)))], k=1, size(members))])
            these%radiator = get_merged_shape(modes%modes, modes%stack%radiator, members)
            if (present(stated_strike)) then
               associate (shape => get_mode_values(modes%modes, 1, modes%stack%length*stated_strike(1, :), &
                  modes%stack%width*stated_strike(2, :)))
                  these%drive = matmul(shape, transpose(shape))/size(shape, 2)
               end associate
            else
               these%drive = get_integrals(get_merged_shape(modes%modes, 1, members), part%struck)/part%area
            end if
            these%velocity = get_integrals(bearing, overlap_type())
            these%above = these%velocity
            if (allocated(part%bearing%x)) these%above = get_integrals(bearing, part%bearing)
            these%is_orthogonal = are_orthogonal(these%drive) .and. .not. are_mixed(these%block)
         end associate
      end do
   end function get_coupled_modes

   !> Whether shapes are orthogonal, from the means of their products.
   pure function are_orthogonal(mean) result(yes)
      real(wp), intent(in) :: mean(:, :)
      logical :: yes
      integer :: i

      yes = .true.
      associate (norm => sqrt([(mean(i, i), i=1, size(mean, 1))]))
         do i = 2, size(norm)
            yes = yes .and. all(abs(mean(:i - 1, i)) <= max_overlap*norm(i)*norm(:i - 1))
         end do
      end associate
   end function are_orthogonal

   !> Index of the set of each block: blocks with functions that are not orthogonal belong to one. Over the whole floor,
   !> each block has its own: [n_block].
   pure function get_sets(modes, overlap) result(set)
      type(modes_type), intent(in) :: modes
      !> Integrals over the strike points of products of the functions of the plate under the source.
      type(overlap_type), intent(in) :: overlap
      integer :: set(size(modes%block))
      integer :: i, j, n

      set = [(i, i=1, size(set))]
      if (.not. allocated(overlap%x)) return
      do i = 2, size(set)
         do j = 1, i - 1
            if (set(i) == set(j)) cycle
            associate (one => modes%block(i)%shape(1), other => modes%block(j)%shape(1))
               if (all(abs(overlap%x(one%x, other%x)) <= rounding)) cycle
               if (all(abs(overlap%y(one%y, other%y)) <= rounding)) cycle
               where (set == max(set(i), set(j))) set = min(set(i), set(j))
            end associate
         end do
      end do
      ! Indices without gaps.
      n = 0
      do i = 1, size(set)
         if (set(i) /= i) cycle
         n = n + 1
         where (set == i) set = -n
      end do
      set = -set
   end function get_sets

   !> Radiation averaged over the frequencies of a band and over the strike points; nothing without modes.
   function get_mean_radiation(coupled, plate, air, band, along, across) result(radiation)
      type(coupled_modes_type), intent(in) :: coupled(:)
      !> The bearing plate, whose losses the modes have.
      type(plate_type), intent(in) :: plate
      type(air_type), intent(in) :: air
      type(band_type), intent(in) :: band
      !> Transforms of the functions of x and of y of the radiating plate.
      type(wave_series_type), intent(in) :: along, across
      type(modal_radiation_type) :: radiation
      type(transforms_type) :: transforms
      type(shape_type) :: motion
      real(wp), allocatable :: response(:, :)
      ! Integrals over angular frequencies: radiated power over rho0 c0, squared velocity times area of the bearing plate and
      ! of its part above the room, m4/s2 rad/s.
      real(wp) :: power, velocity, above
      real(wp) :: edge(2)
      integer :: i, j, n_x, n_y

      if (size(coupled) == 0) return
      power = 0.0_wp
      velocity = 0.0_wp
      above = 0.0_wp
      n_x = maxval([(maxval(coupled(i)%radiator%x), i=1, size(coupled))])
      n_y = maxval([(maxval(coupled(i)%radiator%y), i=1, size(coupled))])
      do j = 1, n_wavenumber
         edge = band%lower*(band%upper/band%lower)**([j - 1, j]/real(n_wavenumber, wp))
         transforms = get_transforms(along, across, n_x, n_y, 2*pi*sqrt(product(edge))/air%sound_speed)
         do i = 1, size(coupled)
            response = get_responses(coupled(i), 2*pi*edge)
            velocity = velocity + sum(response*coupled(i)%velocity)
            above = above + sum(response*coupled(i)%above)
            motion = coupled(i)%radiator
            motion%coefficient = get_product(motion%coefficient, get_factor(response, coupled(i)%is_orthogonal))
            power = power + sum(get_powers(transforms, motion))
         end do
      end do
      if (.not. above > 0.0_wp) return
      associate (width => 2*pi*(band%upper - band%lower))
         radiation = modal_radiation_type(radiation_factor=power/above, radiated=air%density*air%sound_speed*power/width, &
            energy_beyond=velocity/above - 1, conductance=velocity/width*get_surface_mass(plate)*2*pi*band%center &
            *get_total_loss(plate, air, band%center))
      end associate
   end function get_mean_radiation

   !> Columns whose products with themselves add up to a matrix, [n, at most n]: motions that radiate apart.
   pure function get_factor(matrix, is_diagonal) result(factor)
      !> Positive semidefinite: [n, n].
      real(wp), intent(in) :: matrix(:, :)
      !> Of the matrix, only the diagonal counts.
      logical, intent(in) :: is_diagonal
      real(wp), allocatable :: factor(:, :)
      real(wp) :: lower(size(matrix, 1), size(matrix, 1)), work(2*size(matrix, 1))
      integer :: pivot(size(matrix, 1))
      integer :: i, n, rank, info

      n = size(matrix, 1)
      allocate (factor(n, n), source=0.0_wp)
      if (is_diagonal) then
         do i = 1, n
            factor(i, i) = sqrt(matrix(i, i))
         end do
         return
      end if
      lower = matrix
      call dpstrf('L', n, lower, n, pivot, rank, -1.0_wp, work, info)
      do i = 1, rank
         factor(pivot(i:), i) = lower(i:, i)
      end do
      factor = factor(:, :rank)
   end function get_factor

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

   !> Integrals over frequencies and means over strike points of products of the responses of modes, rad/s (m/(N s))**2 kg:
   !> [n_mode, n_mode].
   !>
   !> With r_k = omega/(pole_k - omega**2), the integral of r_k conjg(r_l) is (F_k - conjg(F_l))/(conjg(pole_l) - pole_k), F
   !> being that of pole/(pole - omega**2).
   pure function get_responses(modes, edge) result(response)
      type(coupled_modes_type), intent(in) :: modes
      !> Lowest and highest angular frequency, rad/s.
      real(wp), intent(in) :: edge(2)
      real(wp) :: response(size(modes%pole), size(modes%pole))
      complex(wp) :: integral(size(modes%pole)), product(size(modes%pole), size(modes%pole))
      integer :: i

      associate (pole => modes%pole)
         integral = get_integral(pole, edge(1), edge(2))
         do i = 1, size(pole)
            product(:, i) = (integral - conjg(integral(i)))/(conjg(pole(i)) - pole)
         end do
      end associate
      if (.not. are_mixed(modes%block)) then
         response = modes%drive*real(product, wp)
         return
      end if
      ! With the matrix W: W (product * (W' G W)) W', where ' is the conjugate transpose.
      product = product*get_mixed(modes%block, conjg(transpose( &
         get_mixed(modes%block, cmplx(modes%drive, kind=wp), is_transposed=.true.))), is_transposed=.true.)
      response = real(get_mixed(modes%block, conjg(transpose( &
         get_mixed(modes%block, product, is_transposed=.false.))), is_transposed=.false.), wp)
   end function get_responses

end module thud_modal_radiation
