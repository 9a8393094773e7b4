#include <gtest/gtest.h>

#include "convert/component_order.hpp"
#include "convert/embed.hpp"
#include "convert/islands.hpp"
#include "convert/units.hpp"
#include "merit/merit.hpp"

namespace fclib {
namespace {

/// Contacts 0 and 2 on one body, 1 on another, in the plane; one body touches nothing.
GlobalProblem three_bodies() {
  GlobalProblem problem;
  problem.spacedim = 2;
  Eigen::MatrixXd h = Eigen::MatrixXd::Zero(6, 6);
  h.block(2, 0, 2, 2) = Eigen::Matrix2d::Identity();
  h.block(2, 4, 2, 2) = 2 * Eigen::Matrix2d::Identity();
  h.block(4, 2, 2, 2) = Eigen::Matrix2d::Identity();
  const Eigen::MatrixXd mass = Eigen::VectorXd::LinSpaced(6, 1, 6).asDiagonal();
  problem.M = Matrix::from_eigen(mass.sparseView());
  problem.H = Matrix::from_eigen(h.sparseView());
  problem.f = -Vector::Ones(6);
  problem.w = Vector::Zero(6);
  problem.mu = Vector::Constant(3, 0.3);
  validate(problem);
  return problem;
}

TEST(Islands, are_numbered_by_their_first_contact) {
  const Islands found = islands(three_bodies());
  EXPECT_EQ(found.count, 3);
  EXPECT_EQ(found.contact, (std::vector<Index>{0, 1, 0}));
  EXPECT_EQ(found.dof, (std::vector<Index>{2, 2, 0, 0, 1, 1}));
}

TEST(Islands, split_and_merge_are_inverse) {
  const GlobalProblem problem = three_bodies();
  const Islands found = islands(problem);
  const std::vector<GlobalProblem> parts = split(problem, found);
  ASSERT_EQ(parts.size(), 3U);
  for (const GlobalProblem& part : parts) validate(part);
  EXPECT_EQ(parts[0].mu.size(), 2);
  EXPECT_EQ(parts[2].mu.size(), 0);
  const GlobalProblem again = merge(parts, found);
  EXPECT_EQ(again.M, problem.M);
  EXPECT_EQ(again.H, problem.H);
  EXPECT_EQ(again.f, problem.f);
}

TEST(ComponentOrder, there_and_back) {
  const GlobalProblem problem = three_bodies();
  for (const auto order : {ComponentOrder::normal_last, ComponentOrder::normals_first}) {
    const GlobalProblem there = to_order(problem, order);
    EXPECT_NE(there.H, problem.H);
    EXPECT_EQ(from_order(there, order).H, problem.H);
  }
}

TEST(Embedding, and_units_keep_what_is_a_solution) {
  const GlobalProblem problem = three_bodies();
  // each body stops: contact 0 bears the first
  Solution solution{.r = Vector::Zero(6)};
  solution.r << 1, 0.3, 1, 0.3, 0, 0;
  const double error = merit(problem, solution).error;
  EXPECT_NEAR(merit(embed(problem), embed(solution, problem)).natural, error, 1e-14);
  const Scaling scaling{.velocity = 8, .impulse = 8};
  EXPECT_NEAR(merit(scaled(problem, scaling), scaled(solution, problem, scaling)).natural, error,
              1e-14);
}

}  // namespace
}  // namespace fclib
