#include "reduced/island_bodies.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include "random_data.hpp"

namespace fclib {
namespace {

Eigen::MatrixXd delassus(const Primal& primal) {
  const Eigen::MatrixXd M = primal.M;
  const Eigen::MatrixXd H = primal.H;
  return H.transpose() * M.llt().solve(H);
}

TEST(IslandBodies, HaveTheDelassusMatrixOfTheirContacts) {
  // three bodies of three coordinates; the first two meet in contacts 0 and 3, the last has 1 and 2
  testing::RandomData random(1);
  Eigen::MatrixXd M = Eigen::MatrixXd::Zero(9, 9);
  for (int body = 0; body < 3; ++body) {
    const Eigen::MatrixXd root = random.dense(3, 3);
    M.block(3 * body, 3 * body, 3, 3) = root * root.transpose() + Eigen::MatrixXd::Identity(3, 3);
  }
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(9, 12);
  for (const int contact : {0, 3}) H.block(0, 3 * contact, 6, 3) = random.dense(6, 3);
  for (const int contact : {1, 2}) H(7, 3 * contact + 1) = random.dense(1, 1)(0, 0);
  const Primal whole{SparseColumns(M.sparseView()), SparseColumns(H.sparseView())};
  const Eigen::MatrixXd W = delassus(whole);

  IslandBodies bodies(whole);
  const std::vector<std::vector<Index>> islands{{0, 3}, {1, 2}, {3}};
  const std::vector<Index> sizes{6, 3, 6};  // a coordinate comes with all that M links to it
  for (std::size_t k = 0; k < islands.size(); ++k) {
    const Primal part = bodies.of(islands[k], 3);
    EXPECT_EQ(part.M.rows(), sizes[k]);
    std::vector<Index> columns;
    for (const Index contact : islands[k]) {
      for (int component = 0; component < 3; ++component)
        columns.push_back(3 * contact + component);
    }
    EXPECT_LT((delassus(part) - W(columns, columns)).norm(), 1e-12 * W.norm());
  }
}

}  // namespace
}  // namespace fclib
