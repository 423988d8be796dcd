!> Fits a floor to a table of a measured mobility: vector fit, then the smallest change that makes the fit passive.
module thud_mobility_fit
   use thud_constants, only: pi
   use thud_error, only: error_type, input_error, numerical_error
   use thud_field, only: check_fields
   use thud_interrupt, only: check_interrupt
   use thud_kinds, only: wp
   use thud_measured_mobility_floor, only: measured_mobility_floor_type
   use thud_new_field, only: in_group
   use thud_passivity, only: make_passive
   use thud_text, only: to_text
   use thud_vector_fit, only: fit_rational
   implicit none (type, external)
   private

   public :: fit_mobility

   !> Maximum number of frequency points: the time of a fit grows with their number.
   integer, parameter :: max_points = 10000

   !> Errors are relative to the magnitude, or to this fraction of the largest magnitude if that is more.
   real(wp), parameter :: min_magnitude = 1.0e-6_wp

contains

   !> Fits poles to a mobility, with errors relative to its magnitude.
   subroutine fit_mobility(frequency, mobility, order, floor, free_error, error)
      !> Frequencies, Hz, ascending, above 0: [n_point].
      real(wp), intent(in) :: frequency(:)
      !> The mobility, m/(N s): [n_point].
      complex(wp), intent(in) :: mobility(:)
      !> Number of poles; a conjugate pair has two.
      integer, intent(in) :: order
      type(measured_mobility_floor_type), intent(out), target :: floor
      !> Relative root-mean-square error before the fit was made passive.
      real(wp), intent(out) :: free_error
      !> Set if the table or the order is not allowed, no passive fit was found, or an interrupt came.
      type(error_type), allocatable, intent(out) :: error
      complex(wp), allocatable :: pole(:), residue(:)
      real(wp) :: weight(size(mobility))
      logical :: failed

      free_error = 0.0_wp
      call check_table(frequency, mobility, order, size(floor%pole_frequency%values), error)
      if (allocated(error)) return
      weight = 1/max(abs(mobility), min_magnitude*maxval(abs(mobility)))
      call fit_rational(2*pi*frequency, mobility, weight, order, pole, residue, floor%direct, free_error, failed)
      call check_interrupt(error)
      if (allocated(error)) return
      if (.not. failed) call make_passive(2*pi*frequency, weight, pole, residue, floor%direct, failed)
      call check_interrupt(error)
      if (allocated(error)) return
      if (failed) then
         error = numerical_error('the mobility: no passive function of '//to_text(order)//' poles was found')
      else if (size(pole) > size(floor%pole_frequency%values)) then
         error = numerical_error('the mobility: too many of '//to_text(order)//' poles became real')
      else
         associate (n => size(pole))
            floor%pole_frequency%count = n
            floor%pole_frequency%values(:n) = abs(pole)/(2*pi)
            floor%damping_ratio%count = n
            floor%damping_ratio%values(:n) = min(1.0_wp, -pole%re/abs(pole))
            floor%residue_real%count = n
            floor%residue_real%values(:n) = residue%re
            floor%residue_imaginary%count = n
            floor%residue_imaginary%values(:n) = residue%im
         end associate
         floor%lowest_frequency = frequency(1)
         floor%highest_frequency = frequency(size(frequency))
         call check_fields(in_group('measured_mobility', floor%get_fields()), error)
         if (.not. allocated(error)) call floor%check(.false., error)
      end if
   end subroutine fit_mobility

   !> Checks that a table can be fitted.
   subroutine check_table(frequency, mobility, order, max_poles, error)
      !> As in `fit_mobility`: [n_point].
      real(wp), intent(in) :: frequency(:)
      complex(wp), intent(in) :: mobility(:)
      integer, intent(in) :: order
      !> Maximum number of poles.
      integer, intent(in) :: max_poles
      !> Set if the order, the number of points or a point is not allowed.
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      associate (n => size(frequency))
         if (order < 1 .or. order > min(n - 1, max_poles)) then
            error = input_error('order = '//to_text(order)//' is not allowed with '//to_text(n) &
               //' frequency points; allowed: 1 to '//to_text(min(n - 1, max_poles)))
            return
         end if
         if (n > max_points) then
            error = input_error('the mobility has '//to_text(n)//' frequency points; allowed: up to '//to_text(max_points))
            return
         end if
         do i = 1, n
            if (.not. (frequency(i) > frequency(max(1, i - 1)) .or. (i == 1 .and. frequency(1) > 0.0_wp)) &
               .or. .not. abs(mobility(i)) < huge(1.0_wp) .or. .not. frequency(i) < huge(1.0_wp)) then
               error = input_error('the mobility: frequency point '//to_text(i)//' at '//to_text(frequency(i)) &
                  //' Hz is not allowed; allowed: rising frequencies above 0, and finite values')
               return
            end if
         end do
         ! On average, a passive structure absorbs power.
         if (.not. sum(real(mobility)) > 0.0_wp) error = input_error('the mobility: the mean of its real part is ' &
            //to_text(sum(real(mobility))/n)//' m/(N s); allowed: above 0, force and response in one direction at one point')
      end associate
   end subroutine check_table

end module thud_mobility_fit
