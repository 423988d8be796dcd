!> Suggestions for misspelled words.
module thud_suggestion
   use thud_text, only: lower_case, quoted
   implicit none (type, external)
   private

   public :: get_suggestion

   !> Maximum length of a word that gets a suggestion.
   integer, parameter :: max_length = 64

contains

   !> The known word that a misspelled one probably means.
   pure subroutine get_suggestion(word, known, suggestion)
      !> The misspelled word.
      character(len=*), intent(in) :: word
      !> The known words: [n_known].
      character(len=*), intent(in) :: known(:)
      !> ` (did you mean 'height'?)`; empty if no word is close.
      character(len=:), allocatable, intent(out) :: suggestion
      integer :: distance(size(known))
      integer :: i

      suggestion = ''
      if (size(known) == 0 .or. len(word) > max_length) return
      distance = [(get_distance(lower_case(word), lower_case(trim(known(i)))), i=1, size(known))]
      i = minloc(distance, dim=1)
      ! A third of the letters may be wrong.
      if (3*distance(i) <= max(len(word), len_trim(known(i)))) suggestion = ' (did you mean '//quoted(known(i))//'?)'
   end subroutine get_suggestion

   !> Number of insertions, deletions and replacements of letters that turn one word into the other (Levenshtein distance).
   pure function get_distance(first, second) result(distance)
      character(len=*), intent(in) :: first, second
      integer :: distance
      ! Element (j, i): distance between the first i letters of `first` and the first j letters of `second`.
      integer :: table(0:len(second), 0:len(first))
      integer :: i, j

      table(:, 0) = [(j, j=0, len(second))]
      do i = 1, len(first)
         table(0, i) = i
         do j = 1, len(second)
            table(j, i) = min(table(j, i - 1) + 1, table(j - 1, i) + 1, &
               table(j - 1, i - 1) + merge(0, 1, first(i:i) == second(j:j)))
         end do
      end do
      distance = table(len(second), len(first))
   end function get_distance

end module thud_suggestion
