#!/bin/sh
# Builds problems from their stored states on a bare Debian in a chroot, with its compiler and its Python,
# builds the same here, and compares the two. Needs root and debootstrap.
#
#   sh scripts/compare_on.sh SUITE [SET...]      SUITE is trixie, ...; the sets are tiny and standard by default
#
# The chroot is that of scripts/try_on.sh, what is compared is what is committed, and how is told on top of
# workshop/sets/apart.py.
set -eu
[ $# -ge 1 ] || { sed -n '2,/^set/s/^# \{0,1\}//p' "$0" >&2; exit 2; }
suite=$1
shift
[ $# -gt 0 ] || set -- tiny standard
source=$(cd "$(dirname "$0")/.." && pwd)
chroot=${TRY_ON:-/var/tmp/fclib-try-on}/$suite
here=$(mktemp -d)
trap 'rm -rf "$here"' EXIT
build=".venv/bin/fclib collection build $* --no-references --no-pictures --form global --jobs 1"
sh "$source/scripts/try_on.sh" "$suite" sh -c "make setup && $build --out built"
cd "$source"
$build --out "$here" >/dev/null
.venv/bin/python -m workshop.sets.apart "$here" "$chroot/fclib/built"
