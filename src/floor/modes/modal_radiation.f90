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
   use thud_floor_modes, only: floor_modes_type, get_poles
   use thud_function_set, only: function_set_type, get_functions, get_overlap, get_quadrature
   use thud_kinds, only: wp
   use thud_matrix_product, only: get_product, get_transposed_product
   use thud_mode_mixing, only: get_mixed, get_mixing, get_part, get_unmixed, is_identity, mixing_type
   use thud_plate, only: air_type, get_plate_radiation, get_resistance, get_surface_mass, get_total_loss, plate_type
   use thud_ritz_system, only: get_mode_values, get_ranges, product_type
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

   !> Orthonormal functions whose product has a smaller integral over a part are orthogonal there, but for rounding.
   real(wp), parameter :: rounding = 1.0e-9_wp

   !> Modes whose products have a smaller mean than this, relative to their squares, are orthogonal.
   real(wp), parameter :: max_overlap = 0.05_wp

   !> Maximum number of directions of a quadrature: on large floors, the mean over many modes needs no more.
   integer, parameter :: max_directions = 64

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

   !> Integrals over an area of products of functions of x and of those of y: [n_x, n_x], [n_y, n_y].
   type :: overlap_type
      real(wp), allocatable :: x(:, :), y(:, :)
   end type overlap_type

   !> Part of the floor above the room.
   type :: part_type
      !> Area, m2, and that of the whole floor.
      real(wp) :: area = 0.0_wp, whole = 0.0_wp
      !> Integrals of products of functions of x and y over the part, of the plate under the source and of the bearing plate;
      !> not allocated for the whole floor, over which functions are orthonormal.
      type(overlap_type) :: struck, bearing
   end type part_type

   !> Integrals over angular frequencies: radiated power over rho0 c0, squared velocity times area of the bearing plate and
   !> of its part above the room, m4/s2 rad/s, and 1, rad/s.
   type :: sums_type
      real(wp) :: power = 0.0_wp, velocity = 0.0_wp, above = 0.0_wp, width = 0.0_wp
   end type sums_type

   !> Shapes of some modes in a block.
   type :: block_shapes_type
      !> Positions of the functions in the lists of all shapes: [n_x], [n_y].
      integer, allocatable :: x(:), y(:)
      !> Coefficients of their products, x first: [n_x*n_y, n_mode].
      real(wp), allocatable :: coefficient(:, :)
   end type block_shapes_type

   !> Shapes of the radiating plate in some modes, and numbers of all functions of x and of y in them.
   type :: shapes_type
      integer, allocatable :: x(:), y(:)
      type(block_shapes_type), allocatable :: block(:)
   end type shapes_type

   !> Modes whose shapes have products with a mean at the strike points.
   type :: coupled_modes_type
      !> Their numbers among those that take part: [n_mode].
      integer, allocatable :: mode(:)
      !> Shapes of the radiating plate.
      type(block_shapes_type) :: radiator
      !> Means G over the strike points, and integrals over the bearing plate and its part above the room, of products of
      !> shapes: [n_mode, n_mode].
      real(wp), allocatable :: drive(:, :), velocity(:, :), above(:, :)
      type(mixing_type) :: mixing
      !> Means of products of different shapes vanish, and losses mix no modes.
      logical :: is_orthogonal = .false.
   end type coupled_modes_type

   !> Cosine and sine transforms of functions about the center of an interval, as Chebyshev series of the wavenumber. They
   !> are entire functions of it, so that few terms give them to rounding.
   type :: wave_series_type
      !> Highest wavenumber, 1/m.
      real(wp) :: highest = 0.0_wp
      !> Length of the interval, m.
      real(wp) :: length = 0.0_wp
      !> Coefficients: [n_term, n_function, 2].
      real(wp), allocatable :: coefficient(:, :, :)
      !> Whether a function has such a part: [n_function, 2].
      logical, allocatable :: is_present(:, :)
   end type wave_series_type

   !> Transforms at one wavenumber k0 of sound: kx = k0 sin(a) and ky = k0 cos(a) sin(b).
   type :: transforms_type
      !> Cosine and sine transforms along x: [n_x, n_angle, 2].
      real(wp), allocatable :: along(:, :, :)
      !> Integrals over b of products of two transforms along y, with the weights of the angles a: [n_y, n_y, n_angle, 2].
      real(wp), allocatable :: across(:, :, :, :)
      !> Whether a function of x or y has a cosine and a sine transform: [n_x, 2], [n_y, 2].
      logical, allocatable :: has_along(:, :), has_across(:, :)
   end type transforms_type

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
      integer :: i, k

      allocate (radiation%radiation_factor(size(bands)), radiation%conductance(size(bands)))
      allocate (radiation%radiated(size(bands)), radiation%energy_beyond(size(bands)))
      highest = 2*pi*maxval(bands%upper)/air%sound_speed
      part = new_part(modes, area)
      couples_all = all([area(2) - area(1), area(4) - area(3)] &
         < [modes%stack%length, modes%stack%width]*(1 - 1.0e-9_wp))
      associate (displacement => modes%modes%displacement(modes%stack%radiator))
         along = new_wave_series(displacement%x, area(1:2), highest)
         across = new_wave_series(displacement%y, area(3:4), highest)
      end associate
      do i = 1, size(bands)
         kept = pack([(k, k=1, size(modes%omega))], &
            modes%omega < min(modes%limit, max(max_ratio*2*pi*bands(i)%upper, min_highest)))
         ! Of so many modes, those far from the band matter little.
         if (size(kept) > merge(max_coupled, max_modes, couples_all)) kept = pack(kept, &
            modes%omega(kept) > 2*pi*bands(i)%lower/near_ratio .and. modes%omega(kept) < 2*pi*bands(i)%upper*near_ratio)
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
         if (.not. sums%above > 0.0_wp .or. 2*pi*bands(i)%upper > modes%known_limit) then
            ! A plate without modes there, or without known ones.
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

   !> Part of a floor above a room.
   function new_part(modes, area) result(part)
      type(floor_modes_type), intent(in) :: modes
      !> Its ends along length and width, m.
      real(wp), intent(in) :: area(4)
      type(part_type) :: part

      part%area = (area(2) - area(1))*(area(4) - area(3))
      part%whole = modes%stack%length*modes%stack%width
      if (part%area > part%whole*(1 - 1.0e-9_wp)) return
      associate (displacement => modes%modes%displacement)
         part%struck = new_overlap(displacement(1))
         part%bearing = new_overlap(displacement(modes%stack%bearing))
      end associate
   contains

      !> Integrals over the part.
      function new_overlap(set) result(overlap)
         type(product_type), intent(in) :: set
         type(overlap_type) :: overlap

         allocate (overlap%x, source=get_overlap(set%x, 0, set%x, 0, area(1), area(2)))
         allocate (overlap%y, source=get_overlap(set%y, 0, set%y, 0, area(3), area(4)))
      end function new_overlap
   end function new_part

   !> Shapes of a plate in some modes.
   pure function get_shapes(modes, plate, kept) result(shapes)
      type(floor_modes_type), intent(in) :: modes
      !> Number of the plate.
      integer, intent(in) :: plate
      !> Numbers of the modes, block after block: [n_mode].
      integer, intent(in) :: kept(:)
      type(shapes_type) :: shapes
      integer :: range(2, size(modes%modes%block))
      integer, allocatable :: position_x(:), position_y(:)
      integer :: i, n

      range = get_ranges(modes%modes, kept)
      associate (displacement => modes%modes%displacement(plate))
         allocate (position_x(displacement%x%count), position_y(displacement%y%count), source=0)
      end associate
      do i = 1, size(range, 2)
         if (range(2, i) == 0) cycle
         associate (shape => modes%modes%block(i)%shape(plate))
            position_x(shape%x) = 1
            position_y(shape%y) = 1
         end associate
      end do
      call number_marked(position_x, shapes%x)
      call number_marked(position_y, shapes%y)
      allocate (shapes%block(count(range(2, :) > 0)))
      n = 0
      do i = 1, size(range, 2)
         if (range(2, i) == 0) cycle
         n = n + 1
         associate (shape => modes%modes%block(i)%shape(plate))
            shapes%block(n) = block_shapes_type(position_x(shape%x), position_y(shape%y), &
               shape%coefficient(:, range(1, i):range(2, i)))
         end associate
      end do
   end function get_shapes

   !> Numbers of marked functions, and the position of each among them in place of its mark.
   pure subroutine number_marked(position, number)
      !> 1 for a marked function, else 0; then the positions: [n_function].
      integer, intent(inout) :: position(:)
      !> The numbers: [n_marked].
      integer, allocatable, intent(out) :: number(:)
      integer :: k

      number = pack([(k, k=1, size(position))], position == 1)
      position(number) = [(k, k=1, size(number))]
   end subroutine number_marked

   !> Modes that take part, in sets whose shapes have products with a mean at the strike points.
   function get_coupled_modes(modes, part, radiator, kept, mixing) result(coupled)
      type(floor_modes_type), intent(in) :: modes
      type(part_type), intent(in) :: part
      !> Shapes of the radiating plate.
      type(shapes_type), intent(in) :: radiator
      !> Numbers of the modes: [n_mode].
      integer, intent(in) :: kept(:)
      type(mixing_type), intent(in) :: mixing
      type(coupled_modes_type), allocatable :: coupled(:)
      type(shapes_type) :: struck, bearing
      integer, allocatable :: set(:), members(:), last(:)
      integer :: i, j, k

      struck = get_shapes(modes, 1, kept)
      bearing = get_shapes(modes, modes%stack%bearing, kept)
      set = get_sets(struck, part%struck)
      allocate (last(0:size(set)), source=0)
      do i = 1, size(set)
         last(i) = last(i - 1) + size(struck%block(i)%coefficient, 2)
      end do
      allocate (coupled(maxval([0, set])))
      do i = 1, size(coupled)
         associate (these => coupled(i))
            members = pack([(k, k=1, size(set))], set == i)
            these%mode = [([(j, j=last(members(k) - 1) + 1, last(members(k)))], k=1, size(members))]
            these%radiator = get_merged(radiator, members)
            these%drive = get_integrals(get_merged(struck, members), struck, part%struck)/part%area
            these%mixing = get_part(mixing, these%mode)
            these%velocity = get_integrals(get_merged(bearing, members), bearing, overlap_type())
            these%above = these%velocity
            if (allocated(part%bearing%x)) these%above = get_integrals(get_merged(bearing, members), bearing, &
               part%bearing)
            these%is_orthogonal = are_orthogonal(these%drive) .and. is_identity(these%mixing)
         end associate
      end do
   end function get_coupled_modes

   !> Whether shapes are orthogonal, from the means of their products.
   pure function are_orthogonal(mean) result(yes)
      real(wp), intent(in) :: mean(:, :)
      logical :: yes
      integer :: i

      yes = .true.
      associate (norm => sqrt(get_diagonal(mean)))
         do i = 2, size(norm)
            yes = yes .and. all(abs(mean(:i - 1, i)) <= max_overlap*norm(i)*norm(:i - 1))
         end do
      end associate
   end function are_orthogonal

   !> Number of the set of each block: blocks with functions that are not orthogonal belong to one. Over the whole floor,
   !> each block has its own: [n_block].
   pure function get_sets(shapes, overlap) result(set)
      type(shapes_type), intent(in) :: shapes
      !> Integrals of products of all functions over the strike points.
      type(overlap_type), intent(in) :: overlap
      integer :: set(size(shapes%block))
      integer :: i, j, n, one, other

      set = [(i, i=1, size(set))]
      if (.not. allocated(overlap%x)) return
      do i = 2, size(set)
         do j = 1, i - 1
            if (set(i) == set(j)) cycle
            if (.not. are_coupled(overlap%x, shapes%x(shapes%block(i)%x), shapes%x(shapes%block(j)%x))) cycle
            if (.not. are_coupled(overlap%y, shapes%y(shapes%block(i)%y), shapes%y(shapes%block(j)%y))) cycle
            one = min(set(i), set(j))
            other = max(set(i), set(j))
            where (set == other) set = one
         end do
      end do
      ! Numbers without gaps.
      n = 0
      do i = 1, size(set)
         if (set(i) /= i) cycle
         n = n + 1
         where (set == i) set = -n
      end do
      set = -set
   end function get_sets

   !> Whether some functions of two lists are not orthogonal.
   pure function are_coupled(overlap, first, second) result(yes)
      !> Integrals of products of all functions.
      real(wp), intent(in) :: overlap(:, :)
      !> Numbers of the functions.
      integer, intent(in) :: first(:), second(:)
      logical :: yes

      yes = any(abs(overlap(first, second)) > rounding)
   end function are_coupled

   !> Shapes of several blocks as those of one.
   pure function get_merged(shapes, members) result(merged)
      type(shapes_type), intent(in) :: shapes
      !> Numbers of the blocks.
      integer, intent(in) :: members(:)
      type(block_shapes_type) :: merged
      integer, allocatable :: at_x(:), at_y(:)
      integer :: i, k, l, n

      if (size(members) == 1) then
         merged = shapes%block(members(1))
         return
      end if
      allocate (at_x(size(shapes%x)), at_y(size(shapes%y)), source=0)
      n = 0
      do i = 1, size(members)
         associate (block => shapes%block(members(i)))
            at_x(block%x) = 1
            at_y(block%y) = 1
            n = n + size(block%coefficient, 2)
         end associate
      end do
      call number_marked(at_x, merged%x)
      call number_marked(at_y, merged%y)
      allocate (merged%coefficient(size(merged%x)*size(merged%y), n), source=0.0_wp)
      n = 0
      do i = 1, size(members)
         associate (block => shapes%block(members(i)), n_mode => size(shapes%block(members(i))%coefficient, 2))
            do k = 1, size(block%y)
               do l = 1, size(block%x)
                  merged%coefficient(at_x(block%x(l)) + (at_y(block%y(k)) - 1)*size(merged%x), n + 1:n + n_mode) = &
                     block%coefficient(l + (k - 1)*size(block%x), :)
               end do
            end do
            n = n + n_mode
         end associate
      end do
   end function get_merged

   !> Integrals of products of shapes over an area, m2/kg: [n_mode, n_mode].
   pure function get_integrals(block, shapes, overlap) result(integral)
      type(block_shapes_type), intent(in) :: block
      !> The shapes to whose functions the block refers.
      type(shapes_type), intent(in) :: shapes
      !> Integrals of products of functions over the area, for the whole floor not allocated.
      type(overlap_type), intent(in) :: overlap
      real(wp), allocatable :: integral(:, :)

      integral = get_transposed_product(block%coefficient, get_weighted(block%coefficient, shapes%x(block%x), &
         shapes%y(block%y), overlap))
   end function get_integrals

   !> Coefficients of shapes times the integrals of products of their functions: [n_x*n_y, n_column].
   pure function get_weighted(coefficient, x, y, overlap) result(weighted)
      !> Coefficients of the products, x first: [n_x*n_y, n_column].
      real(wp), intent(in) :: coefficient(:, :)
      !> Numbers of the functions of x and y.
      integer, intent(in) :: x(:), y(:)
      type(overlap_type), intent(in) :: overlap
      real(wp), allocatable :: weighted(:, :)
      integer :: i

      weighted = coefficient
      if (.not. allocated(overlap%x)) return
      do i = 1, size(coefficient, 2)
         weighted(:, i) = reshape(get_product(get_product(overlap%x(x, x), reshape(coefficient(:, i), [size(x), size(y)])), &
            overlap%y(y, y)), [size(x)*size(y)])
      end do
   end function get_weighted

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
         integer :: k

         associate (entry => [(k, k=mixing%first(number), mixing%first(number + 1) - 1)])
            associate (of => mixing%column(entry))
               square = real(sum([(mixing%weight(entry(k))*sum(get_cross_integrals(of(k), of)*conjg(mixing%weight(entry)) &
                  *matmul(conjg(gain(of, :)), gain(of(k), :))), k=1, size(of))]), wp)
            end associate
         end associate
      end function get_square

      !> Integrals of the products of the responses of all modes with that of one: [n_mode].
      pure function get_products(number) result(product)
         integer, intent(in) :: number
         real(wp) :: product(size(pole))
         complex(wp) :: unmixed(size(pole), 1)
         integer :: i, k, l

         unmixed = 0.0_wp
         do k = mixing%first(number), mixing%first(number + 1) - 1
            l = mixing%column(k)
            unmixed(:, 1) = unmixed(:, 1) + conjg(mixing%weight(k)*get_cross_integrals(l, [(i, i=1, size(pole))])) &
               *matmul(gain, conjg(gain(l, :)))
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

   !> Integrals of the squared shapes over the plate, m2/kg: [n_mode].
   pure function get_squares(shapes) result(square)
      type(shapes_type), intent(in) :: shapes
      real(wp), allocatable :: square(:)
      integer :: i

      square = [(sum(shapes%block(i)%coefficient**2, dim=1), i=1, size(shapes%block))]
   end function get_squares

   !> Lowest and highest frequency of one of `n_wavenumber` parts of a band, Hz.
   pure function get_interval(band, number) result(edge)
      type(band_type), intent(in) :: band
      integer, intent(in) :: number
      real(wp) :: edge(2)

      edge = band%lower*(band%upper/band%lower)**([number - 1, number]/real(n_wavenumber, wp))
   end function get_interval

   !> Coefficients of the functions of all shapes, those of x first: [n_x*n_y, n_column].
   pure subroutine get_coefficients(shapes, amplitude, coefficient)
      type(shapes_type), intent(in) :: shapes
      !> Amplitudes of the modes: [n_mode, n_column].
      real(wp), intent(in) :: amplitude(:, :)
      real(wp), allocatable, intent(out) :: coefficient(:, :)
      real(wp), allocatable :: in_block(:, :)
      integer :: i, j, k, l, n

      allocate (coefficient(size(shapes%x)*size(shapes%y), size(amplitude, 2)), source=0.0_wp)
      n = 0
      do i = 1, size(shapes%block)
         associate (block => shapes%block(i), n_mode => size(shapes%block(i)%coefficient, 2))
            in_block = get_product(block%coefficient, amplitude(n + 1:n + n_mode, :))
            do j = 1, size(amplitude, 2)
               do k = 1, size(block%y)
                  do l = 1, size(block%x)
                     coefficient(block%x(l) + (block%y(k) - 1)*size(shapes%x), j) = in_block(l + (k - 1)*size(block%x), j)
                  end do
               end do
            end do
            n = n + n_mode
         end associate
      end do
   end subroutine get_coefficients

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

   !> Diagonal of a matrix.
   pure function get_diagonal(matrix) result(diagonal)
      real(wp), intent(in) :: matrix(:, :)
      real(wp) :: diagonal(size(matrix, 1))
      integer :: i

      diagonal = [(matrix(i, i), i=1, size(diagonal))]
   end function get_diagonal

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

   !> Transforms of functions as series of the wavenumber.
   pure function new_wave_series(set, ends, highest) result(series)
      type(function_set_type), intent(in) :: set
      !> Ends of the interval, m: [2].
      real(wp), intent(in) :: ends(2)
      !> Highest wavenumber, 1/m.
      real(wp), intent(in) :: highest
      type(wave_series_type) :: series
      real(wp), allocatable :: point(:), weight(:), function_value(:, :), phase(:, :), angle(:), terms(:, :)
      integer :: i, n

      series%highest = highest
      series%length = ends(2) - ends(1)
      call get_quadrature(set%count + 20 + int(highest*series%length/2), ends(1), ends(2), point, weight)
      function_value = get_functions(set, point, 0)*spread(weight, 2, set%count)
      ! The coefficients of cos(z t) decrease faster than exponentially from the term z on; z is a quarter of highest*length.
      n = 30 + int(highest*series%length/4)
      angle = pi*([(i, i=1, n)] - 0.5_wp)/n
      phase = spread(point - sum(ends)/2, 2, n)*spread(highest*(1 + cos(angle))/2, 1, size(point))
      terms = cos(spread(angle, 2, n)*spread([(i, i=0, n - 1)], 1, n))*2/n
      terms(:, 1) = terms(:, 1)/2
      allocate (series%coefficient(n, set%count, 2))
      series%coefficient(:, :, 1) = get_transposed_product(terms, get_transposed_product(cos(phase), function_value))
      series%coefficient(:, :, 2) = get_transposed_product(terms, get_transposed_product(sin(phase), function_value))
      series%is_present = maxval(abs(series%coefficient), dim=1) > 1.0e-10_wp*maxval(abs(series%coefficient))
   end function new_wave_series

   !> Transforms of some of the functions.
   pure function get_some(series, numbers) result(some)
      type(wave_series_type), intent(in) :: series
      integer, intent(in) :: numbers(:)
      type(wave_series_type) :: some

      some = wave_series_type(series%highest, series%length, series%coefficient(:, numbers, :), &
         series%is_present(numbers, :))
   end function get_some

   !> Transforms at wavenumbers: [n_function, n_wave, 2].
   pure function get_waves(series, wavenumber) result(wave)
      type(wave_series_type), intent(in) :: series
      !> Wavenumbers up to the highest, 1/m: [n_wave].
      real(wp), intent(in) :: wavenumber(:)
      real(wp), allocatable :: wave(:, :, :)
      real(wp) :: argument(size(wavenumber)), term(size(wavenumber), size(series%coefficient, 1))
      integer :: i

      argument = 2*wavenumber/series%highest - 1
      term(:, 1) = 1.0_wp
      term(:, 2) = argument
      do i = 3, size(term, 2)
         term(:, i) = 2*argument*term(:, i - 1) - term(:, i - 2)
      end do
      allocate (wave(size(series%coefficient, 2), size(wavenumber), 2))
      do i = 1, 2
         wave(:, :, i) = get_transposed_product(series%coefficient(:, :, i), transpose(term))
      end do
   end function get_waves

   !> Transforms at a wavenumber of sound.
   pure function get_transforms(along, across, wavenumber) result(transforms)
      type(wave_series_type), intent(in) :: along, across
      !> Wavenumber of sound, 1/m.
      real(wp), intent(in) :: wavenumber
      type(transforms_type) :: transforms
      real(wp), allocatable :: angle(:), weight(:), wave(:, :, :), weighted(:, :)
      integer :: i, j, n, p

      ! A quadrant is enough: squares of the four parities add up. Products of two transforms are resolved.
      n = min(6 + int(wavenumber*max(along%length, across%length)/2), max_directions)
      call get_quadrature(n, 0.0_wp, pi/2, angle, weight)
      allocate (transforms%along, source=get_waves(along, wavenumber*sin(angle)))
      transforms%has_along = along%is_present
      transforms%has_across = across%is_present
      associate (n_y => size(across%is_present, 1))
         allocate (transforms%across(n_y, n_y, n, 2))
         do i = 1, n
            wave = get_waves(across, wavenumber*cos(angle(i))*sin(angle))
            do p = 1, 2
               ! dkx dky/kz = k0 cos(a) da db; k0/(4 pi**2) makes it a radiation factor times an area.
               weighted = wave(:, :, p)
               do j = 1, n
                  weighted(:, j) = weighted(:, j)*4*(wavenumber/(2*pi))**2*cos(angle(i))*weight(i)*weight(j)
               end do
               transforms%across(:, :, i, p) = get_product(weighted, transpose(wave(:, :, p)))
            end do
         end do
      end associate
   end function get_transforms

   !> Radiated powers over rho0 c0 of velocities that are sums of products of functions, m4/s2: [n_column].
   pure function get_powers(transforms, x, y, coefficient) result(power)
      type(transforms_type), intent(in) :: transforms
      !> Numbers of the functions of x and of y: [n_x], [n_y].
      integer, intent(in) :: x(:), y(:)
      !> Coefficients of the products, x first: [n_x*n_y, n_column].
      real(wp), intent(in) :: coefficient(:, :)
      real(wp) :: power(size(coefficient, 2))
      real(wp), allocatable :: velocity(:, :), wave(:, :)
      integer, allocatable :: in_x(:), in_y(:)
      integer :: i, k, p, q

      power = 0.0_wp
      do p = 1, 2
         in_x = pack([(k, k=1, size(x))], transforms%has_along(x, p))
         if (size(in_x) == 0) cycle
         do q = 1, 2
            in_y = pack([(k, k=1, size(y))], transforms%has_across(y, q))
            if (size(in_y) == 0) cycle
            associate (n_y => size(in_y), n_column => size(coefficient, 2))
               velocity = get_some_coefficients(coefficient, size(x), in_x, in_y)
               wave = get_transposed_product(velocity, transforms%along(x(in_x), :, p))
               if (n_y == 1) then
                  power = power + matmul(wave**2, transforms%across(y(in_y(1)), y(in_y(1)), :, q))
                  cycle
               end if
               do i = 1, size(wave, 2)
                  velocity = reshape(wave(:, i), [n_y, n_column])
                  power = power + sum(velocity*get_product(transforms%across(y(in_y), y(in_y), i, q), velocity), dim=1)
               end do
            end associate
         end do
      end do
   end function get_powers

   !> Coefficients of some of the functions: [n_in_x, n_in_y*n_column].
   pure function get_some_coefficients(coefficient, n_x, in_x, in_y) result(some)
      !> Coefficients of the products, x first: [n_x*n_y, n_column].
      real(wp), intent(in) :: coefficient(:, :)
      !> Number of the functions of x.
      integer, intent(in) :: n_x
      !> Positions of the functions in the lists of x and of y.
      integer, intent(in) :: in_x(:), in_y(:)
      real(wp) :: some(size(in_x), size(in_y)*size(coefficient, 2))
      integer :: i, k, l

      do i = 1, size(coefficient, 2)
         do k = 1, size(in_y)
            do l = 1, size(in_x)
               some(l, (i - 1)*size(in_y) + k) = coefficient(in_x(l) + (in_y(k) - 1)*n_x, i)
            end do
         end do
      end do
   end function get_some_coefficients

   !> Radiated powers over rho0 c0 of pairs of shapes, m4/s2: [n_mode, n_mode].
   pure function get_pair_powers(transforms, shapes) result(power)
      type(transforms_type), intent(in) :: transforms
      type(block_shapes_type), intent(in) :: shapes
      real(wp) :: power(size(shapes%coefficient, 2), size(shapes%coefficient, 2))
      real(wp), allocatable :: velocity(:, :), wave(:, :), resistance(:, :), all_waves(:, :), weighted(:, :)
      integer, allocatable :: in_x(:), in_y(:)
      integer :: i, k, p, q

      power = 0.0_wp
      do p = 1, 2
         in_x = pack([(k, k=1, size(shapes%x))], transforms%has_along(shapes%x, p))
         if (size(in_x) == 0) cycle
         do q = 1, 2
            in_y = pack([(k, k=1, size(shapes%y))], transforms%has_across(shapes%y, q))
            if (size(in_y) == 0) cycle
            velocity = get_some_coefficients(shapes%coefficient, size(shapes%x), in_x, in_y)
            associate (n_y => size(in_y), y => shapes%y(in_y), along => transforms%along(shapes%x(in_x), :, p))
               if (size(in_x) == 1) then
                  ! All modes have the same function of x.
                  allocate (resistance(n_y, n_y), source=0.0_wp)
                  do i = 1, size(along, 2)
                     resistance = resistance + along(1, i)**2*transforms%across(y, y, i, q)
                  end do
                  velocity = reshape(velocity, [n_y, size(power, 1)])
                  power = power + get_transposed_product(velocity, get_product(resistance, velocity))
                  deallocate (resistance)
                  cycle
               end if
               wave = get_transposed_product(velocity, along)
               ! All angles at once, as one product of large matrices is faster.
               allocate (all_waves(n_y*size(wave, 2), size(power, 1)), weighted(n_y*size(wave, 2), size(power, 1)))
               do i = 1, size(wave, 2)
                  velocity = reshape(wave(:, i), [n_y, size(power, 1)])
                  all_waves((i - 1)*n_y + 1:i*n_y, :) = velocity
                  weighted((i - 1)*n_y + 1:i*n_y, :) = get_product(transforms%across(y, y, i, q), velocity)
               end do
               power = power + get_transposed_product(all_waves, weighted)
               deallocate (all_waves, weighted)
            end associate
         end do
      end do
   end function get_pair_powers

end module thud_modal_radiation
