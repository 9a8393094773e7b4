#include "solve/driver.hpp"

#include <algorithm>
#include <chrono>
#include <functional>

#include "convert/complete.hpp"
#include "convert/condense.hpp"
#include "convert/eliminate.hpp"
#include "linalg/cpu_time.hpp"

namespace fclib {

namespace {

using Clock = std::chrono::steady_clock;

/// How often the solver is sent back to work where its own error met the tolerance and the merit
/// of the original problem did not (conversions round).
constexpr int max_corrections = 4;

struct Request {
  const Solver& solver;
  const Settings& settings;
  const OptionValues& options;
};

/// Runs the solver on the reduced form and judges by `judge(r)`, which completes the solution.
/// `q` is the one that the merit is relative to; `prove` looks for a proof near y that the problem
/// as it was given has no solution.
template <class Judge>
Result run(const LocalProblem& plain, const Friction& friction, const Vector& q,
           const Request& request, const Solution& guess, const Judge& judge,
           const std::function<NoSolution(const Vector&)>& prove, const Primal* primal = nullptr) {
  Result result;
  const std::function<bool(const Vector&)> proves = [&](const Vector& y) {
    result.certificate = prove(y);
    return result.certificate.proven();
  };
  const double norm_q = q.norm();
  const ReducedProblem reduced{.W = BlockMatrix(plain.W, plain.spacedim),
                               .q = plain.q,
                               .friction = friction,
                               .scale = norm_q > 0 ? norm_q : 1.0,
                               .primal = primal,
                               .proves_no_solution = &proves};
  result.solver = request.solver.name;
  Vector r = guess.r.size() > 0 ? guess.r : Vector(Vector::Zero(plain.q.size()));
  Settings settings = request.settings;
  if (settings.max_iterations == 0) settings.max_iterations = request.solver.max_iterations;
  const std::int64_t max_iterations = settings.max_iterations;
  const auto first_start = Clock::now();
  const auto elapsed = [&] {
    return std::chrono::duration<double>(Clock::now() - first_start).count();
  };
  if (settings.history) {
    result.history.emplace();
    settings.callback = [&](const Progress& progress) {
      result.history->push_back({result.iterations + progress.iteration, progress.error, elapsed(),
                                 std::string(progress.stage)});
      return !request.settings.callback || request.settings.callback(progress);
    };
  }
  for (int correction = 0;; ++correction) {
    const double start = cpu_time();
    const Outcome outcome = request.solver.solve(reduced, request.options, settings, r);
    const double own = cpu_time() - start;
    result.cpu_s += outcome.cpu_s.value_or(own);
    result.setup_s -= own;
    result.iterations += outcome.iterations;
    result.status = outcome.status;
    result.stages = outcome.stages;
    // a word that nothing stands behind is not passed on
    if (result.status == Status::infeasible && !result.certificate.proven())
      result.status = Status::stalled;
    if (!r.allFinite()) {
      result.status = Status::diverged;
      r.setZero();
    }
    result.solution.r = r;
    result.error = judge(result.solution);
    if (result.error <= request.settings.tolerance) {
      result.status = Status::converged;
      result.certificate = {};
      return result;
    }
    if (result.status != Status::converged) return result;
    // the limits hold for all the attempts together
    settings.max_iterations = max_iterations - result.iterations;
    settings.time_limit = request.settings.time_limit - elapsed();
    result.status = settings.max_iterations <= 0 ? Status::iteration_limit
                    : settings.time_limit <= 0   ? Status::time_limit
                                                 : Status::inaccurate;
    if (correction == max_corrections || result.status != Status::inaccurate) return result;
    settings.tolerance *= 0.5 * request.settings.tolerance / result.error;
  }
}

template <class P>
void require_solvable(const P& problem, const Solver& solver, const Solution& guess) {
  validate(problem);
  if (guess.r.size() > 0 && (guess.r.size() != problem.size(Dim::m) || !guess.r.allFinite())) {
    throw Error(ErrorKind::problem,
                "has " + std::to_string(guess.r.size()) + " entries, expected m = " +
                    std::to_string(problem.size(Dim::m)) + " finite ones",
                "guess r");
  }
  const auto& taken = P::rolling ? solver.rolling_dimensions : solver.dimensions;
  if (std::find(taken.begin(), taken.end(), problem.spacedim) == taken.end()) {
    throw Error(ErrorKind::unsuitable,
                "solver " + solver.name + " does not take " + formulation(problem) + " problems");
  }
}

template <class P>
Result solve_local(const P& problem, const Request& request, const Solution& guess) {
  const auto prove = [&](const Vector& y) { return prove_no_solution(problem, y); };
  if (is_mixed(problem)) {
    const Elimination elimination(problem);
    const auto judge = [&](Solution& solution) {
      solution = elimination.expand(solution);
      return merit(problem, solution).error;
    };
    return run(elimination.plain(), friction_of(problem), problem.q, request, guess, judge, prove);
  }
  const auto judge = [&](Solution& solution) {
    solution.u.resize(0);
    solution = complete(problem, solution);
    return merit(problem, solution).error;
  };
  return run(problem, friction_of(problem), problem.q, request, guess, judge, prove);
}

template <class P>
Result solve_global(const P& problem, const Request& request, const Solution& guess) {
  const auto prove = [&](const Vector& y) { return prove_no_solution(problem, y); };
  const Condensation condensation(problem);
  const LocalProblem& local = condensation.local();
  const auto judge = [&](Solution& solution) {
    solution = condensation.expand(solution);
    return merit(problem, solution, condensation.mass()).error;
  };
  if (!is_mixed(local)) {
    const Primal primal{to_eigen(problem.M), to_eigen(problem.H)};
    return run(local, friction_of(problem), local.q, request, guess, judge, prove, &primal);
  }
  const Elimination elimination(local);
  const auto judge_expanded = [&](Solution& solution) {
    solution = elimination.expand(solution);
    return judge(solution);
  };
  return run(elimination.plain(), friction_of(problem), local.q, request, guess, judge_expanded,
             prove);
}

/// What every solve does: checks, times.
template <class P, class Form>
Result solve_any(const P& problem, const Solver& solver, const Settings& settings,
                 const OptionValues& options, const Solution& guess, const Form& form) {
  const double start = cpu_time();
  const Request request{solver, settings, options};
  require_solvable(problem, request.solver, guess);
  Result result = form(problem, request, guess);
  result.setup_s += cpu_time() - start;  // what the thread spent in the solver is taken off already
  return result;
}

}  // namespace

const Solver& find_solver(std::string_view name) {
  std::string known;
  for (const Solver* solver : solvers()) {
    if (solver->name == name) return *solver;
    known += (known.empty() ? "" : ", ") + solver->name;
  }
  throw Error(ErrorKind::option, "unknown; there is: " + known,
              "solver '" + std::string(name) + "'");
}

Result solve(const LocalProblem& problem, const Solver& solver, const Settings& settings,
             const OptionValues& options, const Solution& guess) {
  return solve_any(problem, solver, settings, options, guess, solve_local<LocalProblem>);
}

Result solve(const LocalRollingProblem& problem, const Solver& solver, const Settings& settings,
             const OptionValues& options, const Solution& guess) {
  return solve_any(problem, solver, settings, options, guess, solve_local<LocalRollingProblem>);
}

Result solve(const GlobalProblem& problem, const Solver& solver, const Settings& settings,
             const OptionValues& options, const Solution& guess) {
  return solve_any(problem, solver, settings, options, guess, solve_global<GlobalProblem>);
}

Result solve(const GlobalRollingProblem& problem, const Solver& solver, const Settings& settings,
             const OptionValues& options, const Solution& guess) {
  return solve_any(problem, solver, settings, options, guess, solve_global<GlobalRollingProblem>);
}

}  // namespace fclib
