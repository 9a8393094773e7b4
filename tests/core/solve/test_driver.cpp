// The driver passes on no word that nothing stands behind.

#include "solve/driver.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace fclib {
namespace {

/// W = 1, a body that closes at 1 m/s.
LocalProblem closing() {
  SparseColumns W(2, 2);
  W.setIdentity();
  LocalProblem problem;
  problem.spacedim = 2;
  problem.W = Matrix::from_eigen(W);
  problem.q = Vector::Zero(2);
  problem.q[0] = -1;
  problem.mu = Vector::Constant(1, 0.5);
  return problem;
}

/// Says a word, and gives a normal reaction.
Solver that_says(Status status, double reaction) {
  Solver solver;
  solver.name = "liar";
  solver.dimensions = {2};
  solver.max_iterations = 10;
  solver.solve = [=](const ReducedProblem&, const OptionValues&, const Settings&, Vector& r) {
    r.setZero();
    r[0] = reaction;
    Outcome outcome;
    outcome.status = status;
    return outcome;
  };
  return solver;
}

Result solved(const Solver& solver) { return solve(closing(), solver, Settings{}, {}, {}); }

TEST(Driver, says_infeasible_with_a_proof_alone) {
  const Result result = solved(that_says(Status::infeasible, 0.5));
  EXPECT_EQ(result.status, Status::stalled);
  EXPECT_FALSE(result.certificate.proven());
}

TEST(Driver, judges_converged_itself) {
  EXPECT_EQ(solved(that_says(Status::converged, 0.5)).status, Status::inaccurate);
  EXPECT_EQ(solved(that_says(Status::diverged, 1)).status, Status::converged);
}

TEST(Driver, returns_numbers) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const Status status : {Status::converged, Status::stalled}) {
    const Result result = solved(that_says(status, nan));
    EXPECT_EQ(result.status, Status::diverged);
    EXPECT_EQ(result.solution.r, Vector::Zero(2));
    EXPECT_EQ(result.error, 1);
  }
}

}  // namespace
}  // namespace fclib
