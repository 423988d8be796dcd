!> A text that grows piece by piece. `text = text//piece` would copy the whole text for each piece; this buffer copies it
!> only when its length has doubled.
module thud_text_buffer
   implicit none (type, external)
   private

   public :: text_buffer_type

   !> The text so far, empty at first.
   type :: text_buffer_type
      private
      !> The text, followed by unused space.
      character(len=:), allocatable :: space
      !> Length of the text.
      integer :: length = 0
   contains
      procedure :: append
      procedure :: get_text
   end type text_buffer_type

contains

   !> Adds a piece at the end.
   pure subroutine append(self, piece)
      class(text_buffer_type), intent(inout) :: self
      character(len=*), intent(in) :: piece
      character(len=:), allocatable :: larger

      if (.not. allocated(self%space)) allocate (character(len=1024) :: self%space)
      if (self%length + len(piece) > len(self%space)) then
         allocate (character(len=2*(self%length + len(piece))) :: larger)
         larger(:self%length) = self%space(:self%length)
         call move_alloc(larger, self%space)
      end if
      self%space(self%length + 1:self%length + len(piece)) = piece
      self%length = self%length + len(piece)
   end subroutine append

   !> The text.
   pure function get_text(self) result(text)
      class(text_buffer_type), intent(in) :: self
      character(len=self%length) :: text

      if (self%length > 0) text = self%space(:self%length)
   end function get_text

end module thud_text_buffer
