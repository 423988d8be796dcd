!> Answers on directories of results; see `thud_answer` and `thud_result_directory`.
module thud_directory_answers
   use thud_bundle, only: bundle_type
   use thud_error, only: error_type
   use thud_kinds, only: wp
   use thud_request, only: request_type
   use thud_result_directory, only: check_target, close_results, new_result_directory, open_results, result_directory_type
   use thud_system, only: path_length
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: answer_check_results, answer_close_results, answer_open_results

contains

   !> Checks that the directory `path` may be replaced by the files `names` of a command.
   subroutine answer_check_results(request, error)
      type(request_type), intent(in) :: request
      !> Set if it may not.
      type(error_type), allocatable, intent(out) :: error
      character(len=path_length), allocatable :: names(:)

      call get_list(request, 'names', names)
      call check_target(new_directory(request), names, error)
   end subroutine answer_check_results

   !> Makes the new directory `folder` beside `path`.
   subroutine answer_open_results(request, bundle, error)
      type(request_type), intent(in) :: request
      type(bundle_type), intent(inout) :: bundle
      !> Set if it cannot be made.
      type(error_type), allocatable, intent(out) :: error
      type(result_directory_type) :: directory

      directory = new_directory(request)
      call open_results(directory, error)
      if (.not. allocated(error)) call bundle%add_text('folder', directory%folder)
   end subroutine answer_open_results

   !> Puts the directory `folder` in the place of `path`, or removes it.
   subroutine answer_close_results(request, error)
      type(request_type), intent(in) :: request
      !> Set if the directory may not be replaced.
      type(error_type), allocatable, intent(out) :: error
      type(result_directory_type) :: directory

      directory = new_directory(request)
      call close_results(directory, error)
   end subroutine answer_close_results

   !> The directory of a request: texts `path`, `command`, `subject` and `inputs`, number `replace`, perhaps text `folder`.
   function new_directory(request) result(directory)
      type(request_type), intent(in) :: request
      type(result_directory_type) :: directory
      character(len=:), allocatable :: path, command, subject
      character(len=path_length), allocatable :: inputs(:)

      call request%get_text('path', path)
      call request%get_text('command', command)
      call request%get_text('subject', subject)
      call get_list(request, 'inputs', inputs)
      directory = new_result_directory(path, command, subject, inputs, request%get_number('replace') > 0.0_wp)
      if (request%has('folder')) call request%get_text('folder', directory%folder)
   end function new_directory

   !> Texts `name.1`, `name.2` and so on: [n_text].
   subroutine get_list(request, name, texts)
      type(request_type), intent(in) :: request
      character(len=*), intent(in) :: name
      character(len=path_length), allocatable, intent(out) :: texts(:)
      character(len=:), allocatable :: text

      allocate (texts(0))
      do while (request%has(name//'.'//to_text(size(texts) + 1)))
         call request%get_text(name//'.'//to_text(size(texts) + 1), text)
         texts = [texts, [character(len=path_length) :: text]]
      end do
   end subroutine get_list

end module thud_directory_answers
