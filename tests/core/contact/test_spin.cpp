#include "contact/spin.hpp"

#include <gtest/gtest.h>

#include "contact/alart_curnier.hpp"
#include "contact/cones.hpp"
#include "contact/contact_functions.hpp"
#include "contact/contact_problem.hpp"
#include "contact/ellipsoid.hpp"
#include "contact/local_solver.hpp"
#include "random_data.hpp"

namespace fclib {
namespace {

/// The support function of the section r_N = 1, which is de Saxce's term.
template <class Cone>
double support(const Cone& cone, const typename Cone::Vec& u) {
  typename Cone::Vec tangential = u;
  tangential[0] = 0;
  return cone.modified(tangential)[0];
}

/// How far x is from fitting into K: the largest part that is beyond its limit.
double beyond(const Spin<4>& cone, const ContactVector<4>& x) {
  return std::max({-x[0], x.segment<2>(1).norm() - cone.coefficient(0) * x[0],
                   std::abs(x[3]) - cone.coefficient(1) * x[0]});
}
double beyond(const Spin<6>& cone, const ContactVector<6>& x) {
  return std::max({-x[0], x.segment<2>(1).norm() - cone.coefficient(0) * x[0],
                   std::abs(x[3]) - cone.coefficient(1) * x[0],
                   x.tail<2>().norm() - cone.coefficient(2) * x[0]});
}
double beyond(const Ellipsoid<>& cone, const ContactVector<4>& x) {
  double square = 0;
  double idle = 0;
  for (int g = 0; g < 2; ++g) {
    const double size = g == 0 ? x.segment<2>(1).norm() : std::abs(x[3]);
    if (cone.coefficient(g) > 0) {
      square += std::pow(size / cone.coefficient(g), 2);
    } else {
      idle = std::max(idle, size);
    }
  }
  const double most = std::max(cone.coefficient(0), cone.coefficient(1));
  return std::max({-x[0], idle, (std::sqrt(square) - x[0]) * std::min(1.0, most)});
}

/// Moreau's decomposition: x = P_K(x) + z with z in the polar cone, orthogonal to P_K(x).
template <class Cone>
void expect_projection(const Cone& cone, double size, testing::RandomData& random) {
  using Vec = typename Cone::Vec;
  const double rounding = 1e-14 * (1 + size) * (1 + size);
  for (int k = 0; k < 1000; ++k) {
    Vec x = random.vector(Cone::dim);
    if (k % 4 == 0) x.template tail<Cone::dim - 1>().setZero();
    if (k % 4 == 1) x[3] = 0;
    if (k % 4 == 2) x.template segment<2>(1).setZero();
    if (k % 8 == 3) x[0] = 0;
    const Vec y = cone.project(x);
    const Vec z = x - y;
    EXPECT_LE(beyond(cone, y), rounding);
    EXPECT_NEAR(y.dot(z), 0, rounding);
    EXPECT_LE(z[0] + support(cone, z), rounding);  // z . k <= 0 for all k in K
    EXPECT_LT((cone.project(y) - y).norm(), rounding);
    // the natural map without a velocity is what is outside
    const Vec outside = natural_map(cone, Vec(Vec::Zero()), x);
    EXPECT_LT((outside - z).norm(), rounding);
  }
}

constexpr double coefficients[] = {0.0, 1e-3, 0.3, 1.0, 20.0};

TEST(SpinCone, projection_satisfies_the_decomposition_of_Moreau) {
  testing::RandomData random(21);
  for (const double mu : coefficients) {
    for (const double mu_s : coefficients) {
      const double size = std::max(mu, mu_s);
      expect_projection(Spin<4>({mu, mu_s}), size, random);
      expect_projection(Ellipsoid<>(mu, mu_s), size, random);
      for (const double mu_r : {0.0, 0.05, 20.0}) {
        expect_projection(Spin<6>({mu, mu_s, mu_r}), std::max(size, mu_r), random);
      }
    }
  }
}

TEST(SpinCone, projection_by_hand) {
  using Vec = ContactVector<4>;
  const Spin<4> cone({0.5, 2});
  // both limits bind: n = (1 + 0.5 * 6 + 2 * 14) / (1 + 0.25 + 4)
  const double n = 32 / 5.25;
  EXPECT_LT((cone.project(Vec(1, 0, -6, 14)) - Vec(n, 0, -0.5 * n, 2 * n)).norm(), 1e-14);
  // sliding alone: n = (1 + 0.5 * 6) / 1.25
  EXPECT_LT((cone.project(Vec(1, 0, -6, 3)) - Vec(3.2, 0, -1.6, 3)).norm(), 1e-15);
  // spin alone: n = (1 + 2 * 7) / 5
  EXPECT_LT((cone.project(Vec(1, 0.5, 0, 7)) - Vec(3, 0.5, 0, 6)).norm(), 1e-14);
  // without friction of either kind a component is taken away
  EXPECT_EQ(Spin<4>({0, 0}).project(Vec(1, 2, 3, 4)), Vec(1, 0, 0, 0));
  EXPECT_EQ(Ellipsoid<>(0, 0).project(Vec(1, 2, 3, 4)), Vec(1, 0, 0, 0));
}

TEST(SpinCone, the_ellipsoid_of_equal_axes_is_the_cone_of_Coulomb) {
  testing::RandomData random(22);
  for (const double mu : {0.0, 0.3, 1.0, 1e5}) {
    const Ellipsoid<> cone(mu, mu);
    const Coulomb<4> round(mu);
    for (int k = 0; k < 1000; ++k) {
      const ContactVector<4> u = random.vector(4);
      const ContactVector<4> r = random.vector(4);
      EXPECT_LT((cone.project(r) - round.project(r)).norm(), 1e-14 * (1 + r.norm()));
      EXPECT_LT((cone.modified(u) - round.modified(u)).norm(), 1e-14 * (1 + mu) * (1 + u.norm()));
      EXPECT_LT((natural_map(cone, u, r) - natural_map(round, u, r)).norm(),
                1e-13 * (r.norm() + u.norm()));
    }
  }
}

TEST(SpinCone, without_spin_is_the_cone_of_Coulomb_and_bears_no_spin) {
  testing::RandomData random(23);
  const Coulomb<3> plain(0.6);
  for (int k = 0; k < 200; ++k) {
    const ContactVector<4> x = random.vector(4);
    const ContactVector<3> expected = plain.project(ContactVector<3>(x.head<3>()));
    const auto expect = [&](const ContactVector<4>& found) {
      EXPECT_LT((found.head<3>() - expected).norm(), 1e-14);
      EXPECT_EQ(found[3], 0);
    };
    expect(Spin<4>({0.6, 0}).project(x));
    expect(Ellipsoid<>(0.6, 0).project(x));
  }
}

/// r and u of a status, by the law itself.
template <class Cone>
void expect_law(const Cone& cone, const typename Cone::Vec& u, const typename Cone::Vec& r,
                double size) {
  for (const double rho : {1.0, 1e-6, 1e6}) {
    EXPECT_LT(natural_map(cone, u, r, rho).norm(), 1e-14 * (r.norm() + rho * size)) << rho;
  }
}

TEST(SpinCone, natural_map_is_zero_for_each_status) {
  using Vec = ContactVector<4>;
  const Vec none = Vec::Zero();
  for (const double mu : {0.5, 1e4, 1e10}) {
    for (const double mu_s : {0.02, 1e-8, 1e10}) {
      const Spin<4> cone({mu, mu_s});
      const Ellipsoid<> coupled(mu, mu_s);
      const Vec u(0.3, 1, 2, -1);
      expect_law(cone, u, none, 1);  // open
      expect_law(coupled, u, none, 1);
      const Vec held(2, 0.3 * mu, -0.4 * mu, 0.4 * mu_s);  // sticks
      expect_law(cone, none, held, 1);
      expect_law(coupled, none, held, 1);
      Vec slip(0, 3, 4, -2);
      expect_law(cone, slip, Vec(2, -1.2 * mu, -1.6 * mu, 2 * mu_s), 6);
      // the ellipsoid: r_t = -r_N E^2 u_t / ||E u_t||
      const double norm = std::hypot(mu * 5, mu_s * 2);
      expect_law(
          coupled, slip,
          Vec(2, -2 * mu * mu * 3 / norm, -2 * mu * mu * 4 / norm, 2 * mu_s * mu_s * 2 / norm), 6);
      slip[3] = 0;  // it slides and does not turn
      expect_law(cone, slip, Vec(2, -1.2 * mu, -1.6 * mu, 0.3 * mu_s), 6);
      slip = Vec(0, 0, 0, 2);  // it turns and does not slide
      expect_law(cone, slip, Vec(2, 0.2 * mu, 0, -2 * mu_s), 6);
      expect_law(coupled, slip, Vec(2, 0, 0, -2 * mu_s), 6);
      // pushed the wrong way
      EXPECT_GT(natural_map(cone, slip, Vec(2, 0, 0, 2 * mu_s)).norm(), 1e-3 * std::min(1.0, mu_s));
      EXPECT_GT(natural_map(coupled, slip, Vec(2, 0, 0, 2 * mu_s)).norm(),
                1e-3 * std::min(1.0, mu_s));
    }
  }
}

/// The derivative of a function by differences.
template <int D, class F>
ContactMatrix<D> differences(const F& f, const ContactVector<D>& x) {
  constexpr double step = 1e-6;
  ContactMatrix<D> result;
  for (int k = 0; k < D; ++k) {
    const ContactVector<D> e = step * ContactVector<D>::Unit(k);
    result.col(k) = (f(ContactVector<D>(x + e)) - f(ContactVector<D>(x - e))) / (2 * step);
  }
  return result;
}

template <class Cone>
void expect_jacobians(const Cone& cone, testing::RandomData& random) {
  using Vec = typename Cone::Vec;
  constexpr int D = Cone::dim;
  for (int k = 0; k < 100; ++k) {
    const Vec x = 3 * random.vector(D);
    const auto project = [&](const Vec& y) { return cone.project(y); };
    const auto disks = [&](const Vec& y) { return alart_curnier_projection(cone, y); };
    const auto modified = [&](const Vec& y) { return cone.modified(y); };
    EXPECT_LT((projection_jacobian(cone, x) - differences<D>(project, x)).norm(), 1e-7);
    EXPECT_LT((alart_curnier_jacobian(cone, x) - differences<D>(disks, x)).norm(), 1e-7);
    EXPECT_LT((modified_jacobian(cone, x) - differences<D>(modified, x)).norm(), 1e-7);
  }
}

TEST(SpinCone, jacobians_are_those_of_differences) {
  testing::RandomData random(24);
  expect_jacobians(Spin<4>({0.5, 0.2}), random);
  expect_jacobians(Spin<6>({0.5, 0.2, 0.1}), random);
  expect_jacobians(Coulomb<4>(0.5), random);
}

/// A contact with a planted solution of one of these kinds: open, sticking, sliding, turning, all,
/// at the edges of the law.
template <class Cone>
void expect_local(const Cone& cone, testing::RandomData& random) {
  using Vec = typename Cone::Vec;
  constexpr int D = Cone::dim;
  for (int k = 0; k < 200; ++k) {
    Vec u = Vec::Zero();
    Vec r = Vec::Zero();
    r[0] = k % 9 == 8 ? 1e-9 : random.uniform(0.1, 2);  // 1e-9: it grazes
    for_each_group<Cone>([&](auto g) {
      const ContactVector<Cone::size(g)> way = random.vector(Cone::size(g)).normalized();
      const bool moves = (k >> g) % 2 == 1;
      const double share = moves ? 1 : k % 5 == 0 ? 1 : random.uniform(0, 0.9);  // 1: just sticks
      r.template segment<Cone::size(g)>(Cone::start(g)) = -share * cone.coefficient(g) * r[0] * way;
      if (moves) u.template segment<Cone::size(g)>(Cone::start(g)) = random.uniform(0.1, 2) * way;
    });
    const Eigen::MatrixXd H = random.dense(2 * D, D);
    ContactMatrix<D> a = H.transpose() * H;
    // a small body turns far more easily than it moves
    const Vec scale = Vec::Ones() + 30 * Vec::Unit(3);
    a = scale.asDiagonal() * a * scale.asDiagonal();
    const Vec b = u - a * r;
    ContactProblem<Cone> contact(a, cone);
    Vec found = Vec::Zero();
    LocalStep<Cone> step;
    step.iterations = 2000;
    for (int again = 0; again < 20; ++again) step(contact, b, found);
    const double size = found.norm() + b.norm() / a.norm();
    EXPECT_LT(natural_map(cone, Vec(a * found + b), found, 1 / a.norm()).norm(), 1e-9 * size)
        << D << " " << k;
  }
}

TEST(SpinCone, local_solver_solves_planted_contacts) {
  testing::RandomData random(25);
  for (const double mu : {0.0, 0.3, 0.8}) {
    for (const double mu_s : {0.0, 0.01, 0.5}) {
      expect_local(Spin<4>({mu, mu_s}), random);
      expect_local(Spin<6>({mu, mu_s, 0.02}), random);
      expect_local(Spin<6>({mu, mu_s, 0}), random);
    }
    expect_local(Coulomb<4>(mu), random);
  }
}

TEST(SpinCone, the_coefficients_are_those_of_the_contact) {
  const Friction friction{.mu = Eigen::Vector2d(0.2, 0.7),
                          .mu_r = Eigen::Vector2d(0.01, 0.02),
                          .mu_s = Eigen::Vector2d(0.03, 0.04)};
  const Spin<6> cone(friction, 1);
  EXPECT_EQ(cone.coefficient(0), 0.7);
  EXPECT_EQ(cone.coefficient(1), 0.04);
  EXPECT_EQ(cone.coefficient(2), 0.02);
  EXPECT_EQ(Ellipsoid<>(friction, 0).coefficient(1), 0.03);
  const Friction second = friction.of(std::vector<int>{1});
  EXPECT_EQ(second.mu_s.size(), 1);
  EXPECT_EQ(second.mu_s[0], 0.04);
}

}  // namespace
}  // namespace fclib
