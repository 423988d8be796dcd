!> One time step of a source on a mobile floor: collocation at the stages of `thud_radau`, with the forces on the floor and
!> the accelerations of the masses as unknowns.
!>
!> The cap, the part of the source that lies on the floor, moves with the floor. The mass of the cap is zero at first touch,
!> and so is its time constant, the mass divided by the resistance of the floor: the equations are arbitrarily stiff. The
!> method damps such a fast decay instead of resolving it.
module thud_coupled_step
   use thud_contact_source, only: contact_source_type
   use thud_kinds, only: wp
   use thud_lapack, only: dgetf2, dgetrs
   use thud_phi, only: get_phi
   use thud_radau, only: n_stage, radau_derivative, radau_integral, radau_monomial, radau_node
   use thud_receiver, only: receiver_motion_type, receiver_type
   implicit none (type, external)
   private

   public :: advance_stages, coupled_state_type, get_free_motion, get_relative_state, new_receiver_stages
   public :: receiver_stages_type, take_coupled_step

   !> Maximum number of Newton iterations of a step.
   integer, parameter :: max_iterations = 30

   !> Number of successive iterations that use the same derivatives.
   integer, parameter :: max_reuse = 5

   !> Change of velocity, as a fraction of the scale of velocities, that ends the iterations.
   real(wp), parameter :: tolerance = 1.0e-13_wp

   !> Relative length of the finite differences for the derivatives.
   real(wp), parameter :: difference = 1.0e-7_wp

   !> Maps the values of a polynomial at the stages to its double integrals up to the stages: [n_stage, n_stage].
   real(wp), parameter :: second_integral(n_stage, n_stage) = matmul(radau_integral, radau_integral)

   !> Loop indices of the next constant.
   integer :: power, stage
   !> Factors m! c**m for the powers m and the stages c of time: [n_stage, n_stage].
   real(wp), parameter :: weight(n_stage, n_stage) = reshape([((gamma(real(power + 1, wp))*radau_node(stage)**power, &
      power=0, n_stage - 1), stage=1, n_stage)], [n_stage, n_stage])

   !> Exact response factors of a receiver under a force that is, in one step, the polynomial through its values at the
   !> stages of `thud_radau`.
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

   !> Motion of source and floor.
   type :: coupled_state_type
      !> State of the source, not relative to the floor: [n_state].
      real(wp), allocatable :: state(:)
      !> Accelerations of the masses, m/s2: [n_mass].
      real(wp), allocatable :: acceleration(:)
      !> Force on the floor, N, and velocity of the floor, m/s.
      real(wp) :: force = 0.0_wp, floor_velocity = 0.0_wp
      !> Energy given to the floor, J.
      real(wp) :: work = 0.0_wp
      !> Motion of the floor.
      type(receiver_motion_type) :: receiver_motion
   end type coupled_state_type

   !> Trial values of the unknowns, and the rate of the source's state that they give.
   type :: trial_type
      !> Forces on the floor, N: [n_stage], and accelerations, m/s2: [n_stage, n_mass].
      real(wp), allocatable :: force(:), acceleration(:, :)
      !> Displacements and velocities of the floor without the forces of this step, m and m/s: [n_stage].
      real(wp), dimension(n_stage) :: free_displacement, free_velocity
      !> Displacements, velocities and accelerations of the floor, m, m/s, m/s2: [n_stage].
      real(wp), dimension(n_stage) :: floor_displacement, floor_velocity, floor_acceleration
      !> Mass of the cap at the stages, 0 after release, kg: [n_stage].
      real(wp) :: cap_mass(n_stage)
      !> State relative to the floor at the stages, and its rate: [n_state, n_stage].
      real(wp), allocatable :: state(:, :), rate(:, :)
   end type trial_type

contains

   !> State of the equations of the source, relative to the floor: [n_state].
   pure function get_relative_state(source, coupled) result(state)
      class(contact_source_type), intent(in) :: source
      type(coupled_state_type), intent(in) :: coupled
      real(wp) :: state(source%n_state)
      integer :: n

      n = 2*source%n_mass
      state = coupled%state
      state(1:n:2) = state(1:n:2) - coupled%receiver_motion%displacement
      state(2:n:2) = state(2:n:2) - coupled%floor_velocity
   end function get_relative_state

   !> Advances source and floor by one step.
   pure subroutine take_coupled_step(source, stages, scale, start, end, valid, converged)
      class(contact_source_type), intent(in) :: source
      !> Motion of the floor at the stages of this step, per unit force and per unit initial motion.
      type(receiver_stages_type), intent(in) :: stages
      !> Scale of velocities, m/s.
      real(wp), intent(in) :: scale
      !> Motion at the beginning and at the end.
      type(coupled_state_type), intent(in) :: start
      type(coupled_state_type), intent(out) :: end
      !> Whether the source stays in the domain of its equations; whether the iterations converge.
      logical, intent(out) :: valid, converged
      type(trial_type) :: trial
      real(wp) :: matrix(n_stage*(1 + source%n_mass), n_stage*(1 + source%n_mass)), change(n_stage*(1 + source%n_mass), 1)
      integer :: pivot(n_stage*(1 + source%n_mass))
      integer :: iteration, info, n

      n = size(change)
      allocate (trial%force(n_stage), source=start%force)
      trial%acceleration = spread(start%acceleration, 1, n_stage)
      allocate (trial%state(source%n_state, n_stage), trial%rate(source%n_state, n_stage), source=0.0_wp)
      call get_free_motion(stages, start%receiver_motion, trial%free_velocity, trial%free_displacement)
      converged = .false.
      do iteration = 1, max_iterations
         call evaluate_stages(source, stages, start, trial, change(:, 1), valid)
         if (.not. valid) return
         if (mod(iteration, max_reuse) == 1) then
            call set_matrix(source, stages, scale, trial, matrix)
            call dgetf2(n, n, matrix, n, pivot, info)
            if (info /= 0) return
         end if
         call dgetrs('N', n, 1, matrix, n, pivot, change, n, info)
         ! Written so that NaN ends here too.
         if (.not. maxval(abs(change)) < huge(1.0_wp)) return
         trial%force = trial%force + change(:n_stage, 1)
         trial%acceleration = trial%acceleration + reshape(change(n_stage + 1:, 1), shape(trial%acceleration))
         converged = max(maxval(abs(change(:n_stage, 1)))/source%mass, maxval(abs(change(n_stage + 1:, 1)))) &
            *stages%interval <= tolerance*scale
         if (converged) exit
      end do
      end = start
      associate (h => stages%interval, weight => radau_integral(n_stage, :), k => 2*source%n_mass)
         end%state(1:k:2) = start%state(1:k:2) + h*start%state(2:k:2) &
            + h**2*matmul(second_integral(n_stage, :), trial%acceleration)
         end%state(2:k:2) = start%state(2:k:2) + h*matmul(weight, trial%acceleration)
         end%acceleration = trial%acceleration(n_stage, :)
         end%force = trial%force(n_stage)
         end%floor_velocity = trial%floor_velocity(n_stage)
         end%state(k + 1) = start%state(k + 1) + h*dot_product(weight, trial%force)
         end%state(k + 2) = start%state(k + 2) + h*dot_product(weight, trial%rate(k + 2, :))
         end%work = start%work + h*dot_product(weight, trial%force*trial%floor_velocity)
      end associate
      call advance_stages(stages, trial%force, end%receiver_motion)
   end subroutine take_coupled_step

   !> Motion at the stages under the trial forces and accelerations, and what they miss of the equations.
   pure subroutine evaluate_stages(source, stages, start, trial, residual, valid)
      class(contact_source_type), intent(in) :: source
      type(receiver_stages_type), intent(in) :: stages
      !> Motion at the beginning.
      type(coupled_state_type), intent(in) :: start
      type(trial_type), intent(inout) :: trial
      !> Right-hand sides of force balance and equations of motion minus the unknowns: [n_unknown].
      real(wp), intent(out) :: residual(:)
      !> Whether the source stays in the domain of its equations.
      logical, intent(out) :: valid
      integer :: i, k

      associate (h => stages%interval, w => trial%floor_displacement, u => trial%floor_velocity, state => trial%state)
         w = trial%free_displacement + matmul(stages%displacement, trial%force)
         u = trial%free_velocity + matmul(stages%velocity, trial%force)
         trial%floor_acceleration = matmul(radau_derivative, u - start%floor_velocity)/h
         do k = 1, source%n_mass
            state(2*k - 1, :) = start%state(2*k - 1) + h*radau_node*start%state(2*k) &
               + h**2*matmul(second_integral, trial%acceleration(:, k)) - w
            state(2*k, :) = start%state(2*k) + h*matmul(radau_integral, trial%acceleration(:, k)) - u
         end do
         do i = 1, n_stage
            call get_rate(source, state(:, i), trial%rate(:, i), valid)
            if (.not. valid) return
         end do
         trial%cap_mass = 0.0_wp
         if (source%touching) trial%cap_mass = source%cap_mass_per_deflection*max(state(1, :), 0.0_wp)
      end associate
      associate (n => source%n_mass)
         residual(:n_stage) = trial%rate(2*n + 1, :) - trial%force - trial%cap_mass*trial%floor_acceleration
         do k = 1, n
            residual(k*n_stage + 1:(k + 1)*n_stage) = trial%rate(2*k, :) - trial%acceleration(:, k)
         end do
      end associate
   end subroutine evaluate_stages

   !> Accelerations, force and loss of the source, all zero for a single mass in flight.
   pure subroutine get_rate(source, state, rate, valid)
      class(contact_source_type), intent(in) :: source
      !> State relative to the floor, and its rate: [n_state].
      real(wp), intent(in) :: state(:)
      real(wp), intent(out) :: rate(:)
      !> Whether the state is in the domain of the equations.
      logical, intent(out) :: valid

      if (source%touching .or. source%n_mass > 1) then
         call source%get_derivative(state, rate, valid)
      else
         valid = .true.
         rate = 0.0_wp
      end if
   end subroutine get_rate

   !> Derivative of the negative residual with respect to the unknowns.
   pure subroutine set_matrix(source, stages, scale, trial, matrix)
      class(contact_source_type), intent(in) :: source
      type(receiver_stages_type), intent(in) :: stages
      !> Scale of velocities, m/s.
      real(wp), intent(in) :: scale
      type(trial_type), intent(in) :: trial
      !> The derivative: [n_unknown, n_unknown].
      real(wp), intent(out) :: matrix(:, :)
      ! Derivatives of the rate with respect to displacements and velocities, and of these with respect to the unknowns.
      real(wp) :: by_state(source%n_state, 2*source%n_mass), state_by_unknown(2*source%n_mass, size(matrix, 2))
      real(wp) :: moved(source%n_state), rate(source%n_state)
      real(wp) :: floor_acceleration_by_force(n_stage, n_stage)
      real(wp) :: length
      integer :: i, j, k
      logical :: valid

      floor_acceleration_by_force = matmul(radau_derivative, stages%velocity)/stages%interval
      do i = 1, n_stage
         do j = 1, 2*source%n_mass
            length = difference*merge(abs(trial%state(j, i)) + scale*stages%interval, scale, mod(j, 2) == 1)
            moved = trial%state(:, i)
            ! Towards smaller values, because smaller deflections stay inside the domain.
            moved(j) = moved(j) - length
            call get_rate(source, moved, rate, valid)
            by_state(:, j) = (trial%rate(:, i) - rate)/(trial%state(j, i) - moved(j))
         end do
         state_by_unknown = 0.0_wp
         do k = 1, source%n_mass
            state_by_unknown(2*k - 1, :n_stage) = -stages%displacement(i, :)
            state_by_unknown(2*k, :n_stage) = -stages%velocity(i, :)
            associate (by_acceleration => state_by_unknown(:, k*n_stage + 1:(k + 1)*n_stage))
               by_acceleration(2*k - 1, :) = stages%interval**2*second_integral(i, :)
               by_acceleration(2*k, :) = stages%interval*radau_integral(i, :)
            end associate
         end do
         associate (force => 2*source%n_mass + 1)
            ! The mass of the cap grows with the deflection.
            if (trial%cap_mass(i) > 0.0_wp) by_state(force, 1) = by_state(force, 1) &
               - source%cap_mass_per_deflection*trial%floor_acceleration(i)
            ! The balance of the forces on the cap, then the equations of motion of the masses.
            matrix(i::n_stage, :) = -matmul(by_state([force, (2*k, k=1, source%n_mass)], :), state_by_unknown)
         end associate
         matrix(i, :n_stage) = matrix(i, :n_stage) + trial%cap_mass(i)*floor_acceleration_by_force(i, :)
      end do
      do i = 1, size(matrix, 1)
         matrix(i, i) = matrix(i, i) + 1
      end do
   end subroutine set_matrix

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

end module thud_coupled_step
