// ACLM: a fixed point on de Saxce's shift.
//
//   s <- mu ||u_T||,   u = W r + q
//   r <- argmin 1/2 r.W r + (q + s e_N).r  over K     (a convex second-order cone problem)
//
// Cadoux, "Analyse convexe et optimisation pour la dynamique non-reguliere" (2009); Acary, Cadoux,
// Lemarechal, Malick, "A formulation of the linear discrete Coulomb friction problem via convex
// optimization" (2011); section 5.3 of Acary, Bremond, Huber, "On solving contact problems with
// Coulomb friction: formulations and numerical comparisons" (2018): ACLMFP.
//
// Differs from the papers in:
// - the inner problem is solved to a share of the current error of Coulomb's law. It starts from
//   the last solution if the inner solver can do that (the interior point cannot). A few projected
//   gradients finish what the interior point returns;
// - if 50 steps bring no lower error, the relaxation is halved, down to an eighth;
// - rolling friction adds its term to the shift.

#include <array>
#include <cstdint>
#include <optional>

#include "error.hpp"
#include "methods/convex_program.hpp"
#include "methods/interior_point.hpp"
#include "methods/relaxation.hpp"
#include "methods/shared_options.hpp"
#include "reduced/de_saxce_shift.hpp"
#include "solve/best_iterate.hpp"
#include "solve/by_cone.hpp"

namespace fclib::aclm {

namespace {

// those of ConvexMethod first
enum class Inner { gauss_seidel, projected_gradient, admm, interior_point };
constexpr std::array<std::string_view, 4> inners{convex_methods[0], convex_methods[1],
                                                 convex_methods[2], "interior_point"};

struct Options : FixedPointOptions {
  Inner inner = Inner::projected_gradient;

  static constexpr auto fields() {
    using O = Options;
    return std::tuple_cat(
        std::tuple{choice(
            "inner", &O::inner, inners,
            "The solver of the convex problem. interior_point does not take rolling friction.")},
        fixed_point_fields<O>());
  }
};

/// The convex problem by an interior point, on a copy of the problem whose q has the shift.
template <int D>
class ShiftedInteriorPoint {
 public:
  explicit ShiftedInteriorPoint(const ReducedProblem& problem)
      : problem_(problem), shifted_(problem), system_(shifted_) {}

  /// If `follow(r, u)` returns true, it ends.
  template <class Follow>
  void solve(const Vector& shift, int limit, Vector& r, Vector& u, const Follow& follow) {
    for (Index a = 0; a < problem_.nc(); ++a) shifted_.q[D * a] = problem_.q[D * a] + shift[a];
    InteriorPoint<D> method(shifted_, system_);
    method.solve({.associated = true, .max_iterations = limit, .patience = limit},
                 Vector::Zero(problem_.m()), [&](double, const Vector& reaction) {
                   r = reaction;
                   problem_.velocity(r, u);
                   return follow(r, u);
                 });
  }

 private:
  const ReducedProblem& problem_;
  ReducedProblem shifted_;
  CoupledSystem system_;
};

template <class Cone>
Outcome iterate(const ReducedProblem& problem, const Options& options, const Settings& settings,
                Vector& r) {
  constexpr int D = Cone::dim;
  constexpr bool rolling = Cone::groups > 1;
  constexpr int longest = 60;              // iterations of an interior point
  constexpr std::int64_t finishing = 100;  // projected gradients after it
  if (rolling && options.inner == Inner::interior_point) {
    throw Error(ErrorKind::unsuitable, "inner = interior_point does not take rolling friction",
                "solver aclm");
  }
  const Cones<Cone> cones(problem.friction);
  ConvexProgram<Cones<Cone>> program(problem);
  std::optional<ShiftedInteriorPoint<D>> interior_point;
  BestIterate<Cone> best(problem, settings, r);
  Vector u(problem.m());
  Vector shift(problem.nc());
  problem.velocity(r, u);
  best.report(0, r, u);
  const auto due = [&](std::int64_t count) { return best.due(count); };
  const auto follow = [&](std::int64_t count, const Vector& reaction, const Vector& velocity) {
    return best.report(count, reaction, velocity);
  };
  de_saxce_shift<Cone>(u, problem.friction, program.shift());
  Relaxation relaxation(options.relaxation);
  while (!best.stopped()) {
    const double accuracy = options.inner_accuracy * best.last_error();
    const std::int64_t before = best.iterations();
    if (options.inner != Inner::interior_point) {
      program.solve(static_cast<ConvexMethod>(options.inner), cones,
                    static_cast<int>(options.local_iterations), accuracy, options.inner_iterations,
                    r, u, due, follow);
    } else if constexpr (!rolling) {
      if (!interior_point) interior_point.emplace(problem);
      std::int64_t count = 0;  // its first iterate is its own starting point
      interior_point->solve(program.shift(), longest, r, u,
                            [&](const Vector& reaction, const Vector& velocity) {
                              if (count++ == 0) return false;
                              return best.report(1, reaction, velocity) ||
                                     program.residual(cones, reaction, velocity) <= accuracy;
                            });
      if (!best.stopped()) {  // its iterates stay inside the cones, away from the boundary
        program.projected_gradient(cones, accuracy, finishing, r, u, due, follow);
      }
    }
    if (best.iterations() == before) break;  // nothing could be done
    problem.velocity(r, u);
    de_saxce_shift<Cone>(u, problem.friction, shift);
    program.shift() += relaxation.next(best.last_error()) * (shift - program.shift());
  }
  return best.outcome(r);
}

}  // namespace

const Solver& solver() {
  static const Solver entry{
      .name = "aclm",
      .family = "optimisation",
      .title = "Fixed point on the shift of de Saxce",
      .citation =
          "Cadoux 2009; Acary, Cadoux, Lemarechal & Malick 2011; Acary, Bremond & Huber 2018",
      .dimensions = {2, 3},
      .rolling_dimensions = {3, 5},
      .options = describe_options<Options>(),
      .max_iterations = 1'000'000,
      .solve = by_cone<Options>([]<class Cone>(auto&... all) { return iterate<Cone>(all...); }),
  };
  return entry;
}

}  // namespace fclib::aclm
