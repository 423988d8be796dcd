# Installs the executable with its manual page, and the library for find_package(thud) and pkg-config.
include(CMakePackageConfigHelpers)
file(RELATIVE_PATH to_libraries "/${CMAKE_INSTALL_BINDIR}" "/${CMAKE_INSTALL_LIBDIR}")
set_target_properties(thud PROPERTIES INSTALL_RPATH "$ORIGIN/${to_libraries}")
install(TARGETS thud)
set_target_properties(thud_library PROPERTIES
  EXPORT_NAME thud
  VERSION ${PROJECT_VERSION}
  SOVERSION ${PROJECT_VERSION_MAJOR})
# Manual pages and completions of shells, if ./bootstrap has made them; thud-driver comes with the wheel.
install(DIRECTORY "${PROJECT_SOURCE_DIR}/share/" DESTINATION "${CMAKE_INSTALL_DATADIR}" OPTIONAL PATTERN "*thud-driver*" EXCLUDE)
install(TARGETS thud_library EXPORT thudTargets)
install(DIRECTORY "$<TARGET_PROPERTY:thud_library,Fortran_MODULE_DIRECTORY>/" DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}/thud")

set(package_directory "${CMAKE_INSTALL_LIBDIR}/cmake/thud")
install(EXPORT thudTargets NAMESPACE thud:: DESTINATION "${package_directory}")
configure_package_config_file("${PROJECT_SOURCE_DIR}/cmake/thudConfig.cmake.in" thudConfig.cmake
  INSTALL_DESTINATION "${package_directory}")
write_basic_package_version_file(thudConfigVersion.cmake COMPATIBILITY SameMajorVersion)
install(FILES "${CMAKE_CURRENT_BINARY_DIR}/thudConfig.cmake" "${CMAKE_CURRENT_BINARY_DIR}/thudConfigVersion.cmake"
  "${PROJECT_SOURCE_DIR}/cmake/FindFFTW.cmake"
  DESTINATION "${package_directory}")

list(JOIN LAPACK_LIBRARIES " " lapack_libraries)
list(JOIN OpenMP_Fortran_FLAGS " " openmp_flags)
# The prefix is known only when thud is installed, and may be moved.
file(RELATIVE_PATH to_prefix "/${CMAKE_INSTALL_LIBDIR}/pkgconfig" "/")
configure_file("${PROJECT_SOURCE_DIR}/cmake/thud.pc.in" thud.pc @ONLY)
install(FILES "${CMAKE_CURRENT_BINARY_DIR}/thud.pc" DESTINATION "${CMAKE_INSTALL_LIBDIR}/pkgconfig")
