!> Floors known at the point under the source only: rigid as the force plate of the standards, a mass on a spring and a
!> damper (one mode of a floor, or a force plate on its mounts), and a thin infinite plate, which is a resistance.
module thud_point_floors
   use thud_error, only: error_type
   use thud_field, only: field_type, new_field
   use thud_floor_model, only: floor_model_type, floor_state_type
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: infinite_plate_floor_type, oscillator_floor_type, rigid_floor_type

   !> Minimum distance of a pole from the mean of both, divided by this mean: near critical damping the poles are moved this
   !> far. The mobility changes by the square of this; cancellation in the sum of both poles has an error of the same size.
   real(wp), parameter :: min_separation = 6.0e-6_wp

   !> A floor that does not move, without options.
   type, extends(floor_model_type) :: rigid_floor_type
   contains
      procedure :: get_fields => get_rigid_fields
      procedure :: prepare => prepare_rigid
   end type rigid_floor_type

   !> A thin infinite plate; the default is 22 mm of chipboard.
   type, extends(floor_model_type) :: infinite_plate_floor_type
      !> Force divided by velocity, 8 sqrt(B' m''), N s/m.
      real(wp) :: resistance = 1600.0_wp
   contains
      procedure :: get_fields => get_infinite_fields
      procedure :: prepare => prepare_infinite
   end type infinite_plate_floor_type

   !> The oscillator; the default resonates at 25 Hz with a loss factor of 0.05.
   type, extends(floor_model_type) :: oscillator_floor_type
      !> Mass, kg.
      real(wp) :: mass = 100.0_wp
      !> Stiffness, N/m.
      real(wp) :: stiffness = 2.467e6_wp
      !> Damping, N s/m.
      real(wp) :: damping = 785.0_wp
   contains
      procedure :: get_fields => get_oscillator_fields
      procedure :: prepare => prepare_oscillator
   end type oscillator_floor_type

contains

   !> No keys.
   function get_rigid_fields(self) result(fields)
      class(rigid_floor_type), intent(in), target :: self
      type(field_type), allocatable :: fields(:)

      allocate (fields(0))
   end function get_rigid_fields

   !> The default receiver, which is rigid.
   subroutine prepare_rigid(self, state, error)
      class(rigid_floor_type), intent(in) :: self
      type(floor_state_type), intent(out) :: state
      type(error_type), allocatable, intent(out) :: error

   end subroutine prepare_rigid

   !> Keys and allowed ranges of the group `&infinite_plate`.
   function get_infinite_fields(self) result(fields)
      class(infinite_plate_floor_type), intent(in), target :: self
      type(field_type), allocatable :: fields(:)

      fields = [new_field('resistance', self%resistance, 'N s/m', &
         'driving-point resistance: force divided by velocity', '[1, 1e15]')]
   end function get_infinite_fields

   !> The mobility is constant: it has no poles.
   subroutine prepare_infinite(self, state, error)
      class(infinite_plate_floor_type), intent(in) :: self
      type(floor_state_type), intent(out) :: state
      type(error_type), allocatable, intent(out) :: error

      state%receiver%direct = 1/self%resistance
      allocate (state%receiver%pole(0), state%receiver%residue(0))
   end subroutine prepare_infinite

   !> Keys and allowed ranges of the group `&oscillator`.
   function get_oscillator_fields(self) result(fields)
      class(oscillator_floor_type), intent(in), target :: self
      type(field_type), allocatable :: fields(:)

      fields = [ &
         new_field('mass', self%mass, 'kg', 'moving mass under the source', '[1e-3, 1e12]'), &
         new_field('stiffness', self%stiffness, 'N/m', 'stiffness of the support', '[0, 1e15]'), &
         new_field('damping', self%damping, 'N s/m', 'damping coefficient of the support', '[0, 1e12]')]
   end function get_oscillator_fields

   !> Y = s/(m s**2 + c s + k) with the poles -c/(2 m) +- sqrt(c**2/(4 m**2) - k/m).
   subroutine prepare_oscillator(self, state, error)
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
   end subroutine prepare_oscillator

end module thud_point_floors
