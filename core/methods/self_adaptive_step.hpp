// The self-adaptive step of projection methods. rho shrinks until a trial is accepted, and grows if
// the trial was accepted with room to spare.
//
//   while rho ratio(trial(rho)) > L:  rho <- tau rho
//   after it, if rho ratio < L_min:  rho <- rho / tau
//
// The ratio is Khobotov's (UPK), ||F(z) - F(z_k)|| / ||z - z_k||, or Solodov & Tseng's (UPTS),
// (z - z_k) . (F(z) - F(z_k)) / ||z - z_k||^2.
//
// Khobotov, "Modification of the extra-gradient method for solving variational inequalities and
// certain optimization problems" (1987); Marcotte, "Application of Khobotov's algorithm to
// variational inequalities and network equilibrium problems" (1991); Solodov & Tseng, "Modified
// projection-type methods for monotone variational inequalities" (1996); He & Liao, "Improvements
// of some projection methods for monotone nonlinear variational inequalities" (2002).
#pragma once

#include <algorithm>

namespace fclib {

struct StepRule {
  double rho = 1;  ///< the first step
  double tau = 2.0 / 3.0;
  double high = 0.9;  ///< L
  double low = 0.3;   ///< L_min
};

class SelfAdaptiveStep {
 public:
  explicit SelfAdaptiveStep(const StepRule& rule) : rule_(rule), rho_(rule.rho) {}

  [[nodiscard]] double rho() const { return rho_; }

  /// Shrinks rho until `trial(rho)`, which computes the trial and returns its ratio, is accepted.
  template <class Trial>
  void search(const Trial& trial) {
    for (int attempt = 0;; ++attempt) {
      measure_ = rho_ * trial(rho_);
      if (measure_ <= rule_.high || attempt == max_attempts) return;
      rho_ = std::max(rule_.tau * rho_, least);
    }
  }

  /// After an iteration: rho for the next one.
  void update() {
    if (measure_ < rule_.low) rho_ = std::min(rho_ / rule_.tau, most);
  }

 private:
  static constexpr int max_attempts = 50;
  static constexpr double least = 1e-100;
  static constexpr double most = 1e100;

  StepRule rule_;
  double rho_;
  double measure_ = 0;  // rho times the ratio of the last trial
};

}  // namespace fclib
