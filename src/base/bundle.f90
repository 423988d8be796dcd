!> Named results: any number of texts, numbers and arrays, described by a header for callers.
module thud_bundle
   use, intrinsic :: iso_c_binding, only: c_f_pointer, c_intptr_t, c_loc, c_null_ptr, c_ptr
   use thud_error, only: error_type
   use thud_kinds, only: int64, wp
   use thud_text, only: newline, tab, to_text
   implicit none (type, external)
   private

   public :: bundle_type, retrieve, store

   !> A number or an array.
   type :: item_type
      !> The numbers, in Fortran's array order: [:, :, :].
      real(wp), allocatable :: values(:, :, :)
   end type item_type

   !> Texts and arrays, each with its name.
   type :: bundle_type
      private
      !> One line per text, number or array: name, tab and form. The form is `t` and the length for a text, the extents, each
      !> followed by a comma, for an array, and empty for a number.
      character(len=:), allocatable, public :: header
      !> All texts, concatenated.
      character(len=:), allocatable, public :: text
      !> Numbers and arrays; the first `n_item` are used.
      type(item_type), allocatable :: items(:)
      !> Number of numbers and arrays.
      integer :: n_item = 0
   contains
      procedure :: add_text
      procedure :: add_number
      procedure :: add_array
      procedure :: move_array
      procedure :: count_values
      procedure :: copy_values
   end type bundle_type

contains

   !> Adds a text.
   subroutine add_text(self, name, text)
      class(bundle_type), intent(inout) :: self
      character(len=*), intent(in) :: name, text

      call add_line(self, name, 't'//to_text(len(text)))
      if (.not. allocated(self%text)) self%text = ''
      self%text = self%text//text
   end subroutine add_text

   !> Adds a number.
   subroutine add_number(self, name, value)
      class(bundle_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      real(wp), intent(in) :: value
      integer :: extents(0)

      call self%add_array(name, extents, [value])
   end subroutine add_number

   !> Adds an array of any rank.
   subroutine add_array(self, name, extents, values)
      class(bundle_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      !> Extents of the array: [rank].
      integer, intent(in) :: extents(:)
      real(wp), intent(in) :: values(*)

      call new_item(self, name, extents)
      self%items(self%n_item)%values = reshape(values(:product(extents)), [product(extents), 1, 1])
   end subroutine add_array

   !> Adds an array of rank 3 without copying it.
   subroutine move_array(self, name, values)
      class(bundle_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      !> The array, unallocated afterwards: [:, :, :].
      real(wp), allocatable, intent(inout) :: values(:, :, :)

      call new_item(self, name, shape(values))
      call move_alloc(values, self%items(self%n_item)%values)
   end subroutine move_array

   !> Adds a line to the header.
   subroutine add_line(self, name, form)
      type(bundle_type), intent(inout) :: self
      !> Name and form, as in the header.
      character(len=*), intent(in) :: name, form

      if (.not. allocated(self%header)) self%header = ''
      self%header = self%header//trim(name)//tab//trim(form)//newline
   end subroutine add_line

   !> Adds an item without values.
   subroutine new_item(self, name, extents)
      type(bundle_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      !> Extents of its array: [rank].
      integer, intent(in) :: extents(:)
      type(item_type), allocatable :: more(:)
      character(len=12*size(extents)) :: form
      integer :: i

      write (form, '(*(i0,","))') extents
      call add_line(self, name, form)
      if (.not. allocated(self%items)) allocate (self%items(4))
      if (self%n_item == size(self%items)) then
         allocate (more(2*self%n_item))
         do i = 1, self%n_item
            call move_alloc(self%items(i)%values, more(i)%values)
         end do
         call move_alloc(more, self%items)
      end if
      self%n_item = self%n_item + 1
   end subroutine new_item

   !> Count of the numbers in all items.
   pure function count_values(self) result(n)
      class(bundle_type), intent(in) :: self
      integer :: n
      integer :: i

      n = sum([(size(self%items(i)%values), i=1, self%n_item)])
   end function count_values

   !> Copies the numbers of all items, in the order of the header.
   subroutine copy_values(self, values)
      class(bundle_type), intent(in) :: self
      !> The numbers: [count_values].
      real(wp), intent(out) :: values(:)
      integer :: i, at

      at = 0
      do i = 1, self%n_item
         call append(size(self%items(i)%values), self%items(i)%values)
      end do

   contains

      !> Appends the numbers of one item.
      subroutine append(n, item)
         !> Count of the numbers.
         integer, intent(in) :: n
         real(wp), intent(in) :: item(n)

         values(at + 1:at + n) = item
         at = at + n
      end subroutine append

   end subroutine copy_values

   !> Stores a bundle for its caller to collect; after an error it holds only the message.
   subroutine store(bundle, error, status, handle, n_byte, n_value)
      type(bundle_type), pointer, intent(inout) :: bundle
      !> Error of the computation, if any.
      type(error_type), allocatable, intent(in) :: error
      !> Code of the error, or 0.
      integer, intent(out) :: status
      integer(int64), intent(out) :: handle
      !> Bytes of header, zero and texts.
      integer, intent(out) :: n_byte
      !> Count of the numbers, at least 1: f2py has no empty arrays.
      integer, intent(out) :: n_value

      status = 0
      if (allocated(error)) then
         deallocate (bundle)
         allocate (bundle)
         status = error%code
         call bundle%add_text('message', error%message)
      end if
      if (.not. allocated(bundle%header)) bundle%header = ''
      if (.not. allocated(bundle%text)) bundle%text = ''
      handle = transfer(c_loc(bundle), handle)
      n_byte = len(bundle%header) + 1 + len(bundle%text)
      n_value = max(1, bundle%count_values())
   end subroutine store

   !> The bundle of a handle; the caller deallocates it.
   subroutine retrieve(handle, bundle)
      !> Handle of a bundle, from `store`; valid once.
      integer(int64), intent(in) :: handle
      type(bundle_type), pointer, intent(out) :: bundle
      type(c_ptr) :: address

      address = transfer(int(handle, c_intptr_t), c_null_ptr)
      call c_f_pointer(address, bundle)
   end subroutine retrieve

end module thud_bundle
