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
// - the shift follows the iterates, so that Coulomb's law is solved instead of the convex
//   relaxation. The objective moves with it: the remembered values are corrected by s.r at the
//   current iterate. shift = none is the convex relaxation, which is not Coulomb's law where
//   anything slides: the error says so, and the solver ends as stalled when it has it;
// - inner products have the weights tr(W_aa) / d, so that masses may differ;
// - W d is known from the line search: an iteration costs one product with W.

#include <algorithm>
#include <array>
#include <cstdint>

#include "methods/shared_options.hpp"
#include "reduced/convex_residual.hpp"
#include "reduced/convex_sets.hpp"
#include "reduced/de_saxce_shift.hpp"
#include "reduced/scale.hpp"
#include "reduced/with_cone.hpp"
#include "solve/best_iterate.hpp"

namespace fclib::bb {

namespace {

enum class Step { longest, shortest, alternating };
constexpr std::array<std::string_view, 3> steps{"long", "short", "alternating"};

struct Options {
  Shift shift = Shift::iterated;
  Step step = Step::alternating;
  std::int64_t memory = 10;
  double decrease = 1e-4;
  bool weights = true;

  static constexpr auto fields() {
    using O = Options;
    return std::tuple{
        shift_field<O>(),
        OptionField<O, Step>{.name = "step",
                             .member = &O::step,
                             .doc = "which of the two steps of Barzilai and Borwein",
                             .choices = steps},
        OptionField<O, std::int64_t>{.name = "memory",
                                     .member = &O::memory,
                                     .unit = "iterations",
                                     .doc = "whose objective the line search may rise to; 1 makes "
                                            "it monotone",
                                     .lowest = 1,
                                     .highest = 1000},
        OptionField<O, double>{.name = "decrease",
                               .member = &O::decrease,
                               .unit = "1",
                               .doc = "share of the predicted decrease that is asked for",
                               .lowest = 0,
                               .highest = 0.5},
        OptionField<O, bool>{.name = "weights",
                             .member = &O::weights,
                             .doc = "a metric for each contact by its own block of W, else the "
                                    "same for all"},
    };
  }
};

constexpr double least_step = 1e-6;
constexpr double greatest_step = 1e6;

/// The next alpha, from the last step: pp = <dr, dr>, pw = <dr, W dr>, ww = <W dr, W dr>.
double next_step(Step step, std::int64_t k, double pp, double pw, double ww) {
  if (!(pp > 0 && pw > 0)) return greatest_step;
  const bool short_one = step == Step::shortest || (step == Step::alternating && k % 2 == 0);
  return std::clamp(short_one ? pw / ww : pp / pw, least_step, greatest_step);
}

template <class Cone>
Outcome iterate(const ReducedProblem& problem, const Options& options, const Settings& settings,
                Vector& r) {
  constexpr int D = Cone::dim;
  using Vec = typename Cone::Vec;
  const Index nc = problem.nc();
  const Cones<Cone> cones(problem.friction);
  BestIterate<Cone> best(problem, settings, r);
  Vector u(problem.m());
  problem.velocity(r, u);
  if (best.report(0, r, u)) return best.outcome(r);

  Vector weight = contact_weights(problem);
  if (!options.weights) weight.setConstant(nc > 0 ? weight.mean() : 1.0);
  Vector shift = Vector::Zero(nc);
  Vector last_shift = shift;
  Vector d(problem.m());
  Vector wd(problem.m());
  const Vector zero = Vector::Zero(problem.m());
  std::vector<double> values(static_cast<std::size_t>(options.memory), -1e300);
  double value = 0;  // of the objective, but for a constant
  values[0] = value;
  double alpha = 1;
  for (std::int64_t k = 1;; ++k) {
    if (options.shift == Shift::iterated) {
      last_shift.swap(shift);
      de_saxce_shift<Cone>(u, problem.friction, shift);
      if (k == 1) last_shift = shift;
      // the objective of before, with the new shift
      double moved = 0;
      for (Index a = 0; a < nc; ++a) moved += (shift[a] - last_shift[a]) * r[D * a];
      for (double& past : values) past += moved;
      value += moved;
    }
    double slope = 0;
    double pp = 0;
    for (Index a = 0; a < nc; ++a) {
      Vec g = u.template segment<D>(D * a);
      g[0] += shift[a];
      const Vec now = r.template segment<D>(D * a);
      const Vec step = cones.project(a, now - (alpha / weight[a]) * g, now) - now;
      d.template segment<D>(D * a) = step;
      slope += g.dot(step);
      pp += weight[a] * step.squaredNorm();
    }
    problem.W.multiply_add(d, zero, wd);
    const double pw = d.dot(wd);
    double ww = 0;
    for (Index a = 0; a < nc; ++a) ww += wd.template segment<D>(D * a).squaredNorm() / weight[a];

    // along d the objective is the parabola slope lambda + pw lambda^2 / 2
    double lambda = 1;
    const double highest = *std::max_element(values.begin(), values.end());
    if (value + slope + 0.5 * pw > highest + options.decrease * slope && pw > 0) {
      lambda = std::clamp(-slope / pw, 1e-3, 1.0);
    }
    r += lambda * d;
    u += lambda * wd;
    value += lambda * (slope + 0.5 * lambda * pw);
    values[static_cast<std::size_t>(k % options.memory)] = value;
    alpha = next_step(options.step, k, pp, pw, ww);

    if (k % 100 == 0) problem.velocity(r, u);
    if (best.report(1, r, u)) return best.outcome(r);
    if (options.shift == Shift::none &&
        convex_residual(problem, cones, shift, r, u) <= best.tolerance()) {
      return best.outcome(r);  // solved, and not Coulomb's law
    }
  }
}

Outcome solve(const ReducedProblem& problem, const OptionValues& values, const Settings& settings,
              Vector& r) {
  const auto options = parse_options<Options>(values);
  return with_cone(problem,
                   [&]<class Cone>() { return iterate<Cone>(problem, options, settings, r); });
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
      .solve = solve,
  };
  return entry;
}

}  // namespace fclib::bb
