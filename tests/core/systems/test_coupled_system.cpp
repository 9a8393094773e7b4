#include "systems/coupled_system.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include "random_data.hpp"

namespace fclib {
namespace {

struct Case {
  ReducedProblem problem;
  Primal primal;
  Eigen::MatrixXd W;
};

Case make_case(testing::RandomData& random, int d, Index nc, Index n) {
  Case result;
  result.primal.M = random.definite(n, 0.1);
  result.primal.H = random.sparse(n, d * nc, 3.0 / n);
  result.W = Eigen::MatrixXd(result.primal.H).transpose() *
             Eigen::MatrixXd(result.primal.M).llt().solve(Eigen::MatrixXd(result.primal.H));
  result.problem.W = BlockMatrix(Matrix::from_eigen(result.W.sparseView()), d);
  result.problem.q = random.vector(d * nc);
  result.problem.friction.mu = Vector::Constant(nc, 0.5);
  return result;
}

/// Blocks as they come: some zero, some singular, none symmetric.
Eigen::MatrixXd random_blocks(testing::RandomData& random, std::vector<double>& blocks, int d,
                              Index nc) {
  Eigen::MatrixXd D = Eigen::MatrixXd::Zero(d * nc, d * nc);
  for (Index a = 0; a < nc; ++a) {
    if (a % 3 == 0) continue;
    Eigen::MatrixXd block = random.dense(d, d) + 2 * Eigen::MatrixXd::Identity(d, d);
    if (a % 3 == 1) block.row(d - 1).setZero();
    D.block(d * a, d * a, d, d) = 10 * block;
  }
  for (Index a = 0; a < nc; ++a) {
    Eigen::Map<Eigen::MatrixXd>(blocks.data() + d * d * a, d, d) = D.block(d * a, d * a, d, d);
  }
  return D;
}

TEST(CoupledSystem, SolvesOnContactsAndOnBodies) {
  testing::RandomData random(4);
  for (const int d : {2, 3, 5}) {
    for (const auto& [nc, n] : {std::pair{1, 6}, std::pair{10, 60}, std::pair{60, 30}}) {
      Case test = make_case(random, d, nc, n);
      for (const bool bodies : {false, true}) {
        test.problem.primal = bodies ? &test.primal : nullptr;
        CoupledSystem system(test.problem);
        EXPECT_TRUE(bodies || !system.on_bodies());
        const Eigen::MatrixXd D = random_blocks(random, system.blocks(), d, nc);
        ASSERT_TRUE(system.factorise());
        const Vector x = random.vector(d * nc);
        Vector h = x + D * (test.W * x);
        system.solve(h);
        EXPECT_LE((h - x).norm(), 1e-9 * x.norm()) << d << " " << nc << " " << bodies;
      }
    }
  }
}

TEST(CoupledSystem, SolvesWithBlocksOfItsOwn) {
  testing::RandomData random(7);
  for (const int d : {2, 3, 5}) {
    const Index nc = 12;
    const Case test = make_case(random, d, nc, 80);
    CoupledSystem system(test.problem, CoupledSystem::Form::general);
    EXPECT_FALSE(system.on_bodies());
    const Eigen::MatrixXd D = random_blocks(random, system.blocks(), d, nc);
    Eigen::MatrixXd B = Eigen::MatrixXd::Identity(d * nc, d * nc);
    B.topLeftCorner(d, d) *= 2;
    // a contact that D regularises by itself has none
    B.block(2 * d, 2 * d, d, d).setZero();
    for (Index a = 0; a < nc; ++a) {
      Eigen::Map<Eigen::MatrixXd>(system.own_blocks().data() + d * d * a, d, d) =
          B.block(d * a, d * a, d, d);
    }
    ASSERT_TRUE(system.factorise());
    const Vector x = random.vector(d * nc);
    Vector h = B * x + D * (test.W * x);
    system.solve(h);
    EXPECT_LE((h - x).norm(), 1e-8 * x.norm()) << d;
  }
}

TEST(CoupledSystem, TakesTheBodiesWhereTheyAreFewer) {
  testing::RandomData random(5);
  Case test = make_case(random, 3, 80, 12);
  test.problem.primal = &test.primal;
  EXPECT_TRUE(CoupledSystem(test.problem).on_bodies());
}

}  // namespace
}  // namespace fclib
