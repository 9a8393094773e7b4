#include "contact/lorentz.hpp"

#include <gtest/gtest.h>

#include <random>

using namespace fclib;

namespace {

/// A random point inside the cone: `least` is x_0 - ||x_1..||.
template <int S>
lorentz::Point<S> inside(std::mt19937& engine, double least) {
  std::normal_distribution<double> normal;
  lorentz::Point<S> x;
  for (int k = 1; k < S; ++k) x[k] = normal(engine);
  const double norm = x.template tail<S - 1>().norm();
  x[0] = norm + least;
  return x;
}

template <int S>
void check_scaling(double least, double accuracy) {
  std::mt19937 engine(S);
  for (int trial = 0; trial < 100; ++trial) {
    const auto x = inside<S>(engine, least);
    const auto y = inside<S>(engine, 1.0);
    lorentz::Scaling<S> scaling;
    scaling.set(x, y);
    const auto& N = scaling.N;
    EXPECT_LT((N - N.transpose()).norm(), accuracy * N.norm());
    EXPECT_LT((N * N * y - x).norm(), accuracy * x.norm());
    const lorentz::Point<S> lambda = N * y;
    EXPECT_LT((scaling.inverse * x - lambda).norm(), accuracy * scaling.inverse.norm() * x.norm());
    EXPECT_NEAR(lorentz::det<S>(scaling.w), 1, accuracy * scaling.w.squaredNorm());
  }
}

}  // namespace

TEST(Lorentz, the_scaling_takes_y_to_x) {
  check_scaling<2>(0.1, 1e-12);
  check_scaling<3>(0.1, 1e-12);
  check_scaling<3>(1e-6, 1e-9);
}

TEST(Lorentz, a_determinant_has_all_digits) {
  lorentz::Point<3> x(1 + 1e-12, 0.6, 0.8);
  EXPECT_NEAR(lorentz::det<3>(x), 2e-12, 1e-15);
  // where rounding has put a point outside, it is still positive
  x[0] = 1 - 1e-15;
  EXPECT_GT(lorentz::inner_det<3>(x), 0);
}

TEST(Lorentz, division_undoes_the_product) {
  std::mt19937 engine(1);
  for (int trial = 0; trial < 100; ++trial) {
    const auto x = inside<3>(engine, 0.1);
    const auto y = inside<3>(engine, 0.1);
    lorentz::Point<3> target = lorentz::Point<3>::Zero();
    lorentz::subtract_product<3>(x, y, target);
    EXPECT_LT((lorentz::divide<3>(-target, x) - y).norm(), 1e-11 * (1 + y.norm()));
  }
}

TEST(Lorentz, the_longest_step_ends_on_the_boundary) {
  std::mt19937 engine(2);
  std::normal_distribution<double> normal;
  int ended = 0;
  for (int trial = 0; trial < 300; ++trial) {
    const auto x = inside<3>(engine, 0.1);
    const lorentz::Point<3> d(normal(engine), normal(engine), normal(engine));
    const double step = lorentz::longest<3>(x, d);
    if (!std::isfinite(step)) {
      // d is in the cone: x never leaves it
      EXPECT_GE(d[0], d.tail<2>().norm());
      continue;
    }
    ++ended;
    const auto eigenvalue = [&](double t) {
      const lorentz::Point<3> z = x + t * d;
      return z[0] - z.tail<2>().norm();
    };
    EXPECT_NEAR(eigenvalue(step), 0, 1e-9 * (1 + step * d.norm()));
    for (int k = 0; k < 10; ++k) EXPECT_GT(eigenvalue(0.099 * k * step), 0);
  }
  EXPECT_GT(ended, 150);
}
