# `make deb`: the C library as Debian packages, libfclib0 and libfclib-dev. They bear the names of
# those of libfclib 3.1, and take their place.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_VENDOR "")
set(CPACK_PACKAGE_VERSION ${FCLIB_C_VERSION})
set(CPACK_PACKAGE_CONTACT "the authors of fclib")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_COMPONENTS_ALL library development)
set(CPACK_COMPONENTS_GROUPING IGNORE)
set(CPACK_STRIP_FILES ON)

set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_PRIORITY optional)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)

set(CPACK_DEBIAN_LIBRARY_PACKAGE_NAME libfclib0)
set(CPACK_DEBIAN_LIBRARY_PACKAGE_SECTION libs)
set(CPACK_DEBIAN_LIBRARY_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_LIBRARY_PACKAGE_GENERATE_SHLIBS ON)
set(CPACK_COMPONENT_LIBRARY_DESCRIPTION
    "frictional contact problems in HDF5 files, and their solvers
A drop-in for libfclib 3.1: reads, writes, validates, judges and solves frictional contact problems.")

set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libfclib-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS "libfclib0 (= ${FCLIB_C_VERSION})")
set(CPACK_COMPONENT_DEVELOPMENT_DESCRIPTION
    "frictional contact problems in HDF5 files, development files
Header, Fortran module, and what find_package and pkg-config read.")

install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/libfclib0 RENAME copyright
        COMPONENT library)
install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/libfclib-dev RENAME copyright
        COMPONENT development)
include(CPack)
