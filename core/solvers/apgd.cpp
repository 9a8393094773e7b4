// APGD: Nesterov's accelerated projected gradient on the cone relaxation, de Saxce's shift
// iterated.
//
//   s  = mu ||(W y + q)_T||                      (0 with shift = none)
//   x+ = P_K(y - t (W y + q + s) / weight),      t by backtracking
//   y  = x+ + beta (x+ - x),                     beta = 0 if the objective rises
//
// Mazhar, Heyn, Negrut, Tasora, "Using Nesterov's method to accelerate multibody dynamics with
// friction and contact" (2015); Nesterov (1983); O'Donoghue & Candes (2015) for the restart.
//
// Differs from the papers in:
// - the shift follows the iterates, so that Coulomb's law is solved. The papers' problem is the
//   convex relaxation, an associated flow rule in which sliding contacts separate. shift = none is
//   that problem. If anything slides, its solution is not one of Coulomb's law: the error shows
//   that, and the solver ends as stalled when it has the solution;
// - steps are measured by tr(W_aa) / d of each contact, so that masses may differ;
// - W x is kept with x, so that a step costs one product with W.

#include "methods/accelerated_gradient.hpp"
#include "methods/shared_options.hpp"
#include "reduced/convex_residual.hpp"
#include "reduced/convex_sets.hpp"
#include "reduced/de_saxce_shift.hpp"
#include "solve/best_iterate.hpp"
#include "solve/by_cone.hpp"

namespace fclib::apgd {

namespace {

struct Options {
  Shift shift = Shift::iterated;
  bool restart = true;
  double growth = 1.05;
  double reduction = 0.7;
  bool weights = true;

  static constexpr auto fields() {
    using O = Options;
    return std::tuple{
        shift_field<O>(),
        flag("restart", &O::restart, "The momentum starts again if it goes uphill."),
        option("growth", &O::growth, "1", {1, 10},
               "The step is multiplied by this after each iteration."),
        option("reduction", &O::reduction, "1", {0.1, 0.95},
               "The largest factor on a step that was too long."),
        flag("weights", &O::weights,
             "Each contact has a step by its own block of W. Else all have the same."),
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

  AcceleratedGradient<Cone> gradient(
      problem,
      {.growth = options.growth, .reduction = options.reduction, .restart = options.restart},
      options.weights);
  Vector shift = Vector::Zero(problem.nc());
  gradient.start(r, u);
  while (true) {
    if (options.shift == Shift::iterated) {
      de_saxce_shift<Cone>(gradient.uy(), problem.friction, shift);
    }
    gradient.step(cones, shift);
    if (best.report(1, gradient.x(), gradient.u())) return best.outcome(r);
    if (options.shift == Shift::none &&
        convex_residual(problem, cones, shift, gradient.x(), gradient.u()) <= best.tolerance()) {
      return best.outcome(r);  // the relaxation is solved, which is not Coulomb's law
    }
  }
}

}  // namespace

const Solver& solver() {
  static const Solver entry{
      .name = "apgd",
      .family = "optimisation",
      .title = "Accelerated projected gradient with the shift iterated",
      .citation = "Mazhar, Heyn, Negrut & Tasora 2015; Nesterov 1983; O'Donoghue & Candes 2015",
      .dimensions = {2, 3},
      .rolling_dimensions = {3, 5},
      .spin_dimensions = {4, 6},
      .options = describe_options<Options>(),
      .max_iterations = 1'000'000,
      .solve = by_cone<Options>([]<class Cone>(auto&... all) { return iterate<Cone>(all...); }),
  };
  return entry;
}

}  // namespace fclib::apgd
