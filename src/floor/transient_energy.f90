!> Transient statistical energy analysis: energies of coupled subsystems after an impact, and the output of a Fast detector.
!> The equations are linear with constant coefficients: each step is the exponential of their matrix.
module thud_transient_energy
   use thud_kinds, only: wp
   use thud_matrix_exponential, only: get_exponential
   implicit none (type, external)
   private

   public :: get_fast_maximum, get_fast_history

   !> Rate of the Fast detector, 1/s: its time constant is 0.125 s (IEC 61672-1).
   real(wp), parameter :: fast_rate = 8.0_wp

   !> Step of the search for the maximum, s: the detector moves by a twentieth of its time constant.
   real(wp), parameter :: search_step = 6.25e-3_wp

   !> Duration of the search, s. A later maximum would need energy that is held back for longer than any room's decay.
   real(wp), parameter :: search_time = 20.0_wp

   !> Error of the time of a maximum, s; the error of the maximum is of second order. Maximum number of Newton's steps.
   real(wp), parameter :: time_error = 1.0e-13_wp
   integer, parameter :: max_refine = 60

contains

   !> Maximum of the Fast detector on a weighted sum of energies, dE/dt = -A E, y' = 8/s (w.E - y), y(0) = 0.
   pure subroutine get_fast_maximum(loss, start, weight, maximum, time)
      !> A, 1/s; column j has the losses of subsystem j on the diagonal and their targets: [n, n].
      real(wp), intent(in) :: loss(:, :)
      !> Energies at the start: [n].
      real(wp), intent(in) :: start(:)
      !> Weights w: [n].
      real(wp), intent(in) :: weight(:)
      !> Maximum of y, and its time, s.
      real(wp), intent(out) :: maximum, time
      real(wp) :: step(size(start) + 1, size(start) + 1)
      real(wp), dimension(size(start) + 1) :: state, next
      integer :: i

      step = get_exponential(search_step*get_detector(loss, weight))
      state = [start, 0.0_wp]
      maximum = 0.0_wp
      time = 0.0_wp
      do i = 1, nint(search_time/search_step)
         next = matmul(step, state)
         ! At the start the detector is at rest, and may reach its maximum within the first step.
         if ((i == 1 .or. get_rise(weight, state) > 0.0_wp) .and. get_rise(weight, next) <= 0.0_wp) then
            call refine(loss, weight, state, (i - 1)*search_step, maximum, time)
            ! The remaining energy cannot raise the detector above the maximum.
            if (maxval(abs(weight))*sum(next(:size(start))) < maximum) return
         end if
         state = next
      end do
   end subroutine get_fast_maximum

   !> Detector on a weighted sum of energies, at equal steps.
   pure function get_fast_history(loss, start, weight, interval, n_step) result(detector)
      !> As in `get_fast_maximum`: [n, n], [n], [n].
      real(wp), intent(in) :: loss(:, :), start(:), weight(:)
      !> Length of a step, s.
      real(wp), intent(in) :: interval
      integer, intent(in) :: n_step
      !> The detector's y at the end of each step: [n_step].
      real(wp) :: detector(n_step)
      real(wp) :: step(size(start) + 1, size(start) + 1), state(size(start) + 1)
      integer :: i

      step = get_exponential(interval*get_detector(loss, weight))
      state = [start, 0.0_wp]
      do i = 1, n_step
         state = matmul(step, state)
         detector(i) = state(size(state))
      end do
   end function get_fast_history

   !> Matrix of energies and detector together.
   pure function get_detector(loss, weight) result(matrix)
      !> A: [n, n].
      real(wp), intent(in) :: loss(:, :)
      !> Weights: [n].
      real(wp), intent(in) :: weight(:)
      !> Of the derivative of [E, y]: [n + 1, n + 1].
      real(wp) :: matrix(size(weight) + 1, size(weight) + 1)

      associate (n => size(weight))
         matrix(:n, :n) = -loss
         matrix(:n, n + 1) = 0.0_wp
         matrix(n + 1, :n) = fast_rate*weight
         matrix(n + 1, n + 1) = -fast_rate
      end associate
   end function get_detector

   !> Sign and size of the detector's change.
   pure function get_rise(weight, state) result(rise)
      real(wp), intent(in) :: weight(:)
      !> Energies and detector: [n + 1].
      real(wp), intent(in) :: state(:)
      real(wp) :: rise

      rise = dot_product(weight, state(:size(weight))) - state(size(state))
   end function get_rise

   !> The maximum inside a step in which the detector stops rising.
   pure subroutine refine(loss, weight, state, begin, maximum, time)
      !> As in `get_fast_maximum`: [n, n], [n].
      real(wp), intent(in) :: loss(:, :), weight(:)
      !> Energies and detector at the beginning of the step: [n + 1].
      real(wp), intent(in) :: state(:)
      !> That time, s.
      real(wp), intent(in) :: begin
      !> Maximum so far and its time, s; replaced by a larger one.
      real(wp), intent(inout) :: maximum, time
      real(wp) :: matrix(size(state), size(state)), middle(size(state))
      real(wp) :: low, high, offset, change
      integer :: i

      matrix = get_detector(loss, weight)
      low = 0.0_wp
      high = search_step
      offset = search_step/2
      ! Newton's steps on the change, halved brackets where they lead astray.
      do i = 1, max_refine
         middle = matmul(get_exponential(offset*matrix), state)
         change = get_rise(weight, middle)
         if (change > 0.0_wp) then
            low = offset
         else
            high = offset
         end if
         change = offset - change/get_rise(weight, matmul(matrix, middle))
         if (abs(change - offset) < time_error) exit
         offset = change
         if (.not. (change > low .and. change < high)) offset = (low + high)/2
      end do
      if (middle(size(middle)) <= maximum) return
      maximum = middle(size(middle))
      time = begin + offset
   end subroutine refine

end module thud_transient_energy
