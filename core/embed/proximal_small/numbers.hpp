// Numbers as the host and the device know them, and how a function is marked for both.
#pragma once

#ifndef __CUDACC_RTC__
#include <cmath>
#endif

#ifdef __CUDACC__
#define FCLIB_LANES __host__ __device__ __forceinline__
#define FCLIB_UNROLL _Pragma("unroll")
#else
#define FCLIB_LANES inline
#define FCLIB_UNROLL
#endif

namespace fclib::proximal_small {

constexpr double machine_epsilon = 2.220446049250313e-16;
/// As rounding_unit_of_q of merit/natural_sums.hpp.
constexpr double rounding_of_q = 4 * machine_epsilon;
#ifdef __CUDACC_RTC__
#define FCLIB_INFINITY __longlong_as_double(0x7ff0000000000000)
#else
#define FCLIB_INFINITY HUGE_VAL
#endif

FCLIB_LANES double square_root(double x) {
#ifdef __CUDACC_RTC__
  return ::sqrt(x);
#else
  return std::sqrt(x);
#endif
}
FCLIB_LANES double absolute(double x) { return x < 0 ? -x : x; }
/// The larger one; a if a is NaN.
FCLIB_LANES double larger(double a, double b) { return a < b ? b : a; }
FCLIB_LANES bool is_finite(double x) { return x - x == 0; }
/// Whether squares of numbers of this size are neither lost nor infinite.
FCLIB_LANES bool has_square(double x) { return x >= 1e-100 && x <= 1e100; }

}  // namespace fclib::proximal_small
