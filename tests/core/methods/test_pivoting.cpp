#include "methods/pivoting.hpp"

#include <gtest/gtest.h>

#include "random_data.hpp"
#include "reduced/relative_error.hpp"

namespace fclib {
namespace {

ReducedProblem plane_problem(testing::RandomData& random, Index nc) {
  const Eigen::MatrixXd H = random.dense(4 * nc, 2 * nc);
  ReducedProblem problem;
  problem.W = BlockMatrix(Matrix::from_eigen((H.transpose() * H).sparseView()), 2);
  problem.q = random.vector(2 * nc);
  problem.friction.mu = Vector::Constant(nc, 0.6);
  problem.scale = problem.q.norm();
  return problem;
}

TEST(Pivoting, is_exact_in_the_plane) {
  // the polygon of two edges is the disk
  testing::RandomData random(12);
  for (int trial = 0; trial < 20; ++trial) {
    const ReducedProblem problem = plane_problem(random, 6);
    const Pivoting<Coulomb<2>> method(problem, 4);
    Vector r;
    method.solve(Vector::Ones(method.size()), 1000, [](int) { return false; }, r);
    Vector u;
    problem.velocity(r, u);
    EXPECT_LT(relative_error<Coulomb<2>>(problem, u, r), 1e-10) << trial;
  }
}

TEST(Pivoting, stops_between_pivots) {
  testing::RandomData random(13);
  const ReducedProblem problem = plane_problem(random, 6);
  const Pivoting<Coulomb<2>> method(problem, 4);
  Vector r;
  const Vector cover = Vector::Ones(method.size());
  ASSERT_GT(method.solve(cover, 1000, [](int) { return false; }, r), 3);
  for (const int most : {0, 3}) {
    EXPECT_EQ(method.solve(cover, 1000, [&](int pivots) { return pivots == most; }, r), most);
    EXPECT_EQ(r, Vector::Zero(problem.m()));
  }
}

}  // namespace
}  // namespace fclib
