// How Gauss-Seidel solves the problem of one contact: the choice of local solvers.
#pragma once

#include <array>
#include <string_view>

#include "contact/cones.hpp"
#include "contact/contact_problem.hpp"

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
    "The solver of one contact. exact: by its statuses. projection: P_K with local iterations. "
    "diagonal: one projection, with the diagonal in the place of the block. alart-curnier and "
    "fischer-burmeister: damped Newton. hybrid: alart-curnier, then exact. If one finds no "
    "solution, the projection does. Contacts with rolling or spin friction have alart-curnier in "
    "the place of exact and of fischer-burmeister.";

/// One projection in which the diagonal stands for the block of a contact. The normal part comes
/// first. Each part is projected with the velocities that the parts before it leave. Returns false,
/// and leaves r untouched, if the diagonal is not positive.
template <class Cone>
bool project_diagonal(const ContactMatrix<Cone::dim>& a, const Cone& cone,
                      const typename Cone::Vec& b, typename Cone::Vec& r);

/// The step of a sweep on one contact.
template <class Cone>
struct LocalStep {
  using Vec = typename Cone::Vec;

  LocalSolver solver = LocalSolver::exact;
  double accuracy = 1e-14;  ///< relative accuracy of the iterations
  int iterations = 10;      ///< largest number of projections or Newton steps
  double relaxation = 1;    ///< omega in r <- P_K(omega r_local + (1 - omega) r)

  /// `next` is r^a on entry. It is replaced by a solution of the contact's problem, or by a better
  /// point. Never fails.
  void operator()(ContactProblem<Cone>& contact, const Vec& b, Vec& next) const {
    const bool exact = solver == LocalSolver::exact && relaxation == 1;
    if (!exact || !contact.solve_exact(b, next)) other(contact, b, next);
  }

 private:
  void other(ContactProblem<Cone>& contact, const Vec& b, Vec& next) const;
  bool solved(ContactProblem<Cone>& contact, const Vec& b, Vec& next) const;
};

#define FCLIB_DECLARE(Cone)                                                                 \
  extern template bool project_diagonal<Cone>(const ContactMatrix<Cone::dim>&, const Cone&, \
                                              const Cone::Vec&, Cone::Vec&);                \
  extern template struct LocalStep<Cone>;
FCLIB_FOR_EACH_CONE(FCLIB_DECLARE)
#undef FCLIB_DECLARE

}  // namespace fclib
