!> Bracketed root searches: the Illinois method with bisection as safeguard, and bisection alone. The caller evaluates the
!> function: `advance_search` proposes a trial point, `update_bracket` takes its value.
module thud_zero_search
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: advance_search, bisection_type, is_converged, new_zero_search, update_bracket, zero_search_type

   !> Maximum number of trials of a search.
   integer, parameter :: max_trials = 200

   !> A bracket: the function is positive at the left end and not positive at the right end.
   type :: zero_search_type
      !> Ends of the bracket.
      real(wp) :: left = 0.0_wp, right = 0.0_wp
      !> Next trial point.
      real(wp) :: trial = 0.0_wp
      !> Function values at the ends of the bracket; halved for an end that is kept twice (Illinois).
      real(wp), private :: left_value = 0.0_wp, right_value = 0.0_wp
      !> Which end moved last.
      logical, private :: left_moved_last = .false., right_moved_last = .false.
      !> Number of trials so far.
      integer, private :: n_trial = 0
   end type zero_search_type

   !> Bisection of a bracket to neighboring numbers: `do while (bracket%is_open())`, then `halve` it.
   type :: bisection_type
      !> Ends of the bracket.
      real(wp) :: left = 0.0_wp, right = 0.0_wp
   contains
      procedure :: get_middle
      procedure :: is_open
      procedure :: halve
   end type bisection_type

contains

   !> A bracket from 0 to the end of a step; the function is positive at 0 or just after it.
   pure function new_zero_search(start_value, step, end_value) result(search)
      !> Function value at 0.
      real(wp), intent(in) :: start_value
      !> Length of the step.
      real(wp), intent(in) :: step
      !> Function value at the end of the step, not positive.
      real(wp), intent(in) :: end_value
      type(zero_search_type) :: search

      search%right = step
      search%left_value = start_value
      search%right_value = end_value
   end function new_zero_search

   !> Whether the zero is located to rounding; it lies at `right`.
   pure function is_converged(search) result(converged)
      type(zero_search_type), intent(in) :: search
      logical :: converged

      converged = search%n_trial == max_trials .or. search%right - search%left <= 2*spacing(search%right)
   end function is_converged

   !> Proposes the next trial point.
   pure subroutine advance_search(search)
      type(zero_search_type), intent(inout) :: search

      search%n_trial = search%n_trial + 1
      associate (left => search%left, right => search%right, trial => search%trial)
         trial = right - search%right_value*(right - left)/(search%right_value - search%left_value)
         if (mod(search%n_trial, 8) == 0 .or. .not. (trial > left .and. trial < right)) trial = (left + right)/2
      end associate
   end subroutine advance_search

   !> Takes the function value at the trial point.
   pure subroutine update_bracket(search, value)
      type(zero_search_type), intent(inout) :: search
      real(wp), intent(in) :: value

      if (value > 0.0_wp) then
         search%left = search%trial
         search%left_value = value
         if (search%left_moved_last) search%right_value = search%right_value/2
      else
         search%right = search%trial
         search%right_value = value
         if (search%right_moved_last) search%left_value = search%left_value/2
      end if
      search%left_moved_last = value > 0.0_wp
      search%right_moved_last = .not. search%left_moved_last
   end subroutine update_bracket

   !> Middle of a bracket.
   pure function get_middle(self) result(middle)
      class(bisection_type), intent(in) :: self
      real(wp) :: middle

      middle = (self%left + self%right)/2
   end function get_middle

   !> Whether there is a floating-point number between the ends.
   pure function is_open(self) result(open)
      class(bisection_type), intent(in) :: self
      logical :: open

      open = self%get_middle() > self%left .and. self%get_middle() < self%right
   end function is_open

   !> Keeps one half of a bracket.
   pure subroutine halve(self, keep_right)
      class(bisection_type), intent(inout) :: self
      !> Whether to keep the right half.
      logical, intent(in) :: keep_right

      if (keep_right) then
         self%left = self%get_middle()
      else
         self%right = self%get_middle()
      end if
   end subroutine halve

end module thud_zero_search
