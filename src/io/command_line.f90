!> The command line of the executable.
module thud_command_line
   use thud_case, only: describe_keys
   use thud_constants, only: version
   use thud_error, only: bad_input, error_type, input_error
   use thud_posix, only: ignore_signals, print_text, standard_error, standard_output
   use thud_progress_line, only: begin_progress, end_progress
   use thud_run, only: outcome_type, run_case
   use thud_text, only: newline, quoted
   implicit none (type, external)
   private

   public :: execute

   !> Exit code where the source does not conform and `--check` asks for it.
   integer, parameter :: not_conforming = 3

   !> What the command line asks for.
   type :: request_type
      !> Path of the case file.
      character(len=:), allocatable :: case_file
      !> Output directory, empty where not given.
      character(len=:), allocatable :: output
      !> Exit with 3 where the source does not conform.
      logical :: check = .false.
      !> Nothing on the screen but errors.
      logical :: quiet = .false.
      !> Text to be shown instead of a run.
      character(len=:), allocatable :: information
   end type request_type

contains

   !> Does what the command line asks for.
   subroutine execute(exit_code)
      !> 0 done, 1 bad input or usage, 2 numerical failure, 3 checked and not conforming.
      integer, intent(out) :: exit_code
      type(request_type) :: request
      type(outcome_type) :: outcome
      type(error_type), allocatable :: error

      exit_code = 0
      call ignore_signals()
      call parse_arguments(request, error)
      if (allocated(error)) then
         call say(standard_error, 'thud: '//error%message//newline//'Usage: '//usage(), exit_code)
         exit_code = bad_input
      else if (allocated(request%information)) then
         call say(standard_output, request%information, exit_code)
      else
         if (.not. request%quiet) call begin_progress()
         call run_case(request%case_file, request%output, outcome, error)
         call end_progress()
         if (allocated(error)) then
            call say(standard_error, 'thud: '//error%message, exit_code)
            exit_code = error%code
            return
         end if
         if (outcome%remark /= '') call say(standard_error, 'thud: '//outcome%remark, exit_code)
         if (.not. request%quiet) call say(standard_output, outcome%table//'  Results: '//outcome%directory, exit_code)
         if (exit_code == 0 .and. request%check .and. .not. outcome%conforms) exit_code = not_conforming
      end if
   end subroutine execute

   !> Writes to the screen; a closed or full output is an error, not a crash.
   subroutine say(descriptor, text, exit_code)
      !> `standard_output` or `standard_error`.
      integer, intent(in) :: descriptor
      !> The text.
      character(len=*), intent(in) :: text
      !> Becomes 1 where the text could not be written.
      integer, intent(inout) :: exit_code
      logical :: done

      call print_text(descriptor, text//newline, done)
      if (.not. done) exit_code = bad_input
   end subroutine say

   !> Turns the arguments into a request.
   subroutine parse_arguments(request, error)
      !> What is asked for.
      type(request_type), intent(out) :: request
      !> An argument is unknown, missing or given twice.
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: argument
      integer :: i

      request%output = ''
      i = 1
      do while (i <= command_argument_count())
         argument = get_argument(i)
         select case (argument)
         case ('-h', '--help')
            request%information = help()
            return
         case ('--version')
            request%information = 'thud '//version
            return
         case ('--keys')
            request%information = describe_keys()
            return
         case ('--check')
            request%check = .true.
         case ('--quiet', '-q')
            request%quiet = .true.
         case ('--output', '-o')
            i = i + 1
            if (i <= command_argument_count()) request%output = get_argument(i)
            if (request%output == '') then
               error = input_error('--output has no value; allowed: a directory')
               return
            end if
         case default
            if (index(argument, '-') == 1) then
               error = input_error(quoted(argument)//' is not a known option; allowed: --output DIR, --check, --quiet, ' &
                  //'--keys, --help, --version')
            else if (allocated(request%case_file)) then
               error = input_error(quoted(argument)//' is a second case; allowed: one')
            else
               request%case_file = argument
            end if
            if (allocated(error)) return
         end select
         i = i + 1
      end do
      if (.not. allocated(request%case_file)) error = input_error('no case is given')
   end subroutine parse_arguments

   !> One argument of the command line.
   function get_argument(i) result(argument)
      !> Number of the argument.
      integer, intent(in) :: i
      !> Its text.
      character(len=:), allocatable :: argument
      integer :: length

      call get_command_argument(i, length=length)
      allocate (character(len=length) :: argument)
      call get_command_argument(i, value=argument)
   end function get_argument

   !> One line on how to call the program.
   pure function usage() result(text)
      !> The line.
      character(len=:), allocatable :: text

      text = 'thud CASE.nml [--output DIR] [--check] [--quiet] | --keys | --help | --version'
   end function usage

   !> The help text.
   pure function help() result(text)
      !> Usage, options, exit codes.
      character(len=:), allocatable :: text

      text = 'Force of a heavy/soft impact source on the floor, its levels and a verdict.'//newline &
         //newline//'Usage: '//usage()//newline//newline &
         //'  CASE.nml           input, a namelist file; inputs/ holds examples'//newline &
         //'  -o, --output DIR   directory for the results (default: outputs/<case name>)'//newline &
         //'  --check            exit with 3 where the source does not conform to the limits'//newline &
         //'  -q, --quiet        show nothing but errors and remarks'//newline &
         //'  --keys             show every key with default, range and meaning'//newline &
         //'  -h, --help         show this text'//newline &
         //'  --version          show the version'//newline//newline &
         //'Exit codes: 0 done, 1 bad input or usage, 2 numerical failure, 3 not conforming (--check).'
   end function help

end module thud_command_line
