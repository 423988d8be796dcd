!> Samples of a case as parameter sets of the shell model, which `thud_ensemble` computes in batches.
module thud_batch_sets
   use thud_case, only: case_type, get_active_fields, get_model_number
   use thud_column, only: column_type
   use thud_field, only: field_type
   use thud_hollow_sphere, only: flux_choices, hollow_sphere_type
   use thud_kinds, only: wp
   use thud_shell_sets, only: get_set_fields, set_type
   implicit none (type, external)
   private

   public :: fill_sets, suits_batch

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

   !> Makes the parameter sets of the shell model.
   subroutine fill_sets(case, columns, values, sets)
      !> The case, for all values that are not in the columns.
      type(case_type), intent(in), target :: case
      !> Keys in which the samples differ: [n_column].
      type(column_type), intent(in) :: columns(:)
      !> Values of the keys: [n_column, n_sample].
      real(wp), intent(in) :: values(:, :)
      !> The sets: [n_sample].
      type(set_type), intent(out) :: sets(:)
      type(set_type), target :: set
      type(field_type), allocatable :: fields(:), set_fields(:)
      integer :: index_of(size(columns))
      integer :: i, j

      set%ball = case%ball
      set%drop = case%drop
      allocate (fields, source=get_active_fields(case))
      allocate (set_fields, source=get_set_fields(set))
      ! The only other key is the choice of the flux term.
      index_of = [(findloc(set_fields%key == fields(columns(j)%field)%key, .true., dim=1), j=1, size(columns))]
      select type (model => case%models(get_model_number(case))%model)
      type is (hollow_sphere_type)
         set%flux = findloc(flux_choices == model%momentum_flux, .true., dim=1)
      end select
      do i = 1, size(sets)
         do j = 1, size(columns)
            if (index_of(j) > 0) then
               set_fields(index_of(j))%real_value = values(j, i)
            else
               set%flux = nint(values(j, i))
               ! A number that is not whole is no valid choice.
               if (abs(values(j, i) - set%flux) > 0.0_wp) set%flux = 0
            end if
         end do
         sets(i) = set
      end do
   end subroutine fill_sets

end module thud_batch_sets
