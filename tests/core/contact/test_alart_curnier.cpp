#include "contact/alart_curnier.hpp"

#include <gtest/gtest.h>

#include "contact/coulomb.hpp"
#include "contact/rolling.hpp"
#include "random_data.hpp"

namespace fclib {
namespace {

template <class Cone>
void check_slope(const Cone& cone, testing::RandomData& random) {
  using Vec = typename Cone::Vec;
  for (int k = 0; k < 200; ++k) {
    const Vec z = random.vector(Cone::dim);
    const Vec step = 1e-6 * random.vector(Cone::dim);
    const Vec change = alart_curnier_projection(cone, Vec(z + step)) -
                       alart_curnier_projection(cone, Vec(z - step));
    EXPECT_LE((change - 2 * alart_curnier_jacobian(cone, z) * step).norm(), 1e-9);
  }
}

TEST(DiskMap, SlopeIsTheDerivative) {
  testing::RandomData random(6);
  for (const double mu : {0.0, 0.3, 2.0}) {
    check_slope(Coulomb<2>(mu), random);
    check_slope(Coulomb<3>(mu), random);
    check_slope(Rolling<3>(mu, 0.1), random);
    check_slope(Rolling<5>(mu, 0.1), random);
  }
}

TEST(DiskMap, FixedPointsAreThoseOfTheContactLaw) {
  const Coulomb<3> cone(0.5);
  using Vec = Coulomb<3>::Vec;
  const auto holds = [&](const Vec& r, const Vec& u) {
    for (const double rho : {0.1, 1.0, 7.0}) {
      if ((alart_curnier_projection(cone, Vec(r - rho * u)) - r).norm() > 1e-14) return false;
    }
    return true;
  };
  EXPECT_TRUE(holds({0, 0, 0}, {1, 3, 4}));         // open
  EXPECT_TRUE(holds({2, 0.3, 0.4}, {0, 0, 0}));     // stick
  EXPECT_TRUE(holds({2, -0.6, -0.8}, {0, 3, 4}));   // slide
  EXPECT_FALSE(holds({2, 0.6, 0.8}, {0, 3, 4}));    // friction pushes along
  EXPECT_FALSE(holds({2, -0.3, -0.4}, {0, 3, 4}));  // too little of it
  EXPECT_FALSE(holds({0, 0, 0}, {-1, 0, 0}));       // it penetrates
}

}  // namespace
}  // namespace fclib
