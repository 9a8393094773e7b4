// Elimination of the bilateral multiplier: from the mixed local problem to the plain one.
//
//   lambda = -R^-1 (V^T r + s),   W' = W - V R^-1 V^T,   q' = q - V R^-1 s
//
// Constraints may follow from others, as those of parallel linkages and of closed loops in space
// do. R is singular then: those that follow are left out, and of all lambda that do the same the
// shortest is returned. Whether those left out agree with the others is said.
//
// R = G^T M^-1 G has the squared condition number of the constraints. Where that is too much and
// the bodies are known, the constraints are made orthonormal: L^-1 G = Q T with M = L L^T,
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
  /// Throws Error (unsuitable) where R is singular though no constraint follows from the others.
  ///
  /// The deadline is looked at after each factorisation, and nothing is done once it has passed:
  /// finished() says so, and plain() is empty then.
  explicit Elimination(const LocalProblem& problem, const Deadline* deadline = nullptr);
  /// Of condensation.local().
  Elimination(const GlobalProblem& problem, const Condensation& condensation,
              const Deadline* deadline = nullptr);

  [[nodiscard]] bool finished() const { return finished_; }

  [[nodiscard]] const LocalProblem& plain() const { return plain_; }
  /// Completes lambda and u from r.
  [[nodiscard]] Solution expand(const Solution& plain) const;

  /// Betters lambda (p) of a whole solution, and takes out of v (n) what its rounding breaks of the
  /// constraints: where joints nearly follow from each other lambda is so large that light bodies
  /// feel it. False where no constraints are so close, and nothing is changed.
  bool hold(const GlobalProblem& bodies, const Condensation& condensation,
            Solution& solution) const;

  /// Where a constraint that follows from the others contradicts them: which one, and by how much.
  [[nodiscard]] const std::optional<Error>& contradiction() const { return contradiction_; }

  /// Bilateral constraints that follow from others.
  [[nodiscard]] Eigen::Index redundant() const { return idle_.cols(); }

 private:
  Elimination(const LocalProblem& problem, const GlobalProblem* bodies,
              const Condensation* condensation, const Deadline* deadline);

  /// With the constraints made orthonormal. False where the bodies do not allow it.
  bool orthonormalise(const GlobalProblem& bodies, const Condensation& condensation);
  /// Without constraints that follow from others; `size` is what s is rounded to. Whether there
  /// were any.
  bool leave_out_redundant(const SparseColumns& r, const Vector& size);
  void reduce();
  /// sqrt(R_kk) of the constraints that are left.
  [[nodiscard]] Vector joint_lengths() const;
  /// The multipliers of the constraints that are left.
  [[nodiscard]] Vector multipliers(const Vector& velocity) const;

  const LocalProblem& problem_;
  std::optional<Factorization> bilateral_;  // of R; none where R is the identity
  SparseColumns v_;                         // V of the constraints that are left
  Vector s_;
  bool all_ = true;          // whether they are those of the problem
  std::vector<Index> kept_;  // else: their places in lambda ...
  Eigen::MatrixXd turn_;     // ... and T1 of those made orthonormal
  Vector scale_;             // ... with the scaling of their columns
  Eigen::MatrixXd idle_;     // combinations of multipliers that do nothing
  std::optional<Error> contradiction_;
  LocalProblem plain_;
  bool finished_ = false;
};

/// The local problem without bilateral constraints; itself where it has none. Throws Error
/// (unsuitable) where R is singular, and where constraints contradict each other.
LocalProblem eliminate(const LocalProblem& problem);
LocalRollingProblem eliminate(const LocalRollingProblem& problem);

}  // namespace fclib
