// The precision of sums that judge a solution, or that restore what rounding took from one.
#pragma once

#include <Eigen/Core>
#include <cfloat>
#include <limits>

// The extended format of x86 has 64 bits, by the processor. Elsewhere long double is a plain double
// (Apple, MSVC), or has 113 bits in software (Linux on ARM), which costs more than two doubles.
// FCLIB_DOUBLE_DOUBLE asks for two doubles on x86 too: the tests then see what others get.
#if LDBL_MANT_DIG != 64 || defined(FCLIB_DOUBLE_DOUBLE)
#include "linalg/double_double.hpp"
#endif

namespace fclib {

// The judge must be more precise than what it judges: with r = 4e5 and q = 0.8, as in granular
// packings under load, the rounding of W r alone is 1e-11 in double precision.
#if LDBL_MANT_DIG == 64 && !defined(FCLIB_DOUBLE_DOUBLE)
using Real = long double;
inline constexpr const char* real_name = "long double";
inline constexpr int real_bits = std::numeric_limits<Real>::digits;

/// a b, which has the precision of both.
inline Real full_product(double a, double b) { return Real(a) * Real(b); }
#else
using Real = DoubleDouble;
inline constexpr const char* real_name = "double-double";
inline constexpr int real_bits = DoubleDouble::digits;

inline Real full_product(double a, double b) { return DoubleDouble::product(a, b); }
#endif
static_assert(real_bits >= 64, "the judge has no more digits than what it judges");
inline Real full_product(double a, Real b) { return Real(a) * b; }

using RealVector = Eigen::Matrix<Real, Eigen::Dynamic, 1>;

}  // namespace fclib
