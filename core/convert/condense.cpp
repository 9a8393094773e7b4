#include "convert/condense.hpp"

namespace fclib {

Condensation::Condensation(const GlobalProblem& problem)
    : problem_(problem), mass_(to_eigen(problem.M), "M") {
  local_.spacedim = problem.spacedim;
  local_.mu = problem.mu;
  local_.info = problem.info;

  const Vector free_velocity = mass_.solve(problem.f);
  local_.q = problem.w;
  multiply_transposed_add(problem.H, free_velocity, local_.q);

  const SparseColumns h = to_eigen(problem.H);
  const SparseColumns g = is_mixed(problem) ? to_eigen(problem.G) : SparseColumns(h.rows(), 0);
  const auto store = [](const SparseColumns& a) {
    return converted(Matrix::from_eigen(a), Storage::csr);
  };
  if (mass_.is_cholesky() || h.rows() == 0) {
    // one triangular solve, and W = Y^T Y is symmetric to the last bit
    const SparseColumns y = mass_.half_solve(h);
    local_.W = store(SparseColumns(y.transpose() * y));
    if (is_mixed(problem)) {
      const SparseColumns z = mass_.half_solve(g);
      local_.V = store(SparseColumns(y.transpose() * z));
      local_.R = store(SparseColumns(z.transpose() * z));
    }
  } else {
    local_.W = store(SparseColumns(h.transpose() * mass_.solve(h)));
    if (is_mixed(problem)) {
      const SparseColumns velocity = mass_.solve(g);
      local_.V = store(SparseColumns(h.transpose() * velocity));
      local_.R = store(SparseColumns(g.transpose() * velocity));
    }
  }
  if (is_mixed(problem)) {
    local_.s = problem.b;
    multiply_transposed_add(problem.G, free_velocity, local_.s);
  }
}

Solution Condensation::expand(const Solution& local) const {
  Solution result = local;
  Vector momentum = problem_.f;
  multiply_add(problem_.H, local.r, momentum);
  if (is_mixed(problem_)) multiply_add(problem_.G, local.l, momentum);
  result.v = mass_.solve(momentum);
  result.u = problem_.w;
  multiply_transposed_add(problem_.H, result.v, result.u);
  return result;
}

LocalProblem condense(const GlobalProblem& problem) { return Condensation(problem).local(); }

LocalRollingProblem condense(const GlobalRollingProblem& problem) {
  return {Condensation(problem).local(), problem.mu_r};
}

}  // namespace fclib
