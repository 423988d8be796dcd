!> Energy that a force injects into a receiver: in frequency bands by the mobility, 2 int |F|**2 Re Y df, and in all
!> frequencies by the work of the force.
!>
!> Bands: over a step of 1/(2 D), D being the duration of the force, the spectrum of the force is a polynomial of degree 15,
!> to 2e-15. The mobility is a sum of poles. Poles near the step are integrated with the polynomial in closed form, by
!> Legendre functions of the second kind, all others by Gauss-Legendre quadrature, so that narrow resonances cost no more
!> than wide ones. Energies of bands are not taken from a recorded velocity V, 2 int Re(F* V) df: away from resonances Re Y
!> is so small a fraction of |Y| that a delay of a fraction of a sampling interval between F and V exceeds it.
module thud_injected_energy
   use thud_band, only: band_type
   use thud_constants, only: pi
   use thud_error, only: error_type
   use thud_interrupt, only: check_interrupt
   use thud_kinds, only: wp
   use thud_legendre, only: get_gauss_legendre, get_legendre, get_second_legendre
   use thud_receiver, only: advance_receiver, new_receiver_motion, new_receiver_step, receiver_motion_type, &
      receiver_step_type, receiver_type
   implicit none (type, external)
   private

   public :: get_injected_energies, get_mean_conductances, get_total_energy

   !> Quadrature nodes of a frequency step.
   integer, parameter :: n_node = 16

   !> A pole is near if the sum of its distances from both ends of the step, divided by half the step, is at most this. For
   !> other poles the quadrature errs by 3**(-32).
   real(wp), parameter :: near = 3 + 1.0_wp/3

   !> Minimum decay rate, 1/s: an undamped pole has an infinite peak.
   real(wp), parameter :: min_decay = 1.0e-6_wp

   !> Nodes and weights on [-1, 1], and the matrix that turns values at the nodes into Legendre coefficients.
   type :: rule_type
      real(wp) :: node(n_node), weight(n_node), coefficient(0:n_node - 1, n_node)
   end type rule_type

   !> Force from first touch to its end, and the mobility.
   type :: record_type
      !> Samples per second, Hz.
      real(wp) :: sample_rate = 1.0_wp
      !> Force, N: [n_sample].
      real(wp), allocatable :: force(:)
      !> Direct part of the mobility, m/(N s).
      real(wp) :: direct = 0.0_wp
      !> Poles, 1/s, with their conjugates; residues, m/(N s2): [n_pole].
      complex(wp), allocatable :: pole(:), residue(:)
   end type record_type

contains

   !> Energies injected in bands.
   subroutine get_injected_energies(receiver, force, sample_rate, bands, energy, error)
      type(receiver_type), intent(in) :: receiver
      !> Force on the floor, N, zero at the end: [n_sample].
      real(wp), intent(in) :: force(:)
      !> Samples per second, Hz.
      real(wp), intent(in) :: sample_rate
      !> The bands: [n_band].
      type(band_type), intent(in) :: bands(:)
      !> The energies, J: [n_band].
      real(wp), intent(out) :: energy(:)
      !> Set by an interrupt.
      type(error_type), allocatable, intent(out) :: error
      type(record_type) :: record
      type(rule_type) :: rule
      real(wp) :: step
      integer :: i, k, n_step

      energy = 0.0_wp
      if (.not. any(abs(force) > 0.0_wp)) return
      record = new_record(receiver, force, sample_rate)
      rule = new_rule()
      do i = 1, size(bands)
         n_step = ceiling((bands(i)%upper - bands(i)%lower)*2*size(record%force)/sample_rate)
         step = (bands(i)%upper - bands(i)%lower)/n_step
         do k = 1, n_step
            call check_interrupt(error)
            if (allocated(error)) return
            energy(i) = energy(i) + get_step_energy(record, rule, bands(i)%lower + (k - 0.5_wp)*step, step/2)
         end do
      end do
   end subroutine get_injected_energies

   !> Energy injected in all frequencies: work of the force, held for a sampling interval, on the receiver moved by it.
   pure function get_total_energy(receiver, force, sample_rate) result(energy)
      type(receiver_type), intent(in) :: receiver
      !> Force on the floor, N: [n_sample].
      real(wp), intent(in) :: force(:)
      !> Samples per second, Hz.
      real(wp), intent(in) :: sample_rate
      !> The energy, J.
      real(wp) :: energy
      type(receiver_step_type) :: step
      type(receiver_motion_type) :: motion
      real(wp) :: before
      integer :: i

      energy = 0.0_wp
      motion = new_receiver_motion(receiver)
      step = new_receiver_step(receiver, 1/sample_rate)
      do i = 1, size(force)
         before = motion%displacement
         call advance_receiver(step, force(i), motion)
         energy = energy + force(i)*(motion%displacement - before)
      end do
   end function get_total_energy

   !> Band averages of the real part of the mobility, in closed form.
   pure function get_mean_conductances(receiver, bands) result(conductance)
      type(receiver_type), intent(in) :: receiver
      !> The bands: [n_band].
      type(band_type), intent(in) :: bands(:)
      !> The averages, m/(N s): [n_band].
      real(wp) :: conductance(size(bands))
      complex(wp) :: ratio(2)
      integer :: i, k

      conductance = receiver%direct
      if (.not. allocated(receiver%pole)) return
      do i = 1, size(bands)
         associate (low => cmplx(0.0_wp, 2*pi*bands(i)%lower, wp), high => cmplx(0.0_wp, 2*pi*bands(i)%upper, wp))
            do k = 1, size(receiver%pole)
               associate (pole => receiver%pole(k), residue => receiver%residue(k))
                  ratio = [log(high - pole) - log(low - pole), log(high - conjg(pole)) - log(low - conjg(pole))]
                  conductance(i) = conductance(i) &
                     + aimag(residue*ratio(1) + conjg(residue)*ratio(2))/(4*pi*(bands(i)%upper - bands(i)%lower))
               end associate
            end do
         end associate
      end do
   end function get_mean_conductances

   !> Nodes, weights and Legendre coefficients.
   pure function new_rule() result(rule)
      type(rule_type) :: rule
      real(wp), dimension(0:n_node - 1) :: value, first, second
      integer :: j, n

      call get_gauss_legendre(rule%node, rule%weight)
      do j = 1, n_node
         call get_legendre(rule%node(j), value, first, second)
         rule%coefficient(:, j) = [((n + 0.5_wp)*rule%weight(j)*value(n), n=0, n_node - 1)]
      end do
   end function new_rule

   !> Record of a force and the mobility under it.
   pure function new_record(receiver, force, sample_rate) result(record)
      type(receiver_type), intent(in) :: receiver
      !> The force, N: [n_sample].
      real(wp), intent(in) :: force(:)
      real(wp), intent(in) :: sample_rate
      type(record_type) :: record

      associate (acts => abs(force) > 0.0_wp)
         record%force = force(findloc(acts, .true., dim=1):findloc(acts, .true., dim=1, back=.true.))
      end associate
      record%sample_rate = sample_rate
      record%direct = receiver%direct
      allocate (record%pole(0), record%residue(0))
      if (.not. allocated(receiver%pole)) return
      associate (pole => cmplx(min(receiver%pole%re, -min_decay), receiver%pole%im, wp))
         record%pole = [pole, conjg(pole)]
      end associate
      ! Half of a doubled residue belongs to the conjugate pole; both halves of a real residue are equal.
      record%residue = [receiver%residue, conjg(receiver%residue)]/2
   end function new_record

   !> Energy in a frequency step.
   pure function get_step_energy(record, rule, middle, half) result(energy)
      type(record_type), intent(in) :: record
      type(rule_type), intent(in) :: rule
      !> Middle and half length of the step, Hz.
      real(wp), intent(in) :: middle, half
      !> The energy, J.
      real(wp) :: energy
      complex(wp), dimension(n_node) :: s, mobility
      real(wp), dimension(n_node) :: square
      real(wp) :: by_square(0:n_node - 1)
      complex(wp) :: second(0:n_node - 1)
      complex(wp) :: z
      integer :: k

      s = cmplx(0.0_wp, 2*pi*(middle + half*rule%node), wp)
      square = abs(get_sums(record%force, exp(-s/record%sample_rate))/record%sample_rate)**2
      by_square = matmul(rule%coefficient, square)
      mobility = record%direct
      energy = 0.0_wp
      do k = 1, size(record%pole)
         associate (pole => record%pole(k), residue => record%residue(k))
            z = (cmplx(pole%im, -pole%re, wp)/(2*pi) - middle)/half
            if (abs(z - 1) + abs(z + 1) > near) then
               mobility = mobility + residue/(s - pole)
            else
               call get_second_legendre(z, second)
               energy = energy - 2/pi*aimag(residue*sum(second*by_square))
            end if
         end associate
      end do
      energy = energy + 2*half*sum(rule%weight*square*real(mobility, wp))
   end function get_step_energy

   !> Sums of sample(i) phase_factor**(i - 1), by Horner's scheme: [n_node].
   pure function get_sums(sample, phase_factor) result(total)
      !> The samples: [n_sample].
      real(wp), intent(in) :: sample(:)
      !> Phase factor of one sample: [n_node].
      complex(wp), intent(in) :: phase_factor(n_node)
      complex(wp) :: total(n_node)
      real(wp), dimension(n_node) :: factor_re, factor_im, re, im, next
      integer :: i

      factor_re = phase_factor%re
      factor_im = phase_factor%im
      re = 0.0_wp
      im = 0.0_wp
      do i = size(sample), 1, -1
         next = re*factor_re - im*factor_im + sample(i)
         im = re*factor_im + im*factor_re
         re = next
      end do
      total = cmplx(re, im, wp)
   end function get_sums

end module thud_injected_energy
