#include "methods/pivoting.hpp"

#include <gtest/gtest.h>

#include "random_data.hpp"
#include "reduced/relative_error.hpp"

namespace fclib {
namespace {

TEST(Pivoting, is_exact_in_the_plane) {
  // the polygon of two edges is the disk
  testing::RandomData random(12);
  for (int trial = 0; trial < 20; ++trial) {
    const Index nc = 6;
    const Eigen::MatrixXd H = random.dense(4 * nc, 2 * nc);
    ReducedProblem problem;
    problem.W = BlockMatrix(Matrix::from_eigen((H.transpose() * H).sparseView()), 2);
    problem.q = random.vector(2 * nc);
    problem.friction.mu = Vector::Constant(nc, 0.6);
    problem.scale = problem.q.norm();
    const Pivoting<Coulomb<2>> method(problem, 4);
    Vector r;
    method.solve(Vector::Ones(method.size()), 1000, r);
    Vector u;
    problem.velocity(r, u);
    EXPECT_LT(relative_error<Coulomb<2>>(problem, u, r), 1e-10) << trial;
  }
}

}  // namespace
}  // namespace fclib
