#include "methods/proximal_point.hpp"

#include <gtest/gtest.h>

#include "contact/coulomb.hpp"

namespace fclib {
namespace {

/// Two contacts of one body at one point, whose free velocities differ by `gap`.
ReducedProblem one_contact_twice(double gap) {
  SparseColumns W(6, 6);
  for (int row = 0; row < 6; ++row) {
    W.insert(row, row) = 1;
    W.insert(row, (row + 3) % 6) = 1;
  }
  ReducedProblem problem{.W = {Matrix::from_eigen(W), 3}, .q = Vector(6), .friction = {}};
  problem.q << -1, 0.1, 0.05, -1, 0.1 + gap, 0.05;
  problem.friction.mu = Vector::Constant(2, 0.5);
  problem.scale = problem.q.norm();
  return problem;
}

TEST(ProximalPoint, a_last_velocity_moves_reactions_far) {
  // both cannot stick: the prestress grows until one of them slides, by 5e-12
  const ReducedProblem problem = one_contact_twice(5e-12);
  CoupledSystem system(problem);
  ProximalPoint<Coulomb<3>> method(problem, system);
  Vector r = Vector::Zero(6);
  std::int64_t steps = 0;
  const double error = method.solve({.kappa = 1000, .easy = 10, .max_factorisations = 60}, 1e-12, r,
                                    [&](double) { return ++steps == 60; });
  EXPECT_LE(error, 1e-12);
  EXPECT_LT(steps, 30);
  EXPECT_NEAR(r[0] + r[3], 1, 1e-6);
}

}  // namespace
}  // namespace fclib
