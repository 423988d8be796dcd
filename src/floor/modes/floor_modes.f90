!> Modes of a floor with their losses, and its mobility from them.
module thud_floor_modes
   use thud_constants, only: pi
   use thud_error, only: error_type, input_error, numerical_error
   use thud_function_set, only: get_highest_wavenumber
   use thud_kinds, only: wp
   use thud_modes, only: diagonalize, get_mode_values, get_some_modes, mode_block_type, modes_type
   use thud_plate, only: air_type, get_total_loss, plate_type
   use thud_plate_stack, only: has_shear, is_uncoupled, plate_stack_type, with_rigid_edges
   use thud_receiver, only: receiver_type
   use thud_stack_modes, only: get_stack_modes
   use thud_text, only: fixed, to_text
   use thud_truncated_compliance, only: get_truncated_compliance
   implicit none (type, external)
   private

   public :: floor_modes_type, get_floor_modes, get_poles, get_selected_modes
   public :: new_floor_receiver, new_modal_receiver

   !> Modes up to this frequency are treated individually, Hz; higher modes add their static compliance. On average, this
   !> omits 0.3 (f/mode_limit)**3 of the mobility of the infinite plate at a frequency f: 0.4 % at 707 Hz.
   real(wp), parameter, public :: mode_limit = 3000.0_wp

   !> Static compliance of uncoupled modes: sum up to this many times `mode_limit`, plus the mean compliance above.
   real(wp), parameter :: sum_limit_factor = 16.0_wp

   !> Ratio of the frequency that the functions resolve to that of the highest mode that is treated individually.
   real(wp), parameter :: resolution = 1.1_wp

   !> Modes of a floor, block after block.
   type :: floor_modes_type
      type(plate_stack_type) :: stack
      type(modes_type) :: modes
      !> Angular frequencies, rad/s, and loss factors: [n_mode].
      real(wp), allocatable :: omega(:), loss_factor(:)
      !> Frequency up to which modes are treated individually, and up to which the others are summed, rad/s.
      real(wp) :: limit = 0.0_wp, sum_limit = 0.0_wp
   end type floor_modes_type

contains

   !> Modes of a stack of plates. To the losses of its parts those of the bearing plate at its edges and by radiation are
   !> added, in proportion to its part of the energy.
   subroutine get_floor_modes(group, stack, bearing, air, modes, error, max_frequency)
      !> Namelist group, for messages.
      character(len=*), intent(in) :: group
      type(plate_stack_type), intent(in) :: stack
      !> The bearing plate, with its total losses.
      type(plate_type), intent(in) :: bearing
      !> Air that it radiates into.
      type(air_type), intent(in) :: air
      type(floor_modes_type), intent(out) :: modes
      !> Set if the modes cannot be computed.
      type(error_type), allocatable, intent(out) :: error
      !> Frequency up to which modes are wanted, Hz (default: `mode_limit`, and beyond for the static compliance).
      real(wp), intent(in), optional :: max_frequency
      real(wp) :: wanted, resolved
      integer :: i
      logical :: failed

      modes%stack = with_rigid_edges(stack)
      wanted = mode_limit*resolution
      ! In shear, waves are short, and many functions gain little.
      if (all(is_uncoupled(modes%stack)) .and. .not. any(has_shear(stack%plate))) wanted = mode_limit*sum_limit_factor
      if (present(max_frequency)) wanted = min(wanted, max_frequency*resolution)
      call get_stack_modes(modes%stack, wanted, modes%modes, resolved, failed, mode_limit)
      if (.not. resolved > 0.0_wp) then
         error = get_unresolved(group, stack)
      else if (failed) then
         error = input_error('no modes can be computed; allowed: stiffnesses and masses above zero', group)
      end if
      if (allocated(error)) return
      modes%sum_limit = 2*pi*resolved
      modes%limit = 2*pi*min(mode_limit, resolved/resolution)
      do i = 1, size(modes%modes%block)
         call add_bearing_losses(modes%modes%block(i), bearing, air, modes%limit, failed)
         if (.not. failed) cycle
         error = numerical_error('the losses of modes cannot be separated; allowed: other loss factors', group)
         return
      end do
      associate (block => modes%modes%block)
         modes%omega = [(block(i)%omega, i=1, size(block))]
         modes%loss_factor = [(block(i)%loss_factor, i=1, size(block))]
      end associate
   end subroutine get_floor_modes

   !> The error of a floor of which no mode is resolved.
   function get_unresolved(group, stack) result(error)
      character(len=*), intent(in) :: group
      type(plate_stack_type), intent(in) :: stack
      type(error_type) :: error

      error = input_error('= '//to_text(stack%length)//' m and width = '//to_text(stack%width)//' m need too many ' &
         //'functions to resolve the lowest mode; allowed: a smaller part of the floor, joists farther apart (spacing), ' &
         //'stiffer plates, or support = simple', group, 'length')
   end function get_unresolved

   !> Adds losses of the bearing plate, and mixes modes below a limit by their losses.
   subroutine add_bearing_losses(block, bearing, air, limit, failed)
      type(mode_block_type), intent(inout) :: block
      !> The bearing plate, with its total losses.
      type(plate_type), intent(in) :: bearing
      type(air_type), intent(in) :: air
      !> Angular frequency, rad/s.
      real(wp), intent(in) :: limit
      !> The modes cannot be mixed.
      logical, intent(out) :: failed
      real(wp) :: added(size(block%omega))
      complex(wp), allocatable :: matrix(:, :)
      integer :: i, j, n

      failed = .false.
      added = get_total_loss(bearing, air, max(block%omega/(2*pi), 1.0_wp)) - bearing%loss_factor
      n = count(block%omega < limit)
      if (n > 1 .and. (allocated(block%damping) .or. allocated(block%bearing))) then
         allocate (matrix(n, n), source=(0.0_wp, 0.0_wp))
         if (allocated(block%damping)) matrix%im = block%damping(:n, :n)
         do j = 1, n
            if (.not. allocated(block%damping)) matrix(j, j)%im = block%loss_factor(j)*block%omega(j)**2
            matrix(j, j)%re = block%omega(j)**2
            ! The losses of two modes differ little, unless these are far apart.
            if (allocated(block%bearing)) then
               matrix(:, j)%im = matrix(:, j)%im + (added(:n) + added(j))/2*block%bearing(:n, j)
            else
               matrix(j, j)%im = matrix(j, j)%im + added(j)*block%bearing_share(j)*block%omega(j)**2
            end if
         end do
         block%pole = block%omega**2*cmplx(1.0_wp, block%loss_factor + block%bearing_share*added, wp)
         allocate (block%mixing(size(block%omega), size(block%omega)), source=(0.0_wp, 0.0_wp))
         do i = n + 1, size(block%omega)
            block%mixing(i, i) = 1.0_wp
         end do
         call diagonalize(matrix, block%pole(:n), block%mixing(:n, :n), failed)
         if (failed) return
      end if
      if (allocated(block%damping)) deallocate (block%damping)
      if (allocated(block%bearing)) deallocate (block%bearing)
      block%loss_factor = block%loss_factor + block%bearing_share*added
   end subroutine add_bearing_losses

   !> Some of the modes of a floor.
   pure function get_selected_modes(modes, is_selected) result(selected)
      type(floor_modes_type), intent(in) :: modes
      !> [n_mode].
      logical, intent(in) :: is_selected(:)
      type(floor_modes_type) :: selected

      selected%stack = modes%stack
      selected%modes = get_some_modes(modes%modes, is_selected)
      selected%omega = pack(modes%omega, is_selected)
      selected%loss_factor = pack(modes%loss_factor, is_selected)
      selected%limit = modes%limit
      selected%sum_limit = modes%sum_limit
   end function get_selected_modes

   !> Squared angular frequencies with their losses, omega**2 (1 + i eta), of mixed modes, rad2/s2: [n_mode].
   pure function get_poles(modes) result(pole)
      type(floor_modes_type), intent(in) :: modes
      complex(wp) :: pole(size(modes%omega))
      integer :: i, n

      pole = modes%omega**2*cmplx(1.0_wp, modes%loss_factor, wp)
      n = 0
      do i = 1, size(modes%modes%block)
         associate (block => modes%modes%block(i))
            if (allocated(block%pole)) pole(n + 1:n + size(block%pole)) = block%pole
            n = n + size(block%omega)
         end associate
      end do
   end function get_poles

   !> Transfer mobility of the upper plate from a source to a point, as poles and residues. Modes above the limit are
   !> residual modes: static compliances, and the conductance of the infinite plate at high frequencies.
   subroutine new_floor_receiver(group, modes, resistance, source, point, receiver, error)
      !> Namelist group, for messages.
      character(len=*), intent(in) :: group
      type(floor_modes_type), intent(in) :: modes
      !> Resistance of the infinite upper plate, N s/m.
      real(wp), intent(in) :: resistance
      !> Positions of source and point, as fractions of length and width: [2].
      real(wp), intent(in) :: source(2), point(2)
      type(receiver_type), intent(out) :: receiver
      !> Set if the losses are too high.
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: value(:, :), gain(:)
      logical, allocatable :: individual(:)
      real(wp) :: compliance, corner
      logical :: has_all

      ! Sums of functions are stopped at a frequency, or have the compliance of all their modes.
      corner = pi/(2*sqrt(2.0_wp))*modes%limit
      has_all = .not. (all(is_uncoupled(modes%stack)) .or. any(has_shear(modes%stack%plate)))
      associate (length => modes%stack%length, width => modes%stack%width, omega => modes%omega, &
         set => modes%modes%displacement(1))
         value = get_mode_values(modes%modes, 1, length*[source(1), point(1)], width*[source(2), point(2)])
         gain = value(:, 1)*value(:, 2)
         individual = omega < modes%limit
         ! The mean mobility alone would take up too little energy: there would be no resonance.
         if (modes%limit < 2*pi*mode_limit .and. .not. any(individual)) then
            error = get_unresolved(group, modes%stack)
            return
         end if
         compliance = sum(gain/max(omega, 1.0_wp)**2, mask=.not. individual .and. (omega < modes%sum_limit .or. has_all))
         ! Shorter waves cancel on average, except at the source.
         if (any(abs(source - point) >= epsilon(1.0_wp))) then
            continue
         else if (has_all) then
            compliance = compliance + get_truncated_compliance(modes%stack%plate(1), &
               get_highest_wavenumber([set%x, set%y]), width*source(2))
         else
            compliance = compliance + 2/(pi*resistance*modes%sum_limit)
         end if
      end associate
      ! With the mode density n(omega) and the compliance 1/(m'' S omega**2) of each (S: area), the residual modes have the
      ! compliance 2/(pi Z limit), averaged over positions; with this corner their conductance is 1/Z at high frequencies.
      ! On a joist the compliance, and so the conductance, is that of joist and plate.
      call new_modal_receiver(group, pack(gain, individual), pack(modes%omega, individual), &
         pack(modes%loss_factor, individual), [compliance, corner], receiver, error)
   end subroutine new_floor_receiver

   !> Sum of modes, gain s/(s**2 + eta omega s + omega**2), and residual modes.
   !>
   !> Modes have viscous damping, with the given loss factor at their frequency. Residual modes have a compliance C at low
   !> frequencies and, above a corner frequency w, the conductance G = sqrt(2) C w:
   !> G (s**2 + w s/sqrt(2))/(s**2 + sqrt(2) w s + w**2). This is passive and absorbs hardly any power below the corner: with
   !> x = omega/w its real part is G x**4/(1 + x**4), its imaginary part omega C (1 + x**2)/(1 + x**4).
   subroutine new_modal_receiver(group, gain, omega, loss_factor, residual, receiver, error)
      !> Namelist group, for messages.
      character(len=*), intent(in) :: group
      !> Product of the mode shapes at source and point, divided by the modal mass, 1/kg: [n].
      real(wp), intent(in) :: gain(:)
      !> Angular frequencies, rad/s, and loss factors: [n].
      real(wp), intent(in) :: omega(:), loss_factor(:)
      !> Compliance, m/N, and corner frequency, rad/s, of the residual modes: [2].
      real(wp), intent(in) :: residual(2)
      type(receiver_type), intent(out) :: receiver
      !> Set if a mode is overdamped: its loss factor is 2 or more.
      type(error_type), allocatable, intent(out) :: error
      complex(wp) :: pole
      integer :: i, n

      i = maxloc(loss_factor, dim=1)
      if (i > 0) then
         if (.not. loss_factor(i) < 2.0_wp) then
            error = input_error('the total loss factor is '//to_text(loss_factor(i))//' at '//fixed(omega(i)/(2*pi), 1) &
               //' Hz; allowed: below 2', group)
            return
         end if
      end if
      n = size(gain)
      allocate (receiver%pole(n + 1), receiver%residue(n + 1))
      do i = 1, n
         if (.not. omega(i) > 0.0_wp) then
            ! A rigid body that nothing holds.
            receiver%pole(i) = 0.0_wp
            receiver%residue(i) = gain(i)
            cycle
         end if
         pole = omega(i)*cmplx(-loss_factor(i)/2, sqrt(1 - (loss_factor(i)/2)**2), wp)
         receiver%pole(i) = pole
         receiver%residue(i) = gain(i)*cmplx(1.0_wp, -pole%re/pole%im, wp)
      end do
      ! Without its direct part G, the quotient is -G (w s/sqrt(2) + w**2)/(s**2 + ...). Its doubled residue at the pole
      ! w (i - 1)/sqrt(2) is -G w (1 - i)/sqrt(2).
      associate (compliance => residual(1), corner => residual(2))
         receiver%direct = sqrt(2.0_wp)*compliance*corner
         receiver%pole(n + 1) = corner*cmplx(-1.0_wp, 1.0_wp, wp)/sqrt(2.0_wp)
         receiver%residue(n + 1) = -receiver%direct*corner*cmplx(1.0_wp, -1.0_wp, wp)/sqrt(2.0_wp)
      end associate
   end subroutine new_modal_receiver

end module thud_floor_modes
