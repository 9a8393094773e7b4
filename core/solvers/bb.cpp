// Barzilai & Borwein's spectral projected gradient on the cone relaxation, de Saxce's shift
// iterated.
//
//   g = W r + q + s,  s = mu ||(W r + q)_T||        (0 with shift = none)
//   d = P_K(r - alpha g / weight) - r
//   r <- r + lambda d,  lambda by a nonmonotone line search (Grippo, Lampariello, Lucidi)
//   alpha = <dr, dr> / <dr, W dr> and <dr, W dr> / <W dr, W dr>, in turn
//
// Birgin, Martinez, Raydan, "Nonmonotone spectral projected gradient methods on convex sets"
// (2000); Barzilai & Borwein, "Two-point step size gradient methods" (1988); Heyn, Anitescu,
// Tasora, Negrut, "Using Krylov subspace and spectral methods for solving complementarity problems
// in many-body contact dynamics simulation" (2013).
//
// Differs from the papers in:
// - the shift follows the iterates, so that Coulomb's law is solved and not the convex relaxation.
//   The objective changes with the shift: the remembered values are corrected by s.r at the current
//   iterate. shift = none is the convex relaxation. If anything slides, that is not Coulomb's law:
//   the error shows it, and the solver ends as stalled when it has the solution;
// - inner products have the weights tr(W_aa) / d, so that masses may differ;
// - W d is known from the line search: an iteration costs one product with W.

#include <cstdint>

#include "methods/shared_options.hpp"
#include "methods/spectral_gradient.hpp"
#include "reduced/convex_residual.hpp"
#include "reduced/convex_sets.hpp"
#include "solve/best_iterate.hpp"
#include "solve/by_cone.hpp"

namespace fclib::bb {

namespace {

struct Options {
  Shift shift = Shift::iterated;
  SpectralStep step = SpectralStep::alternating;
  std::int64_t memory = 10;
  double decrease = 1e-4;
  bool weights = true;

  static constexpr auto fields() {
    using O = Options;
    return std::tuple{
        shift_field<O>(),
        choice("step", &O::step, spectral_steps,
               "Which of the two steps of Barzilai and Borwein is taken."),
        option("memory", &O::memory, "iterations", {1, 1000},
               "The line search may rise to the largest objective of so many iterations. 1 makes "
               "it monotone."),
        option("decrease", &O::decrease, "1", {0, 0.5},
               "The share of the predicted decrease that is asked for."),
        flag("weights", &O::weights,
             "Each contact has a metric by its own block of W. Else all have the same."),
    };
  }
};

template <class Cone>
Outcome iterate(const ReducedProblem& problem, const Options& options, const Settings& settings,
                Vector& r) {
  const Cones<Cone> cones(problem.friction);
  BestIterate<Cone> best(problem, settings, r);
  Vector u(problem.m());
  problem.velocity(r, u);
  if (best.report(0, r, u)) return best.outcome(r);
  const bool relaxed = options.shift == Shift::none;
  spectral_gradient<Cone>(
      problem,
      {.shifted = !relaxed,
       .step = options.step,
       .memory = options.memory,
       .decrease = options.decrease,
       .weights = options.weights},
      r, u, [&](const Vector& shift) {
        // the relaxation is solved, which is not Coulomb's law
        return best.report(1, r, u) ||
               (relaxed && convex_residual(problem, cones, shift, r, u) <= best.tolerance());
      });
  return best.outcome(r);
}

}  // namespace

const Solver& solver() {
  static const Solver entry{
      .name = "bb",
      .family = "optimisation",
      .title = "Barzilai-Borwein spectral projected gradient with the shift iterated",
      .citation =
          "Birgin, Martinez & Raydan 2000; Barzilai & Borwein 1988; Heyn, Anitescu, Tasora & "
          "Negrut 2013",
      .dimensions = {2, 3},
      .rolling_dimensions = {3, 5},
      .options = describe_options<Options>(),
      .max_iterations = 1'000'000,
      .solve = by_cone<Options>([]<class Cone>(auto&... all) { return iterate<Cone>(all...); }),
  };
  return entry;
}

}  // namespace fclib::bb
