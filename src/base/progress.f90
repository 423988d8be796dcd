!> Progress of long work: the library reports it, its caller may show it.
module thud_progress
   !$ use omp_lib, only: omp_in_parallel
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: latest_progress, report_progress, set_progress_handler

   abstract interface
      !> Shows how far the work is.
      subroutine handler(done, whole, unit)
         import :: wp
         implicit none (type, external)
         !> How much has been computed.
         real(wp), intent(in) :: done
         !> Upper bound of the whole; 0 where unknown.
         real(wp), intent(in) :: whole
         character(len=*), intent(in) :: unit
      end subroutine handler
   end interface

   !> Fraction of the latest report of this process that is done, 0 to 1; other threads may ask.
   real(wp), volatile, protected :: latest_progress = 0.0_wp

   !> Procedure that shows it; none unless the executable or the driver sets one.
   procedure(handler), pointer :: show => null()

contains

   !> Sets the procedure that shows the progress.
   subroutine set_progress_handler(new_handler)
      !> The procedure; absent for none.
      procedure(handler), optional :: new_handler

      show => null()
      if (present(new_handler)) show => new_handler
   end subroutine set_progress_handler

   !> Reports how far the work is.
   subroutine report_progress(done, whole, unit)
      !> How much has been computed.
      real(wp), intent(in) :: done
      !> Upper bound of the whole; 0 where unknown.
      real(wp), intent(in) :: whole
      character(len=*), intent(in) :: unit

      procedure(handler), pointer :: current

      ! Drops that are computed in parallel do not report.
      !$ if (omp_in_parallel()) return
      latest_progress = 0.0_wp
      if (whole > 0.0_wp) latest_progress = min(1.0_wp, done/whole)
      ! Another thread may change it meanwhile.
      current => show
      if (associated(current)) call current(done, whole, unit)
   end subroutine report_progress

end module thud_progress
