!> A timber joist floor: sheathing on joists as ribs; its mean properties are those of an orthotropic plate.
module thud_joist_floor
   use thud_constants, only: pi
   use thud_field, only: field_type, name_length, new_field
   use thud_floor_model, only: floor_state_type
   use thud_kinds, only: wp
   use thud_plate, only: get_thin_limit, plate_type
   use thud_plate_stack, only: get_spaced_positions, new_orthotropic, orthotropic_type, ribs_type
   use thud_rectangular_floor, only: rectangular_floor_type
   implicit none (type, external)
   private

   public :: joist_floor_type

   !> Ratio of the shear modulus of softwood to its modulus of elasticity (EN 338).
   real(wp), parameter :: shear_ratio = 1.0_wp/16

   !> The floor; the defaults are chipboard screwed to softwood joists.
   type, extends(rectangular_floor_type) :: joist_floor_type
      !> Span of the joists, and width across them, m.
      real(wp) :: length = 4.0_wp, width = 5.0_wp
      !> Thickness of the sheathing, m; its density, kg/m3; its modulus of elasticity in bending, Pa.
      real(wp) :: sheathing_thickness = 0.022_wp, sheathing_density = 650.0_wp, sheathing_modulus = 3.0e9_wp
      !> Distance between the axes of joists, m.
      real(wp) :: spacing = 0.4_wp
      !> Width and height of a joist, m; its density, kg/m3; its modulus of elasticity, Pa.
      real(wp) :: joist_width = 0.06_wp, joist_height = 0.22_wp, joist_density = 420.0_wp, joist_modulus = 1.1e10_wp
      !> Factor gamma of the connection of sheathing and joists over the span: an estimate for screwed chipboard.
      real(wp) :: connection = 0.1_wp
      !> Loss factor including that of the edges, without radiation.
      real(wp) :: loss_factor = 0.05_wp
      !> Impact location: midway between the next two joists (`sheathing`), the next `joist`, or exactly the `position`.
      character(len=name_length) :: source_on = 'sheathing'
   contains
      procedure :: get_fields
      procedure :: get_bearing
   end type joist_floor_type

contains

   !> Keys and allowed ranges of the group `&joist_floor`.
   function get_fields(self) result(fields)
      class(joist_floor_type), intent(in), target :: self
      type(field_type), allocatable :: fields(:)

      fields = [ &
         new_field('length', self%length, 'm', 'span of the joists', '[0.5, 100]'), &
         new_field('width', self%width, 'm', 'width of the floor across the joists', '[0.5, 100]'), &
         new_field('sheathing_thickness', self%sheathing_thickness, 'm', 'thickness of the sheathing', '[0.003, 0.3]'), &
         new_field('sheathing_density', self%sheathing_density, 'kg/m3', 'density of the sheathing', '[10, 20000]'), &
         new_field('sheathing_modulus', self%sheathing_modulus, 'Pa', &
         'modulus of elasticity of the sheathing in bending', '[1e7, 1e12]'), &
         new_field('spacing', self%spacing, 'm', &
         'distance between the axes of adjacent joists', '(joist_width, width)'), &
         new_field('joist_width', self%joist_width, 'm', 'width of a joist', '[0.005, 1]'), &
         new_field('joist_height', self%joist_height, 'm', 'height of a joist', '[0.01, 2]'), &
         new_field('joist_density', self%joist_density, 'kg/m3', 'density of the joists', '[10, 20000]'), &
         new_field('joist_modulus', self%joist_modulus, 'Pa', 'modulus of elasticity of the joists', '[1e7, 1e12]'), &
         new_field('connection', self%connection, '', &
         'composite action of sheathing and joists over the span, 0 (loose) to 1 (glued), EN 1995-1-1 annex B', '[0, 1]'), &
         new_field('loss_factor', self%loss_factor, '', &
         'loss factor of the floor including its edges, without radiation', '(0, 1]'), &
         self%get_source_fields(), &
         new_field('source_on', self%source_on, '', &
         'impact location: midway between the next joists, on the next joist, or exactly the position', &
         choices=[character(len=9) :: 'sheathing', 'joist', 'position']), &
         self%get_build_up_fields(.true.), self%get_point_fields()]
   end function get_fields

   !> The smeared plate, and the sheathing with its joists.
   subroutine get_bearing(self, state, bearing)
      class(joist_floor_type), intent(in) :: self
      type(floor_state_type), intent(inout) :: state
      type(orthotropic_type), intent(out) :: bearing
      type(plate_type) :: sheathing
      type(ribs_type) :: joists

      state%group = 'joist_floor'
      state%has_modal_conductance = .true.
      sheathing = plate_type(length=self%length, width=self%width, thickness=self%sheathing_thickness, &
         density=self%sheathing_density, wave_speed=sqrt(self%sheathing_modulus/self%sheathing_density), &
         loss_factor=self%loss_factor)
      bearing = new_orthotropic(sheathing)
      state%highest_frequency = get_thin_limit(sheathing)
      state%validity_reason = 'bending waves are shorter than six thicknesses of the sheathing, and it is not thin'
      associate (e => self%joist_modulus, b => self%joist_width, h => self%joist_height, &
         arm => (self%joist_height + self%sheathing_thickness)/2)
         joists%position = get_spaced_positions(self%width, self%spacing, b)
         associate (middle => (joists%position(:size(joists%position) - 1) + joists%position(2:))/2, &
            y => self%source_y*self%width)
            if (self%source_on == 'joist') state%source(2) = &
               joists%position(minloc(abs(joists%position - y), dim=1))/self%width
            if (self%source_on == 'sheathing' .and. size(middle) > 0) state%source(2) = &
               middle(minloc(abs(middle - y), dim=1))/self%width
         end associate
         joists%bending = e*b*h**3/12
         call get_composite(self, joists%composite, joists%slip)
         ! Shear coefficient of a rectangle: 5/6.
         joists%shear = 5*shear_ratio*e*b*h/6
         joists%torsion = shear_ratio*e*get_torsion_constant(b, h)
         joists%mass = self%joist_density*b*h
         joists%inertia = joists%mass*(b**2 + h**2)/12
         ! A free joist swings about the sheathing, and bends sideways where it twists; a subceiling holds it.
         if (.not. self%subceiling%thickness > 0.0_wp) then
            joists%inertia = joists%inertia + joists%mass*arm**2
            joists%warping = e*h*b**3/12*arm**2
         end if
      end associate
      joists%loss_factor = self%loss_factor
      state%plate = get_smeared(self, bearing%along, bearing%mass, joists)
      allocate (bearing%ribs, source=joists)
   end subroutine get_bearing

   !> Bending stiffness that the sheathing adds to a joist, without that of its own bending, and its slip
   !> (EN 1995-1-1 annex B: a deflection with the wavenumber k has gamma = 1/(1 + E A k**2/K) with the sheathing's axial
   !> stiffness E A and the slip modulus K per length).
   pure subroutine get_composite(self, composite, slip)
      class(joist_floor_type), intent(in) :: self
      !> Bending stiffness without slip, N m2, and slip by shear force, 1/N.
      real(wp), intent(out) :: composite, slip
      real(wp) :: sheathing, joist, arm
      ! Loose sheathing slips freely.
      real(wp), parameter :: loose = 1.0e-15_wp

      sheathing = self%sheathing_modulus*self%sheathing_thickness*self%spacing
      joist = self%joist_modulus*self%joist_width*self%joist_height
      arm = (self%joist_height + self%sheathing_thickness)/2
      composite = arm**2*sheathing*joist/(sheathing + joist)
      slip = (1/max(self%connection, loose) - 1)/(sheathing*arm**2)*(self%length/pi)**2
   end subroutine get_composite

   !> The orthotropic plate with smeared joists, as thick as the sheathing.
   !>
   !> The bending stiffness along the joists is that of sheathing and joists over the span, across them B' of the sheathing;
   !> H = B' + G J of a joist/(2 spacing) (Timoshenko and Woinowsky-Krieger).
   pure function get_smeared(self, across, sheathing_mass, joists) result(plate)
      class(joist_floor_type), intent(in) :: self
      !> Bending stiffness, N m, and mass per area, kg/m2, of the sheathing.
      real(wp), intent(in) :: across, sheathing_mass
      type(ribs_type), intent(in) :: joists
      type(plate_type) :: plate
      real(wp) :: along, torsion, mass

      along = across + (joists%bending + joists%composite/(1 + joists%slip*joists%composite*(pi/self%length)**2)) &
         /self%spacing
      torsion = across + joists%torsion/(2*self%spacing)
      mass = sheathing_mass + joists%mass/self%spacing
      plate = plate_type(length=self%length, width=self%width, thickness=self%sheathing_thickness, &
         density=mass/self%sheathing_thickness, stiffness_ratio=across/along, torsion_ratio=torsion/sqrt(along*across), &
         loss_factor=self%loss_factor, edges='absorption')
      plate%wave_speed = sqrt(12*sqrt(along*across)/mass)/plate%thickness
   end function get_smeared

   !> Torsion constant of a rectangle, within 0.5 % (Roark).
   pure function get_torsion_constant(width, height) result(constant)
      !> Sides, m.
      real(wp), intent(in) :: width, height
      !> The constant, m4.
      real(wp) :: constant

      associate (short => min(width, height), long => max(width, height))
         constant = long*short**3*(1.0_wp/3 - 0.21_wp*short/long*(1 - (short/long)**4/12))
      end associate
   end function get_torsion_constant

end module thud_joist_floor
