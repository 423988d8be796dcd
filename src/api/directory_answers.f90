!> Answers on directories of results; see `thud_answer` and `thud_result_directory`.
module thud_directory_answers
   use thud_bundle, only: bundle_type
   use thud_error, only: error_type
   use thud_kinds, only: wp
   use thud_request, only: request_type
   use thud_result_directory, only: check_target, close_results, open_results, result_directory_type
   use thud_system, only: name_length
   use thud_text, only: newline, split
   implicit none (type, external)
   private

   public :: answer_directory

contains

   !> Answers a question on a directory: texts `path`, `command`, `subject`, `inputs` (paths in lines), number `replace`.
   subroutine answer_directory(question, request, bundle, error)
      !> `check_results`: may the files `names` (in lines) replace it; `open_results`: makes the new directory `folder`
      !> beside it; `close_results`: puts `folder` in its place, or removes `folder`.
      character(len=*), intent(in) :: question
      type(request_type), intent(in) :: request
      type(bundle_type), intent(inout) :: bundle
      !> Set if the directory may not be replaced, or `folder` cannot be made.
      type(error_type), allocatable, intent(out) :: error
      type(result_directory_type) :: directory
      character(len=name_length), allocatable :: names(:)
      character(len=:), allocatable :: text

      call request%get_text('path', directory%path)
      call request%get_text('command', directory%command)
      call request%get_text('subject', directory%subject)
      call request%get_text('inputs', text)
      call split(text, newline, directory%inputs)
      directory%replace = request%get_number('replace') > 0.0_wp
      select case (question)
      case ('check_results')
         call request%get_text('names', text)
         call split(text, newline, names)
         call check_target(directory, names, error)
      case ('open_results')
         call open_results(directory, error)
         if (.not. allocated(error)) call bundle%add_text('folder', directory%folder)
      case default
         call request%get_text('folder', directory%folder)
         call close_results(directory, error)
      end select
   end subroutine answer_directory

end module thud_directory_answers
