!> Results on a mobile floor: levels of the contact force, energy injected into the floor, and velocities of points.
module thud_floor_result
   use thud_band, only: band_type, get_level_bands
   use thud_case, only: case_type, get_floor_number
   use thud_error, only: error_type
   use thud_floor_model, only: floor_state_type, get_transfer
   use thud_force_exposure, only: get_force_exposure_levels
   use thud_force_history, only: force_history_type
   use thud_injected_energy, only: get_injected_energies, get_mean_conductances, get_total_energy
   use thud_kinds, only: wp
   use thud_receiver, only: advance_receiver, get_receiver_velocity, new_receiver_motion, new_receiver_step, &
      receiver_motion_type, receiver_step_type, receiver_type
   implicit none (type, external)
   private

   public :: floor_result_type, get_floor_result, get_velocities

   !> Results on a mobile floor; bands of several sets follow each other.
   type :: floor_result_type
      !> The bands: [n_band].
      type(band_type), allocatable :: bands(:)
      !> Levels of the force on the floor, dB: [n_band].
      real(wp), allocatable :: contact_level(:)
      !> Energy injected into the floor, J: [n_band].
      real(wp), allocatable :: energy(:)
      !> Energy injected in all frequencies, J; up to errors of the time steps, the work of the simulated motion.
      real(wp) :: total_energy = 0.0_wp
      !> Mean real part of the mobility, m/(N s): [n_band].
      real(wp), allocatable :: conductance(:)
      !> Velocities of points of the floor, m/s: [n_sample, n_point].
      real(wp), allocatable :: point_velocity(:, :)
   end type floor_result_type

contains

   !> Results on the floor of a case.
   subroutine get_floor_result(case, state, contact, energies, floor_result, error)
      type(case_type), intent(in) :: case
      !> The floor, prepared.
      type(floor_state_type), intent(in) :: state
      !> The drop on the floor.
      type(force_history_type), intent(in) :: contact
      !> Also compute energies and velocities of points.
      logical, intent(in) :: energies
      type(floor_result_type), intent(out) :: floor_result
      !> Set if a level cannot be computed, or a point is not on the floor.
      type(error_type), allocatable, intent(out) :: error
      type(receiver_type) :: transfer
      integer :: first, n, i

      call get_level_bands(case%bands, floor_result%bands, first)
      floor_result%bands = floor_result%bands(first:)
      n = size(floor_result%bands)
      allocate (floor_result%contact_level(n), floor_result%energy(n))
      call get_force_exposure_levels(contact%floor_force, contact%sample_rate, floor_result%bands, trim(case%level_method), &
         floor_result%contact_level, error)
      if (allocated(error) .or. .not. energies) return
      associate (floor => case%floors(get_floor_number(case))%model, receiver => state%receiver)
         call get_injected_energies(receiver, contact%floor_force, contact%sample_rate, floor_result%bands, &
            floor_result%energy, error)
         if (allocated(error)) return
         floor_result%total_energy = get_total_energy(receiver, contact%floor_force, contact%sample_rate)
         floor_result%conductance = get_mean_conductances(receiver, floor_result%bands)
         allocate (floor_result%point_velocity(size(contact%floor_force), floor%point_x%count))
         do i = 1, floor%point_x%count
            call get_transfer(state, floor%point_x%values(i), floor%point_y%values(i), transfer, error)
            if (allocated(error)) return
            floor_result%point_velocity(:, i) = get_velocities(transfer, contact%floor_force, contact%sample_rate)
         end do
      end associate
   end subroutine get_floor_result

   !> Velocities of a point under a force, m/s: [n_sample].
   pure function get_velocities(transfer, force, sample_rate) result(velocity)
      !> The mobility from the force to the point.
      type(receiver_type), intent(in) :: transfer
      !> The force, N: [n_sample].
      real(wp), intent(in) :: force(:)
      !> Samples per second, Hz.
      real(wp), intent(in) :: sample_rate
      real(wp) :: velocity(size(force))
      type(receiver_step_type) :: step
      type(receiver_motion_type) :: motion
      integer :: i

      motion = new_receiver_motion(transfer)
      step = new_receiver_step(transfer, 1/sample_rate)
      velocity(1) = get_receiver_velocity(transfer, force(1), motion)
      do i = 2, size(force)
         call advance_receiver(step, (force(i - 1) + force(i))/2, motion)
         velocity(i) = get_receiver_velocity(transfer, force(i), motion)
      end do
   end function get_velocities

end module thud_floor_result
