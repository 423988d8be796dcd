!> A plate of crossed layers that yield in shear, as cross-laminated timber.
module thud_laminate_floor
   use thud_field, only: field_type, list_type, new_field
   use thud_floor_model, only: floor_state_type
   use thud_kinds, only: wp
   use thud_legendre, only: get_gauss_legendre
   use thud_plate, only: plate_type
   use thud_plate_stack, only: orthotropic_type
   use thud_rectangular_floor, only: rectangular_floor_type
   implicit none (type, external)
   private

   public :: laminate_floor_type

   !> Thicknesses of the default layers, m.
   real(wp), parameter :: default_thickness(*) = [0.04_wp, 0.02_wp, 0.04_wp, 0.02_wp, 0.04_wp]

   !> The floor; the defaults are five layers of spruce (strength class C24).
   type, extends(rectangular_floor_type) :: laminate_floor_type
      !> Length, along the grain of the first layer, and width, m.
      real(wp) :: length = 5.0_wp, width = 4.0_wp
      !> Thicknesses of the layers from the top, which alternate in direction, m; an empty list is the default.
      type(list_type) :: layer_thickness
      !> Modulus of elasticity along and across the grain, Pa.
      real(wp) :: youngs_modulus = 1.1e10_wp, cross_modulus = 3.7e8_wp
      !> Shear modulus along the grain, and that of rolling shear, Pa.
      real(wp) :: shear_modulus = 6.9e8_wp, rolling_shear_modulus = 5.0e7_wp
      !> Fraction of the torsional stiffness that joints between the boards of a layer leave.
      real(wp) :: torsion_factor = 0.65_wp
      !> Density, kg/m3; mass per area of what lies on the plate without stiffness, as gravel, kg/m2.
      real(wp) :: density = 470.0_wp, added_mass = 0.0_wp
      !> Loss factor including that of the edges, without radiation.
      real(wp) :: loss_factor = 0.03_wp
   contains
      procedure :: get_fields
      procedure :: get_bearing
   end type laminate_floor_type

contains

   !> Keys and allowed ranges of the group `&laminate_floor`.
   function get_fields(self) result(fields)
      class(laminate_floor_type), intent(in), target :: self
      type(field_type), allocatable :: fields(:)

      fields = [ &
         new_field('length', self%length, 'm', 'length of the floor, along the grain of the first layer', &
         '[0.5, 100]'), &
         new_field('width', self%width, 'm', 'width of the floor', '[0.5, 100]'), &
         new_field('layer_thickness', self%layer_thickness, 'm', &
         'thicknesses of the crossed layers from the top (default: 40, 20, 40, 20, 40 mm)', '[0.003, 0.5]'), &
         new_field('youngs_modulus', self%youngs_modulus, 'Pa', &
         'modulus of elasticity along the grain', '[1e8, 1e12]'), &
         new_field('cross_modulus', self%cross_modulus, 'Pa', 'modulus of elasticity across the grain', '[0, 1e12]'), &
         new_field('shear_modulus', self%shear_modulus, 'Pa', 'shear modulus along the grain', '[1e6, 1e12]'), &
         new_field('rolling_shear_modulus', self%rolling_shear_modulus, 'Pa', &
         'modulus of rolling shear', '[1e6, 1e12]'), &
         new_field('torsion_factor', self%torsion_factor, '', &
         'fraction of the torsional stiffness that joints between boards leave', '[0, 1]'), &
         new_field('density', self%density, 'kg/m3', 'density of the layers', '[10, 20000]'), &
         new_field('added_mass', self%added_mass, 'kg/m2', &
         'mass without stiffness on the plate, as gravel', '[0, 1000]'), &
         new_field('loss_factor', self%loss_factor, '', &
         'loss factor of the floor including its edges, without radiation', '(0, 1]'), &
         self%get_source_fields(), self%get_build_up_fields(.false.), self%get_point_fields()]
   end function get_fields

   !> Bending and shear stiffness per width in one direction.
   !>
   !> The shear stress at a height z is V Q(z)/B with the shear force V and Q the first moment of the moduli of elasticity
   !> above z; its energy V**2/(2 S) gives 1/S = integral of Q**2/(G B**2) (Timoshenko beam of layers).
   pure subroutine get_section(thickness, modulus, shear_modulus, bending, shear)
      !> Thicknesses of the layers from the top, m: [n_layer].
      real(wp), intent(in) :: thickness(:)
      !> Moduli of elasticity and shear moduli in this direction, Pa: [n_layer].
      real(wp), intent(in) :: modulus(:), shear_modulus(:)
      !> Bending stiffness, N m, and shear stiffness, N/m.
      real(wp), intent(out) :: bending, shear
      real(wp) :: node(3), weight(3), top(size(thickness)), center(size(thickness))
      real(wp) :: axis, moment, compliance
      integer :: i

      top = [(sum(thickness(:i - 1)), i=1, size(thickness))]
      center = top + thickness/2
      axis = sum(modulus*thickness*center)/sum(modulus*thickness)
      bending = sum(modulus*thickness*(thickness**2/12 + (center - axis)**2))
      ! Q**2 is a polynomial of degree 4 in each layer, which three points integrate exactly.
      call get_gauss_legendre(node, weight)
      moment = 0.0_wp
      compliance = 0.0_wp
      do i = 1, size(thickness)
         associate (z => top(i) + thickness(i)*(node + 1)/2)
            compliance = compliance + sum(weight*(moment + modulus(i)*(z - top(i))*((z + top(i))/2 - axis))**2) &
               *thickness(i)/2/shear_modulus(i)
         end associate
         moment = moment + modulus(i)*thickness(i)*(center(i) - axis)
      end do
      shear = bending**2/compliance
   end subroutine get_section

   !> The equivalent homogeneous plate, and the stiffnesses of the layers.
   subroutine get_bearing(self, state, bearing)
      class(laminate_floor_type), intent(in) :: self
      type(floor_state_type), intent(inout) :: state
      type(orthotropic_type), intent(out) :: bearing
      real(wp), allocatable :: thickness(:)
      logical, allocatable :: is_along(:)
      real(wp) :: mean
      integer :: i

      state%group = 'laminate_floor'
      state%has_modal_conductance = .true.
      thickness = default_thickness
      if (self%layer_thickness%count > 0) thickness = self%layer_thickness%values(:self%layer_thickness%count)
      is_along = [(mod(i, 2) == 1, i=1, size(thickness))]
      associate (e => self%youngs_modulus, e_cross => self%cross_modulus, g => self%shear_modulus, &
         g_rolling => self%rolling_shear_modulus, total => sum(thickness))
         call get_section(thickness, merge(e, e_cross, is_along), merge(g, g_rolling, is_along), bearing%along, &
            bearing%shear(1))
         call get_section(thickness, merge(e_cross, e, is_along), merge(g_rolling, g, is_along), bearing%across, &
            bearing%shear(2))
         bearing%torsion = self%torsion_factor*g*total**3/12
         bearing%mass = self%density*total + self%added_mass
         bearing%inertia = self%density*total**3/12
         bearing%loss_factor = self%loss_factor
         mean = sqrt(bearing%along*bearing%across)
         state%plate = plate_type(length=self%length, width=self%width, thickness=total, density=bearing%mass/total, &
            wave_speed=sqrt(12*mean/bearing%mass)/total, stiffness_ratio=bearing%across/bearing%along, &
            torsion_ratio=min(2*bearing%torsion/mean, 1.0_wp), loss_factor=self%loss_factor, edges='absorption')
         state%highest_frequency = sqrt(minval(bearing%shear)/bearing%mass)/(2*total)
      end associate
      state%validity_reason = 'shear waves are shorter than two thicknesses, and layers deform by themselves'
   end subroutine get_bearing

end module thud_laminate_floor
