!> Results of samples as columns of a table: the quantities, the levels of both forces and whether the source conforms by
!> them, the results on a mobile floor and in the room below it, and the verdict.
module thud_result_column
   use thud_band, only: band_type, get_band_name, octave_count
   use thud_case, only: case_type
   use thud_compute, only: get_assessed_force, impact_type
   use thud_floor_result, only: floor_result_type
   use thud_force_history, only: force_count, force_history_type, force_names
   use thud_kinds, only: wp
   use thud_quantities, only: quantities, sample_quantity_count
   use thud_rating, only: get_rated_bands
   use thud_room, only: get_rating_index, room_level_type
   use thud_source_limits, only: criterion_type
   use thud_text, only: replaced
   implicit none (type, external)
   private

   public :: get_result_columns, result_column_type, set_floor_values, set_source_values

   !> A column.
   type :: result_column_type
      !> Name of the result, which has a column for each of its bands.
      character(len=24) :: result = ''
      !> Name of the column, with band and unit.
      character(len=48) :: name = ''
      !> The values are 0 for no and 1 for yes.
      logical :: is_flag = .false.
      !> The case asks for the column; other octaves are computed for the verdict.
      logical :: is_wanted = .true.
   end type result_column_type

contains

   !> Columns of the results of a case.
   function get_result_columns(case, bands, first_band) result(columns)
      type(case_type), intent(in) :: case
      !> Bands of the levels, octaves first: [n_band].
      type(band_type), intent(in) :: bands(:)
      !> Index of the first band that the case asks for.
      integer, intent(in) :: first_band
      !> The columns: [n_column].
      type(result_column_type), allocatable :: columns(:)
      integer :: i

      allocate (columns(0))
      do i = 1, sample_quantity_count
         columns = [columns, get_columns(quantities(i)%name, quantities(i)%unit)]
      end do
      do i = 1, force_count
         columns = [columns, get_columns(force_names(i), 'dB', bands)]
         columns(size(columns) - size(bands) + 1:size(columns) - size(bands) + first_band - 1)%is_wanted = .false.
      end do
      do i = 1, force_count
         columns = [columns, get_columns(trim(force_names(i))//'_conforms', '')]
      end do
      if (case%has_floor) columns = [columns, get_columns('contact', 'dB', bands(first_band:)), &
         get_columns('floor_work', 'J')]
      if (case%has_floor .and. case%has_room) columns = [columns, get_columns('room', 'dB', get_rated_bands('third')), &
         get_columns('room_rating', 'dB')]
      columns = [columns, get_columns('margin', 'dB'), get_columns('conforms', '')]
      columns%is_flag = index(columns%result, 'conforms') > 0
   end function get_result_columns

   !> Columns of one result.
   function get_columns(name, unit, bands) result(columns)
      character(len=*), intent(in) :: name
      !> SI unit or dB.
      character(len=*), intent(in) :: unit
      !> Bands of one or more sets, whose name is added (default: a single number): [n_band].
      type(band_type), intent(in), optional :: bands(:)
      type(result_column_type), allocatable :: columns(:)
      integer :: i

      columns = [result_column_type(name, name)]
      if (present(bands)) columns = [(result_column_type(trim(name)//'_'//bands(i)%set, trim(name)//'_' &
         //trim(bands(i)%set)//'_'//get_band_name(bands(i))//'_Hz'), i=1, size(bands))]
      if (unit == '') return
      do i = 1, size(columns)
         columns(i)%name = trim(columns(i)%name)//'_'//replaced(trim(unit), ' ', '_')
      end do
   end function get_columns

   !> Sets the values that follow from the force on a rigid floor.
   pure subroutine set_source_values(case, criteria, quantity, level, conforms, values)
      !> The case of the sample.
      type(case_type), intent(in) :: case
      !> Criteria of the source, octaves first, of which only the ranges are used: [criterion_count].
      type(criterion_type), intent(in) :: criteria(:)
      !> Quantities, SI units: [sample_quantity_count].
      real(wp), intent(in) :: quantity(:)
      !> Levels of the forces, dB: [n_band, force_count].
      real(wp), intent(in) :: level(:, :)
      !> The source conforms, by each force: [force_count].
      logical, intent(in) :: conforms(:)
      !> Values of the columns; those of floor and room are unchanged: [n_column].
      real(wp), intent(inout) :: values(:)
      integer :: assessed

      assessed = get_assessed_force(case)
      values(:size(quantity) + size(level) + force_count) = [quantity, level, merge(1.0_wp, 0.0_wp, conforms)]
      associate (octaves => criteria(:octave_count), octave_level => level(:octave_count, assessed))
         values(size(values) - 1:) = [minval(min(octave_level - octaves%lower, octaves%upper - octave_level)), &
            merge(1.0_wp, 0.0_wp, conforms(assessed))]
      end associate
   end subroutine set_source_values

   !> Sets the values on a floor and in the room below it.
   subroutine set_floor_values(case, impact, on_floor, floor, room, columns, values)
      !> A case with a floor.
      type(case_type), intent(in) :: case
      !> The drop on a rigid floor, used if `on_floor` is not allocated.
      type(impact_type), intent(in) :: impact
      type(force_history_type), intent(in), allocatable :: on_floor
      !> Results on the floor and in the room, whose levels are allocated if they are known.
      type(floor_result_type), intent(in) :: floor
      type(room_level_type), intent(in) :: room
      !> The columns: [n_column].
      type(result_column_type), intent(in) :: columns(:)
      !> Values of the columns; only those of floor and room are set: [n_column].
      real(wp), intent(inout) :: values(:)
      real(wp), allocatable :: level(:)
      integer :: work

      allocate (level(0))
      if (allocated(impact%assessment%level)) level = impact%assessment%level(impact%assessment%first_band:, 2)
      if (allocated(floor%contact_level)) level = floor%contact_level
      work = findloc(columns%result, 'floor_work', dim=1)
      values(work - size(level):work - 1) = level
      values(work) = impact%history%floor_work
      if (allocated(on_floor)) values(work) = on_floor%floor_work
      if (allocated(room%level)) values(work + 1:size(values) - 2) = [room%level, room%rating(get_rating_index(case%room))]
   end subroutine set_floor_values

end module thud_result_column
