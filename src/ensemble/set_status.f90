!> What can become of a parameter set of an ensemble: one code and one text per reason.
module thud_set_status
   implicit none (type, external)
   private

   public :: get_status_text, set_closes, set_coarse, set_few_samples, set_is_fine, set_outlasts, set_range, set_flux
   public :: status_length

   !> Length of a text.
   integer, parameter :: status_length = 96

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

   !> The choice of the flux term is not known.
   integer, parameter :: set_flux = 5

   !> Parameter number i lies outside its range: this plus i.
   integer, parameter :: set_range = 10

contains

   !> The reason behind a code.
   pure function get_status_text(status, key) result(text)
      !> The code.
      integer, intent(in) :: status
      !> Key of the parameter that a code above `set_range` tells of.
      character(len=*), intent(in) :: key
      !> The reason.
      character(len=status_length) :: text

      select case (status)
      case (set_is_fine)
         text = 'computed'
      case (set_closes)
         text = 'the drop closes the shell'
      case (set_coarse)
         text = 'the steps are too coarse: substeps is too low'
      case (set_outlasts)
         text = 'the contact outlasts the record: duration is too short'
      case (set_few_samples)
         text = 'the contact has too few samples: sample_rate is too low'
      case (set_flux)
         text = 'momentum_flux is not known'
      case default
         text = trim(key)//' lies outside its range'
      end select
   end function get_status_text

end module thud_set_status
