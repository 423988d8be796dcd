!> Stiffness and mass of the ball as banded matrices, and the shift-and-invert operator.
!>
!> Below Poisson's ratio 1/2 the pressure is condensed in each element. At 1/2 the mean dilatations of every solution have to
!> be zero: an augmented Lagrangian achieves this with one factorization of a positive definite matrix; each iteration
!> multiplies the dilatations by about 1e-4.
module thud_mode_matrices
   use thud_ball, only: ball_type, get_density
   use thud_error, only: error_type, numerical_error
   use thud_interrupt, only: check_interrupt, is_interrupted
   use thud_kinds, only: wp
   use thud_lapack, only: dgemm, dpbtrf, dpbtrs, dpotf2, dsbmv, dsyrk, dtrsm
   use thud_memory, only: require_memory
   use thud_mesh, only: mesh_type
   use thud_mixed_element, only: get_mixed_element, n_dilatation, n_node
   implicit none (type, external)
   private

   public :: apply_inverse, apply_mass, mode_matrices_type, new_mode_matrices

   !> Bulk modulus divided by shear modulus that stands for infinity while the constraint is enforced.
   real(wp), parameter :: augmented_ratio = 1.0e4_wp

   !> Relative change of the pressures at which the constraint counts as met: the remaining dilatations are then those of a
   !> bulk modulus of at least 1e7 times the shear modulus, and the frequencies are off by less than 1e-8.
   real(wp), parameter :: constraint_tolerance = 1.0e-3_wp

   !> Maximum number of iterations of the augmented Lagrangian; two are needed.
   integer, parameter :: max_iterations = 30

   !> Matrices over the free displacements.
   type :: mode_matrices_type
      !> Number of unknowns and of diagonals below the main one.
      integer :: n = 0, n_band = 0
      !> Whether Poisson's ratio is 1/2.
      logical :: incompressible = .false.
      !> Bulk modulus, real or augmented, Pa.
      real(wp) :: bulk_modulus = 0.0_wp
      !> Eigenvalue about which the operator is inverted, (rad/s)2.
      real(wp) :: shift = 0.0_wp
      !> Cholesky factor of stiffness - shift*mass, lower band: [n_band + 1, n].
      real(wp), allocatable :: factor(:, :)
      !> Mass, lower band: [n_band + 1, n].
      real(wp), allocatable :: mass(:, :)
      !> Index of the unknown of each displacement, 0 if fixed: [2, 0:n_line, 0:n_ring].
      integer, allocatable :: unknown(:, :, :)
      !> Indices of the unknowns of each element, n + 1 if fixed: [18, n_element].
      integer, allocatable :: element_dof(:, :)
      !> Mean dilatations of each element: [3, 18, n_element].
      real(wp), allocatable :: dilatation(:, :, :)
   end type mode_matrices_type

contains

   !> Matrices of a ball, factorized.
   subroutine new_mode_matrices(ball, mesh, matrices, error)
      type(ball_type), intent(in) :: ball
      !> Mesh of order 2.
      type(mesh_type), intent(in) :: mesh
      type(mode_matrices_type), intent(out) :: matrices
      !> Set if the matrices are too large or not positive definite.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: shear_modulus, density
      integer :: info

      shear_modulus = ball%youngs_modulus/(2*(1 + ball%poisson_ratio))
      density = get_density(ball)
      matrices%incompressible = ball%poisson_ratio >= 0.5_wp
      if (matrices%incompressible) then
         matrices%bulk_modulus = augmented_ratio*shear_modulus
      else
         matrices%bulk_modulus = ball%youngs_modulus/(3*(1 - 2*ball%poisson_ratio))
      end if
      ! Below zero, the rigid eigenvalue, and of much smaller size than the first elastic one.
      matrices%shift = -0.1_wp*ball%youngs_modulus/density/ball%outer_radius**2
      call number_unknowns(mesh, matrices)
      call require_memory(16.0_wp*matrices%n*(matrices%n_band + 1.0_wp), '&mesh: the matrices of so many elements', &
         'lower radial_elements or polar_elements', error)
      if (allocated(error)) return
      call assemble(mesh, shear_modulus, density, matrices)
      call factorize(matrices%n, matrices%n_band, matrices%factor, info)
      call check_interrupt(error)
      if (allocated(error)) return
      if (info /= 0) error = numerical_error('&ball: poisson_ratio or wall_thickness make the stiffness of the ball ' &
         //'too ill-conditioned for double precision; allowed: less extreme values')
   end subroutine new_mode_matrices

   !> Numbers the displacements ring by ring along each polar line, which keeps the band narrow.
   pure subroutine number_unknowns(mesh, matrices)
      type(mesh_type), intent(in) :: mesh
      !> Gets the indices of the unknowns.
      type(mode_matrices_type), intent(inout) :: matrices
      integer :: i, j, k, a, b, c, element, n_ring, n_line

      n_ring = ubound(mesh%r, 2)
      n_line = ubound(mesh%r, 1)
      allocate (matrices%unknown(2, 0:n_line, 0:n_ring), source=0)
      do j = 0, n_line
         do i = 0, n_ring
            do k = 1, 2
               ! Nodes on the axis stay there.
               if (k == 1 .and. (j == 0 .or. j == n_line)) cycle
               matrices%n = matrices%n + 1
               matrices%unknown(k, j, i) = matrices%n
            end do
         end do
      end do
      allocate (matrices%element_dof(2*n_node, mesh%n_radial*mesh%n_polar))
      element = 0
      do j = 0, n_line - 2, 2
         do i = 0, n_ring - 2, 2
            element = element + 1
            matrices%element_dof(:, element) = [(((matrices%unknown(c, j + b, i + a), c=1, 2), a=0, 2), b=0, 2)]
            associate (dof => matrices%element_dof(:, element))
               matrices%n_band = max(matrices%n_band, maxval(dof) - minval(dof, mask=dof > 0))
            end associate
         end do
      end do
      where (matrices%element_dof == 0) matrices%element_dof = matrices%n + 1
   end subroutine number_unknowns

   !> Adds up the matrices of all elements.
   subroutine assemble(mesh, shear_modulus, density, matrices)
      type(mesh_type), intent(in) :: mesh
      !> Shear modulus, Pa; density, kg/m3.
      real(wp), intent(in) :: shear_modulus, density
      !> Gets stiffness - shift*mass, mass and dilatations.
      type(mode_matrices_type), intent(inout) :: matrices
      real(wp) :: volume
      real(wp) :: distortion(2*n_node, 2*n_node), mass(n_node, n_node), inertia(2*n_node, 2*n_node)
      integer :: a, b, i, j, element, row, column

      allocate (matrices%factor(0:matrices%n_band, matrices%n), matrices%mass(0:matrices%n_band, matrices%n))
      allocate (matrices%dilatation(n_dilatation, 2*n_node, size(matrices%element_dof, 2)))
      inertia = 0.0_wp
      do column = 1, matrices%n
         ! The largest matrices fill gigabytes, which takes time.
         if (is_interrupted()) return
         matrices%factor(:, column) = 0.0_wp
         matrices%mass(:, column) = 0.0_wp
      end do
      element = 0
      do j = 0, ubound(mesh%r, 1) - 2, 2
         if (is_interrupted()) return
         do i = 0, ubound(mesh%r, 2) - 2, 2
            element = element + 1
            associate (dof => matrices%element_dof(:, element), dilatation => matrices%dilatation(:, :, element))
               call get_mixed_element(reshape(transpose(mesh%r(j:j + 2, i:i + 2)), [n_node]), &
                  reshape(transpose(mesh%z(j:j + 2, i:i + 2)), [n_node]), shear_modulus, density, distortion, dilatation, &
                  mass)
               inertia(1::2, 1::2) = mass
               inertia(2::2, 2::2) = mass
               do b = 1, 2*n_node
                  do a = b, 2*n_node
                     row = max(dof(a), dof(b))
                     column = min(dof(a), dof(b))
                     if (row > matrices%n) cycle
                     volume = dot_product(dilatation(:, a), dilatation(:, b))
                     matrices%factor(row - column, column) = matrices%factor(row - column, column) &
                        + distortion(a, b) + matrices%bulk_modulus*volume - matrices%shift*inertia(a, b)
                     matrices%mass(row - column, column) = matrices%mass(row - column, column) + inertia(a, b)
                  end do
               end do
            end associate
         end do
      end do
   end subroutine assemble

   !> Cholesky factor of a banded matrix. For wide bands LAPACK would take minutes without a check for interrupts: they are
   !> factored block by block, by the algorithm of its dpbtrf.
   subroutine factorize(n, n_band, a, info)
      !> Numbers of unknowns and of diagonals below the main one.
      integer, intent(in) :: n, n_band
      !> The matrix, then the factor, lower band: [n_band + 1, n].
      real(wp), intent(inout) :: a(n_band + 1, n)
      !> 0, or nonzero if the matrix is not positive definite; undefined after an interrupt.
      integer, intent(out) :: info
      integer, parameter :: block = 32
      ! Triangle of a block that the band cuts off.
      real(wp) :: corner(block, block)
      integer :: i, j, width, inside, cut

      info = 0
      if (is_interrupted()) return
      if (n_band <= 2*block) call dpbtrf('L', n, n_band, a, n_band + 1, info)
      if (n_band <= 2*block) return
      corner = 0.0_wp
      do i = 1, n, block
         if (is_interrupted()) return
         width = min(block, n - i + 1)
         call dpotf2('L', width, a(1, i), n_band, info)
         if (info /= 0) return
         if (i + width > n) exit
         inside = min(n_band - width, n - i - width + 1)
         cut = min(width, n - i - n_band + 1)
         call dtrsm('R', 'L', 'T', 'N', inside, width, 1.0_wp, a(1, i), n_band, a(1 + width, i), n_band)
         call dsyrk('L', 'N', inside, width, -1.0_wp, a(1 + width, i), n_band, 1.0_wp, a(1, i + width), n_band)
         if (cut <= 0) cycle
         do j = 1, width
            corner(:min(j, cut), j) = a(n_band + 2 - j:n_band + 1 - j + min(j, cut), i + j - 1)
         end do
         call dtrsm('R', 'L', 'T', 'N', cut, width, 1.0_wp, a(1, i), n_band, corner, block)
         call dgemm('N', 'T', cut, inside, width, -1.0_wp, corner, block, a(1 + width, i), n_band, 1.0_wp, &
            a(1 + n_band - width, i + width), n_band)
         call dsyrk('L', 'N', cut, width, -1.0_wp, corner, block, 1.0_wp, a(1, i + n_band), n_band)
         do j = 1, width
            a(n_band + 2 - j:n_band + 1 - j + min(j, cut), i + j - 1) = corner(:min(j, cut), j)
         end do
      end do
   end subroutine factorize

   !> Mass times displacements.
   pure subroutine apply_mass(matrices, x, y)
      type(mode_matrices_type), intent(in) :: matrices
      !> Displacements, m: [n].
      real(wp), intent(in) :: x(:)
      !> Product, kg m: [n].
      real(wp), intent(out) :: y(:)

      call dsbmv('L', matrices%n, matrices%n_band, 1.0_wp, matrices%mass, matrices%n_band + 1, x, 1, 0.0_wp, y, 1)
   end subroutine apply_mass

   !> Displacements due to forces on the shifted system, at constant volume if Poisson's ratio is 1/2.
   subroutine apply_inverse(matrices, force, x, failed)
      type(mode_matrices_type), intent(in) :: matrices
      !> Forces, N: [n].
      real(wp), intent(in) :: force(:)
      !> Displacements, m: [n].
      real(wp), intent(out) :: x(:)
      !> Whether the volume could not be kept.
      logical, intent(out) :: failed
      real(wp), dimension(n_dilatation, size(matrices%element_dof, 2)) :: pressure, change
      real(wp) :: padded(matrices%n + 1)
      integer :: iteration, element, info

      failed = .false.
      x = force
      call dpbtrs('L', matrices%n, matrices%n_band, 1, matrices%factor, matrices%n_band + 1, x, matrices%n, info)
      if (.not. matrices%incompressible) return
      pressure = 0.0_wp
      do iteration = 1, max_iterations
         if (is_interrupted()) exit
         padded(:matrices%n) = x
         padded(matrices%n + 1) = 0.0_wp
         do element = 1, size(matrices%element_dof, 2)
            change(:, element) = matrices%bulk_modulus &
               *matmul(matrices%dilatation(:, :, element), padded(matrices%element_dof(:, element)))
         end do
         pressure = pressure + change
         if (sum(change**2) <= constraint_tolerance**2*sum(pressure**2)) return
         ! The change of the pressures gives the correction of the displacements.
         padded = 0.0_wp
         do element = 1, size(matrices%element_dof, 2)
            associate (dof => matrices%element_dof(:, element))
               padded(dof) = padded(dof) - matmul(change(:, element), matrices%dilatation(:, :, element))
            end associate
         end do
         call dpbtrs('L', matrices%n, matrices%n_band, 1, matrices%factor, matrices%n_band + 1, padded, matrices%n + 1, &
            info)
         x = x + padded(:matrices%n)
      end do
      failed = .true.
   end subroutine apply_inverse

end module thud_mode_matrices
