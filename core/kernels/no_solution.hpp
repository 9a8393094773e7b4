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
// ||r|| < -y . q_N / e. A heavy body needs large reactions, so that a small e alone is none: e must
// be the rounding of terms that cancel, at each contact.
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
  constexpr double rounding = 1e-8;  // relative to the terms that cancel
  double gain = 0;
  double terms = 0;
  for (Index a = 0; a < problem.nc(); ++a) {
    if (!(y[a] >= 0)) return 0;
    gain -= y[a] * problem.q[D * a];
    terms += y[a] * std::abs(problem.q[D * a]);
  }
  if (!(gain > rounding * terms)) return 0;
  Vector image = Vector::Zero(problem.m());  // -W^T E y
  Vector size = Vector::Zero(problem.nc());
  problem.W.template for_each_block<D>([&](Index row, Index col, const auto& block) {
    image.template segment<D>(D * col) -= y[row] * block.row(0).transpose();
    size[col] += y[row] * block.row(0).norm();
  });
  double squared = 0;
  for (Index a = 0; a < problem.nc(); ++a) {
    const typename Cone::Vec part = image.template segment<D>(D * a);
    const double distance = dual_violation(Cone(problem.friction, a), part);
    if (!(distance <= rounding * size[a])) return 0;
    squared += distance * distance;
  }
  return squared > 0 ? gain / std::sqrt(squared) : std::numeric_limits<double>::infinity();
}

}  // namespace fclib
