#include "embed/batch.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "counted_allocations.hpp"
#include "embed/small_solver.hpp"
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
      const double error = merit(one, solution).error;
      EXPECT_LE(error, problems.error[k]) << "problem " << k;
      EXPECT_LE(problems.error[k], error + 1e-3 * 1e-8) << "problem " << k;
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

TEST(Batch, ABadProblemHasItsStatusAndHurtsNoOther) {
  Problems good(3, 50, 9, 1);
  solve_batch(good.batch);
  Problems problems(3, 50, 9, 1);
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  problems.mu[0] = -1;
  problems.W[9] = nan;                      // of problem 1
  problems.q[problems.q.size() - 1] = nan;  // of the last
  const BatchOutcome outcome = solve_batch(problems.batch, {.threads = 2});
  EXPECT_EQ(outcome.invalid, 3);
  EXPECT_EQ(outcome.first_invalid, 0);
  EXPECT_NE(outcome.wrong.find("mu: contact 0"), std::string::npos) << outcome.wrong;
  EXPECT_EQ(outcome.converged, 47);
  for (const std::size_t k : {0, 1, 49}) {
    EXPECT_EQ(problems.status[k], static_cast<int>(Status::invalid));
    EXPECT_TRUE(std::isinf(problems.error[k]));
  }
  EXPECT_TRUE(std::isnan(problems.r[0]));
  EXPECT_TRUE(std::isnan(problems.u[0]));
  const auto bad = 3 * static_cast<std::ptrdiff_t>(problems.nc[0] + problems.nc[1]);
  const auto last = static_cast<std::ptrdiff_t>(problems.r.size()) - 3 * problems.nc.back();
  for (std::ptrdiff_t k = bad; k < last; ++k) {
    EXPECT_EQ(problems.r[static_cast<std::size_t>(k)], good.r[static_cast<std::size_t>(k)]);
  }
  problems.batch.spacedim = 5;
  EXPECT_THROW(solve_batch(problems.batch), Error);
}

/// A problem of three towers of two bodies each, with M, H, f, and W as a matrix and by blocks.
/// Contacts of a tower follow each other in steps of three, so that islands are not in a row.
struct Towers {
  static constexpr Index n = 18;
  static constexpr Index nc = 12;
  Eigen::MatrixXd M, H, W;
  Vector f, q, mu;
  std::vector<std::int32_t> starts{0}, columns;
  std::vector<double> blocks;

  explicit Towers(int seed) {
    testing::RandomData random(seed);
    M = Eigen::MatrixXd::Zero(n, n);
    H = Eigen::MatrixXd::Zero(n, 3 * nc);
    for (Index k = 0; k < n; ++k) M(k, k) = 1 + 0.1 * static_cast<double>(k % 5);
    M(1, 0) = M(0, 1) = 0.2;  // a body whose M is not diagonal
    for (Index a = 0; a < nc; ++a) {
      const Index tower = a % 3;
      for (Index row = 0; row < 6; ++row) {
        for (Index col = 0; col < 3; ++col) H(6 * tower + row, 3 * a + col) = random.vector(1)[0];
      }
    }
    f = random.vector(n);
    const Eigen::MatrixXd inverse = M.inverse();
    W = H.transpose() * inverse * H;
    W = (0.5 * (W + W.transpose())).eval();
    for (Index a = 0; a < nc; ++a) {
      for (Index b = 0; b < nc; ++b) {
        if (a % 3 != b % 3) W.block<3, 3>(3 * a, 3 * b).setZero();
      }
    }
    q = H.transpose() * inverse * f;
    mu = Vector::Constant(nc, 0.4);
    for (Index a = 0; a < nc; ++a) {
      for (Index b = a % 3; b < nc; b += 3) {
        columns.push_back(b);
        for (Index i = 0; i < 3; ++i) {
          for (Index j = 0; j < 3; ++j) blocks.push_back(W(3 * a + i, 3 * b + j));
        }
      }
      starts.push_back(static_cast<std::int32_t>(columns.size()));
    }
  }
};

TEST(Batch, IslandsAreSolvedApart) {
  const Towers towers(1);
  SmallSolver<3> solver;
  ASSERT_EQ(solver.take(Towers::nc, towers.W.data(), towers.q.data(), towers.mu.data()), nullptr);
  EXPECT_EQ(solver.islands(), 3U);
  EXPECT_EQ(solver.largest(), 4);
  std::vector<double> r(36);
  const auto judge = [&] { return solver.judge(r.data(), nullptr); };
  EXPECT_LE(solver.solve(1e-10, r.data(), judge), 1e-10);
  // an island alone has the same reactions
  Eigen::MatrixXd W(12, 12);
  Vector q(12);
  for (Index a = 0; a < 4; ++a) {
    q.segment<3>(3 * a) = towers.q.segment<3>(9 * a + 3);
    for (Index b = 0; b < 4; ++b) {
      W.block<3, 3>(3 * a, 3 * b) = towers.W.block<3, 3>(9 * a + 3, 9 * b + 3);
    }
  }
  SmallSolver<3> other;
  ASSERT_EQ(other.take(4, W.data(), q.data(), towers.mu.data()), nullptr);
  EXPECT_EQ(other.islands(), 1U);
  std::vector<double> alone(12);
  other.solve(1e-10, alone.data(), [&] { return other.judge(alone.data(), nullptr); });
  for (std::size_t a = 0; a < 4; ++a) {
    for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(alone[3 * a + k], r[9 * a + 3 + k], 1e-7);
  }
  // no contact, and contacts that nothing couples
  EXPECT_EQ(other.take(0, W.data(), q.data(), towers.mu.data()), nullptr);
  EXPECT_EQ(other.islands(), 0U);
  const Eigen::MatrixXd diagonal = Eigen::MatrixXd::Identity(12, 12);
  EXPECT_EQ(other.take(4, diagonal.data(), q.data(), towers.mu.data()), nullptr);
  EXPECT_EQ(other.islands(), 4U);
}

TEST(Batch, TakesBlocksAndBodiesAsWellAsW) {
  const Towers towers(2);
  const Towers more(3);
  constexpr std::size_t m = 36;
  std::vector<double> q, mu, W, blocks, M, H, f;
  for (const Towers* one : {&towers, &more}) {
    q.insert(q.end(), one->q.begin(), one->q.end());
    mu.insert(mu.end(), one->mu.begin(), one->mu.end());
    f.insert(f.end(), one->f.begin(), one->f.end());
    W.insert(W.end(), one->W.data(), one->W.data() + one->W.size());
    M.insert(M.end(), one->M.data(), one->M.data() + one->M.size());
    H.insert(H.end(), one->H.data(), one->H.data() + one->H.size());  // by columns
    blocks.insert(blocks.end(), one->blocks.begin(), one->blocks.end());
  }
  const auto solved = [&](const auto& set) {
    std::vector<double> r(2 * m);
    Batch batch;
    batch.count = 2;
    batch.nc_each = Towers::nc;
    batch.q = q.data();
    batch.mu = mu.data();
    batch.r = r.data();
    set(batch);
    const BatchOutcome outcome = solve_batch(batch, {.tolerance = 1e-10});
    EXPECT_EQ(outcome.converged, 2);
    EXPECT_EQ(outcome.by_auto, 0);
    return r;
  };
  const auto dense = solved([&](Batch& batch) { batch.W = W.data(); });
  const auto shared = solved([&](Batch& batch) {
    batch.W = blocks.data();
    batch.starts = towers.starts.data();
    batch.columns = towers.columns.data();
    batch.one_pattern = true;
  });
  EXPECT_EQ(dense, shared);
  std::vector<std::int32_t> starts = towers.starts;
  starts.insert(starts.end(), more.starts.begin(), more.starts.end());
  std::vector<std::int32_t> columns = towers.columns;
  columns.insert(columns.end(), more.columns.begin(), more.columns.end());
  EXPECT_EQ(dense, solved([&](Batch& batch) {
              batch.W = blocks.data();
              batch.starts = starts.data();
              batch.columns = columns.data();
            }));
  std::vector<double> v(36);
  std::vector<double> u(2 * m);
  std::vector<double> error(2);
  const auto bodies = solved([&](Batch& batch) {
    batch.n_each = Towers::n;
    batch.M = M.data();
    batch.H = H.data();
    batch.f = f.data();
    batch.v = v.data();
    batch.u = u.data();
    batch.error = error.data();
  });
  for (std::size_t k = 0; k < 2 * m; ++k) EXPECT_NEAR(dense[k], bodies[k], 1e-7);
  GlobalProblem problem;
  problem.spacedim = 3;
  problem.M = Matrix::from_eigen(SparseColumns(towers.M.sparseView()));
  problem.H = Matrix::from_eigen(SparseColumns(towers.H.sparseView()));
  problem.f = towers.f;
  problem.w = Vector::Zero(m);
  problem.mu = towers.mu;
  Solution solution;
  solution.r = Eigen::Map<const Vector>(bodies.data(), m);
  solution.u = Eigen::Map<const Vector>(u.data(), m);
  solution.v = Eigen::Map<const Vector>(v.data(), Towers::n);
  const Merit found = merit(problem, solution);
  EXPECT_LE(found.error, error[0]);
  EXPECT_LE(error[0], 1e-10);
  EXPECT_EQ(found.dynamics, 0);
  // starts that go down say nothing of where the next problem is
  starts[3] = 1;
  Batch wrong;
  wrong.count = 2;
  wrong.nc_each = Towers::nc;
  wrong.starts = starts.data();
  EXPECT_THROW(solve_batch(wrong), Error);
  // an M that is no mass
  M[0] = -1;
  std::vector<std::int32_t> status(2);
  Batch batch;
  batch.count = 2;
  batch.nc_each = Towers::nc;
  batch.n_each = Towers::n;
  batch.M = M.data();
  batch.H = H.data();
  batch.f = f.data();
  batch.mu = mu.data();
  std::vector<double> r(2 * m);
  batch.r = r.data();
  batch.status = status.data();
  const BatchOutcome outcome = solve_batch(batch);
  EXPECT_EQ(outcome.wrong, "M: is not positive definite");
  EXPECT_EQ(status, (std::vector<std::int32_t>{static_cast<int>(Status::invalid), 0}));
}

TEST(Batch, AnErrorInDoublePrecisionIsABound) {
  // masses of 1e6 and more, mu from 0 to 1e3, blocks of rank 1 to 3
  testing::RandomData random(11);
  SmallSolver<3> solver;
  int without_judge = 0;
  for (int k = 0; k < 400; ++k) {
    const Index nc = 1 + k % 5;
    Eigen::MatrixXd h(1 + k % 7, 3 * nc);
    for (Eigen::Index j = 0; j < h.cols(); ++j) {
      h.col(j) = std::pow(10.0, 3 * (j / 3 % 3)) * random.vector(h.rows());
    }
    const Eigen::MatrixXd product = h.transpose() * h;
    const Eigen::MatrixXd W = product.selfadjointView<Eigen::Lower>();
    const Vector q = h.transpose() * random.vector(h.rows());
    Vector mu(nc);
    for (Index a = 0; a < nc; ++a) mu[a] = a == 0 ? 0.0 : std::pow(10.0, k % 6 - 2);
    ASSERT_EQ(solver.take(nc, W.data(), q.data(), mu.data()), nullptr);
    std::vector<double> r(static_cast<std::size_t>(3 * nc));
    const double tolerance = k % 2 == 0 ? 1e-8 : 1e-4;
    const auto judge = [&] { return solver.judge(r.data(), nullptr); };
    const double error = solver.solve(tolerance, r.data(), judge);
    without_judge += solver.has_velocities() ? 1 : 0;
    EXPECT_LE(judge(), error);
    if (error <= tolerance) {
      EXPECT_LE(error, judge() + 1e-3 * tolerance);
    }
  }
  EXPECT_GT(without_judge, 200);
}

/// r, u, error and status of one contact.
struct OneContact {
  std::vector<double> r = {5, 5, 5}, u = {5, 5, 5};
  double error = -1;
  std::int32_t status = -1;
  std::int32_t iterations = -1;

  OneContact(const Eigen::Matrix3d& W, const Vector& q, double mu, const double* guess = nullptr,
             double tolerance = 1e-8) {
    Batch batch;
    batch.count = 1;
    batch.nc_each = 1;
    batch.W = W.data();
    batch.q = q.data();
    batch.mu = &mu;
    batch.guess = guess;
    batch.r = r.data();
    batch.u = u.data();
    batch.error = &error;
    batch.status = &status;
    batch.iterations = &iterations;
    solve_batch(batch, {.tolerance = tolerance});
  }
};

TEST(Batch, OneContactIsJudgedAsManyAre) {
  testing::RandomData random(3);
  SmallSolver<3> solver;
  int direct = 0;
  for (int k = 0; k < 400; ++k) {
    const Vector size = random.vector(3).cwiseAbs() * std::pow(10.0, k % 9 - 4);
    Eigen::Matrix3d W = Eigen::Vector3d(size[0], size[1], size[1]).asDiagonal();
    if (k % 4 == 0) W(2, 2) = size[2];
    if (k % 4 == 1) {
      const Eigen::Matrix3d h = Eigen::Map<const Eigen::Matrix3d>(random.vector(9).data());
      W = (h.transpose() * h).eval().selfadjointView<Eigen::Lower>();
    }
    const Vector q = random.vector(3) * std::pow(10.0, k % 7 - 3);
    const double mu = k % 5 == 0 ? 0.0 : std::abs(random.vector(1)[0]) * std::pow(10.0, k % 3);
    const Vector guess = random.vector(3);
    const double tolerance = k % 2 == 0 ? 1e-8 : 1e-4;
    const OneContact found(W, q, mu, k % 3 == 0 ? guess.data() : nullptr, tolerance);
    ASSERT_EQ(found.status, static_cast<int>(Status::converged)) << k;
    ASSERT_EQ(solver.take(1, W.data(), q.data(), &mu), nullptr);
    std::vector<double> u(3);
    const double error = solver.judge(found.r.data(), u.data());
    EXPECT_LE(error, found.error) << k;
    EXPECT_LE(found.error, error + 1e-3 * tolerance) << k;
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(u[i], found.u[i], 1e-12 * q.norm()) << k;
    direct += found.iterations <= 2 ? 1 : 0;
  }
  EXPECT_GT(direct, 150);
}

TEST(Batch, OneContactThatIsNoneIsInvalid) {
  const Eigen::Matrix3d W = Eigen::Matrix3d::Identity();
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  constexpr double infinity = std::numeric_limits<double>::infinity();
  for (const double normal : {1.0, -1.0}) {  // it opens, or closes
    const Vector q = Eigen::Vector3d(normal, 0.1, 0.2);
    EXPECT_EQ(OneContact(W, q, 0.5).status, static_cast<int>(Status::converged));
    std::vector<OneContact> bad;
    for (const double value : {nan, infinity, -infinity}) {
      for (int k = 0; k < 9; ++k) {
        Eigen::Matrix3d matrix = W;
        matrix(k / 3, k % 3) = value;
        bad.emplace_back(matrix, q, 0.5);
      }
      for (int k = 0; k < 3; ++k) {
        Vector vector = q;
        vector[k] = value;
        bad.emplace_back(W, vector, 0.5);
        Vector guess = Vector::Zero(3);
        guess[k] = value;
        bad.emplace_back(W, q, 0.5, guess.data());
      }
      bad.emplace_back(W, q, value);
    }
    bad.emplace_back(W, q, -0.1);
    for (std::size_t k = 0; k < bad.size(); ++k) {
      EXPECT_EQ(bad[k].status, static_cast<int>(Status::invalid)) << k;
      EXPECT_TRUE(std::isnan(bad[k].r[0]) && std::isnan(bad[k].u[2])) << k;
    }
  }
}

TEST(Batch, SquaresThatAreLostMakeNoSmallError) {
  // 1e-170^2 is 0 in double precision, and (1e160)^2 is infinite
  SmallSolver<3> solver;
  for (const Index nc : {1, 2, 4}) {
    for (const double speed : {1e-300, 1e-170, 1e-140, 1e150, 1e200}) {
      for (const double size : {1e-200, 1e-160, 1.0, 1e160, 1e200}) {
        const Eigen::MatrixXd W = size * Eigen::MatrixXd::Identity(3 * nc, 3 * nc);
        const Vector q = speed * Eigen::Vector3d(-1, 0.3, 0.1).replicate(nc, 1);
        const Vector mu = Vector::Constant(nc, 0.5);
        std::vector<double> r(static_cast<std::size_t>(3 * nc));
        std::int32_t status = -1;
        Batch batch;
        batch.count = 1;
        batch.nc_each = nc;
        batch.W = W.data();
        batch.q = q.data();
        batch.mu = mu.data();
        batch.r = r.data();
        batch.status = &status;
        solve_batch(batch);
        if (status != static_cast<int>(Status::converged)) continue;
        ASSERT_EQ(solver.take(nc, W.data(), q.data(), mu.data()), nullptr);
        EXPECT_LE(solver.judge(r.data(), nullptr), 1e-8) << nc << ' ' << speed << ' ' << size;
      }
    }
  }
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

TEST(Batch, ALimitOfTimeIsNamedAlsoWithinAProblem) {
  Problems problems(3, 32, 3, 6);
  testing::RandomData random(5);
  for (double& q : problems.q) q = random.vector(1)[0];
  solve_batch(problems.batch, {.tolerance = 1e-15, .time_limit = 0.05});
  EXPECT_EQ(problems.status.back(), static_cast<std::int32_t>(Status::time_limit));
  for (const std::int32_t status : problems.status) {
    EXPECT_NE(status, static_cast<std::int32_t>(Status::interrupted)) << "nobody did";
  }
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
