!> Modes of a floor from samples on a grid in a file: splines through the samples.
module thud_sampled_modes
   use, intrinsic :: iso_fortran_env, only: int64
   use thud_ascending, only: get_ascending_order
   use thud_constants, only: pi
   use thud_error, only: error_type, input_error
   use thud_floor_modes, only: floor_modes_type
   use thud_function_set, only: function_set_type, new_splines
   use thud_kinds, only: wp
   use thud_mode_table, only: mode_table_type, read_mode_table
   use thud_modes, only: product_type
   use thud_plate_stack, only: orthotropic_type
   use thud_system, only: get_file_size
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: get_square_integrals, read_sampled_modes

   !> Maximum size of a file, bytes.
   integer(int64), parameter :: max_size = 200000000_int64

contains

   !> Modes of a floor from a file; see `thud_mode_table`.
   subroutine read_sampled_modes(path, modes, error)
      character(len=*), intent(in) :: path
      type(floor_modes_type), intent(out) :: modes
      !> Set if the file cannot be read, or its modes are not complete; the message begins with the path.
      type(error_type), allocatable, intent(out) :: error
      type(mode_table_type) :: table
      integer(int64) :: bytes

      ! Pipes and devices have no size; opening one could block.
      call get_file_size(path, bytes)
      if (bytes < 1 .or. bytes > max_size) then
         error = input_error('there is no such file, or it is empty, a directory, not regular or too large; allowed: a ' &
            //'table of modes of up to '//to_text(int(max_size))//' bytes')
      else
         call read_mode_table(path, table, error)
      end if
      if (allocated(error)) then
         error = input_error(path//': '//error%message)
      else
         call get_sampled_modes(table, modes)
      end if
   end subroutine read_sampled_modes

   !> Modes of a floor from a table.
   subroutine get_sampled_modes(table, modes)
      type(mode_table_type), intent(in) :: table
      type(floor_modes_type), intent(out) :: modes
      type(function_set_type) :: set_x, set_y
      real(wp), allocatable :: by_x(:, :), by_y(:, :)
      integer, allocatable :: order(:)
      integer :: i, n_x, n_y, n_mode

      n_x = size(table%x)
      n_y = size(table%y)
      n_mode = size(table%frequency)
      call new_splines(table%x, set_x, by_x)
      call new_splines(table%y, set_y, by_y)
      modes%stack%length = table%x(n_x)
      modes%stack%width = table%y(n_y)
      allocate (modes%stack%plate(1), modes%stack%layer(0))
      modes%stack%plate(1) = orthotropic_type()
      order = get_ascending_order(table%frequency)
      modes%omega = 2*pi*table%frequency(order)
      modes%loss_factor = table%loss_factor(order)
      ! There is no mode above the highest one.
      modes%limit = maxval(modes%omega)*(1 + epsilon(1.0_wp))
      modes%sum_limit = modes%limit
      modes%known_limit = modes%limit
      allocate (modes%modes%displacement(1), modes%modes%block(1))
      modes%modes%displacement(1) = product_type(set_x, set_y)
      associate (block => modes%modes%block(1))
         block%omega = modes%omega
         block%loss_factor = modes%loss_factor
         allocate (block%bearing_share(n_mode), source=1.0_wp)
         allocate (block%shape(1))
         associate (shape => block%shape(1))
            shape%x = [(i, i=1, n_x)]
            shape%y = [(i, i=1, n_y)]
            allocate (shape%coefficient(n_x*n_y, n_mode))
            do i = 1, n_mode
               shape%coefficient(:, i) = reshape(matmul(matmul(by_x, table%shape(:, :, order(i))), transpose(by_y)), &
                  [n_x*n_y])
            end do
         end associate
      end associate
   end subroutine get_sampled_modes

   !> Integrals of the squared shapes over the floor for a modal mass of 1 kg, m2/kg: [n_mode].
   pure function get_square_integrals(modes) result(square)
      type(floor_modes_type), intent(in) :: modes
      real(wp), allocatable :: square(:)

      square = sum(modes%modes%block(1)%shape(1)%coefficient**2, dim=1)
   end function get_square_integrals

end module thud_sampled_modes
