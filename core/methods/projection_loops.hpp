// What the projection methods share: the loops of those with a self-adaptive step, which differ
// only in their step rule; their options; and the entry of each of them in the registry.
//
// Algorithms 1, 2 and 3 of Acary, Bremond, Huber, "On solving contact problems with Coulomb
// friction: formulations and numerical comparisons" (2018).
//
// Differs from the paper in: each contact may have a step of its own, rho over the mean diagonal of
// W_aa (`metric`); F of the last point is kept for the next iteration and for the error; the step
// may grow even if the error did not fall.
#pragma once

#include <functional>
#include <string>
#include <utility>

#include "methods/self_adaptive_step.hpp"
#include "methods/variational_inequality.hpp"
#include "solve/iterates.hpp"

namespace fclib {

/// The fields of StepOptions, as members of a struct derived from it.
template <class O>
constexpr auto step_fields() {
  return std::tuple{
      choice("metric", &O::metric, metrics, metric_doc),
      option("rho", &O::rho, "1/W_aa", {1e-12, 1e12}, "The first step."),
      option("tau", &O::tau, "1", {0.01, 0.99},
             "The step shrinks by this factor, and grows by its inverse."),
      option("ratio_high", &O::ratio_high, "1", {1e-3, 1},
             "L: the step shrinks while its ratio is above this."),
      option("ratio_low", &O::ratio_low, "1", {0, 1},
             "L_min: the step grows if its ratio is below this."),
  };
}

struct StepOptions {
  Metric metric = Metric::contact;
  double rho = 1.0;
  double tau = 2.0 / 3.0;
  double ratio_high = 0.9;
  double ratio_low = 0.3;

  [[nodiscard]] StepRule rule() const { return {rho, tau, ratio_high, ratio_low}; }

  static constexpr auto fields() { return step_fields<StepOptions>(); }
};

enum class SecondProjection { trial, start };
inline constexpr std::array<std::string_view, 2> second_projections{"trial", "start"};

struct ExtragradientOptions : StepOptions {
  SecondProjection second = SecondProjection::trial;

  static constexpr auto fields() {
    using O = ExtragradientOptions;
    return std::tuple_cat(
        step_fields<O>(),
        std::tuple{
            choice("second", &O::second, second_projections,
                   "Where the second projection starts: at the trial point, as in Siconos, or at "
                   "the start of the iteration, as in Korpelevich's and in the paper.")});
  }
};

/// repeat  z <- P_K(z_k - rho F(z_k))  until rho is accepted;  z_k+1 = z
///
/// One product with W in each iteration, and one more each time rho shrinks.
Outcome fixed_point(StepRatio ratio, const ReducedProblem& problem, const StepOptions& options,
                    Iterates& iterates, const Vector& start);

/// repeat  z <- P_K(z_k - rho F(z_k))  until rho is accepted;  z_k+1 = P_K(z_k - rho F(z)), or,
/// with `second` = trial, P_K(z - rho F(z))
///
/// Two products with W in each iteration, and one more each time rho shrinks.
Outcome extragradient(StepRatio ratio, const ReducedProblem& problem,
                      const ExtragradientOptions& options, Iterates& iterates, const Vector& start);

/// The entry of a method with the loop `loop(problem, options, iterates, start)`.
template <class Options>
Solver projection_entry(
    std::string name, std::string title, std::string citation,
    std::function<Outcome(const ReducedProblem&, const Options&, Iterates&, const Vector& start)>
        loop) {
  return {
      .name = std::move(name),
      .family = "variational inequality",
      .title = std::move(title),
      .citation = std::move(citation) + "; Acary, Bremond & Huber 2018",
      .dimensions = {2, 3},
      .rolling_dimensions = {3, 5},
      .options = describe_options<Options>(),
      .max_iterations = 1'000'000,
      .solve =
          [loop = std::move(loop)](const ReducedProblem& problem, const OptionValues& values,
                                   const Settings& settings, Vector& r) {
            const Vector start = r;
            Iterates iterates(settings, r);
            return loop(problem, parse_options<Options>(values), iterates, start);
          },
  };
}

}  // namespace fclib
