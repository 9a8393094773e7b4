#include "embed/derivatives.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "embed/batch.hpp"
#include "random_problems.hpp"

namespace fclib {
namespace {

/// Problems of three contacts and full rank, solved to 1e-13.
struct Solved {
  int d;
  std::int32_t count = 20;
  std::vector<double> W, q, mu, r;

  explicit Solved(int spacedim) : d(spacedim) {
    testing::RandomData random(4);
    const Eigen::Index m = 3 * d;
    for (std::int32_t k = 0; k < count; ++k) {
      Eigen::MatrixXd h(m + 2, m);
      for (Eigen::Index j = 0; j < m; ++j) h.col(j) = random.vector(m + 2);
      const Eigen::MatrixXd product = h.transpose() * h;
      W.insert(W.end(), product.data(), product.data() + product.size());
      const Vector free = random.vector(m);
      q.insert(q.end(), free.begin(), free.end());
      for (int a = 0; a < 3; ++a) mu.push_back(0.2 * a);
    }
    r = solved(W, q, mu);
  }

  [[nodiscard]] std::vector<double> solved(const std::vector<double>& W,
                                           const std::vector<double>& q,
                                           const std::vector<double>& mu) const {
    std::vector<double> r(q.size());
    Batch batch;
    batch.spacedim = d;
    batch.count = count;
    batch.nc_each = 3;
    batch.W = W.data();
    batch.q = q.data();
    batch.mu = mu.data();
    batch.r = r.data();
    EXPECT_EQ(solve_batch(batch, {.tolerance = 1e-13}).converged, count);
    return r;
  }

  [[nodiscard]] SolvedBatch batch() const {
    SolvedBatch result;
    result.spacedim = d;
    result.count = count;
    result.nc_each = 3;
    result.W = W.data();
    result.q = q.data();
    result.mu = mu.data();
    result.r = r.data();
    return result;
  }
};

TEST(Derivatives, AreThoseOfDifferences) {
  for (const int d : {2, 3}) {
    const Solved solved(d);
    testing::RandomData random(6);
    const auto numbers = [&](std::size_t size) {
      const Vector x = random.vector(static_cast<Eigen::Index>(size));
      return std::vector<double>(x.begin(), x.end());
    };
    auto dW = numbers(solved.W.size());
    const std::size_t m = 3 * static_cast<std::size_t>(d);
    for (std::size_t k = 0; k < dW.size(); k += m * m) {
      for (std::size_t i = 0; i < m; ++i) {
        for (std::size_t j = 0; j < i; ++j) dW[k + m * i + j] = dW[k + m * j + i];
      }
    }
    const auto dq = numbers(solved.q.size());
    const auto dmu = numbers(solved.mu.size());
    std::vector<double> dr(solved.q.size());
    std::vector<double> du(solved.q.size());
    forward(solved.batch(), {1, dW.data(), dq.data(), dmu.data(), dr.data(), du.data()});
    const double step = 1e-7;
    const auto at = [&](double by) {
      auto W = solved.W;
      auto q = solved.q;
      auto mu = solved.mu;
      for (std::size_t k = 0; k < W.size(); ++k) W[k] += by * dW[k];
      for (std::size_t k = 0; k < q.size(); ++k) q[k] += by * dq[k];
      for (std::size_t k = 0; k < mu.size(); ++k) mu[k] = std::abs(mu[k] + by * dmu[k]);
      return solved.solved(W, q, mu);
    };
    const auto there = at(step);
    std::size_t checked = 0;
    for (std::size_t k = 0; k < dr.size(); ++k) {
      if (k / static_cast<std::size_t>(d) % 3 == 0) continue;  // mu = 0 is the end of its range
      const double difference = (there[k] - solved.r[k]) / step;
      if (std::abs(dr[k] - difference) <= 1e-4 * (1 + std::abs(difference))) ++checked;
    }
    // a problem or two may be so near to another status that the step leaves it
    EXPECT_GE(checked, dr.size() * 2 / 3 * 9 / 10);

    // the adjoint of the same: <weights, change of the solution> = <gradient, change of the data>
    const auto by_r = numbers(solved.q.size());
    const auto by_u = numbers(solved.q.size());
    std::vector<double> by_W(dW.size());
    std::vector<double> by_q(dq.size());
    std::vector<double> by_mu(dmu.size());
    adjoint(solved.batch(), {1, by_r.data(), by_u.data(), by_W.data(), by_q.data(), by_mu.data()},
            {.threads = 2});
    const auto dot = [](const std::vector<double>& x, const std::vector<double>& y) {
      double sum = 0;
      for (std::size_t k = 0; k < x.size(); ++k) sum += x[k] * y[k];
      return sum;
    };
    const double left = dot(by_r, dr) + dot(by_u, du);
    const double right = dot(by_W, dW) + dot(by_q, dq) + dot(by_mu, dmu);
    EXPECT_NEAR(left, right, 1e-9 * (std::abs(left) + 1));
  }
}

TEST(Derivatives, SidesShareAFactorisation) {
  const Solved solved(3);
  const std::size_t m = 9;
  testing::RandomData random(8);
  const Vector weights = random.vector(2 * static_cast<Eigen::Index>(solved.q.size()));
  std::vector<double> both(weights.size());
  std::vector<double> once(solved.q.size());
  adjoint(solved.batch(), {2, weights.data(), nullptr, nullptr, both.data(), nullptr});
  for (std::size_t side = 0; side < 2; ++side) {
    std::vector<double> own(solved.q.size());
    for (std::size_t k = 0; k < own.size(); ++k) {
      own[k] = weights[static_cast<Eigen::Index>((2 * (k / m) + side) * m + k % m)];
    }
    adjoint(solved.batch(), {1, own.data(), nullptr, nullptr, once.data(), nullptr});
    for (std::size_t k = 0; k < own.size(); ++k) {
      EXPECT_EQ(once[k], both[(2 * (k / m) + side) * m + k % m]);
    }
  }
}

TEST(Derivatives, RedundantContactsGetTheLeastChange) {
  // two contacts that hold the same body at the same place: each takes half
  const std::vector<double> W{1, 0, 1, 0, 0, 1, 0, 1, 1, 0, 1, 0, 0, 1, 0, 1};
  const std::vector<double> q{-1, 0.1, -1, 0.1};
  const std::vector<double> mu{0.9, 0.9};
  const std::vector<double> r{0.5, -0.05, 0.5, -0.05};
  std::uint8_t unique = 1;
  SolvedBatch batch;
  batch.spacedim = 2;
  batch.count = 1;
  batch.nc_each = 2;
  batch.W = W.data();
  batch.q = q.data();
  batch.mu = mu.data();
  batch.r = r.data();
  batch.unique = &unique;
  const std::vector<double> dq{1, 0, 1, 0};
  std::vector<double> dr(4);
  std::vector<double> du(4);
  forward(batch, {1, nullptr, dq.data(), nullptr, dr.data(), du.data()});
  EXPECT_EQ(unique, 0);
  for (const std::size_t k : {0, 2}) EXPECT_NEAR(dr[k], -0.5, 1e-12);
  for (const std::size_t k : {1, 3}) EXPECT_NEAR(dr[k], 0, 1e-12);
  for (const double x : du) EXPECT_NEAR(x, 0, 1e-12);
}

TEST(Derivatives, OfAProblemThatIsNoneAreNoNumbers) {
  Solved solved(2);
  solved.r[0] = std::numeric_limits<double>::quiet_NaN();
  solved.mu[3] = -1;  // of problem 1
  std::vector<double> ones(solved.q.size(), 1.0);
  std::vector<double> by_q(solved.q.size());
  adjoint(solved.batch(), {1, ones.data(), nullptr, nullptr, by_q.data(), nullptr});
  for (std::size_t k = 0; k < by_q.size(); ++k) EXPECT_EQ(std::isnan(by_q[k]), k < 12) << k;
  std::fill_n(ones.begin(), 12, 0.0);
  adjoint(solved.batch(), {1, ones.data(), nullptr, nullptr, by_q.data(), nullptr});
  for (std::size_t k = 0; k < 12; ++k) EXPECT_EQ(by_q[k], 0);
  SolvedBatch none = solved.batch();
  none.count = 0;
  EXPECT_NO_THROW(adjoint(none, {1, ones.data(), nullptr, nullptr, by_q.data(), nullptr}));
  none.spacedim = 4;
  EXPECT_THROW(adjoint(none, {}), Error);
}

}  // namespace
}  // namespace fclib
