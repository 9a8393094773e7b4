#include "embed/workspace.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include "counted_allocations.hpp"
#include "falling_spheres.hpp"
#include "random_problems.hpp"
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

TEST(Workspace, JointsAreRefused) {
  LocalProblem problem;
  problem.s = Vector::Ones(1);
  EXPECT_THROW(LocalView{problem}, Error);
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

TEST(Workspace, APatternIsKnownAgain) {
  // two islands, in four storages; entries of a triplet add up
  testing::RandomData random(3);
  Eigen::MatrixXd W = Eigen::MatrixXd::Zero(12, 12);
  const auto fill = [&] {
    for (const Index at : {0, 6}) {
      Eigen::MatrixXd h(8, 6);
      for (Eigen::Index j = 0; j < 6; ++j) h.col(j) = random.vector(8);
      W.block<6, 6>(at, at) = h.transpose() * h;
    }
  };
  for (const Storage storage : {Storage::triplet, Storage::csc, Storage::csr, Storage::dense}) {
    Workspace kept;
    for (int k = 0; k < 4; ++k) {
      fill();
      LocalProblem problem;
      problem.spacedim = 3;
      problem.W = Matrix::from_eigen(SparseColumns(W.sparseView()));
      if (storage == Storage::triplet) {
        problem.W = converted(problem.W, Storage::triplet);
        problem.W.x[0] -= 1;
        problem.W.i.push_back(problem.W.i[0]);
        problem.W.p.push_back(problem.W.p[0]);
        problem.W.x.push_back(1);
      } else {
        problem.W = converted(problem.W, storage);
      }
      problem.q = random.vector(12);
      problem.mu = Vector::Constant(4, 0.3);
      if (k == 3) {  // another pattern of the same size: one island
        for (Index a = 0; a < 12; ++a) W(a, (a + 6) % 12) = a % 3 == 0 ? 0.1 : 0.0;
        problem.W = converted(Matrix::from_eigen(SparseColumns(W.sparseView())), storage);
      }
      kept.forget();
      const Workspace::Answer again = kept.solve(LocalView(problem), {}, {});
      const std::vector<double> r(again.r.begin(), again.r.end());
      Workspace fresh;
      const Workspace::Answer first = fresh.solve(LocalView(problem), {}, {});
      EXPECT_EQ(again.status, Status::converged);
      EXPECT_EQ(r, std::vector<double>(first.r.begin(), first.r.end()));
      Solution solution;
      solution.r = Eigen::Map<const Vector>(r.data(), 12);
      EXPECT_NEAR(merit(problem, solution).error, again.error, 1e-15);
      problem.W.x[0] = std::numeric_limits<double>::quiet_NaN();
      EXPECT_THROW(kept.solve(LocalView(problem), {}, {}), Error);
    }
  }
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
