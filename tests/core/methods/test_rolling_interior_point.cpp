#include "methods/rolling_interior_point.hpp"

#include <gtest/gtest.h>

#include "random_data.hpp"
#include "reduced/relative_error.hpp"

namespace fclib {
namespace {

/// Contacts on enough coordinates that the reactions are unique, all of which approach; the first
/// ones without friction of one kind or the other, or of both.
template <int D>
ReducedProblem random_problem(std::uint64_t seed, Index nc) {
  testing::RandomData random(seed);
  const Eigen::Index m = Eigen::Index{D} * nc;
  const Eigen::MatrixXd H = random.dense(2 * m, m);
  ReducedProblem problem{
      .W = {Matrix::from_eigen(SparseColumns((H.transpose() * H).sparseView())), D},
      .q = random.vector(m),
      .friction = {}};
  for (Index a = 0; a < nc; ++a) problem.q[D * a] = -1;
  problem.friction.mu = Vector::Constant(nc, 1.0);
  problem.friction.mu_r = Vector::Constant(nc, 0.5);
  problem.friction.mu[0] = problem.friction.mu[1] = 0;
  problem.friction.mu_r[1] = problem.friction.mu_r[2] = 0;
  problem.scale = problem.q.norm();
  return problem;
}

template <int D>
void expect_solved() {
  constexpr double tolerance = 2e-6;  // the last digits are left to the proximal point
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    const ReducedProblem problem = random_problem<D>(seed, 20);
    CoupledSystem system(problem);
    RollingInteriorPoint<D> method(problem, system);
    Vector r;
    int iterations = 0;
    method.solve({}, Vector::Zero(problem.m()), [&](double error, const Vector& at) {
      r = at;
      ++iterations;
      return error <= tolerance;
    });
    Vector u;
    problem.velocity(r, u);
    EXPECT_LE(relative_error<Rolling<D>>(problem, u, r), tolerance) << seed;
    EXPECT_LT(iterations, 20) << seed;  // with a wrong Jacobian there are more
  }
}

TEST(RollingInteriorPoint, solves_in_the_plane_and_in_space) {
  expect_solved<3>();
  expect_solved<5>();
}

}  // namespace
}  // namespace fclib
