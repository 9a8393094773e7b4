#include "linalg/factorization.hpp"

#include <gtest/gtest.h>

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
    EXPECT_EQ(factorization.is_cholesky(), a.isApprox(SparseColumns(a.transpose())));
    const Vector b = random.vector(20);
    EXPECT_LT((a * factorization.solve(b) - b).norm(), 1e-12);
    const SparseColumns many = random.sparse(20, 6, 0.2);
    EXPECT_LT((Eigen::MatrixXd(a * factorization.solve(many)) - Eigen::MatrixXd(many)).norm(),
              1e-12);
  }
}

TEST(Factorization, half_solve_gives_the_symmetric_product_and_keeps_it_sparse) {
  testing::RandomData random(6);
  // two bodies that do not touch: a block-diagonal matrix
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(16, 16);
  a.topLeftCorner(8, 8) = Eigen::MatrixXd(random.definite(8, 0.4));
  a.bottomRightCorner(8, 8) = Eigen::MatrixXd(random.definite(8, 0.4));
  Eigen::MatrixXd b = Eigen::MatrixXd::Zero(16, 4);
  b.topLeftCorner(8, 2) = random.dense(8, 2);
  b.bottomRightCorner(8, 2) = random.dense(8, 2);
  const SparseColumns y = Factorization(a.sparseView(), "A").half_solve(b.sparseView());
  const Eigen::MatrixXd product(SparseColumns(y.transpose() * y));
  EXPECT_LT((product - b.transpose() * a.inverse() * b).norm(), 1e-12);
  EXPECT_EQ(product, product.transpose());
  EXPECT_LE(y.nonZeros(), 32);
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
