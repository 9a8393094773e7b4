// Sums of products of doubles without any rounding. After terms have cancelled, the sign of the sum
// is still exact for the given numbers.
//
// A product is two doubles (by a fused multiply-add). A sum is kept as doubles that do not overlap
// (Shewchuk, "Adaptive precision floating-point arithmetic", 1997, theorem 10).
#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

namespace fclib {

class ExactSum {
 public:
  void add(double x) {
    if (!std::isfinite(x)) exact_ = false;
    if (!exact_) return;
    std::size_t kept = 0;
    for (double part : parts_) {
      const double sum = x + part;
      const double virtual_part = sum - x;
      const double rest = (x - (sum - virtual_part)) + (part - virtual_part);
      if (rest != 0) parts_[kept++] = rest;
      x = sum;
    }
    parts_.resize(kept);
    if (x != 0) parts_.push_back(x);
    if (!std::isfinite(x)) exact_ = false;
  }

  void add_product(double a, double b) {
    if (a == 0 || b == 0) return;
    const double product = a * b;
    // if a product is nearly too small or too large, its rounding error is no double
    if (!(std::abs(product) > 1e-250 && std::abs(product) < 1e250)) {
      exact_ = false;
      return;
    }
    add(product);
    add(std::fma(a, b, -product));
  }

  /// Whether nothing has left the range of doubles.
  [[nodiscard]] bool exact() const { return exact_; }
  [[nodiscard]] bool zero() const { return exact_ && parts_.empty(); }
  /// The sum, within two units of its last digit and with the right sign. NaN if it is not exact.
  [[nodiscard]] double value() const {
    if (!exact_) return std::nan("");
    double sum = 0;
    for (const double part : parts_) sum += part;
    return sum;
  }

 private:
  std::vector<double> parts_;  // of increasing size
  bool exact_ = true;
};

}  // namespace fclib
