!> Options of the finite-element model, group by group; `thud_finite_element` adds the solution.
module thud_finite_element_options
   use thud_ball, only: ball_type
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type
   use thud_floor_contact, only: contact_options_type, get_contact_fields
   use thud_force_history, only: force_history_type
   use thud_kinds, only: wp
   use thud_material, only: check_material, get_material_fields, material_options_type
   use thud_mesh, only: get_mesh_fields, mesh_options_type
   use thud_new_field, only: in_group, integer_field, real_field
   use thud_sampling, only: get_sample_count, sampling_type
   use thud_source_model, only: source_model_type
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: finite_element_options_type, get_frame_count, get_stride

   !> Maximum memory for snapshots, bytes.
   real(wp), parameter :: max_motion_bytes = 4.0e8_wp

   !> Minimum sampling rate, Hz: the mean over an interval then lowers the highest octave by 0.03 dB.
   real(wp), parameter :: min_rate = 16000.0_wp

   !> Minimum number of elements through the wall; fewer do not bend as the wall does.
   integer, parameter :: min_radial = 2

   !> Options of the model.
   type, abstract, extends(source_model_type) :: finite_element_options_type
      !> Number of contacts to follow.
      integer :: bounces = 1
      !> Free flight before first touch, s.
      real(wp) :: flight_before = 0.0_wp
      !> Free flight after the last contact, s.
      real(wp) :: flight_after = 0.0_wp
      !> Time step as a fraction of the stability limit.
      real(wp) :: step_safety = 0.85_wp
      !> Time between snapshots of the deformed ball, s; 0 for none.
      real(wp) :: snapshot_interval = 0.0_wp
      type(mesh_options_type) :: mesh
      type(material_options_type) :: material
      type(contact_options_type) :: contact
   contains
      procedure, pass(options) :: get_fields
      procedure, pass(options) :: check
      procedure, pass(options) :: get_snapshot_shape
      procedure, pass(options) :: set_level
   end type finite_element_options_type

contains

   !> Keys and allowed ranges; some belong to groups of their own.
   function get_fields(options) result(fields)
      class(finite_element_options_type), intent(in), target :: options
      type(field_type), allocatable :: fields(:)

      fields = [ &
         integer_field('bounces', options%bounces, 'number of contacts to compute', '[1, 100]'), &
         real_field('flight_before', options%flight_before, 's', 'duration of free flight before first touch', '[0, 1]'), &
         real_field('flight_after', options%flight_after, 's', 'duration of free flight after the last contact', &
         '[0, 10]'), &
         real_field('step_safety', options%step_safety, '', 'time step divided by the stability limit', &
         '[0.01, 0.98]'), &
         in_group('mesh', get_mesh_fields(options%mesh)), &
         in_group('material', get_material_fields(options%material)), &
         in_group('contact', get_contact_fields(options%contact)), &
         in_group('output', [real_field('snapshot_interval', options%snapshot_interval, 's', &
         'time between snapshots of the deformed ball; 0: none', '[0, 10]')])]
   end function get_fields

   !> Returns an error if options do not fit each other, the ball or the memory.
   subroutine check(ball, options, sampling, error)
      type(ball_type), intent(in) :: ball
      class(finite_element_options_type), intent(in) :: options
      type(sampling_type), intent(in) :: sampling
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: bytes

      call check_material(options%material, ball, error)
      if (allocated(error)) return
      if (options%mesh%radial_elements < min_radial) then
         error = input_error('&mesh: radial_elements = '//to_text(options%mesh%radial_elements) &
            //' is not allowed with finite_element; allowed: from '//to_text(min_radial))
         return
      end if
      if (sampling%sample_rate < min_rate) then
         error = input_error('&sampling: sample_rate = '//to_text(sampling%sample_rate) &
            //' Hz is not allowed with finite_element; allowed: from '//to_text(min_rate)//' Hz')
         return
      end if
      ! Positions and velocities of each node.
      bytes = 32.0_wp*(options%mesh%radial_elements + 1)*(options%mesh%polar_elements + 1)*get_frame_count(options, sampling)
      if (bytes > max_motion_bytes) error = input_error('&output: snapshot_interval = ' &
         //to_text(options%snapshot_interval)//' s makes '//to_text(get_frame_count(options, sampling)) &
         //' snapshots, more than the memory is meant to hold; allowed: a longer interval, or 0 for none')
   end subroutine check

   !> Sets the resolution: at level 0 elements of twice the size, without snapshots.
   subroutine set_level(ball, options, level, sampling, coarse)
      type(ball_type), intent(in) :: ball
      class(finite_element_options_type), intent(inout) :: options
      integer, intent(in) :: level
      type(sampling_type), intent(inout) :: sampling
      type(force_history_type), intent(in) :: coarse

      if (level > 0) return
      options%mesh%radial_elements = max(min_radial, options%mesh%radial_elements/2)
      options%mesh%polar_elements = options%mesh%polar_elements/2
      options%snapshot_interval = 0.0_wp
   end subroutine set_level

   !> Size of the snapshots.
   function get_snapshot_shape(options, sampling) result(extents)
      class(finite_element_options_type), intent(in) :: options
      type(sampling_type), intent(in) :: sampling
      integer :: extents(3)

      extents = [options%mesh%polar_elements + 1, options%mesh%radial_elements + 1, get_frame_count(options, sampling)]
   end function get_snapshot_shape

   !> Maximum number of snapshots of a run.
   pure function get_frame_count(options, sampling) result(n_frame)
      class(finite_element_options_type), intent(in) :: options
      type(sampling_type), intent(in) :: sampling
      integer :: n_frame

      n_frame = 0
      if (options%snapshot_interval > 0.0_wp) n_frame = 1 + get_sample_count(sampling)/get_stride(options, sampling)
   end function get_frame_count

   !> Number of samples between two snapshots, at least 1.
   pure function get_stride(options, sampling) result(stride)
      !> Options that ask for snapshots.
      class(finite_element_options_type), intent(in) :: options
      type(sampling_type), intent(in) :: sampling
      integer :: stride

      stride = max(1, nint(options%snapshot_interval*sampling%sample_rate))
   end function get_stride

end module thud_finite_element_options
