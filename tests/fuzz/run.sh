#!/bin/sh
# run.sh FOLDER SECONDS: builds the fuzz targets in FOLDER with clang's sanitizers and runs each for
# its share of the time, going on where the last run ended. What breaks a target is kept in
# FOLDER/found; summary.sh FOLDER says what it is. FOLDER/cpu_seconds gets a line for each run.
# FUZZ_CMAKE adds options for CMake.
set -eu
source=$(cd "$(dirname "$0")/../.." && pwd)
mkdir -p "$1"
folder=$(cd "$1" && pwd)
seconds=$2

if ! command -v clang++ >/dev/null; then
  echo "make fuzz: clang is missing. On Debian 12: apt-get install clang libclang-rt-14-dev" >&2
  exit 1
fi
if ! echo 'extern "C" int LLVMFuzzerTestOneInput(const char*, long) { return 0; }' |
  clang++ -x c++ - -fsanitize=fuzzer,address -o "$folder/works" 2>"$folder/works.log"; then
  cat "$folder/works.log" >&2
  echo "make fuzz: clang has no libFuzzer. On Debian 12: apt-get install libclang-rt-14-dev" >&2
  exit 1
fi
# shellcheck disable=SC2086
cmake -S "$source" -B "$folder" -G Ninja -DFCLIB_FUZZ=ON -DFCLIB_PYTHON=OFF -DFCLIB_C=OFF \
  -DCMAKE_BUILD_TYPE=None -DCMAKE_CXX_COMPILER=clang++ -DCMAKE_C_COMPILER=clang \
  ${FUZZ_CMAKE:-} >"$folder/cmake.log" || { cat "$folder/cmake.log" >&2; exit 1; }
ninja -C "$folder" fuzz

# files are made and removed all the time: in memory, where there is such a folder
scratch=$(mktemp -d -p "$(test -w /dev/shm && echo /dev/shm || echo "${TMPDIR:-/tmp}")")
trap 'rm -rf "$scratch"' EXIT
trap 'exit 1' INT TERM
export TMPDIR="$scratch"
. "$source/tests/fuzz/sanitizers.sh"

"$folder/tests/fuzz/write_seeds" "$folder/seeds"
for share in siconos_text:15 hdf5_bytes:30 hdf5_objects:55; do
  target=${share%:*}
  corpus="$folder/corpus/$target" found="$folder/found/$target"
  mkdir -p "$corpus" "$found"
  time=$((seconds * ${share#*:} / 100 + 1))  # 0 would be for ever
  echo "== $target: $time s"
  # in processes of their own, so that what breaks one does not end the run
  "$folder/tests/fuzz/fuzz_$target" "$corpus" "$folder/seeds/$target" \
    -fork=1 -ignore_crashes=1 -ignore_ooms=1 -ignore_timeouts=1 \
    -max_total_time=$time -max_len=24000 $limits \
    -artifact_prefix="$found/" >"$folder/$target.log" 2>&1 || true
  grep '^#' "$folder/$target.log" | tail -1
done
times >"$folder/times"
awk -F'[ ms]+' 'NR == 2 { print 60 * $1 + $2 + 60 * $3 + $4 }' "$folder/times" >>"$folder/cpu_seconds"
"$source/tests/fuzz/summary.sh" "$folder"
