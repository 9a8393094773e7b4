#!/bin/sh
# Makes what a wheel carries: a static HDF5 with nothing but deflate in it, a static METIS, Eigen where
# the system has none, and their licences.
#
#   sh scripts/wheel-libraries.sh FOLDER    then build with -DFCLIB_BUNDLED=FOLDER
#
# The sources are downloaded, and checked; or HDF5_SOURCE, METIS_SOURCE and EIGEN_SOURCE name folders
# of them.
set -eu
[ $# -eq 1 ] || { echo "usage: $0 FOLDER" >&2; exit 2; }
mkdir -p "$1"
prefix=$(cd "$1" && pwd)
HDF5=1.14.6
HDF5_SHA256=e4defbac30f50d64e1556374aa49e574417c9e72c6b1de7a4ff88c4b1bea6e9b
METIS=5.1.0
METIS_SHA256=76faebe03f6c963127dbb73c13eab58c9a3faeae48779f049066a21c087c5db2
EIGEN=3.4.0
EIGEN_SHA256=8586084f71f9bde545ee7fa6d00288b264a2b7ac3607b974e54d13e7162c1c72

if [ -f "$prefix/done" ] && [ -f "$prefix/lib/libmetis.a" ]; then
  echo "== HDF5, METIS and Eigen for the wheel: there already, in $prefix"
  exit 0
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# fetch NAME VERSION URL SHA256: its sources, in $work/NAME
fetch() {
  echo "== downloading $1 $2"
  archive=$work/$1.tar.gz
  curl --fail --location --silent --show-error --retry 3 --output "$archive" "$3" || {
    variable=$(echo "$1" | tr '[:lower:]' '[:upper:]')_SOURCE
    echo "$1 cannot be downloaded. Unpack its sources, and name their folder:" >&2
    echo "  make wheel $variable=FOLDER    (on Debian, those of apt-get source $1)" >&2
    exit 1
  }
  if command -v sha256sum >/dev/null; then sum=$(sha256sum "$archive"); else sum=$(shasum -a 256 "$archive"); fi
  [ "${sum%% *}" = "$4" ] || { echo "$1: the SHA-256 of $3 is ${sum%% *}, expected $4" >&2; exit 1; }
  mkdir "$work/$1"
  tar -xzf "$archive" -C "$work/$1" --strip-components 1
}

if [ -z "${HDF5_SOURCE:-}" ]; then
  fetch hdf5 $HDF5 \
    https://github.com/HDFGroup/hdf5/releases/download/hdf5_$HDF5/hdf5-$HDF5.tar.gz $HDF5_SHA256
  HDF5_SOURCE=$work/hdf5
fi
[ -f "$HDF5_SOURCE/COPYING" ] || { echo "HDF5_SOURCE: $HDF5_SOURCE has no COPYING of HDF5" >&2; exit 1; }
# hidden: the symbols of a static HDF5 have the visibility that the compiler gives
mkdir "$work/build"
( cd "$work/build"; cmake "$HDF5_SOURCE" -DCMAKE_INSTALL_PREFIX="$prefix" -DCMAKE_BUILD_TYPE=Release \
  -DCMAKE_INSTALL_LIBDIR=lib -DHDF5_INSTALL_LIB_DIR=lib \
  -DCMAKE_POSITION_INDEPENDENT_CODE=ON -DCMAKE_C_VISIBILITY_PRESET=hidden -DCMAKE_C_FLAGS=-w \
  -DBUILD_SHARED_LIBS=OFF -DBUILD_TESTING=OFF -DHDF5_BUILD_TOOLS=OFF -DHDF5_BUILD_EXAMPLES=OFF \
  -DHDF5_BUILD_HL_LIB=OFF -DHDF5_BUILD_CPP_LIB=OFF -DHDF5_BUILD_FORTRAN=OFF -DHDF5_BUILD_JAVA=OFF \
  -DHDF5_BUILD_UTILS=OFF -DHDF5_ENABLE_Z_LIB_SUPPORT=ON -DHDF5_ENABLE_SZIP_SUPPORT=OFF \
  -DHDF5_ENABLE_THREADSAFE=OFF ) >"$work/log" 2>&1 || { tail -30 "$work/log" >&2; exit 1; }
echo "== building HDF5"
cmake --build "$work/build" --parallel "${JOBS:-2}" >"$work/log" 2>&1 || { tail -30 "$work/log" >&2; exit 1; }
cmake --install "$work/build" >"$work/log" 2>&1 || { tail -30 "$work/log" >&2; exit 1; }
mkdir -p "$prefix/licenses"
cp "$HDF5_SOURCE/COPYING" "$prefix/licenses/HDF5"

if [ -z "${METIS_SOURCE:-}" ]; then
  fetch metis $METIS \
    https://karypis.github.io/glaros/files/sw/metis/metis-$METIS.tar.gz $METIS_SHA256
  METIS_SOURCE=$work/metis
fi
[ -f "$METIS_SOURCE/libmetis/ometis.c" ] || { echo "METIS_SOURCE: $METIS_SOURCE is no METIS 5.1" >&2; exit 1; }
echo "== building METIS"
# not by its own CMakeLists.txt, which a recent CMake refuses, and which builds programs too
mkdir "$work/metis-build"
cat >"$work/metis-build/CMakeLists.txt" <<'END'
cmake_minimum_required(VERSION 3.18)
project(metis C)
file(GLOB sources ${METIS_SOURCE}/GKlib/*.c ${METIS_SOURCE}/libmetis/*.c)
add_library(metis STATIC ${sources})
target_include_directories(metis PRIVATE ${METIS_SOURCE}/GKlib ${METIS_SOURCE}/include ${METIS_SOURCE}/libmetis)
target_compile_definitions(metis PRIVATE _GNU_SOURCE LINUX HAVE_GETLINE HAVE_THREADLOCALSTORAGE NDEBUG NDEBUG2)
set_target_properties(metis PROPERTIES C_STANDARD 99 C_EXTENSIONS ON C_VISIBILITY_PRESET hidden
                      POSITION_INDEPENDENT_CODE ON)
install(TARGETS metis ARCHIVE DESTINATION lib)
install(FILES ${METIS_SOURCE}/include/metis.h DESTINATION include)
END
metis=$(cd "$METIS_SOURCE" && pwd)
( cd "$work/metis-build"; mkdir build; cd build; cmake .. -DMETIS_SOURCE="$metis" \
  -DCMAKE_INSTALL_PREFIX="$prefix" -DCMAKE_BUILD_TYPE=Release -DCMAKE_C_FLAGS=-w &&
  cmake --build . --parallel "${JOBS:-2}" && cmake --install . ) >"$work/log" 2>&1 ||
  { tail -30 "$work/log" >&2; exit 1; }
cp "$METIS_SOURCE/LICENSE.txt" "$prefix/licenses/METIS"

if [ -z "${EIGEN_SOURCE:-}" ] && [ -f /usr/share/doc/libeigen3-dev/copyright ]; then
  cp /usr/share/doc/libeigen3-dev/copyright "$prefix/licenses/Eigen"
else
  if [ -z "${EIGEN_SOURCE:-}" ]; then
    fetch eigen $EIGEN \
      https://gitlab.com/libeigen/eigen/-/archive/$EIGEN/eigen-$EIGEN.tar.gz $EIGEN_SHA256
    EIGEN_SOURCE=$work/eigen
  fi
  cmake -S "$EIGEN_SOURCE" -B "$work/eigen-build" -DCMAKE_INSTALL_PREFIX="$prefix" \
    -DBUILD_TESTING=OFF -DEIGEN_BUILD_DOC=OFF >"$work/log" 2>&1 || { tail -30 "$work/log" >&2; exit 1; }
  cmake --install "$work/eigen-build" >"$work/log" 2>&1 || { tail -30 "$work/log" >&2; exit 1; }
  cp "$EIGEN_SOURCE/COPYING.MPL2" "$prefix/licenses/Eigen"
fi
touch "$prefix/done"
