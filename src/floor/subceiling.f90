!> A subceiling below any plate, on channels, battens or hangers, with the air between: its keys, and its plate.
module thud_subceiling
   use thud_field, only: field_type, new_field, only_with
   use thud_kinds, only: wp
   use thud_plate, only: plate_type
   implicit none (type, external)
   private

   public :: get_subceiling_fields, get_subceiling_plate, subceiling_type

   !> The subceiling; no thickness means none. The other defaults are those of a gypsum board on resilient channels.
   type :: subceiling_type
      !> Thickness, m; density, kg/m3; modulus of elasticity, Pa; loss factor.
      real(wp) :: thickness = 0.0_wp, density = 720.0_wp, modulus = 2.5e9_wp, loss_factor = 0.02_wp
      !> Lines that hold it: stiffness per length, N/m2, loss factor, and distance, m, of floors without joists.
      real(wp) :: channel_stiffness = 1.0e5_wp, channel_loss_factor = 0.1_wp, channel_spacing = 0.5_wp
      !> Depth of the air above it, m, and its loss factor.
      real(wp) :: cavity_depth = 0.1_wp, cavity_loss_factor = 0.3_wp
   end type subceiling_type

contains

   !> Keys and allowed ranges.
   function get_subceiling_fields(subceiling, on_joists) result(fields)
      !> The subceiling that the fields read and set.
      type(subceiling_type), intent(in), target :: subceiling
      !> The lines that hold it are the joists.
      logical, intent(in) :: on_joists
      type(field_type), allocatable :: fields(:)

      fields = [ &
         new_field('subceiling_thickness', subceiling%thickness, 'm', 'thickness of a subceiling that radiates ' &
         //'instead of the floor; 0: none', '[0, 0.2]'), &
         only_with('subceiling_thickness', [ &
         new_field('subceiling_density', subceiling%density, 'kg/m3', 'density of the subceiling', '[10, 20000]'), &
         new_field('subceiling_modulus', subceiling%modulus, 'Pa', 'modulus of elasticity of the subceiling in bending', &
         '[1e7, 1e12]'), &
         new_field('subceiling_loss_factor', subceiling%loss_factor, '', &
         'loss factor of the subceiling', '[0, 1]'), &
         new_field('channel_stiffness', subceiling%channel_stiffness, 'N/m2', 'stiffness per length of each line that ' &
         //'holds the subceiling (channels, battens, hangers)', '[0, 1e12]'), &
         new_field('channel_loss_factor', subceiling%channel_loss_factor, '', 'loss factor of these lines', '[0, 1]'), &
         new_field('cavity_depth', subceiling%cavity_depth, 'm', 'depth of the air between floor and subceiling', &
         '[0.005, 2]'), &
         new_field('cavity_loss_factor', subceiling%cavity_loss_factor, '', &
         'loss factor of this air, high with absorber in it', '[0, 1]')])]
      if (.not. on_joists) fields = [fields, only_with('subceiling_thickness', [ &
         new_field('channel_spacing', subceiling%channel_spacing, 'm', &
         'distance of the lines that hold the subceiling, which run along the length', '[0.05, 100]')])]
   end function get_subceiling_fields

   !> The subceiling below another plate.
   pure function get_subceiling_plate(subceiling, above) result(plate)
      type(subceiling_type), intent(in) :: subceiling
      type(plate_type), intent(in) :: above
      type(plate_type) :: plate

      plate = plate_type(length=above%length, width=above%width, thickness=subceiling%thickness, &
         density=subceiling%density, wave_speed=sqrt(subceiling%modulus/subceiling%density), &
         loss_factor=subceiling%loss_factor)
   end function get_subceiling_plate

end module thud_subceiling
