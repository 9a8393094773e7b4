// PANA: Panagiotopoulos' alternating method.
//
//   r_N <- argmin 1/2 r.W r + q.r  over  r_N >= 0,            r_T fixed
//   r_T <- argmin 1/2 r.W r + q.r  over  ||r_T|| <= mu r_N,   r_N fixed
//
// Panagiotopoulos, "A nonlinear programming approach to the unilateral contact-, and
// friction-boundary value problem in the theory of elasticity" (1975); section 5.2 of Acary,
// Bremond, Huber, "On solving contact problems with Coulomb friction: formulations and numerical
// comparisons" (2018): PFP.
//
// Differs from the papers in:
// - both convex problems are solved to a share of the current error of Coulomb's law. They start
//   from the last solution;
// - rolling friction is part of the tangential problem.

#include <algorithm>
#include <array>
#include <cstdint>

#include "methods/convex_program.hpp"
#include "solve/best_iterate.hpp"
#include "solve/by_cone.hpp"

namespace fclib::panagiotopoulos {

namespace {

enum class Inner { gauss_seidel, projected_gradient };
constexpr std::array<std::string_view, 2> inners{"gauss_seidel", "projected_gradient"};

struct Options {
  Inner inner = Inner::gauss_seidel;
  double inner_accuracy = 0.1;
  std::int64_t inner_iterations = 1000;

  static constexpr auto fields() {
    using O = Options;
    return std::tuple{
        choice("inner", &O::inner, inners,
               "The solver of the normal and of the tangential problem."),
        option("inner_accuracy", &O::inner_accuracy, "1", {1e-6, 1},
               "The accuracy of the two problems, as a share of the current error."),
        option(
            "inner_iterations", &O::inner_iterations, "iterations", {1, 1e9},
            "The number of iterations of the inner solver before it is the other problem's turn."),
    };
  }
};

template <class Cone>
Outcome iterate(const ReducedProblem& problem, const Options& options, const Settings& settings,
                Vector& r) {
  using Set = Cylinders<Cone>;
  Set normal(problem.friction);
  normal.tangential = false;
  Set tangential(problem.friction);
  tangential.normal = false;
  ConvexProgram<Set> program(problem);
  BestIterate<Cone> best(problem, settings, r);
  Vector u(problem.m());
  problem.velocity(r, u);
  best.report(0, r, u);
  const auto due = [&](std::int64_t count) { return best.due(count); };
  const auto follow = [&](std::int64_t count, const Vector& reaction, const Vector& velocity) {
    return best.report(count, reaction, velocity);
  };
  const auto minimise = [&](const Set& set) {
    const double accuracy = options.inner_accuracy * best.last_error();
    if (options.inner == Inner::gauss_seidel) {
      program.gauss_seidel(set, 2, accuracy, options.inner_iterations, r, u, due, follow);
    } else {
      program.projected_gradient(set, accuracy, options.inner_iterations, r, u, due, follow);
    }
    problem.velocity(r, u);
  };
  while (!best.stopped()) {
    minimise(normal);
    if (best.stopped()) break;
    tangential.set_thresholds(r);
    minimise(tangential);
  }
  return best.outcome(r);
}

}  // namespace

const Solver& solver() {
  static const Solver entry{
      .name = "panagiotopoulos",
      .family = "optimisation",
      .title = "Alternating normal and tangential problems",
      .citation = "Panagiotopoulos 1975; Acary, Bremond & Huber 2018",
      .dimensions = {2, 3},
      .rolling_dimensions = {3, 5},
      .options = describe_options<Options>(),
      .max_iterations = 1'000'000,
      .solve = by_cone<Options>([]<class Cone>(auto&... all) { return iterate<Cone>(all...); }),
  };
  return entry;
}

}  // namespace fclib::panagiotopoulos
