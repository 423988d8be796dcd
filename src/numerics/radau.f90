!> The Radau IIA collocation method with three stages: order 5, stable for any decay (Hairer and Wanner 1996, IV.5).
module thud_radau
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: n_stage, radau_derivative, radau_integral, radau_monomial, radau_node

   !> Number of stages of a step.
   integer, parameter :: n_stage = 3

   !> Square root of 6.
   real(wp), parameter :: r = sqrt(6.0_wp)

   !> Times of the stages, as fractions of the step: [n_stage].
   real(wp), parameter :: radau_node(n_stage) = [(4 - r)/10, (4 + r)/10, 1.0_wp]

   !> Maps the values of a polynomial at the stages to its integrals up to the stages; the last row has the weights of the
   !> step: [n_stage, n_stage].
   real(wp), parameter :: radau_integral(n_stage, n_stage) = reshape([ &
      (88 - 7*r)/360, (296 + 169*r)/1800, (16 - r)/36, &
      (296 - 169*r)/1800, (88 + 7*r)/360, (16 + r)/36, &
      (-2 + 3*r)/225, (-2 - 3*r)/225, 1.0_wp/9], [n_stage, n_stage])

   !> Maps the values of a polynomial at the stages, minus that at the beginning, to its derivatives at the stages; the
   !> inverse of `radau_integral`: [n_stage, n_stage].
   real(wp), parameter :: radau_derivative(n_stage, n_stage) = reshape([ &
      2 + r/2, -1.2_wp - 29*r/30, -1 + 8*r/3, &
      -1.2_wp + 29*r/30, 2 - r/2, -1 - 8*r/3, &
      0.4_wp - 4*r/15, 0.4_wp + 4*r/15, 5.0_wp], [n_stage, n_stage])

   !> Coefficients of 1, t and t**2 in the polynomial that is 1 at one stage and 0 at the others: [n_stage, n_stage].
   real(wp), parameter :: radau_monomial(n_stage, n_stage) = reshape([ &
      1.0_wp/3 + r/2, 4.0_wp/3 - 13*r/6, -5.0_wp/3 + 5*r/3, &
      1.0_wp/3 - r/2, 4.0_wp/3 + 13*r/6, -5.0_wp/3 - 5*r/3, &
      1.0_wp/3, -8.0_wp/3, 10.0_wp/3], [n_stage, n_stage])

end module thud_radau
