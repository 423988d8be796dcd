!> Energy that a force injects into a receiver in frequency bands, computed twice. Both results integrate 2 Re(F* V) over
!> the band: by the motion with the recorded velocity V of the floor, by the mobility with V = Y F.
!>
!> Over a step of 1/(2 D), D being the duration of the force, the spectrum of the force is a polynomial of degree 15, to
!> 2e-15. The mobility is a sum of poles. Poles near the step are integrated with the polynomial in closed form, by Legendre
!> functions of the second kind, all others by Gauss-Legendre quadrature, so that narrow resonances cost no more than wide
!> ones. After the record, the floor moves freely; the transform of this motion is known in closed form.
module thud_injected_energy
   use thud_band, only: band_type
   use thud_constants, only: pi
   use thud_error, only: error_type
   use thud_interrupt, only: check_interrupt
   use thud_kinds, only: wp
   use thud_legendre, only: get_gauss_legendre, get_legendre, get_second_legendre
   use thud_phi, only: get_phi
   use thud_receiver, only: advance_receiver, new_receiver_motion, new_receiver_step, receiver_motion_type, &
      receiver_step_type, receiver_type
   implicit none (type, external)
   private

   public :: get_injected_energies, get_mean_conductances

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

   !> Force and velocity from first touch on, and the receiver with its motion at the end of the force.
   type :: record_type
      !> Samples per second, Hz.
      real(wp) :: sample_rate = 1.0_wp
      !> Force, N: [up to its end]; velocity, m/s: [to the end of the record].
      real(wp), allocatable :: force(:), velocity(:)
      !> Direct part of the mobility, m/(N s).
      real(wp) :: direct = 0.0_wp
      !> Poles, 1/s, with their conjugates; residues, m/(N s2); velocities at the ends of force and record, m/s: [n_pole].
      complex(wp), allocatable :: pole(:), residue(:), end_of_force(:), end_of_record(:)
   end type record_type

contains

   !> Energies injected in bands.
   subroutine get_injected_energies(receiver, force, velocity, sample_rate, bands, by_motion, by_mobility, error)
      type(receiver_type), intent(in) :: receiver
      !> Force on the floor, N, zero at the end; velocity of the floor, m/s: [n_sample].
      real(wp), intent(in) :: force(:), velocity(:)
      !> Samples per second, Hz.
      real(wp), intent(in) :: sample_rate
      !> The bands: [n_band].
      type(band_type), intent(in) :: bands(:)
      !> Energy by the velocity, J; by the mobility, J: [n_band].
      real(wp), intent(out) :: by_motion(:), by_mobility(:)
      !> Set by an interrupt.
      type(error_type), allocatable, intent(out) :: error
      type(record_type) :: record
      type(rule_type) :: rule
      real(wp) :: energy(2)
      real(wp) :: step
      integer :: i, k, n_step

      by_motion = 0.0_wp
      by_mobility = 0.0_wp
      if (.not. any(abs(force) > 0.0_wp)) return
      record = new_record(receiver, force, velocity, sample_rate)
      rule = new_rule()
      do i = 1, size(bands)
         n_step = ceiling((bands(i)%upper - bands(i)%lower)*2*size(record%force)/sample_rate)
         step = (bands(i)%upper - bands(i)%lower)/n_step
         do k = 1, n_step
            call check_interrupt(error)
            if (allocated(error)) return
            energy = get_step_energies(record, rule, bands(i)%lower + (k - 0.5_wp)*step, step/2)
            by_motion(i) = by_motion(i) + energy(1)
            by_mobility(i) = by_mobility(i) + energy(2)
         end do
      end do
   end subroutine get_injected_energies

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

   !> Record of a force and of the motion of its floor, from first touch on.
   pure function new_record(receiver, force, velocity, sample_rate) result(record)
      type(receiver_type), intent(in) :: receiver
      !> The force, N, and the velocity of the floor, m/s: [n_sample].
      real(wp), intent(in) :: force(:), velocity(:)
      real(wp), intent(in) :: sample_rate
      type(record_type) :: record
      type(receiver_step_type) :: step
      type(receiver_motion_type) :: motion
      complex(wp), allocatable :: pole(:)
      integer :: first, last, i

      first = findloc(abs(force) > 0.0_wp, .true., dim=1)
      last = min(findloc(abs(force) > 0.0_wp, .true., dim=1, back=.true.) + 1, size(force))
      record%sample_rate = sample_rate
      record%force = force(first:last)
      record%velocity = velocity(first:)
      record%direct = receiver%direct
      motion = new_receiver_motion(receiver)
      step = new_receiver_step(receiver, 1/sample_rate)
      do i = max(first, 2), last
         call advance_receiver(receiver, step, (force(i - 1) + force(i))/2, motion)
      end do
      allocate (pole(0), record%residue(0), record%end_of_force(0))
      if (allocated(receiver%pole)) then
         pole = cmplx(min(receiver%pole%re, -min_decay), receiver%pole%im, wp)
         ! Half of a doubled residue belongs to the conjugate pole; both halves of a real residue are equal.
         record%residue = [receiver%residue, conjg(receiver%residue)]/2
         record%end_of_force = record%residue*[motion%amplitude, conjg(motion%amplitude)]
      end if
      record%pole = [pole, conjg(pole)]
      record%end_of_record = record%end_of_force*exp(record%pole*((size(force) - last)/sample_rate))
   end function new_record

   !> Energies in a frequency step.
   pure function get_step_energies(record, rule, middle, half) result(energy)
      type(record_type), intent(in) :: record
      type(rule_type), intent(in) :: rule
      !> Middle and half length of the step, Hz.
      real(wp), intent(in) :: middle, half
      !> By the motion and by the mobility, J: [2].
      real(wp) :: energy(2)
      complex(wp), dimension(n_node) :: s, phase_factor, end_factor, force, velocity, mobility
      complex(wp), dimension(0:n_node - 1) :: by_force, by_square, second
      complex(wp) :: z, started
      integer :: k

      s = cmplx(0.0_wp, 2*pi*(middle + half*rule%node), wp)
      phase_factor = exp(-s/record%sample_rate)
      associate (duration => (size(record%force) - 1)/record%sample_rate, &
                 record_time => (size(record%velocity) - 1)/record%sample_rate)
         end_factor = exp(-s*record_time)
         force = get_sums(record%force, phase_factor)/record%sample_rate
         velocity = get_recorded_velocity(record, s, phase_factor, end_factor)
         mobility = record%direct
         by_force = matmul(rule%coefficient, conjg(force))
         by_square = matmul(rule%coefficient, abs(force)**2)
         energy = 0.0_wp
         do k = 1, size(record%pole)
            associate (pole => record%pole(k), residue => record%residue(k))
               z = (cmplx(pole%im, -pole%re, wp)/(2*pi) - middle)/half
               if (abs(z - 1) + abs(z + 1) > near) then
                  mobility = mobility + residue/(s - pole)
                  velocity = velocity + record%end_of_record(k)*end_factor/(s - pole)
               else
                  ! Motion after the record: free decay extended back to the start of the record, minus its recorded part.
                  started = record%end_of_force(k)*exp(-pole*duration)
                  velocity = velocity - started*record_time*get_phi_1((pole - s)*record_time)
                  call get_second_legendre(z, second)
                  energy = energy - 2/pi*aimag([started*sum(second*by_force), residue*sum(second*by_square)])
               end if
            end associate
         end do
      end associate
      energy = energy + 2*half*[sum(rule%weight*real(conjg(force)*velocity, wp)), &
                                sum(rule%weight*abs(force)**2*real(mobility, wp))]
   end function get_step_energies

   !> Transform of the velocity up to the end of the record, by the trapezoidal rule with end correction.
   pure function get_recorded_velocity(record, s, phase_factor, end_factor) result(velocity)
      type(record_type), intent(in) :: record
      !> Frequencies i w, 1/s; exp(-s t) after one sample and after the record: [n_node].
      complex(wp), intent(in) :: s(n_node), phase_factor(n_node), end_factor(n_node)
      !> The transform, m: [n_node].
      complex(wp) :: velocity(n_node)
      real(wp) :: acceleration

      acceleration = real(sum(record%pole*record%end_of_record), wp)
      associate (final => record%velocity(size(record%velocity)), rate => record%sample_rate)
         velocity = (get_sums(record%velocity, phase_factor) - end_factor*final/2)/rate &
            - end_factor*(acceleration - s*final)/(12*rate**2)
      end associate
   end function get_recorded_velocity

   !> (exp z - 1)/z.
   pure elemental function get_phi_1(z) result(phi_1)
      !> Argument whose real part is not large.
      complex(wp), intent(in) :: z
      complex(wp) :: phi_1
      complex(wp) :: phi(0:1)

      phi = get_phi(z, 1)
      phi_1 = phi(1)
   end function get_phi_1

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
