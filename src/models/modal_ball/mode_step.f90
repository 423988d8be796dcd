!> Exact time steps of damped modes of unit modal mass.
!>
!> For a linear viscoelastic material, with a spring g, Maxwell branches g_k and a viscosity:
!> q'' + 2 zeta omega q' + omega**2 [g q + sum of g_k (q - x_k)] = 0 and x_k' = (q - x_k)/tau_k.
!>
!> All modes too fast to oscillate share the creep of the material, so their displacements at the rings follow the forces on
!> the rings as one material does: g u + sum of g_k (u - x_k) + t u' = C f and x_k' = (u - x_k)/tau_k, with the flexibility
!> C of these modes, forces f that are constant in a step, and the retardation time t; moduli are relative to the storage
!> modulus.
module thud_mode_step
   use thud_constants, only: pi
   use thud_kinds, only: wp
   use thud_matrix_exponential, only: get_exponential
   use thud_prony, only: fit_fractional_loss, get_modulus_ratio
   use thud_sphere_modes, only: family_type
   use thud_surface_rings, only: surface_rings_type
   implicit none (type, external)
   private

   public :: advance, damping_type, get_energies, get_mode_forces, get_surface, mode_step_type, new_damping, new_modes
   public :: new_static_step, set_factors, static_step_type

   !> Indices of amplitude q and rate v = q' in the motion of a mode; the internal variables x_k of the branches follow.
   integer, parameter, public :: index_amplitude = 1, index_rate = 2

   !> Damping of the material.
   type :: damping_type
      !> Loss factor of all modes; negative if it follows from the viscosity.
      real(wp) :: loss_factor = -1.0_wp
      !> Long-term modulus divided by storage modulus.
      real(wp) :: equilibrium_ratio = 1.0_wp
      !> Moduli of the branches divided by the storage modulus, and their relaxation times, s: [n_branch].
      real(wp), allocatable :: relative_modulus(:), time(:)
      !> Viscosity divided by the storage modulus, s.
      real(wp) :: retardation_time = 0.0_wp
   end type damping_type

   !> The modes and the factors of their time steps. The factors multiply the motion of a mode; an upward impulse p on the
   !> mode at the beginning adds -p times the factors of the rate v.
   type :: mode_step_type
      !> Angular frequencies for the storage modulus, rad/s: [n_mode].
      real(wp), allocatable :: omega(:)
      !> Harmonic of each mode: [n_mode].
      integer, allocatable :: harmonic(:)
      !> Index of the first mode of each harmonic, and behind the last mode of all: [0:n_harmonic].
      integer, allocatable :: first(:)
      type(damping_type) :: damping
      !> Factors of one step: [n_mode, 2 + n_branch, 2 + n_branch].
      real(wp), allocatable :: factor(:, :, :)
      !> Motion after one step from rest due to a unit force on the mode, constant in the step: [n_mode, 2 + n_branch].
      real(wp), allocatable :: gain(:, :)
      !> U and V of each mode at the outer surface, per unit amplitude: [n_mode, 2].
      real(wp), allocatable :: surface(:, :)
      !> Displacements of the rings due to unit U and V of each harmonic: [n_gap, 2*n_harmonic].
      real(wp), allocatable :: shape_at_ring(:, :)
      !> The transpose: generalized forces on U and V of each harmonic due to unit forces on the rings.
      real(wp), allocatable :: ring_load(:, :)
   end type mode_step_type

   !> Factors of a step of the modes without inertia, and their flexibility.
   type :: static_step_type
      !> Displacements of the rings due to unit forces, m/N: [n_gap, n_gap].
      real(wp), allocatable :: flexibility(:, :)
      !> Factors of u and of the internal variables in one step: [1 + n_branch, 1 + n_branch].
      real(wp), allocatable :: factor(:, :)
      !> The same variables after one step from rest due to unit C f: [1 + n_branch].
      real(wp), allocatable :: gain(:)
   end type static_step_type

contains

   !> Damping by one of the laws `constant`, `rising` and `fractional`.
   subroutine new_damping(law, loss_factor, loss_frequency, order, highest_frequency, damping)
      character(len=*), intent(in) :: law
      real(wp), intent(in) :: loss_factor
      !> Frequency of the loss factor where it is not constant, Hz; order of the fractional derivative.
      real(wp), intent(in) :: loss_frequency, order
      !> Highest frequency of modes that oscillate, at which faster ones have the constant loss factor, Hz.
      real(wp), intent(in) :: highest_frequency
      type(damping_type), intent(out) :: damping
      real(wp) :: viscosity

      allocate (damping%relative_modulus(0), damping%time(0))
      select case (law)
      case ('rising')
         damping%retardation_time = loss_factor/(2*pi*loss_frequency)
      case ('fractional')
         call fit_fractional_loss(order, loss_factor, loss_frequency, damping%relative_modulus, damping%time, viscosity)
         damping%equilibrium_ratio = 1/real(get_modulus_ratio(damping%relative_modulus, damping%time, &
            2*pi*loss_frequency), wp)
         damping%relative_modulus = damping%relative_modulus*damping%equilibrium_ratio
         damping%retardation_time = viscosity*damping%equilibrium_ratio
      case default
         damping%loss_factor = loss_factor
         damping%retardation_time = loss_factor/(2*pi*highest_frequency)
      end select
   end subroutine new_damping

   !> The modes of all harmonics, without damping and without the factors of a step.
   pure function new_modes(families, rings) result(modes)
      !> The modes that oscillate: [0:highest].
      type(family_type), intent(in) :: families(0:)
      type(surface_rings_type), intent(in) :: rings
      type(mode_step_type) :: modes
      integer :: n, n_mode, highest

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
   end function new_modes

   !> Sets the factors of one step.
   pure subroutine set_factors(modes, interval)
      !> The modes; frequencies and damping are set.
      type(mode_step_type), intent(inout) :: modes
      !> Length of a step, s.
      real(wp), intent(in) :: interval
      real(wp) :: matrix(3 + size(modes%damping%time), 3 + size(modes%damping%time))
      real(wp) :: damping_ratio
      integer :: i, k, n

      n = size(matrix, 1) - 1
      allocate (modes%factor(size(modes%omega), n, n), modes%gain(size(modes%omega), n))
      do i = 1, size(modes%omega)
         ! With the rate divided by the frequency, the elements are of similar size.
         associate (omega => modes%omega(i), damping => modes%damping)
            damping_ratio = damping%retardation_time*omega/2
            if (damping%loss_factor >= 0.0_wp) damping_ratio = damping%loss_factor/2
            matrix = 0.0_wp
            matrix(index_amplitude, index_rate) = omega
            matrix(index_rate, index_amplitude) = -omega*(damping%equilibrium_ratio + sum(damping%relative_modulus))
            matrix(index_rate, index_rate) = -2*damping_ratio*omega
            matrix(index_rate, 3:n) = omega*damping%relative_modulus
            do k = 3, n
               matrix(k, [index_amplitude, k]) = [1, -1]/damping%time(k - 2)
            end do
            ! The force, as a further variable that is constant in the step.
            matrix(index_rate, n + 1) = 1/omega
            matrix = get_exponential(interval*matrix)
            matrix(:, index_rate) = matrix(:, index_rate)/omega
            matrix(index_rate, :) = matrix(index_rate, :)*omega
         end associate
         modes%factor(i, :, :) = matrix(:n, :n)
         modes%gain(i, :) = matrix(:n, n + 1)
      end do
   end subroutine set_factors

   !> A step of the modes without inertia.
   pure function new_static_step(damping, interval, flexibility) result(step)
      type(damping_type), intent(in) :: damping
      !> Length of a step, s.
      real(wp), intent(in) :: interval
      !> Displacements of the rings due to unit forces, m/N: [n_gap, n_gap].
      real(wp), intent(in) :: flexibility(:, :)
      type(static_step_type) :: step
      real(wp) :: matrix(2 + size(damping%time), 2 + size(damping%time))
      integer :: k, n

      n = 1 + size(damping%time)
      step%flexibility = flexibility
      allocate (step%factor(n, n), step%gain(n), source=0.0_wp)
      if (.not. damping%retardation_time > 0.0_wp) then
         ! Elastic.
         step%gain(1) = 1
         return
      end if
      matrix = 0.0_wp
      matrix(1, 1) = -(damping%equilibrium_ratio + sum(damping%relative_modulus))
      matrix(1, 2:n) = damping%relative_modulus
      matrix(1, n + 1) = 1
      matrix(1, :) = matrix(1, :)/damping%retardation_time
      do k = 2, n
         matrix(k, [1, k]) = [1, -1]/damping%time(k - 1)
      end do
      matrix = get_exponential(interval*matrix)
      step%factor = matrix(:n, :n)
      step%gain = matrix(:n, n + 1)
   end function new_static_step

   !> Advances the motion of the modes by one step.
   pure subroutine advance(modes, before, after)
      type(mode_step_type), intent(in) :: modes
      !> Motion at the beginning and at the end of the step: [n_mode, 2 + n_branch].
      real(wp), intent(in), contiguous :: before(:, :)
      real(wp), intent(out), contiguous :: after(:, :)
      integer :: i, k

      do i = 1, size(after, 2)
         after(:, i) = modes%factor(:, i, 1)*before(:, 1)
         do k = 2, size(before, 2)
            after(:, i) = after(:, i) + modes%factor(:, i, k)*before(:, k)
         end do
      end do
   end subroutine advance

   !> Displacements at the outer surface, U and V of each harmonic, m: [2*n_harmonic].
   pure subroutine get_surface(modes, amplitude, displacement)
      type(mode_step_type), intent(in) :: modes
      !> Amplitudes, m sqrt(kg): [n_mode].
      real(wp), intent(in) :: amplitude(:)
      real(wp), intent(out) :: displacement(:)
      real(wp) :: u, v
      integer :: n, i

      do n = 0, ubound(modes%first, 1) - 1
         u = 0.0_wp
         v = 0.0_wp
         do i = modes%first(n), modes%first(n + 1) - 1
            u = u + modes%surface(i, 1)*amplitude(i)
            v = v + modes%surface(i, 2)*amplitude(i)
         end do
         displacement(2*n + 1) = u
         displacement(2*n + 2) = v
      end do
   end subroutine get_surface

   !> Forces on the modes due to generalized forces on U and V of each harmonic.
   pure subroutine get_mode_forces(modes, load, force)
      type(mode_step_type), intent(in) :: modes
      !> Generalized forces, N: [2*n_harmonic].
      real(wp), intent(in) :: load(:)
      !> Forces on the modes, N/sqrt(kg): [n_mode].
      real(wp), intent(out) :: force(:)
      integer :: i

      do i = 1, size(force)
         associate (k => 2*modes%harmonic(i) + 1)
            force(i) = modes%surface(i, 1)*load(k) + modes%surface(i, 2)*load(k + 1)
         end associate
      end do
   end subroutine get_mode_forces

   !> Kinetic and elastic energy of each mode, J: [n_mode].
   pure function get_energies(modes, motion) result(energy)
      type(mode_step_type), intent(in) :: modes
      !> The motion: [n_mode, 2 + n_branch].
      real(wp), intent(in) :: motion(:, :)
      real(wp) :: energy(size(modes%omega))
      integer :: k

      energy = modes%damping%equilibrium_ratio*motion(:, index_amplitude)**2
      do k = 1, size(modes%damping%relative_modulus)
         energy = energy + modes%damping%relative_modulus(k)*(motion(:, index_amplitude) - motion(:, 2 + k))**2
      end do
      energy = (motion(:, index_rate)**2 + modes%omega**2*energy)/2
   end function get_energies

end module thud_mode_step
