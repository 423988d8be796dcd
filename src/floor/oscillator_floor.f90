!> A mass on a spring and a damper: one mode of a floor, or a force plate on its mounts.
module thud_oscillator_floor
   use thud_error, only: error_type
   use thud_field, only: field_type
   use thud_floor_model, only: floor_model_type, floor_state_type
   use thud_kinds, only: wp
   use thud_new_field, only: real_field
   implicit none (type, external)
   private

   public :: oscillator_floor_type

   !> Minimum distance of a pole from the mean of both, divided by this mean: near critical damping the poles are moved this
   !> far. The mobility changes by the square of this; cancellation in the sum of both poles has an error of the same size.
   real(wp), parameter :: min_separation = 6.0e-6_wp

   !> The floor; the default resonates at 25 Hz with a loss factor of 0.05.
   type, extends(floor_model_type) :: oscillator_floor_type
      !> Mass, kg.
      real(wp) :: mass = 100.0_wp
      !> Stiffness, N/m.
      real(wp) :: stiffness = 2.467e6_wp
      !> Damping, N s/m.
      real(wp) :: damping = 785.0_wp
   contains
      procedure :: get_fields
      procedure :: prepare
      procedure :: has_radiator
   end type oscillator_floor_type

contains

   !> Keys and allowed ranges of the group `&oscillator`.
   function get_fields(self) result(fields)
      class(oscillator_floor_type), intent(in), target :: self
      type(field_type), allocatable :: fields(:)

      fields = [ &
         real_field('mass', self%mass, 'kg', 'moving mass under the source', '[1e-3, 1e12]'), &
         real_field('stiffness', self%stiffness, 'N/m', 'stiffness of the support', '[0, 1e15]'), &
         real_field('damping', self%damping, 'N s/m', 'damping coefficient of the support', '[0, 1e12]')]
   end function get_fields

   !> Y = s/(m s**2 + c s + k) with the poles -c/(2 m) +- sqrt(c**2/(4 m**2) - k/m).
   subroutine prepare(self, state, error)
      class(oscillator_floor_type), intent(in) :: self
      type(floor_state_type), intent(out) :: state
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: decay, square, fast, slow
      complex(wp) :: pole

      decay = self%damping/(2*self%mass)
      square = decay**2 - self%stiffness/self%mass
      if (.not. (self%damping > 0.0_wp .or. self%stiffness > 0.0_wp)) then
         state%receiver%pole = [(0.0_wp, 0.0_wp)]
         state%receiver%residue = [cmplx(1/self%mass, kind=wp)]
      else if (square > (min_separation*decay)**2) then
         fast = -decay - sqrt(square)
         ! From the product of the poles, because their sum would cancel.
         slow = self%stiffness/(self%mass*fast)
         state%receiver%pole = cmplx([fast, slow], kind=wp)
         state%receiver%residue = cmplx([fast, -slow]/(self%mass*(fast - slow)), kind=wp)
      else
         pole = cmplx(-decay, max(sqrt(max(-square, 0.0_wp)), min_separation*decay), wp)
         state%receiver%pole = [pole]
         state%receiver%residue = [2*pole/(self%mass*cmplx(0.0_wp, 2*pole%im, wp))]
      end if
   end subroutine prepare

   !> No plate radiates into a room.
   pure function has_radiator(self) result(yes)
      class(oscillator_floor_type), intent(in) :: self
      logical :: yes

      yes = .false.
   end function has_radiator

end module thud_oscillator_floor
