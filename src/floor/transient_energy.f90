!> Transient statistical energy analysis: energies of coupled subsystems after an impact, and the response of the Fast
!> detector. The equations are linear with constant coefficients: the exponential of their matrix gives exact steps.
module thud_transient_energy
   use thud_kinds, only: wp
   use thud_matrix_exponential, only: get_exponential
   implicit none (type, external)
   private

   public :: get_fast_maximum

   !> Rate of the Fast detector, 1/s: its time constant is 0.125 s (IEC 61672-1).
   real(wp), parameter :: fast_rate = 8.0_wp

   !> Time step of the search for the maximum, s: a twentieth of the detector's time constant.
   real(wp), parameter :: search_step = 6.25e-3_wp

   !> Duration of the search, s. A later maximum would need energy that is stored for longer than any room's decay.
   real(wp), parameter :: search_time = 20.0_wp

   !> Tolerance of the time of a maximum, s; the error of the maximum is of second order in it.
   real(wp), parameter :: time_tolerance = 1.0e-13_wp
   !> Maximum number of Newton steps.
   integer, parameter :: max_refine = 60

contains

   !> Maximum of the Fast detector's response y to a weighted sum of energies: dE/dt = -A E,
   !> y' = fast_rate (w.E - y), y(0) = 0.
   pure subroutine get_fast_maximum(loss_matrix, initial_energy, weight, maximum)
      !> A, 1/s; column j has the total loss rate of subsystem j on the diagonal, and elsewhere the negative rates of its
      !> flows to the others: [n, n].
      real(wp), intent(in) :: loss_matrix(:, :)
      !> Initial energies: [n].
      real(wp), intent(in) :: initial_energy(:)
      !> Weights w: [n].
      real(wp), intent(in) :: weight(:)
      !> Maximum of y.
      real(wp), intent(out) :: maximum
      real(wp) :: step(size(initial_energy) + 1, size(initial_energy) + 1)
      real(wp), dimension(size(initial_energy) + 1) :: state, next
      integer :: i

      step = get_exponential(search_step*get_system_matrix(loss_matrix, weight))
      state = [initial_energy, 0.0_wp]
      maximum = 0.0_wp
      do i = 1, nint(search_time/search_step)
         next = matmul(step, state)
         ! At time 0 the slope is zero if no subsystem with a weight has energy yet; the first step may still have a maximum.
         if ((i == 1 .or. get_rise(weight, state) > 0.0_wp) .and. get_rise(weight, next) <= 0.0_wp) then
            call refine(loss_matrix, weight, state, maximum)
            ! The remaining energy cannot raise the detector above this maximum.
            if (maxval(abs(weight))*sum(next(:size(initial_energy))) < maximum) return
         end if
         state = next
      end do
   end subroutine get_fast_maximum

   !> Matrix M of energies and detector: [E, y]' = M [E, y].
   pure function get_system_matrix(loss_matrix, weight) result(matrix)
      !> A: [n, n].
      real(wp), intent(in) :: loss_matrix(:, :)
      !> Weights: [n].
      real(wp), intent(in) :: weight(:)
      !> M: [n + 1, n + 1].
      real(wp) :: matrix(size(weight) + 1, size(weight) + 1)

      associate (n => size(weight))
         matrix(:n, :n) = -loss_matrix
         matrix(:n, n + 1) = 0.0_wp
         matrix(n + 1, :n) = fast_rate*weight
         matrix(n + 1, n + 1) = -fast_rate
      end associate
   end function get_system_matrix

   !> Slope of the response, divided by `fast_rate`: w.E - y.
   pure function get_rise(weight, state) result(rise)
      real(wp), intent(in) :: weight(:)
      !> Energies and response: [n + 1].
      real(wp), intent(in) :: state(:)
      real(wp) :: rise

      rise = dot_product(weight, state(:size(weight))) - state(size(state))
   end function get_rise

   !> Locates the maximum inside a step in which the response turns from rise to fall.
   pure subroutine refine(loss_matrix, weight, state, maximum)
      !> As in `get_fast_maximum`: [n, n], [n].
      real(wp), intent(in) :: loss_matrix(:, :), weight(:)
      !> Energies and response at the beginning of the step: [n + 1].
      real(wp), intent(in) :: state(:)
      !> Maximum so far; replaced by a larger one.
      real(wp), intent(inout) :: maximum
      real(wp) :: matrix(size(state), size(state)), trial(size(state))
      real(wp) :: low, high, offset, rise, next_offset
      integer :: i

      matrix = get_system_matrix(loss_matrix, weight)
      low = 0.0_wp
      high = search_step
      offset = search_step/2
      ! Newton's method for zero slope, with bisection if it leaves the bracket.
      do i = 1, max_refine
         trial = matmul(get_exponential(offset*matrix), state)
         rise = get_rise(weight, trial)
         if (rise > 0.0_wp) then
            low = offset
         else
            high = offset
         end if
         next_offset = offset - rise/get_rise(weight, matmul(matrix, trial))
         if (abs(next_offset - offset) < time_tolerance) exit
         offset = next_offset
         if (.not. (next_offset > low .and. next_offset < high)) offset = (low + high)/2
      end do
      maximum = max(maximum, trial(size(trial)))
   end subroutine refine

end module thud_transient_energy
