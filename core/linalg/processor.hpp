// What the processor that runs the program has.
#pragma once

// as for any compiler that knows its attributes, on the processors that may have AVX2
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__EMSCRIPTEN__)
#define FCLIB_AVX2
#endif

namespace fclib {

#ifdef FCLIB_AVX2
/// Whether this processor has AVX2 and fused products.
inline bool has_avx2() {
  static const bool has = __builtin_cpu_supports("avx2") != 0 && __builtin_cpu_supports("fma") != 0;
  return has;
}
#endif

}  // namespace fclib
