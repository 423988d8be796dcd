!> The questions that callers in other languages can ask, by name.
module thud_answer
   use thud_bundle, only: bundle_type
   use thud_case, only: case_type
   use thud_case_answers, only: answer_compression, answer_effective_case, answer_loss_factors, answer_run, &
      answer_samples, answer_solve, describe_library
   use thud_case_text, only: read_case
   use thud_directory_answers, only: answer_check_results, answer_close_results, answer_open_results
   use thud_error, only: error_type, input_error
   use thud_floor_answers, only: answer_floor, answer_mobility_fit
   use thud_level_answers, only: answer_levels, answer_low_pass, answer_peak_count, answer_rating
   use thud_request, only: request_type
   use thud_text, only: quoted
   implicit none (type, external)
   private

   public :: get_answer

contains

   !> Answers a question. If the request has the text `case`, that case is read and checked first.
   subroutine get_answer(question, request, bundle, error)
      character(len=*), intent(in) :: question
      type(request_type), intent(in) :: request
      type(bundle_type), intent(inout) :: bundle
      !> Set if the case is invalid or a computation fails.
      type(error_type), allocatable, intent(out) :: error
      type(case_type), target :: case
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
         call describe_library(bundle)
      case ('effective_case')
         call answer_effective_case(request, bundle, error)
      case ('run')
         call answer_run(request, bundle, error)
      case ('check_results')
         call answer_check_results(request, error)
      case ('open_results')
         call answer_open_results(request, bundle, error)
      case ('close_results')
         call answer_close_results(request, error)
      case ('solve')
         call answer_solve(case, bundle, error)
      case ('compression')
         call answer_compression(case, bundle, error)
      case ('loss_factors')
         call answer_loss_factors(case, request, bundle, error)
      case ('samples')
         call answer_samples(case, request, bundle, error)
      case ('mobility', 'floor_energy', 'floor_impact', 'room_level', 'modal_room', 'floor_modes', 'radiation')
         call answer_floor(question, case, request, bundle, error)
      case ('mobility_fit')
         call answer_mobility_fit(request, bundle, error)
      case ('levels')
         call answer_levels(request, bundle, error)
      case ('peak_count')
         call answer_peak_count(request, bundle)
      case ('low_pass')
         call answer_low_pass(request, bundle)
      case ('rating')
         call answer_rating(request, bundle)
      case default
         error = input_error(quoted(question)//' is no question of the library')
      end select
   end subroutine get_answer

end module thud_answer
