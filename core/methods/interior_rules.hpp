// The options of an interior point, for any cone.
#pragma once

#include <tuple>

#include "solve/options.hpp"

namespace fclib {

struct InteriorPointRules {
  bool associated = false;  ///< without de Saxce's term
  double tau = 1;
  double smoothing = 0;
  double step_cap = 0.95;
  double delta = 1e-6;
  bool delta_follows = true;
  double balance = 1e4;
  int max_iterations = 60;
  int patience = 15;

  using O = InteriorPointRules;
  static constexpr auto tau_option() {
    return option("tau", &O::tau, "1", {1e-12, 1e6},
                  "The complementarity at first: the smaller it is, the nearer to the guess the "
                  "path begins.");
  }
  static constexpr auto smoothing_option() {
    return option("smoothing", &O::smoothing, "1", {0},
                  "The width of the smoothed kink of de Saxce's term, over the mean "
                  "complementarity gap.");
  }
  static constexpr auto step_cap_option() {
    return option("step_cap", &O::step_cap, "1", {0.1, 0.9999},
                  "The largest share of the step to the boundary of the cones.");
  }
  static constexpr auto delta_option() {
    return option("delta", &O::delta, "mean of tr(W_aa) / d", {1e-8, 1},
                  "The regularisation of the system at first.");
  }
  static constexpr auto patience_option() {
    return option("patience", &O::patience, "iterations", {1, 1e6},
                  "The number of iterations in which the error must halve.");
  }
  static constexpr auto fields() {
    return std::tuple{
        tau_option(), step_cap_option(), delta_option(),
        flag("delta_follows", &O::delta_follows, "delta is at most 1e4 times the complementarity."),
        option("balance", &O::balance, "1", {1, 1e12},
               "The complementarity is held if the residual is so many times as large.")};
  }
};

}  // namespace fclib
