!> Unstructured grids for ParaView and VTK: VTU files with data in base 64.
module thud_vtu
   use, intrinsic :: iso_c_binding, only: c_int64_t, c_int8_t
   use thud_kinds, only: wp
   use thud_text, only: newline, to_text
   implicit none (type, external)
   private

   public :: biquadratic_quadrilateral, get_vtu

   !> VTK's number of the cell type with nine nodes.
   integer, parameter :: biquadratic_quadrilateral = 28

contains

   !> A grid with vectors at its points; r and z become x and y.
   subroutine get_vtu(point, cell, cell_type, vector_name, vector, text)
      !> Positions r and z of the points, m: [2, n_point].
      real(wp), intent(in) :: point(:, :)
      !> Points of each cell, from 1: [n_corner, n_cell].
      integer, intent(in) :: cell(:, :)
      integer, intent(in) :: cell_type
      !> Names of the vectors: [n_vector].
      character(len=*), intent(in) :: vector_name(:)
      !> Components r and z of the vectors: [2, n_point, n_vector].
      real(wp), intent(in) :: vector(:, :, :)
      character(len=:), allocatable, intent(out) :: text
      integer :: i, n_cell

      n_cell = size(cell, 2)
      text = '<?xml version="1.0"?>'//newline &
         //'<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64">'//newline &
         //'<UnstructuredGrid><Piece NumberOfPoints="'//to_text(size(point, 2))//'" NumberOfCells="'//to_text(n_cell)//'">' &
         //newline//'<Points>'//newline
      call add_array('Points', 'Float64', 3, get_bytes(in_space(point)), text)
      text = text//'</Points>'//newline//'<Cells>'//newline
      call add_array('connectivity', 'Int64', 1, transfer(int(cell - 1, c_int64_t), [0_c_int8_t]), text)
      call add_array('offsets', 'Int64', 1, transfer(int([(i*size(cell, 1), i=1, n_cell)], c_int64_t), [0_c_int8_t]), text)
      call add_array('types', 'UInt8', 1, [(int(cell_type, c_int8_t), i=1, n_cell)], text)
      text = text//'</Cells>'//newline//'<PointData>'//newline
      do i = 1, size(vector_name)
         call add_array(trim(vector_name(i)), 'Float64', 3, get_bytes(in_space(vector(:, :, i))), text)
      end do
      text = text//'</PointData>'//newline//'</Piece></UnstructuredGrid>'//newline//'</VTKFile>'//newline
   end subroutine get_vtu

   !> Adds an array.
   subroutine add_array(name, type, n_component, bytes, text)
      character(len=*), intent(in) :: name, type
      !> Count of the numbers at each point or cell.
      integer, intent(in) :: n_component
      !> Bytes of the numbers: [n_byte].
      integer(c_int8_t), intent(in) :: bytes(:)
      character(len=:), allocatable, intent(inout) :: text

      ! The number of bytes precedes the data.
      text = text//'<DataArray type="'//type//'" Name="'//name//'" NumberOfComponents="'//to_text(n_component) &
         //'" format="binary">'//encode([transfer(size(bytes, kind=c_int64_t), [0_c_int8_t]), bytes]) &
         //'</DataArray>'//newline
   end subroutine add_array

   !> Bytes in base 64 (RFC 4648).
   pure function encode(bytes) result(text)
      !> The bytes: [n].
      integer(c_int8_t), intent(in) :: bytes(:)
      !> Four characters for every three bytes, the last group padded.
      character(len=4*((size(bytes) + 2)/3)) :: text
      character(len=*), parameter :: letters = 'ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/'
      integer :: group, i, k, n, digit

      n = size(bytes)
      do i = 1, n, 3
         group = 0
         do k = i, i + 2
            group = 256*group
            if (k <= n) group = group + modulo(int(bytes(k)), 256)
         end do
         do k = 0, 3
            digit = mod(group/64**(3 - k), 64) + 1
            text(4*((i - 1)/3) + k + 1:4*((i - 1)/3) + k + 1) = letters(digit:digit)
         end do
      end do
      if (mod(n, 3) > 0) text(len(text) - 2 + mod(n, 3):) = repeat('=', 3 - mod(n, 3))
   end function encode

   !> Numbers as bytes: [8*n].
   pure function get_bytes(numbers) result(bytes)
      !> The numbers: [n].
      real(wp), intent(in) :: numbers(:)
      integer(c_int8_t) :: bytes(8*size(numbers))

      bytes = transfer(numbers, bytes)
   end function get_bytes

   !> Vectors of the plane as vectors in space.
   pure function in_space(plane) result(space)
      !> Components r and z: [2, n].
      real(wp), intent(in) :: plane(:, :)
      !> Components r, z and 0, one vector after the other: [3*n].
      real(wp) :: space(3*size(plane, 2))

      space = 0.0_wp
      space(1::3) = plane(1, :)
      space(2::3) = plane(2, :)
   end function in_space

end module thud_vtu
