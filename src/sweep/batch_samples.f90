!> Converts samples of a case into samples of the shell model, which `thud_ensemble` computes in batches.
module thud_batch_samples
   use thud_case, only: case_type, get_active_fields, get_model_number
   use thud_column, only: column_type
   use thud_error, only: error_type
   use thud_field, only: field_type
   use thud_hollow_sphere, only: flux_choices, hollow_sphere_type
   use thud_kinds, only: wp
   use thud_shell_samples, only: get_sample_fields, sample_type
   implicit none (type, external)
   private

   public :: fill_samples, suits_batch

contains

   !> Whether samples can be computed in batches: the case has the shell model, exact levels and no floor, and the samples
   !> differ only in ball, drop and options of the model.
   function suits_batch(case, columns) result(suits)
      type(case_type), intent(in), target :: case
      !> Keys in which the samples differ: [n_column].
      type(column_type), intent(in) :: columns(:)
      logical :: suits
      type(field_type), allocatable :: fields(:)
      integer :: i

      suits = .false.
      select type (model => case%models(get_model_number(case))%model)
      type is (hollow_sphere_type)
         allocate (fields, source=get_active_fields(case))
         fields = fields(columns%field)
         suits = case%level_method == 'exact' .and. .not. case%has_floor .and. all([(fields(i)%group == 'ball' &
            .or. fields(i)%group == 'drop' .or. fields(i)%owner == case%model, i=1, size(fields))])
      end select
   end function suits_batch

   !> Makes the samples of the shell model.
   subroutine fill_samples(case, columns, values, samples)
      !> The case, for all values that are not in the columns.
      type(case_type), intent(in), target :: case
      !> Keys in which the samples differ: [n_column].
      type(column_type), intent(in) :: columns(:)
      !> Values of the keys: [n_column, n_sample].
      real(wp), intent(in) :: values(:, :)
      !> The samples: [n_sample].
      type(sample_type), intent(out) :: samples(:)
      type(sample_type), target :: sample
      type(error_type), allocatable :: error
      type(field_type), allocatable :: fields(:), sample_fields(:)
      integer :: index_of(size(columns))
      integer :: i, j

      sample%ball = case%ball
      sample%drop = case%drop
      allocate (fields, source=get_active_fields(case))
      allocate (sample_fields, source=get_sample_fields(sample))
      ! The only other key is the choice of the flux term.
      index_of = [(findloc(sample_fields%key == fields(columns(j)%field)%key, .true., dim=1), j=1, size(columns))]
      select type (model => case%models(get_model_number(case))%model)
      type is (hollow_sphere_type)
         sample%flux = findloc(flux_choices == model%momentum_flux, .true., dim=1)
      end select
      do i = 1, size(samples)
         do j = 1, size(columns)
            if (index_of(j) > 0) then
               call sample_fields(index_of(j))%set_number(values(j, i), 0, error)
            else
               sample%flux = nint(values(j, i))
               ! A number that is not whole is no valid choice.
               if (abs(values(j, i) - sample%flux) > 0.0_wp) sample%flux = 0
            end if
         end do
         samples(i) = sample
      end do
   end subroutine fill_samples

end module thud_batch_samples
