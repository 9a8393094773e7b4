#include "convert/condense.hpp"

#include <gtest/gtest.h>

#include "convert/eliminate.hpp"
#include "random_data.hpp"

namespace fclib {
namespace {

GlobalProblem random_global(testing::RandomData& random, Eigen::Index n, Eigen::Index nc,
                            Eigen::Index p) {
  GlobalProblem problem;
  problem.M = Matrix::from_eigen(random.definite(n, 0.2));
  problem.H = Matrix::from_eigen(random.sparse(n, 3 * nc, 0.5));
  problem.f = random.vector(n);
  problem.w = random.vector(3 * nc);
  problem.mu = Vector::Constant(nc, 0.4);
  if (p > 0) {
    problem.G = Matrix::from_eigen(random.sparse(n, p, 0.8));
    problem.b = random.vector(p);
  }
  validate(problem);
  return problem;
}

TEST(Condensation, agrees_with_dense_algebra) {
  testing::RandomData random(11);
  const GlobalProblem problem = random_global(random, 18, 4, 3);
  const LocalProblem local = condense(problem);
  validate(local);
  const Eigen::MatrixXd m(to_eigen(problem.M));
  const Eigen::MatrixXd h(to_eigen(problem.H));
  const Eigen::MatrixXd g(to_eigen(problem.G));
  const Eigen::MatrixXd inverse = m.inverse();
  const auto close = [](const Matrix& a, const Eigen::MatrixXd& b) {
    return (Eigen::MatrixXd(to_eigen(a)) - b).norm() <= 1e-12 * (1 + b.norm());
  };
  EXPECT_TRUE(close(local.W, h.transpose() * inverse * h));
  EXPECT_TRUE(close(local.V, h.transpose() * inverse * g));
  EXPECT_TRUE(close(local.R, g.transpose() * inverse * g));
  EXPECT_LT((local.q - (h.transpose() * inverse * problem.f + problem.w)).norm(), 1e-12);
  EXPECT_LT((local.s - (g.transpose() * inverse * problem.f + problem.b)).norm(), 1e-12);
}

TEST(Condensation, expand_and_eliminate_satisfy_every_equation) {
  testing::RandomData random(12);
  const GlobalProblem problem = random_global(random, 18, 4, 3);
  const Condensation condensation(problem);
  const Elimination elimination(condensation.local());
  Solution solution;
  solution.r = random.vector(12);
  solution = condensation.expand(elimination.expand(solution));

  Vector momentum = problem.f;
  multiply_add(problem.H, solution.r, momentum);
  multiply_add(problem.G, solution.l, momentum);
  EXPECT_LT((to_eigen(problem.M) * solution.v - momentum).norm(), 1e-11);
  EXPECT_LT((to_eigen(problem.G).transpose() * solution.v + problem.b).norm(), 1e-11);
  const LocalProblem& plain = elimination.plain();
  EXPECT_LT((to_eigen(plain.W) * solution.r + plain.q - solution.u).norm(), 1e-11);
}

TEST(Condensation, a_problem_without_contacts_has_an_empty_local_form) {
  testing::RandomData random(13);
  const GlobalProblem problem = random_global(random, 6, 0, 0);
  const LocalProblem local = condense(problem);
  validate(local);
  EXPECT_EQ(local.size(Dim::m), 0);
  EXPECT_EQ(local.W.rows, 0);
}

}  // namespace
}  // namespace fclib
