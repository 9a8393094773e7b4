// How far r is from the solution of the convex problem of a fixed shift.
#pragma once

#include <cmath>

#include "reduced/reduced_problem.hpp"

namespace fclib {

/// ||r - P(r - u - s e_N)|| over a product of sets (convex_sets.hpp), relative to the problem's
/// scale; u = W r + q.
template <class Set>
double convex_residual(const ReducedProblem& problem, const Set& set, const Vector& shift,
                       const Vector& r, const Vector& u) {
  constexpr int D = Set::Cone::dim;
  using Vec = typename Set::Cone::Vec;
  double sum = 0;
  for (Index a = 0; a < problem.nc(); ++a) {
    const Vec now = r.template segment<D>(D * a);
    Vec slope = u.template segment<D>(D * a);
    slope[0] += shift[a];
    sum += (now - set.project(a, now - slope, now)).squaredNorm();
  }
  return std::sqrt(sum) / problem.scale;
}

}  // namespace fclib
