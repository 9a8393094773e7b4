// FP-EG-UPTS: extragradient projections on the variational inequality, with the step rule of
// Solodov & Tseng.
//
//   repeat  z <- P_K(z_k - rho F(z_k)),  F(r) = u^, u = W r + q
//   until   rho (z - z_k) . (F(z) - F(z_k)) <= L ||z - z_k||^2, else rho <- tau rho
//   z_k+1 = P_K(z_k - rho F(z));  rho <- rho / tau where it holds with L_min for L
//
// Korpelevich, "The extragradient method for finding saddle points and other problems" (1976);
// algorithms 2 and 3 of Acary, Bremond, Huber, "On solving contact problems with Coulomb friction:
// formulations and numerical comparisons" (2018); the rule of
// Solodov & Tseng, "Modified projection-type methods for monotone variational inequalities" (1996).
//
// Differs from the paper in: each contact may have a step of its own, rho over the mean diagonal of
// W_aa (`metric`); F(z_k+1) is kept for the next iteration and for the error, so that an iteration
// costs two products with W, and one more where rho shrinks; the step grows whether or not the
// error fell.

#include <utility>

#include "kernels/self_adaptive_step.hpp"
#include "kernels/variational_inequality.hpp"
#include "kernels/with_cone.hpp"
#include "solve/iterates.hpp"
#include "solve/step_options.hpp"

namespace fclib::fp_eg_upts {

namespace {

template <class Cone>
Outcome iterate(const Delassus& problem, const StepOptions& options, Iterates& iterates,
                const Vector& start) {
  const VariationalInequality<Cone> vi(problem, options.metric);
  SelfAdaptiveStep step(options.rule());
  VelocityPoint z_k = vi.point(start);
  VelocityPoint z = z_k;
  VelocityPoint next = z_k;
  vi.evaluate(z_k);
  if (const auto end = iterates.visit(0, vi.error(z_k), z_k.r)) return *end;

  for (std::int64_t k = 1;; ++k) {
    step.search([&](double rho) {
      vi.project(z_k.r, rho, z_k.hat, z);
      vi.evaluate(z);
      return vi.solodov_tseng(z, z_k);
    });
    vi.project(z_k.r, step.rho(), z.hat, next);
    vi.evaluate(next);
    std::swap(z_k, next);
    step.update();
    if (const auto end = iterates.visit(k, vi.error(z_k), z_k.r)) return *end;
  }
}

Outcome solve(const Delassus& problem, const OptionValues& values, const Settings& settings,
              Vector& r) {
  const auto options = parse_options<StepOptions>(values);
  const Vector start = r;
  Iterates iterates(settings, r);
  return with_cone(problem,
                   [&]<class Cone>() { return iterate<Cone>(problem, options, iterates, start); });
}

}  // namespace

const Solver& solver() {
  static const Solver entry{
      .name = "fp-eg-upts",
      .family = "variational inequality",
      .title = "Extragradient projection, step rule of Solodov & Tseng",
      .citation = "Korpelevich 1976; Solodov & Tseng 1996; Acary, Bremond & Huber 2018",
      .dimensions = {2, 3},
      .rolling_dimensions = {3, 5},
      .options = describe_options<StepOptions>(),
      .max_iterations = 1'000'000,
      .check_options = [](const OptionValues& values) { parse_options<StepOptions>(values); },
      .solve = solve,
  };
  return entry;
}

}  // namespace fclib::fp_eg_upts
