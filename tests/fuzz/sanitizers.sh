# Options of the sanitizers and of libFuzzer, for run.sh and summary.sh.
# No input is larger than 24 kB: of what is larger than the limit, none is needed.
limits="-timeout=20 -rss_limit_mb=1500 -malloc_limit_mb=160"
# HDF5 makes and frees large caches with every file: a long quarantine would only hold memory
export ASAN_OPTIONS="quarantine_size_mb=8:detect_leaks=1:handle_abort=1:allocator_may_return_null=1"
export UBSAN_OPTIONS="print_stacktrace=1"
# what HDF5 loses of damaged files; hdf5_objects has none, and sees that no handle stays open
export LSAN_OPTIONS="suppressions=${source:-$(dirname "$0")/../..}/tests/fuzz/leaks.txt:print_suppressions=0"
