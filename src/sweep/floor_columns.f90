!> Results of a drop on a mobile floor and in the room below it, as columns of a table of samples.
module thud_floor_columns
   use thud_band, only: band_type, get_band_name
   use thud_case, only: case_type
   use thud_compute, only: impact_type
   use thud_floor_result, only: floor_result_type
   use thud_force_history, only: force_history_type
   use thud_kinds, only: wp
   use thud_power, only: not_a_number
   use thud_rating, only: get_rated_bands
   use thud_room, only: get_rating_index, room_level_type
   implicit none (type, external)
   private

   public :: column_name_length, get_floor_columns, get_floor_values

   !> Maximum length of the name of a column.
   integer, parameter :: column_name_length = 32

contains

   !> Names of the floor and room columns of a case.
   function get_floor_columns(case, bands) result(names)
      type(case_type), intent(in) :: case
      !> Bands of the levels: [n_band].
      type(band_type), intent(in) :: bands(:)
      !> The names, with units; none if the case has no floor: [n_column].
      character(len=column_name_length), allocatable :: names(:)

      allocate (names(0))
      if (.not. case%has_floor) return
      names = [character(len=column_name_length) :: get_level_names('contact', bands), 'floor_work_J']
      if (.not. case%has_room) return
      names = [character(len=column_name_length) :: names, get_level_names('room', get_rated_bands('third')), 'room_rating_dB']
   end function get_floor_columns

   !> Names of the columns of levels.
   function get_level_names(prefix, bands) result(names)
      character(len=*), intent(in) :: prefix
      !> The bands: [n_band].
      type(band_type), intent(in) :: bands(:)
      !> The names, with band set, frequency and unit: [n_band].
      character(len=column_name_length) :: names(size(bands))
      integer :: i

      do i = 1, size(bands)
         names(i) = prefix//'_'//trim(bands(i)%set)//'_'//get_band_name(bands(i))//'_Hz_dB'
      end do
   end function get_level_names

   !> Values of the columns for one sample.
   subroutine get_floor_values(case, n_band, levels, impact, on_floor, floor, room, values)
      type(case_type), intent(in) :: case
      !> Number of bands of the levels.
      integer, intent(in) :: n_band
      !> Levels have been computed; otherwise all values except `floor_work_J` are NaN.
      logical, intent(in) :: levels
      !> The drop on a rigid floor, used if `on_floor` is not allocated.
      type(impact_type), intent(in) :: impact
      type(force_history_type), intent(in), allocatable :: on_floor
      type(floor_result_type), intent(in) :: floor
      type(room_level_type), intent(in) :: room
      !> The values: [n_column].
      real(wp), intent(out) :: values(:)

      values = not_a_number
      values(n_band + 1) = impact%history%floor_work
      if (allocated(on_floor)) values(n_band + 1) = on_floor%floor_work
      if (.not. levels) return
      if (allocated(on_floor)) then
         values(:n_band) = floor%contact_level
      else
         values(:n_band) = impact%assessment%level(impact%assessment%first_band:, 2)
      end if
      if (case%has_room) values(n_band + 2:) = [room%level, room%rating(get_rating_index(case%room))]
   end subroutine get_floor_values

end module thud_floor_columns
