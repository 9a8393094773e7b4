#include "reduced/own_units.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "fused_kernels.hpp"
#include "methods/homotopy.hpp"
#include "methods/interior_point.hpp"
#include "methods/product_interior_point.hpp"
#include "random_data.hpp"

namespace fclib {
namespace {

constexpr Index contacts = 12;

/// s of each component: another mass of each contact, another length of what rolls.
template <class Cone>
Vector other_units() {
  testing::RandomData random(3);
  Vector s(Cone::dim * contacts);
  for (Index a = 0; a < contacts; ++a) {
    auto own = s.template segment<Cone::dim>(Cone::dim * a);
    own.setConstant(std::exp2(std::round(random.uniform(-12, 12))));
    for (int k = Cone::lengths; k < Cone::dim; ++k) own[k] *= std::exp2(a % 9 - 4);
  }
  return s;
}

template <class Cone>
ReducedProblem random_problem(const Vector& s) {
  constexpr int D = Cone::dim;
  testing::RandomData random(4);
  const Eigen::Index m = Eigen::Index{D} * contacts;
  const Eigen::MatrixXd H = random.dense(2 * m, m) * s.asDiagonal();
  ReducedProblem problem{
      .W = {Matrix::from_eigen(SparseColumns((H.transpose() * H).sparseView())), D},
      .q = random.vector(m),
      .friction = {}};
  for (Index a = 0; a < contacts; ++a) problem.q[D * a] = -1;
  problem.q = problem.q.cwiseProduct(s);
  problem.friction.mu = Vector::Constant(contacts, 0.6);
  problem.friction.mu[0] = 0;
  Vector length = Vector::Constant(contacts, 0.2);
  for (Index a = 0; a < contacts; ++a) length[a] *= s[D * a] / s[D * a + D - 1];
  if (D % 2 == 0 && Cone::groups > 1) problem.friction.mu_s = length;
  if (Cone::groups > 1 && D != 4) problem.friction.mu_r = length;
  problem.scale = problem.q.norm();
  return problem;
}

/// The method goes the same way, in r times s.
template <class Cone, class Method, class Rules>
void expect_same_way(const Rules& rules) {
  const Vector one = Vector::Ones(Cone::dim * contacts);
  const Vector other = other_units<Cone>();
  std::vector<Vector> ways[2];
  for (const bool changed : {false, true}) {
    const Vector& s = changed ? other : one;
    const ReducedProblem problem = random_problem<Cone>(s);
    CoupledSystem system(problem);
    Method method(problem, system);
    std::vector<Vector>& way = ways[changed];
    const auto report = [&](double, const Vector& r) {
      way.push_back(r.cwiseProduct(s));
      return way.size() == 8;
    };
    if constexpr (std::is_same_v<Rules, HomotopyRules>) {
      method.solve(rules, report);
    } else {
      method.solve(rules, Vector::Zero(problem.m()), report);
    }
  }
  ASSERT_EQ(ways[0].size(), 8);
  ASSERT_EQ(ways[1].size(), 8);
  // no direction is refined, and each iterate amplifies the rounding of the one before
  constexpr double bound = testing::fused_kernels ? 1e-7 : 1e-8;
  for (std::size_t k = 0; k < 8; ++k) {
    EXPECT_LT((ways[1][k] - ways[0][k]).norm(), bound * ways[0][k].norm()) << k;
  }
}

TEST(OwnUnits, interior_points_go_the_same_way_in_all_units) {
  expect_same_way<Coulomb<2>, InteriorPoint<2>>(InteriorPointRules{});
  expect_same_way<Coulomb<3>, InteriorPoint<3>>(InteriorPointRules{.smoothing = 0.3});
  expect_same_way<Rolling<3>, ProductInteriorPoint<Rolling<3>>>(InteriorPointRules{});
  expect_same_way<Rolling<5>, ProductInteriorPoint<Rolling<5>>>(InteriorPointRules{});
  expect_same_way<Spin<4>, ProductInteriorPoint<Spin<4>>>(InteriorPointRules{});
  expect_same_way<Spin<6>, ProductInteriorPoint<Spin<6>>>(InteriorPointRules{});
}

TEST(OwnUnits, the_homotopy_goes_the_same_way_in_all_units) {
  expect_same_way<Coulomb<3>, Homotopy<Coulomb<3>>>(HomotopyRules{});
  expect_same_way<Rolling<5>, Homotopy<Rolling<5>>>(HomotopyRules{});
  expect_same_way<Spin<6>, Homotopy<Spin<6>>>(HomotopyRules{});
}

TEST(OwnUnits, there_and_back) {
  const ReducedProblem problem = random_problem<Rolling<5>>(other_units<Rolling<5>>());
  const OwnUnits units(problem);
  EXPECT_DOUBLE_EQ(units.q().lpNorm<Eigen::Infinity>(), 1);
  testing::RandomData random(5);
  const Vector r = random.vector(problem.m());
  EXPECT_LT((units.reactions(units.to_own(r)) - r).norm(), 1e-14);
  Vector u;
  Vector own;
  problem.velocity(r, u);
  units.product(units.to_own(r), units.q(), own);
  EXPECT_LT((units.velocities(own) - u).norm(), 1e-13 * u.norm());
}

TEST(OwnUnits, what_nothing_moves_has_the_usual_unit) {
  for (const double left : {0.0, 1e-16}) {
    const Eigen::MatrixXd W = Vector{{4, 4, left, left}}.asDiagonal();
    ReducedProblem problem{.W = {Matrix::from_eigen(SparseColumns(W.sparseView())), 2},
                           .q = Vector{{-1, 0, 1, 0}},
                           .friction = {Vector::Ones(2), {}, {}}};
    EXPECT_EQ(OwnUnits(problem).to_own(Vector::Ones(4)), Vector::Constant(4, 4));
    problem.q.setZero();
    EXPECT_TRUE(OwnUnits(problem).q().isZero(0));
  }
}

}  // namespace
}  // namespace fclib
