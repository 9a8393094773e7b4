// The problem of one contact for any cone. If the cone has an exact method, that solves it. With
// spin it is Newton's method, on the status that the contact has. If these fail, projections do it,
// which never fail.
#pragma once

#include "contact/cones.hpp"
#include "contact/exact_contact.hpp"
#include "contact/newton_contact.hpp"
#include "contact/projected_contact.hpp"

namespace fclib {

template <class Cone>
struct ContactProblem {
  using Vec = typename Cone::Vec;

  ContactProblem(const ContactMatrix<Cone::dim>& block, const Cone& cone)
      : projected(block, cone) {}

  bool solve_exact(const Vec&, Vec&) { return false; }

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

/// Open and stick in closed form, and Newton's method for the rest.
template <class Cone>
struct NewtonContactProblem {
  using Vec = typename Cone::Vec;

  NewtonContactProblem(const ContactMatrix<Cone::dim>& block, const Cone& cone)
      : projected(block, cone) {}

  bool solve_exact(const Vec& b, Vec& r) {
    constexpr double accuracy = 1e-15;
    constexpr int steps = 20;
    return newton_alart_curnier(projected.block(), projected.cone(), b, accuracy, steps, r);
  }

  ProjectedContact<Cone> projected;
};

template <>
struct ContactProblem<Coulomb<4>> : NewtonContactProblem<Coulomb<4>> {
  using NewtonContactProblem::NewtonContactProblem;
};
template <int D>
struct ContactProblem<Spin<D>> : NewtonContactProblem<Spin<D>> {
  using NewtonContactProblem<Spin<D>>::NewtonContactProblem;
};

}  // namespace fclib
