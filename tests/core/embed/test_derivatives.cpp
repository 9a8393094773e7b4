#include "embed/derivatives.hpp"

#include <gtest/gtest.h>

#include <Eigen/QR>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "embed/batch.hpp"
#include "embed/counted_allocations.hpp"
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

/// Problems of one contact with planted solutions, and weights and changes of their sizes.
struct OfOneContact {
  int d;
  std::int32_t count = 0;
  std::vector<double> W, q, mu, r, by_r, by_u, dW, dq, dmu;

  explicit OfOneContact(int spacedim) : d(spacedim) {
    testing::RandomData random(9);
    const auto n = static_cast<Eigen::Index>(d);
    for (const double mass : {1e-12, 1.0, 1e12}) {
      for (const double speed : {1e-12, 1.0, 1e12}) {
        for (const double least : {1.0, 1e-1, 1e-3, 1e-6, 1e-9, 1e-11, 0.0}) {
          for (const double friction : {0.0, 0.5, 30.0}) {
            for (int status = 0; status < 7; ++status) {
              // W has the singular values 1, 1 and least, and need not be symmetric
              const auto turn = [&] {
                const Eigen::HouseholderQR<Eigen::MatrixXd> factors(random.dense(n, n));
                return Eigen::MatrixXd(factors.householderQ());
              };
              const Eigen::MatrixXd left = turn();
              Vector sizes = Vector::Ones(n);
              sizes[n - 1] = least;
              const Eigen::MatrixXd right = random.uniform(0, 1) < 0.5 ? turn() : left;
              const Eigen::MatrixXd delassus = left * sizes.asDiagonal() * right.transpose() / mass;
              add(delassus, friction, status, mass, speed, random);
            }
          }
        }
      }
    }
    add_slow(random);
  }

  /// Slides at speeds whose squares are next to nothing or less.
  void add_slow(testing::RandomData& random) {
    Eigen::MatrixXd delassus(3, 3);
    delassus << 1, 0.5, 0.25, 0, 0, 0.5, 0.25, 0.5, 1;  // u_T is q_T, without rounding
    Vector reaction(3);
    reaction << 1, -0.5, 0;
    for (const double speed : {1e-100, 1e-170, 1e-310, 0.0}) {
      Vector free(3);
      free << -0.75, speed, 0;
      put(delassus.topLeftCorner(d, d), free.head(d), reaction.head(d), 0.4, 1, 1, random);
    }
  }

  void add(const Eigen::MatrixXd& delassus, double friction, int status, double mass, double speed,
           testing::RandomData& random) {
    const Eigen::Index n = d;
    Vector reaction = Vector::Zero(n);
    Vector velocity = Vector::Zero(n);
    const Vector t = random.vector(n - 1).normalized();
    switch (status) {
      case 0:  // separated
        velocity = random.vector(n);
        velocity[0] = std::abs(velocity[0]);
        break;
      case 1:  // sticks
        reaction << 1, 0.5 * friction * t;
        break;
      case 2:  // slides
      case 3:  // ... slowly
        reaction << 1, -friction * t;
        velocity << 0, (status == 2 ? 1.0 : 1e-5) * t;
        break;
      case 4:  // the border to slide
        reaction << 1, -friction * t;
        break;
      case 5:  // the border to separate, with a velocity
        velocity << 0, t;
        break;
      default:  // ... and at rest
        break;
    }
    reaction *= mass * speed;
    velocity *= speed;
    const Vector free = velocity - delassus * reaction;
    put(delassus, free, reaction, friction, mass, speed, random);
  }

  void put(const Eigen::MatrixXd& delassus, const Vector& free, const Vector& reaction,
           double friction, double mass, double speed, testing::RandomData& random) {
    const Eigen::Index n = d;
    const auto append = [](std::vector<double>& to, const auto& from) {
      to.insert(to.end(), from.reshaped().begin(), from.reshaped().end());
    };
    const Eigen::MatrixXd rows = delassus.transpose();
    append(W, rows);
    append(q, free);
    append(r, reaction);
    mu.push_back(friction);
    append(by_r, Vector(random.vector(n) / mass));
    append(by_u, random.vector(n));
    append(dW, Vector(random.vector(n * n) / mass));
    append(dq, Vector(random.vector(n) * speed));
    append(dmu, random.vector(1));
    ++count;
  }

  /// Beside each contact another one that nothing moves: then it is solved as a problem of many.
  [[nodiscard]] OfOneContact beside_another() const {
    OfOneContact result = *this;
    const auto m = static_cast<std::size_t>(d);
    const auto widen = [&](std::vector<double>& values, std::size_t rows, std::size_t columns,
                           std::size_t more_rows, std::size_t more_columns) {
      const std::vector<double> old = values;
      values.assign(old.size() / rows / columns * more_rows * more_columns, 0.0);
      for (std::size_t k = 0; k < old.size(); ++k) {
        const std::size_t row = k / columns;
        values[(row / rows * more_rows + row % rows) * more_columns + k % columns] = old[k];
      }
    };
    for (auto* matrices : {&result.W, &result.dW}) widen(*matrices, m, m, 2 * m, 2 * m);
    for (auto* vectors : {&result.q, &result.r, &result.by_r, &result.by_u, &result.dq}) {
      widen(*vectors, m, 1, 2 * m, 1);
    }
    for (auto* numbers : {&result.mu, &result.dmu}) widen(*numbers, 1, 1, 2, 1);
    return result;
  }

  struct Found {
    std::vector<double> by_W, by_q, by_mu, dr, du, r_by_q, r_by_mu;
    std::vector<std::uint8_t> degenerate, unique;
  };

  [[nodiscard]] Found found() const {
    const auto nan = std::numeric_limits<double>::quiet_NaN();
    const std::vector<double> vector(q.size(), nan);
    const std::vector<double> matrix(W.size(), nan);
    const std::vector<double> number(mu.size(), nan);
    Found result{matrix, vector, number, vector, vector, matrix, {}, {}, {}};
    const auto each = static_cast<std::int32_t>(mu.size() / static_cast<std::size_t>(count));
    result.r_by_mu.resize(q.size() * static_cast<std::size_t>(each), nan);
    result.degenerate.resize(mu.size(), 2);
    result.unique.resize(static_cast<std::size_t>(count), 2);
    SolvedBatch batch;
    batch.spacedim = d;
    batch.count = count;
    batch.nc_each = each;
    batch.W = W.data();
    batch.q = q.data();
    batch.mu = mu.data();
    batch.r = r.data();
    forward(batch, {1, dW.data(), dq.data(), dmu.data(), result.dr.data(), result.du.data()});
    sensitivities(batch, {result.r_by_q.data(), result.r_by_mu.data()});
    batch.degenerate = result.degenerate.data();
    batch.unique = result.unique.data();
    adjoint(batch, {1, by_r.data(), by_u.data(), result.by_W.data(), result.by_q.data(),
                    result.by_mu.data()});
    return result;
  }
};

/// Entries that are not numbers stand at the same places; the others differ by rounding. `size` is
/// that of the terms of which one vanished.
void expect_near(const double* one, const double* other, std::size_t length, double size,
                 const std::string& where) {
  for (std::size_t k = 0; k < length; ++k) {
    if (std::isfinite(other[k])) size = std::max(size, std::abs(other[k]));
  }
  for (std::size_t k = 0; k < length; ++k) {
    EXPECT_EQ(std::isnan(one[k]), std::isnan(other[k])) << where << ", entry " << k;
    if (std::isnan(one[k])) continue;
    EXPECT_NEAR(one[k], other[k], 1e-10 * size) << where << ", entry " << k;
  }
}

/// Both ways, on all of them.
void expect_same(const OfOneContact& alone) {
  const OfOneContact beside = alone.beside_another();
  const OfOneContact::Found one = alone.found();
  const OfOneContact::Found other = beside.found();
  const auto m = static_cast<std::size_t>(alone.d);
  for (std::size_t k = 0; k < static_cast<std::size_t>(alone.count); ++k) {
    const std::string where = "d = " + std::to_string(m) + ", problem " + std::to_string(k);
    EXPECT_EQ(one.unique[k], other.unique[k]) << where;
    EXPECT_EQ(one.degenerate[k], other.degenerate[2 * k]) << where;
    double by_u = 0;
    double y = 0;
    for (std::size_t i = 0; i < m; ++i) {
      by_u = std::max(by_u, std::abs(alone.by_u[m * k + i]));
      double sum = std::abs(alone.dq[m * k + i]);
      for (std::size_t j = 0; j < m; ++j) {
        sum += std::abs(alone.dW[m * (m * k + i) + j] * alone.r[m * k + j]);
      }
      y = std::max(y, sum);
    }
    const double length = Eigen::Map<const Vector>(&alone.r[m * k], alone.d).norm();
    expect_near(&one.by_q[m * k], &other.by_q[2 * m * k], m, by_u, where + ", by q");
    expect_near(&one.by_mu[k], &other.by_mu[2 * k], 1, 0, where + ", by mu");
    expect_near(&one.dr[m * k], &other.dr[2 * m * k], m, 0, where + ", dr");
    expect_near(&one.du[m * k], &other.du[2 * m * k], m, y, where + ", du");
    std::vector<double> matrix;
    std::vector<double> sensitivity;
    std::vector<double> column;
    for (std::size_t i = 0; i < m; ++i) {
      for (std::size_t j = 0; j < m; ++j) {
        matrix.push_back(other.by_W[2 * m * (2 * m * k + i) + j]);
        sensitivity.push_back(other.r_by_q[2 * m * (2 * m * k + i) + j]);
      }
      column.push_back(other.r_by_mu[2 * (2 * m * k + i)]);
    }
    expect_near(&one.by_W[m * m * k], matrix.data(), m * m, by_u * length, where + ", by W");
    expect_near(&one.r_by_q[m * m * k], sensitivity.data(), m * m, 0, where + ", r by q");
    expect_near(&one.r_by_mu[m * k], column.data(), m, 0, where + ", r by mu");
  }
}

TEST(Derivatives, OfOneContactAreThoseOfTheGeneralWay) {
  for (const int d : {2, 3}) expect_same(OfOneContact(d));
}

TEST(Derivatives, OfOneContactThatIsNoneAreThoseOfTheGeneralWay) {
  for (const int d : {2, 3}) {
    for (const double wrong : {std::numeric_limits<double>::quiet_NaN(),
                               std::numeric_limits<double>::infinity(), -1.0}) {
      OfOneContact problems(d);
      const auto m = static_cast<std::size_t>(d);
      const std::size_t of_each = m * m + 2 * m + 1;
      for (std::size_t k = 0; k < static_cast<std::size_t>(problems.count); ++k) {
        const std::size_t place = k % of_each;
        if (place < m * m) {
          problems.W[m * m * k + place] = wrong;
        } else if (place < m * m + m) {
          problems.q[m * k + place - m * m] = wrong;
        } else if (place < m * m + 2 * m) {
          problems.r[m * k + place - m * m - m] = wrong;
        } else {
          problems.mu[k] = wrong;
        }
      }
      expect_same(problems);
    }
  }
}

TEST(Derivatives, OfOneContactAllocateNothing) {
  const OfOneContact problems(3);
  std::vector<double> by_q(problems.q.size());
  SolvedBatch batch;
  batch.count = 7;  // of each status one
  batch.nc_each = 1;
  batch.W = problems.W.data();
  batch.q = problems.q.data();
  batch.mu = problems.mu.data();
  batch.r = problems.r.data();
  const auto run = [&] {
    adjoint(batch, {1, problems.by_r.data(), nullptr, nullptr, by_q.data(), nullptr});
  };
  run();
  const long before = testing::allocations();
  run();
  EXPECT_EQ(testing::allocations(), before);
}

}  // namespace
}  // namespace fclib
