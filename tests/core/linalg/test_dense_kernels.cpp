#include "linalg/dense_kernels.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <limits>
#include <vector>

#include "random_data.hpp"

namespace fclib {
namespace {

using Eigen::MatrixXd;

MatrixXd random_matrix(testing::RandomData& random, Eigen::Index rows, Eigen::Index cols) {
  MatrixXd a(rows, cols);
  for (double& x : a.reshaped()) x = random.uniform(-1, 1);
  return a;
}

DenseView view(Eigen::Ref<MatrixXd> a) { return {a.data(), a.rows(), a.cols(), a.outerStride()}; }

std::vector<const DenseKernels*> all_kernels() {
  std::vector<const DenseKernels*> all{&dense_kernels_anywhere(), &dense_kernels()};
#ifdef FCLIB_AVX2
  if (has_avx2()) all.push_back(&dense_kernels_avx2());
#endif
  return all;
}

/// Parts of larger matrices, with sizes around those of the tiles.
TEST(DenseKernels, ProductsAndTriangles) {
  testing::RandomData random(1);
  for (const DenseKernels* kernels : all_kernels()) {
    for (const Eigen::Index n : {1, 2, 3, 5, 8, 12, 13, 40, 97}) {
      for (const Eigen::Index m : {1, 2, 3, 7, 12, 25, 96}) {
        // triangles with inverses that are not large
        MatrixXd large = random_matrix(random, 2 * n + m, 2 * n + m) / static_cast<double>(n);
        for (Eigen::Index k = 0; k < n; ++k) large(k, k) += 2;
        const MatrixXd before = large;
        const auto triangle = large.block(0, 0, n, n);
        const MatrixXd lower = triangle.triangularView<Eigen::UnitLower>();
        const MatrixXd upper = triangle.triangularView<Eigen::Upper>();
        auto right = large.block(0, n, n, m);
        auto below = large.block(n, 0, m, n);
        auto corner = large.block(n, n, m, m);

        kernels->solve_unit_lower(view(triangle), view(right));
        EXPECT_TRUE((lower * right).isApprox(before.block(0, n, n, m), 1e-12)) << n << " " << m;
        right = before.block(0, n, n, m);
        kernels->solve_upper(view(triangle), view(right));
        EXPECT_TRUE((upper * right).isApprox(before.block(0, n, n, m), 1e-12)) << n << " " << m;
        kernels->solve_upper_from_right(view(triangle), view(below));
        EXPECT_TRUE((below * upper).isApprox(before.block(n, 0, m, n), 1e-12)) << n << " " << m;
        const MatrixXd expected = corner - below * right;
        kernels->subtract_product(view(corner), view(below), view(right));
        EXPECT_TRUE(corner.isApprox(expected, 1e-12)) << n << " " << m;

        // nothing else was written
        EXPECT_EQ(triangle, before.block(0, 0, n, n));
        EXPECT_EQ(large.rightCols(n), before.rightCols(n));
        EXPECT_EQ(large.bottomRows(n), before.bottomRows(n));
      }
    }
  }
}

/// The same numbers give the same bits wherever they lie.
TEST(DenseKernels, DigitsDoNotDependOnTheAddress) {
  testing::RandomData random(3);
  for (const DenseKernels* kernels : all_kernels()) {
    for (const Eigen::Index n : {1, 2, 3, 5, 6, 7, 12, 30}) {
      for (const Eigen::Index m : {1, 2, 3, 6, 9, 25}) {
        const Eigen::Index size = n + m;
        MatrixXd numbers = random_matrix(random, size, size) / static_cast<double>(n);
        for (Eigen::Index k = 0; k < n; ++k) numbers(k, k) += 2;
        MatrixXd first;
        for (const Eigen::Index offset : {0, 1, 2, 3, 4, 5, 6, 7}) {
          std::vector<double> memory(static_cast<std::size_t>(size * size + offset));
          Eigen::Map<MatrixXd> a(memory.data() + offset, size, size);
          a = numbers;
          const DenseView triangle = view(a.block(0, 0, n, n));
          std::vector<int> exchanged(static_cast<std::size_t>(n));
          ASSERT_TRUE(kernels->eliminate(triangle, 0, n, 0.0, exchanged.data()));
          const DenseView right = view(a.block(0, n, n, m));
          const DenseView below = view(a.block(n, 0, m, n));
          kernels->solve_unit_lower(triangle, right);
          kernels->solve_upper_from_right(triangle, below);
          kernels->subtract_product(view(a.block(n, n, m, m)), below, right);
          kernels->solve_upper(triangle, right);
          if (offset == 0) first = a;
          EXPECT_EQ(first, a) << n << " " << m << " " << offset;
        }
      }
    }
  }
}

TEST(DenseKernels, EliminationIsThatOfEigen) {
  testing::RandomData random(2);
  for (const DenseKernels* kernels : all_kernels()) {
    for (const Eigen::Index n : {1, 2, 3, 5, 8, 13, 24}) {
      MatrixXd a = random_matrix(random, n, n);
      const MatrixXd before = a;
      std::vector<int> exchanged(static_cast<std::size_t>(n));
      ASSERT_TRUE(kernels->eliminate(view(a), 0, n, 0.0, exchanged.data()));
      const MatrixXd lower = a.triangularView<Eigen::UnitLower>();
      const MatrixXd upper = a.triangularView<Eigen::Upper>();
      MatrixXd moved = before;
      for (Eigen::Index k = 0; k < n; ++k) moved.row(k).swap(moved.row(exchanged[k]));
      EXPECT_TRUE((lower * upper).isApprox(moved, 1e-13)) << n;
      EXPECT_LE(lower.cwiseAbs().maxCoeff(), 1);
    }
  }
}

TEST(DenseKernels, APivotThatVanishesIsReplacedAndOneThatIsNotFiniteIsFound) {
  for (const DenseKernels* kernels : all_kernels()) {
    MatrixXd a = MatrixXd::Zero(2, 2);
    std::vector<int> exchanged(2);
    EXPECT_TRUE(kernels->eliminate(view(a), 0, 2, 1e-3, exchanged.data()));
    EXPECT_EQ(a(0, 0), 1e-3);
    EXPECT_EQ(a(1, 1), 1e-3);
    a.setConstant(std::numeric_limits<double>::infinity());
    EXPECT_FALSE(kernels->eliminate(view(a), 0, 2, 1e-3, exchanged.data()));
  }
}

}  // namespace
}  // namespace fclib
