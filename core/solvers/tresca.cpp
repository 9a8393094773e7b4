// Tresca: a fixed point on the threshold of friction.
//
//   g <- mu r_N
//   r <- argmin 1/2 r.W r + q.r  over  r_N >= 0, ||r_T|| <= g      (a convex problem on cylinders)
//
// Panagiotopoulos (1975); Haslinger, "Approximation of the Signorini problem with friction, obeying
// the Coulomb law" (1983); section 5.2 of Acary, Bremond, Huber, "On solving contact problems with
// Coulomb friction: formulations and numerical comparisons" (2018): TFP.
//
// Differs from the papers in:
// - the inner problem is solved to a share of the current error of Coulomb's law, but no further.
//   It starts from the last solution;
// - if 50 steps bring no lower error, the relaxation is halved, down to an eighth;
// - rolling friction has a threshold of its own.

#include <cstdint>

#include "methods/convex_program.hpp"
#include "methods/relaxation.hpp"
#include "methods/shared_options.hpp"
#include "solve/best_iterate.hpp"
#include "solve/by_cone.hpp"

namespace fclib::tresca {

namespace {

struct Options : FixedPointOptions {
  Options() { local_iterations = 5; }

  ConvexMethod inner = ConvexMethod::projected_gradient;

  static constexpr auto fields() {
    using O = Options;
    return std::tuple_cat(std::tuple{choice("inner", &O::inner, convex_methods,
                                            "The solver of the convex problem on cylinders.")},
                          fixed_point_fields<O>());
  }
};

template <class Cone>
Outcome iterate(const ReducedProblem& problem, const Options& options, const Settings& settings,
                Vector& r) {
  Cylinders<Cone> cylinders(problem.friction);
  ConvexProgram<Cylinders<Cone>> program(problem);
  BestIterate<Cone> best(problem, settings, r);
  Vector u(problem.m());
  problem.velocity(r, u);
  best.report(0, r, u);
  const auto due = [&](std::int64_t count) { return best.due(count); };
  const auto follow = [&](std::int64_t count, const Vector& reaction, const Vector& velocity) {
    return best.report(count, reaction, velocity);
  };
  cylinders.set_thresholds(r);
  Relaxation relaxation(options.relaxation);
  while (!best.stopped()) {
    const std::int64_t before = best.iterations();
    program.solve(options.inner, cylinders, static_cast<int>(options.local_iterations),
                  options.inner_accuracy * best.last_error(), options.inner_iterations, r, u, due,
                  follow);
    if (best.iterations() == before) break;  // nothing could be done
    cylinders.set_thresholds(r, relaxation.next(best.last_error()));
    problem.velocity(r, u);
  }
  return best.outcome(r);
}

}  // namespace

const Solver& solver() {
  static const Solver entry{
      .name = "tresca",
      .family = "optimisation",
      .title = "Fixed point on the friction threshold",
      .citation = "Panagiotopoulos 1975; Haslinger 1983; Acary, Bremond & Huber 2018",
      .dimensions = {2, 3},
      .rolling_dimensions = {3, 5},
      .options = describe_options<Options>(),
      .max_iterations = 1'000'000,
      .solve = by_cone<Options>([]<class Cone>(auto&... all) { return iterate<Cone>(all...); }),
  };
  return entry;
}

}  // namespace fclib::tresca
