// Elimination of the bilateral multiplier: from the mixed local problem to the plain one.
//
//   lambda = -R^-1 (V^T r + s),   W' = W - V R^-1 V^T,   q' = q - V R^-1 s
//
// Constraints may follow from others, for example in parallel linkages and in closed loops in
// space. Then R is singular. Those that follow are left out, and of all lambda with the same effect
// the shortest is returned. If those left out contradict the others, that is reported.
//
// R = G^T M^-1 G has the squared condition number of the constraints. If that is too large and the
// bodies are known, the constraints are made orthonormal: L^-1 G = Q T with M = L L^T,
//
//   R' = I,   V' = H^T L^-T Q,   s' = Q^T L^-1 f + T^-T b,   lambda = T^-1 lambda'
#pragma once

#include <optional>

#include "convert/condense.hpp"
#include "error.hpp"
#include "linalg/factorization.hpp"
#include "problem.hpp"

namespace fclib {

/// Keeps the factorisation of R, so that lambda is found again from r.
class Elimination {
 public:
  /// Throws Error (unsuitable) if R is singular though no constraint follows from the others.
  ///
  /// The deadline is checked after each factorisation. If it has passed, nothing more is done:
  /// finished() is false, and plain() is empty then.
  explicit Elimination(const LocalProblem& problem, const Deadline* deadline = nullptr);
  /// Eliminates from condensation.local().
  Elimination(const GlobalProblem& problem, const Condensation& condensation,
              const Deadline* deadline = nullptr);

  [[nodiscard]] bool finished() const { return finished_; }

  [[nodiscard]] const LocalProblem& plain() const { return plain_; }
  /// Completes lambda and u from r.
  [[nodiscard]] Solution expand(const Solution& plain) const;

  /// Whether constraints nearly follow from each other.
  [[nodiscard]] bool nearly_dependent() const { return turn_.size() > 0; }

  /// Makes lambda (p) of a whole solution more accurate, and removes from v (n) what its rounding
  /// breaks of the constraints: if joints nearly follow from each other, or reactions between
  /// joints are large, lambda is so large that its rounding moves light bodies.
  void hold(const GlobalProblem& bodies, const Condensation& condensation,
            Solution& solution) const;

  /// The constraint that follows from the others and contradicts them, if any, and by how much.
  [[nodiscard]] const std::optional<Error>& contradiction() const { return contradiction_; }

  /// The bilateral constraints that follow from others.
  [[nodiscard]] Eigen::Index redundant() const { return idle_.cols(); }

 private:
  Elimination(const LocalProblem& problem, const GlobalProblem* bodies,
              const Condensation* condensation, const Deadline* deadline);

  /// Makes the constraints orthonormal. Returns false if the bodies do not allow it.
  bool orthonormalise(const GlobalProblem& bodies, const Condensation& condensation);
  /// Leaves out constraints that follow from others. `size` is what s is rounded to. Returns
  /// whether there were any.
  bool leave_out_redundant(const SparseColumns& r, const Vector& size);
  void reduce();
  /// sqrt(R_kk) of the constraints that are left.
  [[nodiscard]] Vector joint_lengths() const;
  /// The multipliers of the constraints that are left.
  [[nodiscard]] Vector multipliers(const Vector& velocity) const;

  const LocalProblem& problem_;
  std::optional<Factorization> bilateral_;  // of R; none if R is the identity
  SparseColumns v_;                         // V of the constraints that are left
  Vector s_;
  bool all_ = true;          // whether they are all constraints of the problem
  std::vector<Index> kept_;  // else: their places in lambda ...
  Eigen::MatrixXd turn_;     // ... and T1 of those made orthonormal
  Vector scale_;             // ... with the scaling of their columns
  Eigen::MatrixXd idle_;     // combinations of multipliers that have no effect
  std::optional<Error> contradiction_;
  LocalProblem plain_;
  bool finished_ = false;
};

/// The local problem without bilateral constraints, or the problem itself if it has none. Throws
/// Error (unsuitable) if R is singular, or if constraints contradict each other.
LocalProblem eliminate(const LocalProblem& problem);
template <class P>
  requires(std::derived_from<P, LocalProblem> && !std::same_as<P, LocalProblem>)
P eliminate(const P& problem) {
  P plain = problem;
  static_cast<LocalProblem&>(plain) = eliminate(static_cast<const LocalProblem&>(problem));
  return plain;
}

}  // namespace fclib
