#!/bin/sh
# summary.sh FOLDER: runs again all that was found there, and counts it by what it is and where.
# Exits with 1 where something still breaks, unless it is in libhdf5 alone.
set -eu
folder=$(cd "$1" && pwd)
TMPDIR=$(mktemp -d)
export TMPDIR
trap 'rm -rf "$TMPDIR"' EXIT
. "$(dirname "$0")/sanitizers.sh"

all="$TMPDIR/all"
: >"$all"
for input in "$folder"/found/*/*; do
  test -f "$input" || continue
  target=$(basename "$(dirname "$input")")
  # shellcheck disable=SC2086
  if ! "$folder/tests/fuzz/fuzz_$target" $limits "$input" >"$TMPDIR/log" 2>&1; then
    what=$(grep -m1 -E 'does not hold|ERROR: |runtime error|terminate called' "$TMPDIR/log" |
      sed -E 's/^==[0-9]+==//; s/0x[0-9a-f]+/ADDRESS/g; s/\(malloc\(.*|on unknown address.*| on address.*|[0-9]+ byte.*//')
    # the functions next to it, of ours and of HDF5
    where=$(grep -oE '^ +#[0-9]+ 0x[0-9a-f]+ in (H5[A-Z]*_?_[a-z0-9_]+|fclib::[a-zA-Z_:()]+)' "$TMPDIR/log" |
      sed -E 's/.* in //' | head -3 | tr '\n' ' ')
    echo "$target: $what in $where" >>"$all"
  fi
done
if test -s "$all"; then
  sort "$all" | uniq -c | sort -rn
  echo "inputs: $folder/found"
  grep -qvE '^hdf5_bytes: .* in H5' "$all" && exit 1
  echo "all of it inside libhdf5: see tests/fuzz/README.md"
else
  echo "nothing found that breaks the readers"
fi
