!> The part of pFUnit's module `funit` that the suites of thud use.
module funit
   use, intrinsic :: iso_fortran_env, only: error_unit, output_unit, real64
   implicit none (type, external)
   private

   public :: SourceLocation, anyExceptions, finish_tests, run_test
   public :: assertEqual, assertFalse, assertGreaterThan, assertLessThan, assertTrue

   !> Place of an assert.
   type :: SourceLocation
      !> File of the suite.
      character(len=64) :: file_name = ''
      !> Line in it.
      integer :: line = 0
   end type SourceLocation

   interface SourceLocation
      module procedure :: new_location
   end interface SourceLocation

   interface assertEqual
      module procedure :: equal_integer
      module procedure :: equal_integers
      module procedure :: equal_real
      module procedure :: equal_reals
      module procedure :: equal_text
   end interface assertEqual

   interface assertLessThan
      module procedure :: less_integer
      module procedure :: less_real
   end interface assertLessThan

   interface assertGreaterThan
      module procedure :: greater_integer
      module procedure :: greater_real
   end interface assertGreaterThan

   abstract interface
      !> A test.
      subroutine test_interface()
         implicit none (type, external)
      end subroutine test_interface
   end interface

   logical :: failed = .false.
   integer :: n_test = 0, n_failed = 0

contains

   !> Place of an assert, as pFUnit constructs it.
   function new_location(file_name, line) result(location)
      character(len=*), intent(in) :: file_name
      integer, intent(in) :: line
      type(SourceLocation) :: location

      location%file_name = file_name
      location%line = line
   end function new_location

   !> Whether the running test has failed.
   logical function anyExceptions()
      anyExceptions = failed
   end function anyExceptions

   !> Runs one test.
   subroutine run_test(name, test)
      character(len=*), intent(in) :: name
      procedure(test_interface) :: test

      failed = .false.
      n_test = n_test + 1
      call test()
      if (failed) n_failed = n_failed + 1
      write (output_unit, '(2a)') merge('failed ', 'ok     ', failed), name
   end subroutine run_test

   !> Prints the count; a failure stops with an error.
   subroutine finish_tests()
      write (output_unit, '(i0,a,i0,a)') n_test - n_failed, ' passed, ', n_failed, ' failed'
      if (n_failed > 0 .or. n_test == 0) stop 1
   end subroutine finish_tests

   !> Notes a failure.
   subroutine check(condition, what, message, location)
      logical, intent(in) :: condition
      character(len=*), intent(in) :: what
      character(len=*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location

      if (condition) return
      failed = .true.
      if (present(location)) write (error_unit, '(2a,i0,a)', advance='no') trim(location%file_name), ':', location%line, ': '
      write (error_unit, '(a)') what
      if (present(message)) write (error_unit, '(2a)') '   ', message
   end subroutine check

   function text_of(value) result(text)
      real(real64), intent(in) :: value
      character(len=:), allocatable :: text
      character(len=32) :: buffer

      write (buffer, '(es24.16e3)') value
      text = trim(adjustl(buffer))
   end function text_of

   subroutine assertTrue(condition, message, location)
      logical, intent(in) :: condition
      character(len=*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location

      call check(condition, 'expected true', message, location)
   end subroutine assertTrue

   subroutine assertFalse(condition, message, location)
      logical, intent(in) :: condition
      character(len=*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location

      call check(.not. condition, 'expected false', message, location)
   end subroutine assertFalse

   subroutine equal_integer(expected, found, message, location)
      integer, intent(in) :: expected, found
      character(len=*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location
      character(len=80) :: what

      write (what, '(a,i0,a,i0)') 'expected ', expected, ', found ', found
      call check(expected == found, trim(what), message, location)
   end subroutine equal_integer

   subroutine equal_integers(expected, found, message, location)
      integer, intent(in) :: expected(:), found(:)
      character(len=*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location
      integer :: i

      call check(size(expected) == size(found), 'arrays of different size', message, location)
      do i = 1, min(size(expected), size(found))
         call equal_integer(expected(i), found(i), message, location)
      end do
   end subroutine equal_integers

   subroutine equal_real(expected, found, tolerance, message, location)
      real(real64), intent(in) :: expected, found
      real(real64), intent(in), optional :: tolerance
      character(len=*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location
      real(real64) :: allowed

      allowed = 0.0_real64
      if (present(tolerance)) allowed = tolerance
      ! Asked so that NaN fails.
      call check(abs(expected - found) <= allowed, 'expected '//text_of(expected)//', found '//text_of(found) &
         //', tolerance '//text_of(allowed), message, location)
   end subroutine equal_real

   subroutine equal_reals(expected, found, tolerance, message, location)
      real(real64), intent(in) :: expected(:), found(:)
      real(real64), intent(in), optional :: tolerance
      character(len=*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location
      integer :: i

      call check(size(expected) == size(found), 'arrays of different size', message, location)
      do i = 1, min(size(expected), size(found))
         call equal_real(expected(i), found(i), tolerance, message, location)
      end do
   end subroutine equal_reals

   subroutine equal_text(expected, found, message, location)
      character(len=*), intent(in) :: expected, found
      character(len=*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location

      call check(expected == found, 'expected "'//expected//'", found "'//found//'"', message, location)
   end subroutine equal_text

   subroutine less_integer(a, b, message, location)
      integer, intent(in) :: a, b
      character(len=*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location
      character(len=80) :: what

      write (what, '(a,i0,a,i0)') 'expected ', a, ' < ', b
      call check(a < b, trim(what), message, location)
   end subroutine less_integer

   subroutine less_real(a, b, message, location)
      real(real64), intent(in) :: a, b
      character(len=*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location

      call check(a < b, 'expected '//text_of(a)//' < '//text_of(b), message, location)
   end subroutine less_real

   subroutine greater_integer(a, b, message, location)
      integer, intent(in) :: a, b
      character(len=*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location

      call less_integer(b, a, message, location)
   end subroutine greater_integer

   subroutine greater_real(a, b, message, location)
      real(real64), intent(in) :: a, b
      character(len=*), intent(in), optional :: message
      type(SourceLocation), intent(in), optional :: location

      call less_real(b, a, message, location)
   end subroutine greater_real

end module funit
