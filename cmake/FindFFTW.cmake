# Finds FFTW 3 in double precision with its Fortran 2003 interface.
# Result: target FFTW::FFTW, variables FFTW_FOUND and FFTW_VERSION.
find_package(PkgConfig QUIET)
if(PkgConfig_FOUND)
  pkg_check_modules(PC_FFTW QUIET fftw3)
  set(FFTW_VERSION "${PC_FFTW_VERSION}")
endif()
find_path(FFTW_INCLUDE_DIR fftw3.f03 HINTS ${PC_FFTW_INCLUDE_DIRS})
find_library(FFTW_LIBRARY fftw3 HINTS ${PC_FFTW_LIBRARY_DIRS})

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(FFTW REQUIRED_VARS FFTW_LIBRARY FFTW_INCLUDE_DIR VERSION_VAR FFTW_VERSION)
mark_as_advanced(FFTW_INCLUDE_DIR FFTW_LIBRARY)

if(FFTW_FOUND AND NOT TARGET FFTW::FFTW)
  add_library(FFTW::FFTW UNKNOWN IMPORTED)
  set_target_properties(FFTW::FFTW PROPERTIES IMPORTED_LOCATION "${FFTW_LIBRARY}")
  # As an option and not as an include directory: CMake drops -I/usr/include, which only C
  # compilers search by themselves.
  set_property(TARGET FFTW::FFTW PROPERTY INTERFACE_COMPILE_OPTIONS
    "$<$<COMPILE_LANGUAGE:Fortran>:-I${FFTW_INCLUDE_DIR}>")
endif()
