!> Powers that shapes of a baffled plate radiate, from their transforms at the wavenumbers of sound.
module thud_wave_transforms
   use thud_constants, only: pi
   use thud_function_set, only: function_set_type, get_functions, get_quadrature
   use thud_kinds, only: wp
   use thud_matrix_product, only: get_product, get_transposed_product
   use thud_plate_shapes, only: block_shapes_type, get_some_coefficients
   implicit none (type, external)
   private

   public :: get_pair_powers, get_powers, get_some, get_transforms, new_wave_series, transforms_type, wave_series_type

   !> Maximum number of directions of a quadrature: on large floors, the mean over many modes needs no more.
   integer, parameter :: max_directions = 64

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
      !> Integrals over b of products of two transforms along y, with the weights of the angles a, of those that
      !> `has_across`: [n_y, n_y, n_angle, 2].
      real(wp), allocatable :: across(:, :, :, :)
      !> Whether a function of x or y has a cosine and a sine transform: [n_x, 2], [n_y, 2].
      logical, allocatable :: has_along(:, :), has_across(:, :)
   end type transforms_type

contains

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
      integer, allocatable :: y(:)
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
               y = pack([(j, j=1, n_y)], across%is_present(:, p))
               weighted = wave(y, :, p)
               do j = 1, n
                  weighted(:, j) = weighted(:, j)*4*(wavenumber/(2*pi))**2*cos(angle(i))*weight(i)*weight(j)
               end do
               transforms%across(y, y, i, p) = get_product(weighted, transpose(wave(y, :, p)))
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

end module thud_wave_transforms
