#include "convert/condense.hpp"

#include <gtest/gtest.h>

#include "convert/complete.hpp"
#include "convert/eliminate.hpp"
#include "random_problems.hpp"

namespace fclib {
namespace {

TEST(Condensation, agrees_with_dense_algebra) {
  testing::RandomData random(11);
  const GlobalProblem problem = testing::random_global<GlobalProblem>(random, 18, 3, 4, 3);
  const LocalProblem local = condense(problem);
  validate(local);
  const Eigen::MatrixXd m(to_eigen(problem.M));
  const Eigen::MatrixXd h(to_eigen(problem.H));
  const Eigen::MatrixXd g(to_eigen(problem.G));
  const Eigen::MatrixXd inverse = m.inverse();
  const auto close = [](const Matrix& a, const Eigen::MatrixXd& b) {
    return (Eigen::MatrixXd(to_eigen(a)) - b).norm() <= 1e-12 * (1 + b.norm());
  };
  EXPECT_TRUE(close(local.W, h.transpose() * inverse * h));
  EXPECT_TRUE(close(local.V, h.transpose() * inverse * g));
  EXPECT_TRUE(close(local.R, g.transpose() * inverse * g));
  EXPECT_LT((local.q - (h.transpose() * inverse * problem.f + problem.w)).norm(), 1e-12);
  EXPECT_LT((local.s - (g.transpose() * inverse * problem.f + problem.b)).norm(), 1e-12);
}

TEST(Condensation, expand_and_eliminate_satisfy_every_equation) {
  testing::RandomData random(12);
  const GlobalProblem problem = testing::random_global<GlobalProblem>(random, 18, 3, 4, 3);
  const Condensation condensation(problem);
  const Elimination elimination(condensation.local());
  Solution solution;
  solution.r = random.vector(12);
  solution = condensation.expand(elimination.expand(solution));

  Vector momentum = problem.f;
  multiply_add(problem.H, solution.r, momentum);
  multiply_add(problem.G, solution.l, momentum);
  EXPECT_LT((to_eigen(problem.M) * solution.v - momentum).norm(), 1e-11);
  EXPECT_LT((to_eigen(problem.G).transpose() * solution.v + problem.b).norm(), 1e-11);
  const LocalProblem& plain = elimination.plain();
  EXPECT_LT((to_eigen(plain.W) * solution.r + plain.q - solution.u).norm(), 1e-11);
}

TEST(Condensation, a_problem_without_contacts_has_an_empty_local_form) {
  testing::RandomData random(13);
  const GlobalProblem problem = testing::random_global<GlobalProblem>(random, 6, 3, 0, 0);
  const LocalProblem local = condense(problem);
  validate(local);
  EXPECT_EQ(local.size(Dim::m), 0);
  EXPECT_EQ(local.W.rows, 0);
}

using testing::dense;

TEST(Condensation, keeps_what_it_does_not_change) {
  testing::RandomData random(14);
  auto problem = testing::random_global<GlobalRollingProblem>(random, 9, 5, 2, 0);
  problem.info.title = "a title";
  const LocalRollingProblem local = condense(problem);
  validate(local);
  EXPECT_EQ(local.spacedim, 5);
  EXPECT_EQ(local.mu, problem.mu);
  EXPECT_EQ(local.mu_r, problem.mu_r);
  EXPECT_EQ(local.info.title, "a title");
  EXPECT_EQ(local.W.storage, Storage::csr);
  EXPECT_TRUE(local.V.empty() && local.R.empty() && local.s.size() == 0);
}

TEST(Condensation, expand_gives_the_velocities_without_bilateral_constraints) {
  testing::RandomData random(15);
  const auto problem = testing::random_global<GlobalProblem>(random, 10, 2, 3, 0);
  const Condensation condensation(problem);
  Solution solution;
  solution.r = random.vector(6);
  solution.u = random.vector(6);  // wrong, and to be replaced
  solution = condensation.expand(solution);
  const Vector v = dense(problem.M).inverse() * (dense(problem.H) * solution.r + problem.f);
  EXPECT_LT((solution.v - v).norm(), 1e-12);
  EXPECT_LT((solution.u - (dense(problem.H).transpose() * v + problem.w)).norm(), 1e-12);
  EXPECT_LT((condensation.mass().solve(problem.f) - dense(problem.M).inverse() * problem.f).norm(),
            1e-12);
}

TEST(Condensation, joints_without_contacts_have_a_local_form_of_their_own) {
  testing::RandomData random(16);
  const auto problem = testing::random_global<GlobalProblem>(random, 6, 3, 0, 2);
  const LocalProblem local = condense(problem);
  validate(local);
  EXPECT_EQ(local.R.rows, 2);
  EXPECT_EQ(local.V.rows, 0);
  EXPECT_EQ(local.V.cols, 2);
  // what is left without them is nothing
  EXPECT_EQ(eliminate(local).size(Dim::m), 0);
}

TEST(Condensation, mass_ratios_of_1e12_keep_their_digits) {
  // one direction of a body of 1e12 kg and one of a body of 1 kg, both at each contact
  GlobalProblem problem;
  problem.spacedim = 2;
  const Eigen::Vector4d masses(1e12, 1e12, 1, 1);
  problem.M = Matrix::from_eigen(Eigen::MatrixXd(masses.asDiagonal()).sparseView());
  problem.H = Matrix::from_eigen(Eigen::MatrixXd(Eigen::Matrix4d::Identity()).sparseView());
  problem.f = Eigen::Vector4d(-1e12, 0, -1, 0);
  problem.w = Vector::Zero(4);
  problem.mu = Vector::Constant(2, 0.5);
  const LocalProblem local = condense(problem);
  const Eigen::MatrixXd w = dense(local.W);
  for (int k = 0; k < 4; ++k) EXPECT_NEAR(w(k, k) * masses[k], 1, 1e-15);
  EXPECT_NEAR(local.q[0], -1, 1e-15);
  EXPECT_NEAR(local.q[2], -1, 1e-15);
}

TEST(Condensation, a_mass_that_is_not_definite_is_refused_by_name) {
  testing::RandomData random(17);
  auto problem = testing::random_global<GlobalProblem>(random, 3, 3, 1, 0);
  problem.M =
      Matrix::from_eigen(Eigen::MatrixXd(Eigen::Vector3d(1, 1, -1).asDiagonal()).sparseView());
  try {
    condense(problem);
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind, ErrorKind::unsuitable);
    EXPECT_NE(std::string(error.what()).find("M is"), std::string::npos);
  }
}

TEST(Elimination, agrees_with_dense_algebra) {
  testing::RandomData random(18);
  auto problem = testing::random_local<LocalRollingProblem>(random, 5, 3, 4, 0.1);
  problem.info.title = "a title";
  const LocalRollingProblem plain = eliminate(problem);
  validate(plain);
  const Eigen::MatrixXd v = dense(problem.V);
  const Eigen::MatrixXd inverse = dense(problem.R).inverse();
  EXPECT_LT((dense(plain.W) - (dense(problem.W) - v * inverse * v.transpose())).norm(), 1e-12);
  EXPECT_LT((plain.q - (problem.q - v * inverse * problem.s)).norm(), 1e-12);
  EXPECT_EQ(plain.W.storage, Storage::csr);
  EXPECT_EQ(plain.spacedim, 5);
  EXPECT_EQ(plain.mu, problem.mu);
  EXPECT_EQ(plain.mu_r, problem.mu_r);
  EXPECT_EQ(plain.info.title, "a title");
  EXPECT_FALSE(is_mixed(plain));
  // lambda holds the joints, and u is that of the whole
  const Elimination elimination(problem);
  Solution solution;
  solution.r = random.vector(15);
  solution = elimination.expand(solution);
  EXPECT_LT((solution.l + inverse * (v.transpose() * solution.r + problem.s)).norm(), 1e-12);
  EXPECT_LT((solution.u - (dense(problem.W) * solution.r + v * solution.l + problem.q)).norm(),
            1e-12);
}

TEST(Elimination, leaves_a_problem_without_joints_as_it_is) {
  testing::RandomData random(19);
  const auto problem = testing::random_local<LocalProblem>(random, 3, 2, 0);
  EXPECT_EQ(eliminate(problem).W, problem.W);
  EXPECT_EQ(eliminate(problem).q, problem.q);
}

/// Two contacts in the plane, and one joint.
LocalProblem held_by_a_joint(const Eigen::Matrix4d& w, const Eigen::Vector4d& v, double r) {
  LocalProblem problem;
  problem.spacedim = 2;
  problem.W = Matrix::from_eigen(w.sparseView());
  problem.V = Matrix::from_eigen(Eigen::MatrixXd(v).sparseView());
  problem.R = Matrix::from_eigen(Eigen::MatrixXd::Constant(1, 1, r).sparseView());
  problem.q = Vector::Zero(4);
  problem.s = Vector::Zero(1);
  problem.mu = Vector::Constant(2, 0.5);
  validate(problem);
  return problem;
}

TEST(Elimination, what_a_joint_holds_entirely_is_zero_and_not_rounding) {
  // 0.1 - 0.7 (0.7 / 4.9) is 1e-17 in double precision; an entry of W' that is 0 is not stored
  EXPECT_NE(0.1 - 0.7 * (0.7 / 4.9), 0);
  Eigen::Matrix4d w = Eigen::Matrix4d::Identity();
  w(0, 0) = w(2, 2) = 0.1;
  w(0, 2) = w(2, 0) = -0.1;
  const LocalProblem plain = eliminate(held_by_a_joint(w, {0.7, 0, -0.7, 0}, 4.9));
  EXPECT_EQ(dense(plain.W), Eigen::MatrixXd(Eigen::Vector4d(0, 1, 0, 1).asDiagonal()));
  EXPECT_EQ(plain.W.nnz(), 2U);
  // nor is one that was stored as 0
  LocalProblem problem = held_by_a_joint(Eigen::Matrix4d::Identity(), {0, 1, 0, 0}, 2);
  problem.W = converted(problem.W, Storage::triplet);
  problem.W.i.push_back(0);
  problem.W.p.push_back(2);
  problem.W.x.push_back(0);
  EXPECT_EQ(eliminate(problem).W.nnz(), 4U);
}

TEST(Elimination, what_a_joint_leaves_is_kept_even_if_it_is_little) {
  const Eigen::Matrix4d identity = Eigen::Matrix4d::Identity();
  for (const double left : {1e-6, 1e-12, -1e-12}) {
    const LocalProblem plain = eliminate(held_by_a_joint(identity, {1, 0, 0, 0}, 1 + left));
    EXPECT_NEAR(dense(plain.W)(0, 0) / left, 1, 1e-3);
  }
  // entries that are small beside others, but large beside what they are the difference of
  Eigen::Matrix4d w = identity;
  w(0, 2) = w(2, 0) = 1e-20;
  w(3, 3) = 1e-20;
  const LocalProblem plain = eliminate(held_by_a_joint(w, {0, 1, 0, 0}, 2));
  EXPECT_EQ(dense(plain.W)(0, 2), 1e-20);
  EXPECT_EQ(dense(plain.W)(2, 0), 1e-20);
  EXPECT_EQ(dense(plain.W)(3, 3), 1e-20);
  // and those that the joint alone makes
  const LocalProblem coupled = eliminate(held_by_a_joint(identity, {1, 0, 1, 0}, 4));
  EXPECT_EQ(dense(coupled.W)(0, 2), -0.25);
  EXPECT_EQ(dense(coupled.W)(2, 0), -0.25);
}

TEST(Elimination, redundant_joints_are_refused_and_indefinite_ones_are_not) {
  testing::RandomData random(20);
  auto problem = testing::random_local<LocalProblem>(random, 3, 2, 2);
  Eigen::Matrix2d r;
  r << 1, 1, 1, 1;
  problem.R = Matrix::from_eigen(Eigen::MatrixXd(r).sparseView());
  try {
    eliminate(problem);
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind, ErrorKind::unsuitable);
    EXPECT_NE(std::string(error.what()).find("R is singular"), std::string::npos);
  }
  r << 0, 1, 1, 0;
  problem.R = Matrix::from_eigen(Eigen::MatrixXd(r).sparseView());
  EXPECT_LT((eliminate(problem).q - (problem.q - dense(problem.V) * r * problem.s)).norm(), 1e-15);
}

TEST(Complete, fills_in_what_follows_from_the_reactions_and_nothing_else) {
  testing::RandomData random(21);
  for (const Index p : {0, 3}) {
    const auto local = testing::random_local<LocalProblem>(random, 3, 3, p, 0.1);
    Solution solution = testing::random_solution(random, local, false, false);
    Vector u = dense(local.W) * solution.r + local.q;
    if (p > 0) u += dense(local.V) * solution.l;
    EXPECT_LT((complete(local, solution).u - u).norm(), 1e-12);
    solution.u = Vector::Ones(9);
    EXPECT_EQ(complete(local, solution).u, solution.u);

    const auto global = testing::random_global<GlobalProblem>(random, 12, 3, 3, p, p > 0 ? 0.1 : 0);
    solution = testing::random_solution(random, global, false, false);
    Vector momentum = dense(global.H) * solution.r + global.f;
    if (p > 0) momentum += dense(global.G) * solution.l;
    const Vector v = dense(global.M).inverse() * momentum;
    const Solution whole = complete(global, solution);
    EXPECT_LT((whole.v - v).norm(), 1e-11);
    EXPECT_LT((whole.u - (dense(global.H).transpose() * v + global.w)).norm(), 1e-11);
    // u follows from the v that is there
    solution.v = Vector::Ones(12);
    const Solution from_v = complete(global, solution);
    EXPECT_EQ(from_v.v, solution.v);
    EXPECT_LT((from_v.u - (dense(global.H).transpose() * solution.v + global.w)).norm(), 1e-12);
    solution.u = Vector::Ones(9);
    EXPECT_EQ(complete(global, solution).u, solution.u);
  }
}

TEST(Complete, refuses_a_solution_of_another_size) {
  testing::RandomData random(22);
  const auto local = testing::random_local<LocalProblem>(random, 3, 2, 0);
  const auto global = testing::random_global<GlobalProblem>(random, 6, 3, 2, 0);
  Solution solution;
  solution.r = Vector::Zero(5);
  EXPECT_THROW(complete(local, solution), Error);
  EXPECT_THROW(complete(global, solution), Error);
}

}  // namespace
}  // namespace fclib
