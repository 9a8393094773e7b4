#include "convert/eliminate.hpp"

#include <cmath>
#include <limits>

namespace fclib {

Elimination::Elimination(const LocalProblem& problem)
    : problem_(problem), bilateral_(to_eigen(problem.R), "R", false) {
  plain_.spacedim = problem.spacedim;
  plain_.mu = problem.mu;
  plain_.info = problem.info;
  const SparseColumns v = to_eigen(problem.V);
  const SparseColumns coupling = bilateral_.solve(SparseColumns(v.transpose()));
  // what the bilateral constraints hold entirely is zero, not the rounding of a difference
  const SparseColumns full = to_eigen(problem.W);
  const SparseColumns held = v * coupling;
  SparseColumns w = full - held;
  const SparseColumns size = SparseColumns(full.cwiseAbs()) + SparseColumns(held.cwiseAbs());
  constexpr double rounding = 16 * std::numeric_limits<double>::epsilon();
  w.prune([&](Eigen::Index row, Eigen::Index col, double value) {
    return std::abs(value) > rounding * size.coeff(row, col);
  });
  plain_.W = converted(Matrix::from_eigen(w), Storage::csr);
  plain_.q = problem.q - v * bilateral_.solve(problem.s);
}

Solution Elimination::expand(const Solution& plain) const {
  Solution result = plain;
  Vector velocity = problem_.s;
  multiply_transposed_add(problem_.V, plain.r, velocity);
  result.l = -bilateral_.solve(velocity);
  result.u = problem_.q;
  multiply_add(problem_.W, plain.r, result.u);
  multiply_add(problem_.V, result.l, result.u);
  return result;
}

LocalProblem eliminate(const LocalProblem& problem) {
  return is_mixed(problem) ? Elimination(problem).plain() : problem;
}

LocalRollingProblem eliminate(const LocalRollingProblem& problem) {
  return {eliminate(static_cast<const LocalProblem&>(problem)), problem.mu_r};
}

}  // namespace fclib
