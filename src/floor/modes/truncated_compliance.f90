!> Static compliance of a plate with ribs that the functions of a Ritz system lack: that of all shorter waves.
!>
!> Shorter waves do not reach the edges, so the plate is infinite here. With the wavenumbers k along ribs and q across them,
!> its deflection under a line load cos(k x) at a distance d is the integral of cos(q d)/D over q/(2 pi), with
!> D = B_x k**4 + 2 H k**2 q**2 + B_y q**4. Ribs are elastic supports against deflection and, by their torsion, slope.
module thud_truncated_compliance
   use thud_constants, only: pi
   use thud_function_set, only: get_quadrature
   use thud_kinds, only: wp
   use thud_lapack, only: dposv
   use thud_plate_stack, only: orthotropic_type, ribs_type
   implicit none (type, external)
   private

   public :: get_truncated_compliance

   !> Number of ribs next to the point that take part.
   integer, parameter :: max_ribs = 4

   !> Points of the quadratures over wavenumbers.
   integer, parameter :: n_point = 32

contains

   !> The compliance at a point, m/N.
   function get_truncated_compliance(plate, wavenumber, y) result(compliance)
      !> A plate that is rigid in shear.
      type(orthotropic_type), intent(in) :: plate
      !> Wavenumbers along length and width up to which the functions are complete, 1/m: [2].
      real(wp), intent(in) :: wavenumber(2)
      !> Coordinate of the point along the width, m.
      real(wp), intent(in) :: y
      real(wp) :: compliance
      type(ribs_type) :: ribs
      real(wp), allocatable :: along(:), weight(:), load(:), moment(:), position(:), distance(:, :)
      logical, allocatable :: near(:)
      integer :: i

      allocate (ribs%position(0))
      if (allocated(plate%ribs)) ribs = plate%ribs
      allocate (near(size(ribs%position)), source=.false.)
      do i = 1, min(max_ribs, size(near))
         near(minloc(abs(ribs%position - y), dim=1, mask=.not. near)) = .true.
      end do
      position = [y, pack(ribs%position, near)]
      distance = spread(position, 2, size(position)) - spread(position, 1, size(position))
      compliance = 0.0_wp
      ! Waves along the ribs that the functions have: what is missing across.
      call get_quadrature(n_point, 0.0_wp, wavenumber(1), along, weight)
      do i = 1, n_point
         call get_line_loads(plate, ribs, along(i), distance, load, moment)
         compliance = compliance + weight(i)/pi*dot_product(load, &
            matmul(get_short_deflection(plate, along(i), wavenumber(2), distance), load))
      end do
      ! Shorter ones: k = wavenumber/t.
      call get_quadrature(n_point, 0.0_wp, 1.0_wp, along, weight)
      do i = 1, n_point
         associate (k => wavenumber(1)/along(i))
            call get_line_loads(plate, ribs, k, distance, load, moment)
            compliance = compliance + weight(i)*k/along(i)/pi &
               *(dot_product(load, get_deflection(plate, k, distance(:, 1), 0)) &
               + dot_product(moment, get_deflection(plate, k, distance(2:, 1), 1)))
         end associate
      end do
   end function get_truncated_compliance

   !> Loads on the plate: a unit force, and the reactions of the ribs.
   subroutine get_line_loads(plate, ribs, k, distance, load, moment)
      type(orthotropic_type), intent(in) :: plate
      type(ribs_type), intent(in) :: ribs
      !> Wavenumber along the ribs, 1/m.
      real(wp), intent(in) :: k
      !> Distances of force and ribs from each other, m: [1 + n_rib, 1 + n_rib].
      real(wp), intent(in) :: distance(:, :)
      !> Forces, the unit force first: [1 + n_rib]; moments, m: [n_rib].
      real(wp), allocatable, intent(out) :: load(:), moment(:)
      real(wp) :: matrix(2*size(distance, 1) - 2, 2*size(distance, 1) - 2), reaction(2*size(distance, 1) - 2, 1)
      real(wp) :: beam
      integer :: i, n, info

      n = size(distance, 1) - 1
      allocate (load(n + 1), moment(n), source=0.0_wp)
      load(1) = 1.0_wp
      if (n == 0) return
      beam = 1/((ribs%bending + ribs%composite/(1 + ribs%slip*ribs%composite*k**2))*k**4) + 1/(ribs%shear*k**2)
      associate (between => distance(2:, 2:), from_force => distance(2:, 1))
         matrix(:n, :n) = get_deflection(plate, k, between, 0)
         matrix(:n, n + 1:) = -get_deflection(plate, k, between, 1)
         matrix(n + 1:, n + 1:) = -get_deflection(plate, k, between, 2)
         reaction(:n, 1) = get_deflection(plate, k, from_force, 0)
         reaction(n + 1:, 1) = get_deflection(plate, k, from_force, 1)
      end associate
      do i = 1, n
         matrix(i, i) = matrix(i, i) + beam
         ! Without torsion, nothing resists the slope: a compliance that is far above that of the plate.
         matrix(n + i, n + i) = matrix(n + i, n + i) + 1/max(ribs%torsion*k**2 + ribs%warping*k**4, 1.0e-9_wp*plate%across*k)
      end do
      call dposv('U', 2*n, 1, matrix, 2*n, reaction, 2*n, info)
      if (info /= 0) return
      load(2:) = -reaction(:n, 1)
      moment = -reaction(n + 1:, 1)
   end subroutine get_line_loads

   !> Derivative with respect to the distance of the deflection by a unit line load cos(k x), m2/N/m**order, by residues.
   elemental function get_deflection(plate, k, distance, order) result(deflection)
      type(orthotropic_type), intent(in) :: plate
      !> Wavenumber, 1/m, and distance from the load, m, with its sign.
      real(wp), intent(in) :: k, distance
      integer, intent(in) :: order
      real(wp) :: deflection
      complex(wp) :: square(2), root(2)
      real(wp) :: difference

      associate (product => plate%along*plate%across, mixed => plate%coupling + 2*plate%torsion)
         ! Equal roots, as of an isotropic plate, would divide by zero.
         difference = mixed**2 - product
         if (abs(difference) < 1.0e-6_wp*product) difference = 1.0e-6_wp*product
         square = k**2/plate%across*(mixed + [1, -1]*sqrt(cmplx(difference, 0.0_wp, wp)))
      end associate
      root = sqrt(square)
      deflection = real(((-root(2))**order*exp(-root(2)*abs(distance))/root(2) &
         - (-root(1))**order*exp(-root(1)*abs(distance))/root(1))/(2*plate%across*(square(1) - square(2))), wp)
      if (mod(order, 2) == 1) deflection = sign(1.0_wp, distance)*deflection
   end function get_deflection

   !> As `get_deflection`, of wavenumbers across the ribs from a limit on.
   elemental function get_short_deflection(plate, k, limit, distance) result(deflection)
      type(orthotropic_type), intent(in) :: plate
      real(wp), intent(in) :: k, limit, distance
      real(wp) :: deflection
      real(wp), allocatable :: t(:), weight(:)

      call get_quadrature(n_point, 0.0_wp, 1.0_wp, t, weight)
      associate (q => limit/t, mixed => plate%coupling + 2*plate%torsion)
         deflection = sum(weight*q/t*cos(q*distance)/(plate%along*k**4 + 2*mixed*k**2*q**2 + plate%across*q**4))/pi
      end associate
   end function get_short_deflection

end module thud_truncated_compliance
