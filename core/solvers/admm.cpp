// ADMM on the cone relaxation, with de Saxce's shift updated in the loop.
//
//   x <- (W + rho weight)^-1 (rho weight (z - w) - q - s)
//   z <- P_K(alpha x + (1 - alpha) z + w),   w <- w + alpha x + (1 - alpha) z_old - z
//   s <- mu ||u_T||,   u = -rho weight w
//
// Boyd, Parikh, Chu, Peleato, Eckstein, "Distributed optimization and statistical learning via the
// alternating direction method of multipliers" (2011); Tasora, Mangoni, Benatti, Garziera, "Solving
// variational inequalities and cone complementarity problems in nonsmooth dynamics using the
// alternating direction method of multipliers" (2021); Goldstein, O'Donoghue, Setzer, Baraniuk
// (2014) for acceleration; Xu, Figueiredo, Goldstein (2017) for the spectral penalty.
//
// Differs from the papers in:
// - with the shift, the problem is Coulomb's law and not its convex relaxation, and there is no
//   proof of convergence any more;
// - the penalty is relative to tr(W_aa) / d of each contact, so that masses may differ;
// - the penalty changes only by factors above 3, because each change takes a factorisation, and the
//   changes become rarer and rarer;
// - if the problem is known by its bodies, (M + H H^T / rho) is factorised in place of (W + rho I),
//   if that takes fewer operations;
// - the best iterate by the natural map of Coulomb's law is returned.

#include <algorithm>
#include <array>
#include <cstdint>

#include "methods/alternating_directions.hpp"
#include "reduced/convex_sets.hpp"
#include "reduced/de_saxce_shift.hpp"
#include "solve/best_iterate.hpp"
#include "solve/by_cone.hpp"

namespace fclib::admm {

namespace {

constexpr std::array<std::string_view, 3> penalties{"constant", "balance", "spectral"};

enum class Acceleration { none, restart };
constexpr std::array<std::string_view, 2> accelerations{"none", "restart"};

struct Options {
  double rho = 1;
  PenaltyRule penalty = PenaltyRule::spectral;
  std::int64_t penalty_interval = 5;
  double relaxation = 1.6;
  Acceleration acceleration = Acceleration::none;
  double restart = 0.999;
  bool weights = true;

  static constexpr auto fields() {
    using O = Options;
    return std::tuple{
        option("rho", &O::rho, "1", {1e-6, 1e6}, "The penalty at first, relative to tr(W_aa) / d."),
        choice("penalty", &O::penalty, penalties,
               "How rho changes: not at all, by balancing the relative residuals, or by spectral "
               "estimates of the curvature."),
        option("penalty_interval", &O::penalty_interval, "iterations", {1, 1e6},
               "The number of iterations between two changes of rho. It doubles with each change."),
        option("relaxation", &O::relaxation, "1", {0.1, 1.95},
               "alpha. Above 1 it is over-relaxation."),
        choice("acceleration", &O::acceleration, accelerations,
               "restart: Nesterov's momentum, which starts again if the residual does not fall. "
               "none: no momentum."),
        option("restart", &O::restart, "1", {0.1, 1},
               "The momentum is kept if the combined residual falls below this share of its last "
               "value."),
        flag("weights", &O::weights,
             "Each contact has a penalty by its own block of W. Else all have the same."),
    };
  }
};

/// The error costs a product with W, so it is computed only now and then: iterations to the next
/// time.
std::int64_t next_check(std::int64_t k) { return k + std::clamp<std::int64_t>(k / 4, 1, 10); }

template <class Cone>
Outcome iterate(const ReducedProblem& problem, const Options& options, const Settings& settings,
                Vector& r) {
  const Cones<Cone> cones(problem.friction);
  BestIterate<Cone> best(problem, settings, r);
  Vector u(problem.m());
  Vector shift(problem.nc());
  problem.velocity(r, u);
  de_saxce_shift<Cone>(u, problem.friction, shift);
  if (best.report(0, r, u)) return best.outcome(r);

  CoupledSystem system(problem);
  AlternatingDirections<Cone> step(problem, system,
                                   {.rho = options.rho,
                                    .relaxation = options.relaxation,
                                    .penalty = options.penalty,
                                    .accelerate = options.acceleration == Acceleration::restart,
                                    .eta = options.restart,
                                    .interval = options.penalty_interval},
                                   options.weights);
  if (!step.start(r, u, shift)) return best.outcome(r);
  std::int64_t check = 1;
  std::int64_t told = 0;
  for (std::int64_t k = 1;; ++k) {
    step.x_update(shift);
    step.z_update(cones);
    step.w_update();
    step.velocity(u);
    de_saxce_shift<Cone>(u, problem.friction, shift);
    if (k < check) {
      if (best.due(k - told) && best.glance(k - told, step.z())) return best.outcome(r);
    } else {
      problem.velocity(step.z(), u);
      if (best.report(k - told, step.z(), u)) return best.outcome(r);
      told = k;
      check = next_check(k);
    }
    if (!step.adapt()) return best.outcome(r);
  }
}

}  // namespace

const Solver& solver() {
  static const Solver entry{
      .name = "admm",
      .family = "optimisation",
      .title = "ADMM with the shift in the loop",
      .citation =
          "Boyd et al. 2011; Tasora, Mangoni, Benatti & Garziera 2021; Xu, Figueiredo & Goldstein "
          "2017",
      .dimensions = {2, 3},
      .rolling_dimensions = {3, 5},
      .spin_dimensions = {4, 6},
      .options = describe_options<Options>(),
      .max_iterations = 1'000'000,
      .solve = by_cone<Options>([]<class Cone>(auto&... all) { return iterate<Cone>(all...); }),
  };
  return entry;
}

}  // namespace fclib::admm
