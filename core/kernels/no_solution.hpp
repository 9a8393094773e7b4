// A proof that a problem has no solution.
//
// u^ is in K* exactly where u_N >= 0, so that a solution needs r in K with (W r + q)_N >= 0 at
// every contact. By Farkas' lemma there is none where some y >= 0 has
//
//   -W^T E y in K*   and   y . q_N < 0,      E y: the vector whose normal parts are y.
//
// Where W is symmetric and positive semidefinite that means W E y = 0: normal reactions that move
// nothing, at contacts that would have to move. The rays along which the frictionless problem
// diverges are such y.
//
// In floating point -W^T E y is in K* up to a distance e, and the proof holds for all reactions
// with
// ||r|| < -y . q_N / e.
#pragma once

#include <cmath>
#include <limits>

#include "cones/cone.hpp"
#include "kernels/delassus.hpp"

namespace fclib {

/// The bound on ||r|| below which y proves that there is no solution; 0 where y proves nothing.
template <class Cone>
double no_solution_bound(const Delassus& problem, const Vector& y) {
  constexpr int D = Cone::dim;
  double gain = 0;
  Vector normal = Vector::Zero(problem.m());
  for (Index a = 0; a < problem.nc(); ++a) {
    if (!(y[a] >= 0)) return 0;
    normal[D * a] = y[a];
    gain -= y[a] * problem.q[D * a];
  }
  if (!(gain > 0)) return 0;
  Vector image;
  problem.W.multiply_transposed(normal, image);
  double squared = 0;
  for (Index a = 0; a < problem.nc(); ++a) {
    const typename Cone::Vec part = -image.template segment<D>(D * a);
    squared += std::pow(dual_violation(Cone(problem.friction, a), part), 2);
  }
  return squared > 0 ? gain / std::sqrt(squared) : std::numeric_limits<double>::infinity();
}

}  // namespace fclib
