#include "contact/coulomb.hpp"

#include <gtest/gtest.h>

#include "random_data.hpp"

namespace fclib {
namespace {

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

}  // namespace
}  // namespace fclib
