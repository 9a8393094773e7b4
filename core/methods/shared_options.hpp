// Options that several solvers have. O, the struct of a solver's options, has the members, mostly
// from a base.
#pragma once

#include "contact/local_solver.hpp"
#include "solve/options.hpp"

namespace fclib {

/// Of methods/interior_point.hpp; a stage of a chain has some of them.
template <class O>
constexpr auto step_cap_field() {
  return OptionField<O, double>{.name = "step_cap",
                                .member = &O::step_cap,
                                .unit = "1",
                                .doc = "highest share of the step to the boundary of the cones",
                                .lowest = 0.1,
                                .highest = 0.9999};
}

template <class O>
constexpr auto delta_field() {
  return OptionField<O, double>{.name = "delta",
                                .member = &O::delta,
                                .unit = "mean of tr(W_aa) / d",
                                .doc = "regularisation of the system at first",
                                .lowest = 1e-8,
                                .highest = 1};
}

template <class O>
constexpr auto smoothing_field() {
  return OptionField<O, double>{.name = "smoothing",
                                .member = &O::smoothing,
                                .unit = "1",
                                .doc =
                                    "width of the smoothed kink of de Saxce's term, over the "
                                    "mean complementarity gap",
                                .lowest = 0};
}

template <class O>
constexpr auto patience_field() {
  return OptionField<O, int>{.name = "patience",
                             .member = &O::patience,
                             .unit = "iterations",
                             .doc = "in which the error must halve",
                             .lowest = 1,
                             .highest = 1e6};
}

template <class O>
constexpr auto interior_point_fields() {
  return std::tuple{
      OptionField<O, double>{.name = "tau",
                             .member = &O::tau,
                             .unit = "1",
                             .doc = "complementarity at first: the less, the nearer to the guess "
                                    "it starts",
                             .lowest = 1e-12,
                             .highest = 1e6},
      step_cap_field<O>(),
      delta_field<O>(),
      OptionField<O, bool>{.name = "delta_follows",
                           .member = &O::delta_follows,
                           .doc = "whether delta is at most 1e4 times the complementarity"},
      OptionField<O, double>{.name = "balance",
                             .member = &O::balance,
                             .unit = "1",
                             .doc = "the complementarity is held where the residual exceeds it "
                                    "this many times",
                             .lowest = 1,
                             .highest = 1e12},
  };
}

/// Of sweeps over the contacts: reduced/sweeps.hpp, contact/local_solver.hpp.
struct SweepOptions {
  LocalSolver local_solver = LocalSolver::exact;
  std::int64_t local_iterations = 10;
  double local_accuracy = 1e-14;
  bool symmetric = false;
  std::int64_t threads = 1;
  std::int64_t error_interval = 0;

  template <class Cone>
  [[nodiscard]] LocalStep<Cone> local_step() const {
    return {local_solver, local_accuracy, static_cast<int>(local_iterations)};
  }
};

template <class O>
constexpr auto sweep_fields() {
  return std::tuple{
      OptionField<O, LocalSolver>{.name = "local_solver",
                                  .member = &O::local_solver,
                                  .doc = local_solvers_doc,
                                  .choices = local_solvers},
      OptionField<O, std::int64_t>{.name = "local_iterations",
                                   .member = &O::local_iterations,
                                   .unit = "1",
                                   .doc = "limit of the iterations of the projection or of Newton",
                                   .lowest = 1,
                                   .highest = 1e6},
      OptionField<O, double>{.name = "local_accuracy",
                             .member = &O::local_accuracy,
                             .unit = "1",
                             .doc = "relative step at which the projection stops, relative "
                                    "residual of Newton",
                             .lowest = 0,
                             .highest = 1},
      OptionField<O, bool>{
          .name = "symmetric", .member = &O::symmetric, .doc = "every second sweep runs backwards"},
      OptionField<O, std::int64_t>{
          .name = "threads",
          .member = &O::threads,
          .unit = "threads",
          .doc = "from 2 on the contacts are swept colour by colour, those of a colour on all "
                 "threads at once, with one result for any number; 1: in the order as given",
          .lowest = 1,
          .highest = 256},
      OptionField<O, std::int64_t>{
          .name = "error_interval",
          .member = &O::error_interval,
          .unit = "sweeps",
          .doc = "sweeps between evaluations of the error; 0 adapts it to the convergence",
          .lowest = 0},
  };
}

/// Of projected gradients: whether de Saxce's shift follows the iterates.
enum class Shift { iterated, none };
inline constexpr std::array<std::string_view, 2> shifts{"iterated", "none"};

template <class O>
constexpr auto shift_field() {
  return OptionField<O, Shift>{.name = "shift",
                               .member = &O::shift,
                               .doc =
                                   "iterated: Coulomb's law; none: the convex relaxation, which "
                                   "is NOT Coulomb's law where contacts slide",
                               .choices = shifts};
}

/// Of a fixed point over convex problems.
struct FixedPointOptions {
  double inner_accuracy = 0.1;
  std::int64_t inner_iterations = 1000;
  std::int64_t local_iterations = 10;
  double relaxation = 1;
};

template <class O>
constexpr auto fixed_point_fields() {
  return std::tuple{
      OptionField<O, double>{.name = "inner_accuracy",
                             .member = &O::inner_accuracy,
                             .unit = "1",
                             .doc = "of the convex problem, as a share of the current error",
                             .lowest = 1e-6,
                             .highest = 1},
      OptionField<O, std::int64_t>{
          .name = "inner_iterations",
          .member = &O::inner_iterations,
          .unit = "iterations",
          .doc = "limit of those of the inner solver on one convex problem",
          .lowest = 1,
          .highest = 1e9},
      OptionField<O, std::int64_t>{.name = "local_iterations",
                                   .member = &O::local_iterations,
                                   .unit = "iterations",
                                   .doc = "limit of those of Gauss-Seidel on a contact",
                                   .lowest = 1,
                                   .highest = 1e6},
      OptionField<O, double>{.name = "relaxation",
                             .member = &O::relaxation,
                             .unit = "1",
                             .doc = "share of the new shift or threshold in the next, at first",
                             .lowest = 0.01,
                             .highest = 1},
  };
}

/// The weight of a proximal point algorithm, in a unit of W.
struct ProximalOptions {
  double alpha = 0.1;
  double sigma = 5;
  double nu = 1;
};

template <class O>
constexpr auto proximal_fields(std::string_view unit, std::string_view alpha_doc) {
  return std::tuple{
      OptionField<O, double>{.name = "alpha",
                             .member = &O::alpha,
                             .unit = unit,
                             .doc = alpha_doc,
                             .lowest = 1e-12,
                             .highest = 1e6},
      OptionField<O, double>{.name = "sigma",
                             .member = &O::sigma,
                             .unit = unit,
                             .doc = "of sigma error^nu",
                             .lowest = 1e-9,
                             .highest = 1e9},
      OptionField<O, double>{.name = "nu",
                             .member = &O::nu,
                             .unit = "1",
                             .doc = "of sigma error^nu",
                             .lowest = 0,
                             .highest = 4},
  };
}

}  // namespace fclib
