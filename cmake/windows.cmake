# Toolchain: builds for Windows on Debian with its cross compilers. THUD_WINDOWS_LIBRARIES has OpenBLAS and FFTW for Windows
# in lib, and the Fortran interface of FFTW in include.
set(CMAKE_SYSTEM_NAME Windows)
set(CMAKE_SYSTEM_PROCESSOR AMD64)
# Of the two kinds of threads of this compiler, OpenMP has those of POSIX.
set(CMAKE_C_COMPILER x86_64-w64-mingw32-gcc-posix)
set(CMAKE_Fortran_COMPILER x86_64-w64-mingw32-gfortran-posix)
set(CMAKE_RC_COMPILER x86_64-w64-mingw32-windres)
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_EXE_LINKER_FLAGS_INIT -static)
set(CMAKE_MODULE_LINKER_FLAGS_INIT -static)
set(CMAKE_TRY_COMPILE_PLATFORM_VARIABLES THUD_WINDOWS_LIBRARIES)
set(CMAKE_PREFIX_PATH "${THUD_WINDOWS_LIBRARIES}")
set(BLA_VENDOR OpenBLAS)
# The linker takes a library itself in place of a list of its names.
set(FFTW_LIBRARY "${THUD_WINDOWS_LIBRARIES}/lib/libfftw3-3.dll")
set(PKG_CONFIG_EXECUTABLE "")
# All libraries of the compiler are part of the program.
execute_process(COMMAND "${CMAKE_Fortran_COMPILER}" -print-file-name=libgomp.a
  OUTPUT_VARIABLE OpenMP_gomp_LIBRARY OUTPUT_STRIP_TRAILING_WHITESPACE)
set(CMAKE_CROSSCOMPILING_EMULATOR wine)
# Headers and library of the Python whose extension is built; f2py runs by the Python of this machine.
if(THUD_WINDOWS_PYTHON)
  set(Python_INCLUDE_DIR "${THUD_WINDOWS_PYTHON}/include")
  file(GLOB Python_LIBRARY "${THUD_WINDOWS_PYTHON}/libs/python3?*.lib")
  set(Python_NumPy_INCLUDE_DIR "${THUD_WINDOWS_LIBRARIES}/include")
endif()
