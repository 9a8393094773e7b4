#include "linalg/matrix.hpp"

#include <gtest/gtest.h>

#include "error.hpp"
#include "linalg/places.hpp"
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

TEST(Matrix, a_sum_that_no_double_holds_is_named) {
  const double half = 1e308;
  Matrix a{.storage = Storage::triplet,
           .rows = 2,
           .cols = 2,
           .p = {0, 0, 1, 1},
           .i = {1, 0, 0, 0},
           .x = {half, half, half, half},
           .info = {}};
  try {
    validate(a, "/fclib_local/W");
    FAIL() << "an infinite sum was accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind, ErrorKind::problem);
    EXPECT_EQ(error.where, "/fclib_local/W/x[2]");
    EXPECT_EQ(error.message, "the sum of the entries in row 0, column 1 is not a finite number");
  }
  a.x[3] = -half;
  validate(a, "W");
}

TEST(Matrix, a_triangle_stands_for_both) {
  testing::RandomData random(4);
  const SparseColumns source = random.sparse(6, 6, 0.5);
  for (const Storage storage : all_storages) {
    for (const bool upper : {false, true}) {
      const Eigen::MatrixXd full(source);
      Eigen::MatrixXd half = full.triangularView<Eigen::Lower>();
      if (upper) half.transposeInPlace();
      const Matrix whole =
          symmetric_of_triangle(converted(Matrix::from_eigen(half.sparseView()), storage), "W");
      validate(whole, "W");
      EXPECT_EQ(whole.storage, storage);
      const Eigen::MatrixXd expected = full.selfadjointView<Eigen::Lower>();
      EXPECT_EQ(dense_of(whole), expected);
    }
    const Matrix both = converted(Matrix::from_eigen(source), storage);
    EXPECT_THROW(symmetric_of_triangle(both, "W"), Error);
    EXPECT_THROW(
        symmetric_of_triangle(converted(Matrix::from_eigen(random.sparse(3, 2, 1)), storage), "W"),
        Error);
  }
}

TEST(Matrix, values_that_nobody_counts) {
  const std::vector<double> none(3);
  const std::vector<double> one{1.0};
  const std::vector<double> some{0.0, 2.0, 0.0};
  require_counted(none, 0, "p");
  require_counted(one, 0, "p");
  require_counted(some, 1, "p");
  try {
    require_counted(some, 0, "/fclib_local/W/p");
    FAIL() << "values without a count were accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind, ErrorKind::problem);
    EXPECT_EQ(error.where, "/fclib_local/W/p");
    EXPECT_NE(error.message.find("has 3, of which 1 are not 0"), std::string::npos);
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
