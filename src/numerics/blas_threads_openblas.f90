!> Threads of OpenBLAS. The matrices here are small: its threads would cost more than they bring,
!> and with several calling threads they would crowd the processor.
module thud_blas_threads
   use, intrinsic :: iso_c_binding, only: c_int
   implicit none (type, external)
   private

   public :: use_one_blas_thread

   interface
      subroutine openblas_set_num_threads(count) bind(c, name='openblas_set_num_threads')
         import :: c_int
         implicit none (type, external)
         integer(c_int), value :: count
      end subroutine openblas_set_num_threads
   end interface

contains

   !> Makes OpenBLAS work in the calling thread, for the whole process.
   subroutine use_one_blas_thread()
      call openblas_set_num_threads(1_c_int)
   end subroutine use_one_blas_thread

end module thud_blas_threads
