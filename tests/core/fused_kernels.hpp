// What tests must know of this processor.
#pragma once

#include <Eigen/Core>

namespace fclib::testing {

/// Whether the kernels of Eigen round once for a product and a sum. Those for plain x86-64 round
/// twice.
#if defined(EIGEN_VECTORIZE_FMA) || defined(EIGEN_VECTORIZE_NEON)
constexpr bool fused_kernels = true;
#else
constexpr bool fused_kernels = false;
#endif

}  // namespace fclib::testing
