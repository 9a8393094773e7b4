#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "contact/coulomb.hpp"
#include "contact/ellipsoid.hpp"
#include "contact/rolling.hpp"
#include "contact/spin.hpp"
#include "error_size.hpp"
#include "linalg/double_double.hpp"
#include "merit/merit.hpp"
#include "random_data.hpp"

namespace fclib {
namespace {

using Wide = DoubleDouble;

template <int D>
Coulomb<D> narrow(const Coulomb<D, Wide>& cone) {
  return Coulomb<D>(static_cast<double>(cone.mu()));
}
template <int D>
Rolling<D> narrow(const Rolling<D, Wide>& cone) {
  return Rolling<D>(static_cast<double>(cone.coefficient(0)),
                    static_cast<double>(cone.coefficient(1)));
}

template <int D>
Spin<D> narrow(const Spin<D, Wide>& cone) {
  typename Spin<D>::Coefficients coefficients;
  for (int g = 0; g < Spin<D>::groups; ++g) {
    coefficients[g] = static_cast<double>(cone.coefficient(g));
  }
  return Spin<D>(coefficients);
}
Ellipsoid<> narrow(const Ellipsoid<Wide>& cone) {
  return Ellipsoid<>(static_cast<double>(cone.coefficient(0)),
                     static_cast<double>(cone.coefficient(1)));
}

/// r - P_K(r - rho u^), as it stands.
template <class Cone>
typename Cone::Vec by_definition(const Cone& cone, const typename Cone::Vec& u,
                                 const typename Cone::Vec& r, Wide rho) {
  const typename Cone::Vec y = r - rho * cone.modified(u);
  return r - cone.project(y);
}

/// A contact of one of these kinds: anything; open at a distance; grazing; sticking; sliding. Each
/// group of velocities and reactions may be exactly zero.
template <class Cone>
void draw(const Cone& cone, int kind, testing::RandomData& random, ContactVector<Cone::dim>& u,
          ContactVector<Cone::dim>& r) {
  u = random.vector(Cone::dim);
  r = random.vector(Cone::dim);
  if (kind == 0) return;
  u[0] = kind == 1 ? std::abs(u[0]) : 0.0;
  r[0] = kind <= 2 ? 0.0 : std::abs(r[0]);
  for_each_group<Cone>([&](auto g) {
    auto slip = u.template segment<Cone::size(g)>(Cone::start(g));
    auto force = r.template segment<Cone::size(g)>(Cone::start(g));
    const auto limit = static_cast<double>(cone.coefficient(g)) * r[0];
    if (kind == 3 || random.vector(1)[0] > 0.3) slip.setZero();
    force *= (kind == 3 ? 0.5 : 1.0) * limit / force.norm();
    if (kind == 4 && slip.norm() > 0) force = -limit / slip.norm() * slip;
  });
}

template <class Cone>
void expect_the_definition(const Cone& wide, testing::RandomData& random) {
  using Vec = typename Cone::Vec;
  const auto cone = narrow(wide);
  for (int k = 0; k < 200; ++k) {
    ContactVector<Cone::dim> u;
    ContactVector<Cone::dim> r;
    draw(wide, k % 5, random, u, r);
    for (const double rho : {1.0, 1e-9, 1e9}) {
      const Vec expected = by_definition(wide, Vec(u.template cast<Wide>()),
                                         Vec(r.template cast<Wide>()), Wide(rho));
      const ContactVector<Cone::dim> found = natural_map(cone, u, r, rho);
      const double size = r.norm() + rho * u.norm() + expected.template cast<double>().norm();
      EXPECT_LE((found.template cast<Wide>() - expected).template cast<double>().norm(),
                1e-14 * size)
          << "kind " << k % 5 << " rho " << rho << " mu " << cone.coefficient(0);
    }
  }
}

constexpr double coefficients[] = {0, 1e-6, 0.3, 1, 50, 1e5, 1e8, 1e12};

TEST(NaturalMap, is_that_of_the_definition_for_any_friction) {
  testing::RandomData random(31);
  for (const double mu : coefficients) {
    expect_the_definition(Coulomb<2, Wide>(mu), random);
    expect_the_definition(Coulomb<3, Wide>(mu), random);
    for (const double mu_r : coefficients) {
      expect_the_definition(Rolling<3, Wide>(mu, mu_r), random);
      expect_the_definition(Rolling<5, Wide>(mu, mu_r), random);
      expect_the_definition(Spin<4, Wide>({mu, mu_r}), random);
      expect_the_definition(Spin<6, Wide>({mu, mu_r, 0.3}), random);
      expect_the_definition(Spin<6, Wide>({0.3, mu, mu_r}), random);
      expect_the_definition(Ellipsoid<Wide>(mu, mu_r), random);
    }
  }
}

TEST(NaturalMap, an_exact_solution_has_none) {
  for (const double mu : coefficients) {
    for (const double mu_r : coefficients) {
      const Rolling<5> cone(mu, mu_r);
      using Vec = ContactVector<5>;
      Vec u;
      u << 0, 3, 4, 0, 0;  // slides without rolling and without a reaction
      EXPECT_EQ(natural_map(cone, u, Vec(Vec::Zero())).norm(), 0);
      u << 0, 0, 0, 3, 4;
      EXPECT_EQ(natural_map(cone, u, Vec(Vec::Zero())).norm(), 0);
      Vec r;
      r << 1, 0.3 * mu, 0.4 * mu, 0, 0.5 * mu_r;  // sticks
      EXPECT_EQ(natural_map(cone, Vec(Vec::Zero()), r).norm(), 0);
    }
  }
}

TEST(NaturalMap, sees_a_penetration_without_rolling_at_any_friction) {
  for (const double mu : coefficients) {
    using Vec = ContactVector<5>;
    Vec u;
    u << -0.75, 1, 0, 0, 0;
    const Vec map = natural_map(Rolling<5>(mu, 0.2), u, Vec(Vec::Zero()));
    EXPECT_TRUE(map.allFinite());
    EXPECT_GT(map.norm(), 0.7 / (1 + mu));
  }
}

TEST(NaturalMap, what_is_no_number_stays_so) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (int k = 0; k < 5; ++k) {
    for (const double force : {0.0, 1.0}) {
      ContactVector<5> u = ContactVector<5>::Ones();
      u[k] = nan;
      const ContactVector<5> r = ContactVector<5>::Constant(force);
      EXPECT_FALSE(natural_map(Rolling<5>(0.3, 0.2), u, r).allFinite()) << k;
      if (k >= 3) continue;
      const ContactVector<3> three = u.head<3>();
      EXPECT_FALSE(natural_map(Coulomb<3>(0.3), three, ContactVector<3>(r.head<3>())).allFinite());
    }
  }
}

TEST(ErrorSize, what_is_no_number_is_infinite) {
  const double infinite = std::numeric_limits<double>::infinity();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(error_size(nan), infinite);
  EXPECT_EQ(error_size(-1.0), infinite);
  EXPECT_EQ(larger_error(1.0, nan), infinite);
  EXPECT_EQ(larger_error(nan, 1.0), infinite);
  EXPECT_EQ(larger_error(1.0, 2.0, nan, 0.5), infinite);
  EXPECT_EQ(larger_error(1.0, 3.0, 2.0), 3.0);
}

/// Every error that a tolerance may bound, with a NaN in it.
TEST(ErrorSize, no_figure_of_a_merit_hides_a_nan) {
  for_each_field<Merit>([&]<class Member>(const Field<Merit, Member>& field) {
    if constexpr (std::is_same_v<Member, double>) {
      Merit merit;
      merit.*field.member = std::numeric_limits<double>::quiet_NaN();
      const bool bounded = field.name == "natural" || field.name == "dynamics" ||
                           field.name == "bilateral" || field.name == "kinematics";
      const bool part = field.unit != "" && field.unit != "1";
      if (bounded) {
        EXPECT_EQ(merit.error_by(MeritKind::natural), std::numeric_limits<double>::infinity())
            << field.name;
      } else if (field.name == "error") {
        EXPECT_EQ(merit.error_by(MeritKind::both), std::numeric_limits<double>::infinity());
      } else {
        EXPECT_TRUE(part || field.name == "scaled_natural") << field.name << " is not looked at";
      }
    }
  });
}

}  // namespace
}  // namespace fclib
