!> Transient statistical energy analysis of one band: the flow of energy between coupled subsystems after an impact, and the
!> maximum that the Fast detector shows.
!>
!> The energies follow dE/dt = -A E with constant coefficients: the exponential of the matrix gives exact steps.
module thud_energy_flow
   use thud_kinds, only: wp
   use thud_lapack, only: dgetf2, dgetrs
   use thud_matrix_exponential, only: get_exponential
   use thud_zero_search, only: advance_search, is_converged, new_zero_search, update_bracket, zero_search_type
   implicit none (type, external)
   private

   public :: connect, decay_of_60_db, energy_flow_type, fast_time, get_entering_energies, get_fast_level, get_fast_maximum
   public :: get_loss_matrix, new_energy_flow, reference_pressure

   !> Reference sound pressure, Pa.
   real(wp), parameter :: reference_pressure = 2.0e-5_wp

   !> Time constant of the Fast detector, s (IEC 61672-1).
   real(wp), parameter :: fast_time = 0.125_wp

   !> Natural logarithm of an energy decay of 60 dB.
   real(wp), parameter :: decay_of_60_db = 6*log(10.0_wp)

   !> Time step of the search for the maximum, s: a twentieth of the detector's time constant.
   real(wp), parameter :: search_step = fast_time/20

   !> Duration of the search, s. A later maximum would need energy that is stored for longer than any room's decay.
   real(wp), parameter :: search_time = 20.0_wp

   !> Subsystems and the flow between them.
   type :: energy_flow_type
      !> Modes per hertz of the subsystems, s: [n].
      real(wp), allocatable :: mode_density(:)
      !> Minimum total loss rates, including the flow to others, 1/s: [n].
      real(wp), allocatable :: total(:)
      !> Minimum rates of the losses that go to no other subsystem, 1/s: [n].
      real(wp), allocatable :: internal_loss(:)
      !> Rate at which energy flows from j to i, 1/s: [n, n].
      real(wp), allocatable :: rate(:, :)
      !> Initial energies, J, and squared sound pressure at the detector per energy, Pa2/J: [n].
      real(wp), allocatable :: energy(:), weight(:)
   end type energy_flow_type

contains

   !> Subsystems without losses, energy and flow between them.
   pure function new_energy_flow(n) result(flow)
      !> Number of subsystems.
      integer, intent(in) :: n
      type(energy_flow_type) :: flow

      allocate (flow%mode_density(n), flow%total(n), flow%internal_loss(n), flow%rate(n, n), flow%energy(n), &
         flow%weight(n), source=0.0_wp)
   end function new_energy_flow

   !> Adds an energy flow from one subsystem to another, and the flow back by reciprocity: n1 a12 = n2 a21.
   pure subroutine connect(flow, from, to, rate)
      !> The subsystems, with their mode densities.
      type(energy_flow_type), intent(inout) :: flow
      !> Indices of the subsystems.
      integer, intent(in) :: from, to
      !> Rate at which energy flows from the first to the second, 1/s.
      real(wp), intent(in) :: rate

      flow%rate(to, from) = flow%rate(to, from) + rate
      flow%rate(from, to) = flow%rate(from, to) + rate*flow%mode_density(from)/flow%mode_density(to)
   end subroutine connect

   !> Matrix A of dE/dt = -A E. The sum of a column is the loss that goes to no subsystem: the total loss minus the flow to
   !> others, but at least the internal loss.
   pure function get_loss_matrix(flow) result(loss_matrix)
      type(energy_flow_type), intent(in) :: flow
      !> A, 1/s: [n, n].
      real(wp) :: loss_matrix(size(flow%total), size(flow%total))
      integer :: i

      loss_matrix = -flow%rate
      do i = 1, size(flow%total)
         loss_matrix(i, i) = max(loss_matrix(i, i) + sum(flow%rate(:, i)) + flow%internal_loss(i), flow%total(i))
      end do
   end function get_loss_matrix

   !> Energies that enter a subsystem from each other one, over all times, J: [n].
   !>
   !> With dE/dt = -A E the integrals of the energies over time are A**-1 E(0).
   pure function get_entering_energies(flow, to) result(entering)
      type(energy_flow_type), intent(in) :: flow
      !> Index of the subsystem.
      integer, intent(in) :: to
      real(wp) :: entering(size(flow%energy))
      real(wp) :: matrix(size(flow%energy), size(flow%energy)), integral(size(flow%energy), 1)
      integer :: pivot(size(flow%energy))
      integer :: info

      matrix = get_loss_matrix(flow)
      integral(:, 1) = flow%energy
      associate (n => size(flow%energy))
         call dgetf2(n, n, matrix, n, pivot, info)
         call dgetrs('N', n, 1, matrix, n, pivot, integral, n, info)
      end associate
      entering = flow%rate(to, :)*integral(:, 1)
   end function get_entering_energies

   !> Maximum Fast level of bands together, dB. The detector is linear in the energies, so the bands are subsystems without
   !> flow between them; the maximum of the sum is at most the sum of the maxima.
   pure function get_fast_level(flows) result(level)
      !> Equally many subsystems in each band: [n_band].
      type(energy_flow_type), intent(in) :: flows(:)
      real(wp) :: level
      real(wp), allocatable :: loss_matrix(:, :)
      integer :: i

      associate (n => size(flows(1)%energy))
         allocate (loss_matrix(n*size(flows), n*size(flows)), source=0.0_wp)
         do i = 1, size(flows)
            loss_matrix(n*(i - 1) + 1:n*i, n*(i - 1) + 1:n*i) = get_loss_matrix(flows(i))
         end do
      end associate
      level = 10*log10(get_fast_maximum(loss_matrix, [(flows(i)%energy, i=1, size(flows))], &
         [(flows(i)%weight, i=1, size(flows))])/reference_pressure**2)
   end function get_fast_level

   !> Maximum of the Fast detector's response y to a weighted sum of energies: dE/dt = -A E, `fast_time` y' = w.E - y,
   !> y(0) = 0.
   pure function get_fast_maximum(loss_matrix, energy, weight) result(maximum)
      !> A, 1/s; column j has the total loss rate of subsystem j on the diagonal, and elsewhere the negative rates of its
      !> flows to the others: [n, n].
      real(wp), intent(in) :: loss_matrix(:, :)
      !> Initial energies, and weights w: [n].
      real(wp), intent(in) :: energy(:), weight(:)
      !> Maximum of y.
      real(wp) :: maximum
      ! [E, y]' = matrix [E, y].
      real(wp), dimension(size(energy) + 1, size(energy) + 1) :: matrix, step
      real(wp), dimension(size(energy) + 1) :: state, next
      integer :: i, n

      n = size(energy)
      matrix(:n, :n) = -loss_matrix
      matrix(:n, n + 1) = 0.0_wp
      matrix(n + 1, :) = [weight, -1.0_wp]/fast_time
      step = get_exponential(search_step*matrix)
      state = [energy, 0.0_wp]
      maximum = 0.0_wp
      do i = 1, nint(search_time/search_step)
         next = matmul(step, state)
         ! At time 0 the slope is zero if no subsystem with a weight has energy yet; the first step may still have a maximum.
         if ((i == 1 .or. dot_product(matrix(n + 1, :), state) > 0.0_wp) &
            .and. dot_product(matrix(n + 1, :), next) <= 0.0_wp) then
            maximum = max(maximum, get_maximum_within(matrix, state))
            ! The remaining energy cannot raise the detector above this maximum.
            if (maxval(abs(weight))*sum(next(:n)) < maximum) return
         end if
         state = next
      end do
   end function get_fast_maximum

   !> Maximum of the detector's response inside a step in which it turns from rise to fall, where its slope is zero.
   pure function get_maximum_within(matrix, state) result(maximum)
      !> Matrix of energies and response, 1/s, and both at the beginning of the step: [n + 1, n + 1], [n + 1].
      real(wp), intent(in) :: matrix(:, :), state(:)
      real(wp) :: maximum
      real(wp) :: trial(size(state))
      type(zero_search_type) :: search

      associate (slope => matrix(size(state), :))
         trial = matmul(get_exponential(search_step*matrix), state)
         search = new_zero_search(dot_product(slope, state), search_step, dot_product(slope, trial))
         do while (.not. is_converged(search))
            call advance_search(search)
            trial = matmul(get_exponential(search%trial*matrix), state)
            call update_bracket(search, dot_product(slope, trial))
         end do
      end associate
      maximum = trial(size(state))
   end function get_maximum_within

end module thud_energy_flow
