#include "convert/condense.hpp"

#include <limits>
#include <optional>
#include <utility>

#include "joints/consistent.hpp"
#include "linalg/extended.hpp"

namespace fclib {

Condensation::Condensation(const GlobalProblem& problem, const Deadline* deadline)
    : Condensation(problem, Factorization(to_eigen(problem.M), "M"), deadline) {}

Condensation::Condensation(const GlobalProblem& problem, Factorization mass,
                           const Deadline* deadline)
    : problem_(problem), mass_(std::move(mass)) {
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

  SparseColumns both = to_eigen(problem.H);  // [H G]
  const Eigen::Index m = both.cols();
  const Eigen::Index p = is_mixed(problem) ? problem.G.cols : 0;
  if (p > 0) {
    const SparseColumns h = std::move(both);
    both = SparseColumns(h.rows(), m + p);
    both.reserve(h.nonZeros() + static_cast<Eigen::Index>(problem.G.nnz()));
    both.leftCols(m) = h;
    both.rightCols(p) = to_eigen(problem.G);
  }
  const auto store = Matrix::from_eigen;
  const std::optional<SparseColumns> product = mass_.gram(both, *deadline);
  if (!product) return;
  const SparseColumns& gram = *product;
  if (!is_mixed(problem)) {
    local_.W = store(gram);
  } else {
    local_.W = store(SparseColumns(SparseColumns(gram.leftCols(m)).topRows(m)));
    const SparseColumns right = gram.rightCols(p);
    local_.V = store(SparseColumns(right.topRows(m)));
    local_.R = store(SparseColumns(right.bottomRows(p)));
    local_.s = problem.b;
    multiply_transposed_add(problem.G, free_velocity, local_.s);
  }
  finished_ = true;
}

Solution Condensation::expand(const Solution& local) const {
  return expanded(problem_, mass_, local);
}

Solution expanded(const GlobalProblem& problem, const Factorization& mass, const Solution& local) {
  Solution result = local;
  // joints and contacts may add far more to the velocity of a light body than what is left of it
  RealVector momentum = problem.f.cast<Real>();
  multiply_add(problem.H, local.r, momentum);
  if (is_mixed(problem)) multiply_add(problem.G, local.l, momentum);
  result.v = mass.solve(Vector(momentum.cast<double>()));
  result.u = problem.w;
  multiply_transposed_add(problem.H, result.v, result.u);
  return result;
}

LocalProblem condense(const GlobalProblem& problem) {
  const std::optional<ConsistentJoints> joints = consistent_joints(problem);
  LocalProblem local =
      joints ? Condensation(with(problem, *joints)).local() : Condensation(problem).local();
  for (Matrix* a : {&local.W, &local.V, &local.R}) {
    if (!a->empty()) *a = converted(*a, Storage::csr);
  }
  return local;
}

}  // namespace fclib
