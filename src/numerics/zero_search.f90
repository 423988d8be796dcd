!> Search for the end of the step at which a quantity falls to zero, by the Illinois form of regula falsi, safeguarded by
!> bisection. Who searches evaluates the quantity: get a trial length, and narrow the search by its value there.
module thud_zero_search
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: advance_search, is_found, narrow, new_zero_search, zero_search_type

   !> Trials after which a search ends.
   integer, parameter :: max_trials = 200

   !> A search between lengths at which the quantity is positive and not positive.
   type :: zero_search_type
      !> The two lengths.
      real(wp) :: left = 0.0_wp, right = 0.0_wp
      !> Length to be tried next.
      real(wp) :: trial = 0.0_wp
      !> The quantity at the two lengths; of an end that stays twice, less.
      real(wp), private :: left_value = 0.0_wp, right_value = 0.0_wp
      !> Which end moved last.
      logical, private :: left_moved_last = .false., right_moved_last = .false.
      !> Trials so far.
      integer, private :: n_trial = 0
   end type zero_search_type

contains

   !> A search over a step at whose beginning, or just after it, the quantity is positive.
   pure function new_zero_search(start_value, step, end_value) result(search)
      !> The quantity at the beginning.
      real(wp), intent(in) :: start_value
      !> Length of the step.
      real(wp), intent(in) :: step
      !> The quantity at the end, not positive.
      real(wp), intent(in) :: end_value
      type(zero_search_type) :: search

      search%right = step
      search%left_value = start_value
      search%right_value = end_value
   end function new_zero_search

   !> Whether the zero is known to rounding; it lies at `right`.
   pure function is_found(search) result(found)
      type(zero_search_type), intent(in) :: search
      logical :: found

      found = search%n_trial == max_trials .or. search%right - search%left <= 2*spacing(search%right)
   end function is_found

   !> Chooses the next trial length.
   pure subroutine advance_search(search)
      type(zero_search_type), intent(inout) :: search

      search%n_trial = search%n_trial + 1
      associate (left => search%left, right => search%right, trial => search%trial)
         trial = right - search%right_value*(right - left)/(search%right_value - search%left_value)
         if (mod(search%n_trial, 8) == 0 .or. .not. (trial > left .and. trial < right)) trial = (left + right)/2
      end associate
   end subroutine advance_search

   !> Takes the quantity at the trial length into account.
   pure subroutine narrow(search, value)
      type(zero_search_type), intent(inout) :: search
      !> The quantity.
      real(wp), intent(in) :: value

      ! An end that stays twice has its value halved, or regula falsi would creep.
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
   end subroutine narrow

end module thud_zero_search
