// The precision of sums that judge a solution, or mend what rounding took from one.
#pragma once

#include <Eigen/Core>

#ifdef __wasm__
#include "linalg/double_double.hpp"
#endif

namespace fclib {

// A referee is more precise than what it judges: with r = 4e5 and q = 0.8, as in granular packings
// under load, the rounding of W r alone is worth 1e-11 in double precision.
#ifdef __wasm__
using Real = DoubleDouble;  // long double is software there
#else
using Real = long double;
#endif

/// a b, which needs the precision of both.
inline Real full_product(double a, double b) {
#ifdef __wasm__
  return DoubleDouble::product(a, b);
#else
  return Real(a) * Real(b);
#endif
}
inline Real full_product(double a, Real b) { return Real(a) * b; }

using RealVector = Eigen::Matrix<Real, Eigen::Dynamic, 1>;

}  // namespace fclib
