!> Suggestions for misspelled words.
module thud_suggestion
   use thud_text, only: lower_case, quoted
   implicit none (type, external)
   private

   public :: get_suggestion

   !> Maximum length of a word that gets a suggestion.
   integer, parameter :: max_length = 64

contains

   !> The known word that a misspelled one probably means, by the number of insertions, deletions and replacements of letters
   !> that turn one into the other (Levenshtein distance).
   pure subroutine get_suggestion(word, known, suggestion)
      !> The misspelled word.
      character(len=*), intent(in) :: word
      !> The known words: [n_known].
      character(len=*), intent(in) :: known(:)
      !> ` (did you mean 'height'?)`; empty if no word is close.
      character(len=:), allocatable, intent(out) :: suggestion
      ! Distance between the first j letters of the word and the first i letters of a known one; that for i - 1.
      integer :: row(0:len(word)), before(0:len(word))
      integer :: distance(size(known))
      integer :: i, j, k

      suggestion = ''
      if (size(known) == 0 .or. len(word) > max_length) return
      do k = 1, size(known)
         row = [(j, j=0, len(word))]
         do i = 1, len_trim(known(k))
            before = row
            row(0) = i
            do j = 1, len(word)
               row(j) = min(row(j - 1) + 1, before(j) + 1, &
                  before(j - 1) + merge(0, 1, lower_case(word(j:j)) == lower_case(known(k)(i:i))))
            end do
         end do
         distance(k) = row(len(word))
      end do
      k = minloc(distance, dim=1)
      ! A third of the letters may be wrong.
      if (3*distance(k) <= max(len(word), len_trim(known(k)))) suggestion = ' (did you mean '//quoted(known(k))//'?)'
   end subroutine get_suggestion

end module thud_suggestion
