#include "solve/driver.hpp"

#include <algorithm>
#include <concepts>
#include <cstdio>
#include <functional>
#include <limits>
#include <utility>

#include "contact/laws.hpp"
#include "convert/condense.hpp"
#include "convert/eliminate.hpp"
#include "joints/consistent.hpp"
#include "linalg/stopwatch.hpp"
#include "number_text.hpp"
#include "reduced/relative_error.hpp"
#include "reduced/round.hpp"
#include "solve/plugin.hpp"

namespace fclib {

namespace {

/// How often the solver is called again if its own error met the tolerance but the merit of the
/// original problem did not, because conversions round.
constexpr int max_corrections = 4;

/// Rounding hinders a solve if what it leaves of the velocities is more than this part of the
/// tolerance. It may be the only hindrance if the error is at most so many times the rounding.
constexpr double rounding_in_tolerance = 0.1;
constexpr double rounding_in_error = 1e3;

/// || |A| |x| || eps: the rounding of A x.
double rounding_of_product(const Matrix& a, const Vector& x) {
  Vector sizes = Vector::Zero(a.rows);
  for_each_entry(a, [&](Index row, Index col, double value) {
    sizes[row] += std::abs(value) * std::abs(x[col]);
  });
  return std::numeric_limits<double>::epsilon() * sizes.stableNorm();
}

/// How much the last digit of r may change the natural map, over this scale: the digit of r itself,
/// and that of W r. `product` is || |W| |r| || eps.
double last_digit(const Vector& r, double product, double scale) {
  const double eps = std::numeric_limits<double>::epsilon();
  return (eps * r.stableNorm() + 0.5 * product) / scale;
}

std::string too_coarse(double digit) {
  char text[160];
  std::snprintf(text, sizeof text,
                "doubles are too coarse for the tolerance: the last digit of these reactions "
                "changes the error by up to %.2g",
                digit);
  return text;
}

/// What a second solve of the same problem need not find again.
struct Kept {
  std::optional<Factorization> mass;
  std::optional<OwnSizes> own;
};

struct Request {
  const Solver& solver;
  const Settings& settings;
  const OptionValues& options;
  const Deadline& deadline;  ///< of the whole solve, conversions included
  Stopwatch& watch;          ///< of the whole solve, conversions included
  Kept& kept;
};

/// What the merit is relative to.
struct Measure {
  double q = 0;         ///< ||q||
  double rounding = 0;  ///< the rounding of q
  Vector rho;           ///< of the scaled map, if the merit bounds both
  double scaled_q = 0;  ///< ||rho q||
  double scaled_rounding = 0;

  /// For a problem without conversion, or a condensed one, before bilateral constraints are
  /// eliminated.
  Measure(const LocalProblem& problem, const OwnSizes& own, MeritKind kind)
      : q(problem.q.stableNorm()), rounding(static_cast<double>(own.rounding.norm())) {
    if (kind == MeritKind::natural) return;
    const Index d = problem.spacedim;
    rho = own.rho.cast<double>();
    const auto scaled = [&](Vector x) {
      for (Eigen::Index k = 0; k < x.size(); ++k) x[k] *= rho[k / d];
      return x.stableNorm();
    };
    scaled_q = scaled(problem.q);
    if (own.rounding.size() > 0) scaled_rounding = scaled(own.rounding.cast<double>());
  }

  /// The scale of a solver. The solver aims at an error below the rounding, as far as it can. The
  /// merit of its result leaves the rounding out.
  static double scale(double q, double rounding) {
    const double largest = std::max(q, rounding);
    return largest > 0 ? largest : 1.0;
  }
};

/// For each contact, whether its reaction moves anything.
std::vector<bool> moving(const Matrix& W, int d) {
  std::vector<bool> moves(static_cast<std::size_t>(W.cols / d), false);
  if (W.storage == Storage::csc) {  // one entry is enough
    for (Index col = 0; col < W.cols; ++col) {
      const auto contact = static_cast<std::size_t>(col / d);
      for (Index k = W.p[col]; k < W.p[col + 1] && !moves[contact]; ++k) {
        moves[contact] = W.x[k] != 0;
      }
    }
    return moves;
  }
  for_each_entry(W, [&](Index, Index col, double value) {
    if (value != 0) moves[static_cast<std::size_t>(col / d)] = true;
  });
  return moves;
}

/// Sets r to zero at the contacts whose reactions move nothing. No solver would change a guess
/// there, a large one makes the reactions of the others round, and no value is better than zero.
void clear_without_effect(const std::vector<bool>& moves, int d, Vector& r) {
  for (std::size_t a = 0; a < moves.size(); ++a) {
    if (!moves[a]) r.segment(static_cast<Eigen::Index>(a) * d, d).setZero();
  }
}

/// Puts r in the place of the result's if it is better, and l too if no elimination finds it.
template <class Judge>
void take_if_better(const Vector& r, const Vector& l, const Judge& judge, Result& result) {
  Solution other{.v = {}, .u = {}, .r = r, .l = l};
  const double error = judge(other);
  if (!(error < result.error)) return;
  result.error = error;
  result.solution = std::move(other);
}

/// The contacts that no reaction moves but that close, if this is no proof: joints hold them, up to
/// rounding. A solver would raise their reactions for ever.
std::vector<Index> held_contacts(const LocalProblem& plain, const std::vector<bool>& moves,
                                 const std::function<bool(const Vector&)>& proves) {
  std::vector<Index> result;
  for (std::size_t a = 0; a < moves.size(); ++a) {
    const auto contact = static_cast<Index>(a);
    if (moves[a] || !(plain.q[contact * plain.spacedim] < 0)) continue;
    if (!proves(Vector::Unit(static_cast<Eigen::Index>(moves.size()), contact))) {
      result.push_back(contact);
    }
  }
  return result;
}

/// Runs the solver, on a round cone if the one of the problem is an ellipsoid. `tolerance` becomes
/// the error that the solver reached there if it is less: the two cones measure differently.
Outcome solve_round(const Matrix& W, const ReducedProblem& problem, const Solver& solver,
                    const OptionValues& options, const Settings& settings, double& tolerance,
                    Vector& r) {
  if (!problem.friction.coupled) return solver.solve(problem, options, settings, r);
  const Round round(W, problem);
  Vector own = round.to_own(r);
  Outcome outcome = solver.solve(round.problem(), options, settings, own);
  Vector u;
  round.problem().velocity(own, u);
  const double error = relative_error<Coulomb<4>>(round.problem(), u, own);
  if (error > 0 && error < tolerance) tolerance = error;
  r = round.reactions(own);
  return outcome;
}

/// Runs the solver on the reduced form and judges it by `judge(r)`, which completes the solution.
/// `prove` looks for a proof near y that the problem as given has no solution.
template <class Judge>
Result run(const LocalProblem& plain, const Friction& friction, Measure measure,
           const Request& request, const Solution& guess, const Judge& judge,
           const std::function<NoSolution(const Vector&)>& prove, const Primal* primal = nullptr) {
  Result result;
  const std::function<bool(const Vector&)> proves = [&](const Vector& y) {
    NoSolution found = prove(y);
    if (!(found.gain > least_speed * measure.q * found.y.norm())) return false;
    result.certificate = std::move(found);
    return true;
  };
  result.solver = request.solver.name;
  if (measure.q <= measure.rounding) {
    // only rounding is left of q: if r = 0 is good enough, it is the solution
    result.solution.r = Vector::Zero(plain.q.size());
    result.error = judge(result.solution);
    if (result.error <= request.settings.tolerance) {
      result.status = Status::converged;
      if (request.settings.history) result.history.emplace();
      return result;
    }
  }
  ReducedProblem reduced{.W = BlockMatrix(plain.W, plain.spacedim),
                         .q = plain.q,
                         .friction = friction,
                         .scale = Measure::scale(measure.q, measure.rounding),
                         .rho = std::move(measure.rho),
                         .scaled_scale = Measure::scale(measure.scaled_q, measure.scaled_rounding),
                         .known_r = {},
                         .known_u = {},
                         .primal = primal,
                         .deadline = &request.deadline,
                         .proves_no_solution = &proves};
  const std::vector<bool> moves = moving(plain.W, plain.spacedim);
  const std::vector<Index> held = held_contacts(plain, moves, proves);
  result.certificate = {};
  const auto leave_held = [&] {  // only the merit judges the velocities of these contacts
    for (const Index a : held) reduced.q.segment(a * plain.spacedim, plain.spacedim).setZero();
  };
  leave_held();
  Vector r = guess.r.size() > 0 ? guess.r : Vector(Vector::Zero(plain.q.size()));
  if (guess.r.size() > 0) clear_without_effect(moves, plain.spacedim, r);
  Settings settings = request.settings;
  if (settings.max_iterations == 0) settings.max_iterations = request.solver.max_iterations;
  const std::int64_t max_iterations = settings.max_iterations;
  settings.time_limit = std::max(0.0, request.deadline.left());
  if (settings.history) result.history.emplace();
  if (settings.history || settings.callback) {
    // the counts run over all calls of the solver
    settings.callback = [&, start = now(settings.clock)](Progress progress) {
      progress.iteration += result.iterations;
      progress.time = now(settings.clock) - start;
      if (result.history) {
        result.history->push_back(
            {progress.iteration, progress.error, progress.time, std::string(progress.stage)});
      }
      return !request.settings.callback || request.settings.callback(progress);
    };
  }
  double least = std::numeric_limits<double>::infinity();
  Solution best;
  for (int correction = 0;; ++correction) {
    const Times start = request.watch.read();
    double reached = settings.tolerance;
    Outcome outcome =
        solve_round(plain.W, reduced, request.solver, request.options, settings, reached, r);
    const Times own = request.watch.read() - start - outcome.setup;
    result.cpu_s += outcome.cpu_s.value_or(own.cpu);
    result.time += own.wall;
    result.setup_s -= own.cpu;
    result.iterations += outcome.iterations;
    result.status = outcome.status;
    result.stages = std::move(outcome.stages);
    result.message = std::move(outcome.message);
    // a claim without a proof is not passed on
    if (result.status == Status::infeasible && !result.certificate.proven())
      result.status = Status::stalled;
    // if the time is over, factorisations fail, and solvers have nothing left to try
    if ((result.status == Status::stalled || result.status == Status::diverged) &&
        request.deadline.passed()) {
      result.status = Status::time_limit;
    }
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
    const double product = rounding_of_product(plain.W, r);
    // the last correction may be worse than an earlier attempt, so the best one is kept
    const bool better = result.error < 0.5 * least;
    if (correction == 0 || result.error < least) {
      least = result.error;
      best = result.solution;
    }
    const auto end = [&] {
      result.error = least;
      result.solution = best;
      // what is returned is no worse than what costs nothing, unless another law is asked for
      if (request.solver.family != "relaxation") {
        take_if_better(Vector::Zero(r.size()), {}, judge, result);
        if (guess.r.size() > 0) take_if_better(guess.r, {}, judge, result);
      }
      if (result.error <= request.settings.tolerance) {
        result.status = Status::converged;
        result.certificate = {};
        return result;
      }
      const double digit = last_digit(r, product, reduced.scale);
      const bool all_digits = digit > request.settings.tolerance && result.error <= digit;
      if (all_digits && result.status != Status::infeasible && result.message.empty()) {
        result.message = too_coarse(digit);
      }
      return result;
    };
    const double rounding = product / reduced.scale;
    const bool rounded = rounding > rounding_in_tolerance * request.settings.tolerance;
    const bool hidden = result.status == Status::stalled && rounded && better &&
                        result.error < rounding_in_error * rounding;
    if (result.status != Status::converged && !hidden) return end();
    // the limits are for all attempts together
    settings.max_iterations = max_iterations - result.iterations;
    settings.time_limit = request.deadline.left();
    result.status = settings.max_iterations <= 0 ? Status::iteration_limit
                    : settings.time_limit <= 0   ? Status::time_limit
                    : hidden                     ? Status::stalled
                                                 : Status::inaccurate;
    if (correction == max_corrections || (result.status != Status::inaccurate && !hidden)) {
      return end();
    }
    if (!hidden) settings.tolerance = reached * (0.5 * request.settings.tolerance / result.error);
    // what conversions lost of the velocity of the problem as given is added to q
    Vector u;
    reduced.velocity(r, u);
    reduced.q += result.solution.u - u;
    leave_held();
    if (rounded) {
      reduced.known_r = r;
      reduced.known_u = result.solution.u;
    }
  }
}

/// The result if the time is over before the solver starts: the guess.
template <class Judge>
Result out_of_time(Eigen::Index m, Eigen::Index p, const Request& request, const Solution& guess,
                   const Judge& judge) {
  Result result;
  result.solver = request.solver.name;
  result.solution.r = guess.r.size() > 0 ? guess.r : Vector(Vector::Zero(m));
  if (p > 0) result.solution.l = Vector::Zero(p);
  result.error = judge(result.solution);
  take_if_better(Vector::Zero(m), result.solution.l, judge, result);
  result.status =
      result.error <= request.settings.tolerance ? Status::converged : Status::time_limit;
  if (request.settings.history) result.history.emplace();
  return result;
}

/// The same if the time is over before the condensation has ended. Its merit stays infinite: to
/// judge it takes as long as the condensation, and there is no time.
Result out_of_time(const GlobalProblem& problem, const Condensation& condensation,
                   const Request& request, const Solution& guess) {
  Result result;
  result.solver = request.solver.name;
  result.solution.r = guess.r.size() > 0 ? guess.r : Vector(Vector::Zero(problem.w.size()));
  if (problem.b.size() > 0) result.solution.l = Vector::Zero(problem.b.size());
  result.solution = condensation.expand(result.solution);
  result.error = std::numeric_limits<double>::infinity();
  result.status = Status::time_limit;
  if (request.settings.history) result.history.emplace();
  return result;
}

template <class P>
void require_solvable(const P& problem, const Solver& solver, const Solution& guess) {
  validate(problem);
  if (guess.r.size() > 0) {
    detail::validate_vector(guess.r, problem.size(Dim::m), Dim::m, Range::any, "guess r");
  }
  const auto& taken = P::rolling ? solver.rolling_dimensions
                      : P::spin  ? solver.spin_dimensions
                                 : solver.dimensions;
  if (std::find(taken.begin(), taken.end(), problem.spacedim) == taken.end()) {
    throw Error(ErrorKind::unsuitable,
                "solver " + solver.name + " does not take " + formulation(problem) + " problems");
  }
}

/// The largest residual of the bilateral constraints, over their terms. No rounding is taken off.
double broken(const LocalProblem& problem, const Solution& solution) {
  const SparseColumns V = to_eigen(problem.V);
  const SparseColumns R = to_eigen(problem.R);
  const Vector left = V.transpose() * solution.r + R * solution.l + problem.s;
  const Vector terms = V.cwiseAbs().transpose() * solution.r.cwiseAbs() +
                       R.cwiseAbs() * solution.l.cwiseAbs() + problem.s.cwiseAbs();
  return (left.array().abs() / terms.array().max(std::numeric_limits<double>::min())).maxCoeff();
}

double broken(const GlobalProblem& problem, const Solution& solution) {
  const SparseColumns G = to_eigen(problem.G);
  const Vector left = G.transpose() * solution.v + problem.b;
  const Vector terms = G.cwiseAbs().transpose() * solution.v.cwiseAbs() + problem.b.cwiseAbs();
  return (left.array().abs() / terms.array().max(std::numeric_limits<double>::min())).maxCoeff();
}

/// Refuses bilateral constraints that contradict each other by more than the tolerance. The merit
/// takes off the possible rounding of large multipliers, so it does not show the contradiction.
template <class P>
Result agreeing(const P& problem, Result result, const Elimination& elimination, double tolerance) {
  const std::optional<Error>& contradiction = elimination.contradiction();
  if (!contradiction || result.status == Status::infeasible) return result;
  const double error = std::max(result.error, broken(problem, result.solution));
  if (error <= tolerance) return result;
  if (result.status == Status::interrupted || result.status == Status::time_limit) {
    result.message = contradiction->what();
    return result;
  }
  throw Error(contradiction->kind,
              contradiction->message + "; the best solution found has an error of " +
                  shortest(error) + ": correct it, leave it out, or ask for a looser tolerance",
              contradiction->where);
}

template <class P>
Result solve_local(const P& problem, const Request& request, const Solution& guess) {
  const auto prove = [&](const Vector& y) { return prove_no_solution(problem, y); };
  const MeritKind kind = request.settings.merit;
  const Friction friction = friction_of(problem);
  const OwnSizes own = own_sizes(problem);
  Measure measure(problem, own, kind);
  const auto judge = [&](Solution& solution) {
    return judge_and_complete(problem, friction, own, kind, solution);
  };
  if (!is_mixed(problem)) {
    return run(problem, friction, std::move(measure), request, guess, judge, prove);
  }
  const Elimination elimination(problem, &request.deadline);
  if (!elimination.finished()) {
    return out_of_time(problem.q.size(), problem.s.size(), request, guess, judge);
  }
  const std::vector<bool> moves = moving(elimination.plain().W, problem.spacedim);
  const auto judge_expanded = [&](Solution& solution) {
    clear_without_effect(moves, problem.spacedim, solution.r);
    solution = elimination.expand(solution);
    return judge(solution);
  };
  return agreeing(
      problem,
      run(elimination.plain(), friction, std::move(measure), request, guess, judge_expanded, prove),
      elimination, request.settings.tolerance);
}

/// ||r - P_K(r - u^)||^2 in plain arithmetic.
double natural_squares(Index d, const Friction& friction, const Vector& u, const Vector& r) {
  double sum = 0;
  with_cone<double>(static_cast<int>(d), friction, [&]<class Cone>() {
    for (Eigen::Index a = 0; a < friction.mu.size(); ++a) {
      const ContactVector<Cone::dim, double> ua = u.segment<Cone::dim>(Cone::dim * a);
      const ContactVector<Cone::dim, double> ra = r.segment<Cone::dim>(Cone::dim * a);
      sum += natural_map(Cone(friction, a), ua, ra).squaredNorm();
    }
  });
  return sum;
}

/// The guess, if it is the solution: as bodies at rest have it from the step before. It is judged
/// without W, which takes longer than the judgement. Nothing if something is to be told of the way.
template <class P>
std::optional<Result> known_solution(const P& problem, const Friction& friction,
                                     const Factorization& mass, const Request& request,
                                     const Solution& guess) {
  const Settings& settings = request.settings;
  if (guess.r.size() == 0 || is_mixed(problem) || settings.history || settings.callback) return {};
  const Times start = request.watch.read();
  const Index d = problem.spacedim;
  Result result;
  result.solver = request.solver.name;
  Solution& solution = result.solution;
  solution.r = guess.r;
  clear_without_effect(moving(problem.H, d), d, solution.r);
  solution = expanded(problem, mass, solution);
  Vector q = problem.w;
  multiply_transposed_add(problem.H, mass.solve(problem.f), q);
  const double error = std::sqrt(natural_squares(d, friction, solution.u, solution.r));
  if (!(error <= settings.tolerance * q.stableNorm())) return {};
  const OwnSizes own = request.kept.own ? *request.kept.own : own_sizes(problem, mass);
  // if only rounding is left of q, the solution is r = 0
  if (!(q.stableNorm() > static_cast<double>(own.rounding.norm()))) return {};
  result.error = judge_and_complete(problem, friction, mass, own, settings.merit, solution);
  if (!(result.error <= settings.tolerance)) return {};
  result.status = Status::converged;
  // the judgement is the whole solve
  const Times spent = request.watch.read() - start;
  result.cpu_s = spent.cpu;
  result.time = spent.wall;
  result.setup_s = -spent.cpu;
  return result;
}

/// `given` is the problem as given; proofs are about it.
template <class P>
Result solve_global(const P& problem, const P& given, const Request& request,
                    const Solution& guess) {
  const auto prove = [&](const Vector& y) { return prove_no_solution(given, y); };
  const MeritKind kind = request.settings.merit;
  const Friction friction = friction_of(problem);
  Kept& kept = request.kept;
  Factorization mass =
      kept.mass ? *std::exchange(kept.mass, {}) : Factorization(to_eigen(problem.M), "M");
  if (auto known = known_solution(problem, friction, mass, request, guess)) {
    return *std::move(known);
  }
  Condensation condensation(problem, std::move(mass), &request.deadline);
  const LocalProblem& local = condensation.local();
  if (!condensation.finished()) return out_of_time(problem, condensation, request, guess);
  const OwnSizes own = own_sizes(problem, condensation.mass(), &local);
  const auto judge_complete = [&](Solution& solution) {
    return judge_and_complete(problem, friction, condensation.mass(), own, kind, solution);
  };
  const auto judge = [&](Solution& solution) {
    solution = condensation.expand(solution);
    return judge_complete(solution);
  };
  const auto stop = [&] {
    return out_of_time(problem.w.size(), problem.b.size(), request, guess, judge);
  };
  Measure measure(local, own, kind);
  if (!is_mixed(local)) {
    const Primal primal{to_eigen(problem.M), to_eigen(problem.H)};
    Result result = run(local, friction, std::move(measure), request, guess, judge, prove, &primal);
    kept = {condensation.take_mass(), own};
    return result;
  }
  const Elimination elimination(problem, condensation, &request.deadline);
  if (!elimination.finished()) return stop();
  const std::vector<bool> moves = moving(elimination.plain().W, problem.spacedim);
  const auto judge_expanded = [&](Solution& solution) {
    clear_without_effect(moves, problem.spacedim, solution.r);
    Solution expanded = condensation.expand(elimination.expand(solution));
    const auto held = [&] {
      Solution corrected = expanded;
      elimination.hold(problem, condensation, corrected);
      return corrected;
    };
    // the correction of the velocities may be more than the rounding of multipliers explains
    const bool first = elimination.nearly_dependent();
    solution = first ? held() : expanded;
    const double error = judge_complete(solution);
    if (error <= request.settings.tolerance) return error;
    Solution other = first ? std::move(expanded) : held();
    const double other_error = judge_complete(other);
    if (!(other_error <= request.settings.tolerance)) return error;
    solution = std::move(other);
    return other_error;
  };
  Result result =
      run(elimination.plain(), friction, std::move(measure), request, guess, judge_expanded, prove);
  // what misses the tolerance holds its joints too; corrections are of what conversions give
  if (!(result.error <= request.settings.tolerance)) {
    Solution other = result.solution;
    elimination.hold(problem, condensation, other);
    const double error = judge_complete(other);
    if (error < result.error) {
      result.error = error;
      result.solution = std::move(other);
    }
  }
  return agreeing(problem, std::move(result), elimination, request.settings.tolerance);
}

/// Makes the joints agree if they contradict each other only by rounding, then solves.
template <class P>
Result solve_consistent(const P& given, const Request& request, const Solution& guess) {
  const std::optional<ConsistentJoints> joints = consistent_joints(given);
  if (!joints) return solve_global(given, given, request, guess);
  Result result = solve_global(with(given, *joints), given, request, guess);
  result.message = joints->words() + (result.message.empty() ? "" : "; " + result.message);
  return result;
}

/// The last report is of an iterate that may be another than the result, or be measured on another
/// form of the problem. So the history ends with the result.
void end_history(Result& result) {
  if (!result.history || result.history->empty()) return;
  const HistoryPoint last = result.history->back();
  if (last.error == result.error || !std::isfinite(result.error)) return;
  result.history->push_back(
      {result.iterations, result.error, std::max(last.time, result.time), last.stage});
}

/// What every solve does: checks and times, and a second solve from what the caller prefers.
template <class P, class Form>
Result solve_any(const P& problem, const Solver& solver, const Settings& settings,
                 const OptionValues& options, const Solution& guess, const Preference& prefer,
                 const Form& form) {
  check_tolerance(settings.tolerance);
  Kept kept;
  const auto solve_from = [&](const Solution& start) {
    Stopwatch watch;
    const Deadline deadline(settings.time_limit, settings.clock);
    const Request request{solver, settings, options, deadline, watch, kept};
    require_solvable(problem, request.solver, start);
    Result result = form(problem, request, start);
    end_history(result);
    // the time of the thread in the solver is already taken off
    result.setup_s += watch.read().cpu;
    return result;
  };
  Result result = solve_from(guess);
  if (!prefer || !result.converged() || result.iterations == 0) return result;
  const std::optional<Vector> preferred = prefer(result.solution);
  if (!preferred) return result;
  Result again = solve_from({.v = {}, .u = {}, .r = *preferred, .l = {}});
  return again.converged() ? again : result;
}

}  // namespace

const Solver& find_solver(std::string_view name) {
  if (name.starts_with(plugin_prefix)) return load_plugin(name);
  for (const Solver* solver : solvers()) {
    if (solver->name == name) return *solver;
  }
  std::string known;
  for (const Solver* solver : solvers()) known += (known.empty() ? "" : ", ") + solver->name;
  throw Error(ErrorKind::option, "unknown; there is: " + known,
              "solver '" + std::string(name) + "'");
}

template <class P>
Result solve(const P& problem, const Solver& solver, const Settings& settings,
             const OptionValues& options, const Solution& guess, const Preference& prefer) {
  if constexpr (std::derived_from<P, GlobalProblem>) {
    return solve_any(problem, solver, settings, options, guess, prefer, solve_consistent<P>);
  } else {
    return solve_any(problem, solver, settings, options, guess, prefer, solve_local<P>);
  }
}

#define FCLIB_INSTANTIATE(P)                                                              \
  template Result solve<P>(const P&, const Solver&, const Settings&, const OptionValues&, \
                           const Solution&, const Preference&);
FCLIB_FOR_EACH_FORMULATION(FCLIB_INSTANTIATE)
#undef FCLIB_INSTANTIATE

}  // namespace fclib
