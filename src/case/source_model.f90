!> The source models that can be asked for by name. A new model is one more line in each list here.
module thud_source_model
   use thud_ball, only: ball_type
   use thud_drop, only: drop_type
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type
   use thud_finite_element, only: solve_finite_element
   use thud_finite_element_options, only: check_finite_element, finite_element_groups, finite_element_type, &
      get_finite_element_fields
   use thud_force_history, only: force_history_type
   use thud_hollow_sphere, only: get_hollow_sphere_fields, hollow_sphere_type, solve_hollow_sphere
   use thud_hunt_crossley, only: check_hunt_crossley, get_hunt_crossley_fields, hunt_crossley_type, solve_hunt_crossley
   use thud_kinds, only: wp
   use thud_measured_modes, only: check_measured_modes, get_measured_modes_fields, measured_modes_type, &
      solve_measured_modes
   use thud_modal_ball, only: solve_modal_ball
   use thud_modal_ball_options, only: check_modal_ball, get_modal_ball_fields, modal_ball_type
   use thud_motion, only: motion_type
   use thud_sampling, only: sampling_type
   use thud_source_limits, only: recorded_band
   use thud_text, only: join_quoted, quoted
   use thud_transform, only: get_low_pass
   implicit none (type, external)
   private

   public :: check_model, get_model_fields, get_owner, model_names, model_options_type, solve_model

   !> Names of the models; the options of each stand in the namelist group of its name.
   character(len=24), parameter :: model_names(*) = [character(len=24) :: &
      'hollow_sphere', 'modal_ball', 'finite_element', 'measured_modes', 'hunt_crossley']

   !> Options of every model.
   type :: model_options_type
      !> The paper's analytical model.
      type(hollow_sphere_type) :: hollow_sphere
      !> The modes of the sphere.
      type(modal_ball_type) :: modal_ball
      !> Finite elements.
      type(finite_element_type) :: finite_element
      !> Measured modes.
      type(measured_modes_type) :: measured_modes
      !> Lumped source.
      type(hunt_crossley_type) :: hunt_crossley
   end type model_options_type

contains

   !> Keys of all models.
   function get_model_fields(options) result(fields)
      !> The options that the fields read and set.
      type(model_options_type), intent(in), target :: options
      !> The keys: [n_field].
      type(field_type), allocatable :: fields(:)

      fields = [get_hollow_sphere_fields(options%hollow_sphere), &
         get_modal_ball_fields(options%modal_ball), &
         get_finite_element_fields(options%finite_element), &
         get_measured_modes_fields(options%measured_modes), &
         get_hunt_crossley_fields(options%hunt_crossley)]
   end function get_model_fields

   !> Model that a group of options belongs to.
   pure elemental function get_owner(group) result(model)
      !> Namelist group.
      character(len=*), intent(in) :: group
      !> The model, blank for a group that every model uses.
      character(len=24) :: model

      model = ''
      if (any(model_names == group)) model = group
      if (any(finite_element_groups == group)) model = 'finite_element'
   end function get_owner

   !> Complains about options of the chosen model that do not fit each other.
   subroutine check_model(model, options, ball, sampling, error)
      !> Name of the model.
      character(len=*), intent(in) :: model
      !> The options, each inside its own range.
      type(model_options_type), intent(in) :: options
      !> The ball.
      type(ball_type), intent(in) :: ball
      !> Sampling of the record.
      type(sampling_type), intent(in) :: sampling
      !> What is wrong.
      type(error_type), allocatable, intent(out) :: error

      select case (model)
      case ('modal_ball')
         call check_modal_ball(options%modal_ball, error)
      case ('finite_element')
         call check_finite_element(options%finite_element, ball, sampling, error)
      case ('measured_modes')
         call check_measured_modes(options%measured_modes, ball, error)
      case ('hunt_crossley')
         call check_hunt_crossley(options%hunt_crossley, error)
      case default
         ! Its options cannot contradict each other.
         return
      end select
   end subroutine check_model

   !> Force history of one drop by the chosen model.
   subroutine solve_model(model, options, ball, drop, sampling, history, motion, error)
      !> Name of the model.
      character(len=*), intent(in) :: model
      !> Options of every model.
      type(model_options_type), intent(in) :: options
      !> The ball.
      type(ball_type), intent(in) :: ball
      !> The drop.
      type(drop_type), intent(in) :: drop
      !> Sampling of the record.
      type(sampling_type), intent(in) :: sampling
      !> The history.
      type(force_history_type), intent(out) :: history
      !> Snapshots of the deformed ball, of models that have some.
      type(motion_type), intent(out) :: motion
      !> The model failed.
      type(error_type), allocatable, intent(out) :: error

      select case (model)
      case ('hollow_sphere')
         call solve_hollow_sphere(ball, drop, options%hollow_sphere, sampling, history, error)
      case ('modal_ball')
         call solve_modal_ball(ball, drop, options%modal_ball, sampling, history, error)
      case ('finite_element')
         call solve_finite_element(ball, drop, options%finite_element, sampling, history, motion, error)
         if (.not. allocated(error)) call take_recorded_peak(history)
      case ('measured_modes')
         call solve_measured_modes(drop, options%measured_modes, sampling, history, error)
      case ('hunt_crossley')
         call solve_hunt_crossley(ball, drop, options%hunt_crossley, sampling, history, error)
      case default
         error = input_error('&model: name = '//quoted(model)//' is not allowed; allowed: '//join_quoted(model_names))
      end select
   end subroutine solve_model

   !> Peaks as a force plate records them. Nodes that meet the floor one by one make spikes as high as
   !> the steps are short.
   subroutine take_recorded_peak(history)
      !> Gets its peaks.
      type(force_history_type), intent(inout) :: history
      real(wp) :: recorded(size(history%floor_force))

      call get_low_pass(history%floor_force, history%sample_rate, recorded_band, recorded)
      history%peak_force = maxval(recorded)
      history%peak_floor_force = history%peak_force
   end subroutine take_recorded_peak

end module thud_source_model
