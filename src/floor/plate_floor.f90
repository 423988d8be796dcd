!> A rectangular plate, isotropic or orthotropic, bare or with a floating plate.
module thud_plate_floor
   use thud_double_plate, only: double_plate_type, get_lower_conductance
   use thud_error, only: error_type
   use thud_field, only: field_type
   use thud_floor_model, only: floor_state_type
   use thud_kinds, only: wp
   use thud_plate, only: get_plate_fields, get_resistance, get_thin_limit, plate_type
   use thud_rectangular_floor, only: base_floor_type, rectangular_floor_type
   use thud_screed, only: get_screed_plate, new_orthotropic
   implicit none (type, external)
   private

   public :: plate_floor_type

   !> The floor.
   type, extends(rectangular_floor_type) :: plate_floor_type
      type(plate_type) :: plate
   contains
      procedure :: get_fields
      procedure :: get_base
      procedure :: get_radiator
   end type plate_floor_type

contains

   !> Keys and allowed ranges of the group `&plate`.
   function get_fields(self) result(fields)
      class(plate_floor_type), intent(in), target :: self
      type(field_type), allocatable :: fields(:)

      fields = [get_plate_fields(self%plate), self%get_source_fields(), self%get_build_up_fields(), &
         self%get_point_fields()]
   end function get_fields

   !> The plate.
   function get_base(self) result(base)
      class(plate_floor_type), intent(in) :: self
      type(base_floor_type) :: base

      base = base_floor_type('plate', self%plate, new_orthotropic(self%plate))
      base%highest_frequency = get_thin_limit(self%plate)
      if (self%screed%thickness > 0.0_wp) base%highest_frequency = min(base%highest_frequency, &
         get_thin_limit(get_screed_plate(self%screed, self%plate)))
      base%validity_reason = 'bending waves are shorter than six thicknesses, and a plate is not thin'
   end function get_base

   !> The plate itself; its conductance, averaged over positions, is that of the infinite plate, or the power through the
   !> layer of a floating plate with both plates infinite.
   subroutine get_radiator(self, state, frequency, plate, conductance, error)
      class(plate_floor_type), intent(in) :: self
      type(floor_state_type), intent(in) :: state
      real(wp), intent(in) :: frequency(:)
      type(plate_type), intent(out) :: plate
      real(wp), intent(out) :: conductance(:)
      type(error_type), allocatable, intent(out) :: error

      plate = self%plate
      if (self%screed%thickness > 0.0_wp) then
         associate (screed => self%screed)
            conductance = get_lower_conductance(double_plate_type(get_screed_plate(screed, plate), plate, &
               screed%layer_stiffness, screed%layer_loss_factor, self%air), frequency)
         end associate
      else
         conductance = 1/get_resistance(plate)
      end if
   end subroutine get_radiator

end module thud_plate_floor
