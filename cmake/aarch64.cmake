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
set(FCLIB_SYSROOT "" CACHE PATH "Folder of the libraries for the other processor")
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES FCLIB_SYSROOT)
if(FCLIB_SYSROOT)
  list(APPEND CMAKE_CROSSCOMPILING_EMULATOR -L ${FCLIB_SYSROOT})
endif()
# packages of the other processor; programs, and headers alone such as Eigen, are of this machine
list(PREPEND CMAKE_FIND_ROOT_PATH ${FCLIB_SYSROOT})
list(PREPEND CMAKE_LIBRARY_PATH ${FCLIB_SYSROOT}/usr/lib/aarch64-linux-gnu
     ${FCLIB_SYSROOT}/usr/lib/aarch64-linux-gnu/hdf5/serial)
list(PREPEND CMAKE_INCLUDE_PATH ${FCLIB_SYSROOT}/usr/include ${FCLIB_SYSROOT}/usr/include/hdf5/serial)
list(PREPEND CMAKE_PREFIX_PATH ${FCLIB_SYSROOT}/usr)
if(FCLIB_SYSROOT)
  add_link_options(-Wl,-rpath-link,${FCLIB_SYSROOT}/usr/lib/aarch64-linux-gnu)
endif()
# the h5cc of this machine knows the libraries of this machine alone
set(HDF5_C_COMPILER_EXECUTABLE /bin/false CACHE FILEPATH "" FORCE)
