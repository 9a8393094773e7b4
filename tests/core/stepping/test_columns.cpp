#include "stepping/columns.hpp"

#include <gtest/gtest.h>

#include <array>

#include "random_data.hpp"

namespace fclib::stepping {
namespace {

Eigen::MatrixXd dense(const Matrix& a) { return Eigen::MatrixXd(to_eigen(a)); }

Matrix by_columns(const Eigen::MatrixXd& a) { return Matrix::from_eigen(a.sparseView()); }

void expect_sum(const Eigen::MatrixXd& a, double factor, const Eigen::MatrixXd& b) {
  const Matrix one = converted(by_columns(a), Storage::csc);
  const Matrix other = converted(by_columns(b), Storage::csc);
  const Matrix found = sum(columns_of(one), factor, columns_of(other));
  const Eigen::MatrixXd expected = a + factor * b;
  EXPECT_EQ(dense(found), expected);
  EXPECT_TRUE(is_canonical(found));
  EXPECT_EQ(found.x.size(), static_cast<std::size_t>((expected.array() != 0).count()));
}

TEST(Columns, are_added_without_what_cancels) {
  Eigen::MatrixXd a(4, 4);
  a << 4, 1, 0, 0, 1, 0.3, 0, 0, 0, 0, 5, 0, 0, 0, 0, 0.1;
  for (const std::array<double, 4>& values :
       {std::array{0.0, 0.7, 0.1, 0.0}, std::array{0.0, 0.0, 0.0, -0.2}}) {
    const Eigen::MatrixXd diagonal = Eigen::Map<const Eigen::Vector4d>(values.data()).asDiagonal();
    expect_sum(a, 0.5, diagonal);
    Eigen::MatrixXd gap = a;  // on a diagonal with a gap
    gap(2, 2) = 0;
    expect_sum(gap, 0.5, diagonal);
  }
  testing::RandomData random(3);
  for (int k = 0; k < 10; ++k) {
    expect_sum(Eigen::MatrixXd(random.sparse(12, 12, 0.3)), 0.25,
               Eigen::MatrixXd(random.sparse(12, 12, 0.2)));
  }
}

TEST(Columns, need_no_order_of_their_rows) {
  Matrix a = by_columns(Eigen::MatrixXd::Identity(3, 3));
  a.storage = Storage::csc;
  a.p = {0, 2, 3, 3};
  a.i = {2, 0, 1};
  a.x = {5, 7, 1};
  const Matrix found = sum(columns_of(a), 2, columns_of(a));
  EXPECT_EQ(found.i, (std::vector<Index>{0, 2, 1}));
  EXPECT_EQ(found.x, (std::vector<double>{21, 15, 3}));
}

TEST(Columns, of_some_numbers_have_their_rows_numbered_anew) {
  testing::RandomData random(5);
  const Eigen::MatrixXd full(random.sparse(6, 5, 0.6));
  const Matrix a = converted(by_columns(full), Storage::csc);
  const std::vector<Index> columns{4, 1}, number{1, -1, 0, -1, 2, -1};
  const Eigen::MatrixXd found = dense(part(columns_of(a), columns, number, 3));
  for (Index col = 0; col < 2; ++col) {
    EXPECT_EQ(found(0, col), full(2, columns[static_cast<std::size_t>(col)]));
    EXPECT_EQ(found(1, col), full(0, columns[static_cast<std::size_t>(col)]));
    EXPECT_EQ(found(2, col), full(4, columns[static_cast<std::size_t>(col)]));
  }
}

}  // namespace
}  // namespace fclib::stepping
