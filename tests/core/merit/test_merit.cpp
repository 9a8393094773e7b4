#include "merit/merit.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "by_definition.hpp"
#include "contact/coulomb.hpp"
#include "contact/rolling.hpp"
#include "convert/condense.hpp"
#include "linalg/factorization.hpp"

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

using testing::RandomData;

/// Agreement with the formulas, each term of each equation being the largest in turn.
template <class Cone, class P>
void expect_the_formulas(const P& problem, const Solution& solution) {
  const Merit found = merit(problem, solution);
  const ContactMerits found_each = contact_merits(problem, solution);
  ContactMerits each;
  const Merit expected = testing::by_definition<Cone>(problem, solution, each);
  for_each_field<Merit>([&]<class Member>(const Field<Merit, Member>& field) {
    const auto value = static_cast<double>(expected.*field.member);
    EXPECT_NEAR(static_cast<double>(found.*field.member), value, 1e-9 * (1e-3 + value))
        << field.name;
  });
  const double size = each.u.norm();
  EXPECT_EQ(found_each.status, each.status);
  EXPECT_LT((found_each.u - each.u).norm(), 1e-10 * size);
  EXPECT_LT((found_each.natural - each.natural).norm(), 1e-10 * size);
  EXPECT_LT((found_each.cone - each.cone).norm(), 1e-10 * size);
  EXPECT_LT((found_each.dual_cone - each.dual_cone).norm(), 1e-10 * size);
}

constexpr double loud = 1e3;

template <class Cone, class P>
void expect_the_formulas_of_local_problems(RandomData& random) {
  for (const Index p : {0, 3}) {
    for (const bool with_u : {false, true}) {
      const P problem = testing::random_local<P>(random, Cone::dim, 5, p, 0.1);
      const Solution solution = testing::random_solution(random, problem, with_u, false);
      expect_the_formulas<Cone>(problem, solution);
      for (int term = 0; term < 5; ++term) {
        P other = problem;
        Solution given = solution;
        if (term == 0) given.r *= loud;
        if (term == 1) given.l *= loud;
        if (term == 2) other.q *= loud;
        if (term == 3) given.u *= loud;
        if (term == 4) other.s *= loud;
        expect_the_formulas<Cone>(other, given);
      }
    }
  }
}

template <class Cone, class P>
void expect_the_formulas_of_global_problems(RandomData& random) {
  for (const Index p : {0, 3}) {
    for (const int members : {0, 1, 2, 3}) {
      const P problem = testing::random_global<P>(random, 15, Cone::dim, 4, p, p > 0 ? 0.1 : 0);
      const Solution solution =
          testing::random_solution(random, problem, members % 2 == 1, members >= 2);
      expect_the_formulas<Cone>(problem, solution);
      for (int term = 0; term < 7; ++term) {
        P other = problem;
        Solution given = solution;
        if (term == 0) given.r *= loud;
        if (term == 1) given.l *= loud;
        if (term == 2) other.f *= loud;
        if (term == 3) other.w *= loud;
        if (term == 4) given.u *= loud;
        if (term == 5) given.v *= loud;
        if (term == 6) other.b *= loud;
        expect_the_formulas<Cone>(other, given);
      }
    }
  }
}

TEST(Merit, every_figure_of_a_local_problem_is_what_its_formula_says) {
  RandomData random(31);
  expect_the_formulas_of_local_problems<Coulomb<2>, LocalProblem>(random);
  expect_the_formulas_of_local_problems<Coulomb<3>, LocalProblem>(random);
  expect_the_formulas_of_local_problems<Rolling<3>, LocalRollingProblem>(random);
  expect_the_formulas_of_local_problems<Rolling<5>, LocalRollingProblem>(random);
}

TEST(Merit, every_figure_of_a_global_problem_is_what_its_formula_says) {
  RandomData random(32);
  expect_the_formulas_of_global_problems<Coulomb<2>, GlobalProblem>(random);
  expect_the_formulas_of_global_problems<Coulomb<3>, GlobalProblem>(random);
  expect_the_formulas_of_global_problems<Rolling<3>, GlobalRollingProblem>(random);
  expect_the_formulas_of_global_problems<Rolling<5>, GlobalRollingProblem>(random);
}

TEST(Merit, one_contact_and_one_velocity_are_judged_like_many) {
  RandomData random(37);
  const auto rolling = testing::random_local<LocalRollingProblem>(random, 3, 1, 0);
  expect_the_formulas<Rolling<3>>(rolling, testing::random_solution(random, rolling, true, false));
  const auto global = testing::random_global<GlobalProblem>(random, 1, 2, 1, 0);
  expect_the_formulas<Coulomb<2>>(global, testing::random_solution(random, global, true, true));
}

TEST(Merit, what_is_known_of_the_problem_changes_nothing) {
  RandomData random(33);
  const auto plain = testing::random_global<GlobalProblem>(random, 12, 3, 3, 2);
  const auto rolling = testing::random_global<GlobalRollingProblem>(random, 12, 5, 2, 2);
  const auto expect_same = [&](const auto& problem) {
    Solution solution = testing::random_solution(random, problem, true, false);
    const Merit own = merit(problem, solution);
    const ContactMerits each = contact_merits(problem, solution);
    const Factorization mass(to_eigen(problem.M), "M");
    const LocalProblem condensed = condense(static_cast<const GlobalProblem&>(problem));
    for (const LocalProblem* known : {static_cast<const LocalProblem*>(nullptr), &condensed}) {
      const auto given = [&](MeritKind kind) {
        return judge_and_complete(problem, friction_of(problem), mass,
                                  own_sizes(problem, mass, known), kind, solution);
      };
      EXPECT_NEAR(own.error, given(MeritKind::both), 1e-12 * own.error);
      EXPECT_EQ(own.error_by(MeritKind::natural), given(MeritKind::natural));
      EXPECT_EQ(each.u, solution.u);
    }
    // it is this one that is used: with twice the mass the solution is another one
    const Factorization heavy(SparseColumns(2 * to_eigen(problem.M)), "M");
    const double other = judge_and_complete(problem, friction_of(problem), heavy,
                                            own_sizes(problem, heavy), MeritKind::both, solution);
    EXPECT_NE(other, own.error);
  };
  expect_same(plain);
  expect_same(rolling);
}

/// One contact in the plane, without friction.
LocalProblem one_contact(const Eigen::Matrix2d& w, const Eigen::Vector2d& q) {
  LocalProblem problem;
  problem.spacedim = 2;
  problem.W = Matrix::from_eigen(w.sparseView());
  problem.q = q;
  problem.mu = Vector::Zero(1);
  return problem;
}

TEST(Merit, sums_are_made_in_extended_precision) {
  // (1 + e)^2 - (1 + 2 e) = e^2, of which double precision keeps nothing
  const double e = 0x1p-30;
  const LocalProblem problem =
      one_contact((1 + e) * Eigen::Matrix2d::Identity(), {-(1 + 2 * e), 0});
  const Solution solution{.v = {}, .u = {}, .r = Eigen::Vector2d(1 + e, 0), .l = {}};
  EXPECT_NEAR(merit(problem, solution).natural, 0x1p-60, 1e-3 * 0x1p-60);
}

TEST(Merit, what_a_self_stress_rounds_to_is_a_mistake) {
  // W r = 0 although r is large: reactions of 0 do the same, and round to nothing
  Eigen::Matrix2d w;
  w << 1, -1, -1, 1;
  const LocalProblem problem = one_contact(w, {0, 0});
  for (const double size : {1e6, 1e14}) {
    Solution solution{
        .v = {}, .u = Eigen::Vector2d(1e-9, 0), .r = Eigen::Vector2d(size, size), .l = {}};
    EXPECT_NEAR(merit(problem, solution).kinematics, 1e-9, 1e-15);
    solution.u[0] = 1e-3;
    EXPECT_NEAR(merit(problem, solution).kinematics, 1e-3, 1e-15);
  }
}

/// A light and a heavy body, free but for a contact of the heavy one.
GlobalProblem light_beside_heavy(double ratio) {
  GlobalProblem problem;
  problem.spacedim = 2;
  const Eigen::Vector4d masses(1, 1, ratio, ratio);
  problem.M = Matrix::from_eigen(Eigen::MatrixXd(masses.asDiagonal()).sparseView());
  Eigen::MatrixXd h = Eigen::MatrixXd::Zero(4, 2);
  h(2, 0) = h(3, 1) = 1;
  problem.H = Matrix::from_eigen(h.sparseView());
  problem.f = Eigen::Vector4d(-10, 0, -10 * ratio, 0);
  problem.w = Vector::Zero(2);
  problem.mu = Vector::Constant(1, 0.5);
  return problem;
}

TEST(Merit, a_heavy_neighbour_hides_no_velocity) {
  for (const double ratio : {1.0, 1e6, 1e12}) {
    const GlobalProblem problem = light_beside_heavy(ratio);
    Solution solution{.v = Eigen::Vector4d(-10, 0, 0, 0),
                      .u = Vector::Zero(2),
                      .r = Eigen::Vector2d(10 * ratio, 0),
                      .l = {}};
    EXPECT_EQ(merit(problem, solution).error, 0);
    solution.v[0] = 40;
    const Merit result = merit(problem, solution);
    EXPECT_NEAR(result.dynamics, 50.0 / 40, 1e-9);
    EXPECT_GE(result.error, result.dynamics);
    const ContactMerits each = contact_merits(problem, solution);
    ASSERT_EQ(each.mismatches.size(), 2U);
    EXPECT_EQ(each.mismatches[0].part, "v");
    EXPECT_EQ(each.mismatches[0].index, 0);
    EXPECT_EQ(each.mismatches[0].stored, 40);
    EXPECT_NEAR(each.mismatches[0].difference, 50, 1e-9);
  }
}

/// Three masses in a row, joined along it, each on a contact; the first and the last are pulled
/// apart.
GlobalProblem pulled_row() {
  GlobalProblem problem;
  problem.spacedim = 2;
  problem.M = Matrix::from_eigen(SparseColumns(Eigen::MatrixXd::Identity(6, 6).sparseView()));
  Eigen::MatrixXd h = Eigen::MatrixXd::Zero(6, 6);
  Eigen::MatrixXd g = Eigen::MatrixXd::Zero(6, 2);
  for (Index body = 0; body < 3; ++body) {
    h(2 * body + 1, 2 * body) = 1;  // N upwards
    h(2 * body, 2 * body + 1) = 1;
  }
  for (Index joint = 0; joint < 2; ++joint) {
    g(2 * joint, joint) = -1;
    g(2 * joint + 2, joint) = 1;
  }
  problem.H = Matrix::from_eigen(h.sparseView());
  problem.G = Matrix::from_eigen(g.sparseView());
  problem.f = Vector{{-1, -1, 0, 0, 1, -1}};
  problem.b = Vector::Zero(2);
  problem.w = Vector::Zero(6);
  problem.mu = Vector::Constant(3, 0.5);
  return problem;
}

TEST(Merit, rounding_where_neighbours_hold_a_body_is_no_mistake) {
  // the middle has neither velocity nor force of its own: the tension of the joints passes it
  const GlobalProblem problem = pulled_row();
  Solution solution{.v = Vector::Zero(6),
                    .u = Vector::Zero(6),
                    .r = Vector{{1, 0, 0, 0, 1, 0}},
                    .l = Vector{{-1, -1}}};
  EXPECT_EQ(merit(problem, solution).error, 0);
  for (const double error : {1e-13, 1e-3}) {
    Solution moved = solution;
    moved.v[2] = moved.u[3] = error;
    EXPECT_GT(merit(problem, moved).dynamics, 0.1 * error);
    EXPECT_LT(merit(problem, moved).error, 10 * error);
    EXPECT_GT(merit(problem, moved).bilateral, 0.1 * error);
  }
}

TEST(Merit, an_error_is_not_relative_to_less_than_the_rounding_of_q) {
  // in free flight: the base alone moves, what a joint at its limit feels of it is rounding
  GlobalProblem problem = light_beside_heavy(1);
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m(0, 2) = m(2, 0) = 0.25;
  problem.M = Matrix::from_eigen(m.sparseView());
  problem.f = m * Eigen::Vector4d(-10, 3, 0, 0);
  problem.f[2] -= 1e-15;
  const Solution nothing{.v = {}, .u = {}, .r = Vector::Zero(2), .l = {}};
  EXPECT_EQ(merit(problem, nothing).error, 0);
  problem.f[2] -= 1e-9;  // more than rounding, and no reaction against it
  EXPECT_GT(merit(problem, nothing).natural, 0.5);
}

TEST(Merit, a_contact_whose_block_is_zero_is_scaled_by_one) {
  const LocalProblem problem = one_contact(Eigen::Matrix2d::Zero(), {-2, 1});
  const Solution solution{.v = {}, .u = {}, .r = Eigen::Vector2d::Zero(), .l = {}};
  // F = -P_K(2, -1) = (-2, 0): nothing holds the contact back
  EXPECT_NEAR(merit(problem, solution).natural, 2 / std::sqrt(5), 1e-15);
  EXPECT_NEAR(merit(problem, solution).scaled_natural, 2 / std::sqrt(5), 1e-15);
  // F = r where a contact that opens bears load
  const LocalProblem opens = one_contact(Eigen::Matrix2d::Zero(), {3, 1});
  const Solution loaded{.v = {}, .u = {}, .r = Eigen::Vector2d(1, 0), .l = {}};
  EXPECT_NEAR(merit(opens, loaded).scaled_natural, 1 / std::sqrt(10), 1e-15);
}

TEST(Merit, mass_ratios_of_1e12_do_not_hide_a_mistake_from_the_scaled_error) {
  // a body of 1e12 kg and one of 1 kg, each held by its contact
  LocalProblem problem;
  problem.spacedim = 2;
  const Eigen::Vector4d inverse_masses(1e-12, 1e-12, 1, 1);
  problem.W = Matrix::from_eigen(Eigen::MatrixXd(inverse_masses.asDiagonal()).sparseView());
  problem.q = Eigen::Vector4d(-1, 0, -1, 0);
  problem.mu = Vector::Constant(2, 0.5);
  Solution solution{.v = {}, .u = {}, .r = Eigen::Vector4d(1e12, 0, 1, 0), .l = {}};
  EXPECT_LT(merit(problem, solution).error, 1e-15);
  EXPECT_LT(merit(problem, solution).scaled_natural, 1e-15);
  EXPECT_EQ(merit(problem, solution).stick, 2);
  solution.r[0] = 0.9e12;  // the heavy body sinks at 0.1 m/s
  EXPECT_NEAR(merit(problem, solution).natural, 0.1 / std::sqrt(2), 1e-12);
  EXPECT_NEAR(merit(problem, solution).scaled_natural, 0.1, 1e-12);
}

TEST(Merit, huge_and_absent_friction_have_exact_solutions) {
  for (const double mu : {0.0, 1e7}) {
    LocalProblem problem = one_contact(Eigen::Matrix2d::Identity(), {-1, 3});
    problem.mu = Vector::Constant(1, mu);
    // it slides freely, or it sticks
    const Solution solution{.v = {}, .u = {}, .r = Eigen::Vector2d(1, mu > 0 ? -3 : 0), .l = {}};
    const Merit result = merit(problem, solution);
    EXPECT_LT(result.error, 1e-15);
    EXPECT_LT(result.scaled_natural, 1e-15);
    EXPECT_LT(result.dual_cone, 1e-15);
    EXPECT_EQ(result.slide, mu > 0 ? 0 : 1);
    EXPECT_EQ(result.stick, mu > 0 ? 1 : 0);
  }
}

TEST(Merit, a_problem_without_contacts_is_judged_by_its_equations) {
  RandomData random(34);
  const auto problem = testing::random_global<GlobalProblem>(random, 6, 3, 0, 2);
  Solution solution = testing::random_solution(random, problem, false, true);
  const Merit result = merit(problem, solution);
  EXPECT_EQ(result.natural, 0);
  EXPECT_EQ(result.scaled_natural, 0);
  EXPECT_EQ(result.error, std::max(result.dynamics, result.bilateral));
  EXPECT_GT(result.dynamics, 0.01);
  EXPECT_GT(result.bilateral, 0.01);
}

TEST(Merit, an_invalid_problem_is_an_error) {
  LocalProblem problem = three_statuses();
  problem.mu[1] = -0.5;
  EXPECT_THROW(merit(problem, three_reactions()), Error);
  EXPECT_THROW(contact_merits(problem, three_reactions()), Error);
}

}  // namespace
}  // namespace fclib
