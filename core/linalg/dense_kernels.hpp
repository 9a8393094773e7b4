// What a front of a factorisation does with its dense matrices. The code is compiled for any
// processor that the build names, and a second time for those with AVX2 and fused products. Which
// of the two runs is chosen when the program does.
#pragma once

#include <cstddef>

#include "linalg/processor.hpp"

namespace fclib {

/// A dense matrix, column by column.
struct DenseView {
  double* data;
  std::ptrdiff_t rows, cols;
  std::ptrdiff_t stride;  // from a column to the next
};

struct DenseKernels {
  /// C -= A B.
  void (*subtract_product)(DenseView c, DenseView a, DenseView b);
  /// B <- L^-1 B, where L has ones on its diagonal. The upper triangle is not read.
  void (*solve_unit_lower)(DenseView l, DenseView b);
  /// B <- U^-1 B. What is below the diagonal of U is not read.
  void (*solve_upper)(DenseView u, DenseView b);
  /// B <- B U^-1.
  void (*solve_upper_from_right)(DenseView u, DenseView b);
  /// Gaussian elimination of the columns from start to end of a square matrix, in these columns,
  /// with exchanges of whole rows: row k and row exchanged[k]. A pivot of at most `tiny` is
  /// replaced by it. Returns false if a pivot is infinite.
  bool (*eliminate)(DenseView a, std::ptrdiff_t start, std::ptrdiff_t end, double tiny,
                    int* exchanged);
};

const DenseKernels& dense_kernels_anywhere();
#ifdef FCLIB_AVX2
const DenseKernels& dense_kernels_avx2();
#endif

/// Those for this processor.
const DenseKernels& dense_kernels();

}  // namespace fclib
