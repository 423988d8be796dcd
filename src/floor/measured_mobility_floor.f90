!> A floor given by its measured mobility: a sum of poles, fitted to a table by vector fit and made passive by the smallest
!> change (`thud.fit_mobility`, `thud-driver mobility`), and, for the room below, by the plate that it was measured on.
module thud_measured_mobility_floor
   use thud_constants, only: pi
   use thud_error, only: error_type, input_error, numerical_error
   use thud_field, only: check_fields, field_type, in_group, list_type, new_field
   use thud_floor_model, only: floor_model_type, floor_state_type
   use thud_interrupt, only: check_interrupt
   use thud_kinds, only: wp
   use thud_passivity, only: find_violations, make_passive
   use thud_plate, only: get_plate_fields, plate_type
   use thud_plate_floor, only: plate_floor_type
   use thud_receiver, only: get_mobility, receiver_type
   use thud_text, only: to_text
   use thud_vector_fit, only: fit_rational
   implicit none (type, external)
   private

   public :: fit_mobility, measured_mobility_floor_type

   !> Minimum thickness of a plate that radiates, m.
   real(wp), parameter :: min_thickness = 0.001_wp

   !> Maximum number of frequency points: the time of a fit grows with their number.
   integer, parameter :: max_points = 10000

   !> Errors are relative to the magnitude, or to this fraction of the largest magnitude if that is more.
   real(wp), parameter :: min_magnitude = 1.0e-6_wp

   !> The floor.
   type, extends(floor_model_type) :: measured_mobility_floor_type
      !> Mobility at high frequencies, m/(N s).
      real(wp) :: direct = 0.0_wp
      !> Frequencies of the poles, |p|/(2 pi), Hz, and their damping ratios, 1 for a real pole.
      type(list_type) :: pole_frequency, damping_ratio
      !> Residues, doubled for pairs of poles, m/(N s2).
      type(list_type) :: residue_real, residue_imaginary
      !> First and last frequency of the measurement, Hz.
      real(wp) :: lowest_frequency = 10.0_wp, highest_frequency = 1000.0_wp
      !> The plate that radiates; no thickness: none.
      type(plate_floor_type) :: radiator = plate_floor_type(plate=plate_type(thickness=0.0_wp))
   contains
      procedure :: get_fields
      procedure :: check
      procedure :: prepare
   end type measured_mobility_floor_type

contains

   !> Keys and allowed ranges of the group `&measured_mobility`.
   function get_fields(self) result(fields)
      class(measured_mobility_floor_type), intent(in), target :: self
      type(field_type), allocatable :: fields(:)

      fields = [ &
         new_field('direct', self%direct, 'm/(N s)', 'limit of the mobility at high frequencies', '[0, 1000]'), &
         new_field('pole_frequency', self%pole_frequency, 'Hz', &
         'magnitudes of the poles divided by 2 pi', '[1e-6, 1e7]'), &
         new_field('damping_ratio', self%damping_ratio, '', 'damping ratios of the poles; 1 for a real pole', &
         '[1e-12, 1]'), &
         new_field('residue_real', self%residue_real, 'm/(N s2)', &
         'real parts of the residues, doubled for a pair of poles', '[-1e12, 1e12]'), &
         new_field('residue_imaginary', self%residue_imaginary, 'm/(N s2)', &
         'imaginary parts of the residues, doubled for a pair of poles', '[-1e12, 1e12]'), &
         new_field('lowest_frequency', self%lowest_frequency, 'Hz', 'lowest frequency of the measurement', &
         '(0, highest_frequency)'), &
         new_field('highest_frequency', self%highest_frequency, 'Hz', &
         'highest frequency of the measurement', '(0, 1e7]'), &
         get_plate_fields(self%radiator%plate, .true.)]
   end function get_fields

   !> Checks that the lists are equally long, the mobility is passive, and a plate is stated for a room.
   subroutine check(self, has_room, error)
      class(measured_mobility_floor_type), intent(in) :: self
      logical, intent(in) :: has_room
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: rounding = 1.0e-12_wp
      type(receiver_type) :: receiver
      real(wp), allocatable :: omega(:), conductance(:)
      logical :: failed
      integer :: i

      associate (n => self%pole_frequency%count, thickness => self%radiator%plate%thickness)
         if (n == 0 .or. any([self%damping_ratio%count, self%residue_real%count, self%residue_imaginary%count] &
            /= n)) then
            error = input_error('has '//to_text(n)//' values, damping_ratio '//to_text(self%damping_ratio%count) &
               //', residue_real '//to_text(self%residue_real%count)//' and residue_imaginary ' &
               //to_text(self%residue_imaginary%count)//'; allowed: the same number of each, at least one', &
               'measured_mobility', 'pole_frequency')
         else if (thickness > 0.0_wp .and. thickness < min_thickness) then
            error = input_error('= '//to_text(thickness)//' m; allowed: 0, or from '//to_text(min_thickness)//' m on', &
               'measured_mobility', 'thickness')
         else if (has_room .and. .not. thickness > 0.0_wp) then
            error = input_error('a mobility alone does not radiate into a room; allowed: with the plate that it was ' &
               //'measured on (thickness above 0)', 'measured_mobility')
         end if
      end associate
      if (allocated(error)) return
      receiver = get_receiver(self)
      ! The test needs a positive direct part: it is raised by less than rounding.
      call find_violations(receiver%pole, receiver%residue, receiver%direct + rounding*(receiver%direct &
         + sum(abs(receiver%residue/receiver%pole))), omega, failed)
      if (failed) then
         error = numerical_error('the zeros of the real part were not found', 'measured_mobility')
      else if (size(omega) > 0) then
         conductance = real(get_mobility(receiver, omega/(2*pi)), wp)
         i = minloc(conductance, dim=1)
         error = input_error('the real part of the mobility is '//to_text(conductance(i))//' m/(N s) at ' &
            //to_text(omega(i)/(2*pi))//' Hz; allowed: not negative, see `thud-driver mobility`', 'measured_mobility')
      end if
   end subroutine check

   !> The fitted mobility.
   function get_receiver(self) result(receiver)
      class(measured_mobility_floor_type), intent(in) :: self
      type(receiver_type) :: receiver

      receiver%direct = self%direct
      associate (n => self%pole_frequency%count)
         allocate (receiver%pole(n), receiver%residue(n))
         associate (zeta => self%damping_ratio%values(:n))
            receiver%pole = 2*pi*self%pole_frequency%values(:n)*cmplx(-zeta, sqrt((1 - zeta)*(1 + zeta)), wp)
         end associate
         receiver%residue = cmplx(self%residue_real%values(:n), self%residue_imaginary%values(:n), wp)
         where (.not. receiver%pole%im > 0.0_wp) receiver%residue = real(receiver%residue, wp)
      end associate
   end function get_receiver

   !> The fitted mobility, valid in the band of the measurement, and the plate that radiates with its modes.
   subroutine prepare(self, state, error)
      class(measured_mobility_floor_type), intent(in) :: self
      type(floor_state_type), intent(out) :: state
      type(error_type), allocatable, intent(out) :: error
      type(plate_floor_type) :: radiator

      if (self%radiator%plate%thickness > 0.0_wp) then
         radiator = self%radiator
         radiator%air = self%air
         call radiator%prepare(state, error)
         if (allocated(error)) return
      end if
      state%group = 'measured_mobility'
      state%is_measured = .true.
      state%receiver = get_receiver(self)
      state%lowest_frequency = self%lowest_frequency
      state%highest_frequency = self%highest_frequency
      state%validity_reason = 'the mobility was not measured, and follows from the fit'
   end subroutine prepare

   !> The floor with poles fitted to a mobility, with errors relative to its magnitude.
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
         i = findloc(frequency > [0.0_wp, frequency(:n - 1)] .and. frequency < huge(1.0_wp) &
            .and. abs(mobility) < huge(1.0_wp), .false., dim=1)
         if (i > 0) then
            error = input_error('the mobility: frequency point '//to_text(i)//' at '//to_text(frequency(i)) &
               //' Hz is not allowed; allowed: rising frequencies above 0, and finite values')
            return
         end if
         ! On average, a passive structure absorbs power.
         if (.not. sum(real(mobility)) > 0.0_wp) error = input_error('the mobility: the mean of its real part is ' &
            //to_text(sum(real(mobility))/n)//' m/(N s); allowed: above 0, force and response in one direction at one point')
      end associate
   end subroutine check_table

end module thud_measured_mobility_floor
