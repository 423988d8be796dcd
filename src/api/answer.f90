!> The questions that callers in other languages can ask, by name.
module thud_answer
   use, intrinsic :: iso_fortran_env, only: compiler_options, compiler_version
   use thud_bundle, only: bundle_type
   use thud_case, only: case_type, get_model_number
   use thud_case_text, only: get_case_text, read_case
   use thud_column, only: column_type, find_columns
   use thud_compression, only: compression_type, compute_compression
   use thud_compute, only: compute, results_type, scope_type
   use thud_constants, only: version
   use thud_directory_answers, only: answer_directory
   use thud_error, only: error_type, input_error
   use thud_field, only: name_length
   use thud_finite_element, only: finite_element_type
   use thud_floor_answers, only: answer_floor, answer_mobility_fit
   use thud_interrupt, only: is_forked
   use thud_kinds, only: wp
   use thud_level_answers, only: answer_level
   use thud_progress_line, only: begin_progress, end_progress
   use thud_records, only: add_compression, add_results
   use thud_request, only: request_type
   use thud_run, only: load_case, outcome_type, run_case, run_options_type
   use thud_sweep, only: keep_matrices, new_sweep, solve_sweep, sweep_type
   use thud_text, only: newline, quoted
   use thud_text_buffer, only: text_buffer_type
   implicit none (type, external)
   private

   public :: get_answer

contains

   !> Answers a question. If the request has the text `case`, that case is read and checked first.
   subroutine get_answer(question, request, bundle, error)
      character(len=*), intent(in) :: question
      type(request_type), intent(in) :: request
      type(bundle_type), intent(inout) :: bundle
      !> Set if the case is invalid, a computation fails, or there is no such question.
      type(error_type), allocatable, intent(out) :: error
      type(case_type), target :: case
      type(results_type) :: results
      type(compression_type) :: compression
      real(wp), allocatable :: loss_factors(:)
      character(len=:), allocatable :: text

      if (request%has('case')) then
         call request%get_text('case', text)
         ! The values of samples may make an invalid case valid.
         call read_case(text, 'python', case, error, unchecked=question == 'samples')
         if (allocated(error)) return
      end if
      select case (question)
      case ('check')
         continue
      case ('library')
         call bundle%add_text('version', version)
         call bundle%add_text('compiler', compiler_version()//', options '//compiler_options())
      case ('effective_case')
         ! Of the namelist file `path`, which may have a room without a floor.
         call request%get_text('path', text)
         call load_case(text, case, error, room_alone=.true.)
         if (.not. allocated(error)) call add_case(case, bundle)
      case ('run')
         call answer_run(request, bundle, error)
      case ('check_results', 'open_results', 'close_results')
         call answer_directory(question, request, bundle, error)
      case ('solve')
         ! Without levels and energies: callers ask for them in the bands that they need.
         call compute(case, scope_type(levels=.false., energies=.false.), results, error)
         if (.not. allocated(error)) call add_results(bundle, case, results)
      case ('compression')
         call compute_compression(case%compression, case%ball, case%models(get_model_number(case))%model, compression, error)
         if (.not. allocated(error)) call add_compression(bundle, compression)
      case ('loss_factors')
         ! Of the material, at the frequencies `frequency`, Hz.
         select type (model => case%models(get_model_number(case))%model)
         type is (finite_element_type)
            allocate (loss_factors(size(request%get_array('frequency'))))
            call model%get_loss_factors(case%ball, request%get_array('frequency'), loss_factors, error)
            if (.not. allocated(error)) call bundle%add_array('loss_factors', shape(loss_factors), loss_factors)
         class default
            error = input_error('this model has no material with a loss factor; allowed: finite_element', 'model')
         end select
      case ('samples')
         call answer_samples(case, request, bundle, error)
      case ('mobility', 'floor_energy', 'floor_impact', 'room_level', 'modal_room', 'floor_modes', 'radiation')
         call answer_floor(question, case, request, bundle, error)
      case ('mobility_fit')
         call answer_mobility_fit(request, bundle, error)
      case ('levels', 'low_pass', 'peak_count', 'rating')
         call answer_level(question, request, bundle, error)
      case default
         error = input_error(quoted(question)//' is no question of the library')
      end select
   end subroutine get_answer

   !> Adds the full input of a case to a bundle.
   subroutine add_case(case, bundle)
      type(case_type), intent(in), target :: case
      type(bundle_type), intent(inout) :: bundle
      character(len=:), allocatable :: text

      call get_case_text(case, text)
      call bundle%add_text('case', text)
   end subroutine add_case

   !> Runs the namelist file `path` like the executable, and writes the results into the directory `folder`. Numbers other
   !> than 0 ask to write additional quantities of the model (`all`), to show numbers of the solver in the table (`verbose`),
   !> and to show progress on a terminal (`progress`).
   subroutine answer_run(request, bundle, error)
      type(request_type), intent(in) :: request
      type(bundle_type), intent(inout) :: bundle
      !> Set if the run fails.
      type(error_type), allocatable, intent(out) :: error
      type(case_type), target :: case
      type(outcome_type) :: outcome
      type(run_options_type) :: options
      character(len=:), allocatable :: path

      call request%get_text('path', path)
      options%write_all = request%get_number('all') > 0.0_wp
      options%verbose = request%get_number('verbose') > 0.0_wp
      call request%get_text('folder', options%folder)
      options%output = options%folder
      if (request%get_number('progress') > 0.0_wp) call begin_progress()
      ! gfortran keeps the lengths of texts that functions return in static memory: one run writes its tables at a time.
      !$omp critical (thud_run)
      call run_case(path, options, case, bundle, outcome, error)
      !$omp end critical (thud_run)
      call end_progress()
      if (allocated(error)) return
      bundle%group = ''
      call add_case(case, bundle)
      call bundle%add_text('table', outcome%table)
      call bundle%add_number('conforms', merge(1.0_wp, 0.0_wp, outcome%conforms))
   end subroutine answer_run

   !> Computes samples of a case that differ in the `key_count` comma-separated `keys`, with `threads` threads. `values`
   !> holds the values of the keys, for a choice its index from 1: [n_key, n_sample]. Numbers `levels` and `forces` other
   !> than 0 ask for those.
   subroutine answer_samples(case, request, bundle, error)
      type(case_type), intent(in), target :: case
      type(request_type), intent(in) :: request
      type(bundle_type), intent(inout) :: bundle
      !> Set if a key is unknown, or the samples cannot be computed together.
      type(error_type), allocatable, intent(out) :: error
      type(column_type), allocatable :: columns(:)
      type(sweep_type) :: sweep
      type(text_buffer_type) :: reasons
      character(len=:), allocatable :: keys
      character(len=name_length), allocatable :: names(:)
      character(len=128) :: message
      real(wp), allocatable :: values(:)
      integer :: i, n, status

      call request%get_text('keys', keys)
      allocate (names(nint(request%get_number('key_count'))))
      names = ''
      read (keys, *, iostat=status, iomsg=message) names
      if (status /= 0) names = keys
      call find_columns(case, names, columns, error)
      if (allocated(error)) return
      call new_sweep(case, request%get_number('levels') > 0.0_wp, sweep)
      allocate (values, source=request%get_array('values'))
      call solve_sweep(case, columns, reshape(values, [size(columns), size(values)/size(columns)]), &
         merge(1, nint(request%get_number('threads')), is_forked == 1), request%get_number('forces') > 0.0_wp, sweep, error)
      if (allocated(error)) return
      do i = 1, size(sweep%reason)
         if (allocated(sweep%reason(i)%text)) call reasons%append(sweep%reason(i)%text//newline)
      end do
      call bundle%add_text('reasons', reasons%get_text())
      call bundle%add_array('status', shape(sweep%status), real(sweep%status, wp))
      i = 1
      do while (i <= size(sweep%columns))
         n = count(sweep%columns%result == sweep%columns(i)%result)
         call bundle%add_array(sweep%columns(i)%result, pack([n, size(sweep%status)], [n > 1, .true.]), &
            sweep%values(i:i + n - 1, :))
         i = i + n
      end do
      call bundle%move_array('force', sweep%force)
      call keep_matrices(sweep)
   end subroutine answer_samples

end module thud_answer
