// The loop of the interior point, for any cone: Mehrotra's predictor and corrector along a path
// with x o y = tau e. The system has a regularisation delta, which falls as the steps get longer.
//
// A Cones class has all that depends on the cone (methods/interior_point.hpp and
// product_interior_point.hpp):
//
//   void evaluate(rules)              residual and gap at the iterate
//   double tau(), residual()          mean complementarity, ||R||_inf
//   bool assemble(delta, rules)       the factors of Newton's system; false if there are none
//   void predict()                    the target of the predictor
//   void correct(sigma, second)       that of the corrector: sigma tau e, less the second order
//   void keep_predictor()             keeps the predictor's direction, which both correctors need
//   void correct_shift(step)          adds to the residual what it misses of de Saxce's term
//   bool direction(delta)             dx, dy, dr; false if they are not finite
//   double longest()                  the step at which x or y leaves its cone
//   double gap(step)                  the mean complementarity after a step
//   void advance(step)                the next iterate
//
// Mehrotra, "On the implementation of a primal-dual interior point method" (1992).
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "function_ref.hpp"
#include "methods/interior_rules.hpp"

namespace fclib {

namespace interior {

// when it ends
constexpr double last_tau = 1e-15;
constexpr double shortest_step = 1e-6;
// Until then no direction is refined: the next residual has what rounding leaves of it.
constexpr double refined_tau = 1e-7;
// the regularisation
constexpr double delta_over_tau = 1e4;  // delta is at most so many times tau
constexpr double least_delta = 1e-8;
constexpr double most_delta = 1;
constexpr double short_step = 0.1;  // delta grows tenfold after a shorter one,
constexpr double long_step = 0.5;   // and falls as much after a longer one
// the centring sigma = (gap after the predictor / gap)^3
constexpr double least_sigma = 1e-6;
constexpr double nearly_held =
    0.1;  // share of `balance` above which sigma is at least guarded_sigma
constexpr double guarded_sigma = 0.3;
// if the step of a corrector is short, it is tried again with more centring
constexpr double good_step = 0.3;
constexpr double last_sigma = 0.9;
constexpr int attempts = 3;
constexpr double least_cap = 0.9;  // the cap is 1 - tau, between this and step_cap

/// x of x - y = z and x y = tau, without cancellation.
inline double root(double z, double tau) {
  const double length = std::sqrt(z * z + 4 * tau);
  return z > 0 ? 0.5 * (z + length) : 2 * tau / (length - z);
}

}  // namespace interior

/// Follows the path from the iterate of `cones`. `report(k)` gets each iterate and returns its
/// error; if it returns nothing, the path ends. Returns the number of iterations.
template <class Cones>
int follow_path(Cones& cones, const InteriorPointRules& rules,
                FunctionRef<std::optional<double>(int iteration)> report) {
  using namespace interior;
  double delta = rules.delta;
  double least = std::numeric_limits<double>::infinity();
  int least_at = 0;
  int k = 0;
  for (; k < rules.max_iterations; ++k) {
    cones.evaluate(rules);
    const std::optional<double> error = report(k);
    if (!error) return k;
    if (*error < 0.5 * least) {
      least = *error;
      least_at = k;
    }
    const double tau = cones.tau();
    if (k - least_at > rules.patience || !(tau > last_tau)) return k;
    if (rules.delta_follows) delta = std::min(delta, delta_over_tau * tau);
    delta = std::clamp(delta, least_delta, most_delta);

    if (!cones.assemble(delta, rules)) return k;
    cones.predict();
    if (!cones.direction(delta)) return k;
    const double affine_step = std::min(1.0, cones.longest());
    double sigma = std::clamp(std::pow(cones.gap(affine_step) / tau, 3), least_sigma, 1.0);
    if (cones.residual() > rules.balance * tau) {
      sigma = 1;
    } else if (cones.residual() > nearly_held * rules.balance * tau) {
      sigma = std::max(sigma, guarded_sigma);
    }
    cones.keep_predictor();
    const double cap = std::clamp(1 - tau, std::min(least_cap, rules.step_cap), rules.step_cap);
    double step = 0;
    for (int attempt = 0; attempt < attempts; ++attempt) {
      if (attempt > 0) sigma = std::max(sigma, attempt == 1 ? guarded_sigma : last_sigma);
      cones.correct(sigma, attempt == 0);
      if (attempt == 0 && !rules.associated) cones.correct_shift(affine_step);
      if (!cones.direction(delta)) return k;
      step = std::min(1.0, cap * cones.longest());
      if (step >= good_step) break;
    }
    cones.advance(step);
    if (step < short_step) {
      delta *= 10;
    } else if (step > long_step) {
      delta *= 0.1;
    }
    if (step < shortest_step) return k;
  }
  return k;
}

}  // namespace fclib
