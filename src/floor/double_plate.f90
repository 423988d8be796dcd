!> Two simply supported plates with a resilient layer between them: the upper plate as a receiver, and the power into the
!> lower plate.
module thud_double_plate
   use thud_constants, only: pi
   use thud_error, only: error_type
   use thud_kinds, only: wp
   use thud_modal_receiver, only: new_modal_receiver
   use thud_plate, only: air_type, get_bending_stiffness, get_surface_mass, get_total_loss, plate_type
   use thud_plate_modes, only: get_unsummed_compliance, get_half_waves, get_modal_stiffness, get_shape, mode_limit, &
      residual_corner, sum_limit_factor
   use thud_receiver, only: receiver_type
   implicit none (type, external)
   private

   public :: double_plate_type, get_lower_conductance, new_double_receiver

   !> Both plates and the layer.
   type :: double_plate_type
      !> Plate under the source, and plate above the room, of equal length and width.
      type(plate_type) :: upper, lower
      !> Dynamic stiffness of the layer per unit area, N/m3, and its loss factor.
      real(wp) :: layer_stiffness = 0.0_wp, layer_loss = 0.0_wp
   end type double_plate_type

contains

   !> Transfer mobility from a source to a point of the upper plate.
   !>
   !> Both plates have the same mode shapes. Each shape has two modes, those of two masses on three springs. The loss factor
   !> of a mode is the mean of the loss factors of plates and layer, weighted by elastic energy; the error is of second order
   !> in the differences of the loss factors. Residual modes are treated as for one plate.
   subroutine new_double_receiver(floor, source, point, receiver, error)
      type(double_plate_type), intent(in) :: floor
      !> Positions of source and point, as fractions of length and width.
      real(wp), intent(in) :: source(2), point(2)
      type(receiver_type), intent(out) :: receiver
      !> Set if the losses are too high.
      type(error_type), allocatable, intent(out) :: error
      integer, allocatable :: m(:), n(:)
      real(wp), allocatable :: omega(:, :), modal_square(:, :), loss_factor(:, :), gain(:, :)
      logical, allocatable :: individual(:, :)
      real(wp) :: compliance

      call get_all_half_waves(floor, m, n)
      allocate (omega(size(m), 2), modal_square(size(m), 2), loss_factor(size(m), 2))
      call get_pair(floor, get_modal_stiffness(floor%upper, m, n), get_modal_stiffness(floor%lower, m, n), omega(:, 1), &
         omega(:, 2), modal_square(:, 1), modal_square(:, 2), loss_factor(:, 1), loss_factor(:, 2))
      individual = omega < 2*pi*mode_limit
      gain = 4/(floor%upper%length*floor%upper%width)*modal_square &
         *spread(get_shape(m, n, source)*get_shape(m, n, point), 2, 2)
      compliance = sum(gain/omega**2, mask=.not. individual)
      ! At the source, the modes above the summed ones add their compliances; at other points these cancel on average.
      if (all(abs(source - point) < epsilon(1.0_wp))) compliance = compliance + get_unsummed_compliance(floor%upper)
      call new_modal_receiver('floating_floor', pack(gain, individual), pack(omega, individual), &
         pack(loss_factor, individual), [compliance, residual_corner], receiver, error)
   end subroutine new_double_receiver

   !> Half waves of the modes of the upper plate up to sum_limit_factor*mode_limit, and of the lower plate up to mode_limit.
   pure subroutine get_all_half_waves(floor, m, n)
      type(double_plate_type), intent(in) :: floor
      !> Half waves along length and width: [n_shape].
      integer, allocatable, intent(out) :: m(:), n(:)
      integer, allocatable :: m_lower(:), n_lower(:)
      logical, allocatable :: new(:)

      call get_half_waves(floor%upper, sum_limit_factor*mode_limit, m, n)
      call get_half_waves(floor%lower, mode_limit, m_lower, n_lower)
      new = get_modal_stiffness(floor%upper, m_lower, n_lower) &
         >= get_surface_mass(floor%upper)*(2*pi*sum_limit_factor*mode_limit)**2
      m = [m, pack(m_lower, new)]
      n = [n, pack(n_lower, new)]
   end subroutine get_all_half_waves

   !> The two modes of a shape.
   elemental subroutine get_pair(floor, upper, lower, omega_1, omega_2, square_1, square_2, loss_1, loss_2)
      type(double_plate_type), intent(in) :: floor
      !> Modal stiffness per unit area of both plates, N/m3.
      real(wp), intent(in) :: upper, lower
      !> Angular frequencies, rad/s, the lower first.
      real(wp), intent(out) :: omega_1, omega_2
      !> Squared displacements of the upper plate, for a modal mass of 1 per unit area, m2/kg.
      real(wp), intent(out) :: square_1, square_2
      !> Loss factors.
      real(wp), intent(out) :: loss_1, loss_2
      real(wp) :: first, second, coupling, angle, top, bottom

      associate (m1 => get_surface_mass(floor%upper), m2 => get_surface_mass(floor%lower), s => floor%layer_stiffness)
         first = (upper + s)/m1
         second = (lower + s)/m2
         coupling = -s/sqrt(m1*m2)
         omega_2 = sqrt((first + second)/2 + hypot((first - second)/2, coupling))
         ! From the product of both frequencies, because a difference would cancel.
         omega_1 = sqrt((upper*lower + s*(upper + lower))/(m1*m2))/omega_2
         angle = atan2(2*coupling, first - second)/2
         top = cos(angle)/sqrt(m1)
         bottom = sin(angle)/sqrt(m2)
         square_2 = top**2
         loss_2 = get_loss(floor, omega_2, upper*top**2, lower*bottom**2, s*(top - bottom)**2)
         top = -sin(angle)/sqrt(m1)
         bottom = cos(angle)/sqrt(m2)
         square_1 = top**2
         loss_1 = get_loss(floor, omega_1, upper*top**2, lower*bottom**2, s*(top - bottom)**2)
      end associate
   end subroutine get_pair

   !> Mean of the loss factors, weighted by elastic energy.
   elemental function get_loss(floor, omega, upper, lower, layer) result(loss_factor)
      type(double_plate_type), intent(in) :: floor
      !> Angular frequency, rad/s.
      real(wp), intent(in) :: omega
      !> Elastic energies of plates and layer, in any unit.
      real(wp), intent(in) :: upper, lower, layer
      real(wp) :: loss_factor

      loss_factor = (upper*floor%upper%loss_factor + lower*get_total_loss(floor%lower, air_type(), omega/(2*pi)) &
         + layer*floor%layer_loss)/(upper + lower + layer)
   end function get_loss

   !> Power into the lower plate per mean-square force on the upper plate, for infinite plates and a layer without bending
   !> stiffness (Cremer, Heckl and Petersson, *Structure-Borne Sound*).
   !>
   !> With the wavenumber k and u = k**2, the response of the lower plate is h2 = s/(B1 B2 (u**2 - q1) (u**2 - q2)) with the
   !> roots q of the determinant. The plate dissipates omega Im B2/(4 pi) integral of u**2 |h2|**2 du, solved by partial
   !> fractions with integral du/(u**2 - q) = pi/(2 sqrt(-q)). It dissipates all power that it receives.
   elemental function get_lower_conductance(floor, frequency) result(conductance)
      type(double_plate_type), intent(in) :: floor
      !> Frequency, Hz.
      real(wp), intent(in) :: frequency
      !> The conductance, m/(N s).
      real(wp) :: conductance
      complex(wp) :: root(4)
      complex(wp) :: b1, b2, s, c1, c2, half, term, total
      real(wp) :: omega
      integer :: i, j

      omega = 2*pi*frequency
      b1 = get_bending_stiffness(floor%upper)*cmplx(1.0_wp, floor%upper%loss_factor, wp)
      b2 = get_bending_stiffness(floor%lower)*cmplx(1.0_wp, get_total_loss(floor%lower, air_type(), frequency), wp)
      s = floor%layer_stiffness*cmplx(1.0_wp, floor%layer_loss, wp)
      c1 = (s - get_surface_mass(floor%upper)*omega**2)/b1
      c2 = (s - get_surface_mass(floor%lower)*omega**2)/b2
      half = sqrt(((c1 - c2)/2)**2 + s**2/(b1*b2))
      root(1:2) = -(c1 + c2)/2 + [half, -half]
      root(3:4) = conjg(root(1:2))
      total = 0.0_wp
      do i = 1, 4
         term = root(i)/sqrt(-root(i))
         do j = 1, 4
            if (j /= i) term = term/(root(i) - root(j))
         end do
         total = total + term
      end do
      conductance = omega*b2%im*abs(s/(b1*b2))**2/8*real(total)
   end function get_lower_conductance

end module thud_double_plate
