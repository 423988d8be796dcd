!> What several suites use: drops that must succeed or fail, levels, receivers, numbers without order.
module suite_support
   use thud_ball, only: ball_type, drop_type
   use thud_band, only: octave_count, octaves
   use thud_constants, only: pi
   use thud_error, only: error_type
   use thud_field, only: check_fields, field_type, list_type
   use thud_floor_model, only: floor_model_type, floor_state_type
   use thud_force_exposure, only: get_force_exposure_levels
   use thud_force_history, only: check_samples, force_history_type
   use thud_kinds, only: wp
   use thud_receiver, only: get_mobility, receiver_type
   use thud_refined_drop, only: solve_drop
   use thud_sampling, only: sampling_type
   use thud_source_model, only: source_model_type
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: check_solved, get_difference, get_drop_refusal, get_field_refusal, get_refusal, levels_of, list_of, noise
   public :: oscillator, prepared, resistance, solved, solved_drop, subject_of

contains

   !> Code and subject of an error, `1 &group: key`; the code alone for an error about no key, nothing without an error.
   pure function subject_of(error) result(subject)
      type(error_type), allocatable, intent(in) :: error
      character(len=:), allocatable :: subject

      subject = ''
      if (.not. allocated(error)) return
      subject = to_text(error%code)
      if (allocated(error%group)) subject = subject//' &'//error%group//': '//error%key
   end function subject_of

   !> Stops the suite with the message of an error where none is allowed.
   subroutine check_solved(error)
      type(error_type), allocatable, intent(in) :: error

      if (allocated(error)) error stop error%message
   end subroutine check_solved

   !> History of a drop, by default of the paper's ball from 1 m, that must succeed.
   function solved(model, ball, drop, sampling, receiver) result(history)
      class(source_model_type), intent(in) :: model
      type(ball_type), intent(in), optional :: ball
      type(drop_type), intent(in), optional :: drop
      type(sampling_type), intent(in), optional :: sampling
      type(receiver_type), intent(in), optional :: receiver
      type(force_history_type) :: history
      type(error_type), allocatable :: error

      call solve(model, ball, drop, sampling, receiver, history, error)
      call check_solved(error)
   end function solved

   !> The same at the resolution that the model needs, with its numerical error.
   function solved_drop(model, ball, drop, sampling) result(history)
      class(source_model_type), intent(in) :: model
      type(ball_type), intent(in), optional :: ball
      type(drop_type), intent(in), optional :: drop
      type(sampling_type), intent(in), optional :: sampling
      type(force_history_type) :: history
      type(error_type), allocatable :: error

      call solve_drop(model, ball_of(ball), drop_of(drop), sampling_of(sampling), history, error)
      call check_solved(error)
   end function solved_drop

   !> Code and subject of the error of a drop or of its samples.
   function get_drop_refusal(model, ball, drop, sampling, receiver) result(refusal)
      class(source_model_type), intent(in) :: model
      type(ball_type), intent(in), optional :: ball
      type(drop_type), intent(in), optional :: drop
      type(sampling_type), intent(in), optional :: sampling
      type(receiver_type), intent(in), optional :: receiver
      character(len=:), allocatable :: refusal
      type(force_history_type) :: history
      type(error_type), allocatable :: error

      call solve(model, ball, drop, sampling, receiver, history, error)
      if (.not. allocated(error)) call check_samples(history, error)
      refusal = subject_of(error)
   end function get_drop_refusal

   !> A drop with what is stated of it.
   subroutine solve(model, ball, drop, sampling, receiver, history, error)
      class(source_model_type), intent(in) :: model
      type(ball_type), intent(in), optional :: ball
      type(drop_type), intent(in), optional :: drop
      type(sampling_type), intent(in), optional :: sampling
      type(receiver_type), intent(in), optional :: receiver
      type(force_history_type), intent(out) :: history
      type(error_type), allocatable, intent(out) :: error

      call model%solve(ball_of(ball), drop_of(drop), sampling_of(sampling), history, error, receiver)
   end subroutine solve

   !> A ball as stated, or the default one.
   pure function ball_of(stated) result(ball)
      type(ball_type), intent(in), optional :: stated
      type(ball_type) :: ball

      if (present(stated)) ball = stated
   end function ball_of

   !> A drop as stated, or the default one.
   pure function drop_of(stated) result(drop)
      type(drop_type), intent(in), optional :: stated
      type(drop_type) :: drop

      if (present(stated)) drop = stated
   end function drop_of

   !> Samples as stated, or the default ones.
   pure function sampling_of(stated) result(sampling)
      type(sampling_type), intent(in), optional :: stated
      type(sampling_type) :: sampling

      if (present(stated)) sampling = stated
   end function sampling_of

   !> Code and subject of the error that the keys of a model bring together.
   function get_refusal(model, ball, sampling) result(refusal)
      class(source_model_type), intent(in) :: model
      type(ball_type), intent(in), optional :: ball
      type(sampling_type), intent(in), optional :: sampling
      character(len=:), allocatable :: refusal
      type(error_type), allocatable :: error

      call model%check(ball_of(ball), sampling_of(sampling), error)
      refusal = subject_of(error)
   end function get_refusal

   !> Code and subject of the error that the range of a key brings.
   function get_field_refusal(fields) result(refusal)
      type(field_type), intent(in) :: fields(:)
      character(len=:), allocatable :: refusal
      type(error_type), allocatable :: error

      call check_fields(fields, error)
      refusal = subject_of(error)
   end function get_field_refusal

   !> Levels of the force on the floor in octaves, dB.
   function levels_of(history) result(levels)
      type(force_history_type), intent(in) :: history
      real(wp) :: levels(octave_count)
      type(error_type), allocatable :: error

      call get_force_exposure_levels(history%floor_force, history%sample_rate, octaves, 'exact', levels, error)
      call check_solved(error)
   end function levels_of

   !> What a floor prepares, which must succeed.
   function prepared(floor) result(state)
      class(floor_model_type), intent(in) :: floor
      type(floor_state_type) :: state
      type(error_type), allocatable :: error

      call floor%prepare(state, error)
      call check_solved(error)
   end function prepared

   !> The infinite plate of a resistance, N s/m.
   pure function resistance(value) result(receiver)
      real(wp), intent(in) :: value
      type(receiver_type) :: receiver

      receiver%direct = 1/value
      allocate (receiver%pole(0), receiver%residue(0))
   end function resistance

   !> A mass, kg, on a spring, at its frequency, Hz, with a damper of less than critical damping.
   pure function oscillator(mass, frequency, damping_ratio) result(receiver)
      real(wp), intent(in) :: mass, frequency, damping_ratio
      type(receiver_type) :: receiver
      complex(wp) :: pole

      pole = 2*pi*frequency*cmplx(-damping_ratio, sqrt(1 - damping_ratio**2), wp)
      receiver%pole = [pole]
      receiver%residue = [2*pole/(mass*(pole - conjg(pole)))]
   end function oscillator

   !> Largest difference of the mobilities of two receivers, m/(N s).
   pure function get_difference(first, second) result(difference)
      type(receiver_type), intent(in) :: first, second
      real(wp) :: difference
      real(wp), parameter :: frequency(4) = [10.0_wp, 100.0_wp, 1000.0_wp, 10000.0_wp]

      difference = maxval(abs(get_mobility(first, frequency) - get_mobility(second, frequency)))
   end function get_difference

   !> A list of numbers as a key takes it.
   pure function list_of(values) result(list)
      real(wp), intent(in) :: values(:)
      type(list_type) :: list

      list%count = size(values)
      list%values(:size(values)) = values
   end function list_of

   !> Numbers between -1 and 1, always the same.
   pure function noise(count, seed) result(numbers)
      integer, intent(in) :: count, seed
      real(wp) :: numbers(count)
      integer :: i

      numbers = [(2*modulo(sin(12.9898_wp*i + 78.233_wp*seed)*43758.5453_wp, 1.0_wp) - 1, i=1, count)]
   end function noise

end module suite_support
