!> The abstract source model: options from namelist groups, and the force of one drop.
!>
!> A model is a type `<name>_type` that extends this one, in the module `thud_<name>`; the list of names in
!> src/CMakeLists.txt registers it. Its options form the namelist group `&<name>` unless stated otherwise. The
!> descriptions of arguments in this file hold for every model.
module thud_source_model
   use thud_ball, only: ball_type
   use thud_band, only: octave_count
   use thud_drop, only: drop_type
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type
   use thud_force_history, only: force_history_type
   use thud_kinds, only: wp
   use thud_receiver, only: get_pole_count, receiver_type
   use thud_sampling, only: get_step_count, sampling_type
   use thud_validity_limit, only: get_gravity_limit, get_size_limit, validity_limit_type
   implicit none (type, external)
   private

   public :: convergence_type, source_model_type

   !> Typical simulated duration of a drop on a rigid floor, s, for estimates of the computing time.
   real(wp), parameter, public :: typical_contact = 0.025_wp

   !> How the error of a result follows from its difference from a coarser level of resolution. By default the ratio is
   !> somewhat more than the 1/3 of an error that is proportional to the square of the step, as that of a force that begins
   !> with a jump.
   type :: convergence_type
      !> The coarser level.
      integer :: reference = 0
      !> Estimated error divided by the difference.
      real(wp) :: ratio = 0.4_wp
      !> Minimum errors of the octave levels, which differences do not show, dB: [octave_count].
      real(wp) :: min_error(octave_count) = 0.0_wp
   end type convergence_type

   !> A source model with its options as components.
   type, abstract :: source_model_type
   contains
      procedure(get_fields), deferred :: get_fields
      procedure(solve), deferred :: solve
      procedure :: check
      procedure :: get_snapshot_shape
      procedure :: get_cost
      procedure :: get_standard_modulus
      procedure :: get_validity_limits
      procedure :: get_loss_factors
      procedure :: compress
      procedure :: share_setup
      procedure :: set_level
      procedure :: get_highest_level
      procedure :: chooses_resolution
      procedure :: get_expected_level
      procedure :: get_convergence
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

   !> Shape of the snapshots of the deformed ball; by default there are none.
   function get_snapshot_shape(self, ball, sampling) result(extents)
      class(source_model_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      type(sampling_type), intent(in) :: sampling
      !> Number of nodes from pole to pole, of nodes through the wall, and of snapshots.
      integer :: extents(3)

      extents = 0
   end function get_snapshot_shape

   !> Approximate computing time of a drop at one resolution, that of the options, on one core, s; by default that of a model
   !> with one or two degrees of freedom.
   function get_cost(self, ball, sampling, receiver, contact_time) result(cost)
      !> The options, checked.
      class(source_model_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      type(sampling_type), intent(in) :: sampling
      !> The structure under the source (default: a rigid floor).
      type(receiver_type), intent(in), optional :: receiver
      !> Expected contact time, s (default: `typical_contact`).
      real(wp), intent(in), optional :: contact_time
      !> The time, s.
      real(wp) :: cost
      real(wp) :: time

      time = typical_contact
      if (present(contact_time)) time = contact_time
      cost = 1.5e-4_wp
      if (present(receiver)) then
         cost = cost + get_step_count(sampling)*(9.3e-7_wp + 2.9e-9_wp*get_pole_count(receiver))
      else
         cost = cost + get_step_count(sampling, time)*1.5e-7_wp
      end if
   end function get_cost

   !> Modulus of elasticity of the standard ball in this model, Pa; by default 0, for models that do not use the wall.
   function get_standard_modulus(self) result(modulus)
      class(source_model_type), intent(in) :: self
      !> The modulus, Pa.
      real(wp) :: modulus

      modulus = 0.0_wp
   end function get_standard_modulus

   !> Validity limits of the model for a result; by default those of a source without size and without gravity during the
   !> contact.
   function get_validity_limits(self, ball, drop, sampling, history) result(limits)
      class(source_model_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      type(drop_type), intent(in) :: drop
      type(sampling_type), intent(in) :: sampling
      !> The force.
      type(force_history_type), intent(in) :: history
      !> The limits: [n_limit].
      type(validity_limit_type), allocatable :: limits(:)

      limits = [get_gravity_limit(drop, history), get_size_limit(ball, history)]
   end function get_validity_limits

   !> Loss factor of the material against frequency; models without a material return an error.
   subroutine get_loss_factors(self, ball, frequency, loss_factor, error)
      class(source_model_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      !> Frequencies, Hz: [n].
      real(wp), intent(in) :: frequency(:)
      !> Loss factors: [n].
      real(wp), intent(out) :: loss_factor(:)
      !> Set if the model has no material or the material cannot be made.
      type(error_type), allocatable, intent(out) :: error

      loss_factor = 0.0_wp
      error = input_error('&model: name: this model has no material with a loss factor; allowed: one that has')
   end subroutine get_loss_factors

   !> Computes what the levels of resolution share; by default nothing.
   subroutine share_setup(self, ball, sampling)
      class(source_model_type), intent(inout) :: self
      type(ball_type), intent(in) :: ball
      !> Sampling of the input.
      type(sampling_type), intent(in) :: sampling

   end subroutine share_setup

   !> Sets the resolution. By default level 0 has half the sampling rate of the input, for the error of samples and steps,
   !> level 1 that of the input, and level 2 twice that.
   subroutine set_level(self, ball, level, sampling, coarse)
      class(source_model_type), intent(inout) :: self
      type(ball_type), intent(in) :: ball
      !> The level, from 0 up.
      integer, intent(in) :: level
      !> Sampling of the input, to be changed as the level needs it.
      type(sampling_type), intent(inout) :: sampling
      !> The drop at the next coarser level; without samples if there is none.
      type(force_history_type), intent(in) :: coarse

      sampling%sample_rate = sampling%sample_rate*2.0_wp**(level - 1)
   end subroutine set_level

   !> Highest level of resolution; by default 1: the resolution is that of the input.
   function get_highest_level(self, ball, sampling) result(level)
      class(source_model_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      type(sampling_type), intent(in) :: sampling
      integer :: level

      level = 1
   end function get_highest_level

   !> Whether the model chooses its resolution; by default it is that of the input.
   function chooses_resolution(self) result(yes)
      class(source_model_type), intent(in) :: self
      logical :: yes

      yes = .false.
   end function chooses_resolution

   !> Level at which the resolution is probably fine enough, for estimates of the computing time; by default 1.
   function get_expected_level(self, ball, contact) result(level)
      class(source_model_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      !> Expected contact time, deflection and contact radius, for models that use the wall.
      type(force_history_type), intent(in) :: contact
      integer :: level

      level = 1
   end function get_expected_level

   !> Convergence of a result; by default that of `convergence_type`, with the next coarser level.
   function get_convergence(self, ball, level, history) result(convergence)
      !> The options at the level of the result.
      class(source_model_type), intent(in) :: self
      type(ball_type), intent(in) :: ball
      !> Level of the result, from 1 up.
      integer, intent(in) :: level
      !> The result.
      type(force_history_type), intent(in) :: history
      type(convergence_type) :: convergence

      convergence%reference = level - 1
   end function get_convergence

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
      error = input_error('&model: name: this model has no static compression; allowed: one that has')
   end subroutine compress

end module thud_source_model
