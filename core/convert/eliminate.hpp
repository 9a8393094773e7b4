// Elimination of the bilateral multiplier: from the mixed local problem to the plain one.
//
//   lambda = -R^-1 (V^T r + s),   W' = W - V R^-1 V^T,   q' = q - V R^-1 s
#pragma once

#include "linalg/factorization.hpp"
#include "problem.hpp"

namespace fclib {

/// Keeps the factorisation of R, so that lambda is found again from r.
class Elimination {
 public:
  /// Throws Error (unsuitable) where R is singular (redundant bilateral constraints).
  explicit Elimination(const LocalProblem& problem);

  [[nodiscard]] const LocalProblem& plain() const { return plain_; }
  /// Completes lambda and u from r.
  [[nodiscard]] Solution expand(const Solution& plain) const;

 private:
  const LocalProblem& problem_;
  Factorization bilateral_;
  LocalProblem plain_;
};

/// The local problem without bilateral constraints; itself where it has none.
LocalProblem eliminate(const LocalProblem& problem);
LocalRollingProblem eliminate(const LocalRollingProblem& problem);

}  // namespace fclib
