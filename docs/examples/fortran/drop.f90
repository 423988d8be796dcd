! Drops the standard rubber ball by its modes and prints the octave levels of its force.
program drop
   use thud, only: ball_type, band_type, drop_type, error_type, force_history_type, get_force_exposure_levels, &
      get_octaves, modal_ball_type, sampling_type, solve_drop, wp
   implicit none
   type(modal_ball_type) :: model
   type(ball_type) :: ball
   type(force_history_type) :: history
   type(error_type), allocatable :: error
   type(band_type), allocatable :: bands(:)
   real(wp), allocatable :: level(:)
   integer :: i

   ! The modulus of the standard ball depends on the model.
   ball = ball_type(youngs_modulus=model%get_standard_modulus())
   call solve_drop(model, ball, drop_type(height=1.0_wp), sampling_type(), history, error)
   if (allocated(error)) error stop error%message
   bands = get_octaves()
   allocate (level(size(bands)))
   call get_force_exposure_levels(history%floor_force, history%sample_rate, bands, 'exact', level, error)
   if (allocated(error)) error stop error%message
   print '(a, f6.2, a)', 'contact', 1.0e3_wp*history%contact_time, ' ms'
   print '(f7.1, a, f7.2, a)', (bands(i)%center, ' Hz', level(i), ' dB', i=1, size(bands))
end program drop
