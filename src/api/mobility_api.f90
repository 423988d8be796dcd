!> The flat API for Python to fits of measured mobilities; see `thud_api`.
module thud_mobility_api
   use thud_bundle, only: bundle_type, leave
   use thud_error, only: error_type
   use thud_kinds, only: int64, wp
   use thud_measured_mobility_floor, only: measured_mobility_floor_type
   use thud_mobility_fit, only: fit_table => fit_mobility
   use thud_system, only: begin_call, end_call
   implicit none (type, external)
   private

   public :: fit_mobility

contains

   !> Floor with a measured mobility.
   subroutine fit_mobility(n_line, frequency, real_part, imaginary_part, order, status, handle, n_byte, n_value)
      !f2py threadsafe
      integer, intent(in) :: n_line
      !> Frequencies, Hz; parts of the mobility, m/(N s): [n_line].
      real(wp), intent(in) :: frequency(n_line), real_part(n_line), imaginary_part(n_line)
      !> Number of poles.
      integer, intent(in) :: order
      !> Status, handle and sizes as in `leave`.
      integer, intent(out) :: status, n_byte, n_value
      integer(int64), intent(out) :: handle
      type(bundle_type), pointer :: bundle
      type(measured_mobility_floor_type) :: floor
      type(error_type), allocatable :: error
      real(wp) :: free_error

      call begin_call()
      allocate (bundle)
      call fit_table(frequency, cmplx(real_part, imaginary_part, wp), order, floor, free_error, error)
      if (.not. allocated(error)) then
         call bundle%add_number('free_error', free_error)
         call bundle%add_number('floor.direct', floor%direct)
         call bundle%add_number('floor.lowest_frequency', floor%lowest_frequency)
         call bundle%add_number('floor.highest_frequency', floor%highest_frequency)
         associate (n => floor%pole_frequency%count)
            call bundle%add_array('floor.pole_frequency', [n], floor%pole_frequency%values(:n))
            call bundle%add_array('floor.damping_ratio', [n], floor%damping_ratio%values(:n))
            call bundle%add_array('floor.residue_real', [n], floor%residue_real%values(:n))
            call bundle%add_array('floor.residue_imaginary', [n], floor%residue_imaginary%values(:n))
         end associate
      end if
      call leave(bundle, error, status, handle, n_byte, n_value)
      call end_call()
   end subroutine fit_mobility

end module thud_mobility_api
