#include "methods/newton_loop.hpp"

#include <utility>

#include "reduced/relative_error.hpp"
#include "reduced/with_cone.hpp"

namespace fclib {

namespace {

Outcome run_newton(const ReducedProblem& problem, ContactFunctionKind function,
                   const NewtonRules& rules, const Settings& settings, Vector& r) {
  return with_cone(problem, [&]<class Cone>() -> Outcome {
    Monitor monitor(settings);
    Vector u;
    problem.velocity(r, u);
    const double error = relative_error<Cone>(problem, u, r);
    if (const auto stop = monitor.report(0, error, &r)) return {*stop, 0};

    SemismoothNewton<Cone> newton(problem, function);
    std::int64_t iterations = 0;
    std::optional<Status> stopped;
    const NewtonEnd end = newton.solve(rules, r, [&](double at) {
      stopped = monitor.report(++iterations, at, &r);
      return stopped.has_value();
    });
    const Status otherwise = end == NewtonEnd::not_finite ? Status::diverged : Status::stalled;
    return {stopped.value_or(otherwise), iterations};
  });
}

}  // namespace

Solver newton_entry(std::string name, std::string title, std::string citation,
                    std::vector<int> rolling_dimensions, ContactFunctionKind function) {
  return {
      .name = std::move(name),
      .family = "newton",
      .title = std::move(title),
      .citation = std::move(citation) + "; Acary, Bremond & Huber 2018",
      .dimensions = {2, 3},
      .rolling_dimensions = std::move(rolling_dimensions),
      .options = describe_options<NewtonOptions>(),
      .max_iterations = 10'000,
      .solve =
          [function](const ReducedProblem& problem, const OptionValues& values,
                     const Settings& settings, Vector& r) {
            return run_newton(problem, function, parse_options<NewtonOptions>(values), settings, r);
          },
  };
}

}  // namespace fclib
