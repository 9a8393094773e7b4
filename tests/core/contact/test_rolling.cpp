#include "contact/rolling.hpp"

#include <gtest/gtest.h>

#include "random_data.hpp"

namespace fclib {
namespace {

/// Moreau's decomposition: x = P_K(x) + z with z in the polar cone, orthogonal to P_K(x).
template <int D>
void expect_projection(double mu, double mu_r, testing::RandomData& random) {
  constexpr int T = (D - 1) / 2;
  const Rolling<D> cone(mu, mu_r);
  const double rounding = 2e-15 * (1 + mu) * (1 + mu_r);
  const auto t = [](const ContactVector<D>& x) { return x.template segment<T>(1).norm(); };
  const auto r = [](const ContactVector<D>& x) { return x.template segment<T>(1 + T).norm(); };
  for (int k = 0; k < 2000; ++k) {
    ContactVector<D> x = random.vector(D);
    if (k % 4 == 0) x.template tail<D - 1>().setZero();  // the axis, an edge without friction
    const ContactVector<D> y = cone.project(x);
    EXPECT_GE(y[0], 0);
    const ContactVector<D> z = x - y;
    EXPECT_LE(t(y), mu * y[0] + rounding);
    EXPECT_LE(r(y), mu_r * y[0] + rounding);
    EXPECT_NEAR(y.dot(z), 0, rounding);
    EXPECT_LE(z[0] + mu * t(z) + mu_r * r(z), rounding);  // z . k <= 0 for all k in K
    EXPECT_LT((cone.project(y) - y).norm(), rounding);
  }
}

TEST(RollingCone, projection_satisfies_the_decomposition_of_Moreau) {
  testing::RandomData random(14);
  for (const double mu : {0.0, 0.3, 1.0, 20.0}) {
    for (const double mu_r : {0.0, 0.05, 1.0, 20.0}) {
      expect_projection<3>(mu, mu_r, random);
      expect_projection<5>(mu, mu_r, random);
    }
  }
}

TEST(RollingCone, natural_map_is_zero_for_each_status) {
  const Rolling<5> cone(0.5, 0.1);
  using Vec = ContactVector<5>;
  const Vec none = Vec::Zero();
  Vec u = none;
  Vec r = none;
  u << 0.3, 1, 2, -1, 0;  // open
  EXPECT_EQ(natural_map(cone, u, r).norm(), 0);
  r << 2, 0.3, -0.4, 0.1, 0.1;  // sticks and does not roll
  EXPECT_EQ(natural_map(cone, none, r).norm(), 0);
  u << 0, 3, 4, 0, 2;
  r << 2, -0.6, -0.8, 0, -0.2;  // slides and rolls
  EXPECT_LT(natural_map(cone, u, r).norm(), 1e-14);
  r[4] = 0.2;  // pushed the wrong way
  EXPECT_GT(natural_map(cone, u, r).norm(), 0.1);
}

}  // namespace
}  // namespace fclib
