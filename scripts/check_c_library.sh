#!/bin/sh
# Tries an installed C library as its users will: a program built by pkg-config and by find_package
# writes a file, another solves it.
#
#   sh scripts/check_c_library.sh PREFIX     PREFIX/lib, or PREFIX/lib/ARCHITECTURE, has the library
set -eu
prefix=$(cd "$1" && pwd)
source=$(cd "$(dirname "$0")/.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
pc=$(find "$prefix" -name fclib.pc)
[ -n "$pc" ] || { echo "$prefix has no fclib.pc" >&2; exit 1; }
libraries=$(dirname "$(dirname "$pc")")
static=
[ -e "$libraries/libfclib.so" ] || [ -e "$libraries/libfclib.dylib" ] || static=--static
export PKG_CONFIG_PATH="$(dirname "$pc")${PKG_CONFIG_PATH:+:$PKG_CONFIG_PATH}"
export LD_LIBRARY_PATH="$libraries${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}"
export DYLD_LIBRARY_PATH="$libraries${DYLD_LIBRARY_PATH:+:$DYLD_LIBRARY_PATH}"  # of macOS

for program in write solve; do
  # shellcheck disable=SC2046
  ${CC:-cc} "$source/examples/c/$program.c" -o "$work/$program" $(pkg-config $static --cflags --libs fclib) -lm
done
"$work/write" "$work/ball.hdf5"
"$work/solve" "$work/ball.hdf5" | grep -q converged
echo "pkg-config $static fclib: a program is built and runs"

cat >"$work/CMakeLists.txt" <<CMAKE
cmake_minimum_required(VERSION 3.16)
project(client C)
find_package(fclib 3.1 REQUIRED)
add_executable(by-cmake "$source/examples/c/solve.c")
target_link_libraries(by-cmake fclib::fclib)
CMAKE
cmake -S "$work" -B "$work/build" -DCMAKE_PREFIX_PATH="$prefix" >"$work/log" 2>&1 &&
  cmake --build "$work/build" >"$work/log" 2>&1 || { cat "$work/log" >&2; exit 1; }
"$work/build/by-cmake" "$work/ball.hdf5" | grep -q converged
echo "find_package(fclib): a program is built and runs"
