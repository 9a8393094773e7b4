// Numbers of twice the precision of double, as the sum of two: for processors that have no format
// with more bits.
//
//   T. J. Dekker, A floating-point technique for extending the available precision, 1971
//   M. Joldes, J.-M. Muller, V. Popescu, Tight and rigorous error bounds for basic building blocks
//   of double-word arithmetic, 2017: AccurateDWPlusDW, DWTimesDW1, DWDivDW1
#pragma once

#include <Eigen/Core>
#include <cfloat>
#include <cmath>
#include <limits>
#include <type_traits>

static_assert(FLT_EVAL_METHOD == 0, "doubles must be rounded to doubles: x87 keeps more bits");

namespace fclib {

/// high + low; low is at most half a unit of the last digit of high. The range is that of double.
/// Infinity and NaN stay as they are, and their low part is 0.
class DoubleDouble {
 public:
  /// Bits of a sum, at least.
  static constexpr int digits = 2 * std::numeric_limits<double>::digits - 2;

  constexpr DoubleDouble() = default;
  template <class Number, std::enable_if_t<std::is_arithmetic_v<Number>, int> = 0>
  // NOLINTNEXTLINE(google-explicit-constructor): as of long double
  constexpr DoubleDouble(Number value) : high_(static_cast<double>(value)) {
    if constexpr (std::is_integral_v<Number> && sizeof(Number) > 4) {
      low_ = static_cast<double>(value - static_cast<Number>(high_));
    }
  }

  constexpr explicit operator double() const { return high_; }

  [[nodiscard]] constexpr double high() const { return high_; }
  [[nodiscard]] constexpr double low() const { return low_; }

  friend constexpr DoubleDouble operator-(DoubleDouble a) { return {-a.high_, -a.low_}; }

  friend constexpr DoubleDouble operator+(DoubleDouble a, DoubleDouble b) {
    const double s = a.high_ + b.high_;
    const double t = a.low_ + b.low_;
    const double rest = rest_of_sum(a.high_, b.high_, s) + t;
    const double v = s + rest;
    const double low = rest_of_sum(a.low_, b.low_, t) + (rest - (v - s));
    const double sum = v + low;
    return checked(sum, low - (sum - v), s);
  }
  friend constexpr DoubleDouble operator-(DoubleDouble a, DoubleDouble b) { return a + -b; }

  friend constexpr DoubleDouble operator*(DoubleDouble a, DoubleDouble b) {
    const DoubleDouble p = two_product(a.high_, b.high_);
    const double low = p.low_ + (a.high_ * b.low_ + a.low_ * b.high_);
    const double product = p.high_ + low;
    return checked(product, low - (product - p.high_), p.high_);
  }

  /// a b of two doubles, exact.
  static constexpr DoubleDouble product(double a, double b) { return two_product(a, b); }

  friend constexpr DoubleDouble operator/(DoubleDouble a, DoubleDouble b) {
    const double q = a.high_ / b.high_;
    if (!finite(q) || !finite(b.high_)) return {q, 0.0};
    const DoubleDouble rest = a - b * DoubleDouble(q);
    return quick_two_sum(q, rest.high_ / b.high_);
  }

  constexpr DoubleDouble& operator+=(DoubleDouble b) { return *this = *this + b; }
  constexpr DoubleDouble& operator-=(DoubleDouble b) { return *this = *this - b; }
  constexpr DoubleDouble& operator*=(DoubleDouble b) { return *this = *this * b; }
  constexpr DoubleDouble& operator/=(DoubleDouble b) { return *this = *this / b; }

  friend constexpr bool operator==(DoubleDouble a, DoubleDouble b) {
    return a.high_ == b.high_ && a.low_ == b.low_;
  }
  friend constexpr bool operator<(DoubleDouble a, DoubleDouble b) {
    return a.high_ < b.high_ || (a.high_ == b.high_ && a.low_ < b.low_);
  }
  friend constexpr bool operator>(DoubleDouble a, DoubleDouble b) { return b < a; }
  friend constexpr bool operator<=(DoubleDouble a, DoubleDouble b) { return a < b || a == b; }
  friend constexpr bool operator>=(DoubleDouble a, DoubleDouble b) { return b <= a; }

  friend constexpr DoubleDouble abs(DoubleDouble a) { return a.high_ < 0 ? -a : a; }
  friend DoubleDouble copysign(DoubleDouble a, DoubleDouble sign) {
    return std::signbit(sign.high_) == std::signbit(a.high_) ? a : -a;
  }
  /// A Newton step from the root of the high part.
  friend DoubleDouble sqrt(DoubleDouble a) {
    const double root = std::sqrt(a.high_);
    if (!(root > 0) || !finite(root)) return {root, 0.0};
    const DoubleDouble rest = a - two_product(root, root);
    return quick_two_sum(root, rest.high_ / (2 * root));
  }
  friend bool isfinite(DoubleDouble a) { return finite(a.high_); }
  friend bool isnan(DoubleDouble a) { return std::isnan(a.high_); }

 private:
  constexpr DoubleDouble(double high, double low) : high_(high), low_(low) {}

  static constexpr bool finite(double x) { return x - x == 0; }

  /// The rounding error of s = a + b.
  static constexpr double rest_of_sum(double a, double b, double s) {
    const double part = s - a;
    return (a - (s - part)) + (b - part);
  }
  /// high + low. If that is NaN or infinite, it is `first`, the plain sum. It is checked once, at
  /// the end, since sums of many terms take most of the time of a merit.
  static constexpr DoubleDouble checked(double high, double low, double first) {
    if (finite(low)) return {high, low};
    return {finite(first) ? high : first, 0.0};
  }
  /// Only if |a| >= |b|, or a is 0.
  static constexpr DoubleDouble quick_two_sum(double a, double b) {
    const double s = a + b;
    return {s, finite(s) ? b - (s - a) : 0.0};
  }
  static constexpr DoubleDouble two_product(double a, double b) {
    const double p = a * b;
    const DoubleDouble x = split(a);
    const DoubleDouble y = split(b);
    const double rest =
        ((x.high_ * y.high_ - p) + x.high_ * y.low_ + x.low_ * y.high_) + x.low_ * y.low_;
    // a number that is too large to be split has no low part
    return {p, finite(rest) ? rest : 0.0};
  }
  /// Veltkamp's halves, of 26 bits each.
  static constexpr DoubleDouble split(double a) {
    const double c = 134217729.0 * a;  // 2^27 + 1
    const double high = c - (c - a);
    return {high, a - high};
  }

  double high_ = 0.0;
  double low_ = 0.0;
};

}  // namespace fclib

template <>
struct Eigen::NumTraits<fclib::DoubleDouble> : Eigen::GenericNumTraits<fclib::DoubleDouble> {
  enum {
    IsComplex = 0,
    IsInteger = 0,
    IsSigned = 1,
    RequireInitialization = 1,
    ReadCost = 2,
    AddCost = 20,
    MulCost = 25,
  };
  static fclib::DoubleDouble epsilon() { return 4.93038065763132e-32; }  // 2^-104
  static fclib::DoubleDouble dummy_precision() { return 1e-28; }
  static fclib::DoubleDouble highest() { return std::numeric_limits<double>::max(); }
  static fclib::DoubleDouble lowest() { return std::numeric_limits<double>::lowest(); }
  static int digits10() { return 31; }
};
