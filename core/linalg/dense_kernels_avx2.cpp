// The build compiles this file for processors with AVX2 and fused products. Eigen has a name of its
// own here: the linker must not take a function of this file where any processor may run it.
#include "linalg/processor.hpp"

#ifdef FCLIB_AVX2

#define Eigen eigen_avx2
#include "linalg/dense_code.hpp"

namespace fclib {

const DenseKernels& dense_kernels_avx2() { return kernels; }

}  // namespace fclib

#endif
