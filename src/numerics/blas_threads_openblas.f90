!> Number of threads of OpenBLAS. The matrices here are small: more threads would cost more than they save, and with several
!> calling threads they would overload the processor.
module thud_blas_threads
   use, intrinsic :: iso_c_binding, only: c_int
   implicit none (type, external)
   private

   public :: restore_blas_threads, use_one_blas_thread

   !> Number of callers that use one thread now.
   integer :: n_caller = 0
   !> Number of threads before the first of them.
   integer(c_int) :: count_before = 1_c_int

   interface
      subroutine openblas_set_num_threads(count) bind(c, name='openblas_set_num_threads')
         import :: c_int
         implicit none (type, external)
         integer(c_int), value :: count
      end subroutine openblas_set_num_threads

      function openblas_get_num_threads() bind(c, name='openblas_get_num_threads') result(count)
         import :: c_int
         implicit none (type, external)
         integer(c_int) :: count
      end function openblas_get_num_threads
   end interface

contains

   !> Limits OpenBLAS to the calling thread, in the whole process, until `restore_blas_threads`: every call of the library
   !> does so, because the number of threads changes the last digits of results.
   subroutine use_one_blas_thread()
      !$omp critical (blas_threads)
      if (n_caller == 0) then
         count_before = openblas_get_num_threads()
         call openblas_set_num_threads(1_c_int)
      end if
      n_caller = n_caller + 1
      !$omp end critical (blas_threads)
   end subroutine use_one_blas_thread

   !> Ends `use_one_blas_thread`; after the last caller, the process has its former number of threads.
   subroutine restore_blas_threads()
      !$omp critical (blas_threads)
      n_caller = n_caller - 1
      if (n_caller == 0) call openblas_set_num_threads(count_before)
      !$omp end critical (blas_threads)
   end subroutine restore_blas_threads

end module thud_blas_threads
