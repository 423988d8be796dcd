!> A floor given by its measured mobility: a sum of poles fitted by `thud.fit_mobility` or `thud-driver mobility`,
!> and, for the room below, by the plate that it was measured on.
module thud_measured_mobility_floor
   use thud_constants, only: pi
   use thud_error, only: error_type, input_error, numerical_error
   use thud_field, only: field_type, list_type
   use thud_floor_model, only: floor_model_type, floor_state_type
   use thud_kinds, only: wp
   use thud_new_field, only: list_field, real_field
   use thud_passivity, only: find_violations
   use thud_plate, only: get_plate_fields, plate_type
   use thud_plate_floor, only: plate_floor_type
   use thud_receiver, only: get_mobility, receiver_type
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
            error = input_error('&measured_mobility: pole_frequency has '//to_text(n)//' values, damping_ratio ' &
               //to_text(self%damping_ratio%count)//', residue_real '//to_text(self%residue_real%count) &
               //' and residue_imaginary '//to_text(self%residue_imaginary%count) &
               //'; allowed: the same number of each, at least one')
         else if (thickness > 0.0_wp .and. thickness < min_thickness) then
            error = input_error('&measured_mobility: thickness = '//to_text(thickness)//' m; allowed: 0, or from ' &
               //to_text(min_thickness)//' m on')
         else if (has_room .and. .not. thickness > 0.0_wp) then
            error = input_error('&measured_mobility: a mobility alone does not radiate into a room; allowed: with the ' &
               //'plate that it was measured on (thickness above 0)')
         end if
      end associate
      if (allocated(error)) return
      receiver = get_receiver(self)
      ! The test needs a positive direct part: it is raised by less than rounding.
      call find_violations(receiver%pole, receiver%residue, receiver%direct + rounding*(receiver%direct &
         + sum(abs(receiver%residue/receiver%pole))), omega, failed)
      if (failed) then
         error = numerical_error('&measured_mobility: the zeros of the real part were not found')
      else if (size(omega) > 0) then
         conductance = real(get_mobility(receiver, omega/(2*pi)), wp)
         i = minloc(conductance, dim=1)
         error = input_error('&measured_mobility: the real part of the mobility is '//to_text(conductance(i)) &
            //' m/(N s) at '//to_text(omega(i)/(2*pi))//' Hz; allowed: not negative, see `thud-driver mobility`')
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

end module thud_measured_mobility_floor
