// One target as libFuzzer wants it.
#include "fuzz.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fclib::fuzz::FCLIB_FUZZ_TARGET.run({reinterpret_cast<const char*>(data), size});
  return 0;
}
