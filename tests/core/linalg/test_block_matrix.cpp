#include "linalg/block_matrix.hpp"

#include <gtest/gtest.h>

#include "random_data.hpp"

namespace fclib {
namespace {

template <int D>
void expect_same(const SparseColumns& source, Storage storage, bool dense) {
  const Eigen::MatrixXd reference(source);
  const BlockMatrix a(converted(Matrix::from_eigen(source), storage), D);
  ASSERT_EQ(a.block_count() * D, reference.rows());
  EXPECT_EQ(a.dense(), dense);
  testing::RandomData random(7);
  const Vector x = random.vector(reference.cols());
  const Vector q = random.vector(reference.rows());
  Vector y(reference.rows());
  a.multiply_add(x, q, y);
  EXPECT_LT((y - (reference * x + q)).norm(), 1e-13);
  for (Index k = 0; k < a.block_count(); ++k) {
    const Eigen::MatrixXd block = reference.block(D * k, D * k, D, D);
    EXPECT_EQ(Eigen::MatrixXd(a.diagonal_block<D>(k)), block);
  }
}

TEST(BlockMatrix, agrees_with_the_matrix_it_is_made_from) {
  testing::RandomData random(4);
  for (const Storage storage : {Storage::triplet, Storage::csc, Storage::csr, Storage::dense}) {
    expect_same<3>(random.sparse(60, 60, 0.02), storage, false);
    expect_same<2>(random.sparse(60, 60, 0.02), storage, false);
    expect_same<3>(random.sparse(12, 12, 0.9), storage, true);
    expect_same<2>(random.sparse(12, 12, 0.9), storage, true);
  }
}

TEST(BlockMatrix, rows_and_columns_are_scaled) {
  testing::RandomData random(9);
  for (const bool dense : {false, true}) {
    const SparseColumns source = dense ? random.sparse(12, 12, 0.9) : random.sparse(60, 60, 0.02);
    const BlockMatrix a(Matrix::from_eigen(source), 3);
    ASSERT_EQ(a.dense(), dense);
    const Vector factors = random.vector(source.rows());
    const Vector x = random.vector(source.rows());
    Vector y;
    a.scaled(factors).multiply_add(x, Vector::Zero(x.size()), y);
    const Vector expected = factors.cwiseProduct(source * factors.cwiseProduct(x));
    EXPECT_LT((y - expected).norm(), 1e-13) << dense;
  }
}

template <int D>
void expect_same_bits(int threads) {
  testing::RandomData random(5);
  constexpr int size = 240;
  const BlockMatrix a(Matrix::from_eigen(random.sparse(size, size, 0.01)), D);
  ASSERT_FALSE(a.dense());
  Vector x = random.vector(size);
  x.segment(D, D).setZero();
  const Vector q = random.vector(size);
  Vector expected(size);
  a.multiply_add(x, q, expected);
  Workers workers(threads);
  Vector y;
  a.multiply_add(x, q, y, &workers);
  EXPECT_EQ(y, expected) << threads;
}

TEST(BlockMatrix, any_number_of_threads_gives_the_same_bits) {
  for (const int threads : {1, 2, 3, 7}) {
    expect_same_bits<2>(threads);
    expect_same_bits<3>(threads);
    expect_same_bits<5>(threads);
  }
}

TEST(BlockMatrix, a_missing_diagonal_block_is_zero) {
  const BlockMatrix a(Matrix::from_eigen(SparseColumns(90, 90)), 3);
  EXPECT_EQ(a.diagonal_block<3>(17).norm(), 0);
}

TEST(BlockMatrix, no_contact_is_no_trouble) {
  const BlockMatrix a(Matrix::from_eigen(SparseColumns(0, 0)), 3);
  Vector y(0);
  a.multiply_add(Vector(0), Vector(0), y);
  EXPECT_EQ(a.block_count(), 0);
}

}  // namespace
}  // namespace fclib
