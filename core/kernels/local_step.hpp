// What Gauss-Seidel does with the problem of one contact: the choice of local solvers.
#pragma once

#include <array>
#include <string_view>

#include "kernels/contact_problem.hpp"
#include "kernels/newton_contact.hpp"

namespace fclib {

enum class LocalSolver {
  exact,
  projection,
  diagonal,
  alart_curnier,
  fischer_burmeister,
  hybrid,
};
inline constexpr std::array<std::string_view, 6> local_solvers{
    "exact", "projection", "diagonal", "alart-curnier", "fischer-burmeister", "hybrid"};
inline constexpr std::string_view local_solvers_doc =
    "one-contact solver: exact (enumeration of statuses), projection (P_K with local iterations), "
    "diagonal (one projection, the block replaced by its diagonal), alart-curnier or "
    "fischer-burmeister (damped Newton), hybrid (alart-curnier, then exact); where one has no "
    "solution the projection steps in; rolling contacts have no exact solver, and "
    "alart-curnier for fischer-burmeister";

/// One projection with the block of a contact replaced by its diagonal, normal part first: each
/// part is projected with the velocities that the parts before it leave. False, with r untouched,
/// where the diagonal is not positive.
template <class Cone>
bool project_diagonal(const ContactMatrix<Cone::dim>& a, const Cone& cone,
                      const typename Cone::Vec& b, typename Cone::Vec& r) {
  constexpr int size = Cone::group_size;
  typename Cone::Vec next = r;
  typename Cone::Vec u = a * r + b;
  if (!(a(0, 0) > 0)) return false;
  next[0] = std::max(0.0, r[0] - u[0] / a(0, 0));
  u += a.col(0) * (next[0] - r[0]);
  for (int g = 0; g < Cone::groups; ++g) {
    const int at = 1 + g * size;
    // the norm of the block: a step of one over it never overshoots
    const double norm = a.template block<size, size>(at, at).cwiseAbs().rowwise().sum().maxCoeff();
    if (!(norm > 0)) return false;
    auto part = next.template segment<size>(at);
    part -= u.template segment<size>(at) / norm;
    const double radius = cone.coefficient(g) * next[0];
    const double length = part.norm();
    if (length > radius) part *= radius / length;
    u += a.template middleCols<size>(at) * (part - r.template segment<size>(at));
  }
  r = next;
  return true;
}

template <class Cone>
struct LocalStep {
  using Vec = typename Cone::Vec;

  LocalSolver solver = LocalSolver::exact;
  double accuracy = 1e-14;  ///< of the iterations, relative
  int iterations = 10;      ///< at most, of projections or of Newton

  /// Replaces next by a solution of the contact's problem, or an improvement. Never fails.
  void operator()(ContactProblem<Cone>& contact, const Vec& b, Vec& next) const {
    if (!solved(contact, b, next)) contact.projected.solve(b, accuracy, iterations, next);
  }

 private:
  bool solved(ContactProblem<Cone>& contact, const Vec& b, Vec& next) const {
    const auto& block = contact.projected.block();
    const Cone& cone = contact.projected.cone();
    switch (solver) {
      case LocalSolver::exact:
        return contact.solve_exact(b, next);
      case LocalSolver::projection:
        return false;
      case LocalSolver::diagonal:
        return project_diagonal(block, cone, b, next);
      case LocalSolver::fischer_burmeister:
        if constexpr (Cone::groups == 1) {
          return newton_fischer_burmeister(block, cone, b, accuracy, iterations, next);
        }
        [[fallthrough]];
      case LocalSolver::alart_curnier:
        return newton_alart_curnier(block, cone, b, accuracy, iterations, next);
      case LocalSolver::hybrid:
        return newton_alart_curnier(block, cone, b, accuracy, iterations, next) ||
               contact.solve_exact(b, next);
    }
    return false;
  }
};

}  // namespace fclib
