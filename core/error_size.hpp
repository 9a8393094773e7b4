// The one comparison of errors. std::max(a, NaN) is a, and NaN > tolerance is false: a comparison
// written by hand would take a NaN for a small error.
#pragma once

#include <limits>

namespace fclib {

/// x as an error. NaN, or a number below 0, is an infinite error.
template <class Real>
constexpr double error_size(const Real& x) {
  const auto error = static_cast<double>(x);
  return error >= 0 ? error : std::numeric_limits<double>::infinity();
}

/// The larger of two errors, after error_size of each.
template <class Real, class Other>
constexpr double larger_error(const Real& a, const Other& b) {
  const double x = error_size(a);
  const double y = error_size(b);
  return x < y ? y : x;
}

/// ... of three or more.
template <class Real, class... Others>
constexpr double larger_error(const Real& a, const Others&... others) {
  return larger_error(a, larger_error(others...));
}

}  // namespace fclib
