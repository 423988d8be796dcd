!> Options of the finite-element model, group by group.
module thud_finite_element_options
   use thud_ball, only: ball_type
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type
   use thud_floor_contact, only: contact_options_type, get_contact_fields
   use thud_kinds, only: wp
   use thud_material, only: check_material, get_material_fields, material_options_type
   use thud_mesh, only: get_mesh_fields, mesh_options_type
   use thud_new_field, only: integer_field, real_field
   use thud_sampling, only: get_sample_count, sampling_type
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: check_finite_element, finite_element_groups, finite_element_type, get_finite_element_fields
   public :: get_frame_count, get_stride

   !> Most memory for snapshots, bytes.
   real(wp), parameter :: max_motion_bytes = 4.0e8_wp

   !> Least sampling rate, Hz: the mean over an interval then takes 0.03 dB off the highest octave.
   real(wp), parameter :: min_rate = 16000.0_wp

   !> Least number of elements through the wall that bend as the wall does.
   integer, parameter :: min_radial = 2

   !> Groups of the options.
   character(len=*), parameter :: finite_element_groups(*) = [character(len=16) :: &
      'finite_element', 'mesh', 'material', 'contact', 'output']

   !> Options of the model.
   type :: finite_element_type
      !> Contacts to be followed.
      integer :: bounces = 1
      !> Free flight before first touch, s.
      real(wp) :: flight_before = 0.0_wp
      !> Free flight after the last contact, s.
      real(wp) :: flight_after = 0.0_wp
      !> Part of the limit of stability that a step uses.
      real(wp) :: step_safety = 0.85_wp
      !> Time between snapshots of the deformed ball, s; 0 for none.
      real(wp) :: snapshot_interval = 1.0e-3_wp
      !> Mesh.
      type(mesh_options_type) :: mesh
      !> Material.
      type(material_options_type) :: material
      !> Contact.
      type(contact_options_type) :: contact
   end type finite_element_type

contains

   !> Keys and allowed ranges of the groups `&finite_element`, `&mesh`, `&material`, `&contact` and
   !> `&output`.
   function get_finite_element_fields(options) result(fields)
      !> The options that the fields read and set.
      type(finite_element_type), intent(in), target :: options
      !> One field per component: [17].
      type(field_type), allocatable :: fields(:)
      character(len=*), parameter :: group = 'finite_element'

      fields = [ &
         integer_field(group, 'bounces', options%bounces, 'contacts to be followed', 1, 100), &
         real_field(group, 'flight_before', options%flight_before, 's', 'free flight before first touch', 0.0_wp, 1.0_wp), &
         real_field(group, 'flight_after', options%flight_after, 's', 'free flight after the last contact', &
         0.0_wp, 10.0_wp), &
         real_field(group, 'step_safety', options%step_safety, '', 'part of the limit of stability that a step uses', &
         0.01_wp, 0.98_wp), &
         get_mesh_fields(options%mesh), &
         get_material_fields(options%material), &
         get_contact_fields(options%contact), &
         real_field('output', 'snapshot_interval', options%snapshot_interval, 's', &
         'time between snapshots of the deformed ball; 0: none', 0.0_wp, 10.0_wp)]
   end function get_finite_element_fields

   !> Complains about options that do not fit each other, the ball or the memory.
   subroutine check_finite_element(options, ball, sampling, error)
      !> The options, each inside its own range.
      type(finite_element_type), intent(in) :: options
      !> The ball.
      type(ball_type), intent(in) :: ball
      !> Sampling of the record.
      type(sampling_type), intent(in) :: sampling
      !> What is wrong.
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
   end subroutine check_finite_element

   !> Most snapshots of a run.
   pure function get_frame_count(options, sampling) result(n_frame)
      !> The options.
      type(finite_element_type), intent(in) :: options
      !> Sampling of the record.
      type(sampling_type), intent(in) :: sampling
      !> The number.
      integer :: n_frame

      n_frame = 0
      if (options%snapshot_interval > 0.0_wp) n_frame = 1 + get_sample_count(sampling)/get_stride(options, sampling)
   end function get_frame_count

   !> Samples between two snapshots.
   pure function get_stride(options, sampling) result(stride)
      !> The options, with snapshots.
      type(finite_element_type), intent(in) :: options
      !> Sampling of the record.
      type(sampling_type), intent(in) :: sampling
      !> The number, at least 1.
      integer :: stride

      stride = max(1, nint(options%snapshot_interval*sampling%sample_rate))
   end function get_stride

end module thud_finite_element_options
