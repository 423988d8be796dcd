!> Grids at many times in one file for ParaView: a temporal collection in XDMF with its data as text (xdmf.org).
module thud_xdmf
   use thud_kinds, only: wp
   use thud_text, only: newline, to_text
   use thud_text_buffer, only: text_buffer_type
   implicit none (type, external)
   private

   public :: add_snapshot, begin_snapshots, end_snapshots

contains

   !> Begins a file.
   subroutine begin_snapshots(buffer)
      type(text_buffer_type), intent(inout) :: buffer

      call buffer%append('<?xml version="1.0"?>'//newline//'<Xdmf Version="3.0"><Domain>'//newline &
         //'<Grid Name="snapshots" GridType="Collection" CollectionType="Temporal">'//newline)
   end subroutine begin_snapshots

   !> Ends a file.
   subroutine end_snapshots(buffer)
      type(text_buffer_type), intent(inout) :: buffer

      call buffer%append('</Grid>'//newline//'</Domain></Xdmf>'//newline)
   end subroutine end_snapshots

   !> Adds a grid of quadrilaterals with vectors and scalars at its points; r and z become x and y.
   subroutine add_snapshot(buffer, time, point, cell, vector_name, vector, scalar_name, scalar)
      type(text_buffer_type), intent(inout) :: buffer
      !> Time of the grid, s.
      real(wp), intent(in) :: time
      !> Positions r and z of the points, m: [2, n_point].
      real(wp), intent(in) :: point(:, :)
      !> Points of each cell, from 1: [4, n_cell].
      integer, intent(in) :: cell(:, :)
      !> Names of the vectors: [n_vector].
      character(len=*), intent(in) :: vector_name(:)
      !> Components r and z of the vectors: [2, n_point, n_vector].
      real(wp), intent(in) :: vector(:, :, :)
      !> Names of the scalars: [n_scalar].
      character(len=*), intent(in) :: scalar_name(:)
      !> The scalars: [n_point, n_scalar].
      real(wp), intent(in) :: scalar(:, :)
      integer :: i

      call buffer%append('<Grid Name="ball"><Time Value="'//to_text(time)//'"/>'//newline//'<Topology ' &
         //'TopologyType="Quadrilateral" NumberOfElements="'//to_text(size(cell, 2))//'">'//newline &
         //'<DataItem Format="XML" NumberType="Int" Dimensions="'//to_text(size(cell, 2))//' 4">'//newline)
      do i = 1, size(cell, 2)
         call buffer%append(to_text(cell(1, i) - 1)//' '//to_text(cell(2, i) - 1)//' '//to_text(cell(3, i) - 1)//' ' &
            //to_text(cell(4, i) - 1)//newline)
      end do
      call buffer%append('</DataItem>'//newline//'</Topology>'//newline//'<Geometry GeometryType="XYZ">'//newline)
      call add_vectors(buffer, point)
      call buffer%append('</Geometry>'//newline)
      do i = 1, size(vector_name)
         call buffer%append('<Attribute Name="'//trim(vector_name(i))//'" AttributeType="Vector" Center="Node">'//newline)
         call add_vectors(buffer, vector(:, :, i))
         call buffer%append('</Attribute>'//newline)
      end do
      do i = 1, size(scalar_name)
         call buffer%append('<Attribute Name="'//trim(scalar_name(i))//'" AttributeType="Scalar" Center="Node">'//newline)
         call add_scalars(buffer, scalar(:, i))
         call buffer%append('</Attribute>'//newline)
      end do
      call buffer%append('</Grid>'//newline)
   end subroutine add_snapshot

   !> Adds vectors of the plane as vectors in space.
   subroutine add_vectors(buffer, vector)
      type(text_buffer_type), intent(inout) :: buffer
      !> Components r and z: [2, n].
      real(wp), intent(in) :: vector(:, :)
      integer :: i

      call buffer%append(get_head(to_text(size(vector, 2))//' 3'))
      do i = 1, size(vector, 2)
         call buffer%append(all_digits(vector(1, i))//' '//all_digits(vector(2, i))//' 0'//newline)
      end do
      call buffer%append('</DataItem>'//newline)
   end subroutine add_vectors

   !> Adds scalars.
   subroutine add_scalars(buffer, scalar)
      type(text_buffer_type), intent(inout) :: buffer
      !> The scalars: [n].
      real(wp), intent(in) :: scalar(:)
      integer :: i

      call buffer%append(get_head(to_text(size(scalar))))
      do i = 1, size(scalar)
         call buffer%append(all_digits(scalar(i))//newline)
      end do
      call buffer%append('</DataItem>'//newline)
   end subroutine add_scalars

   !> A number with 17 digits, which keep all its bits and are written faster than its shortest text.
   pure function all_digits(value) result(text)
      real(wp), intent(in) :: value
      character(len=:), allocatable :: text
      character(len=24) :: form

      text = '0'
      if (.not. abs(value) > 0.0_wp) return
      write (form, '(es24.16e3)') value
      text = trim(adjustl(form))
   end function all_digits

   !> The tag before the numbers of an array.
   pure function get_head(dimensions) result(head)
      !> Extents of the array, the fastest index last.
      character(len=*), intent(in) :: dimensions
      character(len=:), allocatable :: head

      head = '<DataItem Format="XML" NumberType="Float" Precision="8" Dimensions="'//dimensions//'">'//newline
   end function get_head

end module thud_xdmf
