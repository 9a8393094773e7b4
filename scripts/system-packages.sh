#!/bin/sh
# Installs the system packages that building needs: by apt where there is one, else it says which.
# With the argument `test` also those that the tests use where they are there.
set -eu
PYTHON=${PYTHON:-python3}

missing=
optional=
need() { # need PACKAGE COMMAND...: COMMAND succeeds where the package is there
  package=$1
  shift
  "$@" >/dev/null 2>&1 || missing="$missing $package"
}

need g++ sh -c 'command -v ${CXX:-c++}'
need cmake cmake --version
need ninja-build ninja --version
need pkg-config pkg-config --version
need python3 "$PYTHON" -c 'import sys; sys.exit(sys.version_info < (3, 10))'
need python3-venv "$PYTHON" -c 'import ensurepip, venv'
need python3-dev "$PYTHON" -c 'import os, sysconfig as s; os.stat(s.get_path("include") + "/Python.h")'
need libhdf5-dev sh -c 'pkg-config --exists hdf5 || ls /usr/include/hdf5.h /usr/local/include/hdf5.h'
need libeigen3-dev sh -c 'pkg-config --exists eigen3 || ls /usr/include/eigen3/Eigen/Core'
need libgtest-dev sh -c 'pkg-config --exists gtest || ls /usr/include/gtest/gtest.h'

# orders large factorisations, which go without where it is not
ls /usr/include/metis.h /usr/local/include/metis.h 2>/dev/null | grep -q . || optional=" libmetis-dev"

# packs and unpacks the arrays of files, in a part of the time that zlib takes
ls /usr/include/libdeflate.h /usr/local/include/libdeflate.h 2>/dev/null | grep -q . || optional="$optional libdeflate-dev"

# draws the picture of the demo, which goes without where it is not; ldconfig is not on every PATH
if ! { PATH="$PATH:/sbin:/usr/sbin" ldconfig -p 2>/dev/null || true; } | grep -qE 'libOSMesa|libEGL'; then optional="$optional libosmesa6"; fi
# shows the report's pages to the tests, at a quarter of what the whole browser takes
if [ "${1-}" = test ] && ! command -v chromium-headless-shell >/dev/null 2>&1; then
  optional="$optional chromium-headless-shell"
fi
# makes the module for browsers, and Node runs it (make wasm)
if [ "${1-}" = test ] && ! { command -v emcmake && command -v node; } >/dev/null 2>&1; then
  optional="$optional emscripten"
fi
# what the C library is compared with: libfclib 3.1, its own recorded interface, and no lost memory
if [ "${1-}" = test ]; then
  ls /usr/include/fclib.h >/dev/null 2>&1 || optional="$optional libfclib-dev"
  command -v abidiff >/dev/null 2>&1 || optional="$optional abigail-tools"
  command -v valgrind >/dev/null 2>&1 || optional="$optional valgrind"
fi
# a Slurm of one node, which tests of campaigns start and stop
if [ "${1-}" = test ]; then
  PATH="$PATH:/sbin:/usr/sbin" command -v slurmctld >/dev/null 2>&1 || optional="$optional slurm-wlm"
  PATH="$PATH:/sbin:/usr/sbin" command -v munged >/dev/null 2>&1 || optional="$optional munge"
fi

if [ -z "$missing$optional" ]; then
  echo "== system packages: all there"
  exit 0
fi
echo "== system packages missing:$missing$optional"
if [ -z "$missing" ] && ! { command -v apt-get && [ "$(id -u)" -eq 0 ]; } >/dev/null 2>&1; then
  echo "   Nothing that is needed; they are left out."
  exit 0
fi
if ! command -v apt-get >/dev/null 2>&1; then
  echo "   There is no apt here. Install these (Debian's names) with the package manager you have," >&2
  echo "   then run make again." >&2
  exit 1
fi
sudo=
if [ "$(id -u)" -ne 0 ]; then
  if ! command -v sudo >/dev/null 2>&1; then
    echo "   Installing them needs root: run  apt-get install$missing$optional  as root, then make again." >&2
    exit 1
  fi
  sudo=sudo
fi
echo "== installing them by apt"
$sudo apt-get update -qq
had=
for package in $optional; do # what this system has not is left out
  if apt-cache show "$package" >/dev/null 2>&1; then
    had="$had $package"
  elif [ "$package" = chromium-headless-shell ] &&
    ! { command -v chromium || command -v chromium-browser; } >/dev/null 2>&1; then
    had="$had chromium"
  fi
done
optional=$had
[ -n "$missing$optional" ] || exit 0
# shellcheck disable=SC2086
$sudo env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $missing $optional
