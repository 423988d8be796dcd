!> Results as a list of records: texts, numbers and arrays, each with a name. Files and callers in other languages get
!> results from this list, which is made once (`thud_records`).
module thud_bundle
   use, intrinsic :: iso_c_binding, only: c_f_pointer, c_intptr_t, c_loc, c_null_ptr
   use thud_error, only: error_type
   use thud_kinds, only: int64, wp
   use thud_text, only: newline, tab, to_text
   implicit none (type, external)
   private

   public :: bundle_type, record_type, retrieve, store

   !> A text, a number or an array.
   type :: record_type
      !> Group, empty if the record has none, and name.
      character(len=32) :: group = '', name = ''
      !> `text`, `real`, `whole` for integers, or `flag` for 0 and 1, which mean false and true.
      character(len=5) :: kind = 'real'
      !> SI unit or remark.
      character(len=40) :: unit = ''
      !> The text, perhaps of several lines.
      character(len=:), allocatable :: text
      !> The numbers, in Fortran's array order; none of a text: [:, :, :].
      real(wp), allocatable :: values(:, :, :)
   end type record_type

   !> Records, each with its name.
   type :: bundle_type
      !> One line per record: group with a point, name, tab and form. The form is `t` and the length for a text, the extents,
      !> each followed by a comma, for an array, and empty for a number.
      character(len=:), allocatable :: header
      !> All texts, concatenated.
      character(len=:), allocatable :: text
      !> The records; the first `n_record` are used.
      type(record_type), allocatable :: records(:)
      !> Number of records.
      integer :: n_record = 0
      !> Group of the records to add.
      character(len=32) :: group = ''
   contains
      procedure :: add_text
      procedure :: add_texts
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

      call add_record(self, name, [len(text)], text)
   end subroutine add_text

   !> Adds a list of texts, as the lines of a text.
   subroutine add_texts(self, name, texts)
      class(bundle_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      !> The texts, whose trailing blanks are dropped: [n_text].
      character(len=*), intent(in) :: texts(:)
      character(len=:), allocatable :: lines
      integer :: i

      lines = ''
      do i = 1, size(texts)
         lines = lines//newline//trim(texts(i))
      end do
      call self%add_text(name, lines(2:))
   end subroutine add_texts

   !> Adds a number.
   subroutine add_number(self, name, value, unit, kind)
      class(bundle_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      real(wp), intent(in) :: value
      !> See `record_type` (default: no unit, `real`).
      character(len=*), intent(in), optional :: unit, kind
      integer :: extents(0)

      call self%add_array(name, extents, [value], unit, kind)
   end subroutine add_number

   !> Adds an array of any rank.
   subroutine add_array(self, name, extents, values, unit, kind)
      class(bundle_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      !> Extents of the array: [rank].
      integer, intent(in) :: extents(:)
      real(wp), intent(in) :: values(*)
      !> See `record_type` (default: no unit, `real`).
      character(len=*), intent(in), optional :: unit, kind

      call add_record(self, name, extents)
      associate (record => self%records(self%n_record))
         record%values = reshape(values(:product(extents)), [product(extents), 1, 1])
         if (present(unit)) record%unit = unit
         if (present(kind)) record%kind = kind
      end associate
   end subroutine add_array

   !> Adds an array of rank 3 without copying it.
   subroutine move_array(self, name, values)
      class(bundle_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      !> The array, unallocated afterwards: [:, :, :].
      real(wp), allocatable, intent(inout) :: values(:, :, :)

      call add_record(self, name, shape(values))
      call move_alloc(values, self%records(self%n_record)%values)
   end subroutine move_array

   !> Adds a record without numbers, and its line of the header.
   subroutine add_record(self, name, extents, text)
      class(bundle_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      !> Extents of the array: [rank].
      integer, intent(in) :: extents(:)
      !> The text, if it is one.
      character(len=*), intent(in), optional :: text
      character(len=12*size(extents)) :: form
      type(record_type), allocatable :: more(:)

      if (.not. allocated(self%records)) then
         ! More than the results of a case, of which a copy could need much memory.
         allocate (self%records(512))
         self%header = ''
         self%text = ''
      else if (self%n_record == size(self%records)) then
         allocate (more(2*self%n_record))
         more(:self%n_record) = self%records
         call move_alloc(more, self%records)
      end if
      self%n_record = self%n_record + 1
      write (form, '(*(i0,","))') extents
      associate (record => self%records(self%n_record))
         record%group = self%group
         record%name = name
         if (present(text)) then
            record%kind = 'text'
            record%text = text
            allocate (record%values(0, 1, 1))
            self%text = self%text//text
            form = 't'//to_text(len(text))
         end if
      end associate
      if (self%group /= '') self%header = self%header//trim(self%group)//'.'
      self%header = self%header//trim(name)//tab//trim(form)//newline
   end subroutine add_record

   !> Count of the numbers in all records.
   pure function count_values(self) result(n)
      class(bundle_type), intent(in) :: self
      integer :: n
      integer :: i

      n = sum([(size(self%records(i)%values), i=1, self%n_record)])
   end function count_values

   !> Copies the numbers of all records, in the order of the header.
   subroutine copy_values(self, values)
      class(bundle_type), intent(in), target :: self
      !> The numbers: [count_values].
      real(wp), intent(out) :: values(:)
      real(wp), pointer :: numbers(:)
      integer :: i, at

      at = 0
      do i = 1, self%n_record
         numbers(1:size(self%records(i)%values)) => self%records(i)%values
         values(at + 1:at + size(numbers)) = numbers
         at = at + size(numbers)
      end do
   end subroutine copy_values

   !> Stores a bundle for its caller to collect; after an error it holds the `message`, `group`, `key` and `problem` if it is
   !> about one, and the `range` that a value is outside of: value, ends, and 1 for each end that is excluded.
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
         if (allocated(error%group)) then
            call bundle%add_text('group', error%group)
            call bundle%add_text('key', error%key)
            call bundle%add_text('problem', error%problem)
         end if
         if (allocated(error%range)) call bundle%add_array('range', [5], [error%value, error%range%lower, &
            error%range%upper, merge(1.0_wp, 0.0_wp, [error%range%lower_open, error%range%upper_open])])
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

      call c_f_pointer(transfer(int(handle, c_intptr_t), c_null_ptr), bundle)
   end subroutine retrieve

end module thud_bundle
