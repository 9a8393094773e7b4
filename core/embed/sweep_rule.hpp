// How long projected sweeps go on: one rule for a problem alone (SmallSolver) and for several at
// once (Lanes).
#pragma once

#include <cstddef>
#include <cstdint>

namespace fclib {

/// The number of operations, roughly: of sweeps and of a step of Newton's method.
struct StepCosts {
  double exact = 0;      ///< a sweep that solves each contact
  double projected = 0;  ///< a sweep of projected steps
  double newton = 0;

  /// Of so many contacts of `dim` components, with so many blocks of W besides the diagonal ones.
  StepCosts(int dim, std::size_t contacts, std::size_t blocks);
};

/// What projected sweeps leave to other methods.
struct SweptStart {
  bool started = false;     ///< whether r is where they ended; else r was not written
  std::int64_t sweeps = 0;  ///< how many there were
  double change = 1;        ///< of r by the last one, as an error
};

class SweepRule {
 public:
  /// The part of their cost that the sweeps have is `part`.
  explicit SweepRule(const StepCosts& costs, double part = 1);

  /// The rate is looked at after so many sweeps.
  static constexpr int between = 3;
  static constexpr int most = 500;

  /// Whether sweep k, which has changed r by `change`, may be the last.
  [[nodiscard]] static bool is_near(int k, double change, double tolerance) {
    return change <= (k % between == 0 ? 2 : 1) * tolerance;
  }
  /// Whether few more sweeps are foreseen. The sweep before k has changed r by `last`.
  [[nodiscard]] bool goes_on(int k, double last, double change, double tolerance) const;

 private:
  double step_;   // sweeps that cost as much as a step of Newton's method
  double worth_;  // sweeps that may be foreseen
};

}  // namespace fclib
