// One target as libFuzzer wants it.
#include <hdf5.h>

#include "fuzz.hpp"

/// What HDF5 does at exit after a file that it could not close (README.md) names no input.
extern "C" int LLVMFuzzerInitialize(int*, char***) {
  H5dont_atexit();
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fclib::fuzz::FCLIB_FUZZ_TARGET.run({reinterpret_cast<const char*>(data), size});
  return 0;
}
