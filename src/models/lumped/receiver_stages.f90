!> Exact motion of a receiver under a force that is, in each step, the polynomial through its values at the stages of
!> `thud_radau`.
module thud_receiver_stages
   use thud_kinds, only: wp
   use thud_phi, only: get_phi
   use thud_radau, only: n_stage, radau_integral, radau_monomial, radau_node
   use thud_receiver, only: receiver_motion_type, receiver_type
   implicit none (type, external)
   private

   public :: advance_stages, get_free_motion, new_receiver_stages, receiver_stages_type

   !> Loop indices of the next constant.
   integer :: power, stage
   !> Factors m! c**m for the powers m and the stages c of time: [n_stage, n_stage].
   real(wp), parameter :: weight(n_stage, n_stage) = reshape([((gamma(real(power + 1, wp))*radau_node(stage)**power, &
      power=0, n_stage - 1), stage=1, n_stage)], [n_stage, n_stage])

   !> Response factors of one step.
   type :: receiver_stages_type
      !> Length of the step, s.
      real(wp) :: interval = 0.0_wp
      !> Velocity, m/(N s), and displacement, m/N, at each stage due to unit force at each stage: [n_stage, n_stage].
      real(wp) :: velocity(n_stage, n_stage), displacement(n_stage, n_stage)
      !> The same due to unit amplitude x_k (see `thud_receiver`) at the beginning, m/(N s2) and m/(N s): [n_pole, n_stage].
      complex(wp), allocatable :: free_velocity(:, :), free_displacement(:, :)
      !> The x_k at the end per unit x_k at the beginning: [n_pole].
      complex(wp), allocatable :: decay(:)
      !> The x_k at the end per unit force at each stage, s: [n_pole, n_stage].
      complex(wp), allocatable :: gain(:, :)
   end type receiver_stages_type

contains

   !> Response factors of steps of one length.
   pure function new_receiver_stages(receiver, interval) result(stages)
      type(receiver_type), intent(in) :: receiver
      !> Length of the steps, s.
      real(wp), intent(in) :: interval
      type(receiver_stages_type) :: stages
      complex(wp) :: phi(0:n_stage + 1), gain(n_stage), travel(n_stage)
      real(wp) :: time
      integer :: i, k, n

      n = 0
      if (allocated(receiver%pole)) n = size(receiver%pole)
      stages%interval = interval
      stages%velocity = 0.0_wp
      stages%displacement = receiver%direct*interval*radau_integral
      do i = 1, n_stage
         stages%velocity(i, i) = receiver%direct
      end do
      allocate (stages%free_velocity(n, n_stage), stages%free_displacement(n, n_stage), stages%decay(n), &
         stages%gain(n, n_stage))
      do i = 1, n_stage
         time = radau_node(i)*interval
         do k = 1, n
            phi = get_phi(receiver%pole(k)*time, n_stage + 1)
            if (i == n_stage) stages%decay(k) = phi(0)
            stages%free_velocity(k, i) = receiver%residue(k)*phi(0)
            stages%free_displacement(k, i) = receiver%residue(k)*time*phi(1)
            ! At the time c h, the force (t/h)**m gives x_k = m! c**m (c h) phi_(m+1), and the integral of x_k is
            ! m! c**m (c h)**2 phi_(m+2).
            gain = matmul(phi(1:n_stage)*weight(:, i), radau_monomial)*time
            travel = matmul(phi(2:n_stage + 1)*weight(:, i), radau_monomial)*time**2
            if (i == n_stage) stages%gain(k, :) = gain
            stages%velocity(i, :) = stages%velocity(i, :) + real(receiver%residue(k)*gain, wp)
            stages%displacement(i, :) = stages%displacement(i, :) + real(receiver%residue(k)*travel, wp)
         end do
      end do
   end function new_receiver_stages

   !> Velocity and displacement at the stages without force.
   pure subroutine get_free_motion(stages, motion, velocity, displacement)
      type(receiver_stages_type), intent(in) :: stages
      !> The motion at the beginning of the step.
      type(receiver_motion_type), intent(in) :: motion
      !> Velocity, m/s, and displacement, m, downwards: [n_stage].
      real(wp), intent(out) :: velocity(:), displacement(:)
      real(wp) :: v, w
      integer :: i, k

      ! Vectorized sums; their speed is limited by reading the factors from memory.
      do i = 1, n_stage
         v = 0.0_wp
         w = motion%displacement
         !$omp simd reduction(+:v, w)
         do k = 1, size(motion%amplitude)
            v = v + real(stages%free_velocity(k, i)*motion%amplitude(k), wp)
            w = w + real(stages%free_displacement(k, i)*motion%amplitude(k), wp)
         end do
         velocity(i) = v
         displacement(i) = w
      end do
   end subroutine get_free_motion

   !> Advances the motion by one step.
   pure subroutine advance_stages(stages, force, motion)
      type(receiver_stages_type), intent(in) :: stages
      !> The force downwards at the stages, N: [n_stage].
      real(wp), intent(in) :: force(:)
      type(receiver_motion_type), intent(inout) :: motion
      real(wp) :: w
      integer :: k

      w = motion%displacement + dot_product(stages%displacement(n_stage, :), force)
      !$omp simd reduction(+:w)
      do k = 1, size(motion%amplitude)
         w = w + real(stages%free_displacement(k, n_stage)*motion%amplitude(k), wp)
         motion%amplitude(k) = stages%decay(k)*motion%amplitude(k) + stages%gain(k, 1)*force(1) &
            + stages%gain(k, 2)*force(2) + stages%gain(k, 3)*force(3)
      end do
      motion%displacement = w
   end subroutine advance_stages

end module thud_receiver_stages
