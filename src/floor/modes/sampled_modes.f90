!> Modes of a floor from samples on a grid in a file, measured or of another program: splines through the samples.
!>
!> The file is a table, see `thud_table_reader`, with one column per mode after two further columns.
!> Rows that begin with `frequency` (Hz), `loss_factor` and, if the shapes are not normalized to a modal mass of 1 kg,
!> `modal_mass` (kg) describe the modes. All other rows are points: x, y (m) and the shapes of the modes there, the motion
!> normal to the floor. A row that begins with `x` is a header.
module thud_sampled_modes
   use, intrinsic :: iso_fortran_env, only: int64
   use thud_ascending, only: get_ascending_order
   use thud_constants, only: pi
   use thud_error, only: error_type, input_error, prefix_error
   use thud_floor_modes, only: floor_modes_type
   use thud_function_set, only: min_nodes, new_splines
   use thud_kinds, only: wp
   use thud_modes, only: shape_type
   use thud_system, only: get_size
   use thud_table_reader, only: cell_length, open_table, read_number, read_row, row_error, table_reader_type
   use thud_text, only: fixed, lower_case, quoted, to_text
   implicit none (type, external)
   private

   public :: read_sampled_modes

   !> Maximum size of a file, bytes.
   integer(int64), parameter :: max_size = 200000000_int64

   !> Rows that describe the modes.
   integer, parameter :: label_length = 11
   character(len=label_length), parameter :: labels(*) = [character(len=label_length) :: 'frequency', 'loss_factor', &
      'modal_mass']

   !> Limits of their values: above 0, and up to these.
   real(wp), parameter :: highest_value(*) = [1.0e6_wp, 1.0_wp, 1.0e9_wp]

   !> Maximum number of points: time and memory of the radiation.
   integer, parameter :: max_points = 10000

   !> Coordinates closer than this, relative to the floor, are equal.
   real(wp), parameter :: same_position = 1.0e-6_wp

   !> Maximum ratio of the sum of squared differences of neighbors to the sum of squares: 2 is that of a wave of four grid
   !> spacings, 4 sin(pi/4)**2.
   real(wp), parameter :: max_roughness = 2.0_wp

contains

   !> Modes of a floor from a file.
   subroutine read_sampled_modes(path, modes, error)
      character(len=*), intent(in) :: path
      type(floor_modes_type), intent(out) :: modes
      !> Set if the file cannot be read, or its modes are not complete; the message begins with the path.
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: frequency(:), loss_factor(:), point(:, :), x(:), y(:), shape(:, :, :)
      integer(int64) :: bytes

      ! Pipes and devices have no size; opening one could block.
      bytes = get_size(path)
      if (bytes < 1 .or. bytes > max_size) then
         error = input_error('there is no such file, or it is empty, a directory, not regular or too large; allowed: a ' &
            //'table of modes of up to '//to_text(int(max_size))//' bytes')
      else
         ! Threads may read the same file, and none can be open twice.
         !$omp critical (thud_sampled_modes)
         call read_rows(path, frequency, loss_factor, point, error)
         !$omp end critical (thud_sampled_modes)
      end if
      if (.not. allocated(error)) call get_coordinates(point(1, :), 'x', x, error)
      if (.not. allocated(error)) call get_coordinates(point(2, :), 'y', y, error)
      if (.not. allocated(error)) call get_shapes(point, x, y, shape, error)
      if (.not. allocated(error)) call check_shapes(shape, frequency, error)
      if (allocated(error)) then
         call prefix_error(error, path)
      else
         call get_sampled_modes(frequency, loss_factor, x, y, shape, modes)
      end if
   end subroutine read_sampled_modes

   !> Reads all rows of a file.
   subroutine read_rows(path, frequency, loss_factor, point, error)
      character(len=*), intent(in) :: path
      !> Natural frequencies, Hz, and loss factors: [n_mode].
      real(wp), allocatable, intent(out) :: frequency(:), loss_factor(:)
      !> Points, with coordinates, m, and shapes for a modal mass of 1 kg, 1/sqrt(kg): [2 + n_mode, n_point].
      real(wp), allocatable, intent(out) :: point(:, :)
      !> Set if a row is not one of a table, or one is missing.
      type(error_type), allocatable, intent(out) :: error
      type(table_reader_type) :: table
      character(len=cell_length), allocatable :: cells(:)
      character(len=:), allocatable :: missing
      real(wp), allocatable :: value(:), rows(:, :)
      logical, allocatable :: valid(:)
      integer :: at(0:size(labels))
      integer :: i, label, n, n_point

      ! Index of the latest row without a label, and of that with each label.
      at = 0
      n = 0
      n_point = 0
      call open_table(path, table, error)
      do
         if (.not. allocated(error)) call read_row(table, cells, error)
         if (allocated(error)) return
         if (size(cells) == 0) exit
         if (index(lower_case(cells(1)), 'x') == 1) cycle
         label = findloc(labels == lower_case(cells(1)), .true., dim=1)
         ! A label and a unit stand before values.
         if (label > 0) cells(:min(2, size(cells))) = '0'
         if (n == 0) allocate (rows(size(cells), 8))
         if (allocated(value)) deallocate (value, valid)
         allocate (value(size(cells)), valid(size(cells)))
         call read_number(cells, value, valid)
         i = findloc(valid, .false., dim=1)
         if (i > 0) then
            error = row_error(table, quoted(trim(cells(i)))//' in column '//to_text(i)//' is not a number; allowed: ' &
               //'finite numbers, and in the first column also frequency, loss_factor, modal_mass or x')
         else if (label > 0) then
            i = findloc(value(3:) > 0.0_wp .and. value(3:) <= highest_value(label), .false., dim=1)
            if (at(label) > 0) then
               error = row_error(table, trim(labels(label))//' is given twice; allowed: once')
            else if (i > 0) then
               error = row_error(table, trim(labels(label))//' of mode '//to_text(i)//' is '//to_text(value(2 + i)) &
                  //'; allowed: above 0, up to '//to_text(highest_value(label)))
            end if
         end if
         if (size(value) /= size(rows, 1) .and. .not. allocated(error)) error = row_error(table, 'it has ' &
            //to_text(size(value))//' cells, the rows before it '//to_text(size(rows, 1))//'; allowed: two and one for ' &
            //'each mode')
         if (allocated(error)) return
         if (n == size(rows, 2)) rows = reshape(rows, [size(rows, 1), 2*n], pad=[0.0_wp])
         n = n + 1
         rows(:, n) = value
         at(label) = n
         if (label == 0) n_point = n_point + 1
      end do
      missing = ''
      if (at(0) == 0) missing = 'x, y and the shapes at a point'
      if (at(2) == 0) missing = trim(labels(2))
      if (at(1) == 0) missing = trim(labels(1))
      if (missing /= '') then
         error = input_error('there is no row of '//missing//'; allowed: a table with rows '//trim(labels(1))//' (Hz) and ' &
            //trim(labels(2))//', and a row of x, y (m) and the shapes of all modes for each point')
      else if (n_point > max_points) then
         error = input_error('the grid has '//to_text(n_point)//' points; allowed: up to '//to_text(max_points) &
            //', of which eight per wavelength are enough')
      else if (size(rows, 1) < 3) then
         error = input_error('there are no modes; allowed: a column for each mode behind the first two')
      end if
      if (allocated(error)) return
      frequency = rows(3:, at(1))
      loss_factor = rows(3:, at(2))
      point = rows(:, pack([(i, i=1, n)], [(all(at(1:) /= i), i=1, n)]))
      do i = 1, merge(n_point, 0, at(3) > 0)
         point(3:, i) = point(3:, i)/sqrt(rows(3:, at(3)))
      end do
   end subroutine read_rows

   !> Shapes at the points of a grid.
   subroutine get_shapes(point, x, y, shape, error)
      !> Points, with coordinates and shapes: [2 + n_mode, n_point].
      real(wp), intent(in) :: point(:, :)
      !> Coordinates of the grid, m: [n_x], [n_y].
      real(wp), intent(in) :: x(:), y(:)
      !> Shapes for a modal mass of 1 kg, 1/sqrt(kg): [n_x, n_y, n_mode].
      real(wp), allocatable, intent(out) :: shape(:, :, :)
      !> Set if the points are not a rectangular grid over the floor.
      type(error_type), allocatable, intent(out) :: error
      logical :: is_set(size(x), size(y))
      integer :: i, j, k

      is_set = .false.
      if (size(is_set) == size(point, 2)) then
         allocate (shape(size(x), size(y), size(point, 1) - 2))
         do k = 1, size(point, 2)
            i = minloc(abs(x - point(1, k)), dim=1)
            j = minloc(abs(y - point(2, k)), dim=1)
            is_set(i, j) = .true.
            shape(i, j, :) = point(3:, k)
         end do
      end if
      if (.not. all(is_set)) error = input_error('the points are no rectangular grid: there are ' &
         //to_text(size(point, 2))//' with '//to_text(size(x))//' values of x and '//to_text(size(y))//' of y; allowed: ' &
         //'one point for each pair of x and y')
   end subroutine get_shapes

   !> Coordinates of a grid, ascending.
   subroutine get_coordinates(value, name, coordinate, error)
      !> Coordinates of all points, m: [n_point].
      real(wp), intent(in) :: value(:)
      !> Name of the coordinate.
      character(len=*), intent(in) :: name
      real(wp), allocatable, intent(out) :: coordinate(:)
      !> Set if they do not begin at 0, or are too few.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: next, side

      side = maxval(value) - minval(value)
      allocate (coordinate(0))
      next = minval(value)
      do
         coordinate = [coordinate, next]
         if (.not. any(value > next + same_position*side)) exit
         next = minval(value, mask=value > next + same_position*side)
      end do
      if (abs(coordinate(1)) > same_position*side) then
         error = input_error(name//' begins at '//to_text(coordinate(1))//' m; allowed: a grid from the corner of the ' &
            //'floor, 0, to its opposite edge')
      else if (size(coordinate) < min_nodes) then
         error = input_error('the grid has '//to_text(size(coordinate))//' values of '//name//'; allowed: at least ' &
            //to_text(min_nodes))
      end if
      coordinate(1) = 0.0_wp
   end subroutine get_coordinates

   !> Checks that the grid resolves the shapes.
   subroutine check_shapes(shapes, frequency, error)
      !> Shapes: [n_x, n_y, n_mode].
      real(wp), intent(in) :: shapes(:, :, :)
      !> Natural frequencies, Hz: [n_mode].
      real(wp), intent(in) :: frequency(:)
      !> Set if a mode does not move, or a grid spacing is more than a quarter of its wavelength.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: roughness(2)
      real(wp) :: total
      integer :: k

      associate (n_x => size(shapes, 1), n_y => size(shapes, 2))
         do k = 1, size(frequency)
            associate (shape => shapes(:, :, k))
               total = sum(shape**2)
               if (.not. total > 0.0_wp) then
                  error = input_error('mode '//to_text(k)//' is 0 at all points; allowed: modes that move')
                  return
               end if
               roughness = [sum((shape(2:, :) - shape(:n_x - 1, :))**2), sum((shape(:, 2:) - shape(:, :n_y - 1))**2)]/total
            end associate
            if (maxval(roughness) <= max_roughness) cycle
            error = input_error('the grid is too coarse for mode '//to_text(k)//' at '//fixed(frequency(k), 1) &
               //' Hz: along '//merge('x', 'y', roughness(1) > roughness(2))//' its wavelength is less than four grid ' &
               //'spacings; allowed: more points, or fewer modes')
            return
         end do
      end associate
   end subroutine check_shapes

   !> Modes of a floor from a table.
   subroutine get_sampled_modes(frequency, loss_factor, x, y, samples, modes)
      !> Natural frequencies, Hz, and loss factors: [n_mode].
      real(wp), intent(in) :: frequency(:), loss_factor(:)
      !> Coordinates of the grid, m: [n_x], [n_y].
      real(wp), intent(in) :: x(:), y(:)
      !> Shapes there, 1/sqrt(kg): [n_x, n_y, n_mode].
      real(wp), intent(in) :: samples(:, :, :)
      type(floor_modes_type), intent(out) :: modes
      type(shape_type) :: shape
      real(wp), allocatable :: by_x(:, :), by_y(:, :)
      integer, allocatable :: order(:)
      integer :: i

      modes%stack%length = x(size(x))
      modes%stack%width = y(size(y))
      allocate (modes%stack%plate(1), modes%stack%layer(0))
      order = get_ascending_order(frequency)
      modes%omega = 2*pi*frequency(order)
      modes%loss_factor = loss_factor(order)
      ! There is no mode above the highest one.
      modes%limit = maxval(modes%omega)*(1 + epsilon(1.0_wp))
      modes%sum_limit = modes%limit
      allocate (modes%modes%displacement(1), modes%modes%block(1))
      call new_splines(x, modes%modes%displacement(1)%x, by_x)
      call new_splines(y, modes%modes%displacement(1)%y, by_y)
      shape%x = [(i, i=1, size(x))]
      shape%y = [(i, i=1, size(y))]
      allocate (shape%coefficient(size(x)*size(y), size(order)))
      do i = 1, size(order)
         shape%coefficient(:, i) = reshape(matmul(matmul(by_x, samples(:, :, order(i))), transpose(by_y)), [size(x)*size(y)])
      end do
      associate (block => modes%modes%block(1))
         block%omega = modes%omega
         block%loss_factor = modes%loss_factor
         block%bearing_share = spread(1.0_wp, 1, size(order))
         block%shape = [shape]
      end associate
   end subroutine get_sampled_modes

end module thud_sampled_modes
