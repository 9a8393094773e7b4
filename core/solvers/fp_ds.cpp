// FP-DS: fixed-point projections with a constant step, the algorithm of de Saxce & Feng.
//
//   r_k+1 = P_K(r_k - rho u^_k),  u_k = W r_k + q
//
// de Saxce & Feng, "The bipotential method: a constructive approach to design the complete contact
// law with friction and improved numerical algorithms" (1998); algorithm 1 of Acary, Bremond,
// Huber, "On solving contact problems with Coulomb friction: formulations and numerical
// comparisons" (2018).
//
// Differs from the paper in: rho is relative to 1 / ||W||, the largest eigenvalue by the power
// method, so that one value suits all units; each contact may have a step of its own (`metric`).

#include "methods/projection_loops.hpp"
#include "reduced/with_cone.hpp"

namespace fclib::fp_ds {

namespace {

struct Options {
  Metric metric = Metric::contact;
  double rho = 1.0;

  static constexpr auto fields() {
    using O = Options;
    return std::tuple{
        choice("metric", &O::metric, metrics, metric_doc),
        option("rho", &O::rho, "1/||W||", {1e-6, 1e6},
               "The step. Without friction every step below 2 converges."),
    };
  }
};

template <class Cone>
Outcome iterate(const ReducedProblem& problem, const Options& options, Iterates& iterates,
                const Vector& start) {
  const VariationalInequality<Cone> vi(problem, options.metric);
  const double rho = options.rho / vi.largest_eigenvalue();
  VelocityPoint z = vi.point(start);
  vi.evaluate(z);
  if (const auto end = iterates.visit(0, z.r, [&] { return vi.error(z); })) return *end;

  for (std::int64_t k = 1;; ++k) {
    vi.project(z.r, rho, z.hat, z);
    vi.evaluate(z);
    if (const auto end = iterates.visit(k, z.r, [&] { return vi.error(z); })) return *end;
  }
}

}  // namespace

const Solver& solver() {
  static const Solver entry = projection_entry<Options>(
      "fp-ds", "Fixed-point projection with a constant step", "de Saxce & Feng 1998",
      [](const ReducedProblem& problem, const Options& options, Iterates& iterates,
         const Vector& start) {
        return with_cone(problem, [&]<class Cone>() {
          return iterate<Cone>(problem, options, iterates, start);
        });
      });
  return entry;
}

}  // namespace fclib::fp_ds
