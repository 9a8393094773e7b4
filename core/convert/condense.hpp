// Condensation: from the global problem to the local one, and back for its solution.
//
//   W = H^T M^-1 H,   q = H^T M^-1 f + w,   V = H^T M^-1 G,   R = G^T M^-1 G,   s = G^T M^-1 f + b
#pragma once

#include "deadline.hpp"
#include "linalg/factorization.hpp"
#include "problem.hpp"

namespace fclib {

/// Keeps the factorisation of M, so that a solution of the local problem is taken back cheaply.
class Condensation {
 public:
  /// Throws Error (unsuitable) where M is singular, or symmetric and not positive definite.
  ///
  /// After the factorisation of M nothing is done once the deadline has passed: finished() says so,
  /// and local() is no problem then.
  explicit Condensation(const GlobalProblem& problem, const Deadline* deadline = nullptr);

  [[nodiscard]] bool finished() const { return finished_; }

  [[nodiscard]] const LocalProblem& local() const { return local_; }
  [[nodiscard]] const Factorization& mass() const { return mass_; }
  /// Completes v = M^-1 (H r + G lambda + f) and u = H^T v + w from r and l.
  [[nodiscard]] Solution expand(const Solution& local) const;

 private:
  const GlobalProblem& problem_;
  Factorization mass_;
  LocalProblem local_;
  bool finished_ = false;
};

/// The local form of a global problem (M3DFC from GM3DFC), with joints that agree if only rounding
/// keeps them from it (joints/consistent.hpp).
LocalProblem condense(const GlobalProblem& problem);
LocalRollingProblem condense(const GlobalRollingProblem& problem);

}  // namespace fclib
