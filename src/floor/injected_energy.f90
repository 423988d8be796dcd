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

   public :: get_injected_energies, get_mean_conductances, get_spectrum, get_total_energy

   !> Quadrature nodes of a frequency step.
   integer, parameter :: n_node = 16

   !> A pole is near if the sum of its distances from both ends of the step, divided by half the step, is at most this. For
   !> other poles the quadrature errs by 3**(-32).
   real(wp), parameter :: near = 3 + 1.0_wp/3

   !> Minimum decay rate, 1/s: an undamped pole has an infinite peak.
   real(wp), parameter :: min_decay = 1.0e-6_wp

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
      type(receiver_type) :: complete
      ! Nodes and weights on [-1, 1], and the matrix that turns values at the nodes into Legendre coefficients.
      real(wp) :: node(n_node), weight(n_node), coefficient(0:n_node - 1, n_node)
      real(wp), dimension(0:n_node - 1) :: value, first_derivative, second_derivative
      real(wp) :: step
      integer :: first, last, i, k, n_step

      energy = 0.0_wp
      first = findloc(abs(force) > 0.0_wp, .true., dim=1)
      last = findloc(abs(force) > 0.0_wp, .true., dim=1, back=.true.)
      if (first == 0) return
      complete = with_conjugates(receiver)
      complete%pole%re = min(complete%pole%re, -min_decay)
      call get_gauss_legendre(node, weight)
      do k = 1, n_node
         call get_legendre(node(k), value, first_derivative, second_derivative)
         coefficient(:, k) = [((i + 0.5_wp)*weight(k)*value(i), i=0, n_node - 1)]
      end do
      do i = 1, size(bands)
         n_step = ceiling((bands(i)%upper - bands(i)%lower)*2*(last - first + 1)/sample_rate)
         step = (bands(i)%upper - bands(i)%lower)/n_step
         do k = 1, n_step
            call check_interrupt(error)
            if (allocated(error)) return
            energy(i) = energy(i) + get_step_energy(bands(i)%lower + (k - 0.5_wp)*step, step/2)
         end do
      end do
   contains

      !> Energy in a frequency step.
      pure function get_step_energy(middle, half) result(step_energy)
         !> Middle and half length of the step, Hz.
         real(wp), intent(in) :: middle, half
         !> The energy, J.
         real(wp) :: step_energy
         complex(wp), dimension(n_node) :: s, mobility
         real(wp), dimension(n_node) :: frequency, square
         real(wp) :: by_square(0:n_node - 1)
         complex(wp) :: second(0:n_node - 1)
         complex(wp) :: z
         integer :: j

         frequency = middle + half*node
         s = cmplx(0.0_wp, 2*pi*frequency, wp)
         square = abs(get_spectrum(force(first:last), sample_rate, frequency))**2
         by_square = matmul(coefficient, square)
         mobility = complete%direct
         step_energy = 0.0_wp
         do j = 1, size(complete%pole)
            associate (pole => complete%pole(j), residue => complete%residue(j))
               z = (cmplx(pole%im, -pole%re, wp)/(2*pi) - middle)/half
               if (abs(z - 1) + abs(z + 1) > near) then
                  mobility = mobility + residue/(s - pole)
               else
                  call get_second_legendre(z, second)
                  step_energy = step_energy - 2/pi*aimag(residue*sum(second*by_square))
               end if
            end associate
         end do
         step_energy = step_energy + 2*half*sum(weight*square*real(mobility, wp))
      end function get_step_energy
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
      type(receiver_type) :: complete
      integer :: i

      complete = with_conjugates(receiver)
      do i = 1, size(bands)
         associate (low => cmplx(0.0_wp, 2*pi*bands(i)%lower, wp), high => cmplx(0.0_wp, 2*pi*bands(i)%upper, wp), &
            pole => complete%pole)
            conductance(i) = complete%direct + sum(aimag(complete%residue*(log(high - pole) - log(low - pole)))) &
               /(2*pi*(bands(i)%upper - bands(i)%lower))
         end associate
      end do
   end function get_mean_conductances

   !> The receiver with the conjugates of its poles as poles of their own.
   pure function with_conjugates(receiver) result(complete)
      type(receiver_type), intent(in) :: receiver
      type(receiver_type) :: complete

      complete%direct = receiver%direct
      allocate (complete%pole(0), complete%residue(0))
      if (.not. allocated(receiver%pole)) return
      complete%pole = [receiver%pole, conjg(receiver%pole)]
      ! Half of a doubled residue belongs to the conjugate pole; both halves of a real residue are equal.
      complete%residue = [receiver%residue, conjg(receiver%residue)]/2
   end function with_conjugates

   !> Fourier transform of a force at frequencies, N s: [n]. It is a polynomial in the phase factor of a sample, summed by
   !> Horner's scheme.
   pure function get_spectrum(force, sample_rate, frequency) result(spectrum)
      !> The force, N: [n_sample].
      real(wp), intent(in) :: force(:)
      !> Samples per second, Hz.
      real(wp), intent(in) :: sample_rate
      !> The frequencies, Hz: [n].
      real(wp), intent(in) :: frequency(:)
      complex(wp) :: spectrum(size(frequency))
      ! So many at once stay in registers.
      real(wp), dimension(n_node) :: angle, re, im, next
      integer :: i, first, n

      do first = 1, size(frequency), n_node
         n = min(n_node, size(frequency) - first + 1)
         angle = 0.0_wp
         angle(:n) = -2*pi*frequency(first:first + n - 1)/sample_rate
         re = 0.0_wp
         im = 0.0_wp
         associate (factor_re => cos(angle), factor_im => sin(angle))
            do i = size(force), 1, -1
               next = re*factor_re - im*factor_im + force(i)
               im = re*factor_im + im*factor_re
               re = next
            end do
         end associate
         spectrum(first:first + n - 1) = cmplx(re(:n), im(:n), wp)/sample_rate
      end do
   end function get_spectrum

end module thud_injected_energy
