!> The source models and the floors by name.
module thud_registry
   use thud_finite_element, only: finite_element_modulus, finite_element_type
   use thud_floor_model, only: floor_model_type
   use thud_hollow_sphere, only: hollow_sphere_modulus, hollow_sphere_type
   use thud_hunt_crossley, only: hunt_crossley_type
   use thud_joist_floor, only: joist_floor_type
   use thud_kinds, only: wp
   use thud_laminate_floor, only: laminate_floor_type
   use thud_measured_mobility_floor, only: measured_mobility_floor_type
   use thud_measured_modes, only: measured_modes_type
   use thud_modal_ball, only: modal_ball_modulus, modal_ball_type
   use thud_modal_floor, only: modal_floor_type
   use thud_plate_floor, only: plate_floor_type
   use thud_point_floors, only: infinite_plate_floor_type, oscillator_floor_type, rigid_floor_type
   use thud_source_model, only: source_model_type
   use thud_two_mass, only: two_mass_type
   implicit none (type, external)
   private

   public :: first_radiating, floor_names, floor_slot_type, model_names, model_slot_type, new_floors, new_models
   public :: standard_moduli

   !> Names of the models and of the namelist groups with their options; the first is the default.
   character(len=24), parameter :: model_names(*) = [character(len=24) :: 'modal_ball', 'finite_element', &
      'hollow_sphere', 'measured_modes', 'hunt_crossley', 'two_mass']

   !> Modulus of elasticity of the standard ball in each of them, Pa; 0 for the others, which do not use the wall: [n_model].
   real(wp), parameter :: standard_moduli(size(model_names)) = [modal_ball_modulus, finite_element_modulus, &
      hollow_sphere_modulus, spread(0.0_wp, 1, size(model_names) - 3)]

   !> Names of the floors and of their namelist groups; the first, the default, is rigid.
   character(len=24), parameter :: floor_names(*) = [character(len=24) :: 'rigid', 'infinite_plate', 'oscillator', &
      'plate', 'laminate_floor', 'joist_floor', 'measured_mobility', 'modal_floor']

   !> Index of the first floor with a plate that radiates into a room; those before it have none.
   integer, parameter :: first_radiating = 4

   !> Element of a list of models of different types.
   type :: model_slot_type
      !> The model with its options.
      class(source_model_type), allocatable :: model
   end type model_slot_type

   !> Element of a list of floors of different types.
   type :: floor_slot_type
      !> The floor with its options.
      class(floor_model_type), allocatable :: model
   end type floor_slot_type

contains

   !> All models with their default options.
   subroutine new_models(models)
      !> The models, in the order of `model_names`: [n_model].
      type(model_slot_type), allocatable, intent(out) :: models(:)

      allocate (models(size(model_names)))
      allocate (modal_ball_type :: models(1)%model)
      allocate (finite_element_type :: models(2)%model)
      allocate (hollow_sphere_type :: models(3)%model)
      allocate (measured_modes_type :: models(4)%model)
      allocate (hunt_crossley_type :: models(5)%model)
      allocate (two_mass_type :: models(6)%model)
   end subroutine new_models

   !> All floors with their default options.
   subroutine new_floors(floors)
      !> The floors, in the order of `floor_names`: [n_floor].
      type(floor_slot_type), allocatable, intent(out) :: floors(:)

      allocate (floors(size(floor_names)))
      allocate (rigid_floor_type :: floors(1)%model)
      allocate (infinite_plate_floor_type :: floors(2)%model)
      allocate (oscillator_floor_type :: floors(3)%model)
      allocate (plate_floor_type :: floors(4)%model)
      allocate (laminate_floor_type :: floors(5)%model)
      allocate (joist_floor_type :: floors(6)%model)
      allocate (measured_mobility_floor_type :: floors(7)%model)
      allocate (modal_floor_type :: floors(8)%model)
   end subroutine new_floors

end module thud_registry
