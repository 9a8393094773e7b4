# Compiles for Linux on 32-bit x86 with SSE2, whose programs 64-bit x86 runs. On Debian, where
# `dpkg --add-architecture i386` was done:
#   apt-get install g++-multilib libhdf5-dev:i386 libgtest-dev:i386
# FCLIB_SYSROOT: a folder that has these libraries, if they are not installed in the system.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR i686)
set(CMAKE_C_FLAGS_INIT -m32)
set(CMAKE_CXX_FLAGS_INIT -m32)
set(CMAKE_LIBRARY_ARCHITECTURE i386-linux-gnu)
include(${CMAKE_CURRENT_LIST_DIR}/sysroot.cmake)
if(FCLIB_SYSROOT)
  set(CMAKE_CROSSCOMPILING_EMULATOR
      ${FCLIB_SYSROOT}/lib/ld-linux.so.2 --library-path
      ${FCLIB_SYSROOT}/lib/i386-linux-gnu:${FCLIB_SYSROOT}/usr/lib/i386-linux-gnu)
endif()
