// How far r is from the solution of the convex problem with a fixed shift.
#pragma once

#include "contact/cones.hpp"
#include "reduced/convex_sets.hpp"

namespace fclib {

/// ||r - P(r - u - s e_N)|| over a product of sets (convex_sets.hpp), relative to the problem's
/// scale; u = W r + q.
template <class Set>
double convex_residual(const ReducedProblem& problem, const Set& set, const Vector& shift,
                       const Vector& r, const Vector& u);

#define FCLIB_DECLARE_SET(Set)                                                                  \
  extern template double convex_residual<Set>(const ReducedProblem&, const Set&, const Vector&, \
                                              const Vector&, const Vector&);
#define FCLIB_DECLARE(Cone) FCLIB_DECLARE_SET(Cones<Cone>) FCLIB_DECLARE_SET(Cylinders<Cone>)
FCLIB_FOR_EACH_CONE(FCLIB_DECLARE)
#undef FCLIB_DECLARE
#undef FCLIB_DECLARE_SET

}  // namespace fclib
