!> Options of the finite-element model, group by group; `thud_finite_element` adds the solution.
module thud_finite_element_options
   use thud_ball, only: ball_type, get_density
   use thud_band, only: octave_count
   use thud_constants, only: pi
   use thud_element_block, only: n_element
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type
   use thud_floor_contact, only: contact_options_type, get_contact_fields, new_floor_contact
   use thud_force_history, only: force_history_type
   use thud_impact_run, only: get_stable_interval
   use thud_kinds, only: wp
   use thud_material, only: check_material, get_material_fields, material_options_type, material_type, &
      new_material
   use thud_mesh, only: check_mesh, get_element_counts, get_mesh_fields, mesh_options_type, mesh_type, new_mesh
   use thud_new_field, only: in_group, integer_field, real_field
   use thud_sampling, only: get_sample_count, sampling_type
   use thud_source_model, only: resolution_type, source_model_type
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

   !> Ratio of the numbers of elements of a level of resolution to those of the next coarser one, above level 1.
   real(wp), parameter :: refinement_ratio = sqrt(2.0_wp)

   !> Number of elements along a contact radius.
   real(wp), parameter :: contact_elements = 4.5_wp

   !> Maximum ratio of the number of elements for the contact to the number for the wall.
   real(wp), parameter :: max_contact_ratio = 2.0_wp

   !> Highest level of resolution, and maximum number of steps times elements of its drop.
   integer, parameter :: highest_level = 3
   real(wp), parameter :: max_work = 5.05e7_wp

   !> Typical simulated duration of a drop, s, for the number of steps.
   real(wp), parameter :: typical_contact = 0.025_wp

   !> Coefficients of friction between which a mesh may be too coarse for the stick and slip of the surface, which then
   !> changes the levels of a finer one only (docs/finite_elements.md): smaller friction is too weak, larger friction sticks.
   !> The viscosity of Kelvin and Voigt prevents it.
   real(wp), parameter :: slip_friction(2) = [0.33_wp, 0.95_wp]

   !> Largest changes by it from the default elements to finer ones among eight balls, dB, at the octaves that the velocity
   !> of shear waves per radius makes those of `slip_ball`; the change is taken as proportional to the element size.
   real(wp), parameter :: slip_error(octave_count) = [0.05_wp, 0.2_wp, 0.4_wp, 2.0_wp, 2.0_wp]
   type(ball_type), parameter :: slip_ball = ball_type(youngs_modulus=2.08e6_wp)

   !> Options of the model.
   type, abstract, extends(source_model_type) :: finite_element_options_type
      !> Number of contacts to follow.
      integer :: bounces = 1
      !> Free flight before first touch, s.
      real(wp) :: flight_before = 0.0_wp
      !> Free flight after the last contact, s.
      real(wp) :: flight_after = 0.0_wp
      !> Time step divided by a bound on stable steps.
      real(wp) :: step_safety = 0.85_wp
      !> Time between snapshots of the deformed ball, s; 0 for none.
      real(wp) :: snapshot_interval = 0.0_wp
      type(mesh_options_type) :: mesh
      type(material_options_type) :: material
      type(contact_options_type) :: contact
   contains
      procedure :: get_fields
      procedure :: check
      procedure :: get_snapshot_shape
      procedure :: refine
   end type finite_element_options_type

contains

   !> Keys and allowed ranges; some belong to groups of their own.
   function get_fields(self) result(fields)
      class(finite_element_options_type), intent(in), target :: self
      type(field_type), allocatable :: fields(:)

      fields = [ &
         integer_field('bounces', self%bounces, 'number of contacts to compute', '[1, 100]'), &
         real_field('flight_before', self%flight_before, 's', 'duration of free flight before first touch', '[0, 1]', &
         is_numerical=.true.), &
         real_field('flight_after', self%flight_after, 's', 'duration of free flight after the last contact', &
         '[0, 10]', is_numerical=.true.), &
         real_field('step_safety', self%step_safety, '', 'time step divided by a bound on stable steps', &
         '[0.01, 0.98]', is_numerical=.true.), &
         in_group('mesh', get_mesh_fields(self%mesh)), &
         in_group('material', get_material_fields(self%material)), &
         in_group('contact', get_contact_fields(self%contact)), &
         in_group('output', [real_field('snapshot_interval', self%snapshot_interval, 's', &
         'time between snapshots of the deformed ball; 0: none', '[0, 10]', is_numerical=.true.)])]
   end function get_fields

   !> Returns an error if options do not fit each other, the ball or the memory.
   subroutine check(self, ball, sampling, error)
      class(finite_element_options_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      type(sampling_type), intent(in) :: sampling
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: bytes

      call check_material(self%material, ball, error)
      if (allocated(error)) return
      call check_mesh(self%mesh, error)
      if (allocated(error)) return
      if (self%mesh%radial_elements == 1) then
         error = input_error('&mesh: radial_elements = 1 is not allowed with finite_element; allowed: from ' &
            //to_text(min_radial)//', or 0 for automatic')
         return
      end if
      if (sampling%sample_rate < min_rate) then
         error = input_error('&sampling: sample_rate = '//to_text(sampling%sample_rate) &
            //' Hz is not allowed with finite_element; allowed: from '//to_text(min_rate)//' Hz')
         return
      end if
      ! Positions and velocities of each node.
      bytes = 32.0_wp*product(real(self%get_snapshot_shape(ball, sampling), wp))
      if (bytes > max_motion_bytes) error = input_error('&output: snapshot_interval = ' &
         //to_text(self%snapshot_interval)//' s makes '//to_text(get_frame_count(self, sampling)) &
         //' snapshots, more than the memory is meant to hold; allowed: a longer interval, or 0 for none')
   end subroutine check

   !> The model at a level of resolution: at level 0 elements of twice the size, without snapshots; above level 1 smaller
   !> ones. Automatic elements are short enough for the contact radius of the coarser drop. The error follows from the level
   !> with elements of twice the size, if there is one, for errors proportional to the square of the element size; with
   !> elements of twice the size more, since these are often outside of that order.
   subroutine refine(self, ball, level, coarse, sampling, refined, resolution)
      class(finite_element_options_type), intent(inout) :: self
      type(ball_type), intent(in) :: ball
      integer, intent(in) :: level
      type(force_history_type), intent(in) :: coarse
      type(sampling_type), intent(inout) :: sampling
      class(source_model_type), allocatable, intent(out) :: refined
      type(resolution_type), intent(out) :: resolution
      class(finite_element_options_type), allocatable :: finer
      real(wp) :: refinement
      logical :: resolves_contact

      refinement = merge(0.5_wp, refinement_ratio**(level - 1), level == 0)
      resolves_contact = chooses_resolution(self) .and. allocated(coarse%model_history)
      allocate (finer, source=self)
      associate (mesh => finer%mesh)
         mesh = get_element_counts(ball, mesh)
         if (resolves_contact) mesh%polar_elements = nint(mesh%polar_elements*max(1.0_wp, min(max_contact_ratio, &
            contact_elements*pi*ball%outer_radius/mesh%polar_elements/maxval(coarse%model_history(:, 1)))))
         mesh%radial_elements = max(min_radial, nint(mesh%radial_elements*refinement))
         mesh%polar_elements = nint(mesh%polar_elements*refinement)
      end associate
      if (level == 0) finer%snapshot_interval = 0.0_wp
      resolution = resolution_type(reference=merge(level - 2, level - 1, level > 2), &
         ratio=merge(1/(refinement_ratio**2 - 1), 0.5_wp, level == 2), min_error=get_min_error(finer, ball))
      ! Nodes that stick and slip converge more slowly.
      if (self%contact%friction > 0.0_wp) resolution%ratio = 2*resolution%ratio
      if (level > 1) resolution%lowers_error = chooses_resolution(self) .and. level <= highest_level
      if (level > 1 .and. resolution%lowers_error) resolution%lowers_error = &
         count_work(self, ball, sampling)*refinement_ratio**(3*(level - 1)) < max_work
      call move_alloc(finer, refined)
   end subroutine refine

   !> Number of steps times elements of a drop at level 1, without the finer elements of the contact.
   function count_work(self, ball, sampling) result(work)
      class(finite_element_options_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      type(sampling_type), intent(in) :: sampling
      real(wp) :: work
      type(mesh_type) :: mesh
      type(material_type) :: material
      type(error_type), allocatable :: error
      real(wp) :: interval, time

      mesh = new_mesh(ball, self%mesh)
      ! The run reports a material that cannot be.
      call new_material(self%material, ball, material, error)
      interval = 1/sampling%sample_rate
      if (.not. allocated(error)) interval = self%step_safety*get_stable_interval(mesh, material, &
         new_floor_contact(self%contact, ball, mesh))
      time = typical_contact + self%flight_before + self%flight_after
      if (self%bounces > 1) time = sampling%duration
      time = min(time, sampling%duration)
      ! Elements with the lanes that are left empty.
      work = max(time*sampling%sample_rate*sampling%substeps, time/interval) &
         *(mesh%n_radial*n_element*ceiling(mesh%n_polar/real(n_element, wp)))
   end function count_work

   !> Whether the resolution may be chosen: the user's keys do not grow.
   pure function chooses_resolution(self) result(yes)
      class(finite_element_options_type), intent(in) :: self
      logical :: yes

      yes = self%mesh%radial_elements == 0 .and. self%mesh%polar_elements == 0
   end function chooses_resolution

   !> Minimum error with friction at which a sliding surface may begin to stick and slip on its own (`slip_friction`).
   function get_min_error(self, ball) result(error)
      class(finite_element_options_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      real(wp) :: error(octave_count)
      type(mesh_options_type) :: automatic, mesh
      real(wp) :: octave, scale
      integer :: i, below
      logical :: slips

      error = 0.0_wp
      slips = self%contact%friction > slip_friction(1) .and. self%contact%friction < slip_friction(2)
      if (.not. slips .or. is_viscous(self%material)) return
      automatic = get_element_counts(ball, mesh_options_type())
      mesh = get_element_counts(ball, self%mesh)
      scale = get_shear_rate(ball)/get_shear_rate(slip_ball)
      do i = 1, octave_count
         ! The octave of `slip_ball` that corresponds to this one; octaves are 10**0.3 apart.
         octave = min(real(octave_count, wp), max(1.0_wp, i - log10(scale)/0.3_wp))
         below = min(int(octave), octave_count - 1)
         error(i) = slip_error(below) + (octave - below)*(slip_error(below + 1) - slip_error(below))
      end do
      error = error*automatic%polar_elements/mesh%polar_elements
   end function get_min_error

   !> Velocity of shear waves per outer radius, 1/s.
   pure function get_shear_rate(ball) result(rate)
      type(ball_type), intent(in) :: ball
      real(wp) :: rate

      rate = sqrt(ball%youngs_modulus/(2*(1 + ball%poisson_ratio)*get_density(ball)))/ball%outer_radius
   end function get_shear_rate

   !> Whether the viscosity of the material is that of Kelvin and Voigt.
   pure function is_viscous(material) result(yes)
      type(material_options_type), intent(in) :: material
      logical :: yes

      yes = material%viscosity == 'kelvin_voigt' .or. &
         (material%viscosity == 'fractional' .and. .not. material%fractional_order < 1.0_wp)
   end function is_viscous

   !> Size of the snapshots; of automatic elements the largest that the levels of resolution can have.
   function get_snapshot_shape(self, ball, sampling) result(extents)
      class(finite_element_options_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      type(sampling_type), intent(in) :: sampling
      integer :: extents(3)
      integer :: factor(2)

      factor = 1
      if (chooses_resolution(self)) factor = nint(refinement_ratio**(highest_level - 1)*[max_contact_ratio, 1.0_wp])
      associate (counts => get_element_counts(ball, self%mesh))
         extents = [factor*[counts%polar_elements, counts%radial_elements] + 1, get_frame_count(self, sampling)]
      end associate
   end function get_snapshot_shape

   !> Maximum number of snapshots of a run.
   pure function get_frame_count(self, sampling) result(n_frame)
      class(finite_element_options_type), intent(in) :: self
      type(sampling_type), intent(in) :: sampling
      integer :: n_frame

      n_frame = 0
      if (self%snapshot_interval > 0.0_wp) n_frame = 1 + get_sample_count(sampling)/get_stride(self, sampling)
   end function get_frame_count

   !> Number of samples between two snapshots, at least 1.
   pure function get_stride(self, sampling) result(stride)
      !> Options that ask for snapshots.
      class(finite_element_options_type), intent(in) :: self
      type(sampling_type), intent(in) :: sampling
      integer :: stride

      stride = max(1, nint(self%snapshot_interval*sampling%sample_rate))
   end function get_stride

end module thud_finite_element_options
