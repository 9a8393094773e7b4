#include "merit/merit.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace fclib {
namespace {

/// Three uncoupled unit contacts that end open, sticking and sliding.
LocalProblem three_statuses() {
  LocalProblem problem;
  SparseColumns identity(9, 9);
  identity.setIdentity();
  problem.W = Matrix::from_eigen(identity);
  problem.q = Vector(9);
  problem.q << 1, 2, 3, -1, 0.1, 0, -1, 2, 0;
  problem.mu = Vector::Constant(3, 0.5);
  return problem;
}

Solution three_reactions() {
  Solution solution;
  solution.r = Vector(9);
  solution.r << 0, 0, 0, 1, -0.1, 0, 1, -0.5, 0;
  return solution;
}

TEST(Merit, an_exact_solution_has_none_and_shows_the_statuses) {
  const Merit result = merit(three_statuses(), three_reactions());
  EXPECT_LT(result.error, 1e-15);
  EXPECT_LT(result.cone, 1e-15);
  EXPECT_LT(result.dual_cone, 1e-15);
  EXPECT_LT(result.complementarity, 1e-15);
  EXPECT_EQ(result.open, 1);
  EXPECT_EQ(result.stick, 1);
  EXPECT_EQ(result.slide, 1);
}

TEST(Merit, each_part_sees_its_own_mistake) {
  const LocalProblem problem = three_statuses();
  Solution outside = three_reactions();
  outside.r[7] = -0.8;  // the sliding contact leaves the cone
  EXPECT_NEAR(merit(problem, outside).cone, 0.3 / std::sqrt(1.25), 1e-12);
  Solution penetrating = three_reactions();
  penetrating.r.segment<3>(3).setZero();
  EXPECT_GT(merit(problem, penetrating).dual_cone, 0.5);
  Solution loaded = three_reactions();
  loaded.r[0] = 1;  // the open contact carries load
  EXPECT_GT(merit(problem, loaded).complementarity, 1);
  Solution moving = three_reactions();
  moving.u = Vector::Ones(9);
  EXPECT_GT(merit(problem, moving).kinematics, 0.1);
  for (const Solution& wrong : {outside, penetrating, loaded, moving}) {
    EXPECT_GT(merit(problem, wrong).error, 0.01);
  }
}

TEST(Merit, the_relative_error_is_absolute_where_q_is_zero) {
  LocalProblem problem = three_statuses();
  problem.q.setZero();
  Solution solution;
  solution.r = Vector::Zero(9);
  EXPECT_EQ(merit(problem, solution).error, 0);
  solution.r[1] = 1e-3;
  EXPECT_NEAR(merit(problem, solution).natural, 1e-3, 1e-4);
}

TEST(Merit, the_scaled_natural_map_does_not_change_with_the_units) {
  LocalProblem problem = three_statuses();
  Solution solution = three_reactions();
  solution.r[7] = -0.45;
  const double before = merit(problem, solution).scaled_natural;
  for (auto& value : problem.W.x) value *= 1e-6;  // heavier by 1e6
  solution.r *= 1e6;
  const double after = merit(problem, solution).scaled_natural;
  EXPECT_NEAR(after / before, 1, 1e-12);
}

TEST(Merit, what_is_not_a_solution_of_the_right_size_is_an_error) {
  Solution solution = three_reactions();
  solution.r.conservativeResize(6);
  EXPECT_THROW(merit(three_statuses(), solution), Error);
  solution = three_reactions();
  solution.r[0] = std::nan("");
  EXPECT_THROW(merit(three_statuses(), solution), Error);
}

}  // namespace
}  // namespace fclib
