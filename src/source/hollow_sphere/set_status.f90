!> Why the batch has no result for a set; the single solver has the sentences.
module thud_set_status
   implicit none (type, external)
   private

   public :: set_closes, set_coarse, set_few_samples, set_is_fine, set_outlasts, set_range

   !> The set was computed.
   integer, parameter :: set_is_fine = 0

   !> The drop closes the shell.
   integer, parameter :: set_closes = 1

   !> The steps are too coarse for the source.
   integer, parameter :: set_coarse = 2

   !> The contact outlasts the record.
   integer, parameter :: set_outlasts = 3

   !> The contact has too few samples.
   integer, parameter :: set_few_samples = 4

   !> A parameter lies outside its range.
   integer, parameter :: set_range = 5

end module thud_set_status
