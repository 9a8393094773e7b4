# For a toolchain of another processor, which sets CMAKE_LIBRARY_ARCHITECTURE before: finds its libraries
# in the system, as Debian has them, or in the folder FCLIB_SYSROOT.
set(FCLIB_SYSROOT "" CACHE PATH "Folder of the libraries for the other processor")
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES FCLIB_SYSROOT)
# packages of the other processor; programs, and headers alone such as Eigen, are of this machine
list(PREPEND CMAKE_FIND_ROOT_PATH ${FCLIB_SYSROOT})
set(fclib_other ${FCLIB_SYSROOT}/usr/lib/${CMAKE_LIBRARY_ARCHITECTURE})
list(PREPEND CMAKE_LIBRARY_PATH ${fclib_other} ${fclib_other}/hdf5/serial)
list(PREPEND CMAKE_INCLUDE_PATH ${FCLIB_SYSROOT}/usr/include ${FCLIB_SYSROOT}/usr/include/hdf5/serial)
list(PREPEND CMAKE_PREFIX_PATH ${FCLIB_SYSROOT}/usr)
if(FCLIB_SYSROOT)
  add_link_options(-Wl,-rpath-link,${fclib_other}:${FCLIB_SYSROOT}/lib/${CMAKE_LIBRARY_ARCHITECTURE})
endif()
# the h5cc of this machine knows the libraries of this machine alone
set(HDF5_C_COMPILER_EXECUTABLE /bin/false CACHE FILEPATH "" FORCE)
