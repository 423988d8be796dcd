# One wheel for all x86-64: the library is built for several kinds of processor, and the loader of glibc (2.33 or later)
# takes the best that fits from glibc-hwcaps beside the library, which is for all of them.
set(place thud/lib)
add_core(thud_library -march=x86-64 SHARED)
foreach(processor IN ITEMS x86-64-v3 x86-64-v4)
  set(variant "thud_${processor}")
  add_core(${variant} -march=${processor} SHARED)
  set_target_properties(${variant} PROPERTIES
    LIBRARY_OUTPUT_DIRECTORY "${CMAKE_CURRENT_BINARY_DIR}/glibc-hwcaps/${processor}")
  install(TARGETS ${variant} DESTINATION ${place}/glibc-hwcaps/${processor})
endforeach()
# The executable stands beside the library; a script of its name starts it.
set_target_properties(thud PROPERTIES INSTALL_RPATH "$ORIGIN")
install(TARGETS thud_library thud DESTINATION ${place})
install(PROGRAMS "${PROJECT_SOURCE_DIR}/driver/start_executable.sh" DESTINATION "${SKBUILD_SCRIPTS_DIR}" RENAME thud)
