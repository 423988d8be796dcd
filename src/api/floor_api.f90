!> The flat API for Python to floors that move; see `thud_api`.
module thud_floor_api
   use thud_band, only: band_type, find_bands
   use thud_bundle, only: bundle_type, leave
   use thud_case, only: case_type, get_floor_number
   use thud_case_text, only: read_case
   use thud_error, only: error_type
   use thud_floor_result, only: get_point_velocity
   use thud_injected_energy, only: get_injected_energies, get_mean_conductances
   use thud_kinds, only: int64, wp
   use thud_receiver, only: get_mobility, receiver_type
   implicit none (type, external)
   private

   public :: floor_energies, floor_mobility, point_velocity

contains

   !> Mobility of the floor of a case, under the source or from there to a point.
   subroutine floor_mobility(text, frequency, n, to_point, x, y, status, handle, n_byte, n_value)
      !f2py threadsafe
      !f2py integer, intent(hide), depend(frequency) :: n = len(frequency)
      !> Text of a namelist file with the group `&floor`.
      character(len=*), intent(in) :: text
      !> Number of frequencies.
      integer, intent(in) :: n
      !> Frequencies, Hz: [n].
      real(wp), intent(in) :: frequency(n)
      !> 1 for the velocity of a point.
      integer, intent(in) :: to_point
      !> Place of the point, m.
      real(wp), intent(in) :: x, y
      !> Status, handle and sizes as in `leave`.
      integer, intent(out) :: status, n_byte, n_value
      integer(int64), intent(out) :: handle
      type(bundle_type), pointer :: bundle
      type(case_type), target :: case
      type(receiver_type) :: receiver
      type(error_type), allocatable :: error
      complex(wp) :: mobility(n)

      allocate (bundle)
      call read_case(text, 'python', case, error)
      if (.not. allocated(error)) then
         associate (floor => case%floors(get_floor_number(case))%model)
            if (to_point == 1) then
               call floor%get_transfer(x, y, receiver, error)
            else
               call floor%get_receiver(receiver, error)
            end if
         end associate
      end if
      if (.not. allocated(error)) then
         mobility = get_mobility(receiver, frequency)
         call bundle%add_array('real', [n], real(mobility, wp))
         call bundle%add_array('imaginary', [n], aimag(mobility))
      end if
      call leave(bundle, error, status, handle, n_byte, n_value)
   end subroutine floor_mobility

   !> Energy that a force gives to the floor of a case, by bands.
   subroutine floor_energies(text, set, force, velocity, n, sample_rate, status, handle, n_byte, n_value)
      !f2py threadsafe
      !f2py integer, intent(hide), depend(force) :: n = len(force)
      !> Text of a namelist file with the group `&floor`; set of bands.
      character(len=*), intent(in) :: text, set
      !> Number of samples.
      integer, intent(in) :: n
      !> Force on the floor, N, and velocity of the floor, m/s: [n].
      real(wp), intent(in) :: force(n), velocity(n)
      !> Samples per second, Hz.
      real(wp), intent(in) :: sample_rate
      !> Status, handle and sizes as in `leave`.
      integer, intent(out) :: status, n_byte, n_value
      integer(int64), intent(out) :: handle
      type(bundle_type), pointer :: bundle
      type(case_type), target :: case
      type(receiver_type) :: receiver
      type(band_type), allocatable :: bands(:)
      type(error_type), allocatable :: error
      real(wp), allocatable :: by_motion(:), by_mobility(:)

      allocate (bundle)
      call read_case(text, 'python', case, error)
      if (.not. allocated(error)) call find_bands(set, bands, error)
      if (.not. allocated(error)) then
         associate (floor => case%floors(get_floor_number(case))%model)
            call floor%get_receiver(receiver, error)
         end associate
      end if
      if (.not. allocated(error)) then
         allocate (by_motion(size(bands)), by_mobility(size(bands)))
         call get_injected_energies(receiver, force, velocity, sample_rate, bands, by_motion, by_mobility)
         call bundle%add_array('frequency', shape(bands), bands%nominal)
         call bundle%add_array('by_motion', shape(bands), by_motion)
         call bundle%add_array('by_mobility', shape(bands), by_mobility)
         call bundle%add_array('conductance', shape(bands), get_mean_conductances(receiver, bands))
      end if
      call leave(bundle, error, status, handle, n_byte, n_value)
   end subroutine floor_energies

   !> Velocity of a point of the floor of a case.
   subroutine point_velocity(text, force, n, sample_rate, x, y, status, handle, n_byte, n_value)
      !f2py threadsafe
      !f2py integer, intent(hide), depend(force) :: n = len(force)
      !> Text of a namelist file with the group `&floor`.
      character(len=*), intent(in) :: text
      !> Number of samples.
      integer, intent(in) :: n
      !> Force on the floor, N: [n].
      real(wp), intent(in) :: force(n)
      !> Samples per second, Hz; place of the point, m.
      real(wp), intent(in) :: sample_rate, x, y
      !> Status, handle and sizes as in `leave`.
      integer, intent(out) :: status, n_byte, n_value
      integer(int64), intent(out) :: handle
      type(bundle_type), pointer :: bundle
      type(case_type), target :: case
      type(error_type), allocatable :: error
      real(wp) :: velocity(n)

      allocate (bundle)
      call read_case(text, 'python', case, error)
      if (.not. allocated(error)) then
         associate (floor => case%floors(get_floor_number(case))%model)
            call get_point_velocity(floor, force, sample_rate, x, y, velocity, error)
         end associate
      end if
      if (.not. allocated(error)) call bundle%add_array('velocity', [n], velocity)
      call leave(bundle, error, status, handle, n_byte, n_value)
   end subroutine point_velocity

end module thud_floor_api
