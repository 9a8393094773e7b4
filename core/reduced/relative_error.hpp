// The error by which solvers measure themselves: the natural map on the reduced form.
#pragma once

#include "contact/cones.hpp"
#include "reduced/reduced_problem.hpp"

namespace fclib {

/// ||r - P_K(r - u^)||^2 summed over the contacts; u and r of length dim nc.
template <class Cone>
double natural_map_squared(const Vector& u, const Vector& r, const Friction& friction);

/// ||r - P_K(r - u^)|| over the scale of the problem, for r and u = W r + q. With rho, the largest
/// of that and of both sums of r - P_K(r - rho u^) (contact/natural_squares.hpp) over their scales.
template <class Cone>
double relative_error(const ReducedProblem& problem, const Vector& u, const Vector& r);

#define FCLIB_DECLARE(Cone)                                                                        \
  extern template double natural_map_squared<Cone>(const Vector&, const Vector&, const Friction&); \
  extern template double relative_error<Cone>(const ReducedProblem&, const Vector&, const Vector&);
FCLIB_FOR_EACH_CONE(FCLIB_DECLARE)
#undef FCLIB_DECLARE

}  // namespace fclib
