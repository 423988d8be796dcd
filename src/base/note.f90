!> Notes: facts that the user of an input or a result should know, as records from which sentences are made.
module thud_note
   use thud_constants, only: not_a_number
   use thud_interval, only: key_length
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: get_sentence, get_subject, note_type

   !> A fact about a group or a key of the input.
   type :: note_type
      !> What it is, for programs.
      character(len=24) :: code = ''
      !> Group, and key if it is about one.
      character(len=key_length) :: group = '', key = ''
      !> Quantity that it is about, if it is no key, or how the value is stated, such as its unit.
      character(len=72) :: quantity = ''
      !> Value, and ends of the range in which it should be; NaN if there is none.
      real(wp) :: value = not_a_number, low = not_a_number, high = not_a_number
      !> What it says of its subject.
      character(len=240) :: text = ''
   end type note_type

contains

   !> The sentence of a note, which names group and key.
   elemental function get_sentence(note) result(sentence)
      type(note_type), intent(in) :: note
      character(len=2*key_length + len(note%quantity) + len(note%text) + 5) :: sentence

      sentence = '&'//trim(note%group)//': '//adjustl(trim(note%key)//' '//adjustl(trim(note%quantity)//' '//note%text))
   end function get_sentence

   !> Group and key of a note, with a point between.
   elemental function get_subject(note) result(subject)
      type(note_type), intent(in) :: note
      character(len=2*key_length + 1) :: subject

      subject = note%group
      if (note%key /= '') subject = trim(note%group)//'.'//note%key
   end function get_subject

end module thud_note
