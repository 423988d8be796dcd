!> The result of every source model: the force on a floor, sampled from first touch on. Levels, assessments and files use
!> only this type and no source model.
module thud_force_history
   use thud_band, only: octave_count
   use thud_constants, only: not_a_number
   use thud_error, only: error_type, input_error
   use thud_kinds, only: wp
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: add_model_quantity, add_to_means, check_samples, force_count, force_history_type, force_names
   public :: get_model_quantity, holds_impulse, max_residual, min_contact_samples, motion_type, new_force_history
   public :: numerical_error_type, snapshot_type

   !> Residual of the balances of impulse and energy above which all models except the finite elements return an error; it
   !> is below 1e-9 at the default step.
   real(wp), parameter :: max_residual = 1.0e-6_wp

   !> Minimum number of samples of a contact: fewer show only a few spikes.
   real(wp), parameter :: min_contact_samples = 8.0_wp

   !> Fraction of the impulse that samples may miss; with eight samples in a contact they miss up to 0.006.
   real(wp), parameter :: max_missing = 0.02_wp

   !> Number of forces for levels and assessments: without and with the flux of momentum.
   integer, parameter :: force_count = 2

   !> Names of these forces.
   character(len=8), parameter :: force_names(force_count) = [character(len=8) :: 'elastic', 'floor']

   !> Length of the name of a force component.
   integer, parameter :: name_length = 24

   !> The deforming ball at one time, for pictures: its nodes run from the lowest point to the highest and from the inner
   !> surface to the outer.
   type :: snapshot_type
      !> Time since the beginning of the record, s.
      real(wp) :: time = 0.0_wp
      !> Positions of the nodes, m, relative to a floor at rest at height 0: [0:n_polar, 0:n_radial, 2].
      real(wp), allocatable :: position(:, :, :)
      !> Velocities, m/s: the same shape.
      real(wp), allocatable :: velocity(:, :, :)
      !> Stresses from the floor on the nodes of the outer surface, outwards and upwards, Pa: [n_polar + 1, 2].
      real(wp), allocatable :: contact_stress(:, :)
      !> Overpressure of the gas, Pa.
      real(wp) :: cavity_pressure = 0.0_wp
      !> Displacement of the floor under the ball, downwards, m.
      real(wp) :: floor_displacement = 0.0_wp
   end type snapshot_type

   !> The snapshots of an impact.
   type :: motion_type
      !> Positions of the nodes before the impact, m: [0:n_polar, 0:n_radial, 2].
      real(wp), allocatable :: start(:, :, :)
      !> Number of snapshots taken.
      integer :: n_frame = 0
      !> The snapshots, and space for more: [capacity].
      type(snapshot_type), allocatable :: snapshot(:)
   end type motion_type

   !> Errors due to the resolution; NaN if they are not known.
   type :: numerical_error_type
      !> Whether they could be estimated.
      logical :: known = .false.
      !> Errors of the octave levels of the force on the floor, dB.
      real(wp) :: octave(octave_count) = not_a_number
      !> Errors of contact time, s, restitution, and peak force, N.
      real(wp) :: contact_time = not_a_number, restitution = not_a_number, peak_force = not_a_number
   end type numerical_error_type

   !> Force of one impact, and numbers that describe it.
   type :: force_history_type
      !> Samples per second, Hz; sample i belongs to the time (i - 1)/sample_rate in the record: it is the value at this
      !> instant, or the mean over the sampling interval around it.
      real(wp) :: sample_rate = 0.0_wp
      !> Whether a sample of the force is such a mean.
      logical :: has_means = .false.
      !> Deflection of the source, m: [n_sample].
      real(wp), allocatable :: deflection(:)
      !> Rate of the deflection, m/s: [n_sample].
      real(wp), allocatable :: velocity(:)
      !> Names of the components of the force: [n_component].
      character(len=name_length), allocatable :: component_name(:)
      !> Components of the force, N: [n_sample, n_component].
      real(wp), allocatable :: component(:, :)
      !> Force without the flux of momentum (the ball force of the paper), N: [n_sample].
      real(wp), allocatable :: elastic_force(:)
      !> Total force on the floor, N: [n_sample].
      real(wp), allocatable :: floor_force(:)
      !> Displacement, m, and velocity, m/s, of a mobile floor under the source, downwards: [n_sample].
      real(wp), allocatable :: floor_displacement(:), floor_velocity(:)
      !> Energy that the source gives to the floor, J.
      real(wp) :: floor_work = 0.0_wp
      !> Names, with units, of further quantities against time: [n_model_history].
      character(len=name_length), allocatable :: model_history_name(:)
      !> Values of these quantities: [n_sample, n_model_history].
      real(wp), allocatable :: model_history(:, :)
      !> Names of scalar quantities that the model chose or computed: [n_model_quantity].
      character(len=name_length), allocatable :: model_quantity_name(:)
      !> SI units of these scalars: [n_model_quantity].
      character(len=8), allocatable :: model_quantity_unit(:)
      !> Values of these scalars: [n_model_quantity].
      real(wp), allocatable :: model_quantity(:)
      !> Velocity towards the floor at first touch, m/s.
      real(wp) :: impact_velocity = 0.0_wp
      !> Snapshots of the deformed source, if the model takes any.
      type(motion_type), allocatable :: motion
      !> Time of first touch in the record, s.
      real(wp) :: touch_time = 0.0_wp
      !> Time from first touch to release, s.
      real(wp) :: contact_time = 0.0_wp
      !> Contact time resolved between steps, s; `solve_drop` sets it where a model does not.
      real(wp) :: exact_contact_time = 0.0_wp
      !> Maximum force on the floor, N; low-passed if the model has spikes that no force plate records.
      real(wp) :: peak_force = 0.0_wp
      !> Maximum elastic force, N, likewise.
      real(wp) :: peak_elastic_force = 0.0_wp
      !> Maximum force on the floor in the steps of a model whose samples are means over several, N; otherwise 0.
      real(wp) :: step_peak_force = 0.0_wp
      !> Maximum deflection, m.
      real(wp) :: max_deflection = 0.0_wp
      !> Velocity at release divided by velocity at first touch.
      real(wp) :: restitution = 0.0_wp
      !> Time integral of the force on the floor, N s.
      real(wp) :: impulse = 0.0_wp
      !> |impulse - change of momentum|, divided by the change of momentum.
      real(wp) :: impulse_residual = 0.0_wp
      !> |energy at release + loss - energy at first touch|, divided by the energy at first touch.
      real(wp) :: energy_residual = 0.0_wp
      !> Octave levels of the force on the floor, dB, for their error; NaN if unknown. Those of results are made by `assess`.
      real(wp) :: octave_level(octave_count) = not_a_number
      !> Estimated error divided by the difference from a coarser resolution, if the model converges more slowly than others.
      real(wp) :: error_ratio = 0.0_wp
      !> Errors due to the resolution.
      type(numerical_error_type) :: numerical_error
   end type force_history_type

contains

   !> Whether samples represent the impulse of a force.
   elemental function holds_impulse(sampled, impulse) result(yes)
      !> Sum of the samples divided by the sampling rate, and time integral of the force, N s.
      real(wp), intent(in) :: sampled, impulse
      logical :: yes

      yes = abs(sampled - impulse) <= max_missing*impulse
   end function holds_impulse

   !> Checks that a contact has enough samples, which do not miss part of the force, such as a spike between two of them.
   subroutine check_samples(history, error)
      !> The history, complete.
      type(force_history_type), intent(in) :: history
      !> Set if they are too few, or the impulses differ; the message states the required rate, or both impulses.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: sampled

      sampled = sum(history%floor_force)/history%sample_rate
      associate (rate => history%sample_rate, contact_time => history%contact_time)
         if (.not. contact_time*rate >= min_contact_samples) then
            error = input_error('= '//to_text(rate)//' Hz gives the contact of '//to_text(contact_time)//' s too few ' &
               //'samples; allowed: from '//to_text(min_contact_samples/contact_time)//' Hz', 'sampling', 'sample_rate')
         else if (.not. holds_impulse(sampled, history%impulse)) then
            error = input_error('= '//to_text(rate)//' Hz misses the force: its samples hold an impulse of ' &
               //to_text(sampled)//' N s of '//to_text(history%impulse)//' N s; allowed: a higher one', 'sampling', &
               'sample_rate')
         end if
      end associate
   end subroutine check_samples

   !> Adds the integral of a quantity over a part of a sampling interval to the means of the samples before and after it.
   pure subroutine add_to_means(integral, interval, i, fraction, mean)
      !> The integral, in the unit of the quantity times s; sampling interval, s.
      real(wp), intent(in) :: integral, interval
      !> Index of the sample before.
      integer, intent(in) :: i
      !> Fraction of the part that lies nearer to the sample after.
      real(wp), intent(in) :: fraction
      !> Means over the sampling intervals around the samples: [n_sample].
      real(wp), intent(inout) :: mean(:)

      mean(i) = mean(i) + (1 - fraction)*integral/interval
      if (i < size(mean)) mean(i + 1) = mean(i + 1) + fraction*integral/interval
   end subroutine add_to_means

   !> Adds a scalar quantity of the model.
   pure subroutine add_model_quantity(history, name, unit, value)
      type(force_history_type), intent(inout) :: history
      !> Name and SI unit.
      character(len=*), intent(in) :: name, unit
      real(wp), intent(in) :: value

      history%model_quantity_name = [character(len=name_length) :: history%model_quantity_name, name]
      history%model_quantity_unit = [character(len=len(history%model_quantity_unit)) :: history%model_quantity_unit, unit]
      history%model_quantity = [history%model_quantity, value]
   end subroutine add_model_quantity

   !> A quantity that the model has stated.
   pure function get_model_quantity(history, name) result(value)
      type(force_history_type), intent(in) :: history
      character(len=*), intent(in) :: name
      !> The value; 0 if there is none.
      real(wp) :: value

      value = sum(history%model_quantity, mask=history%model_quantity_name == name)
   end function get_model_quantity

   !> A history of zero force, all arrays allocated and zero.
   pure function new_force_history(sample_rate, n_sample, component_name, model_history_name) result(history)
      !> Samples per second, Hz.
      real(wp), intent(in) :: sample_rate
      integer, intent(in) :: n_sample
      !> Names of the components of the force: [n_component].
      character(len=*), intent(in) :: component_name(:)
      !> Names, with units, of further quantities against time (default: none): [n_model_history].
      character(len=*), intent(in), optional :: model_history_name(:)
      type(force_history_type) :: history

      history%sample_rate = sample_rate
      allocate (history%component_name(size(component_name)))
      history%component_name = component_name
      allocate (history%deflection(n_sample), history%velocity(n_sample), history%elastic_force(n_sample), &
         history%floor_force(n_sample), source=0.0_wp)
      allocate (history%component(n_sample, size(component_name)), source=0.0_wp)
      allocate (history%model_quantity_name(0), history%model_quantity_unit(0), history%model_quantity(0))
      if (.not. present(model_history_name)) return
      allocate (history%model_history_name(size(model_history_name)))
      history%model_history_name = model_history_name
      allocate (history%model_history(n_sample, size(model_history_name)), source=0.0_wp)
   end function new_force_history

end module thud_force_history
