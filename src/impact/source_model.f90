!> The abstract source model: options from namelist groups, and the force of one drop.
!>
!> A model is a type `<name>_type` that extends this one, in the module `thud_<name>`, and stands in
!> src/case/registry.f90. Its options form the namelist group `&<name>` unless stated otherwise. The
!> descriptions of arguments in this file hold for every model.
module thud_source_model
   use thud_ball, only: ball_type, drop_type
   use thud_band, only: octave_count
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type
   use thud_force_history, only: force_history_type
   use thud_kinds, only: wp
   use thud_receiver, only: receiver_type
   use thud_sampling, only: sampling_type
   use thud_validity_limit, only: get_gravity_limit, validity_limit_type
   implicit none (type, external)
   private

   public :: resolution_type, source_model_type

   !> A level of resolution, and how the error of a drop at this level follows from its difference from a coarser one. By
   !> default the ratio is somewhat more than the 1/3 of an error that is proportional to the square of the step, as that of
   !> a force that begins with a jump.
   type :: resolution_type
      !> Whether the level may be computed to lower the error, or else only to show it.
      logical :: lowers_error = .true.
      !> The coarser level.
      integer :: reference = 0
      !> Estimated error divided by the difference.
      real(wp) :: ratio = 0.4_wp
      !> Minimum errors of the octave levels, which differences do not show, dB: [octave_count].
      real(wp) :: min_error(octave_count) = 0.0_wp
   end type resolution_type

   !> A source model with its options as components.
   type, abstract :: source_model_type
   contains
      procedure(get_fields), deferred :: get_fields
      procedure(solve), deferred :: solve
      procedure :: check
      procedure :: refine
      procedure :: compress
      procedure :: get_validity_limits
   end type source_model_type

   abstract interface
      !> Fields of the options: each connects a namelist key to a component.
      function get_fields(self) result(fields)
         import :: field_type, source_model_type
         implicit none (type, external)
         !> The options that the fields read and set.
         class(source_model_type), intent(in), target :: self
         !> The fields: [n_field].
         type(field_type), allocatable :: fields(:)
      end function get_fields

      !> Force history of one drop.
      subroutine solve(self, ball, drop, sampling, history, error, receiver)
         import :: ball_type, drop_type, error_type, force_history_type, receiver_type, sampling_type, source_model_type
         implicit none (type, external)
         !> The options, checked.
         class(source_model_type), intent(in) :: self
         type(ball_type), intent(in) :: ball
         type(drop_type), intent(in) :: drop
         !> Sampling rate, length of the record, substeps.
         type(sampling_type), intent(in) :: sampling
         type(force_history_type), intent(out) :: history
         !> Set if the drop leaves the range of the model, the contact outlasts the record, or the steps are too coarse.
         type(error_type), allocatable, intent(out) :: error
         !> The structure under the source (default: a rigid floor). A model that ignores it returns no motion of the floor.
         type(receiver_type), intent(in), optional :: receiver
      end subroutine solve
   end interface

contains

   !> Checks that options, ball and sampling fit each other; by default, they do.
   subroutine check(self, ball, sampling, error)
      !> The options, each inside its own range.
      class(source_model_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      type(sampling_type), intent(in) :: sampling
      !> Set if they do not fit; the message names group, key, value and allowed range.
      type(error_type), allocatable, intent(out) :: error

   end subroutine check

   !> Validity limits of the model for a result; by default those of a source without size and without gravity during the
   !> contact.
   function get_validity_limits(self, ball, drop, history) result(limits)
      class(source_model_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      type(drop_type), intent(in) :: drop
      !> The force.
      type(force_history_type), intent(in) :: history
      !> The limits: [n_limit].
      type(validity_limit_type), allocatable :: limits(:)

      limits = [get_gravity_limit(drop, history), validity_limit_type('drop', 'deflection over twice outer radius', &
         history%max_deflection/(2*ball%outer_radius), highest=1.0_wp, reason='the source is no thicker')]
   end function get_validity_limits

   !> The model and the sampling at a level of resolution. By default the resolution is that of the input: level 0 has half
   !> its sampling rate, for the error of samples and steps, and level 2 twice its rate.
   subroutine refine(self, ball, level, coarse, sampling, refined, resolution)
      !> The options of the input, and what the levels share, which level 0 computes.
      class(source_model_type), intent(inout) :: self
      type(ball_type), intent(in) :: ball
      !> The level: 0 is coarse, 1 the resolution of the input, higher ones are finer.
      integer, intent(in) :: level
      !> The drop at the next coarser level; without samples if there is none.
      type(force_history_type), intent(in) :: coarse
      !> Sampling of the input, to be changed as the level needs it.
      type(sampling_type), intent(inout) :: sampling
      !> The model at this level.
      class(source_model_type), allocatable, intent(out) :: refined
      type(resolution_type), intent(out) :: resolution

      allocate (refined, source=self)
      sampling%sample_rate = sampling%sample_rate*2.0_wp**(level - 1)
      resolution = resolution_type(lowers_error=level <= 1, reference=level - 1)
   end subroutine refine

   !> Force on each of two plates in a quasi-static compression; models without one return an error.
   subroutine compress(self, ball, deflection, force, error)
      !> The options, checked.
      class(source_model_type), intent(in) :: self
      !> The ball, with the gas that it has in the press.
      type(ball_type), intent(in) :: ball
      !> Approach of the plates, ascending from 0, m: [n].
      real(wp), intent(in) :: deflection(:)
      !> The force, N: [n].
      real(wp), intent(out) :: force(:)
      !> Set if the model has no quasi-static compression, or the ball cannot be pressed so far.
      type(error_type), allocatable, intent(out) :: error

      force = 0.0_wp
      error = input_error('this model has no static compression; allowed: one that has', 'model')
   end subroutine compress

end module thud_source_model
