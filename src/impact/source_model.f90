!> The abstract source model: options from namelist groups, and the force of one drop.
!>
!> A model is a module `thud_<name>` with a type `<name>_type` that extends this one; the list of names in
!> src/CMakeLists.txt makes it known. Its options belong to the group of its name unless stated otherwise. What is said
!> here of the arguments of a procedure holds for those of every model.
module thud_source_model
   use thud_ball, only: ball_type
   use thud_drop, only: drop_type
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type
   use thud_force_history, only: force_history_type
   use thud_kinds, only: wp
   use thud_receiver, only: get_pole_count, receiver_type
   use thud_sampling, only: get_step_count, sampling_type
   use thud_validity_limit, only: get_gravity_limit, validity_limit_type
   implicit none (type, external)
   private

   public :: source_model_type

   !> Typical time that a source is computed for on a rigid floor, s.
   real(wp), parameter, public :: typical_contact = 0.025_wp

   !> A source model with its options as components.
   type, abstract :: source_model_type
   contains
      procedure(get_fields), deferred, pass(options) :: get_fields
      procedure(solve), deferred, pass(options) :: solve
      procedure, pass(options) :: check
      procedure, pass(options) :: get_snapshot_shape
      procedure, pass(options) :: get_cost
      procedure, pass(options) :: get_paper_modulus
      procedure, pass(options) :: get_validity_limits
      procedure, pass(options) :: get_loss_factors
      procedure, pass(options) :: compress
      procedure, pass(options) :: couples
   end type source_model_type

   abstract interface
      !> Keys of the options.
      function get_fields(options) result(fields)
         import :: field_type, source_model_type
         implicit none (type, external)
         !> The options that the fields read and set.
         class(source_model_type), intent(in), target :: options
         !> The keys: [n_field].
         type(field_type), allocatable :: fields(:)
      end function get_fields

      !> Force history of one drop.
      subroutine solve(ball, drop, options, sampling, history, error, receiver)
         import :: ball_type, drop_type, error_type, force_history_type, receiver_type, sampling_type, source_model_type
         implicit none (type, external)
         type(ball_type), intent(in) :: ball
         type(drop_type), intent(in) :: drop
         !> The options, checked.
         class(source_model_type), intent(in) :: options
         !> Sampling rate, length of the record, substeps.
         type(sampling_type), intent(in) :: sampling
         type(force_history_type), intent(out) :: history
         !> The drop leads out of the model, the contact outlasts the record, or the steps are too coarse.
         type(error_type), allocatable, intent(out) :: error
         !> The floor under the ball (default: rigid); present only for models that `couples`.
         type(receiver_type), intent(in), optional :: receiver
      end subroutine solve
   end interface

contains

   !> Refuses options that do not fit each other, the ball or the sampling; by default all fit.
   subroutine check(ball, options, sampling, error)
      type(ball_type), intent(in) :: ball
      !> The options, each inside its own range.
      class(source_model_type), intent(in) :: options
      type(sampling_type), intent(in) :: sampling
      !> Names group, key, value and allowed range.
      type(error_type), allocatable, intent(out) :: error

   end subroutine check

   !> Size of the snapshots of the deformed ball; by default there are none.
   function get_snapshot_shape(options, sampling) result(extents)
      class(source_model_type), intent(in) :: options
      type(sampling_type), intent(in) :: sampling
      !> Nodes from pole to pole, nodes through the wall, snapshots.
      integer :: extents(3)

      extents = 0
   end function get_snapshot_shape

   !> Approximate time of one drop on one core, s; by default that of a model with one or two degrees of freedom.
   function get_cost(ball, options, sampling, receiver) result(cost)
      type(ball_type), intent(in) :: ball
      !> The options, checked.
      class(source_model_type), intent(in) :: options
      type(sampling_type), intent(in) :: sampling
      !> The floor under the source (default: rigid).
      type(receiver_type), intent(in), optional :: receiver
      !> The time, s.
      real(wp) :: cost

      cost = 3.0e-4_wp
      if (present(receiver)) then
         cost = cost + get_step_count(sampling)*(1.4e-6_wp + 4.3e-9_wp*get_pole_count(receiver))
      else
         cost = cost + get_step_count(sampling, typical_contact)*2.2e-7_wp
      end if
   end function get_cost

   !> Modulus of elasticity of the paper's ball in this model, Pa; by default 0, for models that do not use the wall.
   function get_paper_modulus(options) result(modulus)
      class(source_model_type), intent(in) :: options
      !> The modulus, Pa.
      real(wp) :: modulus

      modulus = 0.0_wp
   end function get_paper_modulus

   !> Validity limits of the model for a result; by default gravity, which models leave out.
   function get_validity_limits(ball, drop, options, sampling, history) result(limits)
      type(ball_type), intent(in) :: ball
      type(drop_type), intent(in) :: drop
      class(source_model_type), intent(in) :: options
      type(sampling_type), intent(in) :: sampling
      !> The force.
      type(force_history_type), intent(in) :: history
      !> The limits: [n_limit].
      type(validity_limit_type), allocatable :: limits(:)

      limits = [get_gravity_limit(drop, history)]
   end function get_validity_limits

   !> Loss factor of the material against frequency, of models that have a material; others refuse.
   subroutine get_loss_factors(ball, options, frequency, loss_factor, error)
      type(ball_type), intent(in) :: ball
      class(source_model_type), intent(in) :: options
      !> Frequencies, Hz: [n].
      real(wp), intent(in) :: frequency(:)
      !> Loss factors: [n].
      real(wp), intent(out) :: loss_factor(:)
      !> The model has no material, or it cannot be made.
      type(error_type), allocatable, intent(out) :: error

      loss_factor = 0.0_wp
      error = input_error('&model: name: this model has no material with a loss factor; allowed: one that has')
   end subroutine get_loss_factors

   !> Whether the model can drop on a mobile floor; by default it can. The force of others is the blocked one.
   function couples(options) result(yes)
      class(source_model_type), intent(in) :: options
      logical :: yes

      yes = .true.
   end function couples

   !> Force on each of two plates in a quasi-static compression, of models that have one; others refuse.
   subroutine compress(ball, options, deflection, force, error)
      !> The ball, with the gas that it has in the press.
      type(ball_type), intent(in) :: ball
      !> The options, checked.
      class(source_model_type), intent(in) :: options
      !> Approach of the plates, ascending from 0, m: [n].
      real(wp), intent(in) :: deflection(:)
      !> The force, N: [n].
      real(wp), intent(out) :: force(:)
      !> The model has no static compression, or the ball cannot be pressed so far.
      type(error_type), allocatable, intent(out) :: error

      force = 0.0_wp
      error = input_error('&model: name: this model has no static compression; allowed: one that has')
   end subroutine compress

end module thud_source_model
