# add_pfunit_ctest for machines without pFUnit: see tests/funit/README.md.
find_package(Python 3.11 REQUIRED COMPONENTS Interpreter)
set(funit_directory "${PROJECT_SOURCE_DIR}/tests/funit")

add_library(funit_stand_in STATIC "${funit_directory}/funit.f90")
set_target_properties(funit_stand_in PROPERTIES Fortran_MODULE_DIRECTORY "${CMAKE_CURRENT_BINARY_DIR}/funit")
target_include_directories(funit_stand_in PUBLIC "${CMAKE_CURRENT_BINARY_DIR}/funit")

# The arguments are those of pFUnit's function that the suites of thud use.
function(add_pfunit_ctest name)
  cmake_parse_arguments(suite "" "WORKING_DIRECTORY" "TEST_SOURCES;LINK_LIBRARIES" ${ARGN})
  set(directory "${CMAKE_CURRENT_BINARY_DIR}/${name}.dir")
  file(MAKE_DIRECTORY "${directory}")
  foreach(source IN LISTS suite_TEST_SOURCES)
    cmake_path(GET source STEM stem)
    list(APPEND generated "${directory}/${stem}.F90")
    list(APPEND sources "${CMAKE_CURRENT_SOURCE_DIR}/${source}")
  endforeach()
  add_custom_command(
    OUTPUT "${directory}/driver.f90" ${generated}
    COMMAND "${Python_EXECUTABLE}" "${funit_directory}/preprocess.py" "${directory}/driver.f90" ${sources}
    DEPENDS ${sources} "${funit_directory}/preprocess.py"
    COMMENT "Preprocessing ${name}"
    VERBATIM)
  add_executable(${name} ${generated} "${directory}/driver.f90")
  set_target_properties(${name} PROPERTIES Fortran_MODULE_DIRECTORY "${directory}")
  target_link_libraries(${name} PRIVATE ${suite_LINK_LIBRARIES} funit_stand_in)
  if(NOT suite_WORKING_DIRECTORY)
    set(suite_WORKING_DIRECTORY "${CMAKE_CURRENT_BINARY_DIR}")
  endif()
  add_test(NAME ${name} COMMAND ${name} WORKING_DIRECTORY "${suite_WORKING_DIRECTORY}")
endfunction()
