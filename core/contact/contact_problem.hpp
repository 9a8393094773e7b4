// The problem of one contact for any cone. If the cone has an exact method, that solves it; else
// projections do, which never fail.
#pragma once

#include "contact/coulomb.hpp"
#include "contact/exact_contact.hpp"
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
struct ContactProblem<Coulomb<D>> {
  ContactProblem(const ContactMatrix<D>& block, const Coulomb<D>& cone)
      : exact(block, cone.mu()), projected(block, cone) {}

  bool solve_exact(const ContactVector<D>& b, ContactVector<D>& r) { return exact.solve(b, r); }

  ExactContact<D> exact;
  ProjectedContact<Coulomb<D>> projected;
};

}  // namespace fclib
