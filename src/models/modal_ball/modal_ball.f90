!> The improved analytical model that the paper asks for (section 5): the exact modes of the free hollow sphere under
!> unilateral contact with the floor. Apart from the numerical resolution, its only input is geometry and material.
!>
!> Modes up to a highest frequency oscillate; all others follow the forces without inertia, by their flexibility and the
!> creep of the material. Time steps are exact for each mode. In every step the forces of the surface rings make gaps and
!> pressures complementary: no ring penetrates, none pulls, and there is no penalty stiffness.
module thud_modal_ball
   use thud_ball, only: ball_type
   use thud_ball_motion, only: ball_motion_type, new_ball_motion, stays_clear, take_step
   use thud_constants, only: pi
   use thud_drop, only: drop_type, get_impact_velocity
   use thud_error, only: error_type, input_error, numerical_error
   use thud_force_history, only: add_model_quantity, add_to_means, force_history_type, max_residual, new_force_history
   use thud_interrupt, only: check_interrupt
   use thud_kinds, only: wp
   use thud_lapack, only: dgemm
   use thud_modal_ball_options, only: get_error_ratio, max_phase, modal_ball_options_type
   use thud_modal_compression, only: compress_modal_ball
   use thud_modal_damping, only: set_damping
   use thud_mode_step, only: get_energies, mode_step_type, index_amplitude, set_factors
   use thud_receiver, only: can_strike, get_pole_count, new_receiver_step, receiver_step_type, receiver_type
   use thud_ring_contact, only: new_ring_contact, ring_contact_type
   use thud_sampling, only: check_contact_samples, get_sample_count, sampling_type
   use thud_sphere_modes, only: basis_type, family_type, get_families, get_static_family, limit_family, new_basis
   use thud_static_step, only: new_static_step, static_step_type
   use thud_surface_rings, only: new_surface_rings, surface_rings_type
   use thud_text, only: fixed, significant, to_text
   use thud_validity_limit, only: get_gravity_limit, get_wall_limits, validity_limit_type
   implicit none (type, external)
   private

   public :: modal_ball_type

   !> Number of harmonics whose energies are recorded separately, from n = 0 on.
   integer, parameter :: n_family = 6

   !> The model.
   type, extends(modal_ball_options_type) :: modal_ball_type
   contains
      procedure :: solve
      procedure :: compress
      procedure :: get_standard_modulus
      procedure :: get_validity_limits
   end type modal_ball_type

contains

   !> Modulus of elasticity of the standard ball, Pa, calibrated (docs/standard_ball.md): for linear modes an effective
   !> modulus.
   function get_standard_modulus(self) result(modulus)
      class(modal_ball_type), intent(in) :: self
      real(wp) :: modulus

      modulus = 1.56e6_wp
   end function get_standard_modulus

   !> Limits of linear modes.
   function get_validity_limits(self, ball, drop, sampling, history) result(limits)
      class(modal_ball_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      type(drop_type), intent(in) :: drop
      type(sampling_type), intent(in) :: sampling
      type(force_history_type), intent(in) :: history
      type(validity_limit_type), allocatable :: limits(:)

      limits = get_wall_limits(ball, history)
      if (.not. self%contact_gravity) limits = [limits, get_gravity_limit(drop, history)]
   end function get_validity_limits

   !> Force on each of two plates in a quasi-static compression.
   subroutine compress(self, ball, deflection, force, error)
      class(modal_ball_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      real(wp), intent(in) :: deflection(:)
      real(wp), intent(out) :: force(:)
      type(error_type), allocatable, intent(out) :: error

      call compress_modal_ball(ball, self, deflection, force, error)
   end subroutine compress

   !> Force history of one drop.
   subroutine solve(self, ball, drop, sampling, history, error, receiver)
      class(modal_ball_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      type(drop_type), intent(in) :: drop
      type(sampling_type), intent(in) :: sampling
      type(force_history_type), intent(out) :: history
      type(error_type), allocatable, intent(out) :: error
      type(receiver_type), intent(in), optional :: receiver
      type(mode_step_type) :: modes
      type(static_step_type) :: static
      type(ring_contact_type) :: contact
      type(surface_rings_type) :: rings
      type(receiver_type) :: floor
      type(ball_motion_type) :: state
      real(wp) :: interval
      integer :: n_sample, i

      if (present(receiver)) floor = receiver

      n_sample = get_sample_count(sampling)
      interval = 1/(sampling%sample_rate*real(sampling%substeps, wp))
      history = new_force_history(sampling%sample_rate, n_sample, ['contact_force'])
      history%has_means = .true.
      history%impact_velocity = get_impact_velocity(drop)
      if (self%level > 0) then
         history%model_history_name = [character(len=24) :: 'contact_radius_m', &
            ('energy_n'//to_text(i)//'_J', i=0, n_family - 1), 'energy_rest_J']
      else
         history%model_history_name = [character(len=24) :: 'contact_radius_m']
      end if
      allocate (history%model_history(n_sample, size(history%model_history_name)), source=0.0_wp)
      rings = new_surface_rings(self%get_ring_count(), self%outermost_angle, self%floor_friction == 'stick')
      call prepare(self, ball, rings, floor, interval, modes, static, contact, error)
      if (.not. allocated(error)) then
         state = new_ball_motion(modes, interval, rings, floor, ball%outer_radius, history%impact_velocity, &
            merge(drop%gravity, 0.0_wp, self%contact_gravity))
         if (state%floor_moves) then
            allocate (history%floor_displacement(n_sample), history%floor_velocity(n_sample), source=0.0_wp)
         end if
         call march(ball, sampling, interval, rings, modes, static, contact, state, history, error)
         history%error_ratio = get_error_ratio(ball, history)
         call add_model_quantity(history, 'rings', '', real(size(rings%radius), wp))
         call add_model_quantity(history, 'highest_frequency', 'Hz', &
            min(self%get_highest_frequency(), max_phase/(2*pi*interval)))
         call add_model_quantity(history, 'substeps', '', real(sampling%substeps, wp))
      end if
   end subroutine solve

   !> Sets the modes, the factors of their time steps, and the response of the rings.
   subroutine prepare(self, ball, rings, floor, interval, modes, static, contact, error)
      !> Modes and damping.
      class(modal_ball_options_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      type(surface_rings_type), intent(in) :: rings
      !> The floor under the ball.
      type(receiver_type), intent(in) :: floor
      !> Length of a step, s.
      real(wp), intent(in) :: interval
      type(mode_step_type), intent(out) :: modes
      type(static_step_type), intent(out) :: static
      type(ring_contact_type), intent(out) :: contact
      !> Set if the modes cannot be computed, or if the rings cannot be distinguished.
      type(error_type), allocatable, intent(out) :: error
      type(family_type), allocatable :: families(:)
      type(receiver_step_type) :: floor_step
      real(wp), allocatable :: response(:, :), flexibility(:, :)
      real(wp), allocatable :: zeta(:)
      real(wp) :: highest_omega, own_response
      logical :: failed

      highest_omega = min(2*pi*self%get_highest_frequency(), max_phase/interval)
      if (allocated(self%families)) then
         families = self%families
      else
         call get_families(ball, self%cavity_gas, highest_omega, families, error)
         if (allocated(error)) return
      end if
      call set_modes(self, rings, highest_omega, families, modes)
      allocate (zeta, mold=modes%omega)
      call set_damping(self, modes, zeta)
      call set_factors(modes, zeta, interval)
      call get_response(self, ball, rings, families, modes, flexibility, response, error)
      if (allocated(error)) return
      static = new_static_step(modes, interval, flexibility)
      ! Response of the rigid ball and of the floor.
      floor_step = new_receiver_step(floor, interval)
      own_response = interval**2/(2*ball%mass) + floor_step%compliance
      response = static%gain(1)*flexibility + response
      response(::rings%n_dof, ::rings%n_dof) = response(::rings%n_dof, ::rings%n_dof) + own_response
      call new_ring_contact(response, rings%n_dof, contact, failed)
      if (failed) error = numerical_error('&modal_ball: rings = '//to_text(size(rings%radius)) &
         //' cannot be distinguished; allowed: fewer rings, or more substeps')
   end subroutine prepare

   !> Sets the modes that oscillate.
   subroutine set_modes(self, rings, highest_omega, families, modes)
      !> Harmonics treated as quasi-static.
      class(modal_ball_options_type), intent(in) :: self
      type(surface_rings_type), intent(in) :: rings
      !> Highest angular frequency of modes that oscillate, rad/s.
      real(wp), intent(in) :: highest_omega
      !> All modes; only those that oscillate remain, and the flexibility of the others: [0:highest].
      type(family_type), intent(inout) :: families(0:)
      !> The modes; their frequencies, harmonics and shapes are set here.
      type(mode_step_type), intent(inout) :: modes
      integer :: n, n_mode, highest

      do n = 0, ubound(families, 1)
         associate (chosen => self%static_families)
            call limit_family(merge(0.0_wp, highest_omega, any(nint(chosen%values(:chosen%count)) == n)), families(n))
         end associate
      end do
      highest = min(ubound(families, 1), ubound(rings%shape_at_ring, 3))
      n_mode = sum([(size(families(n)%omega), n=0, highest)])
      allocate (modes%omega(n_mode), modes%harmonic(n_mode), modes%surface(n_mode, 2))
      allocate (modes%first(0:highest + 1))
      modes%first(0) = 1
      do n = 0, highest
         modes%first(n + 1) = modes%first(n) + size(families(n)%omega)
         associate (first => modes%first(n), last => modes%first(n + 1) - 1)
            modes%omega(first:last) = families(n)%omega
            modes%harmonic(first:last) = n
            modes%surface(first:last, :) = transpose(families(n)%surface)
         end associate
      end do
      modes%shape_at_ring = reshape(rings%shape_at_ring(:, :, :highest), [size(rings%shape_at_ring, 1), 2*(highest + 1)])
      modes%ring_load = transpose(modes%shape_at_ring)
   end subroutine set_modes

   !> Displacements of the rings due to unit forces on them.
   subroutine get_response(self, ball, rings, families, modes, flexibility, response, error)
      class(modal_ball_options_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      type(surface_rings_type), intent(in) :: rings
      !> Families that have modes: [0:highest].
      type(family_type), intent(in) :: families(0:)
      !> The modes and their gains.
      type(mode_step_type), intent(in) :: modes
      !> Due to the modes without inertia, m/N: [n_gap, n_gap].
      real(wp), allocatable, intent(out) :: flexibility(:, :)
      !> Due to the oscillating modes after one step, m/N: [n_gap, n_gap].
      real(wp), allocatable, intent(out) :: response(:, :)
      !> Set if a flexibility cannot be computed.
      type(error_type), allocatable, intent(out) :: error
      type(basis_type) :: basis
      type(family_type) :: family
      real(wp), allocatable :: displacement(:, :, :)
      real(wp) :: gain(2, 2, 0:ubound(families, 1))
      logical :: failed
      integer :: n, i, highest

      highest = ubound(rings%shape_at_ring, 3)
      basis = new_basis(ball, 0, self%cavity_gas)
      associate (n_gap => size(rings%shape_at_ring, 1))
         allocate (displacement(n_gap, 2, 0:highest), flexibility(n_gap, n_gap), response(n_gap, n_gap))
      end associate
      do n = 0, highest
         if (n <= ubound(families, 1)) then
            displacement(:, :, n) = product_of(rings%shape_at_ring(:, :, n), families(n)%flexibility)
            cycle
         end if
         call get_static_family(basis, n, family, failed)
         if (failed) then
            error = numerical_error('&modal_ball: rings: the flexibility of harmonic '//to_text(n) &
               //' cannot be computed; allowed: fewer rings, or a thinner wall')
            return
         end if
         displacement(:, :, n) = product_of(rings%shape_at_ring(:, :, n), family%flexibility)
      end do
      call multiply(displacement, flexibility)
      gain = 0.0_wp
      do i = 1, size(modes%omega)
         associate (g => gain(:, :, modes%harmonic(i)), surface => modes%surface(i, :))
            g = g + modes%gain(i, index_amplitude)*spread(surface, 1, 2)*spread(surface, 2, 2)
         end associate
      end do
      highest = size(modes%shape_at_ring, 2)/2 - 1
      do n = 0, highest
         displacement(:, :, n) = product_of(rings%shape_at_ring(:, :, n), gain(:, :, n))
      end do
      call multiply(displacement(:, :, :highest), response)

   contains

      !> The shapes at the rings of one harmonic, times a matrix: [n_gap, 2].
      pure function product_of(shape_at_ring, matrix) result(product)
         real(wp), intent(in) :: shape_at_ring(:, :)
         real(wp), intent(in) :: matrix(2, 2)
         real(wp) :: product(size(shape_at_ring, 1), 2)
         integer :: j

         do j = 1, 2
            product(:, j) = shape_at_ring(:, 1)*matrix(1, j) + shape_at_ring(:, 2)*matrix(2, j)
         end do
      end function product_of

      !> Sum over harmonics of displacements times the shapes at the rings.
      subroutine multiply(displacement, sum_of_products)
         real(wp), intent(in), contiguous :: displacement(:, :, 0:)
         real(wp), intent(out), contiguous :: sum_of_products(:, :)

         associate (n_gap => size(displacement, 1), n_column => 2*size(displacement, 3))
            call dgemm('N', 'T', n_gap, n_gap, n_column, 1.0_wp, displacement, n_gap, rings%shape_at_ring, n_gap, 0.0_wp, &
               sum_of_products, n_gap)
         end associate
      end subroutine multiply

   end subroutine get_response

   !> Integrates in time from first touch until the ball has left for good, or on a mobile floor to the end of the record.
   subroutine march(ball, sampling, interval, rings, modes, static, contact, state, history, error)
      type(ball_type), intent(in) :: ball
      type(sampling_type), intent(in) :: sampling
      real(wp), intent(in) :: interval
      type(surface_rings_type), intent(in) :: rings
      type(mode_step_type), intent(in) :: modes
      type(static_step_type), intent(in) :: static
      type(ring_contact_type), intent(inout) :: contact
      !> Motion of ball and floor.
      type(ball_motion_type), intent(inout) :: state
      type(force_history_type), intent(inout) :: history
      !> Set if the contact outlasts the record, or if too much energy is lost in the contact.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: settling_time, before, fraction, clearance, last_clearance
      integer :: i, j, n_step, last_contact, nearest
      logical :: has_separated

      ! The surface may touch again while the slowest mode swings back, half a period later.
      settling_time = 0.0_wp
      if (size(modes%omega) > 0) settling_time = pi/(sqrt(modes%equilibrium_ratio)*minval(modes%omega))
      last_contact = 0
      clearance = 0.0_wp
      has_separated = .false.
      samples: do i = 1, size(history%floor_force)
         call record_motion(ball, modes, state, i, history)
         do j = 1, sampling%substeps
            n_step = (i - 1)*sampling%substeps + j
            fraction = min(1.0_wp, max(0.0_wp, j - sampling%substeps/2.0_wp))
            before = state%floor_motion%displacement
            call take_step(modes, static, interval, ball%mass, state, contact, error)
            call check_interrupt(error)
            if (allocated(error)) return
            last_clearance = clearance
            clearance = minval(state%gap(::contact%n_dof))
            if (contact%outermost > 0) then
               last_contact = n_step
               history%impulse = history%impulse + state%force*interval
               history%step_peak_force = max(history%step_peak_force, state%force)
               call add_to_means(state%force*interval, 1/sampling%sample_rate, i, fraction, history%component(:, 1))
               nearest = min(i + nint(fraction), size(history%floor_force))
               history%model_history(nearest, 1) = max(history%model_history(nearest, 1), &
                  ball%outer_radius*rings%radius(contact%outermost))
            else if (n_step == last_contact + 1) then
               ! Forces are means over a step that close the gaps at its end.
               history%exact_contact_time = (n_step - 0.5_wp - clearance/(clearance - last_clearance))*interval
            end if
            if (contact%outermost == size(rings%radius)) then
               error = numerical_error('&ball: youngs_modulus = '//to_text(ball%youngs_modulus)//' Pa is too low for this ' &
                  //'drop: '//significant(1.0e3_wp*n_step*interval, 3)//' ms after first touch the ball lies on its ' &
                  //'outermost ring, its center lowered by ' &
                  //significant(1.0e3_wp*(ball%outer_radius - state%height), 3)//' mm; allowed: a stiffer ball, or a ' &
                  //'lower height')
               return
            end if
            if (state%floor_moves) call add_to_means(state%floor_motion%displacement - before, 1/sampling%sample_rate, i, &
               fraction, history%floor_velocity)
            has_separated = state%velocity > 0.0_wp .and. (n_step - last_contact)*interval > settling_time
            if (has_separated .and. .not. state%floor_moves) exit samples
         end do
         if (contact%outermost == 0 .and. .not. state%floor_moves) then
            ! Without gravity the end is often certain sooner.
            has_separated = stays_clear(modes, contact%n_dof, state)
            if (has_separated) exit samples
         end if
      end do samples
      if (state%floor_moves) history%velocity = history%velocity - history%floor_velocity
      call check_end(sampling, settling_time, has_separated, contact, state, error)
      if (allocated(error)) return
      history%contact_time = last_contact*interval
      call check_contact_samples(sampling, history%contact_time, error)
      if (.not. allocated(error)) call finish(ball, n_step*interval, modes, state, history, error)
   end subroutine march

   !> Returns an error if the record ends too early.
   subroutine check_end(sampling, settling_time, has_separated, contact, state, error)
      type(sampling_type), intent(in) :: sampling
      !> Time without contact after which the surface no longer touches, s.
      real(wp), intent(in) :: settling_time
      !> Whether this time has passed and the ball rises.
      logical, intent(in) :: has_separated
      type(ring_contact_type), intent(in) :: contact
      !> Motion of ball and floor.
      type(ball_motion_type), intent(in) :: state
      !> Set if the ball touches the floor or may touch it again.
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: cause, allowed

      if (.not. has_separated) then
         cause = ''
         allowed = 'longer than that'
         if (state%floor_moves) then
            cause = ', probably because the floor is so soft that the ball sinks into it instead of rebounding'
            allowed = 'a stiffer floor, covering or floating plate, or a longer duration'
         end if
         error = input_error('&sampling: duration = '//to_text(sampling%duration)//' s ends less than ' &
            //fixed(1.0e3_wp*settling_time, 1)//' ms after the last contact'//cause//'; allowed: '//allowed)
      else if (state%floor_moves) then
         if (can_strike(state%floor, state%floor_motion, minval(state%gap(::contact%n_dof)), state%velocity)) then
            error = input_error('&sampling: duration = '//to_text(sampling%duration) &
               //' s ends while the floor may strike the ball again; allowed: longer')
         end if
      end if
   end subroutine check_end

   !> Sets the scalars of the impact, and checks the balances.
   subroutine finish(ball, time, modes, state, history, error)
      type(ball_type), intent(in) :: ball
      !> Time since first touch, s.
      real(wp), intent(in) :: time
      type(mode_step_type), intent(in) :: modes
      !> Motion of the ball after the contact.
      type(ball_motion_type), intent(in) :: state
      !> The history; its samples are complete.
      type(force_history_type), intent(inout) :: history
      !> Set if the balance of energy does not close.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: energy, gain, initial

      history%elastic_force = history%component(:, 1)
      history%floor_force = history%component(:, 1)
      history%peak_force = maxval(history%floor_force)
      history%peak_elastic_force = history%peak_force
      history%max_deflection = maxval(history%deflection, mask=history%floor_force > 0.0_wp)
      ! Extrapolated back to the end of the contact.
      history%restitution = (state%velocity + state%gravity*(time - history%contact_time))/history%impact_velocity
      gain = ball%mass*(history%impact_velocity + state%velocity + state%gravity*time)
      history%impulse_residual = abs(history%impulse - gain)/gain
      history%floor_work = state%floor_work
      call add_model_quantity(history, 'contact_loss', 'J', state%contact_loss)
      initial = ball%mass/2*history%impact_velocity**2
      energy = ball%mass*(state%velocity**2/2 + state%gravity*(state%height - ball%outer_radius)) &
         + state%loss + state%contact_loss + state%floor_work
      history%energy_residual = abs(energy - initial)/initial
      ! Written so that NaN fails too.
      if (.not. history%energy_residual <= max_residual) error = numerical_error('&sampling: substeps is too low: the ' &
         //'balance of energy misses by '//to_text(history%energy_residual)//'; allowed: up to '//to_text(max_residual))
   end subroutine finish

   !> Writes motion and energies of one sample into the history.
   pure subroutine record_motion(ball, modes, state, i, history)
      type(ball_type), intent(in) :: ball
      type(mode_step_type), intent(in) :: modes
      !> Motion of the ball.
      type(ball_motion_type), intent(in) :: state
      !> Index of the sample.
      integer, intent(in) :: i
      type(force_history_type), intent(inout) :: history
      real(wp) :: energy(size(modes%omega))
      integer :: n

      history%deflection(i) = ball%outer_radius - state%height - state%floor_motion%displacement
      history%velocity(i) = -state%velocity
      if (state%floor_moves) history%floor_displacement(i) = state%floor_motion%displacement
      ! A level without an own result has no energies.
      if (size(history%model_history, 2) == 1) return
      energy = get_energies(modes, state%motion)
      associate (n_harmonic => ubound(modes%first, 1))
         do n = 0, min(n_family, n_harmonic) - 1
            history%model_history(i, 2 + n) = sum(energy(modes%first(n):modes%first(n + 1) - 1))
         end do
         history%model_history(i, 2 + n_family) = sum(energy(modes%first(min(n_family, n_harmonic)):))
      end associate
   end subroutine record_motion

end module thud_modal_ball
