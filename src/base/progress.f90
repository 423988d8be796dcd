!> Progress of long work: the library reports it, its caller may show it.
module thud_progress
   !$ use omp_lib, only: omp_get_thread_num
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: report_progress, show_progress

   abstract interface
      !> Shows the progress.
      subroutine handler(done, whole, unit)
         import :: wp
         implicit none (type, external)
         !> Amount of work done.
         real(wp), intent(in) :: done
         !> Upper bound of the total amount; 0 if unknown.
         real(wp), intent(in) :: whole
         character(len=*), intent(in) :: unit
      end subroutine handler
   end interface

   !> Procedure that shows the progress; null unless the executable or the driver sets it.
   procedure(handler), pointer :: show_progress => null()

contains

   !> Reports the progress.
   subroutine report_progress(done, whole, unit)
      !> Amount of work done.
      real(wp), intent(in) :: done
      !> Upper bound of the total amount; 0 if unknown.
      real(wp), intent(in) :: whole
      character(len=*), intent(in) :: unit
      procedure(handler), pointer :: current

      ! Of drops that are computed in parallel one reports.
      !$ if (omp_get_thread_num() > 0) return
      ! Another thread may change it meanwhile.
      current => show_progress
      if (associated(current)) call current(done, whole, unit)
   end subroutine report_progress

end module thud_progress
