!> Results of a drop on a floor that may move, and in the room below it, as the columns of a table of drops.
module thud_further_results
   use thud_band, only: band_type, get_band_name
   use thud_case, only: case_type
   use thud_compute, only: drop_on_floor, predict_room
   use thud_error, only: error_type
   use thud_force_exposure, only: get_force_exposure_levels
   use thud_force_history, only: force_history_type
   use thud_kinds, only: wp
   use thud_power, only: not_a_number
   use thud_rating, only: get_a_weighted_level, get_standardisation
   use thud_room, only: get_room_bands, room_level_type
   implicit none (type, external)
   private

   public :: further_length, get_further_names, solve_further

   !> Length of a name.
   integer, parameter :: further_length = 32

contains

   !> Names of the further results of a case.
   function get_further_names(case, bands) result(names)
      type(case_type), intent(in) :: case
      !> Bands of the levels: [n_band].
      type(band_type), intent(in) :: bands(:)
      !> The names, with units: [n_further].
      character(len=further_length), allocatable :: names(:)
      type(band_type), allocatable :: room_bands(:)
      type(error_type), allocatable :: error

      allocate (names(0))
      if (.not. case%has_floor) return
      names = [character(len=further_length) :: get_level_names('contact', bands), 'floor_work_J']
      if (.not. case%has_room) return
      call get_room_bands(room_bands, error)
      names = [character(len=further_length) :: names, get_level_names('room', room_bands), 'room_rating_dB', &
         'room_standardised_rating_dB']
   end function get_further_names

   !> Names of levels in bands.
   function get_level_names(prefix, bands) result(names)
      character(len=*), intent(in) :: prefix
      !> The bands: [n_band].
      type(band_type), intent(in) :: bands(:)
      !> The names, with set, frequency and unit: [n_band].
      character(len=further_length) :: names(size(bands))
      integer :: i

      do i = 1, size(bands)
         names(i) = prefix//'_'//trim(bands(i)%set)//'_'//get_band_name(bands(i))//'_Hz_dB'
      end do
   end function get_level_names

   !> The drop on the floor, and the level in the room below.
   subroutine solve_further(case, blocked, bands, judged, further, error)
      !> The case, checked, with a floor.
      type(case_type), intent(in) :: case
      !> The drop on a rigid floor.
      type(force_history_type), intent(in) :: blocked
      !> Bands of the levels: [n_band].
      type(band_type), intent(in) :: bands(:)
      !> Levels are wanted.
      logical, intent(in) :: judged
      !> Results in the order of their names: [n_further].
      real(wp), intent(out) :: further(:)
      !> The drop failed.
      type(error_type), allocatable, intent(out) :: error
      type(force_history_type), allocatable :: contact
      type(room_level_type) :: room
      integer :: n

      further = not_a_number
      call drop_on_floor(case, contact, error)
      if (allocated(error)) return
      ! On a rigid floor, and of models that know its force only.
      if (.not. allocated(contact)) allocate (contact, source=blocked)
      n = size(bands)
      further(n + 1) = contact%floor_work
      if (.not. judged) return
      call get_force_exposure_levels(contact%floor_force, contact%sample_rate, bands, trim(case%level_method), &
         further(:n), error)
      if (allocated(error) .or. .not. case%has_room) return
      call predict_room(case, contact%floor_force, contact%sample_rate, room, error)
      if (allocated(error)) return
      further(n + 2:) = [room%level, room%a_weighted, get_a_weighted_level(room%bands(1)%set, room%level &
         + get_standardisation(room%reverberation_time, case%room%volume))]
   end subroutine solve_further

end module thud_further_results
