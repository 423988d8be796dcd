!> Reads files and pipes of any size line by line. Fortran's `read` would load a whole line into memory, however long.
module thud_line_reader
   use thud_system, only: close_descriptor, open_descriptor, read_bytes
   use thud_text, only: byte_order_mark, newline
   implicit none (type, external)
   private

   public :: close_lines, line_length, line_reader_type, open_lines, read_line

   !> Maximum length of a line.
   integer, parameter :: line_length = 4096

   !> Number of bytes read at a time.
   integer, parameter :: buffer_length = 65536

   !> An open text.
   type :: line_reader_type
      private
      integer :: descriptor = -1
      !> The bytes read last.
      character(len=buffer_length) :: buffer = ''
      !> Number of bytes in the buffer, and number already returned.
      integer :: filled = 0, taken = 0
      !> Number of the latest line.
      integer, public :: line = 0
   end type line_reader_type

contains

   !> Opens a text.
   subroutine open_lines(path, reader, done)
      character(len=*), intent(in) :: path
      type(line_reader_type), intent(out) :: reader
      !> The text can be read.
      logical, intent(out) :: done

      reader%descriptor = open_descriptor(path)
      done = reader%descriptor >= 0
      if (.not. done) return
      call fill(reader)
      done = reader%filled >= 0
      if (.not. done) then
         call close_lines(reader)
      else if (index(reader%buffer(:reader%filled), byte_order_mark) == 1) then
         reader%taken = len(byte_order_mark)
      end if
   end subroutine open_lines

   !> The next line, without its end.
   subroutine read_line(reader, line, length)
      type(line_reader_type), intent(inout) :: reader
      !> The line, cut to `line_length`.
      character(len=line_length), intent(out) :: line
      !> Length of the line, at most `line_length` + 1; -1 at the end of the text, -2 if it cannot be read.
      integer, intent(out) :: length
      integer :: stop, n

      line = ''
      length = -1
      if (reader%descriptor < 0) return
      do
         if (reader%taken >= reader%filled) call fill(reader)
         if (reader%filled < 0) length = -2
         if (reader%filled <= 0) exit
         length = max(length, 0)
         stop = index(reader%buffer(reader%taken + 1:reader%filled), newline)
         n = merge(stop - 1, reader%filled - reader%taken, stop > 0)
         if (length < line_length) line(length + 1:) = reader%buffer(reader%taken + 1:reader%taken + n)
         length = min(length + n, line_length + 1)
         reader%taken = reader%taken + n + min(stop, 1)
         if (stop > 0) exit
         ! Only comments may be longer.
         if (length > line_length .and. line(1:1) /= '#') exit
      end do
      if (length < 0) return
      reader%line = reader%line + 1
      ! On some systems lines end with a carriage return and a line feed.
      if (length == 0 .or. length > line_length) return
      if (line(length:length) /= achar(13)) return
      line(length:length) = ' '
      length = length - 1
   end subroutine read_line

   !> Refills the buffer.
   subroutine fill(reader)
      !> The text; `filled` is negative if it cannot be read.
      type(line_reader_type), intent(inout) :: reader

      reader%taken = 0
      call read_bytes(reader%descriptor, reader%buffer, reader%filled)
   end subroutine fill

   !> Closes a text; does nothing if it is closed.
   subroutine close_lines(reader)
      type(line_reader_type), intent(inout) :: reader

      call close_descriptor(reader%descriptor)
   end subroutine close_lines

end module thud_line_reader
