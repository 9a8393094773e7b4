// Candidates for a proof that a problem has no solution.
//
// u^ is in K* exactly if u_N >= 0. So a solution needs r in K with (W r + q)_N >= 0 at every
// contact. By Farkas' lemma there is none if some y >= 0 has
//
//   -W^T E y in K*   and   y . q_N < 0,      E y: the vector whose normal parts are y.
//
// If W is symmetric and positive semidefinite, that means W E y = 0: normal reactions that move
// nothing, at contacts that would have to move. The rays along which the frictionless problem
// diverges are such y.
//
// Here such a y is only a candidate: in floating point -W^T E y is in K* up to a distance, and W
// may have been condensed, or joints may have been eliminated from it. proof/no_solution.hpp judges
// it on the problem as given.
#pragma once

#include "contact/cones.hpp"
#include "reduced/reduced_problem.hpp"

namespace fclib {

/// y would prove that no reactions with a norm below the result are a solution. 0 if it proves
/// nothing.
template <class Cone>
double no_solution_bound(const ReducedProblem& problem, const Vector& y);

#define FCLIB_DECLARE(Cone) \
  extern template double no_solution_bound<Cone>(const ReducedProblem&, const Vector&);
FCLIB_FOR_EACH_CONE(FCLIB_DECLARE)
#undef FCLIB_DECLARE

}  // namespace fclib
