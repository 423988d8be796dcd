!> Constants of mathematics, the band of records, the version of the program.
module thud_constants
   use, intrinsic :: iso_fortran_env, only: int64
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: not_a_number, pi, recorded_band, version

   !> Ratio of a circle's circumference to its diameter.
   real(wp), parameter :: pi = acos(-1.0_wp)

   !> A quiet NaN: a number that is not known.
   real(wp), parameter :: not_a_number = transfer(int(z'7FF8000000000000', int64), 1.0_wp)

   !> Upper limit of the frequency range of force plate records, Hz (paper section 3); the standards' limits end at 707 Hz.
   real(wp), parameter :: recorded_band = 1250.0_wp

   !> Version of thud; pyproject.toml and CMakeLists.txt read it from here.
   character(len=*), parameter :: version = '1.0.0'

end module thud_constants
