!> A floating plate on a resilient layer, on any plate: its keys, and what it adds to a stack of plates.
module thud_screed
   use thud_field, only: field_type
   use thud_kinds, only: wp
   use thud_new_field, only: real_field
   use thud_plate, only: get_bending_stiffness, get_surface_mass, plate_type
   use thud_plate_stack, only: layer_type, orthotropic_type
   implicit none (type, external)
   private

   public :: get_screed_fields, get_screed_layer, get_screed_plate, new_orthotropic, screed_type

   !> Poisson's ratio of plates; it affects only edges that are not held.
   real(wp), parameter :: poisson = 0.2_wp

   !> The floating plate, simply supported; no thickness means none. The other defaults are those of a cement screed on
   !> mineral wool.
   type :: screed_type
      !> Thickness, m; density, kg/m3; longitudinal wave speed, m/s; loss factor.
      real(wp) :: thickness = 0.0_wp, density = 2000.0_wp, wave_speed = 3500.0_wp, loss_factor = 0.03_wp
      !> Dynamic stiffness of the layer per unit area, N/m3, and its loss factor.
      real(wp) :: layer_stiffness = 1.0e7_wp, layer_loss_factor = 0.1_wp
   end type screed_type

contains

   !> Keys and allowed ranges.
   function get_screed_fields(screed) result(fields)
      !> The plate that the fields read and set.
      type(screed_type), intent(in), target :: screed
      type(field_type), allocatable :: fields(:)

      fields = [ &
         real_field('screed_thickness', screed%thickness, 'm', 'thickness of a floating plate; 0: none', '[0, 0.5]'), &
         real_field('screed_density', screed%density, 'kg/m3', 'density of the floating plate', '[10, 20000]'), &
         real_field('screed_wave_speed', screed%wave_speed, 'm/s', &
         'speed of longitudinal waves in the floating plate', '[100, 10000]'), &
         real_field('screed_loss_factor', screed%loss_factor, '', 'loss factor of the floating plate', '[0, 1]'), &
         real_field('layer_stiffness', screed%layer_stiffness, 'N/m3', &
         'dynamic stiffness of the resilient layer per unit area (ISO 9052-1)', '[1e4, 1e12]'), &
         real_field('layer_loss_factor', screed%layer_loss_factor, '', 'loss factor of the resilient layer', '[0, 1]')]
   end function get_screed_fields

   !> The floating plate on another plate.
   pure function get_screed_plate(screed, below) result(plate)
      type(screed_type), intent(in) :: screed
      type(plate_type), intent(in) :: below
      type(plate_type) :: plate

      plate = plate_type(length=below%length, width=below%width, thickness=screed%thickness, density=screed%density, &
         wave_speed=screed%wave_speed, loss_factor=screed%loss_factor)
   end function get_screed_plate

   !> Stiffnesses and mass of a homogeneous thin plate.
   pure function new_orthotropic(plate) result(thin)
      type(plate_type), intent(in) :: plate
      type(orthotropic_type) :: thin

      associate (mean => get_bending_stiffness(plate), root => sqrt(plate%stiffness_ratio))
         thin%along = mean/root
         thin%across = mean*root
         ! H = coupling + 2 torsion.
         thin%coupling = poisson*plate%torsion_ratio*mean
         thin%torsion = (1 - poisson)/2*plate%torsion_ratio*mean
      end associate
      thin%mass = get_surface_mass(plate)
      thin%loss_factor = plate%loss_factor
   end function new_orthotropic

   !> The layer below a floating plate.
   pure function get_screed_layer(screed) result(layer)
      type(screed_type), intent(in) :: screed
      type(layer_type) :: layer

      layer%stiffness = screed%layer_stiffness
      layer%loss_factor = screed%layer_loss_factor
   end function get_screed_layer

end module thud_screed
