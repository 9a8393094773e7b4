// Associated: the convex relaxation, in which u itself lies in the dual cone. NOT Coulomb's law.
//
//   K* contains u,  u . r = 0,  r in K,  u = W r + q
//
// A contact that slides by u_T also opens by mu ||u_T||. The problem is convex. If it has a Slater
// point, the interior point method (methods/interior_point.hpp) solves it. Its reactions obey
// Coulomb's law only if nothing slides. The error is that of Coulomb's law, so it shows what the
// relaxation costs.
//
// Acary, Armand, Nguyen, Shpakovych, "Second order cone programming for frictional contact
// mechanics using interior point algorithm" (2023).
//
// Differs from the paper in: the system is regularised, and condensed to the contacts or the
// bodies. It starts near the guess, well inside the cones.
//
// Ends `inaccurate` with the solution of the relaxation, to the tolerance. That solution is
// returned even if an earlier iterate was nearer to Coulomb's law.

#include "methods/interior_point.hpp"
#include "methods/shared_options.hpp"
#include "reduced/relative_error.hpp"
#include "solve/solver.hpp"

namespace fclib::associated {

namespace {

using Options = InteriorPointRules;

/// The complementarity and the residual at the end, over the tolerance.
constexpr double share = 0.1;

template <int D>
Outcome iterate(const ReducedProblem& problem, InteriorPointRules rules, const Settings& settings,
                Vector& r) {
  Monitor monitor(settings);
  Vector u;
  problem.velocity(r, u);
  const double first = relative_error<Coulomb<D>>(problem, u, r);
  if (const auto stop = monitor.report(0, first, &r)) return {*stop, 0};

  CoupledSystem system(problem);
  InteriorPoint<D> method(problem, system);
  rules.associated = true;
  rules.max_iterations = std::numeric_limits<int>::max();
  rules.patience = std::numeric_limits<int>::max();  // its error need not fall
  std::optional<Status> stopped;
  bool solved = false;
  method.solve(rules, Vector(r), [&](double error, const Vector& at) {
    if (at.allFinite()) r = at;
    solved = method.tau() <= share * monitor.tolerance() &&
             method.residual() <= share * monitor.tolerance();
    stopped = monitor.report(method.iterations(), error, &r);
    return stopped.has_value() || solved;
  });
  return {stopped.value_or(solved ? Status::inaccurate : Status::stalled), method.iterations()};
}

Outcome solve(const ReducedProblem& problem, const OptionValues& values, const Settings& settings,
              Vector& r) {
  const auto options = parse_options<Options>(values);
  return problem.d() == 2 ? iterate<2>(problem, options, settings, r)
                          : iterate<3>(problem, options, settings, r);
}

}  // namespace

const Solver& solver() {
  static const Solver entry{
      .name = "associated",
      .family = "relaxation",
      .title = "Convex relaxation by interior point: does not solve Coulomb's law",
      .citation = "Acary, Armand, Nguyen & Shpakovych 2023",
      .dimensions = {2, 3},
      .rolling_dimensions = {},
      .options = describe_options<Options>(),
      .max_iterations = 1000,
      .solve = solve,
  };
  return entry;
}

}  // namespace fclib::associated
