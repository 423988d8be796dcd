!> A mass on a spring and a damper: one mode of a floor, or a force plate on its mounts.
module thud_oscillator_floor
   use thud_error, only: error_type
   use thud_field, only: field_type
   use thud_floor_model, only: floor_model_type
   use thud_kinds, only: wp
   use thud_new_field, only: real_field
   use thud_receiver, only: receiver_type
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
      procedure, pass(options) :: get_fields
      procedure, pass(options) :: get_receiver
      procedure, pass(options) :: has_radiator
   end type oscillator_floor_type

contains

   !> Keys and allowed ranges of the group `&oscillator`.
   function get_fields(options) result(fields)
      class(oscillator_floor_type), intent(in), target :: options
      type(field_type), allocatable :: fields(:)

      fields = [ &
         real_field('mass', options%mass, 'kg', 'moving mass under the source', '[1e-3, 1e12]'), &
         real_field('stiffness', options%stiffness, 'N/m', 'stiffness of the support', '[0, 1e15]'), &
         real_field('damping', options%damping, 'N s/m', 'damping coefficient of the support', '[0, 1e12]')]
   end function get_fields

   !> Y = s/(m s**2 + c s + k) with the poles -c/(2 m) +- sqrt(c**2/(4 m**2) - k/m).
   subroutine get_receiver(options, receiver, error)
      class(oscillator_floor_type), intent(in) :: options
      type(receiver_type), intent(out) :: receiver
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: decay, square, fast, slow
      complex(wp) :: pole

      decay = options%damping/(2*options%mass)
      square = decay**2 - options%stiffness/options%mass
      if (.not. (options%damping > 0.0_wp .or. options%stiffness > 0.0_wp)) then
         receiver%pole = [(0.0_wp, 0.0_wp)]
         receiver%residue = [cmplx(1/options%mass, kind=wp)]
      else if (square > (min_separation*decay)**2) then
         fast = -decay - sqrt(square)
         ! From the product of the poles, because their sum would cancel.
         slow = options%stiffness/(options%mass*fast)
         receiver%pole = cmplx([fast, slow], kind=wp)
         receiver%residue = cmplx([fast, -slow]/(options%mass*(fast - slow)), kind=wp)
      else
         pole = cmplx(-decay, max(sqrt(max(-square, 0.0_wp)), min_separation*decay), wp)
         receiver%pole = [pole]
         receiver%residue = [2*pole/(options%mass*cmplx(0.0_wp, 2*pole%im, wp))]
      end if
   end subroutine get_receiver

   !> No plate radiates into a room.
   pure function has_radiator(options) result(yes)
      class(oscillator_floor_type), intent(in) :: options
      logical :: yes

      yes = .false.
   end function has_radiator

end module thud_oscillator_floor
