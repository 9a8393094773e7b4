#include "contact/coulomb.hpp"
#include "contact/exact_contact.hpp"
#include "contact/projected_contact.hpp"

#include <gtest/gtest.h>

#include "random_data.hpp"

namespace fclib {
namespace {

template <int D>
double error_of(const ContactMatrix<D>& a, const ContactVector<D>& b, const ContactVector<D>& r,
                double mu) {
  const ContactVector<D> u = a * r + b;
  return natural_map(Coulomb<D>(mu), u, r).norm() / b.norm();
}

template <int D>
ContactMatrix<D> random_block(testing::RandomData& random) {
  const ContactMatrix<D> root = random.dense(D, D);
  return root * root.transpose() + 0.05 * ContactMatrix<D>::Identity();
}

template <int D>
void expect_exact(testing::RandomData& random) {
  int solved = 0;
  for (int k = 0; k < 3000; ++k) {
    const double mu = random.uniform(0, 1);
    const ContactMatrix<D> a = random_block<D>(random);
    ExactContact<D> contact(a, mu);
    const ContactVector<D> b = random.vector(D);
    ContactVector<D> r = random.vector(D);
    if (!contact.solve(b, r)) continue;
    ++solved;
    EXPECT_LT(error_of<D>(a, b, r, mu), 1e-12) << "sample " << k;
  }
  EXPECT_GT(solved, 2950);
}

TEST(OneContact, the_exact_solution_satisfies_the_law) {
  testing::RandomData random(9);
  expect_exact<2>(random);
  expect_exact<3>(random);
}

TEST(OneContact, the_projection_finds_the_same_solution) {
  testing::RandomData random(10);
  for (int k = 0; k < 200; ++k) {
    const double mu = random.uniform(0, 0.6);
    const ContactMatrix<3> a = random_block<3>(random);
    ExactContact<3> contact(a, mu);
    ProjectedContact<Coulomb<3>> projection(a, Coulomb<3>(mu));
    const ContactVector<3> b = random.vector(3);
    ContactVector<3> exact = ContactVector<3>::Zero();
    ContactVector<3> projected = ContactVector<3>::Zero();
    if (!contact.solve(b, exact)) continue;
    projection.solve(b, 1e-14, 20000, projected);
    EXPECT_LT(error_of<3>(a, b, projected, mu), 1e-8) << "sample " << k;
  }
}

TEST(OneContact, a_block_without_a_normal_part_is_refused) {
  ExactContact<3> contact(ContactMatrix<3>::Zero(), 0.5);
  ContactVector<3> r(1, 0, 0);
  EXPECT_FALSE(contact.solve({-1, 0, 0}, r));
  EXPECT_EQ(r, (ContactVector<3>(1, 0, 0)));
  EXPECT_TRUE(contact.solve({1, 2, 3}, r));
  EXPECT_EQ(r.norm(), 0);
}

TEST(OneContact, a_frictionless_contact_has_no_tangential_reaction) {
  ExactContact<3> contact(ContactMatrix<3>::Identity(), 0.0);
  ContactVector<3> r = ContactVector<3>::Zero();
  ASSERT_TRUE(contact.solve({-2, 1, 1}, r));
  EXPECT_EQ(r, (ContactVector<3>(2, 0, 0)));
}

}  // namespace
}  // namespace fclib
