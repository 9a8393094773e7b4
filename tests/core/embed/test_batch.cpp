#include "embed/batch.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "counted_allocations.hpp"
#include "random_problems.hpp"
#include "solve/driver.hpp"

namespace fclib {
namespace {

/// Problems of 0 to 6 contacts, W of any rank, one behind another.
struct Problems {
  std::vector<std::int32_t> nc;
  std::vector<double> W, q, mu, r, u, error;
  std::vector<std::int32_t> status, iterations;
  Batch batch;

  Problems(int spacedim, int count, int seed, int least = 0) {
    testing::RandomData random(seed);
    for (int k = 0; k < count; ++k) {
      const Index contacts = least + k % (7 - least);
      const Eigen::Index m = spacedim * contacts;
      // 6 rows: redundant contacts
      Eigen::MatrixXd h(6, m);
      for (Eigen::Index j = 0; j < m; ++j) h.col(j) = random.vector(6);
      // not every processor rounds a product of matrices to a symmetric one
      const Eigen::MatrixXd product = h.transpose() * h;
      const Eigen::MatrixXd w = product.selfadjointView<Eigen::Lower>();
      const Vector free = h.transpose() * random.vector(6);
      nc.push_back(contacts);
      W.insert(W.end(), w.data(), w.data() + w.size());
      q.insert(q.end(), free.begin(), free.end());
      for (Index a = 0; a < contacts; ++a) mu.push_back(0.1 * a);
    }
    r.resize(q.size());
    u.resize(q.size());
    error.resize(nc.size());
    status.resize(nc.size());
    iterations.resize(nc.size());
    batch.spacedim = spacedim;
    batch.count = count;
    batch.nc = nc.data();
    batch.W = W.data();
    batch.q = q.data();
    batch.mu = mu.data();
    batch.r = r.data();
    batch.u = u.data();
    batch.status = status.data();
    batch.error = error.data();
    batch.iterations = iterations.data();
  }
};

TEST(Batch, IsJudgedByTheMerit) {
  for (const int d : {2, 3}) {
    Problems problems(d, 200, 3);
    const BatchOutcome outcome = solve_batch(problems.batch);
    EXPECT_EQ(outcome.converged, 200);
    EXPECT_LT(outcome.by_auto, 20);
    Eigen::Index W = 0;
    Eigen::Index q = 0;
    Eigen::Index mu = 0;
    for (std::size_t k = 0; k < problems.nc.size(); ++k) {
      const Eigen::Index nc = problems.nc[k];
      const Eigen::Index m = d * nc;
      LocalProblem one;
      one.spacedim = d;
      one.W.storage = Storage::dense;
      one.W.rows = one.W.cols = static_cast<Index>(m);
      one.W.x.assign(problems.W.begin() + W, problems.W.begin() + W + m * m);  // symmetric
      one.q = Eigen::Map<Vector>(problems.q.data() + q, m);
      one.mu = Eigen::Map<Vector>(problems.mu.data() + mu, nc);
      Solution solution;
      solution.r = Eigen::Map<Vector>(problems.r.data() + q, m);
      EXPECT_EQ(merit(one, solution).error, problems.error[k]) << "problem " << k;
      EXPECT_EQ(problems.status[k], static_cast<int>(Status::converged));
      solution.u = Eigen::Map<Vector>(problems.u.data() + q, m);
      EXPECT_LT(merit(one, solution).kinematics, 1e-12);
      W += m * m;
      q += m;
      mu += nc;
    }
  }
}

TEST(Batch, IsTheSameOnThreads) {
  Problems one(3, 500, 5);
  Problems three(3, 500, 5);
  solve_batch(one.batch);
  solve_batch(three.batch, {.threads = 3});
  EXPECT_EQ(one.r, three.r);
  EXPECT_EQ(one.error, three.error);
}

TEST(Batch, AllocatesNothingForAProblem) {
  const long start = testing::allocations();
  if (start < 0) GTEST_SKIP() << "a sanitizer has malloc";
  ::operator delete(::operator new(1));
  ASSERT_EQ(testing::allocations(), start + 1) << "new is counted too";
  Problems problems(3, 400, 7, 1);
  const BatchOutcome first = solve_batch(problems.batch);
  ASSERT_EQ(first.by_auto, 0);
  problems.batch.count = 1;  // as a program calls it that has one problem at a time
  problems.batch.nc = nullptr;
  problems.batch.nc_each = problems.nc[0];
  const long before = testing::allocations();
  for (int k = 0; k < 100; ++k) solve_batch(problems.batch);
  EXPECT_EQ(testing::allocations() - before, 0);
  problems.batch.nc = problems.nc.data();
  problems.batch.count = 400;
  const long all = testing::allocations();
  solve_batch(problems.batch);
  EXPECT_LE(testing::allocations() - all, 1) << "a call knows where its chunks begin";
}

TEST(Batch, NamesWhatIsWrongAndSolvesTheRest) {
  Problems problems(3, 50, 9, 1);
  problems.mu[0] = -1;
  try {
    solve_batch(problems.batch);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind, ErrorKind::problem);
    EXPECT_NE(std::string(error.what()).find("problem 0: mu"), std::string::npos) << error.what();
  }
  EXPECT_EQ(problems.status[49], 0);
  problems.mu[0] = 0.5;
  problems.q[0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(solve_batch(problems.batch), Error);
  problems.batch.spacedim = 5;
  EXPECT_THROW(solve_batch(problems.batch), Error);
}

TEST(Batch, StopsInTheMidstOfWhatTakesLong) {
  // rank 6, and a q of any rank: most have no solution that sweeps find, and `auto` is long at each
  Problems problems(3, 32, 3, 6);
  testing::RandomData random(5);
  for (double& q : problems.q) q = random.vector(1)[0];
  const BatchOutcome outcome =
      solve_batch(problems.batch, {.tolerance = 1e-15, .poll = [] { return false; }});
  EXPECT_LT(outcome.by_auto, 32);
  EXPECT_EQ(problems.status.back(), static_cast<std::int32_t>(Status::interrupted));
}

TEST(Batch, WhatTheFastWayDoesNotFinishGoesToAuto) {
  // W = 0 and an approach that nothing stops: there is no solution
  const std::vector<double> W(9, 0.0);
  const std::vector<double> q{-1, 0, 0};
  const double mu = 0.5;
  std::vector<double> r(3);
  std::int32_t status = -1;
  Batch batch;
  batch.count = 1;
  batch.nc_each = 1;
  batch.W = W.data();
  batch.q = q.data();
  batch.mu = &mu;
  batch.r = r.data();
  batch.status = &status;
  EXPECT_EQ(solve_batch(batch).by_auto, 1);
  EXPECT_EQ(status, static_cast<int>(Status::infeasible));
}

}  // namespace
}  // namespace fclib
