// The driver: any problem, any solver. It validates, converts and solves. It takes the solution
// back to the formulation of the problem, and the merit judges it.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "merit/merit.hpp"
#include "problem.hpp"
#include "proof/no_solution.hpp"
#include "solve/solver.hpp"

namespace fclib {

/// A report of a solver.
struct HistoryPoint {
  std::int64_t iteration = 0;
  double error = 0;
  double time = 0;  ///< wall clock since the first start of the solver [s]
  std::string stage;
};

struct Result {
  Solution solution;
  Status status = Status::diverged;
  std::int64_t iterations = 0;
  double error = 0;  ///< Merit::error_by(Settings::merit) of the solution, on the problem as given
  double cpu_s = 0;  ///< CPU time of the solver alone [s]
  double time = 0;   ///< wall clock of the solver alone [s]
  double setup_s = 0;         ///< CPU time of conversions, validation and merit [s]
  NoSolution certificate;     ///< the proof on the problem as given, if infeasible
  std::vector<Stage> stages;  ///< of solvers that chain others, in the last attempt
  std::string solver;
  std::string message;  ///< what a user should know, in words; mostly empty
  std::optional<std::vector<HistoryPoint>> history;  ///< if the settings ask for it: all reports,
                                                     ///< then the error of the result

  [[nodiscard]] bool converged() const { return status == Status::converged; }
};

/// Other reactions than those of a solution, or none.
using Preference = std::function<std::optional<Vector>(const Solution&)>;

/// Solves a problem of any formulation. `guess` may be empty; only its r is used.
///
/// If the solution took iterations and `prefer` names other reactions, the problem is solved again
/// from these. That result is returned if it converged.
///
/// Throws Error: (problem) for invalid data, (option) for an unknown solver or option, (unsuitable)
/// if the problem cannot be brought to the form that the solver takes.
template <class P>
Result solve(const P& problem, const Solver& solver, const Settings& settings = {},
             const OptionValues& options = {}, const Solution& guess = {},
             const Preference& prefer = {});
#define FCLIB_DECLARE(P)                                                                         \
  extern template Result solve<P>(const P&, const Solver&, const Settings&, const OptionValues&, \
                                  const Solution&, const Preference&);
FCLIB_FOR_EACH_FORMULATION(FCLIB_DECLARE)
#undef FCLIB_DECLARE

/// The same with the name of a solver in the registry.
template <class P>
Result solve(const P& problem, std::string_view solver, const Settings& settings = {},
             const OptionValues& options = {}, const Solution& guess = {}) {
  return solve(problem, find_solver(solver), settings, options, guess);
}

}  // namespace fclib
