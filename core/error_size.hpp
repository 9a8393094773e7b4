// The one comparison of errors. std::max(a, NaN) is a, and NaN > tolerance is false: written out by
// hand, a part that is no number passes as a small one.
#pragma once

#include <limits>

namespace fclib {

/// x as an error. What is no number, or below 0, is an infinite error.
template <class Real>
constexpr double error_size(const Real& x) {
  const auto error = static_cast<double>(x);
  return error >= 0 ? error : std::numeric_limits<double>::infinity();
}

/// The larger of two errors, each as error_size has it.
template <class Real, class Other>
constexpr double larger_error(const Real& a, const Other& b) {
  const double x = error_size(a);
  const double y = error_size(b);
  return x < y ? y : x;
}

/// ... of more than two.
template <class Real, class... Others>
constexpr double larger_error(const Real& a, const Others&... others) {
  return larger_error(a, larger_error(others...));
}

}  // namespace fclib
