!> A floor given by its measured mobility: a sum of poles fitted by `thud.fit_mobility` or `thud-driver mobility`,
!> and, for the room below, by the plate that it was measured on.
module thud_measured_mobility_floor
   use thud_band, only: band_type
   use thud_constants, only: pi
   use thud_error, only: error_type, input_error, numerical_error
   use thud_field, only: field_type, list_type, name_length
   use thud_floor_model, only: floor_model_type, floor_state_type
   use thud_floor_modes, only: floor_modes_type
   use thud_injected_energy, only: get_mean_conductances
   use thud_kinds, only: wp
   use thud_new_field, only: list_field, real_field
   use thud_passivity, only: find_violations
   use thud_plate, only: get_plate_fields, get_resistance, plate_type
   use thud_plate_floor, only: plate_floor_type
   use thud_receiver, only: get_conductance, receiver_type
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: measured_mobility_floor_type

   !> Minimum thickness of a plate that radiates, m.
   real(wp), parameter :: min_thickness = 0.001_wp

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
      procedure :: check_radiator
      procedure :: get_radiator
      procedure :: get_radiating_modes
      procedure :: has_room_modes
      procedure :: get_room_modes
      procedure :: get_support
   end type measured_mobility_floor_type

contains

   !> Keys and allowed ranges of the group `&measured_mobility`.
   function get_fields(self) result(fields)
      class(measured_mobility_floor_type), intent(in), target :: self
      type(field_type), allocatable :: fields(:)

      fields = [ &
         real_field('direct', self%direct, 'm/(N s)', 'limit of the mobility at high frequencies', '[0, 1000]'), &
         list_field('pole_frequency', self%pole_frequency, 'Hz', &
         'magnitudes of the poles divided by 2 pi', '[1e-6, 1e7]'), &
         list_field('damping_ratio', self%damping_ratio, '', 'damping ratios of the poles; 1 for a real pole', &
         '[1e-12, 1]'), &
         list_field('residue_real', self%residue_real, 'm/(N s2)', &
         'real parts of the residues, doubled for a pair of poles', '[-1e12, 1e12]'), &
         list_field('residue_imaginary', self%residue_imaginary, 'm/(N s2)', &
         'imaginary parts of the residues, doubled for a pair of poles', '[-1e12, 1e12]'), &
         real_field('lowest_frequency', self%lowest_frequency, 'Hz', 'lowest frequency of the measurement', &
         '(0, highest_frequency)'), &
         real_field('highest_frequency', self%highest_frequency, 'Hz', &
         'highest frequency of the measurement', '(0, 1e7]'), &
         get_plate_fields(self%radiator%plate, optional_plate=.true.)]
   end function get_fields

   !> Checks that the lists are equally long and the mobility is passive.
   subroutine check(self, error)
      class(measured_mobility_floor_type), intent(in) :: self
      type(error_type), allocatable, intent(out) :: error
      type(floor_state_type) :: state

      associate (n => self%pole_frequency%count)
         if (n == 0 .or. any([self%damping_ratio%count, self%residue_real%count, self%residue_imaginary%count] &
            /= n)) then
            error = input_error('&measured_mobility: pole_frequency has '//to_text(n)//' values, damping_ratio ' &
               //to_text(self%damping_ratio%count)//', residue_real '//to_text(self%residue_real%count) &
               //' and residue_imaginary '//to_text(self%residue_imaginary%count) &
               //'; allowed: the same number of each, at least one')
         else if (self%radiator%plate%thickness > 0.0_wp .and. self%radiator%plate%thickness < min_thickness) then
            error = input_error('&measured_mobility: thickness = '//to_text(self%radiator%plate%thickness) &
               //' m; allowed: 0, or from '//to_text(min_thickness)//' m on')
         else
            call self%prepare(state, error)
         end if
      end associate
   end subroutine check

   !> The fitted mobility, valid in the band of the measurement; an error if it is not passive.
   subroutine prepare(self, state, error)
      class(measured_mobility_floor_type), intent(in) :: self
      type(floor_state_type), intent(out) :: state
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: rounding = 1.0e-12_wp
      real(wp), allocatable :: omega(:), conductance(:)
      real(wp) :: regularization
      logical :: failed
      integer :: i

      state%lowest_frequency = self%lowest_frequency
      state%highest_frequency = self%highest_frequency
      state%validity_reason = 'the mobility was not measured, and follows from the fit'
      associate (n => self%pole_frequency%count, receiver => state%receiver)
         receiver%direct = self%direct
         allocate (receiver%pole(n), receiver%residue(n))
         associate (zeta => self%damping_ratio%values(:n))
            receiver%pole = 2*pi*self%pole_frequency%values(:n)*cmplx(-zeta, sqrt((1 - zeta)*(1 + zeta)), wp)
         end associate
         receiver%residue = cmplx(self%residue_real%values(:n), self%residue_imaginary%values(:n), wp)
         where (.not. receiver%pole%im > 0.0_wp) receiver%residue = real(receiver%residue, wp)
      end associate
      ! The test needs a positive direct part: it is raised by less than rounding.
      regularization = rounding*(state%receiver%direct + sum(abs(state%receiver%residue/state%receiver%pole)))
      call find_violations(state%receiver%pole, state%receiver%residue, state%receiver%direct + regularization, &
         omega, failed)
      if (failed) then
         error = numerical_error('&measured_mobility: the zeros of the real part were not found')
      else if (size(omega) > 0) then
         conductance = get_conductance(state%receiver, omega/(2*pi))
         i = minloc(conductance, dim=1)
         error = input_error('&measured_mobility: the real part of the mobility is '//to_text(conductance(i)) &
            //' m/(N s) at '//to_text(omega(i)/(2*pi))//' Hz; allowed: not negative, see `thud-driver mobility`')
      end if
   end subroutine prepare

   !> Checks that a plate is stated.
   subroutine check_radiator(self, error)
      class(measured_mobility_floor_type), intent(in) :: self
      type(error_type), allocatable, intent(out) :: error

      if (.not. self%radiator%plate%thickness > 0.0_wp) error = input_error('&measured_mobility: a mobility alone does ' &
         //'not radiate into a room; allowed: with the plate that it was measured on (thickness above 0)')
   end subroutine check_radiator

   !> The plate; its conductance is the mean real part of the mobility in one-third octaves around the frequencies, and
   !> outside the measurement that of the infinite plate.
   subroutine get_radiator(self, state, frequency, plate, conductance, error)
      class(measured_mobility_floor_type), intent(in) :: self
      type(floor_state_type), intent(in) :: state
      real(wp), intent(in) :: frequency(:)
      type(plate_type), intent(out) :: plate
      real(wp), intent(out) :: conductance(:)
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      plate = self%radiator%plate
      conductance = 0.0_wp
      call self%check_radiator(error)
      if (allocated(error)) return
      conductance = get_mean_conductances(state%receiver, [(band_type(lower=frequency(i)*10**(-0.05_wp), &
         upper=frequency(i)*10**0.05_wp), i=1, size(frequency))])
      where (frequency < self%lowest_frequency .or. frequency > self%highest_frequency) &
         conductance = 1/get_resistance(plate)
   end subroutine get_radiator

   !> Modes of the plate: the floor has another mobility, and other modes.
   subroutine get_radiating_modes(self, state, plate, modes, error)
      class(measured_mobility_floor_type), intent(in) :: self
      type(floor_state_type), intent(in) :: state
      type(plate_type), intent(out) :: plate
      type(floor_modes_type), intent(out) :: modes
      type(error_type), allocatable, intent(out) :: error

      call self%get_room_modes(state, self%get_support(), plate, modes, error)
   end subroutine get_radiating_modes

   !> The mobility of one point contains no shapes of modes.
   pure function has_room_modes(self) result(yes)
      class(measured_mobility_floor_type), intent(in) :: self
      logical :: yes

      yes = .false.
   end function has_room_modes

   !> Modes of the plate with another support of its edges.
   subroutine get_room_modes(self, state, support, plate, modes, error, max_frequency)
      class(measured_mobility_floor_type), intent(in) :: self
      type(floor_state_type), intent(in) :: state
      character(len=*), intent(in) :: support
      type(plate_type), intent(out) :: plate
      type(floor_modes_type), intent(out) :: modes
      type(error_type), allocatable, intent(out) :: error
      real(wp), intent(in), optional :: max_frequency
      type(plate_floor_type) :: radiator

      radiator = self%radiator
      radiator%air = self%air
      call radiator%get_room_modes(state, support, plate, modes, error, max_frequency)
   end subroutine get_room_modes

   !> Support of the edges of the plate.
   pure function get_support(self) result(support)
      class(measured_mobility_floor_type), intent(in) :: self
      character(len=name_length) :: support

      support = self%radiator%get_support()
   end function get_support

end module thud_measured_mobility_floor
