!> Files of finite element results: free modes, and snapshots of an impact.
module thud_mesh_files
   use thud_file, only: text_file_type
   use thud_free_modes, only: free_modes_type
   use thud_kinds, only: wp
   use thud_motion, only: motion_type
   use thud_text, only: fixed, newline, to_text
   use thud_text_buffer, only: text_buffer_type
   use thud_vtu, only: biquadratic_quadrilateral, get_vtu
   use thud_xdmf, only: add_snapshot, begin_snapshots, end_snapshots
   implicit none (type, external)
   private

   public :: estimate_motion_bytes, get_modes_files, get_motion_files, modes_file_names, motion_file_names

   !> Files of free modes.
   character(len=9), parameter :: modes_file_names(2) = [character(len=9) :: 'modes.csv', 'modes.vtu']

   !> Files of the snapshots of an impact.
   character(len=13), parameter :: motion_file_names(2) = [character(len=13) :: 'snapshots.xmf', 'pressure.csv']

   !> Names of the scalars of a snapshot.
   character(len=18), parameter :: motion_scalars(4) = [character(len=18) :: 'contact_pressure', 'contact_shear', &
      'cavity_pressure', 'floor_displacement']

contains

   !> Table and mode shapes of free modes.
   subroutine get_modes_files(modes, files)
      type(free_modes_type), intent(in) :: modes
      !> The files: [2].
      type(text_file_type), intent(out) :: files(:)
      character(len=48) :: name(size(modes%frequency))
      real(wp) :: vector(2, size(modes%mesh%r), size(modes%frequency))
      integer :: i

      files%name = modes_file_names
      files(1)%content = 'mode,harmonic,frequency_Hz,pole_participation'//newline &
         //'rigid,1,'//to_text(modes%rigid_frequency)//',1'//newline
      do i = 1, size(modes%frequency)
         files(1)%content = files(1)%content//to_text(i)//','//to_text(modes%harmonic(i))//',' &
            //to_text(modes%frequency(i))//','//to_text(modes%participation(i))//newline
         name(i) = 'mode '//to_text(i)//', '//fixed(modes%frequency(i), 3)//' Hz'
         vector(:, :, i) = reshape(modes%shape(:, :, :, i), [2, size(modes%mesh%r)])
      end do
      call get_vtu(get_points(modes%mesh%r, modes%mesh%z), get_cells(modes%mesh%n_polar, modes%mesh%n_radial, 2), &
         biquadratic_quadrilateral, name, vector, files(2)%content)
   end subroutine get_modes_files

   !> Approximate size of the snapshots of an impact, bytes.
   pure function estimate_motion_bytes(extents) result(bytes)
      !> Numbers of nodes from pole to pole, nodes through the wall, and snapshots.
      integer, intent(in) :: extents(3)
      real(wp) :: bytes

      ! Six numbers per node have 17 digits, the others are mostly zero; an element has four nodes.
      associate (n => real(extents, wp))
         bytes = n(3)*(1600 + 150*n(1)*n(2) + 20*(n(1) - 1)*(n(2) - 1))
      end associate
   end function estimate_motion_bytes

   !> Snapshots, and table of the pressures on the floor.
   subroutine get_motion_files(motion, prefix, files)
      type(motion_type), intent(in) :: motion
      !> Prefix of the file names.
      character(len=*), intent(in) :: prefix
      !> The files: [2].
      type(text_file_type), intent(out) :: files(:)
      type(text_buffer_type) :: buffer
      real(wp) :: vector(2, size(motion%start, 1)*size(motion%start, 2), 2), scalar(size(vector, 2), size(motion_scalars))
      integer :: i, n_polar, n_radial

      n_polar = ubound(motion%start, 1)
      n_radial = ubound(motion%start, 2)
      call begin_snapshots(buffer)
      do i = 1, motion%n_frame
         vector(:, :, 1) = get_points(motion%position(:, :, 1, i) - motion%start(:, :, 1), &
            motion%position(:, :, 2, i) - motion%start(:, :, 2))
         vector(:, :, 2) = get_points(motion%velocity(:, :, 1, i), motion%velocity(:, :, 2, i))
         scalar = 0.0_wp
         scalar(size(scalar, 1) - n_polar:, 1) = motion%contact_pressure(:, i)
         scalar(size(scalar, 1) - n_polar:, 2) = motion%contact_shear(:, i)
         scalar(:n_polar + 1, 3) = motion%cavity_pressure(i)
         scalar(:, 4) = motion%floor_displacement(i)
         call add_snapshot(buffer, motion%time(i), get_points(motion%position(:, :, 1, i), motion%position(:, :, 2, i)), &
            get_cells(n_polar, n_radial, 1), [character(len=12) :: 'displacement', 'velocity'], vector, motion_scalars, &
            scalar)
      end do
      call end_snapshots(buffer)
      files%name = prefix//motion_file_names
      files(1)%content = buffer%get_text()
      call get_pressure_csv(motion, files(2)%content)
   end subroutine get_motion_files

   !> Pressures and radial shear stresses on the floor, one line per snapshot and touching node.
   subroutine get_pressure_csv(motion, text)
      type(motion_type), intent(in) :: motion
      !> Text of `pressure.csv`.
      character(len=:), allocatable, intent(out) :: text
      type(text_buffer_type) :: buffer
      integer :: i, j

      call buffer%append('time_s,radius_m,pressure_Pa,shear_Pa'//newline)
      do i = 1, motion%n_frame
         do j = 0, ubound(motion%contact_pressure, 1)
            if (.not. motion%contact_pressure(j, i) > 0.0_wp) cycle
            call buffer%append(to_text(motion%time(i))//','//to_text(motion%position(j, ubound(motion%position, 2), 1, i)) &
               //','//to_text(motion%contact_pressure(j, i))//','//to_text(motion%contact_shear(j, i))//newline)
         end do
      end do
      text = buffer%get_text()
   end subroutine get_pressure_csv

   !> Vectors at all nodes, one after the other.
   pure function get_points(r, z) result(point)
      !> Components of the vectors: [nodes from pole to pole, nodes through the wall].
      real(wp), intent(in) :: r(:, :), z(:, :)
      !> The vectors, in array order: [2, n_node].
      real(wp) :: point(2, size(r))

      point(1, :) = reshape(r, [size(r)])
      point(2, :) = reshape(z, [size(z)])
   end function get_points

   !> Node numbers of the elements, in VTK's order.
   pure function get_cells(n_polar, n_radial, order) result(cell)
      !> Numbers of elements from pole to pole and through the wall.
      integer, intent(in) :: n_polar, n_radial
      integer, intent(in) :: order
      !> Node numbers, from 1: [4 or 9, n_element].
      integer :: cell((order + 1)**2, n_polar*n_radial)
      integer :: i, j, line, first

      line = order*n_polar + 1
      do i = 1, n_radial
         do j = 1, n_polar
            first = 1 + order*(j - 1) + line*order*(i - 1)
            associate (corners => [first, first + order*line, first + order*line + order, first + order])
               if (order == 1) then
                  cell(:, j + n_polar*(i - 1)) = corners
               else
                  cell(:, j + n_polar*(i - 1)) = [corners, first + line, first + 2*line + 1, first + line + 2, first + 1, &
                     first + line + 1]
               end if
            end associate
         end do
      end do
   end function get_cells

end module thud_mesh_files
