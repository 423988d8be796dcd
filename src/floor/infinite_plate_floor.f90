!> A thin infinite plate: a resistance, the same at all frequencies and positions.
module thud_infinite_plate_floor
   use thud_error, only: error_type
   use thud_field, only: field_type
   use thud_floor_model, only: floor_model_type, floor_state_type
   use thud_kinds, only: wp
   use thud_new_field, only: real_field
   implicit none (type, external)
   private

   public :: infinite_plate_floor_type

   !> The floor; the default is 22 mm of chipboard.
   type, extends(floor_model_type) :: infinite_plate_floor_type
      !> Force divided by velocity, 8 sqrt(B' m''), N s/m.
      real(wp) :: resistance = 1600.0_wp
   contains
      procedure :: get_fields
      procedure :: prepare
      procedure :: has_radiator
   end type infinite_plate_floor_type

contains

   !> Keys and allowed ranges of the group `&infinite_plate`.
   function get_fields(self) result(fields)
      class(infinite_plate_floor_type), intent(in), target :: self
      type(field_type), allocatable :: fields(:)

      fields = [real_field('resistance', self%resistance, 'N s/m', &
         'driving-point resistance: force divided by velocity', '[1, 1e15]')]
   end function get_fields

   !> The mobility is constant: it has no poles.
   subroutine prepare(self, state, error)
      class(infinite_plate_floor_type), intent(in) :: self
      type(floor_state_type), intent(out) :: state
      type(error_type), allocatable, intent(out) :: error

      state%receiver%direct = 1/self%resistance
      allocate (state%receiver%pole(0), state%receiver%residue(0))
   end subroutine prepare

   !> A resistance alone does not radiate into a room.
   pure function has_radiator(self) result(yes)
      class(infinite_plate_floor_type), intent(in) :: self
      logical :: yes

      yes = .false.
   end function has_radiator

end module thud_infinite_plate_floor
