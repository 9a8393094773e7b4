#include "linalg/dense_code.hpp"

namespace fclib {

const DenseKernels& dense_kernels_anywhere() { return kernels; }

const DenseKernels& dense_kernels() {
#ifdef FCLIB_AVX2
  if (has_avx2()) return dense_kernels_avx2();
#endif
  return kernels;
}

}  // namespace fclib
