// The precision of sums that judge a solution, or that restore what rounding took from one.
#pragma once

#include <Eigen/Core>
#include <cfloat>

// the extended format of x86: 64 bits by the processor. Elsewhere long double is a plain double, or
// has 113 bits in software, which costs more than two doubles.
#if LDBL_MANT_DIG == 64
#define FCLIB_HAS_EXTENDED 1
#else
#define FCLIB_HAS_EXTENDED 0
#include "linalg/double_double.hpp"
#endif

namespace fclib {

// The judge must be more precise than what it judges: with r = 4e5 and q = 0.8, as in granular
// packings under load, the rounding of W r alone is 1e-11 in double precision.
#if FCLIB_HAS_EXTENDED
using Real = long double;

/// a b, which has the precision of both.
inline Real full_product(double a, double b) { return Real(a) * Real(b); }
#else
using Real = DoubleDouble;

inline Real full_product(double a, double b) { return DoubleDouble::product(a, b); }
#endif
static_assert(sizeof(Real) > sizeof(double));
inline Real full_product(double a, Real b) { return Real(a) * b; }

using RealVector = Eigen::Matrix<Real, Eigen::Dynamic, 1>;

}  // namespace fclib
