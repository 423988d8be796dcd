!> Threads of a BLAS other than OpenBLAS: it keeps its own ways.
module thud_blas_threads
   implicit none (type, external)
   private

   public :: use_one_blas_thread

contains

   !> Nothing to be done.
   subroutine use_one_blas_thread()
   end subroutine use_one_blas_thread

end module thud_blas_threads
