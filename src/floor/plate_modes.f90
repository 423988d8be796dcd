!> Modes of simply supported rectangular plates, sin(m pi x/l) sin(n pi y/b), and the receivers that plates are.
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

   public :: check_mode_count, get_far_compliance, get_half_waves, get_modal_stiffness, get_shape, new_plate_receiver

   !> Modes up to this frequency count one by one, Hz. Those above act by their static compliance. In the mean, at a
   !> frequency f that misses 0.3 (f/limit)**3 of the mobility of the infinite plate: 0.4 % at 707 Hz.
   real(wp), parameter, public :: mode_limit = 3000.0_wp

   !> Modes up to this many times the limit make the static compliance; that of the others is their mean.
   real(wp), parameter, public :: far = 16.0_wp

   !> Corner of the residual modes, rad/s: in the mean over positions residual n(omega) modes with 1/(m'' S omega**2) each
   !> have the compliance 2/(pi Z 2 pi limit); with this corner its conductance is 1/Z.
   real(wp), parameter, public :: residual_corner = pi/(2*sqrt(2.0_wp))*2*pi*mode_limit

   !> Maximum number of modes below the limit: a drop takes time in proportion.
   real(wp), parameter :: max_modes = 20000.0_wp

contains

   !> Refuses a plate with too many modes.
   subroutine check_mode_count(group, plate, error)
      !> Group of the keys.
      character(len=*), intent(in) :: group
      type(plate_type), intent(in) :: plate
      !> Names the size.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: count

      count = mode_limit*get_mode_density(plate)
      if (count > max_modes) error = input_error('&'//group//': length = '//to_text(plate%length)//' m and width = ' &
         //to_text(plate%width)//' m have '//fixed(count, 0)//' modes below '//fixed(mode_limit, 0) &
         //' Hz; allowed: up to '//fixed(max_modes, 0))
   end subroutine check_mode_count

   !> Half waves along length and width of the modes below a frequency.
   pure subroutine get_half_waves(plate, frequency, m, n)
      type(plate_type), intent(in) :: plate
      !> The frequency, Hz.
      real(wp), intent(in) :: frequency
      !> Half waves along length and width: [n_mode].
      integer, allocatable, intent(out) :: m(:), n(:)
      real(wp) :: limit
      integer :: i, j, last, count

      limit = get_surface_mass(plate)*(2*pi*frequency)**2
      do i = 1, 2
         count = 0
         j = 1
         do
            last = get_last(plate, limit, j)
            if (last < 1) exit
            if (i == 2) then
               m(count + 1:count + last) = j
               n(count + 1:count + last) = counting(last)
            end if
            count = count + last
            j = j + 1
         end do
         if (i == 1) allocate (m(count), n(count))
      end do
   end subroutine get_half_waves

   !> Last number of half waves along the width below a modal stiffness.
   pure function get_last(plate, limit, m) result(n)
      type(plate_type), intent(in) :: plate
      !> The stiffness over area, N/m3.
      real(wp), intent(in) :: limit
      !> Half waves along the length.
      integer, intent(in) :: m
      !> 0 where there is none.
      integer :: n
      real(wp) :: along, across, square

      ! Bx kx**4 + 2 H kx**2 ky**2 + By ky**4 = limit is quadratic in ky**2.
      across = get_bending_stiffness(plate)*sqrt(plate%stiffness_ratio)
      along = get_bending_stiffness(plate)*(m*pi/plate%length)**2
      square = limit - get_modal_stiffness(plate, m, 0)
      n = 0
      if (square < 0.0_wp) return
      square = square/(along*plate%torsion_ratio + sqrt((along*plate%torsion_ratio)**2 + across*square))
      n = int(sqrt(square)*plate%width/pi)
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

   !> Stiffness of a mode over area, Bx kx**4 + 2 H kx**2 ky**2 + By ky**4: omega**2 = stiffness/m''.
   elemental function get_modal_stiffness(plate, m, n) result(stiffness)
      type(plate_type), intent(in) :: plate
      !> Half waves along length and width.
      integer, intent(in) :: m, n
      !> The stiffness, N/m3.
      real(wp) :: stiffness

      associate (x => (m*pi/plate%length)**2, y => (n*pi/plate%width)**2, ratio => sqrt(plate%stiffness_ratio))
         stiffness = get_bending_stiffness(plate)*(x**2/ratio + 2*plate%torsion_ratio*x*y + ratio*y**2)
      end associate
   end function get_modal_stiffness

   !> Shapes of modes at a point.
   pure function get_shape(m, n, point) result(shape)
      !> Half waves along length and width: [n_mode].
      integer, intent(in) :: m(:), n(:)
      !> The point, over length and width.
      real(wp), intent(in) :: point(2)
      !> The shapes: [n_mode].
      real(wp) :: shape(size(m))
      real(wp) :: along(maxval([m, 0])), across(maxval([n, 0]))

      along = sin(pi*point(1)*counting(size(along)))
      across = sin(pi*point(2)*counting(size(across)))
      shape = along(m)*across(n)
   end function get_shape

   !> Velocity of a point of a plate over the force at another. Modes above the limit are residual modes.
   subroutine new_plate_receiver(group, plate, source, point, receiver, error, max_across, residual)
      !> Group of the plate's keys, for messages.
      character(len=*), intent(in) :: group
      type(plate_type), intent(in) :: plate
      !> Positions of source and point, over length and width: [2].
      real(wp), intent(in) :: source(2), point(2)
      type(receiver_type), intent(out) :: receiver
      !> The losses are too high.
      type(error_type), allocatable, intent(out) :: error
      !> Maximum number of half waves along the width (default: any).
      integer, intent(in), optional :: max_across
      !> Compliance, m/N, and corner, rad/s, of the residual modes (default: those of the plate): [2].
      real(wp), intent(in), optional :: residual(2)
      integer, allocatable :: m(:), n(:)
      real(wp), allocatable :: omega(:), gain(:)
      logical, allocatable :: single(:)
      real(wp) :: residual_terms(2)

      call get_half_waves(plate, far*mode_limit, m, n)
      if (present(max_across)) then
         m = pack(m, n <= max_across)
         n = pack(n, n <= max_across)
      end if
      omega = sqrt(get_modal_stiffness(plate, m, n)/get_surface_mass(plate))
      single = omega < 2*pi*mode_limit
      gain = 4/(get_surface_mass(plate)*plate%length*plate%width)*get_shape(m, n, source)*get_shape(m, n, point)
      residual_terms = [sum(gain/omega**2, mask=.not. single), residual_corner]
      ! Modes farther off cancel but under the source.
      if (.not. present(max_across) .and. all(abs(source - point) < epsilon(1.0_wp))) residual_terms(1) = residual_terms(1) &
         + get_far_compliance(plate)
      if (present(residual)) residual_terms = residual
      associate (omega => pack(omega, single))
         call new_modal_receiver(group, pack(gain, single), omega, get_total_loss(plate, air_type(), omega/(2*pi)), &
            residual_terms, receiver, error)
      end associate
   end subroutine new_plate_receiver

   !> Static compliance of the modes that are too far off to be summed, the mean over positions.
   elemental function get_far_compliance(plate) result(compliance)
      type(plate_type), intent(in) :: plate
      !> The compliance, m/N.
      real(wp) :: compliance

      compliance = 2/(pi*get_resistance(plate)*2*pi*mode_limit*far)
   end function get_far_compliance

end module thud_plate_modes
