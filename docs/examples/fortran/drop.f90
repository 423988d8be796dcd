! Drops the standard rubber ball by its modes and prints the octave levels of its force.
program drop
   use thud, only: ball_type, drop_type, error_type, force_history_type, get_force_exposure_levels, &
      modal_ball_modulus, modal_ball_type, octaves, sampling_type, solve_drop, wp
   implicit none
   type(modal_ball_type) :: model
   type(ball_type) :: ball
   type(force_history_type) :: history
   type(error_type), allocatable :: error
   real(wp) :: level(size(octaves))
   integer :: i

   ! The modulus of the standard ball depends on the model.
   ball = ball_type(youngs_modulus=modal_ball_modulus)
   call solve_drop(model, ball, drop_type(height=1.0_wp), sampling_type(), history, error)
   if (allocated(error)) error stop error%message
   call get_force_exposure_levels(history%floor_force, history%sample_rate, octaves, 'exact', level, error)
   if (allocated(error)) error stop error%message
   print '(a, f6.2, a)', 'contact', 1.0e3_wp*history%contact_time, ' ms'
   print '(f7.1, a, f7.2, a)', (octaves(i)%center, ' Hz', level(i), ' dB', i=1, size(octaves))
end program drop
