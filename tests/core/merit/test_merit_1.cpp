#include "merit/merit_1.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "by_definition.hpp"
#include "contact/coulomb.hpp"
#include "contact/rolling.hpp"

namespace fclib {
namespace {

using testing::dense;
using testing::RandomData;

/// ||F|| / (1 + sqrt(||q||)), with F^a = r^a - P_K(r^a - u^^a).
template <class Cone, class P>
double natural_term(const P& problem, const Vector& u, const Vector& q, const Vector& r) {
  constexpr int d = Cone::dim;
  double squares = 0;
  for (Eigen::Index a = 0; a < problem.mu.size(); ++a) {
    const Cone cone(friction_of(problem), a);
    squares +=
        std::pow(testing::natural_norm<Cone>(cone, u.segment<d>(d * a), r.segment<d>(d * a), 1), 2);
  }
  return std::sqrt(squares) / (1 + std::sqrt(q.norm()));
}

double over_constant(const Vector& residual, const Vector& constant) {
  return residual.norm() / (1 + constant.norm());
}

template <class Cone, class P>
double of_local(const P& problem, const Solution& solution) {
  Vector u = dense(problem.W) * solution.r + problem.q;
  double bilateral = 0;
  if (is_mixed(problem)) {
    const Eigen::MatrixXd v = dense(problem.V);
    u += v * solution.l;
    bilateral = over_constant(
        v.transpose() * solution.r + dense(problem.R) * solution.l + problem.s, problem.s);
  }
  return natural_term<Cone>(problem, u, problem.q, solution.r) + bilateral;
}

template <class Cone, class P>
double of_global(const P& problem, const Solution& solution) {
  const Eigen::MatrixXd mass = dense(problem.M);
  const Eigen::MatrixXd h = dense(problem.H);
  Vector momentum = h * solution.r + problem.f;
  if (is_mixed(problem)) momentum += dense(problem.G) * solution.l;
  const Vector v = solution.v.size() > 0 ? solution.v : Vector(mass.inverse() * momentum);
  double others = over_constant(mass * v - momentum, problem.f);
  if (is_mixed(problem)) {
    others += over_constant(dense(problem.G).transpose() * v + problem.b, problem.b);
  }
  const Vector u = h.transpose() * v + problem.w;
  const Vector q = h.transpose() * mass.inverse() * problem.f + problem.w;
  return natural_term<Cone>(problem, u, q, solution.r) + others;
}

template <class Cone, class Local, class Global>
void expect_the_formula(RandomData& random) {
  for (const Index p : {0, 3}) {
    const auto local = testing::random_local<Local>(random, Cone::dim, 4, p, 0.1);
    const Solution of_it = testing::random_solution(random, local, false, false);
    EXPECT_NEAR(merit_1(local, of_it), of_local<Cone>(local, of_it), 1e-11);
    const auto global =
        testing::random_global<Global>(random, 14, Cone::dim, 4, p, p > 0 ? 0.1 : 0);
    for (const bool with_v : {false, true}) {
      const Solution solution = testing::random_solution(random, global, false, with_v);
      EXPECT_NEAR(merit_1(global, solution), of_global<Cone>(global, solution), 1e-9);
    }
  }
}

TEST(Merit1, is_what_its_formula_says_in_every_formulation) {
  RandomData random(35);
  expect_the_formula<Coulomb<2>, LocalProblem, GlobalProblem>(random);
  expect_the_formula<Coulomb<3>, LocalProblem, GlobalProblem>(random);
  expect_the_formula<Rolling<3>, LocalRollingProblem, GlobalRollingProblem>(random);
  expect_the_formula<Rolling<5>, LocalRollingProblem, GlobalRollingProblem>(random);
}

TEST(Merit1, of_one_contact_and_one_velocity_is_what_its_formula_says) {
  RandomData random(38);
  for (int k = 0; k < 10; ++k) {
    const auto local = testing::random_local<LocalRollingProblem>(random, 3, 1, 0);
    const Solution of_it = testing::random_solution(random, local, false, false);
    EXPECT_NEAR(merit_1(local, of_it), of_local<Rolling<3>>(local, of_it), 1e-13);
  }
  const auto global = testing::random_global<GlobalProblem>(random, 1, 2, 1, 0);
  const Solution solution = testing::random_solution(random, global, false, true);
  EXPECT_NEAR(merit_1(global, solution), of_global<Coulomb<2>>(global, solution), 1e-13);
}

TEST(Merit1, what_is_not_valid_is_an_error) {
  RandomData random(36);
  auto problem = testing::random_local<LocalProblem>(random, 3, 2, 0);
  Solution solution = testing::random_solution(random, problem, false, false);
  solution.r.conservativeResize(5);
  EXPECT_THROW(merit_1(problem, solution), Error);
  solution.r = Vector::Zero(6);
  problem.mu[0] = -1;
  EXPECT_THROW(merit_1(problem, solution), Error);
}

}  // namespace
}  // namespace fclib
