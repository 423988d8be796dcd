!> Files of the ball itself: its free modes, and snapshots of an impact.
module thud_ball_files
   use thud_csv, only: get_history_csv, get_table_csv
   use thud_free_modes, only: free_modes_type
   use thud_kinds, only: wp
   use thud_motion, only: motion_type
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: get_modes_csv, get_snapshots_csv

   !> Number of columns of `snapshots.csv`.
   integer, parameter :: n_column = 13

contains

   !> Table of free modes.
   subroutine get_modes_csv(modes, text)
      type(free_modes_type), intent(in) :: modes
      !> Text of `modes.csv`.
      character(len=:), allocatable, intent(out) :: text
      integer :: i

      associate (n => size(modes%frequency))
         text = get_table_csv('mode,harmonic,frequency_Hz,pole_participation', &
            reshape([modes%frequency, modes%participation], [n, 2]), &
            [(to_label(to_text(i)//','//to_text(modes%harmonic(i))), i=1, n)])
      end associate
   end subroutine get_modes_csv

   !> A text as an element of a list.
   pure function to_label(text) result(label)
      character(len=*), intent(in) :: text
      character(len=24) :: label

      label = text
   end function to_label

   !> Snapshots, one row for each time and node. Line and ring count the nodes from the lowest point to the highest and from
   !> the inner surface to the outer; neighbors of both make the cells. Stresses act on the outer surface, the pressure of
   !> the gas on the inner one.
   subroutine get_snapshots_csv(motion, text)
      type(motion_type), intent(in) :: motion
      !> Text of `snapshots.csv`.
      character(len=:), allocatable, intent(out) :: text
      real(wp), allocatable :: row(:, :)
      integer :: i, j, k, at

      allocate (row(motion%n_frame*size(motion%start)/2, n_column), source=0.0_wp)
      at = 0
      do k = 1, motion%n_frame
         do j = 1, size(motion%start, 2)
            do i = 1, size(motion%start, 1)
               at = at + 1
               row(at, 1:3) = [motion%time(k), real(i, wp), real(j, wp)]
               row(at, 4:5) = motion%start(i - 1, j - 1, :)
               row(at, 6:7) = motion%position(i - 1, j - 1, :, k)
               row(at, 8:9) = motion%velocity(i - 1, j - 1, :, k)
               if (j == size(motion%start, 2)) row(at, 10:11) = [motion%contact_pressure(i - 1, k), &
                  motion%contact_shear(i - 1, k)]
               row(at, 12:13) = [motion%cavity_pressure(k), motion%floor_displacement(k)]
            end do
         end do
      end do
      text = get_history_csv('time_s,line,ring,start_radius_m,start_height_m,radius_m,height_m,radial_velocity_m_per_s,' &
         //'upward_velocity_m_per_s,contact_pressure_Pa,contact_shear_Pa,cavity_pressure_Pa,floor_displacement_m', &
         row(:, 1), row(:, 2:))
   end subroutine get_snapshots_csv

end module thud_ball_files
