#include "joints/consistent.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

namespace fclib {
namespace {

/// A point of 1 kg at 1 m/s, held twice along the same direction, which the second row asks to
/// move `off` faster [m/s]. Its numbers are floats.
GlobalProblem held_twice(double off, double rounding = 0) {
  GlobalProblem problem;
  problem.spacedim = 2;
  Eigen::MatrixXd g(2, 2);
  const double x = 0.6F;
  const double y = 0.8F;
  g << x + rounding, x, y, y;
  problem.M = Matrix::from_eigen(SparseColumns(Eigen::MatrixXd::Identity(2, 2).sparseView()));
  problem.H = problem.M;
  problem.G = Matrix::from_eigen(SparseColumns(g.sparseView()));
  problem.f = Vector::Unit(2, 0);
  problem.w = Vector::Zero(2);
  problem.mu = Vector::Constant(1, 0.5);
  problem.b = Vector(2);
  problem.b << 0.25, 0.25 + off;
  return problem;
}

TEST(ConsistentJoints, meet_in_the_middle) {
  const double off = 1e-8;
  const auto found = consistent_joints(held_twice(off));
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->moved, off / 2, 1e-15);
  EXPECT_NEAR(found->b[0], found->b[1], 1e-15);
  EXPECT_NEAR(found->b[0], 0.25 + off / 2, 1e-15);
  EXPECT_FALSE(found->stated);
  EXPECT_NE(found->words().find("5e-09 m/s"), std::string::npos) << found->words();
}

TEST(ConsistentJoints, stay_where_they_agree_or_contradict_each_other) {
  EXPECT_FALSE(consistent_joints(held_twice(0)));
  EXPECT_FALSE(consistent_joints(held_twice(1e-4)));
  EXPECT_FALSE(consistent_joints(held_twice(std::nan(""))));
}

TEST(ConsistentJoints, stay_without_bodies_that_move) {
  GlobalProblem still = held_twice(1e-9);
  still.f.setZero();
  still.b << 0, 1e-9;
  EXPECT_FALSE(consistent_joints(still));
}

TEST(ConsistentJoints, of_doubles_stay_unless_the_precision_is_stated) {
  GlobalProblem problem = held_twice(1e-8, 1e-12);
  EXPECT_FALSE(consistent_joints(problem));
  problem.info.description = R"({"engine": "any", "precision": 6e-08})";
  const auto found = consistent_joints(problem);
  ASSERT_TRUE(found);
  EXPECT_TRUE(found->stated);
  EXPECT_EQ(found->precision, 6e-8);
  for (const char* nonsense :
       {R"({"precision": -1})", R"({"precision": "single"})", R"({"precision": 1e-16})",
        R"({"precision": nan})", R"({"precision": 1e9})"}) {
    problem.info.description = nonsense;
    EXPECT_FALSE(consistent_joints(problem)) << nonsense;
  }
}

TEST(ConsistentJoints, of_numbers_written_by_hand_stay) {
  GlobalProblem problem = held_twice(1e-8);
  Eigen::MatrixXd g(2, 2);
  g << 0.5, 0.5, 0.25, 0.25;
  problem.G = Matrix::from_eigen(SparseColumns(g.sparseView()));
  EXPECT_FALSE(consistent_joints(problem));
}

}  // namespace
}  // namespace fclib
