// Options that several solvers have. O is the struct of a solver's options. It has these members,
// mostly from a base.
#pragma once

#include "contact/local_solver.hpp"
#include "solve/options.hpp"

namespace fclib {

/// For sweeps over the contacts: reduced/sweeps.hpp, contact/local_solver.hpp.
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
      choice("local_solver", &O::local_solver, local_solvers, local_solvers_doc),
      option("local_iterations", &O::local_iterations, "1", {1, 1e6},
             "The largest number of iterations of the projection or of Newton."),
      option("local_accuracy", &O::local_accuracy, "1", {0, 1},
             "The relative step at which the projection stops, or the relative residual at which "
             "Newton does."),
      flag("symmetric", &O::symmetric, "Every second sweep runs backwards."),
      option("threads", &O::threads, "threads", {1, 256},
             "With 2 or more, the contacts are swept colour by colour, those of a colour on all "
             "threads at once. The result is the same for any number. With 1 they are swept in "
             "their order."),
      option("error_interval", &O::error_interval, "sweeps", {0},
             "The number of sweeps between two evaluations of the error. 0: it follows the "
             "convergence."),
  };
}

/// For projected gradients: whether de Saxce's shift follows the iterates.
enum class Shift { iterated, none };
inline constexpr std::array<std::string_view, 2> shifts{"iterated", "none"};

template <class O>
constexpr auto shift_field() {
  return choice("shift", &O::shift, shifts,
                "iterated: Coulomb's law. none: the convex relaxation, which is NOT Coulomb's law "
                "if contacts slide.");
}

/// For a fixed point over convex problems.
struct FixedPointOptions {
  double inner_accuracy = 0.1;
  std::int64_t inner_iterations = 1000;
  std::int64_t local_iterations = 10;
  double relaxation = 1;
};

template <class O>
constexpr auto fixed_point_fields() {
  return std::tuple{
      option("inner_accuracy", &O::inner_accuracy, "1", {1e-6, 1},
             "The accuracy of the convex problem, as a share of the current error."),
      option("inner_iterations", &O::inner_iterations, "iterations", {1, 1e9},
             "The largest number of iterations of the inner solver on one convex problem."),
      option("local_iterations", &O::local_iterations, "iterations", {1, 1e6},
             "The largest number of iterations of Gauss-Seidel on a contact."),
      option("relaxation", &O::relaxation, "1", {0.01, 1},
             "The share of the new shift or threshold in the next one, at first."),
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
      option("alpha", &O::alpha, unit, {1e-12, 1e6}, alpha_doc),
      option("sigma", &O::sigma, unit, {1e-9, 1e9}, "sigma in sigma error^nu."),
      option("nu", &O::nu, "1", {0, 4}, "nu in sigma error^nu."),
  };
}

}  // namespace fclib
