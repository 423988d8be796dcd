!> Free axisymmetric modes of the ball without twist by finite elements (paper section 4.1, figure 4).
module thud_free_modes
   use thud_arpack, only: dsaupd, dseupd
   use thud_ball, only: ball_type
   use thud_constants, only: pi
   use thud_error, only: error_type, input_error, numerical_error
   use thud_field, only: field_type
   use thud_interrupt, only: check_interrupt, is_interrupted
   use thud_kinds, only: wp
   use thud_legendre, only: get_legendre
   use thud_mesh, only: check_mesh, get_element_counts, get_mesh_fields, mesh_options_type, mesh_type, new_mesh
   use thud_mode_matrices, only: apply_inverse, apply_mass, mode_matrices_type, new_mode_matrices
   use thud_new_field, only: in_group, integer_field
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: check_modes, free_modes_type, get_free_modes, get_modes_fields, modes_options_type

   !> Relative error of the eigenvalues that ends the iteration, far below the error of the mesh.
   real(wp), parameter :: eigenvalue_tolerance = 1.0e-11_wp

   !> Maximum number of restarts of the Lanczos method; a few are needed.
   integer, parameter :: max_restarts = 300

   !> Highest harmonic considered for a mode.
   integer, parameter :: max_harmonic = 64

   !> Options of the modes.
   type :: modes_options_type
      !> Number of elastic modes; 0 for none.
      integer :: count = 6
      type(mesh_options_type) :: mesh
   end type modes_options_type

   !> The elastic modes in ascending order; the rigid motion is kept separately.
   type :: free_modes_type
      !> Mesh of order 2 that the shapes belong to.
      type(mesh_type) :: mesh
      !> Natural frequencies, Hz: [n_mode].
      real(wp), allocatable :: frequency(:)
      !> Order of the Legendre polynomial that dominates at the outer surface: [n_mode].
      integer, allocatable :: harmonic(:)
      !> Mass of the ball times squared vertical amplitude of the lowest point at unit modal mass. It states how strongly a
      !> contact at the lowest point drives the mode; it would be 1 for the rigid motion: [n_mode].
      real(wp), allocatable :: participation(:)
      !> Displacements in r and z, of maximum length 1, the lowest point moving upwards: [2, 0:n_line, 0:n_ring, n_mode].
      real(wp), allocatable :: shape(:, :, :, :)
      !> Computed frequency of the rigid motion along the axis, Hz; the exact one is 0.
      real(wp) :: rigid_frequency = 0.0_wp
   end type free_modes_type

contains

   !> Keys and allowed ranges of the groups `&modes` and `&mesh`.
   function get_modes_fields(options) result(fields)
      !> The options that the fields read and set.
      type(modes_options_type), intent(in), target :: options
      !> One field per component: [3].
      type(field_type), allocatable :: fields(:)

      fields = [in_group('modes', [integer_field('count', options%count, 'number of elastic free modes', '[1, 100]')]), &
         in_group('mesh', get_mesh_fields(options%mesh))]
   end function get_modes_fields

   !> Returns an error if the mesh does not resolve the requested number of modes.
   subroutine check_modes(ball, options, error)
      type(ball_type), intent(in) :: ball
      !> Number of modes, and the mesh.
      type(modes_options_type), intent(in) :: options
      !> Error that names the count and its maximum.
      type(error_type), allocatable, intent(out) :: error
      integer :: max_count

      call check_mesh(options%mesh, error)
      if (allocated(error)) return
      associate (counts => get_element_counts(ball, options%mesh))
         max_count = counts%polar_elements*counts%radial_elements/4
      end associate
      if (options%count > max_count) error = input_error('&modes: count = '//to_text(options%count) &
         //' is not allowed with so few elements; allowed: 1 to '//to_text(max_count)//', a quarter of their number')
   end subroutine check_modes

   !> The lowest elastic modes of a ball.
   subroutine get_free_modes(ball, mesh_options, count, modes, error)
      type(ball_type), intent(in) :: ball
      type(mesh_options_type), intent(in) :: mesh_options
      integer, intent(in) :: count
      type(free_modes_type), intent(out) :: modes
      !> Set if the modes cannot be computed.
      type(error_type), allocatable, intent(out) :: error
      type(mode_matrices_type) :: matrices
      real(wp), allocatable :: vector(:, :), eigenvalue(:)
      integer :: i

      modes%mesh = new_mesh(ball, mesh_options, 2)
      call new_mode_matrices(ball, modes%mesh, matrices, error)
      if (.not. allocated(error)) call find_eigenpairs(matrices, count + 1, eigenvalue, vector, error)
      if (allocated(error)) return
      modes%rigid_frequency = sqrt(abs(eigenvalue(1)))/(2*pi)
      allocate (modes%frequency, source=sqrt(max(eigenvalue(2:), 0.0_wp))/(2*pi))
      allocate (modes%harmonic(count), modes%participation(count))
      allocate (modes%shape(2, 0:ubound(modes%mesh%r, 1), 0:ubound(modes%mesh%r, 2), count))
      do i = 1, count
         call describe(ball, matrices, vector(:, i + 1), modes%mesh, modes%shape(:, :, :, i), modes%harmonic(i), &
            modes%participation(i))
      end do
   end subroutine get_free_modes

   !> Lowest eigenpairs, by the shift-invert Lanczos method.
   subroutine find_eigenpairs(matrices, count, eigenvalue, vector, error)
      type(mode_matrices_type), intent(in) :: matrices
      !> Number of pairs.
      integer, intent(in) :: count
      !> Squared angular frequencies, ascending, (rad/s)2: [count].
      real(wp), allocatable, intent(out) :: eigenvalue(:)
      !> Vectors of unit modal mass: [n, count].
      real(wp), allocatable, intent(out) :: vector(:, :)
      !> Set if the method does not converge.
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: n_parameter = 11
      real(wp), allocatable :: resid(:), basis(:, :), workd(:), workl(:), product(:)
      logical, allocatable :: select(:)
      integer :: ido, info, ncv, n, i
      logical :: failed
      integer :: iparam(n_parameter), ipntr(n_parameter)

      n = matrices%n
      ncv = min(n, max(2*count + 6, 20))
      allocate (resid(n), basis(n, ncv), workd(3*n), workl(ncv*(ncv + 8)), product(n), select(ncv), eigenvalue(count))
      ! A fixed start vector that is orthogonal to no mode.
      resid = [(1.0_wp + modulo(0.618_wp*i, 1.0_wp), i=1, n)]
      ipntr = 1
      iparam = 0
      iparam([1, 3, 7]) = [1, max_restarts, 3]
      ido = 0
      info = 1
      failed = .false.
      ! ARPACK keeps its state in static memory: one thread at a time.
      !$omp critical (arpack)
      iterations: do while (.not. (failed .or. is_interrupted()))
         call dsaupd(ido, 'G', n, 'LM', count, eigenvalue_tolerance, resid, ncv, basis, n, iparam, ipntr, workd, workl, &
            size(workl), info)
         associate (x => workd(ipntr(1):ipntr(1) + n - 1), y => workd(ipntr(2):ipntr(2) + n - 1))
            select case (ido)
            case (-1)
               call apply_mass(matrices, x, product)
               call apply_inverse(matrices, product, y, failed)
            case (1)
               product = workd(ipntr(3):ipntr(3) + n - 1)
               call apply_inverse(matrices, product, y, failed)
            case (2)
               call apply_mass(matrices, x, product)
               y = product
            case default
               exit iterations
            end select
         end associate
      end do iterations
      allocate (vector(n, count))
      if (info == 0 .and. .not. (failed .or. is_interrupted())) call dseupd(.true., 'A', select, eigenvalue, vector, n, &
         matrices%shift, 'G', n, 'LM', count, eigenvalue_tolerance, resid, ncv, basis, n, iparam(1:7), ipntr, workd, &
         workl, size(workl), info)
      !$omp end critical (arpack)
      call check_eigenpairs(failed, info, error)
   end subroutine find_eigenpairs

   !> Returns an error if interrupt, operator or ARPACK ended the iteration.
   subroutine check_eigenpairs(failed, info, error)
      !> Whether the volume could not be kept.
      logical, intent(in) :: failed
      !> Status of ARPACK, 0 for success.
      integer, intent(in) :: info
      !> Error that names the reason.
      type(error_type), allocatable, intent(out) :: error

      call check_interrupt(error)
      if (allocated(error)) return
      if (failed) then
         error = numerical_error('&ball: at poisson_ratio = 0.5 the volume of a wall so thin is not kept in double ' &
            //'precision; allowed: a larger wall_thickness, or a lower poisson_ratio')
      else if (info /= 0) then
         error = numerical_error('&modes: the Lanczos method fails (info = '//to_text(info) &
            //' of ARPACK); allowed: fewer modes, or a finer mesh')
      end if
   end subroutine check_eigenpairs

   !> Shape, harmonic and participation of one mode.
   subroutine describe(ball, matrices, vector, mesh, shape, harmonic, participation)
      type(ball_type), intent(in) :: ball
      type(mode_matrices_type), intent(in) :: matrices
      !> Displacements at unit modal mass: [n].
      real(wp), intent(in) :: vector(:)
      type(mesh_type), intent(in) :: mesh
      !> Displacements, the maximum of length 1: [2, 0:n_line, 0:n_ring].
      real(wp), intent(out) :: shape(:, 0:, 0:)
      !> Order of the Legendre polynomial that dominates.
      integer, intent(out) :: harmonic
      !> Participation of the lowest point.
      real(wp), intent(out) :: participation
      integer :: i, j, k

      shape = 0.0_wp
      do i = 0, ubound(shape, 3)
         do j = 0, ubound(shape, 2)
            do k = 1, 2
               if (matrices%unknown(k, j, i) > 0) shape(k, j, i) = vector(matrices%unknown(k, j, i))
            end do
         end do
      end do
      associate (lowest => shape(2, 0, ubound(shape, 3)))
         participation = ball%mass*lowest**2
         shape = sign(1.0_wp, lowest)*shape/sqrt(maxval(shape(1, :, :)**2 + shape(2, :, :)**2))
      end associate
      associate (outer => shape(:, :, ubound(shape, 3)), n_ring => ubound(mesh%r, 2))
         harmonic = get_harmonic((outer(1, :)*mesh%r(:, n_ring) + outer(2, :)*mesh%z(:, n_ring))/ball%outer_radius, &
            mesh%z(:, n_ring)/ball%outer_radius)
      end associate
   end subroutine describe

   !> Order of the Legendre polynomial that carries most of a normal displacement.
   pure function get_harmonic(normal, cosine) result(harmonic)
      !> Normal displacement from pole to pole at equal angles: [n].
      real(wp), intent(in) :: normal(:)
      !> Cosine of the angle at these points: [n].
      real(wp), intent(in) :: cosine(:)
      integer :: harmonic
      ! Higher orders would alias on so few points.
      real(wp), dimension(0:min(max_harmonic, (size(normal) - 1)/2)) :: value, first, second, coefficient
      integer :: i

      coefficient = 0.0_wp
      do i = 1, size(normal)
         call get_legendre(cosine(i), value, first, second)
         coefficient = coefficient + value*normal(i)*sqrt(max(0.0_wp, 1 - cosine(i)**2))
      end do
      ! Share of each order in the mean square over the sphere.
      harmonic = maxloc([((2*i + 1)*coefficient(i)**2, i=0, ubound(coefficient, 1))], dim=1) - 1
   end function get_harmonic

end module thud_free_modes
