#include "reduced/coloured_sweeps.hpp"

#include <gtest/gtest.h>

#include <set>

#include "contact/coulomb.hpp"
#include "random_data.hpp"

namespace fclib {
namespace {

/// Of 300 contacts, coupled at random; the pattern of W is not symmetric.
template <int D>
BlockMatrix random_matrix(std::uint64_t seed, double share) {
  testing::RandomData random(seed);
  return {Matrix::from_eigen(random.sparse(Eigen::Index{D} * 300, Eigen::Index{D} * 300, share)),
          D};
}

template <int D>
void expect_colouring(const BlockMatrix& W, std::size_t size) {
  const Colouring colouring = colour_contacts(W, size);
  const auto nc = static_cast<std::size_t>(W.block_count());
  const std::set<Index> visited(colouring.order.begin(), colouring.order.end());
  ASSERT_EQ(colouring.order.size(), nc);
  ASSERT_EQ(visited.size(), nc);
  ASSERT_EQ(colouring.clusters.back(), nc);
  ASSERT_EQ(colouring.colours.back() + 1, colouring.clusters.size());

  std::vector<std::size_t> cluster(nc), colour(nc);
  for (std::size_t k = 0; k + 1 < colouring.colours.size(); ++k) {
    for (std::size_t c = colouring.colours[k]; c < colouring.colours[k + 1]; ++c) {
      ASSERT_LT(colouring.clusters[c], colouring.clusters[c + 1]);
      ASSERT_LE(colouring.clusters[c + 1] - colouring.clusters[c], size);
      for (std::size_t at = colouring.clusters[c]; at < colouring.clusters[c + 1]; ++at) {
        cluster[static_cast<std::size_t>(colouring.order[at])] = c;
        colour[static_cast<std::size_t>(colouring.order[at])] = k;
      }
    }
  }
  W.template for_each_block<D>([&](Index row, Index col, const auto&) {
    const auto a = static_cast<std::size_t>(row);
    const auto b = static_cast<std::size_t>(col);
    EXPECT_TRUE(cluster[a] == cluster[b] || colour[a] != colour[b]) << a << ", " << b;
  });
}

TEST(Colouring, clusters_of_a_colour_are_not_coupled) {
  for (const std::size_t size : {1, 4, 32}) {
    for (const double share : {0.0, 0.0005, 0.002, 0.01}) {
      expect_colouring<3>(random_matrix<3>(size, share), size);
      expect_colouring<2>(random_matrix<2>(size, share), size);
    }
  }
}

TEST(Colouring, no_contact_has_no_colour) {
  const BlockMatrix W(Matrix::from_eigen(SparseColumns(0, 0)), 3);
  const Colouring colouring = colour_contacts(W);
  EXPECT_EQ(colouring.colours.size(), 1U);
  EXPECT_EQ(colouring.clusters.size(), 1U);
}

TEST(ColouredSweeps, velocities_are_those_of_w) {
  testing::RandomData random(3);
  ReducedProblem problem{.W = random_matrix<3>(5, 0.005),
                         .q = random.vector(900),
                         .friction = {Vector::Constant(300, 0.5), {}, {}}};
  const Vector r = random.vector(900);
  Vector expected(900), u(900);
  problem.velocity(r, expected);
  for (const int threads : {1, 2, 5}) {
    ColouredSweeps<Coulomb<3>> sweeps(problem, 1, threads);
    sweeps.velocity(r, u);
    EXPECT_LT((u - expected).norm(), 1e-12);
  }
}

TEST(ColouredSweeps, a_sweep_visits_each_contact_once_forwards_and_backwards) {
  ReducedProblem problem{.W = random_matrix<3>(9, 0.001),
                         .q = Vector::Zero(900),
                         .friction = {Vector::Constant(300, 0.5), {}, {}}};
  ColouredSweeps<Coulomb<3>> sweeps(problem, 1, 1);  // one thread: the order can be kept
  std::vector<Index> forwards, backwards;
  sweeps.sweep([&](Index a) { forwards.push_back(a); });
  sweeps.reverse();
  sweeps.sweep([&](Index a) { backwards.push_back(a); });
  EXPECT_EQ(forwards.size(), 300U);
  std::reverse(backwards.begin(), backwards.end());
  EXPECT_EQ(forwards, backwards);
}

TEST(Workers, wait_for_each_other) {
  Workers workers(4);
  std::vector<int> counts(static_cast<std::size_t>(workers.count()), 0);
  std::vector<int> seen = counts;
  for (int run = 0; run < 50; ++run) {
    workers.run([&](int k) {
      ++counts[static_cast<std::size_t>(k)];
      workers.wait();
      seen[static_cast<std::size_t>(k)] = *std::min_element(counts.begin(), counts.end());
      workers.wait();
    });
    EXPECT_EQ(seen, counts);
  }
}

}  // namespace
}  // namespace fclib
