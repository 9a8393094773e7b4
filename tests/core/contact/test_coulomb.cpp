#include "contact/coulomb.hpp"

#include <gtest/gtest.h>

#include <cmath>

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
void expect_projection(double mu, testing::RandomData& random) {
  const Coulomb<D> cone(mu);
  const double rounding = 1e-15 * (1 + mu);
  for (int k = 0; k < 1000; ++k) {
    ContactVector<D> x = random.vector(D);
    if (k % 4 == 0) x.template tail<D - 1>().setZero();  // the axis, where mu = 0 is an edge
    const ContactVector<D> y = cone.project(x);
    const ContactVector<D> z = x - y;
    EXPECT_GE(y[0], 0);
    EXPECT_LE(Coulomb<D>::tangential_norm(y), mu * y[0] + rounding);
    EXPECT_NEAR(y.dot(z), 0, rounding);
    EXPECT_LE(z[0] + mu * Coulomb<D>::tangential_norm(z), rounding);  // z . k <= 0 for all k in K
    EXPECT_LT((cone.project(y) - y).norm(), rounding);
  }
}

TEST(CoulombCone, projection_satisfies_the_decomposition_of_Moreau) {
  testing::RandomData random(8);
  for (const double mu : {0.0, 0.1, 0.7, 1.0, 50.0}) {
    expect_projection<2>(mu, random);
    expect_projection<3>(mu, random);
  }
}

TEST(CoulombCone, what_is_outside_is_the_difference_from_the_projection) {
  testing::RandomData random(18);
  for (const double mu : {0.0, 1e-4, 0.7, 50.0}) {
    const Coulomb<3> cone(mu);
    for (int k = 0; k < 1000; ++k) {
      ContactVector<3> x = random.vector(3);
      if (k % 4 == 0) x.tail<2>().setZero();
      EXPECT_LT((outside(cone, x) - (x - cone.project(x))).norm(), 1e-15 * (1 + mu));
      EXPECT_EQ(outside(cone, x).isZero(0), cone.project(x) == x);
    }
  }
}

TEST(CoulombCone, natural_map_is_zero_for_each_status_and_not_otherwise) {
  const Coulomb<3> cone(0.5);
  using Vec = Eigen::Vector3d;
  const Vec none = Vec::Zero();
  EXPECT_EQ(natural_map(cone, Vec{0.2, 1, -2}, none).norm(), 0);                 // open
  EXPECT_EQ(natural_map(cone, none, Vec{2, 0.3, -0.4}).norm(), 0);               // stick
  EXPECT_LT(natural_map(cone, Vec{0, 3, 4}, Vec{2, -0.6, -0.8}).norm(), 1e-15);  // slide
  EXPECT_GT(natural_map(cone, Vec{0, 3, 4}, Vec{2, 0.6, 0.8}).norm(),
            0.1);                                                    // slides the wrong way
  EXPECT_GT(natural_map(cone, Vec{-0.1, 0, 0}, none).norm(), 0.05);  // penetrates
  EXPECT_GT(natural_map(cone, Vec{0.1, 0, 0}, Vec{2, 0, 0}).norm(),
            0.05);                                               // pulls away under load
  EXPECT_GT(natural_map(cone, none, Vec{1, 1, 0}).norm(), 0.1);  // outside the cone
}

TEST(CoulombCone, a_huge_reaction_does_not_swallow_a_wrong_velocity) {
  const Coulomb<3> cone(0.5);
  using Vec = Eigen::Vector3d;
  EXPECT_EQ(natural_map(cone, Vec{-1, 0, 0}, Vec{1e20, 0, 0}).norm(), 1);
}

TEST(CoulombCone, a_huge_velocity_does_not_swallow_a_wrong_reaction) {
  const Coulomb<3> cone(0.5);
  using Vec = Eigen::Vector3d;
  EXPECT_EQ(natural_map(cone, Vec{1e20, 0, 0}, Vec{1, 0, 0}).norm(), 1);
}

TEST(CoulombCone, projection_and_modified_velocity_by_hand) {
  const Coulomb<3> cone(0.5);
  using Vec = Eigen::Vector3d;
  EXPECT_LT((cone.project(Vec{1, 3, -4}) - Vec{2.8, 0.84, -1.12}).norm(), 1e-15);
  EXPECT_LT((cone.modified(Vec{1, 3, -4}) - Vec{3.5, 3, -4}).norm(), 1e-15);
  const Coulomb<2> planar(0.5);
  EXPECT_LT((planar.project(Eigen::Vector2d{1, -4}) - Eigen::Vector2d{2.4, -1.2}).norm(), 1e-15);
  EXPECT_LT((planar.modified(Eigen::Vector2d{1, -4}) - Eigen::Vector2d{3, -4}).norm(), 1e-15);
}

TEST(CoulombCone, a_point_on_the_boundary_is_its_own_projection_to_the_bit) {
  const Coulomb<3> cone(0.5);
  using Vec = Eigen::Vector3d;
  EXPECT_EQ(cone.project(Vec{10, 3, 4}), (Vec{10, 3, 4}));
  EXPECT_EQ(cone.project(Vec{0, 0, 0}), Vec::Zero());
  testing::RandomData random(10);
  for (int k = 0; k < 100; ++k) {
    const double mu = random.uniform(0, 2);
    const double normal = random.uniform(0, 9);
    const Vec x{normal, 0, -mu * normal};
    EXPECT_EQ(Coulomb<3>(mu).project(x), x);
  }
  // and on that of the polar cone there is nothing left
  EXPECT_EQ(cone.project(Vec{-2.5, 3, 4}), Vec::Zero());
}

TEST(CoulombCone, the_coefficient_is_that_of_the_contact) {
  const Friction friction{Eigen::Vector3d(0.2, 0.7, 1e7), {}, {}};
  for (Eigen::Index contact = 0; contact < 3; ++contact) {
    const Coulomb<3> cone(friction, contact);
    EXPECT_EQ(cone.mu(), friction.mu[contact]);
    EXPECT_EQ(cone.coefficient(0), friction.mu[contact]);
  }
}

TEST(CoulombCone, with_huge_friction_is_nearly_a_half_space) {
  const Coulomb<3> cone(1e7);
  using Vec = Eigen::Vector3d;
  EXPECT_EQ(cone.project(Vec{1, 3e6, -4e6}), (Vec{1, 3e6, -4e6}));
  // its normal part is (x_N + mu ||x_T||) / (1 + mu^2), here 1e-7
  const Vec nearly = cone.project(Vec{0, 0.6, -0.8});
  EXPECT_NEAR(nearly[0], 1e-7, 1e-20);
  EXPECT_NEAR(nearly[1], 0.6, 1e-13);
  EXPECT_NEAR(nearly[2], -0.8, 1e-13);
  EXPECT_EQ(cone.project(Vec{-1, 0, 5e-8}), Vec::Zero());
}

TEST(CoulombCone, distances_from_the_cone_and_from_its_dual_by_hand) {
  const Coulomb<3> cone(0.5);
  using Vec = Eigen::Vector3d;
  EXPECT_EQ(cone_violation(cone, Vec{2, 0.6, -0.8}), 0);
  EXPECT_NEAR(cone_violation(cone, Vec{0, 0.6, -0.8}), 1 / std::sqrt(1.25), 1e-15);
  EXPECT_EQ(cone_violation(cone, Vec{-5, 0.6, -0.8}), std::sqrt(26));
  // the dual: ||y_T|| mu <= y_N
  EXPECT_EQ(dual_violation(cone, Vec{0.5, 0.6, -0.8}), 0);
  EXPECT_NEAR(dual_violation(cone, Vec{0, 0.6, -0.8}), 0.5 / std::sqrt(1.25), 1e-15);
  EXPECT_EQ(dual_violation(cone, Vec{-1, 0, 0}), 1);
}

/// r - P_K(r - rho u^), as it stands; its statuses with the open ones first.
template <int D>
void expect_natural_map(double mu, double rho, testing::RandomData& random) {
  const Coulomb<D> cone(mu);
  int open = 0;
  int stick = 0;
  for (int k = 0; k < 300; ++k) {
    ContactVector<D> u = random.vector(D);
    ContactVector<D> r = 3 * random.vector(D);
    if (k % 3 == 0) r.setZero();
    if (k % 3 == 1) u *= 1e-3;
    const ContactVector<D> y = r - rho * cone.modified(u);
    const ContactVector<D> projection = cone.project(y);
    EXPECT_LT((natural_map(cone, u, r, rho) - (r - projection)).norm(), 1e-14 * (1 + rho));
    const ContactStatus status = cone.natural(u, r, rho, {}).status;
    EXPECT_EQ(status == ContactStatus::open, projection.isZero(0));
    EXPECT_EQ(status == ContactStatus::stick, projection == y);
    open += status == ContactStatus::open ? 1 : 0;
    stick += status == ContactStatus::stick ? 1 : 0;
  }
  EXPECT_GT(open, 5);
  EXPECT_GT(stick, 5);
  EXPECT_LT(open + stick, 295);
}

TEST(CoulombCone, sliding_along_one_axis_or_without_friction_is_sliding) {
  using Vec = Eigen::Vector3d;
  for (const double mu : {0.0, 0.5}) {
    const Coulomb<3> cone(mu);
    for (const Vec& direction : {Vec{0, 1, 0}, Vec{0, 0, -1}}) {
      const Vec u = 5 * direction;
      const Vec r = Vec{2, 0, 0} - 2 * mu * direction;
      EXPECT_LT(natural_map(cone, u, r).norm(), 1e-15);
      EXPECT_EQ(cone.natural(u, r, 1, {}).status, ContactStatus::slide);
    }
  }
}

TEST(CoulombCone, natural_map_is_its_formula_for_every_scale) {
  testing::RandomData random(9);
  for (const double rho : {0.01, 1.0, 30.0}) {
    expect_natural_map<2>(0.6, rho, random);
    expect_natural_map<3>(0.6, rho, random);
  }
}

}  // namespace
}  // namespace fclib
