// Condensation: from the global problem to the local one, and back for its solution.
//
//   W = H^T M^-1 H,   q = H^T M^-1 f + w,   V = H^T M^-1 G,   R = G^T M^-1 G,   s = G^T M^-1 f + b
#pragma once

#include <utility>

#include "deadline.hpp"
#include "linalg/factorization.hpp"
#include "problem.hpp"

namespace fclib {

/// Keeps the factorisation of M, so that it is cheap to take a solution of the local problem back.
class Condensation {
 public:
  /// Throws Error (unsuitable) if M is singular, or symmetric and not positive definite.
  ///
  /// If the deadline has passed after the factorisation of M, nothing more is done: finished() is
  /// false, and local() is not a problem then.
  explicit Condensation(const GlobalProblem& problem, const Deadline* deadline = nullptr);
  /// ... with M factorised already.
  Condensation(const GlobalProblem& problem, Factorization mass,
               const Deadline* deadline = nullptr);

  [[nodiscard]] bool finished() const { return finished_; }

  [[nodiscard]] const LocalProblem& local() const { return local_; }
  [[nodiscard]] const Factorization& mass() const { return mass_; }
  /// Takes the factorisation out. What needs it cannot be called any more.
  [[nodiscard]] Factorization take_mass() { return std::move(mass_); }
  /// `expanded` with the factorisation that is kept.
  [[nodiscard]] Solution expand(const Solution& local) const;

 private:
  const GlobalProblem& problem_;
  Factorization mass_;
  LocalProblem local_;
  bool finished_ = false;
};

/// Completes v = M^-1 (H r + G lambda + f) and u = H^T v + w from r and l.
Solution expanded(const GlobalProblem& problem, const Factorization& mass, const Solution& local);

/// The local form of a global problem (M3DFC from GM3DFC). If its joints contradict each other only
/// by rounding, they are made to agree (joints/consistent.hpp).
LocalProblem condense(const GlobalProblem& problem);
/// ... and with another law than Coulomb's.
template <class P>
  requires(std::derived_from<P, GlobalProblem> && !std::same_as<P, GlobalProblem>)
LocalFormOf<P> condense(const P& problem) {
  LocalFormOf<P> local;
  static_cast<LocalProblem&>(local) = condense(static_cast<const GlobalProblem&>(problem));
  copy_law(problem, local);
  return local;
}

}  // namespace fclib
