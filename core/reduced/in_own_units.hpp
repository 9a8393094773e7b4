// A problem in the units of its own contacts (own_units.hpp), as a problem for any method.
//
// If some bodies are very much lighter than others, or lengths stand beside angles, the entries of
// W differ by many orders of magnitude, and sweeps, gradients and factors of W lose digits on what
// is small. In its own units all diagonal blocks of W are about 1.
#pragma once

#include "reduced/own_units.hpp"
#include "reduced/reduced_problem.hpp"

namespace fclib {

/// The largest trace of a W_aa over the least one that is not nothing beside it (`nothing_moves`).
double range_of_units(const ReducedProblem& problem);

class InOwnUnits {
 public:
  /// `given` must outlive this.
  explicit InOwnUnits(const ReducedProblem& given);

  [[nodiscard]] const ReducedProblem& problem() const { return problem_; }
  /// r~ of r (m).
  [[nodiscard]] Vector to_own(const Vector& r) const { return units_.to_own(r); }
  /// r of r~ (m).
  [[nodiscard]] Vector reactions(const Vector& r) const { return units_.reactions(r); }

 private:
  OwnUnits units_;
  Primal primal_;
  std::function<bool(const Vector&)> proves_;
  ReducedProblem problem_;
};

}  // namespace fclib
