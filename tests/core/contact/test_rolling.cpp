#include "contact/rolling.hpp"

#include <gtest/gtest.h>

#include "contact/coulomb.hpp"
#include "random_data.hpp"

namespace fclib {
namespace {

/// x - P_K(x): the natural map without a velocity.
template <class Cone>
typename Cone::Vec outside(const Cone& cone, const typename Cone::Vec& x) {
  return natural_map(cone, typename Cone::Vec(Cone::Vec::Zero()), x);
}

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

TEST(RollingCone, what_is_outside_is_the_difference_from_the_projection) {
  testing::RandomData random(17);
  for (const double mu : {0.0, 0.3, 20.0}) {
    for (const double mu_r : {0.0, 1e-4, 1.0}) {
      const Rolling<5> cone(mu, mu_r);
      const Rolling<3> planar(mu, mu_r);
      for (int k = 0; k < 2000; ++k) {
        ContactVector<5> x = random.vector(5);
        if (k % 5 == 1) x.segment<2>(1).setZero();
        if (k % 5 == 2) x.tail<2>().setZero();
        if (k % 5 == 3) x[0] *= 100;
        EXPECT_LT((outside(cone, x) - (x - cone.project(x))).norm(), 1e-15 * (1 + x.norm()) * 30);
        const ContactVector<3> y = x.head<3>();
        EXPECT_LT((outside(planar, y) - (y - planar.project(y))).norm(),
                  1e-15 * (1 + y.norm()) * 30);
        EXPECT_EQ(outside(cone, x).isZero(0), cone.project(x) == x);
      }
    }
  }
}

TEST(RollingCone, a_large_normal_part_does_not_swallow_what_its_small_limit_leaves) {
  const Rolling<5> cone(0.6, 1e-4);
  ContactVector<5> u = ContactVector<5>::Zero();
  ContactVector<5> r = u;
  u[3] = -18;
  r << 1e5, -2e3, 0, 1e-4 * 1e5, 0;
  EXPECT_LT(natural_map(cone, u, r, 1e-8).norm(), 1e-14);
  r[3] += 1e-12;
  EXPECT_NEAR(natural_map(cone, u, r, 1e-8).norm(), 1e-12, 1e-14);
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

TEST(RollingCone, modified_velocity_by_hand) {
  ContactVector<5> u;
  u << 1, 3, -4, 0.6, -0.8;
  ContactVector<5> expected = u;
  expected[0] = 1 + 0.5 * 5 + 2 * 1;
  EXPECT_LT((Rolling<5>(0.5, 2).modified(u) - expected).norm(), 1e-15);
  const ContactVector<3> planar(1, -4, 3);
  EXPECT_LT((Rolling<3>(0.5, 2).modified(planar) - ContactVector<3>(9, -4, 3)).norm(), 1e-15);
}

TEST(RollingCone, projection_by_hand) {
  const Rolling<3> cone(0.5, 2);
  using Vec = ContactVector<3>;
  // both limits bind: n = (1 + 0.5 * 6 + 2 * 14) / (1 + 0.25 + 4)
  const double n = 32 / 5.25;
  EXPECT_LT((cone.project(Vec(1, -6, 14)) - Vec(n, -0.5 * n, 2 * n)).norm(), 1e-14);
  // sliding alone: n = (1 + 0.5 * 6) / 1.25
  EXPECT_LT((cone.project(Vec(1, -6, 3)) - Vec(3.2, -1.6, 3)).norm(), 1e-15);
  // rolling alone: n = (1 + 2 * 7) / 5
  EXPECT_LT((cone.project(Vec(1, 0.5, 7)) - Vec(3, 0.5, 6)).norm(), 1e-14);
  // and where the other part is nothing
  EXPECT_LT((cone.project(Vec(0.1, -0.4, 0)) - Vec(0.24, -0.12, 0)).norm(), 1e-15);
  EXPECT_LT((cone.project(Vec(0.1, 0, 0.4)) - Vec(0.18, 0, 0.36)).norm(), 1e-15);
}

TEST(RollingCone, a_point_on_the_boundary_is_its_own_projection_to_the_bit) {
  const Rolling<3> cone(0.5, 2);
  using Vec = ContactVector<3>;
  for (const Vec& x : {Vec(2, -1, 4), Vec(2, 1, 0), Vec(2, 0, -4), Vec(0, 0, 0)}) {
    EXPECT_EQ(cone.project(x), x);
  }
  testing::RandomData random(16);
  for (int k = 0; k < 100; ++k) {
    const double mu = random.uniform(0, 2);
    const double mu_r = random.uniform(0, 2);
    const double normal = random.uniform(0, 9);
    for (const Vec& x : {Vec(normal, mu * normal, 0), Vec(normal, 0, mu_r * normal),
                         Vec(normal, -mu * normal, mu_r * normal)}) {
      EXPECT_EQ(Rolling<3>(mu, mu_r).project(x), x);
    }
  }
  // and on that of the polar cone there is nothing left
  EXPECT_EQ(cone.project(Vec(-5, 2, -2)), Vec::Zero());
}

TEST(RollingCone, the_coefficients_are_those_of_the_contact) {
  const Friction friction{Eigen::Vector2d(0.2, 0.7), Eigen::Vector2d(0.01, 0.02), {}};
  const Rolling<5> cone(friction, 1);
  EXPECT_EQ(cone.coefficient(0), 0.7);
  EXPECT_EQ(cone.coefficient(1), 0.02);
}

TEST(RollingCone, without_rolling_friction_is_the_cone_of_Coulomb_and_bears_no_rolling) {
  testing::RandomData random(15);
  const Rolling<5> rolling(0.6, 0);
  const Coulomb<3> plain(0.6);
  for (int k = 0; k < 100; ++k) {
    ContactVector<5> x = random.vector(5);
    const ContactVector<3> expected = plain.project(ContactVector<3>(x.head<3>()));
    const ContactVector<5> found = rolling.project(x);
    EXPECT_LT((found.head<3>() - expected).norm(), 1e-15);
    EXPECT_EQ(found.tail<2>().norm(), 0);
  }
}

TEST(RollingCone, with_huge_friction_keeps_what_is_in_it) {
  const Rolling<5> cone(1e7, 1e7);
  ContactVector<5> x;
  x << 1, 3e6, -4e6, 6e6, 8e6;
  EXPECT_EQ(cone.project(x), x);
  x << 0, 0.6, -0.8, 0, 1;
  const ContactVector<5> y = cone.project(x);
  EXPECT_NEAR(y[0], 1e-7, 1e-20);
  EXPECT_LT((y.tail<4>() - x.tail<4>()).norm(), 1e-13);
}

}  // namespace
}  // namespace fclib
