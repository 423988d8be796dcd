!> Free axisymmetric modes of the ball without twist (paper section 4.1, figure 4): the lowest ones of all harmonics of the
!> hollow sphere.
module thud_free_modes
   use thud_ball, only: ball_type, get_density
   use thud_constants, only: pi
   use thud_error, only: error_type, input_error, numerical_error
   use thud_field, only: field_type, in_group, new_field
   use thud_interrupt, only: check_interrupt
   use thud_kinds, only: wp
   use thud_legendre, only: get_legendre
   use thud_sphere_modes, only: basis_type, get_displacements, get_modes, new_basis
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: check_modes, free_modes_type, get_free_modes, get_modes_fields, modes_options_type

   !> Lines from pole to pole and rings through the wall between the nodes of the shapes, and lines for each harmonic.
   integer, parameter :: n_line = 128, n_ring = 16, lines_per_harmonic = 4

   !> Minimum ratio of wall thickness to outer radius: of thinner walls, bending loses too many digits beside stretching.
   real(wp), parameter :: min_wall = 1.0e-3_wp

   !> Natural logarithm of the accuracy of the shapes, the root of that of the frequencies.
   real(wp), parameter :: shape_digits = 14.0_wp

   !> Minimum of the rate by which polynomials converge: small cavities hardly change the modes.
   real(wp), parameter :: min_rate = 0.3_wp

   !> Maximum number of times that the modes are looked for up to higher frequencies; a hundred modes need about six.
   integer, parameter :: max_passes = 20

   !> Options of the modes.
   type :: modes_options_type
      !> Number of elastic modes.
      integer :: count = 6
   end type modes_options_type

   !> The elastic modes in ascending order.
   type :: free_modes_type
      !> Natural frequencies, Hz: [n_mode].
      real(wp), allocatable :: frequency(:)
      !> Harmonic, the order of the Legendre polynomial: [n_mode].
      integer, allocatable :: harmonic(:)
      !> Mass of the ball times squared vertical amplitude of the lowest point at unit modal mass. It states how strongly a
      !> contact at the lowest point drives the mode; it would be 1 for the rigid motion: [n_mode].
      real(wp), allocatable :: participation(:)
      !> Distance from the axis and height over the center of the nodes, from the lowest point to the highest and from the
      !> inner surface to the outer, m: [0:n_line, 0:n_ring].
      real(wp), allocatable :: r(:, :), z(:, :)
      !> Displacements in r and z, of maximum length 1, the lowest point moving upwards: [2, 0:n_line, 0:n_ring, n_mode].
      real(wp), allocatable :: shape(:, :, :, :)
   end type free_modes_type

   !> One mode.
   type :: mode_type
      !> Angular frequency, rad/s.
      real(wp) :: omega = huge(1.0_wp)
      integer :: harmonic = 0
      !> Coefficients of the functions of the harmonic at unit modal mass, 1/sqrt(kg): [n].
      real(wp), allocatable :: coefficient(:)
   end type mode_type

contains

   !> Keys and allowed ranges of the group `&modes`.
   function get_modes_fields(options) result(fields)
      !> The options that the fields read and set.
      type(modes_options_type), intent(in), target :: options
      !> One field per component: [1].
      type(field_type), allocatable :: fields(:)

      fields = in_group('modes', [new_field('count', options%count, '', 'number of elastic free modes', '[1, 100]')])
   end function get_modes_fields

   !> Returns an error if the wall is too thin.
   subroutine check_modes(ball, error)
      type(ball_type), intent(in) :: ball
      type(error_type), allocatable, intent(out) :: error

      if (ball%wall_thickness < min_wall*ball%outer_radius) error = input_error('= '//to_text(ball%wall_thickness)//' m ' &
         //'is not allowed with &modes; allowed: from '//to_text(min_wall*ball%outer_radius)//' m, '//to_text(min_wall) &
         //' of outer_radius', 'ball', 'wall_thickness')
   end subroutine check_modes

   !> The lowest elastic modes of a ball.
   subroutine get_free_modes(ball, count, modes, error)
      type(ball_type), intent(in) :: ball
      integer, intent(in) :: count
      type(free_modes_type), intent(out) :: modes
      !> Set if the modes cannot be computed.
      type(error_type), allocatable, intent(out) :: error
      type(mode_type) :: lowest(count)
      type(basis_type) :: basis
      real(wp) :: highest_omega, rate
      integer :: pass

      ! The solutions are singular at the center.
      rate = max(min_rate, acosh(2*ball%outer_radius/ball%wall_thickness - 1))
      highest_omega = 10*sqrt(ball%youngs_modulus/get_density(ball))/ball%outer_radius
      do pass = 1, max_passes
         basis = new_basis(ball, count + 1, .false., highest_omega, ceiling(shape_digits/rate))
         call find_lowest(basis, highest_omega, lowest, error)
         if (allocated(error) .or. lowest(count)%omega <= highest_omega) exit
         highest_omega = 1.5_wp*highest_omega
      end do
      if (pass > max_passes) error = numerical_error('= '//to_text(count)//' needs too many polynomials; allowed: fewer ' &
         //'modes', 'modes', 'count')
      if (.not. allocated(error)) call describe(ball, basis, lowest, modes)
   end subroutine get_free_modes

   !> The lowest modes of all harmonics up to a frequency. From n = 2 on the lowest frequencies of the harmonics increase:
   !> the first harmonic without a mode among the lowest ends the search.
   subroutine find_lowest(basis, highest_omega, lowest, error)
      type(basis_type), intent(in) :: basis
      !> Highest angular frequency, rad/s.
      real(wp), intent(in) :: highest_omega
      !> The modes, ascending, the last ones with the default frequency if there are not enough: [n_mode].
      type(mode_type), intent(out) :: lowest(:)
      !> Set if the modes cannot be computed.
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: omega(:), coefficient(:, :)
      integer :: n, k, i, place

      do n = 0, size(lowest) + 1
         call check_interrupt(error)
         if (allocated(error)) return
         call get_modes(basis, n, highest_omega, omega, coefficient, error)
         if (allocated(error)) return
         do k = 1, size(omega)
            place = count(lowest%omega <= omega(k)) + 1
            if (place > size(lowest)) exit
            do i = size(lowest), place + 1, -1
               lowest(i) = lowest(i - 1)
            end do
            lowest(place) = mode_type(omega(k), n, coefficient(:, k))
         end do
         if (n >= 2 .and. k == 1) exit
      end do
   end subroutine find_lowest

   !> Frequencies, harmonics, participations and shapes.
   subroutine describe(ball, basis, lowest, modes)
      type(ball_type), intent(in) :: ball
      type(basis_type), intent(in) :: basis
      !> The modes, ascending: [n_mode].
      type(mode_type), intent(in) :: lowest(:)
      type(free_modes_type), intent(out) :: modes
      real(wp), allocatable :: angle(:), displacement(:, :, :), u(:), v(:)
      real(wp) :: radius
      integer :: i, j, n

      modes%frequency = lowest%omega/(2*pi)
      modes%harmonic = lowest%harmonic
      allocate (modes%participation(size(lowest)))
      n = max(n_line, lines_per_harmonic*maxval(modes%harmonic))
      allocate (modes%r(0:n, 0:n_ring), modes%z(0:n, 0:n_ring), modes%shape(2, 0:n, 0:n_ring, size(lowest)))
      angle = [(pi*real(j, wp)/n, j=0, n)]
      do i = 0, n_ring
         radius = ball%outer_radius - ball%wall_thickness*real(n_ring - i, wp)/n_ring
         modes%r(:, i) = radius*sin(angle)
         modes%z(:, i) = -radius*cos(angle)
      end do
      ! The sine of pi is not quite zero.
      modes%r(n, :) = 0.0_wp
      do i = 1, size(lowest)
         displacement = get_displacements(basis, lowest(i)%harmonic, [(2*real(j, wp)/n_ring - 1, j=0, n_ring)])
         u = matmul(displacement(1, :, :), lowest(i)%coefficient)
         v = matmul(displacement(2, :, :), lowest(i)%coefficient)
         modes%participation(i) = ball%mass*u(n_ring + 1)**2
         modes%shape(:, :, :, i) = get_shape(lowest(i)%harmonic, u, v, size(modes%r, 1))
      end do
   end subroutine describe

   !> Displacements U P_n(cos t) along the radius and V dP_n/dt along the meridian, of maximum length 1, the lowest point
   !> moving upwards.
   pure function get_shape(harmonic, u, v, n) result(shape)
      !> Harmonic n.
      integer, intent(in) :: harmonic
      !> U and V on the rings: [0:n_ring].
      real(wp), intent(in) :: u(0:), v(0:)
      !> Number of lines.
      integer, intent(in) :: n
      !> Displacements in r and z: [2, n, n_ring + 1].
      real(wp) :: shape(2, n, 0:n_ring)
      real(wp), dimension(0:harmonic) :: value, first, second
      real(wp) :: sine, cosine
      integer :: j

      do j = 1, n
         ! The angle from the lowest point is that from the pole at t = pi.
         sine = merge(0.0_wp, sin(pi*real(j - 1, wp)/(n - 1)), j == n)
         cosine = -cos(pi*real(j - 1, wp)/(n - 1))
         call get_legendre(cosine, value, first, second)
         associate (along_radius => u*value(harmonic), along_meridian => -v*sine*first(harmonic))
            shape(1, j, :) = along_radius*sine + along_meridian*cosine
            shape(2, j, :) = along_radius*cosine - along_meridian*sine
         end associate
      end do
      shape = sign(1.0_wp, shape(2, 1, n_ring))*shape/sqrt(maxval(shape(1, :, :)**2 + shape(2, :, :)**2))
   end function get_shape

end module thud_free_modes
