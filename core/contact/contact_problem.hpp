// The problem of one contact for any cone. Coulomb's cone has an exact method. With rolling or spin
// friction it is Newton's method, from the reaction that the contact has. If these fail,
// projections do it, which never fail.
#pragma once

#include "contact/cones.hpp"
#include "contact/exact_contact.hpp"
#include "contact/newton_contact.hpp"
#include "contact/projected_contact.hpp"

namespace fclib {

/// Open in closed form, and Newton's method for the rest.
template <class Cone>
struct ContactProblem {
  using Vec = typename Cone::Vec;

  ContactProblem(const ContactMatrix<Cone::dim>& block, const Cone& cone)
      : projected(block, cone) {}

  bool solve_exact(const Vec& b, Vec& r) {
    constexpr double accuracy = 1e-15;
    constexpr int steps = 20;
    return newton_alart_curnier(projected.block(), projected.cone(), b, accuracy, steps, r);
  }

  ProjectedContact<Cone> projected;
};

template <int D>
  requires(D <= 3)
struct ContactProblem<Coulomb<D>> {
  ContactProblem(const ContactMatrix<D>& block, const Coulomb<D>& cone)
      : exact(block, cone.mu()), projected(block, cone) {}

  bool solve_exact(const ContactVector<D>& b, ContactVector<D>& r) { return exact.solve(b, r); }

  ExactContact<D> exact;
  ProjectedContact<Coulomb<D>> projected;
};

}  // namespace fclib
