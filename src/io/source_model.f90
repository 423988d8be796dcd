!> The source models that can be asked for by name. A new model is one more line in each list here.
module thud_source_model
   use thud_ball, only: ball_type
   use thud_drop, only: drop_type
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type
   use thud_force_history, only: force_history_type
   use thud_hollow_sphere, only: get_hollow_sphere_fields, hollow_sphere_type, solve_hollow_sphere
   use thud_hunt_crossley, only: check_hunt_crossley, get_hunt_crossley_fields, hunt_crossley_type, solve_hunt_crossley
   use thud_measured_modes, only: check_measured_modes, get_measured_modes_fields, measured_modes_type, &
      solve_measured_modes
   use thud_modal_ball, only: solve_modal_ball
   use thud_modal_ball_options, only: check_modal_ball, get_modal_ball_fields, modal_ball_type
   use thud_sampling, only: sampling_type
   use thud_text, only: join_quoted, quoted
   implicit none (type, external)
   private

   public :: check_model, get_model_fields, model_names, model_options_type, solve_model

   !> Names of the models; the options of each stand in the namelist group of its name.
   character(len=24), parameter :: model_names(4) = [character(len=24) :: &
      'hollow_sphere', 'modal_ball', 'measured_modes', 'hunt_crossley']

   !> Options of every model.
   type :: model_options_type
      !> The paper's analytical model.
      type(hollow_sphere_type) :: hollow_sphere
      !> The modes of the sphere.
      type(modal_ball_type) :: modal_ball
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
         get_measured_modes_fields(options%measured_modes), &
         get_hunt_crossley_fields(options%hunt_crossley)]
   end function get_model_fields

   !> Complains about options of the chosen model that do not fit each other.
   subroutine check_model(model, options, ball, error)
      !> Name of the model.
      character(len=*), intent(in) :: model
      !> The options, each inside its own range.
      type(model_options_type), intent(in) :: options
      !> The ball.
      type(ball_type), intent(in) :: ball
      !> What is wrong.
      type(error_type), allocatable, intent(out) :: error

      select case (model)
      case ('modal_ball')
         call check_modal_ball(options%modal_ball, error)
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
   subroutine solve_model(model, options, ball, drop, sampling, history, error)
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
      !> The model failed.
      type(error_type), allocatable, intent(out) :: error

      select case (model)
      case ('hollow_sphere')
         call solve_hollow_sphere(ball, drop, options%hollow_sphere, sampling, history, error)
      case ('modal_ball')
         call solve_modal_ball(ball, drop, options%modal_ball, sampling, history, error)
      case ('measured_modes')
         call solve_measured_modes(drop, options%measured_modes, sampling, history, error)
      case ('hunt_crossley')
         call solve_hunt_crossley(ball, drop, options%hunt_crossley, sampling, history, error)
      case default
         error = input_error('&model: name = '//quoted(model)//' is not allowed; allowed: '//join_quoted(model_names))
      end select
   end subroutine solve_model

end module thud_source_model
