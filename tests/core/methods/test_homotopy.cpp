#include "methods/homotopy.hpp"

#include <gtest/gtest.h>

#include "contact/coulomb.hpp"
#include "contact/rolling.hpp"
#include "random_data.hpp"

namespace fclib {
namespace {

/// Contacts of bodies with more coordinates than W has rows: each such problem has a solution.
template <class Cone>
ReducedProblem random_problem(testing::RandomData& random, Index nc) {
  constexpr int D = Cone::dim;
  const Eigen::Index m = D * nc;
  const Eigen::MatrixXd H = random.dense(2 * m, m);
  const Eigen::MatrixXd W = H.transpose() * H;
  ReducedProblem problem;
  problem.W = BlockMatrix(Matrix::from_eigen(W.sparseView()), D);
  problem.q = random.vector(m);
  problem.friction.mu = Vector::Constant(nc, 0.6);
  problem.friction.mu[0] = 0;
  if constexpr (Cone::groups == 2) {
    problem.friction.mu_r = Vector::Constant(nc, 0.2);
    problem.friction.mu_r[nc - 1] = 0;
  }
  problem.scale = problem.q.norm();
  return problem;
}

template <class Cone>
void arrives() {
  testing::RandomData random(6);
  for (int trial = 0; trial < 10; ++trial) {
    const ReducedProblem problem = random_problem<Cone>(random, 8);
    CoupledSystem system(problem);
    Homotopy<Cone> path(problem, system);
    double least = 1;
    double last = 1;
    bool falls = true;
    path.solve({}, [&](double error, const Vector&) {
      least = std::min(least, error);
      falls = falls && path.t() < last;
      last = path.t();
      return error < 1e-6;
    });
    EXPECT_LT(least, 1e-6) << trial;
    EXPECT_TRUE(falls || path.folds() > 0) << trial;
  }
}

TEST(Homotopy, ArrivesAtASolution) {
  arrives<Coulomb<2>>();
  arrives<Coulomb<3>>();
  arrives<Rolling<3>>();
  arrives<Rolling<5>>();
}

TEST(Homotopy, EndsWithinItsFactorisations) {
  testing::RandomData random(7);
  const ReducedProblem problem = random_problem<Coulomb<3>>(random, 8);
  CoupledSystem system(problem);
  Homotopy<Coulomb<3>> path(problem, system);
  path.solve({.max_factorisations = 10}, [](double, const Vector&) { return false; });
  EXPECT_LE(system.factorisations(), 15);
  EXPECT_GE(system.factorisations(), 10);
}

}  // namespace
}  // namespace fclib
