#include "embed/lanes.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "embed/batch.hpp"
#include "embed/small_solver.hpp"
#include "random_problems.hpp"
#include "solve/driver.hpp"

namespace fclib {
namespace {

/// Problems of as many contacts each: bodies from light to heavy, mu from 0 to 1e3, W of any rank.
template <int D>
struct Same {
  Index nc;
  std::int64_t count;
  std::vector<double> W, q, mu, guess, r, u, error;
  std::vector<std::int32_t> status, iterations;

  Same(Index contacts, std::int64_t number, int seed) : nc(contacts), count(number) {
    testing::RandomData random(seed);
    for (std::int64_t k = 0; k < count; ++k) {
      Eigen::MatrixXd h(D + k % 5, D * nc);
      for (Eigen::Index j = 0; j < h.cols(); ++j) {
        h.col(j) = std::pow(10.0, k % 3 * (j / D % 3)) * random.vector(h.rows());
      }
      const Eigen::MatrixXd product = h.transpose() * h;
      const Eigen::MatrixXd matrix = product.template selfadjointView<Eigen::Lower>();
      const Vector free = h.transpose() * random.vector(h.rows());
      W.insert(W.end(), matrix.data(), matrix.data() + matrix.size());
      q.insert(q.end(), free.begin(), free.end());
      for (Index a = 0; a < nc; ++a) {
        mu.push_back(k % 7 == 0 ? 0.0 : std::pow(10.0, k % 6 == 0 ? 3 : -0.3 * a));
      }
    }
    guess = std::vector<double>(q.size());
    for (double& one : guess) one = random.vector(1)[0];
    r.resize(q.size());
    u.resize(q.size());
    error.resize(static_cast<std::size_t>(count));
    status.resize(error.size());
    iterations.resize(error.size());
  }

  /// Problems from `first` on.
  BatchOutcome solve(std::int64_t first, std::int64_t number, double tolerance, bool guessed) {
    const std::int64_t m = std::int64_t{D} * nc;
    Batch batch;
    batch.spacedim = D;
    batch.count = number;
    batch.nc_each = nc;
    batch.W = W.data() + first * m * m;
    batch.q = q.data() + first * m;
    batch.mu = mu.data() + first * nc;
    if (guessed) batch.guess = guess.data() + first * m;
    batch.r = r.data() + first * m;
    batch.u = u.data() + first * m;
    batch.error = error.data() + first;
    batch.status = status.data() + first;
    batch.iterations = iterations.data() + first;
    return solve_batch(batch, {.tolerance = tolerance});
  }
};

template <int D>
void check_all(Index nc, double tolerance, bool guessed) {
  constexpr std::int64_t count = 70;  // more than a chunk
  Same<D> many(nc, count, 100 * D + nc);
  EXPECT_LT(many.solve(0, count, tolerance, guessed).by_auto, count / 4);
  Same<D> one(nc, count, 100 * D + nc);
  SmallSolver<D> solver;
  const auto m = static_cast<std::size_t>(D * nc);
  for (std::size_t k = 0; k < count; ++k) {
    const std::string where = std::to_string(nc) + " contacts, problem " + std::to_string(k);
    const BatchOutcome alone = one.solve(static_cast<std::int64_t>(k), 1, tolerance, guessed);
    ASSERT_EQ(many.status[k], static_cast<int>(Status::converged)) << where;
    if (alone.by_auto > 0) continue;  // Merit::error as the driver has it
    ASSERT_EQ(solver.take(nc, many.W.data() + k * m * m, many.q.data() + k * m,
                          many.mu.data() + k * static_cast<std::size_t>(nc)),
              nullptr);
    std::vector<double> u(m);
    const double error = solver.judge(many.r.data() + k * m, u.data());
    EXPECT_LE(error, many.error[k]) << where;
    EXPECT_LE(many.error[k], error + 1e-3 * tolerance) << where;
    EXPECT_LE(many.error[k], tolerance) << where;
    double size = 0;
    for (std::size_t i = 0; i < m; ++i) size += std::abs(many.q[k * m + i]);
    for (std::size_t i = 0; i < m; ++i) EXPECT_NEAR(u[i], many.u[k * m + i], 1e-9 * size) << where;
  }
  EXPECT_EQ(many.r, one.r) << nc << " contacts: no problem has an effect on another";
  EXPECT_EQ(many.error, one.error) << nc;
  EXPECT_EQ(many.iterations, one.iterations) << nc;
}

TEST(Lanes, EachIsSolvedAndJudgedAsIfItWereAlone) {
  for (const Index nc : {1, 2, 3, 4, 5, 8}) {
    for (const double tolerance : {1e-3, 1e-6, 1e-10}) {
      for (const bool guessed : {false, true}) {
        check_all<2>(nc, tolerance, guessed);
        check_all<3>(nc, tolerance, guessed);
      }
    }
  }
}

TEST(Lanes, WhatIsNoNumberIsInvalidAndHurtsNoOther) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  constexpr double infinity = std::numeric_limits<double>::infinity();
  constexpr std::int64_t count = 40;
  for (const Index nc : {1, 2, 4}) {
    Same<3> good(nc, count, 5);
    good.solve(0, count, 1e-6, true);
    const auto m = static_cast<std::size_t>(3 * nc);
    for (const double value : {nan, infinity, -infinity, 1e200}) {
      for (int which = 0; which < 4; ++which) {
        Same<3> bad(nc, count, 5);
        std::vector<double>& array = which == 0   ? bad.W
                                     : which == 1 ? bad.q
                                     : which == 2 ? bad.mu
                                                  : bad.guess;
        const std::size_t each = array.size() / count;
        for (const std::size_t k : {3, 17}) array[k * each + (k * 5) % each] = value;
        const BatchOutcome outcome = bad.solve(0, count, 1e-6, true);
        if (value != 1e200) {
          EXPECT_EQ(outcome.invalid, 2) << which;
          EXPECT_EQ(outcome.first_invalid, 3) << which;
        }
        for (std::size_t k = 0; k < count; ++k) {
          if (k == 3 || k == 17) continue;
          EXPECT_EQ(bad.error[k], good.error[k]) << nc << ' ' << which << ' ' << k;
          for (std::size_t i = k * m; i < (k + 1) * m; ++i) EXPECT_EQ(bad.r[i], good.r[i]);
        }
      }
    }
  }
}

TEST(Lanes, TakeWhatAFewSweepsSolve) {
  Same<3> many(4, 64, 1);
  const std::size_t m = 12;
  Lanes<3> lanes;
  int solved = 0;
  int started = 0;
  std::vector<int> answers(64);
  lanes.solve(1e-4, 4, 64,
              {many.W.data(), many.q.data(), many.mu.data(), nullptr, many.r.data(), many.u.data()},
              [&](std::int64_t k, const auto& answer) {
                solved += answer.solved ? 1 : 0;
                started += answer.started ? 1 : 0;
                ++answers[static_cast<std::size_t>(k)];
              });
  EXPECT_EQ(answers, std::vector<int>(64, 1)) << "each is answered once";
  EXPECT_GT(solved, 16);
  EXPECT_LT(solved, started) << "of those that are left, r is where the sweeps ended";
  // a block of zeros: there may be islands
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 3; j < 6; ++j) many.W[m * i + j] = many.W[m * j + i] = 0;
  }
  bool zeros = true;
  lanes.solve(1e-4, 4, 1,
              {many.W.data(), many.q.data(), many.mu.data(), nullptr, many.r.data(), many.u.data()},
              [&](std::int64_t, const auto& answer) { zeros = answer.solved || answer.started; });
  EXPECT_FALSE(zeros);
}

}  // namespace
}  // namespace fclib
