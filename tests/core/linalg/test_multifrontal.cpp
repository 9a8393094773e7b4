#include "linalg/multifrontal.hpp"

#include <gtest/gtest.h>

#include <array>

#include "random_data.hpp"

namespace fclib {
namespace {

/// The block pattern of a symmetric graph where each pair is linked with this probability.
BlockPattern random_pattern(testing::RandomData& random, Index nodes, int d, double share) {
  std::vector<std::vector<Index>> columns(static_cast<std::size_t>(nodes));
  for (Index col = 0; col < nodes; ++col) {
    columns[col].push_back(col);
    for (Index row = 0; row < col; ++row) {
      if (random.uniform(0, 1) > share) continue;
      columns[col].push_back(row);
      columns[row].push_back(col);
    }
  }
  BlockPattern pattern;
  pattern.d = d;
  pattern.first.push_back(0);
  for (auto& rows : columns) {
    std::sort(rows.begin(), rows.end());
    pattern.row.insert(pattern.row.end(), rows.begin(), rows.end());
    pattern.first.push_back(static_cast<std::int64_t>(pattern.row.size()));
  }
  return pattern;
}

Eigen::MatrixXd dense(const BlockPattern& pattern, const std::vector<double>& values) {
  const int d = pattern.d;
  const Index n = d * pattern.nodes();
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(n, n);
  for (Index col = 0; col < pattern.nodes(); ++col) {
    for (auto k = pattern.first[col]; k < pattern.first[col + 1]; ++k) {
      result.block(d * pattern.row[static_cast<std::size_t>(k)], d * col, d, d) =
          Eigen::Map<const Eigen::MatrixXd>(values.data() + d * d * k, d, d);
    }
  }
  return result;
}

std::vector<double> random_values(testing::RandomData& random, const BlockPattern& pattern,
                                  double diagonal) {
  std::vector<double> values(pattern.values());
  for (double& value : values) value = random.uniform(-1, 1);
  for (Index col = 0; col < pattern.nodes(); ++col) {
    for (auto k = pattern.first[col]; k < pattern.first[col + 1]; ++k) {
      if (pattern.row[static_cast<std::size_t>(k)] != col) continue;
      for (int c = 0; c < pattern.d; ++c) {
        values[static_cast<std::size_t>(pattern.d * pattern.d * k + (pattern.d + 1) * c)] +=
            diagonal;
      }
    }
  }
  return values;
}

TEST(Multifrontal, SolvesUnsymmetricSystemsOfAnySize) {
  testing::RandomData random(1);
  for (const int d : {1, 2, 3, 5}) {
    for (const Index nodes : {0, 1, 2, 7, 40, 150}) {
      for (const double share : {0.0, 0.02, 0.2, 1.0}) {
        const BlockPattern pattern = random_pattern(random, nodes, d, share);
        const auto values = random_values(random, pattern, 0.5 * d * nodes * share + 3);
        Multifrontal lu(pattern);
        ASSERT_EQ(lu.size(), d * nodes);
        ASSERT_TRUE(lu.factorise(values));
        const Vector x = random.vector(d * nodes);
        Vector b = dense(pattern, values) * x;
        lu.solve(b);
        EXPECT_LE((b - x).norm(), 1e-11 * (1 + x.norm())) << d << " " << nodes << " " << share;
      }
    }
  }
}

TEST(Multifrontal, FactorisesAgainOnItsPattern) {
  testing::RandomData random(2);
  const BlockPattern pattern = random_pattern(random, 120, 3, 0.03);
  Multifrontal lu(pattern);
  for (int k = 0; k < 3; ++k) {
    const auto values = random_values(random, pattern, 20);
    ASSERT_TRUE(lu.factorise(values));
    const Vector x = random.vector(360);
    Vector b = dense(pattern, values) * x;
    lu.solve(b);
    EXPECT_LE((b - x).norm(), 1e-11 * x.norm());
  }
}

TEST(Multifrontal, ExchangesRowsInsideAFront) {
  BlockPattern pattern;  // one 3 x 3 block without a diagonal
  pattern.d = 3;
  pattern.first = {0, 1};
  pattern.row = {0};
  Multifrontal lu(pattern);
  ASSERT_TRUE(lu.factorise({0, 0, 2, 4, 0, 0, 0, 8, 0}));
  Vector b(3);
  b << 4, 8, 2;
  lu.solve(b);
  EXPECT_EQ(b, Vector(Vector::Ones(3)));
}

TEST(Multifrontal, KnowsTheSignOfTheDeterminant) {
  testing::RandomData random(5);
  int negative = 0;
  for (int trial = 0; trial < 40; ++trial) {
    const BlockPattern pattern = random_pattern(random, 2 + trial % 9, 3, 0.3);
    const auto values = random_values(random, pattern, 0);
    Multifrontal lu(pattern);
    ASSERT_TRUE(lu.factorise(values));
    const double determinant = dense(pattern, values).determinant();
    EXPECT_EQ(lu.determinant_sign(), determinant < 0 ? -1 : 1) << trial;
    negative += determinant < 0;
  }
  EXPECT_GT(negative, 5);
  EXPECT_LT(negative, 35);
}

TEST(Multifrontal, RefusesWhatIsNotFinite) {
  testing::RandomData random(3);
  const BlockPattern pattern = random_pattern(random, 50, 3, 0.1);
  auto values = random_values(random, pattern, 5);
  values[17] = std::numeric_limits<double>::quiet_NaN();
  Multifrontal lu(pattern);
  EXPECT_FALSE(lu.factorise(values));
  values[17] = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(lu.factorise(values));
}

TEST(Multifrontal, StopsWhenTheTimeIsOver) {
  testing::RandomData random(5);
  for (const double share : {0.03, 1.0}) {  // many fronts, and a large one
    const BlockPattern pattern = random_pattern(random, 60, 3, share);
    const auto values = random_values(random, pattern, 60);
    Multifrontal lu(pattern);
    double time = 0;
    const Clock clock = [&time] { return time += 1; };  // a second passes at each look
    const Deadline enough(1000, clock);
    ASSERT_TRUE(lu.factorise(values, &enough));
    const double looks = time;
    ASSERT_GT(looks, 3);
    time = 0;
    const Deadline half(looks / 2, clock);
    EXPECT_FALSE(lu.factorise(values, &half));
    EXPECT_LT(time, looks);
  }
}

TEST(Multifrontal, FillsLittleOnAChain) {
  BlockPattern pattern;
  pattern.d = 3;
  pattern.first.push_back(0);
  constexpr Index nodes = 2000;
  for (Index k = 0; k < nodes; ++k) {
    for (const Index row : {k - 1, k, k + 1}) {
      if (row >= 0 && row < nodes) pattern.row.push_back(row);
    }
    pattern.first.push_back(static_cast<std::int64_t>(pattern.row.size()));
  }
  EXPECT_LE(Multifrontal(pattern).memory(), 30.0 * nodes * 9);
}

TEST(Multifrontal, any_number_of_threads_gives_the_same_bits) {
  testing::RandomData random(11);
  // the last fronts have more than a thousand rows, not a multiple of any tile
#ifdef __SANITIZE_THREAD__
  const BlockPattern pattern = random_pattern(random, 601, 3, 0.012);  // each access is watched
#else
  const BlockPattern pattern = random_pattern(random, 1201, 3, 0.006);
#endif
  const std::vector<double> values = random_values(random, pattern, 20.0);
  Vector expected;
  for (const int threads : {1, 2, 3, 7}) {
    Multifrontal lu(pattern, threads);
    ASSERT_GT(lu.flops(), 1e8);  // so that threads are used
    Vector x = Vector::LinSpaced(lu.size(), -1, 1);
    for (int again = 0; again < 2; ++again) ASSERT_TRUE(lu.factorise(values));
    lu.solve(x);
    EXPECT_EQ(lu.others_cpu() > 0, threads > 1);
    if (threads == 1) {
      expected = x;
      Vector residual = -Vector::LinSpaced(lu.size(), -1, 1);
      residual += dense(pattern, values) * x;
      EXPECT_LT(residual.norm(), 1e-10);
    } else {
      EXPECT_EQ(x, expected) << threads;
    }
  }
}

/// Cliques that hang on a separator, each a front with many rows below its pivots.
BlockPattern cliques_on_a_separator(Index cliques, Index clique, Index separator) {
  BlockPattern pattern;
  pattern.d = 3;
  pattern.first.push_back(0);
  const Index nodes = cliques * clique + separator;
  for (Index col = 0; col < nodes; ++col) {
    for (Index row = 0; row < nodes; ++row) {
      const bool both = row < cliques * clique && col < cliques * clique;
      if (!both || row / clique == col / clique) pattern.row.push_back(row);
    }
    pattern.first.push_back(static_cast<std::int64_t>(pattern.row.size()));
  }
  return pattern;
}

TEST(Multifrontal, threads_that_share_a_front_give_the_same_bits) {
  testing::RandomData random(13);
  const BlockPattern pattern = cliques_on_a_separator(2, 67, 153);
  const std::vector<double> values = random_values(random, pattern, 20.0);
  Vector expected;
  for (const int threads : {1, 2, 3, 4, 5}) {
    Multifrontal lu(pattern, threads);
    ASSERT_GT(lu.flops(), 3e7);  // so that threads are used
    ASSERT_TRUE(lu.factorise(values));
    Vector x = Vector::LinSpaced(lu.size(), -1, 1);
    lu.solve(x);
    if (threads == 1) expected = x;
    EXPECT_EQ(x, expected) << threads;
  }
}

TEST(Fronts, are_planned_once_for_a_pattern) {
  testing::RandomData random(12);
  const BlockPattern pattern = random_pattern(random, 60, 3, 0.05);
  const BlockPattern other = random_pattern(random, 60, 3, 0.05);
  const auto first = analysed(pattern);
  EXPECT_NE(analysed(other), first);
  EXPECT_EQ(analysed(pattern), first);
}

/// Blocks on a grid in space, each linked with its neighbours.
BlockPattern grid(Index side, int d) {
  BlockPattern pattern;
  pattern.d = d;
  pattern.first.push_back(0);
  for (Index node = 0; node < side * side * side; ++node) {
    const std::array<Index, 3> place{node % side, node / side % side, node / (side * side)};
    std::vector<Index> rows{node};
    Index step = 1;
    for (const Index at : place) {
      if (at > 0) rows.push_back(node - step);
      if (at + 1 < side) rows.push_back(node + step);
      step *= side;
    }
    std::sort(rows.begin(), rows.end());
    pattern.row.insert(pattern.row.end(), rows.begin(), rows.end());
    pattern.first.push_back(static_cast<std::int64_t>(pattern.row.size()));
  }
  return pattern;
}

TEST(Fronts, large_systems_have_the_ordering_of_fewer_operations) {
  const BlockPattern pattern = grid(12, 3);
  const Fronts degree(pattern, Ordering::minimum_degree);
  const Fronts dissected(pattern, Ordering::nested_dissection);
  const Fronts best(pattern);
  EXPECT_EQ(best.flops, std::min(degree.flops, dissected.flops));
  EXPECT_EQ(degree.ordering, Ordering::minimum_degree);
  for (const Fronts* fronts : {&degree, &dissected}) {
    std::vector<Index> places = fronts->position;
    std::sort(places.begin(), places.end());
    for (Index k = 0; k < pattern.nodes(); ++k) ASSERT_EQ(places[k], k);
  }
  // one ordering, however often it is asked for
  EXPECT_EQ(Fronts(pattern, Ordering::nested_dissection).position, dissected.position);
  if (!has_nested_dissection()) {
    EXPECT_EQ(dissected.ordering, Ordering::minimum_degree);
    return;
  }
  EXPECT_EQ(dissected.ordering, Ordering::nested_dissection);
  EXPECT_LT(dissected.flops, degree.flops);

  testing::RandomData random(14);
  const std::vector<double> values = random_values(random, pattern, 20.0);
  Multifrontal lu(pattern);
  EXPECT_EQ(lu.flops(), dissected.flops);
  ASSERT_TRUE(lu.factorise(values));
  const Vector b = Vector::LinSpaced(lu.size(), -1, 1);
  Vector x = b;
  lu.solve(x);
  Vector residual = b;
  for (Index col = 0; col < pattern.nodes(); ++col) {
    for (auto k = pattern.first[col]; k < pattern.first[col + 1]; ++k) {
      residual.segment<3>(3 * pattern.row[static_cast<std::size_t>(k)]) -=
          Eigen::Map<const Eigen::Matrix3d>(values.data() + 9 * k) * x.segment<3>(3 * col);
    }
  }
  EXPECT_LT(residual.norm(), 1e-12 * b.norm());
}

}  // namespace
}  // namespace fclib
