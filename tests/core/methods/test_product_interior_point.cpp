#include "methods/product_interior_point.hpp"

#include <gtest/gtest.h>

#include "random_data.hpp"
#include "reduced/relative_error.hpp"

namespace fclib {
namespace {

/// Contacts on enough coordinates that the reactions are unique, all of which approach; the first
/// ones without friction of one kind or the other, or of all.
template <class Cone>
ReducedProblem random_problem(std::uint64_t seed, Index nc) {
  constexpr int D = Cone::dim;
  testing::RandomData random(seed);
  const Eigen::Index m = Eigen::Index{D} * nc;
  const Eigen::MatrixXd H = random.dense(2 * m, m);
  ReducedProblem problem{
      .W = {Matrix::from_eigen(SparseColumns((H.transpose() * H).sparseView())), D},
      .q = random.vector(m),
      .friction = {}};
  for (Index a = 0; a < nc; ++a) problem.q[D * a] = -1;
  problem.friction.mu = Vector::Constant(nc, 1.0);
  Vector other = Vector::Constant(nc, 0.5);
  problem.friction.mu[0] = problem.friction.mu[1] = 0;
  other[1] = other[2] = 0;
  if (D % 2 == 0) problem.friction.mu_s = other;
  if (D != 4) problem.friction.mu_r = other;
  problem.scale = problem.q.norm();
  return problem;
}

/// The last digits are left to the proximal point.
template <class Cone>
void expect_solved(double tolerance) {
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    const ReducedProblem problem = random_problem<Cone>(seed, 20);
    CoupledSystem system(problem);
    ProductInteriorPoint<Cone> method(problem, system);
    Vector r;
    int iterations = 0;
    method.solve({}, Vector::Zero(problem.m()), [&](double error, const Vector& at) {
      r = at;
      ++iterations;
      return error <= tolerance;
    });
    Vector u;
    problem.velocity(r, u);
    EXPECT_LE(relative_error<Cone>(problem, u, r), tolerance) << seed;
    EXPECT_LT(iterations, 20) << seed;  // with a wrong Jacobian there are more
  }
}

TEST(ProductInteriorPoint, solves_rolling_in_the_plane_and_in_space) {
  expect_solved<Rolling<3>>(2e-6);
  expect_solved<Rolling<5>>(2e-6);
}

TEST(ProductInteriorPoint, solves_spin_with_and_without_rolling) {
  expect_solved<Spin<4>>(1e-5);
  expect_solved<Spin<6>>(1e-5);
}

}  // namespace
}  // namespace fclib
