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

      columns = [(get_column(quantities(i)%name, quantities(i)%unit), i=1, sample_quantity_count)]
      do i = 1, force_count
         columns = [columns, get_level_columns(force_names(i), bands)]
         columns(size(columns) - size(bands) + 1:size(columns) - size(bands) + first_band - 1)%is_wanted = .false.
      end do
      do i = 1, force_count
         columns = [columns, get_column(trim(force_names(i))//'_conforms', is_flag=.true.)]
      end do
      if (case%has_floor) columns = [columns, get_level_columns('contact', bands(first_band:)), &
         get_column('floor_work', 'J')]
      if (case%has_floor .and. case%has_room) columns = [columns, get_level_columns('room', get_rated_bands('third')), &
         get_column('room_rating', 'dB')]
      columns = [columns, get_column('margin', 'dB'), get_column('conforms', is_flag=.true.)]
   end function get_result_columns

   !> Column of a result without bands.
   pure function get_column(name, unit, is_flag) result(column)
      character(len=*), intent(in) :: name
      !> SI unit or dB (default: none).
      character(len=*), intent(in), optional :: unit
      !> See `result_column_type` (default: false).
      logical, intent(in), optional :: is_flag
      type(result_column_type) :: column

      column = result_column_type(name, name)
      if (present(is_flag)) column%is_flag = is_flag
      if (.not. present(unit)) return
      if (unit /= '') column%name = trim(name)//'_'//replaced(trim(unit), ' ', '_')
   end function get_column

   !> Columns of levels in bands.
   function get_level_columns(prefix, bands) result(columns)
      !> What the levels are of.
      character(len=*), intent(in) :: prefix
      !> The bands: [n_band].
      type(band_type), intent(in) :: bands(:)
      !> The columns: [n_band].
      type(result_column_type) :: columns(size(bands))
      integer :: i

      do i = 1, size(bands)
         columns(i)%result = trim(prefix)//'_'//bands(i)%set
         columns(i)%name = trim(columns(i)%result)//'_'//get_band_name(bands(i))//'_Hz_dB'
      end do
   end function get_level_columns

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
