#include "linalg/double_double.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <random>

namespace fclib {
namespace {

using Real = DoubleDouble;
constexpr double inf = std::numeric_limits<double>::infinity();

/// Of what is 1 or less.
constexpr double accuracy = 0x1p-102;

class Drawn {
 public:
  double operator()() {
    return std::ldexp(fraction_(engine_), static_cast<int>(exponent_(engine_)));
  }
  /// With digits beyond those of a double.
  Real wide() {
    const double high = (*this)();
    return Real(high) + Real(high * 0x1p-60 * fraction_(engine_));
  }

 private:
  std::mt19937_64 engine_{1};
  std::uniform_real_distribution<double> fraction_{-1.0, 1.0};
  std::uniform_int_distribution<int> exponent_{-40, 40};
};

double relative(Real found, Real expected) {
  return std::abs(static_cast<double>(found - expected) / static_cast<double>(expected));
}

TEST(DoubleDouble, HasTheDigitsThatDoubleLoses) {
  EXPECT_EQ((Real(1) + 1e-25 - 1).high(), static_cast<double>(Real(1e-25)));
  EXPECT_EQ(static_cast<double>(Real(1) + 0x1p-100 - 1), 0x1p-100);
  EXPECT_EQ(static_cast<double>(Real(1e16) + 1 - 1e16), 1.0);
  EXPECT_EQ(static_cast<double>(Real(std::int64_t{9007199254740993}) - 9007199254740992.0), 1.0);
}

TEST(DoubleDouble, SumsAndProductsOfDoublesAreExact) {
  Drawn drawn;
  for (int k = 0; k < 10000; ++k) {
    const double a = drawn();
    const double b = drawn();
    const Real product = Real(a) * Real(b);
    EXPECT_EQ(product.high(), a * b);
    EXPECT_EQ(product.low(), std::fma(a, b, -(a * b)));
    const Real sum = Real(a) + Real(b);
    EXPECT_EQ(sum.high(), a + b);
    const double part = (a + b) - a;
    EXPECT_EQ(sum.low(), (a - ((a + b) - part)) + (b - part));
  }
}

/// What the compiler makes of a product and a sum, in every file that includes the core.
TEST(DoubleDouble, NoProductIsFusedWithASum) {
  Drawn drawn;
  for (int k = 0; k < 100; ++k) {
    const volatile double a = drawn();
    const volatile double b = drawn();
    const double product = a * b;
    const volatile double stored = product;
    EXPECT_EQ(a * b - stored, 0.0);
  }
}

TEST(DoubleDouble, OperationsUndoEachOther) {
  Drawn drawn;
  for (int k = 0; k < 10000; ++k) {
    const Real a = drawn.wide();
    const Real b = drawn.wide();
    EXPECT_LT(relative(a * b / b, a), 8 * accuracy);
    EXPECT_LT(relative(a / b * b, a), 8 * accuracy);
    EXPECT_LT(relative((a * b) * (a * b), (a * a) * (b * b)), 16 * accuracy);
    const Real root = sqrt(a * a);
    EXPECT_LT(relative(root, abs(a)), 8 * accuracy);
    const Real sum = abs(a) + abs(b);
    EXPECT_LT(relative(sum - abs(b) + abs(b), sum), 8 * accuracy);
    EXPECT_EQ(a - b, -(b - a));
    EXPECT_TRUE(a - b > 0 ? a > b && b < a && !(a <= b) : a <= b && b >= a && !(a > b));
  }
}

TEST(DoubleDouble, WhatIsNotFiniteStaysSo) {
  const double none = std::numeric_limits<double>::quiet_NaN();
  const double most = std::numeric_limits<double>::max();
  for (const Real& x : {Real(inf) + 1, Real(inf) * 2, Real(1) / 0, Real(most) * 2,
                        Real(most) + most, sqrt(Real(inf)), Real(inf) / 2}) {
    EXPECT_EQ(x.high(), inf);
    EXPECT_EQ(x.low(), 0.0);
    EXPECT_FALSE(isfinite(x));
  }
  for (const Real& x : {Real(none) + 1, Real(inf) - inf, Real(0) / 0, Real(inf) * 0, sqrt(Real(-1)),
                        Real(none) * 2}) {
    EXPECT_TRUE(isnan(x));
    EXPECT_FALSE(x < 0 || x > 0 || x == 0 || x <= 0 || x >= 0);
  }
  // too large to be split: as in double
  EXPECT_EQ((Real(1e300) * 2).high(), 2e300);
  EXPECT_EQ((Real(1) / inf).high(), 0.0);
  EXPECT_EQ(static_cast<double>(sqrt(Real(0))), 0.0);
}

TEST(DoubleDouble, IsANumberOfEigen) {
  using Vector = Eigen::Matrix<Real, Eigen::Dynamic, 1>;
  Drawn drawn;
  Eigen::VectorXd plain(50);
  for (double& value : plain) value = drawn();
  const Vector x = plain.cast<Real>();
  EXPECT_LT(relative(x.norm() * x.norm(), x.squaredNorm()), 16 * accuracy);
  EXPECT_EQ(x.cwiseAbs().maxCoeff(), Real(plain.cwiseAbs().maxCoeff()));
  EXPECT_EQ(Eigen::VectorXd(x.cast<double>()), plain);
  EXPECT_EQ(copysign(Real(2), Real(-1)), Real(-2));
  EXPECT_EQ(copysign(Real(-2), Real(-1)), Real(-2));
}

}  // namespace
}  // namespace fclib
