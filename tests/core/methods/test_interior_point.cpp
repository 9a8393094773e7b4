#include "methods/interior_point.hpp"

#include <gtest/gtest.h>

#include "fused_kernels.hpp"
#include "random_data.hpp"

namespace fclib {
namespace {

/// Contacts on enough coordinates that the reactions are unique, all of which approach.
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
  problem.friction.mu = Vector::Constant(nc, 0.4);
  problem.friction.mu[0] = 0;
  problem.scale = problem.q.norm();
  return problem;
}

/// At the root of the rounding unit the error begins to creep, since contact 0 has a cone without
/// an inside. With fused kernels it does so earlier.
constexpr double tolerance = testing::fused_kernels ? 1e-7 : 1e-8;

struct End {
  double first = 0;  // error of the start
  double error = 0;
  int iterations = 0;
};

template <int D>
End run(const ReducedProblem& problem, double tau, Vector& r) {
  CoupledSystem system(problem);
  InteriorPoint<D> method(problem, system);
  End end;
  const Vector guess = r;
  method.solve({.tau = tau}, guess, [&](double error, const Vector& at) {
    if (method.iterations() == 0) end.first = error;
    end.error = error;
    r = at;
    return error <= tolerance;
  });
  end.iterations = method.iterations();
  return end;
}

template <int D>
void expect_less_work_near_a_guess() {
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    const ReducedProblem problem = random_problem<D>(seed, 20);
    Vector r = Vector::Zero(problem.m());
    const End cold = run<D>(problem, 1, r);
    ASSERT_LE(cold.error, tolerance);
    const End warm = run<D>(problem, 1e-6, r);
    EXPECT_LE(warm.error, tolerance);
    EXPECT_LT(warm.first, 1e-2 * cold.first);
    EXPECT_LT(warm.iterations, cold.iterations / 2) << seed;
  }
}

TEST(InteriorPoint, starts_near_the_guess) {
  expect_less_work_near_a_guess<2>();
  expect_less_work_near_a_guess<3>();
}

TEST(InteriorPoint, a_guess_outside_the_cones_will_do) {
  const ReducedProblem problem = random_problem<3>(1, 20);
  Vector r = Vector::Constant(problem.m(), -3);
  EXPECT_LE(run<3>(problem, 1, r).error, tolerance);
}

}  // namespace
}  // namespace fclib
