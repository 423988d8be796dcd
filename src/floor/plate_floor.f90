!> A rectangular plate, isotropic or orthotropic, bare or with a floating plate.
module thud_plate_floor
   use thud_field, only: field_type
   use thud_floor_model, only: floor_state_type
   use thud_kinds, only: wp
   use thud_plate, only: get_plate_fields, get_thin_limit, plate_type
   use thud_plate_stack, only: new_orthotropic, orthotropic_type
   use thud_rectangular_floor, only: rectangular_floor_type
   use thud_screed, only: get_screed_plate
   implicit none (type, external)
   private

   public :: plate_floor_type

   !> The floor.
   type, extends(rectangular_floor_type) :: plate_floor_type
      type(plate_type) :: plate
   contains
      procedure :: get_fields
      procedure :: get_bearing
   end type plate_floor_type

contains

   !> Keys and allowed ranges of the group `&plate`.
   function get_fields(self) result(fields)
      class(plate_floor_type), intent(in), target :: self
      type(field_type), allocatable :: fields(:)

      fields = [get_plate_fields(self%plate, .false.), self%get_source_fields(), self%get_build_up_fields(.false.), &
         self%get_point_fields()]
   end function get_fields

   !> The plate.
   subroutine get_bearing(self, state, bearing)
      class(plate_floor_type), intent(in) :: self
      type(floor_state_type), intent(inout) :: state
      type(orthotropic_type), intent(out) :: bearing

      state%group = 'plate'
      state%plate = self%plate
      bearing = new_orthotropic(self%plate)
      state%highest_frequency = get_thin_limit(self%plate)
      if (self%screed%thickness > 0.0_wp) state%highest_frequency = min(state%highest_frequency, &
         get_thin_limit(get_screed_plate(self%screed, self%plate)))
      state%validity_reason = 'bending waves are shorter than six thicknesses, and a plate is not thin'
   end subroutine get_bearing

end module thud_plate_floor
