// NSIP: a nonsmooth interior point method for Coulomb's law, with the shift mu ||u_T|| inside
// Newton's system.
//
//   x = (mu r_N, r_T),  y = (u^_N / mu, u_T),  x o y = tau e,  tau -> 0
//   u = W r + q,  u^ = u + [mu ||u_T||, 0, 0]
//
// Nesterov & Todd's scaling, Mehrotra's predictor and corrector (methods/interior_point.hpp).
//
// Acary, Armand, Nguyen, Shpakovych, "Second order cone programming for frictional contact
// mechanics using interior point algorithm" (2023).
//
// Differs from the paper in: the paper's problem is the convex one; here the shift is linearised
// with the rest. Rolling and spin have cones of their own (methods/product_interior_point.hpp), of
// which only the sum of the normal parts is known. Their path has no smoothing. The system is
// regularised, and condensed to the contacts or the bodies. It starts near the guess, well inside
// the cones. When its steps end, sweeps of Gauss-Seidel follow
// (`sweeps`). The reason: the scaling contains the gap mu r_N - ||r_T|| of sliding contacts, which
// falls below the rounding of r. If a direction of sliding is wrong by e, the gap changes only by
// e^2 / 2. So the direction is known to 1e-6 or 1e-7, and the interior point cannot improve it.
//
// The problem is not convex: the path may fold, and the method then ends `stalled`.

#include "methods/product_interior_point.hpp"
#include "methods/shared_options.hpp"
#include "reduced/gauss_seidel.hpp"
#include "solve/best_iterate.hpp"
#include "solve/by_cone.hpp"
#include "solve/solver.hpp"

namespace fclib::nsip {

namespace {

struct Options : InteriorPointRules {
  std::int64_t sweeps = 100;

  Options() { tau = 10; }  // from r = 0 it solves a few more than with 1

  static constexpr auto fields() {
    using O = Options;
    return std::tuple_cat(InteriorPointRules::fields(),
                          std::tuple{patience_option(), smoothing_option(),
                                     option("sweeps", &O::sweeps, "sweeps", {0, 1e6},
                                            "The largest number of sweeps of Gauss-Seidel after "
                                            "the last step of the interior point.")});
  }
};

template <class Cone>
Outcome iterate(const ReducedProblem& problem, const Options& options, const Settings& settings,
                Vector& r) {
  BestIterate<Cone> best(problem, settings, r);
  Vector u(problem.m());
  problem.velocity(r, u);
  if (best.report(0, r, u)) return best.outcome(r);

  CoupledSystem system(problem);
  typename InteriorPointFor<Cone>::type method(problem, system);
  InteriorPointRules rules = options;
  rules.max_iterations = std::numeric_limits<int>::max();
  method.solve(rules, Vector(r), [&](double error, const Vector& at) {
    return best.report(method.iterations() > 0 ? 1 : 0, at, error);
  });
  if (best.stopped()) return best.outcome(r);

  best.outcome(r);
  problem.velocity(r, u);
  GaussSeidel<Cone> contacts(problem);
  for (std::int64_t sweep = 0; sweep < options.sweeps && !best.stopped(); ++sweep) {
    contacts.sweep(r, u);
    best.report(1, r, u);
  }
  return best.outcome(r);
}

}  // namespace

const Solver& solver() {
  static const Solver entry{
      .name = "nsip",
      .family = "interior point",
      .title = "Nonsmooth interior point for Coulomb's law",
      .citation =
          "Acary, Armand, Nguyen & Shpakovych 2023, with de Saxce's term in Newton's system",
      .dimensions = {2, 3},
      .rolling_dimensions = {3, 5},
      .spin_dimensions = {4, 6},
      .options = describe_options<Options>(),
      .max_iterations = 1000,
      .solve = by_cone<Options>([]<class Cone>(auto&... all) { return iterate<Cone>(all...); }),
  };
  return entry;
}

}  // namespace fclib::nsip
