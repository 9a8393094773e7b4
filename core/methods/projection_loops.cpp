#include "methods/projection_loops.hpp"

#include <utility>

#include "reduced/with_cone.hpp"

namespace fclib {

Outcome fixed_point(StepRatio ratio, const ReducedProblem& problem, const StepOptions& options,
                    Iterates& iterates, const Vector& start) {
  return with_cone(problem, [&]<class Cone>() -> Outcome {
    const VariationalInequality<Cone> vi(problem, options.metric);
    SelfAdaptiveStep step(options.rule());
    VelocityPoint z_k = vi.point(start);
    VelocityPoint z = z_k;
    vi.evaluate(z_k);
    if (const auto end = iterates.visit(0, z_k.r, [&] { return vi.error(z_k); })) return *end;

    for (std::int64_t k = 1;; ++k) {
      step.search([&](double rho) {
        vi.project(z_k.r, rho, z_k.hat, z);
        vi.evaluate(z);
        return vi.ratio(ratio, z, z_k);
      });
      std::swap(z_k, z);
      step.update();
      if (const auto end = iterates.visit(k, z_k.r, [&] { return vi.error(z_k); })) return *end;
    }
  });
}

Outcome extragradient(StepRatio ratio, const ReducedProblem& problem,
                      const ExtragradientOptions& options, Iterates& iterates,
                      const Vector& start) {
  return with_cone(problem, [&]<class Cone>() -> Outcome {
    const VariationalInequality<Cone> vi(problem, options.metric);
    SelfAdaptiveStep step(options.rule());
    VelocityPoint z_k = vi.point(start);
    VelocityPoint z = z_k;
    VelocityPoint next = z_k;
    vi.evaluate(z_k);
    if (const auto end = iterates.visit(0, z_k.r, [&] { return vi.error(z_k); })) return *end;

    for (std::int64_t k = 1;; ++k) {
      step.search([&](double rho) {
        vi.project(z_k.r, rho, z_k.hat, z);
        vi.evaluate(z);
        return vi.ratio(ratio, z, z_k);
      });
      const Vector& from = options.second == SecondProjection::trial ? z.r : z_k.r;
      vi.project(from, step.rho(), z.hat, next);
      vi.evaluate(next);
      std::swap(z_k, next);
      step.update();
      if (const auto end = iterates.visit(k, z_k.r, [&] { return vi.error(z_k); })) return *end;
    }
  });
}

}  // namespace fclib
