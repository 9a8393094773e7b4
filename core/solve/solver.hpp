// The contract between a solver and the rest: what it gets, what it returns, when it stops.
//
// A solver is one file in solvers/. It defines, in a namespace of the file's name,
//
//   const Solver& solver();
//
// The build finds it. It knows no file and no format. Nobody trusts its error: the driver
// recomputes the merit of what it returns.
#pragma once

#include <chrono>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "deadline.hpp"
#include "error.hpp"
#include "linalg/stopwatch.hpp"
#include "merit_kind.hpp"
#include "reduced/reduced_problem.hpp"
#include "solve/options.hpp"

namespace fclib {

enum class Status {
  converged,        ///< the merit is at most the tolerance
  iteration_limit,  ///< stopped at max_iterations
  time_limit,       ///< stopped at time_limit
  diverged,         ///< an iterate was not finite
  inaccurate,       ///< the solver was content, but the merit of the problem as given is too large
  stalled,          ///< the solver has nothing left to try; its best iterate is returned
  interrupted,      ///< the callback stopped it
  infeasible,       ///< there is no solution: ReducedProblem::proves_no_solution has confirmed it
  invalid,          ///< of a problem in a batch: its data are not valid
};
inline constexpr std::size_t status_count = static_cast<std::size_t>(Status::invalid) + 1;

constexpr std::string_view name_of(Status status) {
  switch (status) {
    case Status::converged:
      return "converged";
    case Status::iteration_limit:
      return "iteration_limit";
    case Status::time_limit:
      return "time_limit";
    case Status::diverged:
      return "diverged";
    case Status::inaccurate:
      return "inaccurate";
    case Status::stalled:
      return "stalled";
    case Status::interrupted:
      return "interrupted";
    case Status::infeasible:
      return "infeasible";
    case Status::invalid:
      return "invalid";
  }
  return "?";
}

/// A point of the convergence history.
struct Progress {
  std::int64_t iteration = 0;
  double error = 0;           ///< the solver's own, relative to ReducedProblem::scale
  double time = 0;            ///< wall clock since the solver started [s]
  std::string_view stage;     ///< for a solver that chains others; empty for a plain one
  const Vector* r = nullptr;  ///< the iterate, or the best one so far
};

/// What a caller asks of any solver.
struct Settings {
  double tolerance = 1e-8;                                      ///< on Merit::error
  MeritKind merit = MeritKind::both;                            ///< ... this one
  std::int64_t max_iterations = 0;                              ///< 0: the solver's own default
  double time_limit = std::numeric_limits<double>::infinity();  ///< wall clock [s], conversions
                                                                ///< included
  std::function<bool(const Progress&)> callback;  ///< called at each report; false stops the solver
  std::function<bool()> poll;                     ///< called at least every 16 sweeps or
                                                  ///< iterations; false stops the solver
  Clock clock;                                    ///< another than the steady one, for tests
  bool history = false;                           ///< whether the result keeps all reports
};

/// Throws Error (option) unless a tolerance is a finite number of 0 or more. With an infinite one,
/// anything would be a solution.
inline void check_tolerance(double tolerance) {
  if (!(tolerance >= 0 && tolerance <= std::numeric_limits<double>::max())) {
    throw Error(ErrorKind::option, "is not a finite number of 0 or more", "tolerance");
  }
}

/// Watches over a solver: the solver reports its iterates, and learns whether to stop.
class Monitor {
 public:
  explicit Monitor(const Settings& settings)
      : settings_(settings), start_(now(settings.clock)), last_poll_(start_) {}

  [[nodiscard]] double tolerance() const { return settings_.tolerance; }
  [[nodiscard]] std::int64_t max_iterations() const { return settings_.max_iterations; }

  /// Whether a callback wants the iterate, so that the solver must put it together.
  [[nodiscard]] bool watched() const { return static_cast<bool>(settings_.callback); }

  /// Wall clock since the solver started [s].
  [[nodiscard]] double elapsed() const { return now(settings_.clock) - start_; }

  /// Names the stage of the next reports.
  void enter(std::string_view stage) { stage_ = stage; }

  /// The reason to stop at this iterate, if there is one. `r` is the iterate, for the callback.
  std::optional<Status> report(std::int64_t iteration, double error, const Vector* r = nullptr) {
    if (!(error < std::numeric_limits<double>::infinity())) return Status::diverged;
    if (settings_.callback && !settings_.callback({iteration, error, elapsed(), stage_, r})) {
      return Status::interrupted;
    }
    if (error <= settings_.tolerance) return Status::converged;
    if (iteration >= settings_.max_iterations) return Status::iteration_limit;
    if (settings_.time_limit < std::numeric_limits<double>::infinity() &&
        elapsed() > settings_.time_limit) {
      return Status::time_limit;
    }
    if (due()) {
      last_poll_ = now(settings_.clock);
      if (settings_.poll && !settings_.poll()) return Status::interrupted;
    }
    return std::nullopt;
  }

  /// Whether a report is wanted now, between those that the solver makes anyway. A solver that
  /// reports seldom must ask every few iterations.
  [[nodiscard]] bool due() const {
    const double time = now(settings_.clock);
    return time - last_poll_ > poll_interval || time - start_ > settings_.time_limit;
  }

 private:
  static constexpr double poll_interval = 0.1;  // [s]

  const Settings& settings_;
  std::string_view stage_;
  double start_;
  double last_poll_;
};

/// A method that is a stage of solvers that chain others.
struct StageKind {
  std::string name;
  std::string families;  ///< families of the solvers whose methods it uses, separated by ", "
};

/// A part of a solve by one method.
struct Stage {
  StageKind kind;
  std::int64_t calls = 0;   ///< how often it was entered: once for each island that needed it
  std::int64_t solved = 0;  ///< ... how often it reached the tolerance
  std::int64_t iterations = 0;
  std::int64_t factorisations = 0;
  double cpu_s = 0;  ///< CPU time of all threads [s]
  double time = 0;   ///< wall clock [s]
};

/// What a solver returns besides r.
struct Outcome {
  Status status = Status::diverged;
  std::int64_t iterations = 0;
  std::vector<Stage> stages = {};    ///< in the order of their first call; empty for plain solvers
  std::optional<double> cpu_s = {};  ///< [s] if it is not that of the calling thread
  std::string message = {};          ///< what a user should know, in words; mostly empty
  Times setup = {};                  ///< what it took to read the options, which is no solve
};

/// The entry of a solver in the registry.
struct Solver {
  std::string name;
  std::string family;
  std::string title;
  std::string citation;
  std::vector<int> dimensions;            ///< the spacedims that it takes
  std::vector<int> rolling_dimensions;    ///< ... of rolling problems
  std::vector<int> spin_dimensions = {};  ///< ... of problems with spin
  std::vector<OptionInfo> options;
  std::int64_t max_iterations = 0;  ///< if the caller sets none
  /// Solves from the guess in r (length m), and leaves its best iterate there.
  std::function<Outcome(const ReducedProblem& problem, const OptionValues& options,
                        const Settings& settings, Vector& r)>
      solve;
  std::string origin = "fclib";  ///< the package that it comes from

  /// Throws Error (option) at the first option that is unknown or has a wrong value.
  void check_options(const OptionValues& values) const { parse_options(options, values); }
};

/// All solvers, by name; generated from the files in solvers/.
const std::vector<const Solver*>& solvers();

/// Throws Error (option) with the known names if none has this name.
const Solver& find_solver(std::string_view name);

}  // namespace fclib
