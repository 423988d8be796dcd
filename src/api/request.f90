!> Requests of callers in other languages: named texts, numbers and arrays, the counterpart of `thud_bundle`.
module thud_request
   use thud_kinds, only: wp
   use thud_text, only: newline, tab
   implicit none (type, external)
   private

   public :: request_type

   !> Texts and arrays, each with its name.
   type :: request_type
      !> One line per item: its name, a tab, and, of its characters in `text` or its numbers in `values`, the index of the
      !> first and how many there are.
      character(len=:), allocatable :: header
      !> All texts, concatenated.
      character(len=:), allocatable :: text
      !> All numbers and arrays, concatenated; points to memory of the caller: [n_value].
      real(wp), pointer, contiguous :: values(:) => null()
   contains
      procedure :: has
      procedure :: get_text
      procedure :: get_number
      procedure :: get_array
   end type request_type

contains

   !> Whether the request has an item of a name.
   pure function has(self, name) result(exists)
      class(request_type), intent(in) :: self
      character(len=*), intent(in) :: name
      logical :: exists

      exists = index(newline//self%header, newline//name//tab) > 0
   end function has

   !> A text by its name; empty if there is none.
   pure subroutine get_text(self, name, text)
      class(request_type), intent(in) :: self
      character(len=*), intent(in) :: name
      character(len=:), allocatable, intent(out) :: text
      integer :: first, length

      call find(self, name, first, length)
      text = self%text(first:first + length - 1)
   end subroutine get_text

   !> A number by its name.
   pure function get_number(self, name, default) result(number)
      class(request_type), intent(in) :: self
      character(len=*), intent(in) :: name
      !> The number if there is none (default: 0).
      real(wp), intent(in), optional :: default
      real(wp) :: number
      integer :: first, length

      call find(self, name, first, length)
      number = 0.0_wp
      if (present(default)) number = default
      if (length > 0) number = self%values(first)
   end function get_number

   !> An array by its name; of size 0 if there is none.
   function get_array(self, name) result(values)
      class(request_type), intent(in) :: self
      character(len=*), intent(in) :: name
      !> The values, not copied: [n].
      real(wp), pointer, contiguous :: values(:)
      integer :: first, length

      call find(self, name, first, length)
      values => self%values(first:first + length - 1)
   end function get_array

   !> Finds an item in the texts or in the values.
   pure subroutine find(self, name, first, length)
      type(request_type), intent(in) :: self
      character(len=*), intent(in) :: name
      !> Index of its first character or value, and their number; `length` is 0 if there is no such item.
      integer, intent(out) :: first, length
      integer :: begin

      first = 1
      length = 0
      if (.not. self%has(name)) return
      begin = index(newline//self%header, newline//name//tab) + len(name//tab)
      read (self%header(begin:begin + index(self%header(begin:), newline) - 2), *) first, length
   end subroutine find

end module thud_request
