!> Energy that a force gives to a receiver in frequency bands, by the motion and by the mobility: both are the integral
!> over the band of 2 Re(F* V), by the velocity V that the floor had, and by V = Y F.
!>
!> The floor swings on after the record: its velocity then is that of the receiver, whose transform is known in closed
!> form. Bands are cut into steps that are short against the distance of the nearest pole and against the inverse of the
!> contact time, each with a Gauss-Legendre quadrature.
module thud_injected_energy
   use thud_band, only: band_type
   use thud_constants, only: pi
   use thud_kinds, only: wp
   use thud_legendre, only: get_gauss_legendre
   use thud_receiver, only: advance_receiver, get_mobility, new_receiver_motion, new_receiver_step, receiver_motion_type, &
      receiver_step_type, receiver_type
   implicit none (type, external)
   private

   public :: get_injected_energies, get_mean_conductances

   !> Nodes of a step: half as long as the distance of the nearest pole it has it in an ellipse of at least 3 + sqrt(8)
   !> around, so that 8 nodes err by 1e-12.
   integer, parameter :: n_node = 8

   !> Least rate of decay, 1/s. Narrower peaks are widened to it: the spectrum of a contact changes by less than 1e-5 over
   !> so narrow a one.
   real(wp), parameter :: min_decay = 1.0e-3_wp

   !> Samples of a record at one frequency: transforms of force and velocity.
   type :: pair_type
      complex(wp) :: force, velocity
   end type pair_type

contains

   !> Energies in bands.
   subroutine get_injected_energies(receiver, force, velocity, sample_rate, bands, by_motion, by_mobility)
      type(receiver_type), intent(in) :: receiver
      !> Force on the floor, N, zero at the end; velocity of the floor, m/s: [n_sample].
      real(wp), intent(in) :: force(:), velocity(:)
      !> Samples per second, Hz.
      real(wp), intent(in) :: sample_rate
      !> The bands: [n_band].
      type(band_type), intent(in) :: bands(:)
      !> Energy by the velocity, J; by the mobility, J: [n_band].
      real(wp), intent(out) :: by_motion(:), by_mobility(:)
      type(receiver_type) :: damped
      type(receiver_motion_type) :: motion
      type(pair_type) :: pair
      complex(wp) :: mobility(1)
      real(wp) :: node(n_node), weight(n_node)
      real(wp) :: begin, step, frequency, contact
      integer :: i, k

      call get_gauss_legendre(node, weight)
      damped = get_damped(receiver)
      motion = get_last_motion(receiver, force, sample_rate)
      contact = count(abs(force) > 0.0_wp)/sample_rate
      by_motion = 0.0_wp
      by_mobility = 0.0_wp
      do i = 1, size(bands)
         begin = bands(i)%lower
         do while (begin < bands(i)%upper)
            step = min(bands(i)%upper - begin, get_step(damped, begin, contact))
            do k = 1, n_node
               frequency = begin + step*(1 + node(k))/2
               pair = get_pair(damped, motion, force, velocity, sample_rate, frequency)
               mobility = get_mobility(damped, [frequency])
               by_motion(i) = by_motion(i) + step*weight(k)*real(conjg(pair%force)*pair%velocity, wp)
               by_mobility(i) = by_mobility(i) + step*weight(k)*abs(pair%force)**2*real(mobility(1), wp)
            end do
            begin = begin + step
         end do
      end do
   end subroutine get_injected_energies

   !> Means of the real part of the mobility over bands, in closed form.
   pure function get_mean_conductances(receiver, bands) result(conductance)
      type(receiver_type), intent(in) :: receiver
      !> The bands: [n_band].
      type(band_type), intent(in) :: bands(:)
      !> The means, m/(N s): [n_band].
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

   !> A receiver whose peaks can be resolved.
   pure function get_damped(receiver) result(damped)
      type(receiver_type), intent(in) :: receiver
      !> The same, poles decay at the least rate.
      type(receiver_type) :: damped

      damped%direct = receiver%direct
      allocate (damped%pole(0), damped%residue(0))
      if (.not. allocated(receiver%pole)) return
      damped%pole = cmplx(min(receiver%pole%re, -min_decay), receiver%pole%im, wp)
      damped%residue = receiver%residue
   end function get_damped

   !> Motion of a receiver at the end of a force.
   pure function get_last_motion(receiver, force, sample_rate) result(motion)
      type(receiver_type), intent(in) :: receiver
      !> The force, N: [n_sample].
      real(wp), intent(in) :: force(:)
      !> Samples per second, Hz.
      real(wp), intent(in) :: sample_rate
      type(receiver_motion_type) :: motion
      type(receiver_step_type) :: step
      integer :: i

      motion = new_receiver_motion(receiver)
      step = new_receiver_step(receiver, 1/sample_rate)
      do i = 2, size(force)
         call advance_receiver(receiver, step, (force(i - 1) + force(i))/2, motion)
      end do
   end function get_last_motion

   !> Length of a step over a band.
   pure function get_step(receiver, frequency, contact) result(step)
      type(receiver_type), intent(in) :: receiver
      !> Where the step begins, Hz.
      real(wp), intent(in) :: frequency
      !> Contact time, s.
      real(wp), intent(in) :: contact
      !> Its length, Hz.
      real(wp) :: step
      integer :: k

      step = 1/(2*contact)
      do k = 1, size(receiver%pole)
         step = min(step, abs(cmplx(0.0_wp, 2*pi*frequency, wp) - receiver%pole(k))/(4*pi))
      end do
   end function get_step

   !> Transforms of force and velocity at one frequency, the latter with what follows the record.
   pure function get_pair(receiver, motion, force, velocity, sample_rate, frequency) result(pair)
      type(receiver_type), intent(in) :: receiver
      !> At the end of the record.
      type(receiver_motion_type), intent(in) :: motion
      !> Force, N, and velocity, m/s: [n_sample].
      real(wp), intent(in) :: force(:), velocity(:)
      !> Samples per second, and the frequency, Hz.
      real(wp), intent(in) :: sample_rate, frequency
      type(pair_type) :: pair
      complex(wp) :: turn, last, s
      real(wp) :: acceleration
      integer :: i, n

      n = size(force)
      s = cmplx(0.0_wp, 2*pi*frequency, wp)
      turn = exp(-s/sample_rate)
      last = exp(-s*(n - 1)/sample_rate)
      pair = pair_type(cmplx(force(n), kind=wp), cmplx(velocity(n)/2, kind=wp))
      do i = n - 1, 1, -1
         pair%force = pair%force*turn + force(i)
         pair%velocity = pair%velocity*turn + velocity(i)
      end do
      acceleration = sum(real(receiver%pole*receiver%residue*motion%amplitude, wp))
      pair%force = pair%force/sample_rate
      ! The trapezoidal rule with the correction of its end, then the decay.
      pair%velocity = pair%velocity/sample_rate - last*(acceleration - s*velocity(n))/(12*sample_rate**2) &
         + last*sum(receiver%residue*motion%amplitude/(s - receiver%pole) &
         + conjg(receiver%residue*motion%amplitude)/(s - conjg(receiver%pole)))/2
   end function get_pair

end module thud_injected_energy
