# add_f2py_extension(name sources... MAP file): an extension of Python, by f2py, of Fortran sources of this directory.
find_package(Python 3.11 REQUIRED COMPONENTS Interpreter Development.Module NumPy)

# scikit-build-core puts the helpers of f2py-cmake on the module path; a plain build asks Python.
execute_process(
  COMMAND "${Python_EXECUTABLE}" -c "import f2py_cmake, pathlib; print(pathlib.Path(f2py_cmake.__file__).parent / 'cmake')"
  OUTPUT_VARIABLE f2py_cmake_directory OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
list(APPEND CMAKE_MODULE_PATH "${f2py_cmake_directory}")
include(UseF2Py)

# f2py splits paths at blanks, so that f2py_add_module, which passes whole paths, works in few directories. Here f2py
# runs on copies in its working directory, by their names.
function(add_f2py_extension name)
  cmake_parse_arguments(PARSE_ARGV 1 f2py "" "MAP" "")
  set(sources ${f2py_UNPARSED_ARGUMENTS})
  set(inputs ${sources} ${f2py_MAP})
  list(TRANSFORM inputs PREPEND "${CMAKE_CURRENT_SOURCE_DIR}/")
  set(wrappers "${name}-f2pywrappers.f" "${name}-f2pywrappers2.f90")
  # Without the map f2py would take the kind wp, which it cannot look up, for a C float.
  add_custom_command(
    OUTPUT "${name}module.c" ${wrappers}
    DEPENDS ${inputs}
    COMMAND "${CMAKE_COMMAND}" -E copy ${inputs} "${CMAKE_CURRENT_BINARY_DIR}"
    COMMAND "${Python_EXECUTABLE}" -m numpy.f2py ${sources} -m "${name}" --lower --f2cmap "${f2py_MAP}" --quiet
      --freethreading-compatible
    # f2py writes those that it needs.
    COMMAND "${CMAKE_COMMAND}" -E touch ${wrappers}
    COMMENT "Wrapping ${name} by f2py"
    VERBATIM)
  Python_add_library(${name} MODULE WITH_SOABI "${name}module.c" ${wrappers} ${sources})
  f2py_object_library(${name}_f2py OBJECT)
  target_link_libraries(${name} PRIVATE ${name}_f2py)
endfunction()
