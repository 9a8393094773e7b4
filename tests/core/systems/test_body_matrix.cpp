#include "systems/body_matrix.hpp"

#include <gtest/gtest.h>

#include <optional>

#include "random_data.hpp"

namespace fclib {
namespace {

struct Case {
  int d;
  Index nc;
  Primal primal;
  std::vector<double> blocks;
  Eigen::MatrixXd D;
  Vector x, y;
};

/// M as it is stored, not symmetric in its pattern; the first contact touches nothing.
Case make_case(testing::RandomData& random, int d, Index nc, Index n) {
  Case result{d, nc, {}, {}, Eigen::MatrixXd::Zero(d * nc, d * nc), {}, {}};
  result.primal.M = random.sparse(n, n, 0.2);
  Eigen::MatrixXd h = Eigen::MatrixXd(random.sparse(n, d * nc, 3.0 / n));
  h.leftCols(d).setZero();
  result.primal.H = h.sparseView();
  for (Index a = 0; a < nc; ++a) {
    const Eigen::MatrixXd block = random.dense(d, d);
    result.D.block(d * a, d * a, d, d) = block;
    result.blocks.insert(result.blocks.end(), block.data(), block.data() + block.size());
  }
  result.x = random.vector(d * nc);
  result.y = random.vector(n);
  return result;
}

TEST(BodyMatrix, IsTheMatrixOnTheBodiesOnAnyNumberOfThreads) {
  testing::RandomData random(11);
  for (const int d : {2, 3, 5}) {
    for (const auto& [nc, n] : {std::pair{1, 1}, std::pair{9, 40}, std::pair{40, 12}}) {
      const Case test = make_case(random, d, nc, n);
      const Eigen::MatrixXd H(test.primal.H);
      const Eigen::MatrixXd expected = Eigen::MatrixXd(test.primal.M) + H * test.D * H.transpose();
      std::optional<std::vector<double>> values_of_one;
      Vector y_of_one;
      Vector x_of_one;
      for (const int threads : {1, 2, 3, 7}) {
        BodyMatrix bodies;
        const std::optional<BlockPattern> pattern = bodies.analyse(test.primal, d);
        ASSERT_TRUE(pattern);
        bodies.share_out(threads);
        std::optional<Workers> workers;
        if (threads > 1) workers.emplace(threads);
        Workers* team = workers ? &*workers : nullptr;

        std::vector<double> values;
        for (int again = 0; again < 2; ++again) bodies.fill(test.blocks, values, team);
        ASSERT_EQ(values.size(), pattern->row.size());
        Eigen::MatrixXd found = Eigen::MatrixXd::Zero(n, n);
        for (Index col = 0; col < n; ++col) {
          for (auto k = pattern->first[col]; k < pattern->first[col + 1]; ++k)
            found(pattern->row[k], col) = values[k];
        }
        EXPECT_LE((found - expected).cwiseAbs().maxCoeff(), 1e-13 * (1 + expected.norm()));
        Vector y;
        bodies.to_bodies(test.x, y, team);
        EXPECT_LE((y - H * test.x).norm(), 1e-13 * (1 + y.norm()));
        Vector x = test.x;
        bodies.subtract_from_contacts(test.blocks, test.y, x, team);
        const Vector difference = x - (test.x - test.D * (H.transpose() * test.y));
        EXPECT_LE(difference.norm(), 1e-13 * (1 + x.norm()));

        if (threads == 1) {
          values_of_one = values;
          y_of_one = y;
          x_of_one = x;
        }
        EXPECT_EQ(values, *values_of_one) << threads;
        EXPECT_TRUE(y == y_of_one && x == x_of_one) << threads;
      }
    }
  }
}

TEST(BodyMatrix, IsNotMadeWhereAContactTouchesTooMuch) {
  testing::RandomData random(3);
  Primal primal;
  primal.M = random.definite(80, 0.1);
  primal.H = Eigen::MatrixXd::Ones(80, 3).sparseView();
  EXPECT_FALSE(BodyMatrix().analyse(primal, 3));
}

}  // namespace
}  // namespace fclib
