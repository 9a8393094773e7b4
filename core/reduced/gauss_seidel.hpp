// A sweep of nonsmooth Gauss-Seidel over the contacts. Columns of W keep the velocities up to date.
// If the reaction of a contact does not change, it costs nothing.
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

  /// With omega, the problems have W_aa / omega in place of W_aa: projected over-relaxation.
  explicit GaussSeidel(const ReducedProblem& problem, double omega = 1);

  /// Solves the problem of contact a and keeps u up to date. Returns the change of r^a.
  Vec update(Index a, Vector& r, Vector& u, const LocalStep<Cone>& step);

  /// One sweep in the order of the contacts. Each is solved exactly, or by at most 10 projections.
  void sweep(Vector& r, Vector& u);

 private:
  const ReducedProblem& problem_;
  std::vector<Contact> contacts_;
};

#define FCLIB_DECLARE(Cone) extern template class GaussSeidel<Cone>;
FCLIB_FOR_EACH_CONE(FCLIB_DECLARE)
#undef FCLIB_DECLARE

}  // namespace fclib
