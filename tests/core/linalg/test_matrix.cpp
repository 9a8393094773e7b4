#include "linalg/matrix.hpp"

#include <gtest/gtest.h>

#include "error.hpp"
#include "random_data.hpp"

namespace fclib {
namespace {

constexpr Storage all_storages[] = {Storage::triplet, Storage::csc, Storage::csr, Storage::dense};

Eigen::MatrixXd dense_of(const Matrix& a) {
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(a.rows, a.cols);
  for_each_entry(a, [&](Index row, Index col, double value) { result(row, col) += value; });
  return result;
}

TEST(Matrix, every_storage_converts_to_every_other) {
  testing::RandomData random(1);
  const SparseColumns source = random.sparse(7, 5, 0.4);
  for (const Storage from : all_storages) {
    const Matrix a = converted(Matrix::from_eigen(source), from);
    validate(a, "a");
    for (const Storage to : all_storages) {
      const Matrix b = converted(a, to);
      validate(b, "b");
      EXPECT_EQ(b.storage, to);
      EXPECT_EQ(dense_of(b), Eigen::MatrixXd(source));
    }
  }
}

TEST(Matrix, triplets_add_up) {
  const Matrix a{.storage = Storage::triplet,
                 .rows = 2,
                 .cols = 2,
                 .p = {1, 1},
                 .i = {0, 0},
                 .x = {1, 2},
                 .info = {}};
  EXPECT_EQ(dense_of(converted(a, Storage::csr))(0, 1), 3);
  EXPECT_EQ(to_eigen(a).nonZeros(), 1);
}

TEST(Matrix, products_agree_with_dense_ones) {
  testing::RandomData random(2);
  const SparseColumns source = random.sparse(6, 9, 0.5);
  const Vector x = random.vector(9);
  const Vector y = random.vector(6);
  for (const Storage storage : all_storages) {
    const Matrix a = converted(Matrix::from_eigen(source), storage);
    Vector ax = y;
    multiply_add(a, x, ax);
    EXPECT_LT((ax - (y + Eigen::MatrixXd(source) * x)).norm(), 1e-14);
    Vector aty = x;
    multiply_transposed_add(a, y, aty);
    EXPECT_LT((aty - (x + Eigen::MatrixXd(source).transpose() * y)).norm(), 1e-14);
  }
}

TEST(Matrix, validation_names_the_entry) {
  testing::RandomData random(3);
  Matrix a = converted(Matrix::from_eigen(random.sparse(4, 4, 0.9)), Storage::csr);
  a.i[2] = 4;
  try {
    validate(a, "/fclib_local/W");
    FAIL() << "an index out of range was accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind, ErrorKind::problem);
    EXPECT_EQ(error.where, "/fclib_local/W/i[2]");
  }
}

TEST(Matrix, an_unsorted_matrix_is_not_canonical) {
  Matrix a{.storage = Storage::csr,
           .rows = 1,
           .cols = 3,
           .p = {0, 2},
           .i = {0, 2},
           .x = {1, 2},
           .info = {}};
  EXPECT_TRUE(is_canonical(a));
  a.i = {2, 0};
  EXPECT_FALSE(is_canonical(a));
  a.i = {1, 1};
  EXPECT_FALSE(is_canonical(a));
}

}  // namespace
}  // namespace fclib
