!> Modes of a floor from a file: measured ones, or those of another program.
!>
!> The file is a table, see `thud_table_reader`, with one column per mode after two further columns.
!> Rows that begin with `frequency` (Hz), `loss_factor` and, if the shapes are not normalized to a modal mass of 1 kg,
!> `modal_mass` (kg) describe the modes. All other rows are points: x, y (m) and the shapes of the modes there, the motion
!> normal to the floor. A row that begins with `x` is a header.
module thud_mode_table
   use thud_error, only: error_type, input_error
   use thud_function_set, only: min_nodes
   use thud_kinds, only: wp
   use thud_table_reader, only: cell_length, open_table, read_number, read_row, row_error, table_reader_type
   use thud_text, only: fixed, lower_case, quoted, to_text
   implicit none (type, external)
   private

   public :: mode_table_type, read_mode_table

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

   !> Modes on a grid.
   type :: mode_table_type
      !> Coordinates of the grid along length and width, ascending from 0 to the sides of the floor, m: [n_x], [n_y].
      real(wp), allocatable :: x(:), y(:)
      !> Natural frequencies, Hz, and loss factors: [n_mode].
      real(wp), allocatable :: frequency(:), loss_factor(:)
      !> Shapes for a modal mass of 1 kg, 1/sqrt(kg): [n_x, n_y, n_mode].
      real(wp), allocatable :: shape(:, :, :)
   end type mode_table_type

   !> Rows of a file.
   type :: rows_type
      !> Values that describe the modes; not allocated without such a row: [n_mode].
      real(wp), allocatable :: frequency(:), loss_factor(:), modal_mass(:)
      !> Points, with coordinates and shapes; the first `n_point` are used: [2 + n_mode, at least n_point].
      real(wp), allocatable :: point(:, :)
      integer :: n_point = 0
   end type rows_type

contains

   !> Modes in a file.
   subroutine read_mode_table(path, table, error)
      character(len=*), intent(in) :: path
      type(mode_table_type), intent(out) :: table
      !> Set if the modes are not complete.
      type(error_type), allocatable, intent(out) :: error
      type(rows_type) :: rows

      call read_rows(path, rows, error)
      if (.not. allocated(error)) call find_grid(rows, table, error)
      if (.not. allocated(error)) call check_shapes(table, error)
   end subroutine read_mode_table

   !> Reads all rows of a file.
   subroutine read_rows(path, rows, error)
      character(len=*), intent(in) :: path
      type(rows_type), intent(out) :: rows
      !> Set if a row is not one of a table, or one is missing.
      type(error_type), allocatable, intent(out) :: error
      type(table_reader_type) :: table
      character(len=cell_length), allocatable :: cells(:)
      real(wp), allocatable :: value(:), more(:, :)
      character(len=label_length) :: label

      call open_table(path, table, error)
      do
         if (.not. allocated(error)) call read_row(table, cells, error)
         if (.not. allocated(error)) then
            if (size(cells) == 0) exit
            call read_values(table, cells, label, value, error)
         end if
         if (allocated(error)) return
         select case (label)
          case ('frequency')
            call set_row(rows%frequency, 1)
          case ('loss_factor')
            call set_row(rows%loss_factor, 2)
          case ('modal_mass')
            call set_row(rows%modal_mass, 3)
          case ('point')
            if (rows%n_point == 0) allocate (rows%point(size(value), 64))
            if (size(value) /= size(rows%point, 1)) then
               error = row_error(table, 'it has '//to_text(size(value))//' values, points before it have ' &
                  //to_text(size(rows%point, 1))//'; allowed: x, y and the shape of each mode')
               return
            end if
            rows%n_point = rows%n_point + 1
            if (rows%n_point > size(rows%point, 2)) then
               allocate (more(size(value), 2*rows%n_point))
               more(:, :rows%n_point - 1) = rows%point
               call move_alloc(more, rows%point)
            end if
            rows%point(:, rows%n_point) = value
          case default
            cycle
         end select
         if (allocated(error)) return
      end do
      if (.not. allocated(rows%frequency)) then
         error = input_error('there is no row of frequencies; allowed: a table with rows '//labels(1)//' (Hz) and ' &
            //labels(2)//', and a row of x, y and the shapes of all modes for each point')
      else if (.not. allocated(rows%loss_factor)) then
         error = input_error('the modes have no losses; allowed: a row '//labels(2)//' with one value above 0 per mode')
      else if (rows%n_point == 0) then
         error = input_error('there is no point; allowed: a row of x, y (m) and the shapes of all modes for each point')
      end if
      if (allocated(error)) return
      associate (n => size(rows%point, 1) - 2)
         if (.not. allocated(rows%modal_mass)) allocate (rows%modal_mass(n), source=1.0_wp)
         if (n < 1 .or. any([size(rows%frequency), size(rows%loss_factor), size(rows%modal_mass)] /= n)) then
            error = input_error('there are '//to_text(size(rows%frequency))//' frequencies, ' &
               //to_text(size(rows%loss_factor))//' loss factors, '//to_text(size(rows%modal_mass))//' modal masses and ' &
               //to_text(n)//' shapes; allowed: one of each per mode')
         end if
      end associate
   contains

      !> Sets a row that describes the modes.
      subroutine set_row(target_row, number)
         real(wp), allocatable, intent(inout) :: target_row(:)
         !> Its number in `labels`.
         integer, intent(in) :: number
         integer :: i

         if (allocated(target_row)) then
            error = row_error(table, trim(labels(number))//' is given twice; allowed: once')
            return
         end if
         i = findloc(value > 0.0_wp .and. value <= highest_value(number), .false., dim=1)
         if (i > 0) then
            error = row_error(table, trim(labels(number))//' of mode '//to_text(i)//' is ' &
               //to_text(value(i))//'; allowed: above 0, up to '//to_text(highest_value(number)))
            return
         end if
         target_row = value
      end subroutine set_row
   end subroutine read_rows

   !> Reads one row.
   subroutine read_values(table, cells, label, value, error)
      type(table_reader_type), intent(in) :: table
      !> The cells: [n_cell].
      character(len=cell_length), intent(in) :: cells(:)
      !> One of `labels`, `point`, or blank for a header.
      character(len=label_length), intent(out) :: label
      !> Its values; of a point with coordinates.
      real(wp), allocatable, intent(out) :: value(:)
      !> Set if a cell is neither a number nor a label.
      type(error_type), allocatable, intent(out) :: error
      logical :: valid
      integer :: i, first

      label = ''
      if (index(lower_case(cells(1)), 'x') == 1) return
      label = 'point'
      if (any(labels == lower_case(cells(1)))) label = lower_case(cells(1)(:label_length))
      ! Between the label and the values there is a cell for the unit.
      first = merge(1, 3, label == 'point')
      allocate (value(max(size(cells) - first + 1, 0)))
      do i = 1, size(value)
         call read_number(cells(first + i - 1), value(i), valid)
         if (valid) cycle
         error = row_error(table, quoted(trim(cells(first + i - 1)))//' in column '//to_text(first + i - 1)//' is not a ' &
            //'number; allowed: finite numbers, and in the first column also frequency, loss_factor, modal_mass or x')
         return
      end do
   end subroutine read_values

   !> Puts the points on their grid.
   subroutine find_grid(rows, table, error)
      type(rows_type), intent(in) :: rows
      type(mode_table_type), intent(out) :: table
      !> Set if the points are not a rectangular grid over the floor.
      type(error_type), allocatable, intent(out) :: error
      logical, allocatable :: is_set(:, :)
      integer :: i, j, k, n_mode

      n_mode = size(rows%frequency)
      associate (point => rows%point(:, :rows%n_point))
         call get_coordinates(point(1, :), 'x', table%x, error)
         if (.not. allocated(error)) call get_coordinates(point(2, :), 'y', table%y, error)
         if (allocated(error)) return
         associate (n_x => size(table%x), n_y => size(table%y))
            if (rows%n_point > max_points) then
               error = input_error('the grid has '//to_text(rows%n_point)//' points; allowed: up to '//to_text(max_points) &
                  //', of which eight per wavelength are enough')
               return
            end if
            if (n_x*n_y /= rows%n_point) then
               error = input_error('the points are no rectangular grid: there are '//to_text(rows%n_point)//' with ' &
                  //to_text(n_x)//' values of x and '//to_text(n_y)//' of y; allowed: one point for each pair of x and y')
               return
            end if
            allocate (table%shape(n_x, n_y, n_mode), is_set(n_x, n_y))
         end associate
         is_set = .false.
         do k = 1, rows%n_point
            i = minloc(abs(table%x - point(1, k)), dim=1)
            j = minloc(abs(table%y - point(2, k)), dim=1)
            if (is_set(i, j)) then
               error = input_error('the points are no rectangular grid: two are at x = '//to_text(point(1, k))//' m, y = ' &
                  //to_text(point(2, k))//' m; allowed: one point for each pair of x and y')
               return
            end if
            is_set(i, j) = .true.
            table%shape(i, j, :) = point(3:, k)/sqrt(rows%modal_mass)
         end do
      end associate
      table%frequency = rows%frequency
      table%loss_factor = rows%loss_factor
   end subroutine find_grid

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
   subroutine check_shapes(table, error)
      type(mode_table_type), intent(in) :: table
      !> Set if a mode does not move, or a grid spacing is more than a quarter of its wavelength.
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: roughness(2)
      real(wp) :: total
      integer :: k

      associate (n_x => size(table%x), n_y => size(table%y))
         do k = 1, size(table%frequency)
            associate (shape => table%shape(:, :, k))
               total = sum(shape**2)
               if (.not. total > 0.0_wp) then
                  error = input_error('mode '//to_text(k)//' is 0 at all points; allowed: modes that move')
                  return
               end if
               roughness = [sum((shape(2:, :) - shape(:n_x - 1, :))**2), sum((shape(:, 2:) - shape(:, :n_y - 1))**2)]/total
            end associate
            if (maxval(roughness) <= max_roughness) cycle
            error = input_error('the grid is too coarse for mode '//to_text(k)//' at '//fixed(table%frequency(k), 1) &
               //' Hz: along '//merge('x', 'y', roughness(1) > roughness(2))//' its wavelength is less than four grid ' &
               //'spacings; allowed: more points, or fewer modes')
            return
         end do
      end associate
   end subroutine check_shapes

end module thud_mode_table
