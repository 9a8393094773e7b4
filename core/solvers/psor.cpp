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
// iterate is in the cone without a projection after it (nsgs has the average of old and new);
// velocities are kept up to date by columns.
//
// Over-relaxed sweeps converge without friction; with it they may cycle where omega = 1 converges.

#include "kernels/gauss_seidel.hpp"
#include "kernels/local_step.hpp"
#include "kernels/natural_error.hpp"
#include "kernels/schedule.hpp"
#include "kernels/with_cone.hpp"
#include "solve/solver.hpp"

namespace fclib::psor {

namespace {

struct Options {
  double omega = 1.1;
  LocalSolver local_solver = LocalSolver::exact;
  std::int64_t local_iterations = 10;
  double local_accuracy = 1e-14;
  bool symmetric = false;
  std::int64_t error_interval = 0;

  static constexpr auto fields() {
    using O = Options;
    return std::tuple{
        OptionField<O, double>{.name = "omega",
                               .member = &O::omega,
                               .unit = "1",
                               .doc = "relaxation; above 1 over-relaxed, 1 is nsgs",
                               .lowest = 1e-3,
                               .highest = 1.999},
        OptionField<O, LocalSolver>{.name = "local_solver",
                                    .member = &O::local_solver,
                                    .doc = local_solvers_doc,
                                    .choices = local_solvers},
        OptionField<O, std::int64_t>{
            .name = "local_iterations",
            .member = &O::local_iterations,
            .unit = "1",
            .doc = "limit of the iterations of the projection or of Newton",
            .lowest = 1,
            .highest = 1e6},
        OptionField<O, double>{.name = "local_accuracy",
                               .member = &O::local_accuracy,
                               .unit = "1",
                               .doc = "relative step at which the projection stops, relative "
                                      "residual of Newton",
                               .lowest = 0,
                               .highest = 1},
        OptionField<O, bool>{.name = "symmetric",
                             .member = &O::symmetric,
                             .doc = "every second sweep runs backwards (SSOR)"},
        OptionField<O, std::int64_t>{
            .name = "error_interval",
            .member = &O::error_interval,
            .unit = "sweeps",
            .doc = "sweeps between evaluations of the error; 0 adapts it to the convergence",
            .lowest = 0},
    };
  }
};

template <class Cone>
Outcome iterate(const Delassus& problem, const Options& options, Monitor& monitor, Vector& r) {
  GaussSeidel<Cone> contacts(problem, options.omega);
  const LocalStep<Cone> step{options.local_solver, options.local_accuracy,
                             static_cast<int>(options.local_iterations)};
  Vector u(problem.m());
  const auto error = [&] {
    return std::sqrt(natural_map_squared<Cone>(u, r, problem.friction)) / problem.scale;
  };
  problem.velocity(r, u);
  double best_error = error();
  Vector best = r;
  if (const auto stop = monitor.report(0, best_error)) return {*stop, 0};

  Schedule schedule(options.error_interval, monitor.tolerance());
  for (std::int64_t sweep = 1;; ++sweep) {
    const bool backwards = options.symmetric && sweep % 2 == 0;
    for (Index a = 0; a < problem.nc(); ++a) {
      contacts.update(backwards ? problem.nc() - 1 - a : a, r, u, step);
    }
    if (!schedule.due(sweep) && sweep < monitor.max_iterations() &&
        !(sweep % 16 == 0 && monitor.due())) {
      continue;
    }
    problem.velocity(r, u);  // takes out the rounding of the updates
    const double current = error();
    if (current <= best_error) {
      best_error = current;
      best = r;
    }
    if (const auto stop = monitor.report(sweep, current)) {
      r = best;
      return {*stop, sweep};
    }
    schedule.evaluated(sweep, current);
  }
}

Outcome solve(const Delassus& problem, const OptionValues& values, const Settings& settings,
              Vector& r) {
  const auto options = parse_options<Options>(values);
  Monitor monitor(settings);
  return with_cone(problem,
                   [&]<class Cone>() { return iterate<Cone>(problem, options, monitor, r); });
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
      .check_options = [](const OptionValues& values) { parse_options<Options>(values); },
      .solve = solve,
  };
  return entry;
}

}  // namespace fclib::psor
