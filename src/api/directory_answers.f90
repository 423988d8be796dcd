!> Answers on directories of results; see `thud_answer` and `thud_result_directory`.
module thud_directory_answers
   use thud_bundle, only: bundle_type
   use thud_error, only: error_type
   use thud_kinds, only: wp
   use thud_request, only: request_type
   use thud_result_directory, only: check_target, close_results, open_results, result_directory_type
   use thud_system, only: path_length
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: answer_directory

contains

   !> Answers a question on a directory: texts `path`, `command`, `subject` and `inputs`, number `replace`.
   subroutine answer_directory(question, request, bundle, error)
      !> `check_results`: may the files `names` replace it; `open_results`: makes the new directory `folder` beside it;
      !> `close_results`: puts `folder` in its place, or removes `folder`.
      character(len=*), intent(in) :: question
      type(request_type), intent(in) :: request
      type(bundle_type), intent(inout) :: bundle
      !> Set if the directory may not be replaced, or `folder` cannot be made.
      type(error_type), allocatable, intent(out) :: error
      type(result_directory_type) :: directory

      call request%get_text('path', directory%path)
      call request%get_text('command', directory%command)
      call request%get_text('subject', directory%subject)
      directory%inputs = get_list('inputs')
      directory%replace = request%get_number('replace') > 0.0_wp
      select case (question)
      case ('check_results')
         call check_target(directory, get_list('names'), error)
      case ('open_results')
         call open_results(directory, error)
         if (.not. allocated(error)) call bundle%add_text('folder', directory%folder)
      case default
         call request%get_text('folder', directory%folder)
         call close_results(directory, error)
      end select

   contains

      !> Texts `name.1`, `name.2` and so on: [n_text].
      function get_list(name) result(texts)
         character(len=*), intent(in) :: name
         character(len=path_length), allocatable :: texts(:)
         character(len=:), allocatable :: text

         allocate (texts(0))
         do while (request%has(name//'.'//to_text(size(texts) + 1)))
            call request%get_text(name//'.'//to_text(size(texts) + 1), text)
            texts = [character(len=path_length) :: texts, text]
         end do
      end function get_list

   end subroutine answer_directory

end module thud_directory_answers
