!> The flat API for Python to many drops; see `thud_api`.
module thud_ensemble_api
   use thud_bundle, only: bundle_type, leave
   use thud_case, only: case_type
   use thud_case_text, only: read_case
   use thud_column, only: column_type, find_columns
   use thud_error, only: error_type
   use thud_force_history, only: force_count, outcome_count
   use thud_kinds, only: int64, wp
   use thud_many, only: leave_many, many_type, new_many, solve_many, take_many
   use thud_sampling, only: get_sample_count
   use thud_system, only: begin_call, end_call
   use thud_text, only: newline, split
   implicit none (type, external)
   private

   public :: drop_many, size_many

contains

   !> Sizes of the results of many drops, and the time that each takes.
   subroutine size_many(text, names, n_column, status, handle, n_byte, n_value)
      !f2py threadsafe
      !> Text of a namelist file; names of the keys in which the drops differ, with commas between.
      character(len=*), intent(in) :: text, names
      !> Number of these keys.
      integer, intent(in) :: n_column
      !> Status, handle and sizes as in `leave`.
      integer, intent(out) :: status, n_byte, n_value
      integer(int64), intent(out) :: handle
      type(bundle_type), pointer :: bundle
      type(case_type), target :: case
      type(column_type), allocatable :: columns(:)
      type(many_type) :: many
      type(error_type), allocatable :: error

      call begin_call()
      allocate (bundle)
      call read_case(text, 'python', case, error, unchecked=.true.)
      if (.not. allocated(error)) call find_columns(case, split(names, n_column), columns, error)
      if (.not. allocated(error)) then
         call new_many(case, columns, .true., many)
         call bundle%add_number('outcome', real(outcome_count, wp))
         call bundle%add_number('band', real(size(many%bands), wp))
         call bundle%add_number('first_band', real(many%first_band, wp))
         call bundle%add_number('force', real(force_count, wp))
         call bundle%add_number('sample', real(get_sample_count(case%sampling), wp))
         call bundle%add_number('cost', many%cost)
         call bundle%add_number('further', real(size(many%further_name), wp))
      end if
      call leave(bundle, error, status, handle, n_byte, n_value)
      call end_call()
   end subroutine size_many

   !> Outcomes, levels and verdicts of drops of a case that differ in some keys.
   subroutine drop_many(text, names, n_column, n_drop, values, threads, judged, n_outcome, n_band, n_force, n_sample, &
      n_kept, drop_status, outcome, level, conforms, margin, verdict, n_further, &
      further, force, status, handle, n_byte, n_value)
      !f2py threadsafe
      !> Text of a namelist file; names of the keys, with commas between.
      character(len=*), intent(in) :: text, names
      !> Numbers of keys, drops and threads.
      integer, intent(in) :: n_column, n_drop, threads
      !> Values of the keys, of a choice its number from 1: [n_column, n_drop].
      real(wp), intent(in) :: values(n_column, n_drop)
      !> 0 where neither levels nor verdicts are wanted.
      integer, intent(in) :: judged
      !> Numbers of outcomes, bands and forces, from `size_many`.
      integer, intent(in) :: n_outcome, n_band, n_force
      !> Samples of each record, or 1 where no forces are wanted.
      integer, intent(in) :: n_sample
      !> Drops whose forces are wanted, n_drop or 1.
      integer, intent(in) :: n_kept
      !> 0, or the code of the error: [n_drop].
      integer, intent(out) :: drop_status(n_drop)
      !> Outcomes: [n_outcome, n_drop].
      real(wp), intent(out) :: outcome(n_outcome, n_drop)
      !> Levels, dB: [n_band, n_force, n_drop].
      real(wp), intent(out) :: level(n_band, n_force, n_drop)
      !> 1 where the source conforms by that force, else 0: [n_force, n_drop].
      integer, intent(out) :: conforms(n_force, n_drop)
      !> Minimum distance of an octave level of the judged force to its limits, dB: [n_drop].
      real(wp), intent(out) :: margin(n_drop)
      !> 1 where the source conforms by the judged force, else 0: [n_drop].
      integer, intent(out) :: verdict(n_drop)
      !> Number of further results, from `size_many`, at least 1.
      integer, intent(in) :: n_further
      !> Further results, of cases with a floor: [n_further, n_drop].
      real(wp), intent(out) :: further(n_further, n_drop)
      !> Forces, N: [n_sample, n_force, n_kept].
      real(wp), intent(out) :: force(n_sample, n_force, n_kept)
      !> Status, handle and sizes as in `leave`.
      integer, intent(out) :: status, n_byte, n_value
      integer(int64), intent(out) :: handle
      type(bundle_type), pointer :: bundle
      type(case_type), target :: case
      type(column_type), allocatable :: columns(:)
      type(many_type), allocatable :: many
      type(error_type), allocatable :: error
      character(len=:), allocatable :: reasons

      call begin_call()
      allocate (bundle)
      call read_case(text, 'python', case, error, unchecked=.true.)
      if (.not. allocated(error)) call find_columns(case, split(names, n_column), columns, error)
      if (.not. allocated(error)) then
         call take_many(many)
         call new_many(case, columns, judged /= 0, many)
         call solve_many(case, columns, values, threads, n_kept == n_drop .and. n_sample > 1, many, error)
      end if
      if (.not. allocated(error)) then
         drop_status = many%status
         outcome = many%outcome
         level = many%level
         conforms = merge(1, 0, many%conforms)
         margin = many%margin
         verdict = merge(1, 0, many%verdict)
         further = 0.0_wp
         if (size(many%further) > 0) further = many%further
         if (size(many%force) > 0) force = many%force
         call join_reasons(many, reasons)
         call bundle%add_text('reasons', reasons)
         call leave_many(many)
      end if
      call leave(bundle, error, status, handle, n_byte, n_value)
      call end_call()
   end subroutine drop_many

   !> The sentences of all drops that failed, a line for each.
   pure subroutine join_reasons(many, text)
      type(many_type), intent(in) :: many
      character(len=:), allocatable, intent(out) :: text
      integer :: i, n

      n = 0
      do i = 1, size(many%reason)
         if (allocated(many%reason(i)%text)) n = n + len(many%reason(i)%text) + 1
      end do
      allocate (character(len=n) :: text)
      n = 0
      do i = 1, size(many%reason)
         if (.not. allocated(many%reason(i)%text)) cycle
         text(n + 1:n + len(many%reason(i)%text) + 1) = many%reason(i)%text//newline
         n = n + len(many%reason(i)%text) + 1
      end do
   end subroutine join_reasons

end module thud_ensemble_api
