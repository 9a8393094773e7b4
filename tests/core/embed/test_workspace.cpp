#include "embed/workspace.hpp"

#include <gtest/gtest.h>

#include "counted_allocations.hpp"
#include "falling_spheres.hpp"
#include "solve/driver.hpp"

namespace fclib {
namespace {

/// Steps a heap of spheres; returns what the solves have allocated.
long allocated_in_steps(Workspace& workspace) {
  testing::FallingSpheres spheres;
  long allocated = 0;
  std::size_t most = 0;
  constexpr int steps = 400;
  for (int k = 0; k < steps; ++k) {
    const LocalProblem& problem = spheres.problem();
    const LocalView view(problem);
    const long before = testing::allocations();
    const Workspace::Answer answer = workspace.solve(view, spheres.names, {});
    allocated += testing::allocations() - before;
    EXPECT_EQ(answer.status, Status::converged) << "step " << k;
    EXPECT_FALSE(answer.by_auto) << "step " << k;
    most = std::max(most, spheres.names.size());
    Solution solution;
    solution.r = Eigen::Map<const Vector>(answer.r.data(), problem.q.size());
    EXPECT_EQ(merit(problem, solution).error, answer.error);
    if (k % 50 == 49) {
      EXPECT_LE(workspace.solve(view, spheres.names, {}).iterations, 2) << "what it knows";
    }
    spheres.move(solution.r);
  }
  EXPECT_GT(most, 50U);
  return allocated;
}

TEST(Workspace, StepsThirtyBodiesWithoutAllocation) {
  Workspace workspace;
  const long first = allocated_in_steps(workspace);
  workspace.forget();
  const long again = allocated_in_steps(workspace);
  if (testing::allocations() < 0) GTEST_SKIP() << "a sanitizer has malloc";
  EXPECT_GT(first, 0) << "new is counted too";
  EXPECT_EQ(again, 0) << "it has seen the largest";
}

/// A contact at rest on the ground, W = 1 / mass.
struct OneContact {
  LocalProblem problem;

  OneContact() {
    problem.spacedim = 2;
    problem.W.storage = Storage::dense;
    problem.W.rows = problem.W.cols = 2;
    problem.W.x = {1, 0, 0, 1};
    problem.q = Vector::Zero(2);
    problem.q << -1, 0.1;
    problem.mu = Vector::Constant(1, 0.5);
  }
};

TEST(Workspace, KnowsContactsByTheirNames) {
  const OneContact one;
  Workspace workspace;
  const std::vector<std::int64_t> name{7};
  workspace.solve(LocalView(one.problem), name, {});
  std::vector<double> r(4, -1.0);
  const std::vector<std::int64_t> names{3, 7};
  workspace.guess(2, names, r);
  EXPECT_EQ(r, (std::vector<double>{0, 0, 1, -0.1}));
  workspace.forget();
  workspace.guess(2, names, r);
  EXPECT_EQ(r, (std::vector<double>(4, 0.0)));
}

TEST(Workspace, RefusesWhatIsWrong) {
  Workspace workspace;
  const auto refused = [&](const LocalProblem& problem, const char* where,
                           const std::vector<std::int64_t>& names = {}) {
    try {
      workspace.solve(LocalView(problem), names, {});
      ADD_FAILURE() << where;
    } catch (const Error& error) {
      EXPECT_EQ(error.where, where);
    }
  };
  OneContact one;
  one.problem.mu[0] = -1;
  refused(one.problem, "mu");
  one = {};
  one.problem.W.x[3] = std::numeric_limits<double>::infinity();
  refused(one.problem, "W");
  one = {};
  one.problem.W = {
      .storage = Storage::csr, .rows = 2, .cols = 2, .p = {0, 3, 1}, .i = {9}, .x = {1}};
  refused(one.problem, "W");
  one = {};
  refused(one.problem, "contacts", {1, 2});
  one.problem.q = Vector::Zero(3);
  refused(one.problem, "q");
}

}  // namespace
}  // namespace fclib
