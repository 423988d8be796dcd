!> Modes of simply supported rectangular plates, sin(m pi x/l) sin(n pi y/b), and the receivers of such plates.
module thud_plate_modes
   use thud_constants, only: pi
   use thud_error, only: error_type, input_error
   use thud_kinds, only: wp
   use thud_modal_receiver, only: new_modal_receiver
   use thud_plate, only: air_type, get_bending_stiffness, get_mode_density, get_resistance, get_surface_mass, &
      get_total_loss, plate_type
   use thud_receiver, only: receiver_type
   use thud_text, only: fixed, to_text
   implicit none (type, external)
   private

   public :: check_mode_count, get_unsummed_compliance, get_half_waves, get_modal_stiffness, get_shape, new_plate_receiver

   !> Modes up to this frequency are treated individually, Hz; higher modes add their static compliance. On average, this
   !> omits 0.3 (f/mode_limit)**3 of the mobility of the infinite plate at a frequency f: 0.4 % at 707 Hz.
   real(wp), parameter, public :: mode_limit = 3000.0_wp

   !> Static compliance: sum of the modes up to this many times `mode_limit`, plus the mean compliance of the modes above.
   real(wp), parameter, public :: sum_limit_factor = 16.0_wp

   !> Corner frequency of the residual modes, rad/s. With the mode density n(omega) and the compliance 1/(m'' S omega**2) of
   !> each (S: area), they have the compliance 2/(pi Z 2 pi mode_limit), averaged over positions (Z: resistance of the
   !> infinite plate). With this corner, their conductance at high frequencies is 1/Z.
   real(wp), parameter, public :: residual_corner = pi/(2*sqrt(2.0_wp))*2*pi*mode_limit

   !> Maximum number of modes below `mode_limit`: the time for a drop is proportional to it.
   real(wp), parameter :: max_modes = 20000.0_wp

contains

   !> Checks the number of modes of a plate.
   subroutine check_mode_count(group, plate, error)
      !> Namelist group, for messages.
      character(len=*), intent(in) :: group
      type(plate_type), intent(in) :: plate
      !> Set if there are too many; the message names length and width.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: count

      count = mode_limit*get_mode_density(plate)
      if (count > max_modes) error = input_error('&'//group//': length = '//to_text(plate%length)//' m and width = ' &
         //to_text(plate%width)//' m have '//fixed(count, 0)//' modes below '//fixed(mode_limit, 0) &
         //' Hz; allowed: up to '//fixed(max_modes, 0))
   end subroutine check_mode_count

   !> Half waves of the modes below a frequency.
   pure subroutine get_half_waves(plate, frequency, m, n)
      type(plate_type), intent(in) :: plate
      !> The frequency, Hz.
      real(wp), intent(in) :: frequency
      !> Half waves along length and width: [n_mode].
      integer, allocatable, intent(out) :: m(:), n(:)
      real(wp) :: max_stiffness
      integer :: pass, j, last, count

      max_stiffness = get_surface_mass(plate)*(2*pi*frequency)**2
      ! The first pass counts the modes, the second stores them.
      do pass = 1, 2
         count = 0
         j = 1
         do
            last = get_last(plate, max_stiffness, j)
            if (last < 1) exit
            if (pass == 2) then
               m(count + 1:count + last) = j
               n(count + 1:count + last) = counting(last)
            end if
            count = count + last
            j = j + 1
         end do
         if (pass == 1) allocate (m(count), n(count))
      end do
   end subroutine get_half_waves

   !> Largest number of half waves along the width up to a modal stiffness.
   pure function get_last(plate, max_stiffness, m) result(n)
      type(plate_type), intent(in) :: plate
      !> Maximum modal stiffness per unit area, N/m3.
      real(wp), intent(in) :: max_stiffness
      !> Number of half waves along the length.
      integer, intent(in) :: m
      !> The number; 0 if there is none.
      integer :: n
      real(wp) :: quadratic, half_linear, remainder, ky_squared

      ! Bx kx**4 + 2 H kx**2 ky**2 + By ky**4 = max_stiffness is quadratic in ky**2.
      quadratic = get_bending_stiffness(plate)*sqrt(plate%stiffness_ratio)
      half_linear = get_bending_stiffness(plate)*(m*pi/plate%length)**2*plate%torsion_ratio
      remainder = max_stiffness - get_modal_stiffness(plate, m, 0)
      n = 0
      if (remainder < 0.0_wp) return
      ky_squared = remainder/(half_linear + sqrt(half_linear**2 + quadratic*remainder))
      n = int(sqrt(ky_squared)*plate%width/pi)
   end function get_last

   !> 1, 2, ..., n.
   pure function counting(n) result(numbers)
      integer, intent(in) :: n
      integer :: numbers(n)
      integer :: i

      do i = 1, n
         numbers(i) = i
      end do
   end function counting

   !> Modal stiffness per unit area, Bx kx**4 + 2 H kx**2 ky**2 + By ky**4: omega**2 = stiffness/m''.
   elemental function get_modal_stiffness(plate, m, n) result(stiffness)
      type(plate_type), intent(in) :: plate
      !> Half waves along length and width.
      integer, intent(in) :: m, n
      !> The stiffness, N/m3.
      real(wp) :: stiffness

      associate (kx2 => (m*pi/plate%length)**2, ky2 => (n*pi/plate%width)**2, root_ratio => sqrt(plate%stiffness_ratio))
         stiffness = get_bending_stiffness(plate)*(kx2**2/root_ratio + 2*plate%torsion_ratio*kx2*ky2 + root_ratio*ky2**2)
      end associate
   end function get_modal_stiffness

   !> Mode shapes at a point: [n_mode].
   pure function get_shape(m, n, point) result(shape)
      !> Half waves along length and width: [n_mode].
      integer, intent(in) :: m(:), n(:)
      !> Position of the point, as fractions of length and width.
      real(wp), intent(in) :: point(2)
      real(wp) :: shape(size(m))
      real(wp) :: sine_x(maxval([m, 0])), sine_y(maxval([n, 0]))

      sine_x = sin(pi*point(1)*counting(size(sine_x)))
      sine_y = sin(pi*point(2)*counting(size(sine_y)))
      shape = sine_x(m)*sine_y(n)
   end function get_shape

   !> Transfer mobility from a source to a point of a plate. Modes above `mode_limit` are residual modes.
   subroutine new_plate_receiver(group, plate, source, point, receiver, error, max_across, residual)
      !> Namelist group, for messages.
      character(len=*), intent(in) :: group
      type(plate_type), intent(in) :: plate
      !> Positions of source and point, as fractions of length and width: [2].
      real(wp), intent(in) :: source(2), point(2)
      type(receiver_type), intent(out) :: receiver
      !> Set if the losses are too high.
      type(error_type), allocatable, intent(out) :: error
      !> Maximum number of half waves along the width (default: no maximum).
      integer, intent(in), optional :: max_across
      !> Compliance, m/N, and corner frequency, rad/s, of the residual modes (default: those of the plate): [2].
      real(wp), intent(in), optional :: residual(2)
      integer, allocatable :: m(:), n(:)
      real(wp), allocatable :: omega(:), gain(:)
      logical, allocatable :: individual(:)
      real(wp) :: residual_terms(2)

      call get_half_waves(plate, sum_limit_factor*mode_limit, m, n)
      if (present(max_across)) then
         m = pack(m, n <= max_across)
         n = pack(n, n <= max_across)
      end if
      omega = sqrt(get_modal_stiffness(plate, m, n)/get_surface_mass(plate))
      individual = omega < 2*pi*mode_limit
      gain = 4/(get_surface_mass(plate)*plate%length*plate%width)*get_shape(m, n, source)*get_shape(m, n, point)
      residual_terms = [sum(gain/omega**2, mask=.not. individual), residual_corner]
      ! The modes that are not summed cancel on average, except at the source.
      if (.not. present(max_across) .and. all(abs(source - point) < epsilon(1.0_wp))) then
         residual_terms(1) = residual_terms(1) + get_unsummed_compliance(plate)
      end if
      if (present(residual)) residual_terms = residual
      associate (omega => pack(omega, individual))
         call new_modal_receiver(group, pack(gain, individual), omega, get_total_loss(plate, air_type(), omega/(2*pi)), &
            residual_terms, receiver, error)
      end associate
   end subroutine new_plate_receiver

   !> Static compliance of the modes above the summed ones, averaged over positions.
   elemental function get_unsummed_compliance(plate) result(compliance)
      type(plate_type), intent(in) :: plate
      !> The compliance, m/N.
      real(wp) :: compliance

      compliance = 2/(pi*get_resistance(plate)*2*pi*mode_limit*sum_limit_factor)
   end function get_unsummed_compliance

end module thud_plate_modes
