!> Reports on long work. The library only tells how far it is; who runs it may show that.
module thud_progress
   !$ use omp_lib, only: omp_in_parallel
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: report_progress, set_progress_handler

   abstract interface
      !> Shows how far the work is.
      subroutine handler(done, whole, unit)
         import :: wp
         implicit none (type, external)
         !> How much has been computed.
         real(wp), intent(in) :: done
         !> How much there is to compute at most; 0 where nobody knows.
         real(wp), intent(in) :: whole
         !> What is counted.
         character(len=*), intent(in) :: unit
      end subroutine handler
   end interface

   !> Who shows it; nobody unless the executable or the driver asks for it.
   procedure(handler), pointer :: show => null()

contains

   !> Says who shows the progress from now on.
   subroutine set_progress_handler(new_handler)
      !> The procedure; without it, nobody.
      procedure(handler), optional :: new_handler

      show => null()
      if (present(new_handler)) show => new_handler
   end subroutine set_progress_handler

   !> Tells how far the work is.
   subroutine report_progress(done, whole, unit)
      !> How much has been computed.
      real(wp), intent(in) :: done
      !> How much there is to compute at most; 0 where nobody knows.
      real(wp), intent(in) :: whole
      !> What is counted.
      character(len=*), intent(in) :: unit

      procedure(handler), pointer :: current

      ! Of many drops that are computed at once none tells how far it is.
      !$ if (omp_in_parallel()) return
      ! Another thread may change it meanwhile.
      current => show
      if (associated(current)) call current(done, whole, unit)
   end subroutine report_progress

end module thud_progress
