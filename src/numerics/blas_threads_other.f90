!> Threads of a BLAS other than OpenBLAS: it manages its own threads.
module thud_blas_threads
   implicit none (type, external)
   private

   public :: restore_blas_threads, use_one_blas_thread

contains

   !> Does nothing.
   subroutine use_one_blas_thread()
   end subroutine use_one_blas_thread

   !> Does nothing.
   subroutine restore_blas_threads()
   end subroutine restore_blas_threads

end module thud_blas_threads
