!> Results of many sets as rows of a table.
module thud_set_report
   use thud_band, only: band_type, get_band_name
   use thud_shell_sets, only: get_set_fields, parameter_count, set_outcome_type, set_type
   use thud_ensemble, only: force_count, verdict_type
   use thud_field, only: field_type
   use thud_hollow_sphere, only: flux_choices
   use thud_kinds, only: wp
   use thud_set_status, only: get_status_text, set_is_fine, set_range, status_length
   use thud_set_table, only: set_table_type
   use thud_text, only: fixed, newline, to_text
   implicit none (type, external)
   private

   public :: get_set_header, get_set_reason, get_set_rows

   !> Columns behind the parameters.
   character(len=*), parameter :: outcome_names = 'contact_time_s,peak_force_N,peak_floor_force_N,max_deflection_m,' &
      //'restitution,impulse_N_s'

   !> Names of the forces.
   character(len=7), parameter :: force_names(force_count) = [character(len=7) :: 'elastic', 'floor']

contains

   !> First line of the results.
   subroutine get_set_header(table, bands, text)
      !> The table.
      type(set_table_type), intent(in) :: table
      !> Bands of the levels: [n_band].
      type(band_type), intent(in) :: bands(:)
      !> The line.
      character(len=:), allocatable, intent(out) :: text
      integer :: i, j

      text = 'set'
      do i = 1, size(table%columns)
         text = text//','//trim(table%keys(table%columns(i)))
      end do
      text = text//','//outcome_names
      do j = 1, force_count
         do i = 1, size(bands)
            text = text//','//trim(force_names(j))//'_'//trim(bands(i)%set)//'_'//get_band_name(bands(i))//'_Hz_dB'
         end do
      end do
      do j = 1, force_count
         text = text//','//trim(force_names(j))//'_conforms'
      end do
      text = text//',status'//newline
   end subroutine get_set_header

   !> Lines of the results, 17 digits; what could not be computed is left out.
   subroutine get_set_rows(table, before, sets, outcomes, levels, verdicts, text)
      !> The table.
      type(set_table_type), intent(in) :: table
      !> Number of sets before these.
      integer, intent(in) :: before
      !> The sets: [n_set].
      type(set_type), intent(in), target :: sets(:)
      !> Their outcomes: [n_set].
      type(set_outcome_type), intent(in) :: outcomes(:)
      !> Their levels, dB: [n_band, force_count, n_set].
      real(wp), intent(in) :: levels(:, :, :)
      !> Their verdicts: [n_set].
      type(verdict_type), intent(in) :: verdicts(:)
      !> The lines.
      character(len=:), allocatable, intent(out) :: text
      !> Room for a number with its comma, and for all that is none.
      integer, parameter :: number_width = 26, rest_width = 192
      character(len=*), parameter :: numbers_form = '(*(:,",",es24.16e3))'
      character(len=number_width*(size(table%columns) + 6 + size(levels, 1)*force_count) + rest_width) :: row
      type(set_type), target :: set
      type(field_type) :: fields(parameter_count)
      integer :: i, j, at, end_of_text

      fields = get_set_fields(set)
      allocate (character(len=len(row)*size(sets)) :: text)
      end_of_text = 0
      do i = 1, size(sets)
         set = sets(i)
         row = to_text(before + i)
         do j = 1, size(table%columns)
            at = len_trim(row) + 1
            if (table%columns(j) <= parameter_count) then
               write (row(at:), numbers_form) fields(table%columns(j))%real_value
            else
               row(at:) = ','//flux_choices(set%flux)
            end if
         end do
         at = len_trim(row) + 1
         if (outcomes(i)%status == set_is_fine) then
            associate (found => outcomes(i))
               write (row(at:), numbers_form) found%contact_time, found%peak_force, found%peak_floor_force, &
                  found%max_deflection, found%restitution, found%impulse, levels(:, :, i)
            end associate
            row(len_trim(row) + 1:) = ','//get_word(verdicts(i)%conforms(1))//','//get_word(verdicts(i)%conforms(2))
         else
            row(at:) = repeat(',', 6 + size(levels, 1)*force_count + force_count)
         end if
         row(len_trim(row) + 1:) = ','//trim(get_set_reason(outcomes(i)%status))//newline
         at = index(row, newline)
         text(end_of_text + 1:end_of_text + at) = row(:at)
         end_of_text = end_of_text + at
      end do
      text = text(:end_of_text)
   end subroutine get_set_rows

   !> What a status means.
   function get_set_reason(status) result(text)
      !> The status of a set.
      integer, intent(in) :: status
      !> Its meaning, with the key of the parameter that it is about.
      character(len=status_length) :: text
      type(set_type), target :: set
      type(field_type) :: fields(parameter_count)

      ! Descriptions of keys take longer than most rows.
      text = get_status_text(status, '')
      if (status <= set_range) return
      fields = get_set_fields(set)
      text = get_status_text(status, fields(max(1, min(parameter_count, status - set_range)))%key)
   end function get_set_reason

   !> A verdict in a table.
   pure function get_word(conforms) result(word)
      !> The verdict.
      logical, intent(in) :: conforms
      !> Yes or no.
      character(len=merge(3, 2, conforms)) :: word

      word = merge('yes', 'no ', conforms)
   end function get_word

end module thud_set_report
