#include "linalg/factorization.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "error.hpp"
#include "random_data.hpp"

namespace fclib {
namespace {

TEST(Factorization, solves_symmetric_and_other_systems) {
  testing::RandomData random(5);
  const SparseColumns symmetric = random.definite(20, 0.1);
  SparseColumns other = symmetric;
  other.coeffRef(0, 0) += 1;
  other.coeffRef(0, 1) += 1e-3;
  for (const SparseColumns& a : {symmetric, other}) {
    const Factorization factorization(a, "A");
    const Vector b = random.vector(20);
    EXPECT_LT((a * factorization.solve(b) - b).norm(), 1e-12);
    const SparseColumns many = random.sparse(20, 6, 0.2);
    EXPECT_LT((Eigen::MatrixXd(a * factorization.solve(many)) - Eigen::MatrixXd(many)).norm(),
              1e-12);
  }
}

TEST(Factorization, bodies_whose_mass_is_not_symmetric_stay_apart) {
  testing::RandomData random(8);
  // blocks of 1, 3 and 2 rows among one another, a stored zero between two of them
  const std::vector<std::vector<Index>> bodies{{0}, {1, 3, 5}, {2, 4}};
  std::vector<Eigen::Triplet<double, Index>> entries{{0, 4, 0.0}};
  for (const auto& rows : bodies) {
    for (const Index row : rows) {
      for (const Index col : rows)
        entries.emplace_back(row, col, (row == col ? 4 : 0) + random.vector(1)[0]);
    }
  }
  SparseColumns a(6, 6);
  a.setFromTriplets(entries.begin(), entries.end());
  SparseColumns b(6, 4);
  b.insert(3, 0) = 2;
  b.insert(0, 1) = -1;
  b.insert(5, 2) = 1;
  b.insert(4, 3) = 3;
  const Factorization factorization(a, "A");
  const Eigen::MatrixXd expected = Eigen::MatrixXd(a).inverse() * Eigen::MatrixXd(b);
  const SparseColumns x = factorization.solve(b);
  EXPECT_LT((Eigen::MatrixXd(x) - expected).norm(), 1e-14);
  EXPECT_EQ(x.nonZeros(), 9);
  const Vector one = random.vector(6);
  EXPECT_LT((a * factorization.solve(one) - one).norm(), 1e-14);
  const Eigen::MatrixXd product = Eigen::MatrixXd(b).transpose() * expected;
  EXPECT_LT((Eigen::MatrixXd(factorization.gram(b)) - product).norm(), 1e-14);
  EXPECT_LT((factorization.gram_diagonal(b) - product.diagonal()).norm(), 1e-14);
}

TEST(Factorization, gram_keeps_stored_zeros_and_their_signs) {
  // with A = 1 the half is B itself: (-0) (-1) = 0 and (-0) 1 = -0 are entries of B^T B
  SparseColumns one(1, 1);
  one.insert(0, 0) = 1;
  SparseColumns b(1, 3);
  b.insert(0, 0) = -0.0;
  b.insert(0, 1) = -1;
  b.insert(0, 2) = 1;
  const SparseColumns gram = Factorization(one, "A").gram(b);
  ASSERT_EQ(gram.nonZeros(), 9);
  EXPECT_FALSE(std::signbit(gram.coeff(1, 0)));
  EXPECT_TRUE(std::signbit(gram.coeff(2, 0)));
  EXPECT_TRUE(std::signbit(gram.coeff(0, 2)));
  EXPECT_EQ(gram.coeff(1, 2), -1);
}

TEST(Factorization, gram_is_the_same_of_dense_and_of_sparse_rows) {
  // rows without entries make the others few: columns are then looked for entry by entry
  testing::RandomData random(7);
  const Eigen::Index m = 150;
  Eigen::MatrixXd dense = random.dense(10, m);
  dense = (dense.array() < -0.5).select(0.0, dense);
  dense.col(70).setZero();
  const auto gram_of = [&](Eigen::Index rows) {
    SparseColumns one(rows, rows);
    one.setIdentity();
    Eigen::MatrixXd b = Eigen::MatrixXd::Zero(rows, m);
    b.topRows(10) = dense;
    return Factorization(one, "A").gram(b.sparseView());
  };
  const SparseColumns few = gram_of(10), many = gram_of(1000);
  ASSERT_EQ(few.nonZeros(), many.nonZeros());
  EXPECT_LT(few.nonZeros(), m * m);
  for (Eigen::Index k = 0; k < few.nonZeros(); ++k) {
    EXPECT_EQ(few.innerIndexPtr()[k], many.innerIndexPtr()[k]);
    EXPECT_EQ(few.valuePtr()[k], many.valuePtr()[k]);
  }
  const Eigen::MatrixXd product = dense.transpose() * dense;
  EXPECT_LT((Eigen::MatrixXd(few) - product).norm(), 1e-12 * product.norm());
}

TEST(Factorization, gram_diagonal_is_that_of_gram_to_the_last_bit) {
  // columns of different rows, also none, and a number of them that no block of columns divides
  testing::RandomData random(8);
  const SparseColumns a = random.definite(12, 0.3);
  Eigen::MatrixXd dense = random.dense(12, 11);
  dense = (dense.array() < 0.3).select(0.0, dense);
  dense.col(4).setZero();
  const SparseColumns b = dense.sparseView();
  const Factorization factorization(a, "A");
  const SparseColumns gram = factorization.gram(b);
  const Vector diagonal = factorization.gram_diagonal(b);
  ASSERT_EQ(diagonal.size(), 11);
  for (Eigen::Index k = 0; k < diagonal.size(); ++k) EXPECT_EQ(diagonal[k], gram.coeff(k, k));
  EXPECT_EQ(diagonal[4], 0);
}

TEST(Factorization, an_infinite_entry_of_gram_leaves_the_others_finite) {
  SparseColumns one(2, 2);
  one.setIdentity();
  SparseColumns b(2, 3);
  b.insert(0, 0) = 1;
  b.insert(1, 1) = 2;
  b.insert(0, 2) = std::numeric_limits<double>::infinity();
  b.insert(1, 2) = 3;
  const SparseColumns gram = Factorization(one, "A").gram(b);
  EXPECT_EQ(gram.coeff(1, 1), 4);
  EXPECT_EQ(gram.coeff(2, 1), 6);
  EXPECT_EQ(gram.coeff(2, 0), std::numeric_limits<double>::infinity());
}

TEST(Factorization, gram_is_symmetric_and_keeps_bodies_apart) {
  testing::RandomData random(6);
  // two bodies that do not touch: a block-diagonal matrix
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(16, 16);
  a.topLeftCorner(8, 8) = Eigen::MatrixXd(random.definite(8, 0.4));
  a.bottomRightCorner(8, 8) = Eigen::MatrixXd(random.definite(8, 0.4));
  Eigen::MatrixXd b = Eigen::MatrixXd::Zero(16, 4);
  b.topLeftCorner(8, 2) = random.dense(8, 2);
  b.bottomRightCorner(8, 2) = random.dense(8, 2);
  const Factorization factorization(a.sparseView(), "A");
  const SparseColumns sparse = factorization.gram(b.sparseView());
  const Eigen::MatrixXd product(sparse);
  EXPECT_LT((product - b.transpose() * a.inverse() * b).norm(), 1e-12);
  EXPECT_EQ(product, product.transpose());
  EXPECT_EQ(sparse.nonZeros(), 8);
  EXPECT_LT((factorization.gram_diagonal(b.sparseView()) - product.diagonal()).norm(), 1e-12);
}

/// The stiffness of a cube of bricks, three unknowns a node, and a bit on the diagonal.
SparseColumns brick(Index side) {
  const auto node = [&](Index x, Index y, Index z) { return (z * side + y) * side + x; };
  std::vector<Eigen::Triplet<double, Index>> entries;
  const Index n = 3 * side * side * side;
  for (Index k = 0; k < n; ++k) entries.emplace_back(k, k, 0.01);
  for (Index z = 0; z + 1 < side; ++z) {
    for (Index y = 0; y + 1 < side; ++y) {
      for (Index x = 0; x + 1 < side; ++x) {
        for (Index i = 0; i < 8; ++i) {
          for (Index j = 0; j < 8; ++j) {
            for (Index c = 0; c < 9; ++c) {
              const Index row = 3 * node(x + i % 2, y + i / 2 % 2, z + i / 4) + c / 3;
              const Index col = 3 * node(x + j % 2, y + j / 2 % 2, z + j / 4) + c % 3;
              const double part = c / 3 == c % 3 ? 1.0 : 0.25;
              entries.emplace_back(row, col, part * (i == j ? 7.0 : -1.0));
            }
          }
        }
      }
    }
  }
  SparseColumns a(n, n);
  a.setFromTriplets(entries.begin(), entries.end());
  return a;
}

TEST(Factorization, of_meshes_is_by_supernodes) {
  testing::RandomData random(7);
  const SparseColumns one = brick(9);
  const Index n = static_cast<Index>(one.rows());
  std::vector<Eigen::Triplet<double, Index>> entries;  // two bricks that do not touch
  for (Index col = 0; col < n; ++col) {
    for (SparseColumns::InnerIterator at(one, col); at; ++at) {
      entries.emplace_back(static_cast<Index>(at.row()), col, at.value());
      entries.emplace_back(n + static_cast<Index>(at.row()), n + col, 2 * at.value());
    }
  }
  SparseColumns a(2 * n, 2 * n);
  a.setFromTriplets(entries.begin(), entries.end());
  ASSERT_GT(Fronts(MultifrontalCholesky::symmetric_pattern(a)).flops, 1e8);  // so it is used
  const Factorization factorization(a, "A");
  const Vector b = random.vector(2 * n);
  EXPECT_LT((a * factorization.solve(b) - b).norm(), 1e-10 * b.norm());

  SparseColumns h(2 * n, 12);  // the first on one brick, the last on the other, some on both
  for (Index col = 0; col < 12; ++col) {
    for (Index k = 0; k < 5; ++k) {
      if (col < 8) h.coeffRef((97 * k + 13 * col) % n, col) = random.vector(1)[0];
      if (col > 4) h.coeffRef(n + (89 * k + 17 * col) % n, col) = random.vector(1)[0];
    }
  }
  const SparseColumns sparse = factorization.gram(h);
  const Eigen::MatrixXd gram(sparse);
  const Eigen::MatrixXd expected(SparseColumns(h.transpose() * factorization.solve(h)));
  EXPECT_LT((gram - expected).norm(), 1e-10 * expected.norm());
  EXPECT_EQ(gram, gram.transpose());
  EXPECT_EQ(gram(0, 11), 0);
  EXPECT_LT((factorization.gram_diagonal(h) - gram.diagonal()).norm(), 1e-12 * gram.norm());

  SparseColumns indefinite = a;
  indefinite.coeffRef(n, n) = -1;
  EXPECT_THROW(Factorization(indefinite, "M"), Error);
}

TEST(Factorization, says_what_cannot_be_factorised) {
  Eigen::MatrixXd a = Eigen::MatrixXd::Identity(3, 3);
  a(2, 2) = -1;
  EXPECT_THROW(Factorization(a.sparseView(), "M"), Error);
  a(2, 2) = 0;
  a(0, 1) = 1;
  EXPECT_THROW(Factorization(a.sparseView(), "M"), Error);
}

}  // namespace
}  // namespace fclib
