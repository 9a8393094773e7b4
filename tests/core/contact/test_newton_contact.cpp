#include "contact/exact_contact.hpp"
#include "contact/local_solver.hpp"
#include "contact/newton_contact.hpp"
#include "contact/rolling.hpp"

#include <gtest/gtest.h>

#include "random_data.hpp"

namespace fclib {
namespace {

template <int D>
ContactMatrix<D> random_block(testing::RandomData& random) {
  const ContactMatrix<D> root = random.dense(D, D);
  return root * root.transpose() + 0.2 * ContactMatrix<D>::Identity();
}

template <class Cone>
double error_of(const ContactMatrix<Cone::dim>& a, const typename Cone::Vec& b,
                const typename Cone::Vec& r, const Cone& cone) {
  return natural_map(cone, typename Cone::Vec(a * r + b), r).norm() / b.norm();
}

template <int D>
void expect_solutions(std::uint64_t seed) {
  testing::RandomData random(seed);
  int alart_curnier = 0;
  int fischer_burmeister = 0;
  for (int k = 0; k < 1000; ++k) {
    const Coulomb<D> cone(random.uniform(0.1, 0.9));
    const ContactMatrix<D> a = random_block<D>(random);
    const ContactVector<D> b = random.vector(D);
    ContactVector<D> r = ContactVector<D>::Zero();
    if (newton_alart_curnier(a, cone, b, 1e-14, 50, r)) {
      ++alart_curnier;
      EXPECT_LT(error_of(a, b, r, cone), 1e-10) << "sample " << k;
    } else {
      EXPECT_EQ(r.norm(), 0);
    }
    r.setZero();
    if (newton_fischer_burmeister(a, cone, b, 1e-14, 50, r)) {
      ++fischer_burmeister;
      EXPECT_LT(error_of(a, b, r, cone), 1e-9) << "sample " << k;
    } else {
      EXPECT_EQ(r.norm(), 0);
    }
  }
  EXPECT_GT(alart_curnier, 900);
  EXPECT_GT(fischer_burmeister, 900);
}

TEST(NewtonContact, a_solution_satisfies_the_law_in_the_plane) { expect_solutions<2>(21); }
TEST(NewtonContact, a_solution_satisfies_the_law_in_space) { expect_solutions<3>(22); }

TEST(NewtonContact, alart_curnier_solves_rolling_contacts) {
  testing::RandomData random(23);
  int solved = 0;
  for (int k = 0; k < 1000; ++k) {
    const Rolling<5> cone(random.uniform(0.1, 0.9), random.uniform(0.01, 0.3));
    const ContactMatrix<5> a = random_block<5>(random);
    const ContactVector<5> b = random.vector(5);
    ContactVector<5> r = ContactVector<5>::Zero();
    if (!newton_alart_curnier(a, cone, b, 1e-14, 50, r)) continue;
    ++solved;
    EXPECT_LT(error_of(a, b, r, cone), 1e-10) << "sample " << k;
  }
  EXPECT_GT(solved, 800);
}

/// A planar contact that slides and rolls at its limits: 1 of W_NN, `rolling` of W_RR.
void expect_rolling(double rolling) {
  const Rolling<3> cone(0.5, 0.05);
  ContactMatrix<3> a;
  a << 1, 0.4, 0, 0.4, 2, 0, 0, 0, rolling;
  const ContactVector<3> exact(1.25, -0.625, 0.0625);
  const ContactVector<3> u(0, 0.8, -1);
  const ContactVector<3> b = u - a * exact;
  ContactVector<3> r = ContactVector<3>::Zero();
  ASSERT_TRUE(newton_alart_curnier(a, cone, b, 1e-15, 20, r)) << rolling;
  EXPECT_LT((r - exact).norm(), 1e-14) << rolling;
}

// a rolling velocity over W_RR is much more than the reaction ever is
TEST(NewtonContact, fast_rolling_of_what_hardly_moves_hides_no_error) {
  for (const double rolling : {1.0, 1e-4, 1e-8, 1e-12, 1e-16, 1e-100}) expect_rolling(rolling);
}

TEST(NewtonContact, a_group_that_no_reaction_moves_is_solved) { expect_rolling(0); }

// a point mass: it has no rolling at all
TEST(NewtonContact, a_group_without_velocity_keeps_its_reaction) {
  const Rolling<3> cone(0.5, 0.05);
  ContactMatrix<3> a;
  a << 1, 0.4, 0, 0.4, 2, 0, 0, 0, 0;
  ContactVector<3> r(1, 0, 0.01);
  ASSERT_TRUE(newton_alart_curnier(a, cone, {-1, 0.1, 0}, 1e-15, 20, r));
  EXPECT_EQ(r[2], 0.01);
  EXPECT_LT((a * r + ContactVector<3>(-1, 0.1, 0)).norm(), 1e-15);
}

TEST(NewtonContact, reactions_whose_squares_overflow_are_refused) {
  const Rolling<3> cone(0.5, 0.05);
  const ContactMatrix<3> a = 1e-200 * ContactMatrix<3>::Identity();
  ContactVector<3> r = ContactVector<3>::Zero();
  EXPECT_FALSE(newton_alart_curnier(a, cone, {-1, 0, 0}, 1e-15, 20, r));
  EXPECT_EQ(r, (ContactVector<3>::Zero()));
}

TEST(NewtonContact, a_block_of_zeros_is_refused) {
  const ContactMatrix<3> zero = ContactMatrix<3>::Zero();
  const Coulomb<3> cone(0.5);
  ContactVector<3> r(1, 0, 0);
  EXPECT_FALSE(newton_alart_curnier(zero, cone, {-1, 0, 0}, 1e-14, 50, r));
  EXPECT_FALSE(newton_fischer_burmeister(zero, cone, {-1, 0, 0}, 1e-14, 50, r));
  EXPECT_FALSE(project_diagonal(zero, cone, {-1, 0, 0}, r));
  EXPECT_EQ(r, (ContactVector<3>(1, 0, 0)));
}

TEST(LocalStep, one_diagonal_projection_is_exact_for_a_multiple_of_the_identity) {
  testing::RandomData random(24);
  for (int k = 0; k < 200; ++k) {
    const Coulomb<3> cone(random.uniform(0, 1));
    const ContactMatrix<3> a = random.uniform(0.1, 10) * ContactMatrix<3>::Identity();
    const ContactVector<3> b = random.vector(3);
    ContactVector<3> r = random.vector(3);
    ASSERT_TRUE(project_diagonal(a, cone, b, r));
    EXPECT_LT(error_of(a, b, r, cone), 1e-13) << "sample " << k;
  }
}

}  // namespace
}  // namespace fclib
