!> The command line of the executable.
module thud_command_line
   use thud_blas_threads, only: use_one_blas_thread
   use thud_bundle, only: bundle_type
   use thud_case, only: case_type
   use thud_case_text, only: describe_keys
   use thud_constants, only: version
   use thud_error, only: bad_input, error_type, input_error, numerical_error
   use thud_interrupt, only: prepare_process
   use thud_kinds, only: int64, int8
   use thud_progress_line, only: begin_progress, end_progress
   use thud_run, only: outcome_type, run_case, run_options_type
   use thud_samples_run, only: run_samples
   use thud_schema, only: get_schema
   use thud_screen, only: print_message, print_results, red, wrap_lines, write_screen, yellow
   use thud_system, only: path_length, standard_output
   use thud_text, only: get_suggestion, join, lower_case, newline, quoted, to_text
   implicit none (type, external)
   private

   public :: execute

   !> Exit code if the source does not conform, with `--check`.
   integer, parameter :: not_conforming = 3

   !> Maximum number of threads.
   integer, parameter :: max_threads = 1024

   !> Usage of the program.
   character(len=*), parameter :: usage = 'thud CASE.nml [--samples TABLE.csv [--threads N]] [--output DIR] [--replace] ' &
      //'[--all] [--check] [--quiet] [--verbose] | --keys | --schema | --help | --version'

   !> The help text.
   character(len=*), parameter :: help = &
      'Force of a heavy/soft impact source on the floor, its levels and a verdict.'//newline//newline &
      //'Usage: '//usage//newline//newline &
      //'  CASE.nml             input, a namelist file; inputs/ holds examples'//newline &
      //'  -o, --output DIR     directory for the results (default: outputs/<case>, with'//newline &
      //'                       --samples outputs/<case>_samples)'//newline &
      //'  --replace            replace also results of another case'//newline &
      //'  --all                write also model_histories.csv: energies and other'//newline &
      //'                       quantities of the model against time'//newline &
      //'  --samples TABLE.csv  a header row of keys and one drop, a sample, in each'//newline &
      //'                       further row; all other keys are those of CASE.nml'//newline &
      //'  --threads N          threads for the samples (default: 1)'//newline &
      //'  --check              exit with 3 if the source, with the values of CASE.nml,'//newline &
      //'                       does not conform to the limits'//newline &
      //'  -q, --quiet          show only errors and warnings'//newline &
      //'  -v, --verbose        show also numbers of the solver: resolution, quantities'//newline &
      //'                       of the model'//newline &
      //'  --keys               show every key with default, range and meaning'//newline &
      //'  --schema             the same and more as JSON, for programs'//newline &
      //'  -h, --help           show this text'//newline &
      //'  --version            show the version'//newline//newline &
      //'Exit codes: 0 done, 1 bad input or usage, 2 numerical failure, 3 not conforming'//newline &
      //'(--check), 130 interrupted, 143 terminated.'//newline//'Environment: NO_COLOR=1 shows no colors.'

   !> Address space that OpenBLAS allocates in each thread that uses it, bytes; without it OpenBLAS would wait forever.
   integer(int64), parameter :: blas_memory = 160000000_int64

   !> Long names of all options.
   character(len=*), parameter :: known_options(*) = [character(len=9) :: '--output', '--replace', '--all', &
      '--samples', '--threads', '--check', '--quiet', '--verbose', '--keys', '--schema', '--help', '--version']

   !> Memory of one thread.
   type :: buffer_type
      integer(int8), allocatable :: bytes(:)
   end type buffer_type

   !> Options of the command line.
   type :: request_type
      !> Path of the case file.
      character(len=:), allocatable :: case_file
      !> What is written where.
      type(run_options_type) :: options
      !> Path of a table of samples; empty if not given.
      character(len=:), allocatable :: samples
      !> Number of threads for the samples.
      integer :: threads = 1
      !> Exit with 3 if the source does not conform.
      logical :: check = .false.
      !> Show only errors and warnings.
      logical :: quiet = .false.
      !> Text to show instead of a run.
      character(len=:), allocatable :: information
   end type request_type

contains

   !> Executes the command line.
   subroutine execute(exit_code)
      !> 0 done, 1 bad input or usage, 2 numerical failure, 3 checked and not conforming, 130 interrupted, 143 terminated.
      integer, intent(out) :: exit_code
      type(request_type) :: request
      type(case_type), target :: case
      type(bundle_type) :: records
      type(outcome_type) :: outcome
      type(error_type), allocatable :: error
      type(buffer_type), allocatable, volatile :: buffers(:)
      character(len=128) :: message
      integer :: i, status

      exit_code = 0
      call prepare_process()
      call use_one_blas_thread()
      call parse_arguments(request, error)
      if (allocated(error)) then
         call print_message(error%message//newline//'Usage: '//usage, red, exit_code)
         exit_code = bad_input
      else if (allocated(request%information)) then
         call write_screen(standard_output, request%information//newline, exit_code)
      else
         if (.not. request%quiet) call begin_progress()
         allocate (buffers(request%threads))
         ! One by one, as Linux refuses more at once than the machine has.
         do i = 1, size(buffers)
            allocate (buffers(i)%bytes(blas_memory), stat=status, errmsg=message)
            if (status /= 0) exit
         end do
         deallocate (buffers)
         if (status /= 0) then
            error = numerical_error('buffers of OpenBLAS do not fit into the memory; allowed: more memory, or fewer threads')
         else if (request%samples == '') then
            call run_case(request%case_file, request%options, case, records, outcome, error)
         else
            call run_samples(request%case_file, request%samples, request%threads, request%options, outcome, error)
         end if
         call end_progress()
         if (allocated(error)) then
            call print_message(error%message, red, exit_code)
            exit_code = error%code
            return
         end if
         do i = 1, size(outcome%warning)
            call print_message(request%case_file//': '//trim(outcome%warning(i)), yellow, exit_code)
         end do
         if (.not. request%quiet) call print_results(outcome%table, outcome%directory, exit_code)
         if (exit_code == 0 .and. request%check .and. .not. outcome%conforms) exit_code = not_conforming
      end if
   end subroutine execute

   !> Parses the arguments.
   subroutine parse_arguments(request, error)
      type(request_type), intent(out) :: request
      !> Set if an argument is unknown, missing or not allowed.
      type(error_type), allocatable, intent(out) :: error
      character(len=path_length) :: argument, value
      character(len=:), allocatable :: suggestion, text
      integer :: i

      request%options%output = ''
      request%options%folder = ''
      request%samples = ''
      i = 1
      do while (i <= command_argument_count())
         call get_command_argument(i, argument)
         select case (argument)
         case ('--version')
            request%information = 'thud '//version
         case ('--keys')
            call describe_keys(text)
            call wrap_lines(text, request%information)
         case ('--schema')
            call get_schema(request%information)
         case ('-h', '--help')
            call wrap_lines(help, request%information)
         case ('--replace')
            request%options%replace = .true.
         case ('--all')
            request%options%write_all = .true.
         case ('--check')
            request%check = .true.
         case ('--quiet', '-q')
            request%quiet = .true.
         case ('--verbose', '-v')
            request%options%verbose = .true.
         case ('--output', '-o', '--samples', '--threads')
            i = i + 1
            call get_command_argument(i, value)
            if (value == '') then
               error = input_error(trim(argument)//' has no value; allowed: a directory, a table, or a number of threads')
            else if (argument == '--samples') then
               request%samples = trim(value)
            else if (argument /= '--threads') then
               request%options%output = trim(value)
            else
               request%threads = 0
               if (verify(trim(value), '0123456789') == 0 .and. len_trim(value) <= 4) read (value, *) request%threads
               if (request%threads < 1 .or. request%threads > max_threads) error = input_error('--threads = ' &
                  //quoted(value)//' is not allowed; allowed: 1 to '//to_text(max_threads)//', whole')
            end if
         case default
            if (index(argument, '-') == 1) then
               call get_suggestion(trim(argument), known_options, suggestion)
               error = input_error(quoted(argument)//' is not a known option'//suggestion//'; allowed: ' &
                  //join(known_options))
            else if (index(lower_case(argument), '.wav ') > 0) then
               error = input_error(quoted(argument)//' is a recording, for thud-driver measure; allowed: a namelist file')
            else if (allocated(request%case_file)) then
               error = input_error(quoted(argument)//' is a second case; allowed: one (commands such as run ' &
                  //'and predict belong to thud-driver)')
            else
               request%case_file = trim(argument)
            end if
         end select
         if (allocated(error) .or. allocated(request%information)) return
         i = i + 1
      end do
      if (.not. allocated(request%case_file)) then
         error = input_error('no case is given')
      else if (request%samples == '' .and. request%threads > 1) then
         error = input_error('--threads does nothing without --samples; allowed: both')
      else if (request%samples /= '' .and. (request%options%write_all .or. request%options%verbose)) then
         error = input_error('--samples writes one table; allowed: without --all and --verbose')
      else if (request%options%verbose .and. request%quiet) then
         error = input_error('--verbose contradicts --quiet; allowed: one of them')
      end if
   end subroutine parse_arguments

end module thud_command_line
