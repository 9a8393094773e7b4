// PSOR: projected successive over-relaxation, Gauss-Seidel with the splitting W_aa / omega.
//
//   for each contact a:  b = u^a - (W_aa / omega) r^a
//                        r^a <- solution of the one-contact problem (W_aa / omega, b)
//                        u <- u + W(:, a) (r^a - r^a_old)
//
// Cryer, "The solution of a quadratic programming problem using systematic overrelaxation" (1971);
// Mangasarian, "Solution of symmetric linear complementarity problems by iterative methods" (1977);
// algorithm 4 of Acary, Bremond, Huber, "On solving contact problems with Coulomb friction:
// formulations and numerical comparisons" (2018), with the splitting of its section on relaxation.
//
// Differs from the papers in: the relaxation is inside the one-contact problem, so that every
// iterate is in the cone without a projection after it (nsgs has the average of old and new).
// Columns of W keep the velocities up to date. With `threads` above 1 it sweeps colour by colour,
// as in nsgs.
//
// Without friction, over-relaxed sweeps converge. With friction, they may cycle even if those with
// omega = 1 converge.

#include <cstdint>

#include "methods/shared_options.hpp"
#include "reduced/sweeps.hpp"
#include "solve/best_iterate.hpp"
#include "solve/by_cone.hpp"
#include "solve/schedule.hpp"

namespace fclib::psor {

namespace {

struct Options : SweepOptions {
  double omega = 1.1;

  static constexpr auto fields() {
    using O = Options;
    return std::tuple_cat(
        std::tuple{option("omega", &O::omega, "1", {1e-3, 1.999},
                          "The relaxation. Above 1 it is over-relaxed; 1 is nsgs.")},
        sweep_fields<O>());
  }
};

template <class Cone>
Outcome iterate(const ReducedProblem& problem, const Options& options, const Settings& settings,
                Vector& r) {
  BestIterate<Cone> best(problem, settings, r);
  Vector u(problem.m());
  problem.velocity(r, u);
  if (best.report(0, r, u)) return best.outcome(r);

  Sweeps<Cone> contacts(problem, options.threads, options.omega);
  const auto step = options.local_step<Cone>();
  Schedule schedule(options.error_interval, best.tolerance());
  for (std::int64_t sweep = 1;; ++sweep) {
    if (options.symmetric && sweep > 1) contacts.reverse();
    contacts.sweep([&](Index a) { contacts.update(a, r, u, step); });

    const std::int64_t count = sweep - best.iterations();
    if (!schedule.due(sweep)) {
      if (best.due(count) && best.glance(count, r)) return best.outcome(r, contacts.cpu_s());
      continue;
    }
    problem.velocity(r, u);  // removes the rounding of the updates
    if (best.report(count, r, u)) return best.outcome(r, contacts.cpu_s());
    schedule.evaluated(sweep, best.last_error());
  }
}

}  // namespace

const Solver& solver() {
  static const Solver entry{
      .name = "psor",
      .family = "splitting",
      .title = "Projected successive over-relaxation",
      .citation = "Cryer 1971; Mangasarian 1977; Acary, Bremond & Huber 2018",
      .dimensions = {2, 3},
      .rolling_dimensions = {3, 5},
      .options = describe_options<Options>(),
      .max_iterations = 1'000'000,
      .solve = by_cone<Options>([]<class Cone>(auto&... all) { return iterate<Cone>(all...); }),
  };
  return entry;
}

}  // namespace fclib::psor
