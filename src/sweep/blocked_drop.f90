!> The drop on a rigid floor, computed once for drops that differ in floor and room only.
module thud_blocked_drop
   use thud_case, only: case_type, get_model_number
   use thud_compute, only: judge_case, verdict_type
   use thud_error, only: error_type
   use thud_field, only: field_type, key_length
   use thud_force_history, only: force_history_type
   use thud_kinds, only: wp
   use thud_registry, only: floor_names
   implicit none (type, external)
   private

   public :: blocked_type, solve_blocked

   !> The drop on a rigid floor that serves again while only floor and room differ.
   type :: blocked_type
      !> All numbers that it hangs on; not allocated before the first: [n_number].
      real(wp), allocatable :: signature(:)
      type(force_history_type) :: history
      type(verdict_type) :: verdict
      !> The drop failed.
      type(error_type), allocatable :: error
   end type blocked_type

contains

   !> The drop on a rigid floor, unless the one before was the same.
   subroutine solve_blocked(case, fields, judged, blocked, error)
      !> The case, checked.
      type(case_type), intent(in) :: case
      !> The keys that it uses: [n_field].
      type(field_type), intent(in) :: fields(:)
      !> Levels and verdict are wanted.
      logical, intent(in) :: judged
      type(blocked_type), intent(inout) :: blocked
      !> The drop failed.
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: signature(:)
      logical :: same

      allocate (signature, source=get_signature(fields, judged))
      same = allocated(blocked%signature)
      if (same) same = size(signature) == size(blocked%signature)
      if (same) same = .not. any(abs(signature - blocked%signature) > 0.0_wp)
      if (.not. same) then
         call move_alloc(signature, blocked%signature)
         associate (model => case%models(get_model_number(case))%model)
            call model%solve(case%ball, case%drop, case%sampling, blocked%history, blocked%error)
         end associate
         if (judged .and. .not. allocated(blocked%error)) call judge_case(case, blocked%history, blocked%verdict, &
            blocked%error)
      end if
      if (allocated(blocked%error)) error = blocked%error
   end subroutine solve_blocked

   !> All numbers of the keys that the drop on a rigid floor hangs on.
   function get_signature(fields, judged) result(signature)
      !> The keys that the case uses: [n_field].
      type(field_type), intent(in) :: fields(:)
      !> Levels and verdict are wanted.
      logical, intent(in) :: judged
      !> The numbers, of lists with their count: [n_number].
      real(wp), allocatable :: signature(:)
      integer :: i

      signature = [merge(1.0_wp, 0.0_wp, judged)]
      do i = 1, size(fields)
         associate (field => fields(i))
            if (any(field%owner == [character(len=key_length) :: 'floor', 'room', floor_names])) cycle
            if (associated(field%list_value)) then
               signature = [signature, real(field%list_value%count, wp), field%list_value%values(:field%list_value%count)]
            else
               signature = [signature, field%get_number()]
            end if
         end associate
      end do
   end function get_signature

end module thud_blocked_drop
