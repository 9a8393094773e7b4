#include "reduced/round.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include "random_data.hpp"

namespace fclib {
namespace {

TEST(Round, ItsBodiesHaveItsDelassusMatrix) {
  // contacts that slide and spin, slide alone, spin alone, and do neither
  const Vector mu = Vector{{0.5, 0.7, 0.0, 0.0}};
  const Vector mu_s = Vector{{0.01, 0.0, 0.02, 0.0}};
  constexpr Index n = 9;
  constexpr Index m = 16;
  testing::RandomData random(1);
  const Eigen::MatrixXd root = random.dense(n, n);
  const Eigen::MatrixXd M = root * root.transpose() + Eigen::MatrixXd::Identity(n, n);
  const Eigen::MatrixXd H = random.dense(n, m);
  const Matrix W =
      Matrix::from_eigen(SparseColumns((H.transpose() * M.llt().solve(H)).sparseView()));
  const Primal primal{SparseColumns(M.sparseView()), SparseColumns(H.sparseView())};
  ReducedProblem given{.W = BlockMatrix(W, 4), .q = random.vector(m), .friction = {}};
  given.friction.mu = mu;
  given.friction.mu_s = mu_s;
  given.friction.coupled = true;
  given.primal = &primal;

  const Round round(W, given);
  const ReducedProblem& problem = round.problem();
  ASSERT_NE(problem.primal, nullptr);
  const Eigen::MatrixXd mass = problem.primal->M;
  const Eigen::MatrixXd directions = problem.primal->H;
  const Eigen::MatrixXd from_bodies = directions.transpose() * mass.llt().solve(directions);
  Eigen::MatrixXd from_contacts(m, m);
  for (Index k = 0; k < m; ++k) {
    Vector column;
    problem.W.multiply_add(Vector::Unit(m, k), Vector::Zero(m), column);
    from_contacts.col(k) = column;
  }
  EXPECT_LT((from_bodies - from_contacts).norm(), 1e-12 * from_contacts.norm());
  // each component that is taken away is moved by a mass of its own
  EXPECT_EQ(mass.rows(), n + 3);
  EXPECT_GT(from_contacts.diagonal().minCoeff(), 0);
}

}  // namespace
}  // namespace fclib
