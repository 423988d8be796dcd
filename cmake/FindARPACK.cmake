# Finds ARPACK-NG, its LAPACK-free part only: LAPACK is linked by name.
# Result: target ARPACK::ARPACK, variables ARPACK_FOUND and ARPACK_VERSION.
find_package(PkgConfig QUIET)
if(PkgConfig_FOUND)
  pkg_check_modules(PC_ARPACK QUIET arpack)
  set(ARPACK_VERSION "${PC_ARPACK_VERSION}")
endif()
find_library(ARPACK_LIBRARY arpack HINTS ${PC_ARPACK_LIBRARY_DIRS})

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(ARPACK REQUIRED_VARS ARPACK_LIBRARY VERSION_VAR ARPACK_VERSION)
mark_as_advanced(ARPACK_LIBRARY)

if(ARPACK_FOUND AND NOT TARGET ARPACK::ARPACK)
  add_library(ARPACK::ARPACK UNKNOWN IMPORTED)
  set_target_properties(ARPACK::ARPACK PROPERTIES IMPORTED_LOCATION "${ARPACK_LIBRARY}")
endif()
