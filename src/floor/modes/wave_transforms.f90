!> Powers that shapes of a baffled plate radiate, from their transforms at the wavenumbers of sound.
module thud_wave_transforms
   use thud_constants, only: pi
   use thud_function_set, only: function_set_type, get_functions, get_quadrature
   use thud_kinds, only: wp
   use thud_matrix_product, only: get_product, get_transposed_product
   use thud_modes, only: shape_type
   implicit none (type, external)
   private

   public :: get_powers, get_transforms, new_wave_series, transforms_type, wave_series_type

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

   !> Transforms of the first functions at wavenumbers: [n_function, n_wave, 2].
   pure function get_waves(series, n_function, wavenumber) result(wave)
      type(wave_series_type), intent(in) :: series
      integer, intent(in) :: n_function
      !> Wavenumbers up to the highest, 1/m: [n_wave].
      real(wp), intent(in) :: wavenumber(:)
      real(wp) :: wave(n_function, size(wavenumber), 2)
      real(wp) :: argument(size(wavenumber)), term(size(wavenumber), size(series%coefficient, 1))
      integer :: i

      argument = 2*wavenumber/series%highest - 1
      term(:, 1) = 1.0_wp
      term(:, 2) = argument
      do i = 3, size(term, 2)
         term(:, i) = 2*argument*term(:, i - 1) - term(:, i - 2)
      end do
      do i = 1, 2
         wave(:, :, i) = get_transposed_product(series%coefficient(:, :n_function, i), transpose(term))
      end do
   end function get_waves

   !> Transforms at a wavenumber of sound.
   pure function get_transforms(along, across, n_x, n_y, wavenumber) result(transforms)
      type(wave_series_type), intent(in) :: along, across
      !> Numbers of the first functions of x and of y that are wanted.
      integer, intent(in) :: n_x, n_y
      !> Wavenumber of sound, 1/m.
      real(wp), intent(in) :: wavenumber
      type(transforms_type) :: transforms
      real(wp), allocatable :: angle(:), weight(:), wave(:, :, :), weighted(:, :)
      integer, allocatable :: y(:)
      integer :: i, j, n, p

      ! A quadrant is enough: squares of the four parities add up. Products of two transforms are resolved.
      n = min(6 + int(wavenumber*max(along%length, across%length)/2), max_directions)
      call get_quadrature(n, 0.0_wp, pi/2, angle, weight)
      allocate (transforms%along, source=get_waves(along, n_x, wavenumber*sin(angle)))
      transforms%has_along = along%is_present(:n_x, :)
      transforms%has_across = across%is_present(:n_y, :)
      allocate (transforms%across(n_y, n_y, n, 2))
      do i = 1, n
         wave = get_waves(across, n_y, wavenumber*cos(angle(i))*sin(angle))
         do p = 1, 2
            ! dkx dky/kz = k0 cos(a) da db; k0/(4 pi**2) makes it a radiation factor times an area.
            y = pack([(j, j=1, n_y)], transforms%has_across(:, p))
            weighted = wave(y, :, p)
            do j = 1, n
               weighted(:, j) = weighted(:, j)*4*(wavenumber/(2*pi))**2*cos(angle(i))*weight(i)*weight(j)
            end do
            transforms%across(y, y, i, p) = get_product(weighted, transpose(wave(y, :, p)))
         end do
      end do
   end function get_transforms

   !> Radiated powers over rho0 c0 of velocities that are sums of products of functions, m4/s2: [n_column].
   pure function get_powers(transforms, motion) result(power)
      type(transforms_type), intent(in) :: transforms
      !> The velocities, one for each column of coefficients.
      type(shape_type), intent(in) :: motion
      real(wp) :: power(size(motion%coefficient, 2))
      real(wp), allocatable :: velocity(:, :), wave(:, :)
      integer, allocatable :: in_x(:), in_y(:)
      integer :: i, k, l, p, q

      power = 0.0_wp
      do p = 1, 2
         in_x = pack([(k, k=1, size(motion%x))], transforms%has_along(motion%x, p))
         if (size(in_x) == 0) cycle
         do q = 1, 2
            in_y = pack([(k, k=1, size(motion%y))], transforms%has_across(motion%y, q))
            if (size(in_y) == 0) cycle
            associate (x => motion%x(in_x), y => motion%y(in_y), n_y => size(in_y), n_column => size(power), &
               at => [((in_x(l) + (in_y(k) - 1)*size(motion%x), l=1, size(in_x)), k=1, size(in_y))])
               velocity = reshape(motion%coefficient(at, :), [size(in_x), n_y*n_column])
               wave = get_transposed_product(velocity, transforms%along(x, :, p))
               if (n_y == 1) then
                  power = power + matmul(wave**2, transforms%across(y(1), y(1), :, q))
                  cycle
               end if
               do i = 1, size(wave, 2)
                  velocity = reshape(wave(:, i), [n_y, n_column])
                  power = power + sum(velocity*get_product(transforms%across(y, y, i, q), velocity), dim=1)
               end do
            end associate
         end do
      end do
   end function get_powers

end module thud_wave_transforms
