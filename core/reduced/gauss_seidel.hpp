// A sweep of nonsmooth Gauss-Seidel over the contacts. The velocities are kept up to date by
// columns of W, so that a contact whose reaction does not change costs nothing.
#pragma once

#include <vector>

#include "contact/local_solver.hpp"
#include "reduced/reduced_problem.hpp"

namespace fclib {

template <class Cone>
class GaussSeidel {
 public:
  static constexpr int D = Cone::dim;
  using Vec = typename Cone::Vec;
  using Contact = ContactProblem<Cone>;

  /// With omega, the contacts' problems are those of W_aa / omega: projected over-relaxation.
  explicit GaussSeidel(const ReducedProblem& problem, double omega = 1);

  /// Solves the problem of contact a and keeps u up to date. The change of r^a.
  Vec update(Index a, Vector& r, Vector& u, const LocalStep<Cone>& step);

  /// One sweep in the order of the contacts, each solved exactly or by 10 projections at most.
  void sweep(Vector& r, Vector& u);

 private:
  const ReducedProblem& problem_;
  std::vector<Contact> contacts_;
};

#define FCLIB_DECLARE(Cone) extern template class GaussSeidel<Cone>;
FCLIB_FOR_EACH_CONE(FCLIB_DECLARE)
#undef FCLIB_DECLARE

}  // namespace fclib
