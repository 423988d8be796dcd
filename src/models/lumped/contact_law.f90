!> Contact law: a linear and a power-law spring in parallel, damped in proportion to their force (Hunt and Crossley 1975),
!> F = (k d + c d^n)(1 + a d'), never tensile.
module thud_contact_law
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: contact_law_type, get_contact_force

   !> The law.
   type :: contact_law_type
      !> Stiffness k of the linear spring, N/m.
      real(wp) :: stiffness = 0.0_wp
      !> Factor c of the power law, N/m^exponent, and its exponent n.
      real(wp) :: factor = 0.0_wp, exponent = 1.5_wp
      !> Damping a, s/m.
      real(wp) :: damping = 0.0_wp
   end type contact_law_type

contains

   !> Components of the force. They stay smooth beyond the end of a contact, where the search for it evaluates them.
   pure function get_contact_force(law, deflection, velocity) result(components)
      type(contact_law_type), intent(in) :: law
      !> Deflection d, m, and its rate, m/s.
      real(wp), intent(in) :: deflection, velocity
      !> Linear spring, power law, damping, N: [3].
      real(wp) :: components(3)

      components(1) = law%stiffness*deflection
      components(2) = law%factor*sign(abs(deflection)**law%exponent, deflection)
      components(3) = max(-1.0_wp, law%damping*velocity)*sum(components(1:2))
   end function get_contact_force

end module thud_contact_law
