// Homotopy: the central path of Coulomb's law, from a convex problem, by its arclength.
//
// methods/homotopy.hpp has the path and its sources. It is slow and reliable: if an interior point
// stops at a fold of its path, this method goes around the fold. The proximal Newton method gives
// the last digits.

#include "methods/homotopy.hpp"
#include "methods/proximal_point.hpp"
#include "reduced/relative_error.hpp"
#include "solve/by_cone.hpp"
#include "solve/solver.hpp"

namespace fclib::homotopy {

namespace {

struct Options : HomotopyRules {
  double polish_below = 1e-5;

  static constexpr auto fields() {
    using O = Options;
    return std::tuple{option("smoothing", &O::smoothing, "1", {1e-3, 100},
                             "The width of the smoothed kink of de Saxce's term, over the velocity "
                             "on the path of a contact that sticks."),
                      option("stride", &O::stride, "1", {1e-3, 10},
                             "The longest step of a contact, in the metric of its barrier."),
                      option("accuracy", &O::accuracy, "1", {1e-10, 0.5},
                             "How near a point must be to the path, in the metric of the barrier."),
                      option("cosine", &O::cosine, "1", {0, 0.99},
                             "The least cosine between the directions of the path at two points."),
                      option("polish_below", &O::polish_below, "1", {0},
                             "The proximal Newton method is tried if the error is below this.")};
  }
};

template <class Cone>
Outcome iterate(const ReducedProblem& problem, Options options, const Settings& settings,
                Vector& r) {
  Monitor monitor(settings);
  Vector u;
  problem.velocity(r, u);
  double best = relative_error<Cone>(problem, u, r);
  if (const auto stop = monitor.report(0, best, &r)) return {*stop, 0};

  CoupledSystem system(problem);
  Homotopy<Cone> method(problem, system);
  ProximalPoint<Cone> newton(problem, system);
  options.max_factorisations = std::numeric_limits<std::int64_t>::max() / 2;
  std::int64_t iterations = 0;
  double next_polish = options.polish_below;
  std::optional<Status> stopped;
  const auto take = [&](double error, const Vector& at) {
    if (error < best) {
      best = error;
      r = at;
    }
    stopped = monitor.report(++iterations, error, &r);
    return stopped.has_value();
  };
  const auto polish = [&](std::int64_t factorisations) {
    Vector polished = r;
    const double reached =
        newton.solve({.kappa = 100, .easy = 10, .hard = 0.2, .max_factorisations = factorisations},
                     settings.tolerance, polished, [](double) { return false; });
    return take(reached, polished);
  };
  method.solve(options, [&](double error, const Vector& at) {
    if (take(error, at)) return true;
    if (error > next_polish) return false;
    next_polish = error / 10;
    return polish(12);
  });
  if (!stopped) polish(200);
  return {stopped.value_or(Status::stalled), iterations};
}

}  // namespace

const Solver& solver() {
  static const Solver entry{
      .name = "homotopy",
      .family = "interior point",
      .title = "The central path from a convex problem, by arclength",
      .citation = "Chow, Mallet-Paret & Yorke 1978; Keller 1977; the path is this project's",
      .dimensions = {2, 3},
      .rolling_dimensions = {3, 5},
      .spin_dimensions = {4, 6},
      .options = describe_options<Options>(),
      .max_iterations = 100000,
      .solve = by_cone<Options>([]<class Cone>(auto&... all) { return iterate<Cone>(all...); }),
  };
  return entry;
}

}  // namespace fclib::homotopy
