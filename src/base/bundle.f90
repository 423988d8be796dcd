!> Results by name: texts, numbers and arrays of any count, self-describing for callers.
module thud_bundle
   use, intrinsic :: iso_c_binding, only: c_f_pointer, c_intptr_t, c_loc, c_null_ptr, c_ptr
   use thud_error, only: error_type
   use thud_kinds, only: int64, wp
   use thud_text, only: newline, tab, to_text
   implicit none (type, external)
   private

   public :: bundle_type, retrieve, store

   !> Numbers of one item, in `values` or in `cube`.
   type :: item_type
      !> The numbers, in Fortran's order: [n].
      real(wp), allocatable :: values(:)
      !> A large array that was moved here: [:, :, :].
      real(wp), allocatable :: cube(:, :, :)
   end type item_type

   !> Texts and arrays, each with its name.
   type :: bundle_type
      private
      !> A line for each: name, tab, then the extents of an array with commas between (none for a single number), or
      !> `t` and the length of a text.
      character(len=:), allocatable, public :: header
      !> All texts, one after the other.
      character(len=:), allocatable, public :: text
      !> All arrays, the first `n_item` hold.
      type(item_type), allocatable :: items(:)
      !> Number of arrays.
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

      call add_line(self, name, '')
      call new_item(self)
      self%items(self%n_item)%values = [value]
   end subroutine add_number

   !> Adds an array of any rank.
   subroutine add_array(self, name, extents, values)
      class(bundle_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      !> Its extents: [rank].
      integer, intent(in) :: extents(:)
      real(wp), intent(in) :: values(*)

      call add_line(self, name, get_form(extents))
      call new_item(self)
      self%items(self%n_item)%values = values(:product(extents))
   end subroutine add_array

   !> Adds an array of rank 3 without a copy of it.
   subroutine move_array(self, name, values)
      class(bundle_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      !> The array, not allocated afterwards: [:, :, :].
      real(wp), allocatable, intent(inout) :: values(:, :, :)

      call add_line(self, name, get_form(shape(values)))
      call new_item(self)
      call move_alloc(values, self%items(self%n_item)%cube)
   end subroutine move_array

   !> Extents as the header has them.
   pure function get_form(extents) result(form)
      !> Extents of an array: [rank].
      integer, intent(in) :: extents(:)
      !> The extents with commas between.
      character(len=:), allocatable :: form
      integer :: i

      form = ''
      do i = 1, size(extents)
         form = form//to_text(extents(i))//','
      end do
   end function get_form

   !> Adds a line to the header.
   subroutine add_line(self, name, form)
      type(bundle_type), intent(inout) :: self
      !> Name of the item; its form.
      character(len=*), intent(in) :: name, form

      if (.not. allocated(self%header)) self%header = ''
      self%header = self%header//trim(name)//tab//form//newline
   end subroutine add_line

   !> Adds an empty item.
   subroutine new_item(self)
      type(bundle_type), intent(inout) :: self
      type(item_type), allocatable :: more(:)
      integer :: i

      if (.not. allocated(self%items)) allocate (self%items(4))
      if (self%n_item == size(self%items)) then
         allocate (more(2*self%n_item))
         do i = 1, self%n_item
            call move_alloc(self%items(i)%values, more(i)%values)
            call move_alloc(self%items(i)%cube, more(i)%cube)
         end do
         call move_alloc(more, self%items)
      end if
      self%n_item = self%n_item + 1
   end subroutine new_item

   !> Number of all numbers.
   pure function count_values(self) result(n)
      class(bundle_type), intent(in) :: self
      !> Their number.
      integer :: n
      integer :: i

      n = 0
      do i = 1, self%n_item
         associate (item => self%items(i))
            if (allocated(item%cube)) then
               n = n + size(item%cube)
            else
               n = n + size(item%values)
            end if
         end associate
      end do
   end function count_values

   !> All numbers in the order of the header.
   subroutine copy_values(self, values)
      class(bundle_type), intent(in) :: self
      !> The numbers: [count_values].
      real(wp), intent(out) :: values(:)
      integer :: i, at

      at = 0
      do i = 1, self%n_item
         associate (item => self%items(i))
            if (allocated(item%cube)) then
               call append(size(item%cube), item%cube)
            else
               call append(size(item%values), item%values)
            end if
         end associate
      end do

   contains

      !> Appends the numbers of one item.
      subroutine append(n, item)
         !> Their number.
         integer, intent(in) :: n
         real(wp), intent(in) :: item(n)

         values(at + 1:at + n) = item
         at = at + n
      end subroutine append

   end subroutine copy_values

   !> Stores a bundle to be collected, or the message of an error alone.
   subroutine store(bundle, error, status, handle, n_byte, n_value)
      type(bundle_type), pointer, intent(inout) :: bundle
      !> An error whose message replaces the bundle.
      type(error_type), allocatable, intent(in) :: error
      !> Code of the error, or 0.
      integer, intent(out) :: status
      integer(int64), intent(out) :: handle
      !> Size of its header and its texts.
      integer, intent(out) :: n_byte
      !> Number of its numbers, at least 1: f2py has no empty arrays.
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

   !> The bundle of a handle; the caller frees it.
   subroutine retrieve(handle, bundle)
      !> Handle of a stored bundle that was not retrieved before.
      integer(int64), intent(in) :: handle
      type(bundle_type), pointer, intent(out) :: bundle
      type(c_ptr) :: address

      address = transfer(int(handle, c_intptr_t), c_null_ptr)
      call c_f_pointer(address, bundle)
   end subroutine retrieve

end module thud_bundle
