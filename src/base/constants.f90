!> Constants of mathematics and acoustics, the band of records, the version and compiler of the program.
module thud_constants
   use, intrinsic :: iso_fortran_env, only: compiler_options, compiler_version, int64
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: decay_of_60_db, fast_time, get_compiler, not_a_number, pi, recorded_band, reference_pressure, version

   !> Ratio of a circle's circumference to its diameter.
   real(wp), parameter :: pi = acos(-1.0_wp)

   !> A quiet NaN: a number that is not known.
   real(wp), parameter :: not_a_number = transfer(int(z'7FF8000000000000', int64), 1.0_wp)

   !> Reference sound pressure, Pa.
   real(wp), parameter :: reference_pressure = 2.0e-5_wp

   !> Time constant of the Fast detector, s (IEC 61672-1).
   real(wp), parameter :: fast_time = 0.125_wp

   !> Natural logarithm of an energy decay of 60 dB.
   real(wp), parameter :: decay_of_60_db = 6*log(10.0_wp)

   !> Upper limit of the frequency range of force plate records, Hz (paper section 3); the standards' limits end at 707 Hz.
   real(wp), parameter :: recorded_band = 1250.0_wp

   !> Version of thud; pyproject.toml and CMakeLists.txt read it from here.
   character(len=*), parameter :: version = '1.0.0'

contains

   !> Compiler of the library and its options; a function, because a constant would hold those of the unit that uses it.
   pure function get_compiler() result(text)
      !> Name, version and options, padded with blanks.
      character(len=4000) :: text

      text = compiler_version()//', options '//compiler_options()
   end function get_compiler

end module thud_constants
