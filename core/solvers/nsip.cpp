// NSIP: a nonsmooth interior point method for Coulomb's law, the shift mu ||u_T|| inside Newton's
// system.
//
//   x = (mu r_N, r_T),  y = (u^_N / mu, u_T),  x o y = tau e,  tau -> 0
//   u = W r + q,  u^ = u + [mu ||u_T||, 0, 0]
//
// Nesterov & Todd's scaling, Mehrotra's predictor and corrector (kernels/interior_point.hpp).
//
// Acary, Armand, Nguyen, Shpakovych, "Second order cone programming for frictional contact
// mechanics using interior point algorithm" (2023).
//
// Differs from the paper in: the paper's problem is the convex one, here the shift is linearised
// with the rest; the system is regularised, and condensed to the contacts or the bodies. It starts
// inside the cones: of a guess it only asks whether it will do already.
//
// The problem is not convex: the path may fold, and the method then ends `stalled`; so it does
// where the last digits of contacts at rest are lost in the scaling, at errors of 1e-6 to 1e-11.

#include "kernels/interior_point.hpp"
#include "solve/shared_options.hpp"
#include "solve/solver.hpp"

namespace fclib::nsip {

namespace {

struct Options : InteriorPointRules {
  static constexpr auto fields() {
    using O = Options;
    return std::tuple_cat(interior_point_fields<O>(),
                          std::tuple{OptionField<O, int>{.name = "patience",
                                                         .member = &O::patience,
                                                         .unit = "iterations",
                                                         .doc = "in which the error must halve",
                                                         .lowest = 1,
                                                         .highest = 1e6}});
  }
};

template <int D>
Outcome iterate(const Delassus& problem, InteriorPointRules rules, const Settings& settings,
                Vector& r) {
  Monitor monitor(settings);
  Vector u;
  problem.velocity(r, u);
  double best = std::sqrt(natural_map_squared<Coulomb<D>>(u, r, problem.friction)) / problem.scale;
  if (const auto stop = monitor.report(0, best)) return {*stop, 0};

  CoupledSystem system(problem);
  InteriorPoint<D> method(problem, system);
  rules.max_iterations = std::numeric_limits<int>::max();
  std::optional<Status> stopped;
  method.solve(rules, [&](double error, const Vector& at) {
    if (error < best) {
      best = error;
      r = at;
    }
    stopped = monitor.report(method.iterations(), error);
    return stopped.has_value();
  });
  return {stopped.value_or(Status::stalled), method.iterations()};
}

Outcome solve(const Delassus& problem, const OptionValues& values, const Settings& settings,
              Vector& r) {
  const auto options = parse_options<Options>(values);
  return problem.d() == 2 ? iterate<2>(problem, options, settings, r)
                          : iterate<3>(problem, options, settings, r);
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
      .rolling_dimensions = {},
      .options = describe_options<Options>(),
      .max_iterations = 1000,
      .check_options = [](const OptionValues& values) { parse_options<Options>(values); },
      .solve = solve,
  };
  return entry;
}

}  // namespace fclib::nsip
