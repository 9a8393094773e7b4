#include "convert/condense.hpp"

#include <limits>
#include <optional>

#include "linalg/extended.hpp"

namespace fclib {

Condensation::Condensation(const GlobalProblem& problem, const Deadline* deadline)
    : problem_(problem), mass_(to_eigen(problem.M), "M") {
  const Deadline never(std::numeric_limits<double>::infinity());
  if (deadline == nullptr) deadline = &never;
  if (deadline->passed()) return;
  local_.spacedim = problem.spacedim;
  local_.mu = problem.mu;
  local_.info = problem.info;
  local_.geometry = problem.geometry;

  const Vector free_velocity = mass_.solve(problem.f);
  local_.q = problem.w;
  multiply_transposed_add(problem.H, free_velocity, local_.q);

  const SparseColumns h = to_eigen(problem.H);
  const SparseColumns g = is_mixed(problem) ? to_eigen(problem.G) : SparseColumns(h.rows(), 0);
  const auto store = [](const SparseColumns& a) {
    return converted(Matrix::from_eigen(a), Storage::csr);
  };
  const Eigen::Index m = h.cols();
  const Eigen::Index p = g.cols();
  SparseColumns both(h.rows(), m + p);  // [H G]
  both.reserve(h.nonZeros() + g.nonZeros());
  both.leftCols(m) = h;
  both.rightCols(p) = g;
  const std::optional<SparseColumns> product = mass_.gram(both, *deadline);
  if (!product) return;
  const SparseColumns& gram = *product;
  local_.W = store(SparseColumns(SparseColumns(gram.leftCols(m)).topRows(m)));
  if (is_mixed(problem)) {
    const SparseColumns right = gram.rightCols(p);
    local_.V = store(SparseColumns(right.topRows(m)));
    local_.R = store(SparseColumns(right.bottomRows(p)));
  }
  if (is_mixed(problem)) {
    local_.s = problem.b;
    multiply_transposed_add(problem.G, free_velocity, local_.s);
  }
  finished_ = true;
}

Solution Condensation::expand(const Solution& local) const {
  Solution result = local;
  // what joints and contacts add to a light body may be far larger than what is left of it
  RealVector momentum = problem_.f.cast<Real>();
  multiply_add(problem_.H, local.r, momentum);
  if (is_mixed(problem_)) multiply_add(problem_.G, local.l, momentum);
  result.v = mass_.solve(Vector(momentum.cast<double>()));
  result.u = problem_.w;
  multiply_transposed_add(problem_.H, result.v, result.u);
  return result;
}

LocalProblem condense(const GlobalProblem& problem) { return Condensation(problem).local(); }

LocalRollingProblem condense(const GlobalRollingProblem& problem) {
  return {Condensation(problem).local(), problem.mu_r};
}

}  // namespace fclib
