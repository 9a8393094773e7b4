#include "reduced/no_solution.hpp"

#include <cmath>
#include <limits>

namespace fclib {

template <class Cone>
double no_solution_bound(const ReducedProblem& problem, const Vector& y) {
  constexpr int D = Cone::dim;
  constexpr double least_gain = 1e-8;  // relative to its terms
  constexpr double rounding = 1e-8;    // relative to the terms that cancel
  double gain = 0;
  double terms = 0;
  for (Index a = 0; a < problem.nc(); ++a) {
    if (!(y[a] >= 0)) return 0;
    gain -= y[a] * problem.q[D * a];
    terms += y[a] * std::abs(problem.q[D * a]);
  }
  if (!(gain > least_gain * terms)) return 0;
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

#define FCLIB_INSTANTIATE(Cone) \
  template double no_solution_bound<Cone>(const ReducedProblem&, const Vector&);
FCLIB_FOR_EACH_CONE(FCLIB_INSTANTIATE)
#undef FCLIB_INSTANTIATE

}  // namespace fclib
