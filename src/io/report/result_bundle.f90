!> Results of a case as items of a bundle.
module thud_result_bundle
   use thud_bundle, only: bundle_type
   use thud_case, only: case_type
   use thud_compression, only: compression_type
   use thud_compute, only: results_type
   use thud_floor_model, only: floor_state_type
   use thud_force_history, only: force_history_type
   use thud_free_modes, only: free_modes_type
   use thud_kinds, only: wp
   use thud_quantities, only: get_quantities, history_quantity_count, quantities
   use thud_rating, only: rating_names
   use thud_room, only: get_band_records, room_level_type
   use thud_room_uncertainty, only: contribution_names
   use thud_text, only: to_text
   use thud_warnings, only: add_floor_warning, add_height_warning, add_modes_warning, warning_length
   implicit none (type, external)
   private

   public :: add_compression, add_history, add_results, add_room_level

contains

   !> Adds the results of a case to a bundle.
   subroutine add_results(bundle, case, results)
      type(bundle_type), intent(inout) :: bundle
      type(case_type), intent(in) :: case
      type(results_type), intent(in) :: results

      if (case%has_impact) call add_history(bundle, '', results%impact%history)
      if (allocated(results%on_floor)) call add_history(bundle, 'on_floor.', results%on_floor)
      if (allocated(results%room%bands)) call add_room_level(bundle, case, results%state, results%room)
      if (case%has_modes) call add_modes(bundle, results%modes)
      if (case%has_compression) call add_compression(bundle, results%compression)
      call add_warnings(bundle, 'warnings.', results%warning)
   end subroutine add_results

   !> Adds warnings to a bundle.
   subroutine add_warnings(bundle, prefix, warnings)
      type(bundle_type), intent(inout) :: bundle
      !> Prefix of the names of the items.
      character(len=*), intent(in) :: prefix
      !> Messages: [n].
      character(len=*), intent(in) :: warnings(:)
      integer :: i

      do i = 1, size(warnings)
         call bundle%add_text(prefix//to_text(i), trim(warnings(i)))
      end do
   end subroutine add_warnings

   !> Adds a force history to a bundle.
   subroutine add_history(bundle, prefix, history)
      type(bundle_type), intent(inout) :: bundle
      !> Prefix of the names of the items.
      character(len=*), intent(in) :: prefix
      type(force_history_type), intent(in) :: history
      real(wp) :: values(history_quantity_count)
      integer :: n(1)
      integer :: i

      n = size(history%deflection)
      values = get_quantities(history)
      do i = 1, history_quantity_count
         call bundle%add_number(prefix//'quantities.'//quantities(i)%name, values(i))
      end do
      do i = 1, size(history%model_quantity)
         call bundle%add_number(prefix//'model_quantities.'//history%model_quantity_name(i), history%model_quantity(i))
      end do
      call bundle%add_array(prefix//'samples.deflection', n, history%deflection)
      call bundle%add_array(prefix//'samples.velocity', n, history%velocity)
      call bundle%add_array(prefix//'samples.elastic_force', n, history%elastic_force)
      call bundle%add_array(prefix//'samples.floor_force', n, history%floor_force)
      if (allocated(history%floor_velocity)) then
         call bundle%add_array(prefix//'floor.floor_displacement', n, history%floor_displacement)
         call bundle%add_array(prefix//'floor.floor_velocity', n, history%floor_velocity)
         call bundle%add_number(prefix//'floor.floor_work', history%floor_work)
      end if
      do i = 1, size(history%component_name)
         call bundle%add_array(prefix//'components.'//history%component_name(i), n, history%component(:, i))
      end do
      if (allocated(history%model_history)) then
         do i = 1, size(history%model_history_name)
            call bundle%add_array(prefix//'model_histories.'//history%model_history_name(i), n, history%model_history(:, i))
         end do
      end if
      if (.not. allocated(history%motion)) return
      associate (motion => history%motion, n_frame => history%motion%n_frame)
         call bundle%add_array(prefix//'motion.time', [n_frame], motion%time)
         call bundle%add_array(prefix//'motion.start', shape(motion%start), motion%start)
         call bundle%add_array(prefix//'motion.position', [shape(motion%start), n_frame], motion%position)
         call bundle%add_array(prefix//'motion.velocity', [shape(motion%start), n_frame], motion%velocity)
         call bundle%add_array(prefix//'motion.contact_pressure', [size(motion%start, 1), n_frame], motion%contact_pressure)
         call bundle%add_array(prefix//'motion.contact_shear', [size(motion%start, 1), n_frame], motion%contact_shear)
         call bundle%add_array(prefix//'motion.cavity_pressure', [n_frame], motion%cavity_pressure)
         call bundle%add_array(prefix//'motion.floor_displacement', [n_frame], motion%floor_displacement)
      end associate
   end subroutine add_history

   !> Adds the level in the room below to a bundle, with warnings on the floor.
   subroutine add_room_level(bundle, case, state, room)
      type(bundle_type), intent(inout) :: bundle
      type(case_type), intent(in) :: case
      !> The floor, prepared.
      type(floor_state_type), intent(in) :: state
      type(room_level_type), intent(in) :: room
      character(len=warning_length), allocatable :: warnings(:)
      integer :: n(1)
      integer :: i

      n = size(room%bands)
      call bundle%add_number('room.surface_mass', room%surface_mass)
      call bundle%add_number('room.volume', room%volume)
      call bundle%add_number('room.n_modal', real(room%n_modal, wp))
      call bundle%add_number('room.crossover', room%crossover)
      call bundle%add_array('room_bands.frequency', n, room%bands%nominal)
      associate (records => get_band_records(room))
         do i = 1, size(records)
            call bundle%add_array('room_bands.'//trim(records(i)%name), n, records(i)%values)
         end do
      end associate
      call bundle%add_array('room_size.sides', [3], room%sides)
      do i = 1, size(contribution_names)
         call bundle%add_number('room_contributions.'//trim(contribution_names(i)), room%contribution(i))
      end do
      do i = 1, size(rating_names)
         call bundle%add_number('room_ratings.'//trim(rating_names(i)), room%rating(i))
      end do
      call bundle%add_number('room.uncertainty', room%rating_uncertainty)
      call bundle%add_array('room_paths.share', shape(room%path_share), room%path_share)
      n = size(room%octaves)
      call bundle%add_array('room_octaves.frequency', n, room%octaves%nominal)
      call bundle%add_array('room_octaves.level', n, room%octave_level)
      allocate (warnings(0))
      call add_floor_warning(case, state, warnings)
      call add_height_warning(case, state, warnings)
      call add_modes_warning(room, warnings)
      call add_warnings(bundle, 'room_warnings.', warnings)
   end subroutine add_room_level

   !> Adds free modes to a bundle.
   subroutine add_modes(bundle, modes)
      type(bundle_type), intent(inout) :: bundle
      type(free_modes_type), intent(in) :: modes

      call bundle%add_array('modes.frequency', shape(modes%frequency), modes%frequency)
      call bundle%add_array('modes.harmonic', shape(modes%harmonic), real(modes%harmonic, wp))
      call bundle%add_array('modes.participation', shape(modes%participation), modes%participation)
      call bundle%add_array('modes.r', shape(modes%r), modes%r)
      call bundle%add_array('modes.z', shape(modes%z), modes%z)
      call bundle%add_array('modes.shape', shape(modes%shape), modes%shape)
   end subroutine add_modes

   !> Adds a quasi-static compression to a bundle.
   subroutine add_compression(bundle, compression)
      type(bundle_type), intent(inout) :: bundle
      type(compression_type), intent(in) :: compression

      call bundle%add_array('compression.deflection', shape(compression%deflection), compression%deflection)
      call bundle%add_array('compression.force', shape(compression%force), compression%force)
   end subroutine add_compression

end module thud_result_bundle
