# Cross-compiles for Linux on 64-bit ARM, and runs the tests by QEMU. On Debian, where
# `dpkg --add-architecture arm64` was done:
#   apt-get install g++-aarch64-linux-gnu qemu-user-static libhdf5-dev:arm64 libgtest-dev:arm64
# FCLIB_SYSROOT: a folder that has these libraries, if they are not installed in the system.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_C_COMPILER aarch64-linux-gnu-gcc)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
set(CMAKE_LIBRARY_ARCHITECTURE aarch64-linux-gnu)
set(CMAKE_CROSSCOMPILING_EMULATOR qemu-aarch64-static)
include(${CMAKE_CURRENT_LIST_DIR}/sysroot.cmake)
if(FCLIB_SYSROOT)
  list(APPEND CMAKE_CROSSCOMPILING_EMULATOR -L ${FCLIB_SYSROOT})
endif()
