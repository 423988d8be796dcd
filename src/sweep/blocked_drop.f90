!> The drop on a rigid floor, computed only once for samples that differ only in floor and room.
module thud_blocked_drop
   use thud_case, only: case_type
   use thud_compute, only: compute_impact, impact_type, scope_type
   use thud_error, only: error_type
   use thud_field, only: field_type, key_length
   use thud_kinds, only: wp
   use thud_registry, only: floor_names
   implicit none (type, external)
   private

   public :: blocked_type, solve_blocked

   !> The latest drop on a rigid floor, reused for samples that differ only in floor and room.
   type :: blocked_type
      !> All numbers that the drop depends on; not allocated before the first drop: [n_number].
      real(wp), allocatable :: cache_key(:)
      type(impact_type) :: impact
      !> Set if the drop failed.
      type(error_type), allocatable :: error
   end type blocked_type

contains

   !> Computes the drop on a rigid floor, unless it equals the latest one.
   subroutine solve_blocked(case, fields, scope, blocked, error)
      !> The case, checked.
      type(case_type), intent(in) :: case
      !> The keys that the case uses: [n_field].
      type(field_type), intent(in) :: fields(:)
      type(scope_type), intent(in) :: scope
      type(blocked_type), intent(inout) :: blocked
      !> Set if the drop fails.
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: cache_key(:)
      logical :: same

      allocate (cache_key, source=get_cache_key(fields, scope))
      same = allocated(blocked%cache_key)
      if (same) same = size(cache_key) == size(blocked%cache_key)
      if (same) same = .not. any(abs(cache_key - blocked%cache_key) > 0.0_wp)
      if (.not. same) then
         call move_alloc(cache_key, blocked%cache_key)
         call compute_impact(case, scope, blocked%impact, blocked%error)
      end if
      if (allocated(blocked%error)) error = blocked%error
   end subroutine solve_blocked

   !> All numbers that the drop on a rigid floor depends on.
   function get_cache_key(fields, scope) result(cache_key)
      !> The keys that the case uses: [n_field].
      type(field_type), intent(in) :: fields(:)
      type(scope_type), intent(in) :: scope
      !> The numbers; those of a list follow their count: [n_number].
      real(wp), allocatable :: cache_key(:)
      integer :: i

      cache_key = [merge(1.0_wp, 0.0_wp, scope%levels)]
      do i = 1, size(fields)
         associate (field => fields(i))
            if (any(field%owner == [character(len=key_length) :: 'floor', 'room', floor_names])) cycle
            if (associated(field%list_value)) then
               cache_key = [cache_key, real(field%list_value%count, wp), field%list_value%values(:field%list_value%count)]
            else
               cache_key = [cache_key, field%get_number()]
            end if
         end associate
      end do
   end function get_cache_key

end module thud_blocked_drop
