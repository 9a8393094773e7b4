// auto: the default. A chain of methods, each cheap to leave, from the fastest that may do to the
// slowest that nearly always does:
//
//   0  r = 0, where nothing approaches
//   1  Gauss-Seidel sweeps on the whole, then on each island (contacts linked through W) left over
//   2  conjugate gradients on W r = -q, before the sweeps of an island: all may stick and rest
//      (before the sweeps of an island too, from a guess that is good: a few steps of Newton, or of
//      the proximal point)
//   3  proximal Newton ("polish"), where the error is small already
//   4  interior point with the shift in the Newton system, from near what the sweeps have, polished
//      as it comes near; where its path folds, sweeps for what it has cost, again from far away and
//      with shorter steps, and with the shift's kink smoothed
//   5  interior point on the associated problem: packings without a Slater point, where u = 0
//   6  semismooth Newton on the natural map
//   7  a proof that there is no solution (reduced/no_solution.hpp finds it, proof/no_solution.hpp
//      judges it on the data as they were given)
//   8  proximal point with an accurate inner solution, for some steps
//   9  homotopy: the path by its arclength, around its folds
//  10  proximal point to the end, the last resort
//
// 4 to 6 are for Coulomb's cone alone. Every stage returns to the best iterate so far, and most
// start from it; each island is held to its share of the tolerance. What a stage may cost is
// counted in operations, not in time: the same problem takes the same path on every machine.
//
// An iterate that is not finite ends the stage that made it, never the chain. Where the chain does
// not solve the problem from a guess it starts again from r = 0.

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <utility>

#include "linalg/cpu_time.hpp"
#include "methods/homotopy.hpp"
#include "methods/interior_point.hpp"
#include "methods/proximal_point.hpp"
#include "methods/semismooth_newton.hpp"
#include "reduced/gauss_seidel.hpp"
#include "reduced/no_solution.hpp"
#include "reduced/relative_error.hpp"
#include "reduced/scale.hpp"
#include "reduced/with_cone.hpp"
#include "solve/solver.hpp"

namespace fclib::automatic {

namespace {

struct Options {
  std::int64_t sweeps = 20;
  std::int64_t island_sweeps = 100;
  double polish_below = 1e-5;
  std::int64_t last_resort = 4000;
  std::int64_t threads = 1;

  static constexpr auto fields() {
    using O = Options;
    return std::tuple{
        OptionField<O, std::int64_t>{.name = "sweeps",
                                     .member = &O::sweeps,
                                     .unit = "sweeps",
                                     .doc = "of Gauss-Seidel on the whole problem",
                                     .lowest = 0},
        OptionField<O, std::int64_t>{.name = "island_sweeps",
                                     .member = &O::island_sweeps,
                                     .unit = "sweeps",
                                     .doc = "of Gauss-Seidel on each island that is left",
                                     .lowest = 0},
        OptionField<O, double>{.name = "polish_below",
                               .member = &O::polish_below,
                               .unit = "1",
                               .doc = "error under which the proximal Newton method is tried",
                               .lowest = 0},
        OptionField<O, std::int64_t>{.name = "last_resort",
                                     .member = &O::last_resort,
                                     .unit = "factorisations",
                                     .doc = "that the accurate proximal point method may take on "
                                            "an island",
                                     .lowest = 0},
        OptionField<O, std::int64_t>{.name = "threads",
                                     .member = &O::threads,
                                     .unit = "threads",
                                     .doc = "that share a large factorisation; the result is the "
                                            "same for any number",
                                     .lowest = 1,
                                     .highest = 256},
    };
  }
};

/// The names of the stages, as results and histories have them.
namespace stages {
// what it reaches is polished by the proximal point
constexpr std::string_view polished = "interior point, newton, proximal point";
constexpr StageKind gauss_seidel{"gauss-seidel", "splitting"};
constexpr StageKind conjugate_gradients{"conjugate gradients", "krylov"};
constexpr StageKind newton_from_guess{"newton from the guess", "newton"};
constexpr StageKind proximal_newton{"proximal newton", "newton, proximal point"};
constexpr StageKind interior_point{"interior point", polished};
constexpr StageKind interior_point_short{"interior point, shorter steps", polished};
constexpr StageKind interior_point_smoothed{"interior point, smoothed", polished};
constexpr StageKind associated{"associated", polished};
constexpr StageKind semismooth_newton{"semismooth newton", "newton"};
constexpr StageKind no_solution{"no solution?", "newton, proximal point"};
constexpr StageKind proximal_point{"proximal point", "newton, proximal point"};
constexpr StageKind homotopy{"homotopy", polished};
}  // namespace stages

/// Up to here the error is evaluated often: a few sweeps may do, and cost no more than it.
constexpr Index few_contacts = 10;

/// Of the semismooth Newton method: what it solves, it nearly always solves within these.
constexpr std::int64_t newton_iterations = 200;

/// ... and only where its factorisations take at most so many times the operations of the other
/// methods': hopeless where each contact is there many times, as collision detection may have them.
constexpr double most_newton_flops = 100;

/// Newton's method from a guess, where the error is less, needs few iterations, or fails: it must
/// be cheap where it does.
constexpr double good_guess = 0.03;
constexpr std::int64_t guess_iterations = 12;

/// The interior point starts at tau = far times the error of the sweeps, or least_tau: nearer to
/// them it saves iterations where they are good, and loses some where they are not.
constexpr double far = 4;
constexpr double least_tau = 0.03;

/// What the interior point reaches by itself.
constexpr double interior_accuracy = 1e-7;

/// Of the proximal point before the paths with folds: half of what it solves takes fewer.
constexpr std::int64_t proximal_trial = 200;

/// Of a path with folds: those that are passed at all mostly take fewer.
constexpr std::int64_t homotopy_factorisations = 1500;

/// From an iterate that is nearly a solution, the way to one may lead over errors that are far
/// larger.
constexpr double endless = std::numeric_limits<double>::infinity();

/// A proof that there is no solution must hold for reactions this many times the usual size.
constexpr double safe_bound = 1e4;

/// Operations, about: of a sweep, and of a factorisation with its solve and the rest of an
/// iteration.
double sweep_cost(const ReducedProblem& problem) {
  return 60.0 * static_cast<double>(problem.nc()) + static_cast<double>(problem.W.entries());
}
double factorisation_cost(const ReducedProblem& problem, const CoupledSystem& system) {
  return 1500.0 * static_cast<double>(problem.nc()) + system.flops();
}

/// Follows the whole solve: iterations, stages, the error of the islands not being worked on.
class Tracker {
 public:
  explicit Tracker(const Settings& settings) : monitor_(settings) {}

  [[nodiscard]] double tolerance() const { return monitor_.tolerance(); }
  [[nodiscard]] std::optional<Status> stopped() const { return stopped_; }
  [[nodiscard]] std::int64_t iterations() const { return iterations_; }
  [[nodiscard]] std::vector<Stage>& stages() { return stages_; }

  /// There is no solution.
  void refuse() { stopped_ = Status::infeasible; }

  /// CPU time of other threads than the caller's [s].
  void add_cpu(double seconds) { others_cpu_ += seconds; }
  [[nodiscard]] double others_cpu() const { return others_cpu_; }

  /// The squared error of all contacts but those worked on now.
  void set_others(double squared) { others_ = squared; }

  /// Counts iterations and tells of the error that is left. Whether to end the stage: because
  /// everything stops, or because the iterate is not finite.
  bool report(std::int64_t iterations, double error) {
    const bool first = iterations_ == 0 && !reported_;
    iterations_ += iterations;
    reported_ = true;
    const double all = std::sqrt(others_ + error * error);
    const bool finite = std::isfinite(all);
    if (!stopped_ && (iterations > 0 || first)) {
      // what has overflown is not an error to tell of, but its iterations count
      if (finite) told_ = all;
      stopped_ = monitor_.report(iterations_, told_);
    }
    return stopped_.has_value() || !finite;
  }
  /// Iterations that may still be made.
  [[nodiscard]] std::int64_t left() const { return monitor_.max_iterations() - iterations_; }

  template <class F>
  void stage(const StageKind& kind, const F& run) {
    auto at = std::find_if(stages_.begin(), stages_.end(),
                           [&](const Stage& stage) { return stage.kind.name == kind.name; });
    if (at == stages_.end()) at = stages_.insert(stages_.end(), Stage{.kind = kind});
    monitor_.enter(kind.name);
    const auto place = at - stages_.begin();  // stages may be entered one inside another
    const auto start = std::chrono::steady_clock::now();
    const auto before = iterations_;
    const auto [factorisations, solved] = run();
    Stage& stage = stages_[static_cast<std::size_t>(place)];
    ++stage.calls;
    stage.solved += solved;
    stage.iterations += iterations_ - before;
    stage.factorisations += factorisations;
    stage.time += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  }

 private:
  Monitor monitor_;
  double others_ = 0;
  double told_ = std::numeric_limits<double>::max();  // the last error that was finite
  double others_cpu_ = 0;
  std::int64_t iterations_ = 0;
  bool reported_ = false;
  std::optional<Status> stopped_;
  std::vector<Stage> stages_;
};

template <class Cone>
class Island {
 public:
  static constexpr int D = Cone::dim;

  /// `proves` says whether y (nc of the island) proves that there is no solution.
  Island(const ReducedProblem& problem, const Options& options, Tracker& tracker, double tolerance,
         bool guessed, std::function<bool(const Vector&)> proves)
      : problem_(problem),
        options_(options),
        tracker_(tracker),
        tolerance_(tolerance),
        guessed_(guessed),
        proves_(std::move(proves)) {
    gauss_seidel_.emplace(problem);
  }

  /// From r; the best iterate ends in r. Its error relative to the problem's scale.
  double solve(Vector& r, std::int64_t sweeps, bool whole) {
    r_ = r;
    problem_.velocity(r_, u_);
    best_ = r_;
    error_ = relative_error<Cone>(problem_, u_, r_);
    if (!std::isfinite(error_)) error_ = endless;  // anything is better
    tracker_.report(0, error_);
    if (!whole && problem_.nc() >= 20)
      stage(stages::conjugate_gradients, [&] { conjugate_gradients(); });
    if (!whole && guessed_ && problem_.nc() >= 5 && error_ < good_guess && !done()) {
      // the contacts' statuses are nearly known: on few bodies the proximal point is cheaper
      if (CoupledSystem::bodies_are_fewer(problem_)) {
        stage(stages::proximal_newton, [&] { polish(best_, guess_iterations); });
      } else {
        semismooth_newton(stages::newton_from_guess, ContactFunctionKind::alart_curnier,
                          {.sweeps = 0, .patience = 3}, best_, guess_iterations);
      }
    }
    if (!done()) stage(stages::gauss_seidel, [&] { return sweep(sweeps, whole); });
    if (!whole && !done()) continue_by_newton();
    r = best_;
    return error_;
  }

 private:
  [[nodiscard]] bool done() const { return error_ <= tolerance_ || tracker_.stopped(); }

  /// Keeps r where it is the best so far. Whether to end the stage.
  bool take(std::int64_t iterations, double error, const Vector& r) {
    if (error < error_) {
      error_ = error;
      best_ = r;
    }
    return tracker_.report(iterations, error) || done();
  }

  /// Sweeps from the best iterate; what is kept of each contact is lost where it has overflown.
  void return_to_best() {
    r_ = best_;
    problem_.velocity(r_, u_);
    gauss_seidel_.emplace(problem_);
  }

  template <class F>
  void stage(const StageKind& kind, const F& run) {
    tracker_.stage(kind, [&] {
      const auto before = system_ ? system_->factorisations() : 0;
      const double cpu = system_ ? system_->others_cpu() : 0;
      run();
      if (system_) tracker_.add_cpu(system_->others_cpu() - cpu);
      return std::pair((system_ ? system_->factorisations() : 0) - before, error_ <= tolerance_);
    });
  }

  CoupledSystem& system() {
    if (!system_) {
      system_.emplace(problem_, CoupledSystem::Form::identity, static_cast<int>(options_.threads));
    }
    return *system_;
  }

  void sweep(std::int64_t limit, bool whole) {
    constexpr std::int64_t interval = 5;
    double last = error_;
    std::int64_t k = 0;
    while (k < limit) {
      // some are solved by the first sweep, a few contacts by some
      const bool few = problem_.nc() <= few_contacts;
      const std::int64_t wanted = k == 0         ? 1
                                  : k < interval ? (few ? k + 1 : interval - 1)
                                                 : interval;
      const std::int64_t count = std::min({wanted, limit - k, tracker_.left()});
      for (std::int64_t j = 0; j < count; ++j) gauss_seidel_->sweep(r_, u_);
      k += count;
      double error = relative_error<Cone>(problem_, u_, r_);
      if (error <= tolerance_) {
        problem_.velocity(r_, u_);
        error = relative_error<Cone>(problem_, u_, r_);
      }
      if (take(count, error, r_)) {
        if (!std::isfinite(error)) return_to_best();
        return;
      }
      // on an island, only while the sweeps to go cost less than a dozen factorisations
      if (!whole && k >= 2 * interval && k >= limit / 4) {
        const double rate = std::log(last / error) / static_cast<double>(count);
        const double left = std::log(error / tolerance_) / rate;
        if (!(rate > 0) ||
            left * sweep_cost(problem_) > 12 * factorisation_cost(problem_, system())) {
          return;
        }
        if (k == limit && left < 20 * static_cast<double>(limit)) limit += interval;
      }
      last = error;
    }
  }

  /// From the best iterate, while it may end for what the factorisations have cost so far: for a
  /// loose tolerance it often does, where the interior points fail.
  void sweep_on() {
    constexpr std::int64_t interval = 10;
    const double budget = static_cast<double>(system().factorisations()) *
                          factorisation_cost(problem_, system()) / sweep_cost(problem_);
    r_ = best_;
    problem_.velocity(r_, u_);
    double least = std::numeric_limits<double>::infinity();  // error since the last look
    double marked = least;                                   // ... and before it
    std::int64_t mark = 0;                                   // sweeps at the last look
    for (std::int64_t k = interval; static_cast<double>(k) < budget; k += interval) {
      const std::int64_t count = std::min(interval, tracker_.left());
      for (std::int64_t j = 0; j < count; ++j) gauss_seidel_->sweep(r_, u_);
      problem_.velocity(r_, u_);
      const double error = relative_error<Cone>(problem_, u_, r_);
      if (take(count, error, r_)) {
        if (!std::isfinite(error)) return_to_best();
        return;
      }
      least = std::min(least, error);
      if (k < 2 * mark || k < 5 * interval) continue;
      const double rate = std::log(marked / least) / static_cast<double>(k - mark);
      const double left = std::log(least / tolerance_) / rate;
      if (!(rate > 0) || left > 2 * (budget - static_cast<double>(k))) return;
      marked = least;
      least = std::numeric_limits<double>::infinity();
      mark = k;
    }
  }

  void continue_by_newton() {
    if (!done() && error_ < options_.polish_below) {
      stage(stages::proximal_newton, [&] { return polish(best_); });
    }
    start_ = best_;
    const Vector swept = best_;
    const Vector zero = Vector::Zero(problem_.m());
    if constexpr (std::is_same_v<Cone, Coulomb<D>>) {
      if (!done())
        stage(stages::interior_point,
              [&] { interior_point({.tau = std::clamp(far * error_, least_tau, 1.0)}, swept); });
      if (!done()) stage(stages::gauss_seidel, [&] { sweep_on(); });
      // where its path folds, another may pass
      if (!done()) {
        stage(stages::interior_point_short, [&] {
          interior_point({.tau = 10, .step_cap = 0.8, .delta = 1e-3, .max_iterations = 100}, zero);
        });
      }
      if (!done()) stage(stages::gauss_seidel, [&] { sweep_on(); });
      if (!done()) {
        stage(stages::interior_point_smoothed, [&] {
          interior_point({.smoothing = 1, .step_cap = 0.8, .delta = 1e-3, .max_iterations = 100},
                         swept);
        });
      }
      if (!done()) stage(stages::associated, [&] { associated(); });
      // from nothing: where it converges, it does from there as well as from an iterate that
      // another method is stuck at; slower than the proximal point on rolling contacts
      if (!done()) {
        semismooth_newton(stages::semismooth_newton, ContactFunctionKind::natural_map, {}, zero,
                          newton_iterations, most_newton_flops);
      }
    }
    if (!done()) stage(stages::no_solution, [&] { prove_no_solution(); });
    // where it converges from there, it does soon
    if (!done()) {
      stage(stages::proximal_point,
            [&] { proximal({.kappa = 10, .max_factorisations = proximal_trial}, best_); });
    }
    // another width of smoothing is another path
    for (const double smoothing : {0.3, 1.0}) {
      if (!done()) stage(stages::homotopy, [&] { homotopy(smoothing); });
    }
    // from the associated solution, then from the best iterate, which is another
    std::int64_t left = options_.last_resort;
    for (std::int64_t limit = 400; !done() && left > 0; limit *= 2) {
      limit = std::min(limit, left);
      stage(stages::proximal_point, [&] {
        proximal({.kappa = 10, .patience = endless, .max_factorisations = limit}, start_);
      });
      left -= limit;
      start_ = best_;
    }
  }

  /// On W r = -q from the guess, or from nothing, preconditioned by tr(W_aa); given up where r
  /// leaves the cones for good.
  void conjugate_gradients() {
    constexpr std::int64_t most = 400;
    constexpr std::int64_t trial = 15;
    const std::int64_t limit = std::min(most, tracker_.left());
    Vector inverse(problem_.nc());
    for (Index a = 0; a < problem_.nc(); ++a) {
      const double trace = problem_.W.template diagonal_block<D>(a).trace();
      if (!(trace > 0)) return;
      inverse[a] = D / trace;
    }
    const auto precondition = [&](const Vector& x, Vector& y) {
      for (Index a = 0; a < problem_.nc(); ++a) {
        y.template segment<D>(D * a) = inverse[a] * x.template segment<D>(D * a);
      }
    };
    const Vector zero = Vector::Zero(problem_.m());
    Vector r = guessed_ ? best_ : zero;
    Vector residual;
    problem_.velocity(r, residual);
    residual = -residual;
    Vector z(problem_.m());
    Vector product(problem_.m());
    precondition(residual, z);
    Vector direction = z;
    double rz = residual.dot(z);
    double last = residual.norm();
    for (std::int64_t k = 1; k <= limit; ++k) {
      problem_.W.multiply_add(direction, zero, product);
      const double curvature = direction.dot(product);
      if (!(curvature > 0)) return;
      const double length = rz / curvature;
      r += length * direction;
      residual -= length * product;
      const double size = residual.norm();
      if (k == 5 && violation(r) > 1e-2) return;
      if (k % trial == 0) {
        // at this rate, is it done within the limit?
        const double rate = std::log(last / size) / trial;
        const double left = std::log(size / (tolerance_ * problem_.scale)) / rate;
        if (violation(r) > 1e-2 || !(rate > 0) || left > static_cast<double>(limit)) return;
        if (tracker_.report(trial, error_)) return;
        last = size;
      }
      if (size <= tolerance_ * problem_.scale) {
        Vector inside = r;
        project(inside);
        Vector u(problem_.m());
        problem_.velocity(inside, u);
        if (take(k % trial, relative_error<Cone>(problem_, u, inside), inside)) return;
        // what is left is that r is not in the cones
        if (size <= 0.01 * tolerance_ * problem_.scale) return;
      }
      precondition(residual, z);
      const double next = residual.dot(z);
      direction = z + (next / rz) * direction;
      rz = next;
    }
    if (limit < most) tracker_.report(limit % trial, error_);
  }

  void project(Vector& r) const {
    for (Index a = 0; a < problem_.nc(); ++a) {
      auto part = r.template segment<D>(D * a);
      part = Cone(problem_.friction, a).project(part);
    }
  }
  [[nodiscard]] double violation(const Vector& r) const {
    Vector inside = r;
    project(inside);
    return (r - inside).norm() / r.norm();
  }

  void proximal(const ProximalRules& rules, Vector r) {
    ProximalPoint<Cone> method(problem_, system());
    const double error =
        method.solve(rules, tolerance_, r, [&](double at) { return tracker_.report(1, at); });
    take(0, error, r);
  }

  void polish(const Vector& r, std::int64_t factorisations = 24) {
    proximal({.kappa = 1000, .easy = 10, .hard = 0.2, .max_factorisations = factorisations}, r);
  }

  void interior_point(const InteriorPointRules& rules, const Vector& guess) {
    InteriorPoint<D> method(problem_, system());
    double next_polish = options_.polish_below;
    // the last steps to a loose tolerance are its own
    const double near = tolerance_ > interior_accuracy ? 30 * tolerance_ : 0;
    method.solve(rules, guess, [&](double error, const Vector& r) {
      if (take(1, error, r)) return true;
      if (error > near && error < next_polish) {
        polish(r);
        next_polish = error / 30;
      }
      return done();
    });
  }

  /// Around the folds of the path.
  void homotopy(double smoothing) {
    Homotopy<Cone> method(problem_, system());
    double next_polish = 10 * options_.polish_below;
    Vector last = best_;
    method.solve({.smoothing = smoothing, .max_factorisations = homotopy_factorisations},
                 [&](double error, const Vector& r) {
                   if (take(1, error, r)) return true;
                   last = r;
                   if (error < next_polish) {
                     polish(r);
                     next_polish = error / 10;
                   }
                   return done();
                 });
    if (!done()) {
      proximal(
          {.kappa = 100, .easy = 10, .hard = 0.2, .patience = endless, .max_factorisations = 200},
          last);
    }
  }

  /// Always on the contacts.
  void semismooth_newton(const StageKind& kind, ContactFunctionKind function,
                         const NewtonRules& rules, Vector r, std::int64_t left,
                         double most = std::numeric_limits<double>::infinity()) {
    tracker_.stage(kind, [&] {
      SemismoothNewton<Cone> newton(problem_, function, static_cast<int>(options_.threads));
      if (std::isfinite(most) && newton.system().flops() > most * system().flops())
        return std::pair(std::int64_t{0}, false);
      double least = std::numeric_limits<double>::infinity();
      newton.solve(rules, r, [&](double error) {
        least = std::min(least, error);
        return tracker_.report(1, error) || error <= tolerance_ || --left == 0;
      });
      take(0, least, r);
      tracker_.add_cpu(newton.system().others_cpu());
      return std::pair(newton.factorisations(), done());
    });
  }

  /// The proximal point iterates of the frictionless problem, which is convex, go to infinity along
  /// a ray of proof where there is no solution (Pazy 1971), and converge where there is one.
  void prove_no_solution() {
    ReducedProblem frictionless = problem_;
    frictionless.friction.mu.setZero();
    frictionless.friction.mu_r.setZero();
    const double usual = problem_.q.norm() / mean_diagonal(problem_);
    CoupledSystem system(frictionless);
    ProximalPoint<Cone> method(frictionless, system);
    Vector r = Vector::Zero(problem_.m());
    Vector last = r;
    Vector step = r;
    Vector y(problem_.nc());
    const ProximalRules rules{.kappa = 100,
                              .kappa_max = 1e12,
                              .easy = 100,
                              .hard = 0.1,
                              .patience = endless,
                              .max_factorisations = 60};
    method.solve(rules, 1e-10, r, [&](double) {
      // the steps tend to the ray, free of the part of r that stays
      step = method.iterate() - last;
      last = method.iterate();
      double largest = 0;
      for (Index a = 0; a < problem_.nc(); ++a) largest = std::max(largest, step[D * a]);
      // contacts outside the ray keep small parts, which are left out
      for (const double least : {1e-9, 1e-6, 1e-3}) {
        for (Index a = 0; a < problem_.nc(); ++a) {
          y[a] = step[D * a] > least * largest ? step[D * a] / largest : 0;
        }
        // here it may be rounding of what was eliminated: the data as they were given decide
        if (no_solution_bound<Cone>(problem_, y) > safe_bound * usual && proves_(y)) {
          tracker_.refuse();
          return true;
        }
      }
      return tracker_.report(1, error_);
    });
  }

  /// Where the associated problem's velocity tends to zero, its reactions solve this one. Else what
  /// it had on the way is where the proximal point starts.
  void associated() {
    InteriorPoint<D> method(problem_, system());
    double next_polish = options_.polish_below;
    bool near = false;
    method.solve({.associated = true}, Vector::Zero(problem_.m()),
                 [&](double error, const Vector& r) {
                   if (take(1, error, r)) return true;
                   if (!near && method.tau() < 1e-4) {
                     near = true;
                     start_ = r;
                   }
                   if (method.tau() < 1e-4 && method.speed() > 0.05) return true;
                   if (method.tau() < 1e-6 && method.speed() > 1e-3) return true;
                   if (error < next_polish) {
                     polish(r);
                     next_polish = error / 30;
                   }
                   return done();
                 });
  }

  const ReducedProblem& problem_;
  const Options& options_;
  Tracker& tracker_;
  double tolerance_;
  bool guessed_;
  std::function<bool(const Vector&)> proves_;
  std::optional<GaussSeidel<Cone>> gauss_seidel_;
  std::optional<CoupledSystem> system_;
  Vector r_, u_, best_;
  Vector start_;  // of the last resort
  double error_ = 0;
};

/// The part of a problem that these contacts are.
ReducedProblem restricted(const ReducedProblem& problem, const std::vector<Index>& contacts) {
  const int d = problem.d();
  ReducedProblem part{.W = problem.W.restricted(contacts),
                      .q = {},
                      .friction = {},
                      .scale = problem.scale,
                      .rho = {},
                      .scaled_scale = problem.scaled_scale,
                      .deadline = problem.deadline};
  const auto count = static_cast<Eigen::Index>(contacts.size());
  if (problem.rho.size() > 0) part.rho = problem.rho(contacts);
  part.q.resize(d * count);
  part.friction.mu.resize(count);
  if (problem.rolling()) part.friction.mu_r.resize(count);
  for (Eigen::Index k = 0; k < count; ++k) {
    part.q.segment(d * k, d) = problem.q.segment(d * contacts[k], d);
    part.friction.mu[k] = problem.friction.mu[contacts[k]];
    if (problem.rolling()) part.friction.mu_r[k] = problem.friction.mu_r[contacts[k]];
  }
  return part;
}

/// The chain from r, on the whole and then on each island that is left; what it reaches ends in r.
template <class Cone>
void chain(const ReducedProblem& problem, const Options& options, Tracker& tracker, bool guessed,
           Vector& r) {
  constexpr int D = Cone::dim;
  const Index nc = problem.nc();
  const double tolerance = tracker.tolerance();
  tracker.set_others(0);
  std::optional<Island<Cone>> whole;
  const auto proves = [&](const Vector& y) {
    return problem.proves_no_solution != nullptr && (*problem.proves_no_solution)(y);
  };
  whole.emplace(problem, options, tracker, tolerance, guessed, proves);
  whole->solve(r, nc <= 2 ? 5 : options.sweeps, true);
  if (tracker.stopped()) return;
  const std::vector<Index> group = problem.W.components();
  const Index count = 1 + *std::max_element(group.begin(), group.end());
  if (count == 1) {
    whole->solve(r, options.island_sweeps, false);
    return;
  }
  whole.reset();

  std::vector<std::vector<Index>> islands(static_cast<std::size_t>(count));
  for (Index a = 0; a < nc; ++a) islands[group[a]].push_back(a);
  Vector u;
  problem.velocity(r, u);
  std::vector<double> squared(islands.size(), 0.0);
  std::vector<double> scaled(islands.size(), 0.0);
  double sum = 0;
  for (Index a = 0; a < nc; ++a) {
    const Cone cone(problem.friction, a);
    const typename Cone::Vec ua = u.template segment<D>(D * a);
    const typename Cone::Vec ra = r.template segment<D>(D * a);
    const double error = natural_map(cone, ua, ra).squaredNorm() / (problem.scale * problem.scale);
    squared[group[a]] += error;
    sum += error;
    if (problem.rho.size() > 0) {
      scaled[group[a]] += natural_map(cone, ua, ra, problem.rho[a]).squaredNorm() /
                          (problem.scaled_scale * problem.scaled_scale);
    }
  }
  if (problem.rho.size() > 0) {  // of each island the larger error
    sum = 0;
    for (std::size_t k = 0; k < islands.size(); ++k) {
      squared[k] = std::max(squared[k], scaled[k]);
      sum += squared[k];
    }
  }
  for (std::size_t k = 0; k < islands.size() && !tracker.stopped(); ++k) {
    const std::vector<Index>& contacts = islands[k];
    const double share =
        tolerance * std::sqrt(static_cast<double>(contacts.size()) / static_cast<double>(nc));
    if (squared[k] <= share * share) continue;
    const ReducedProblem part = restricted(problem, contacts);
    const auto size = static_cast<Eigen::Index>(contacts.size());
    Vector x(D * size);
    for (Eigen::Index j = 0; j < size; ++j)
      x.template segment<D>(D * j) = r.template segment<D>(D * contacts[j]);
    sum = std::max(0.0, sum - squared[k]);
    tracker.set_others(sum);
    const auto proves_island = [&](const Vector& y) {
      Vector padded = Vector::Zero(nc);
      for (Eigen::Index j = 0; j < size; ++j) padded[contacts[static_cast<std::size_t>(j)]] = y[j];
      return proves(padded);
    };
    const double error = Island<Cone>(part, options, tracker, share, guessed, proves_island)
                             .solve(x, options.island_sweeps, false);
    sum += error * error;
    for (Eigen::Index j = 0; j < size; ++j)
      r.template segment<D>(D * contacts[j]) = x.template segment<D>(D * j);
  }
}

template <class Cone>
double error_at(const ReducedProblem& problem, const Vector& r) {
  Vector u;
  problem.velocity(r, u);
  const double error = relative_error<Cone>(problem, u, r);
  return std::isfinite(error) ? error : endless;
}

template <class Cone>
Outcome iterate(const ReducedProblem& problem, const Options& options, const Settings& settings,
                Vector& r) {
  constexpr int D = Cone::dim;
  const Index nc = problem.nc();
  Tracker tracker(settings);
  const double start = options.threads > 1 ? cpu_time() : 0.0;  // the clock takes 0.3 microseconds
  const auto outcome = [&] {
    Outcome result{tracker.stopped().value_or(Status::stalled), tracker.iterations(),
                   std::move(tracker.stages())};
    if (options.threads > 1) result.cpu_s = cpu_time() - start + tracker.others_cpu();
    return result;
  };
  bool separating = true;
  for (Index a = 0; a < nc && separating; ++a) separating = problem.q[D * a] >= 0;
  if (separating) {
    r.setZero();
    tracker.report(0, 0.0);
    return outcome();
  }

  const Vector zero = Vector::Zero(problem.m());
  bool guessed = (r.array() != 0).any();
  if (guessed && error_at<Cone>(problem, r) == endless) {
    r = zero;
    guessed = false;
  }
  chain<Cone>(problem, options, tracker, guessed, r);
  if (guessed && !tracker.stopped() && error_at<Cone>(problem, r) > tracker.tolerance()) {
    Vector cold = zero;
    chain<Cone>(problem, options, tracker, false, cold);
    if (error_at<Cone>(problem, cold) < error_at<Cone>(problem, r)) r = cold;
  }
  return outcome();
}

Outcome solve(const ReducedProblem& problem, const OptionValues& values, const Settings& settings,
              Vector& r) {
  const auto options = parse_options<Options>(values);
  return with_cone(problem,
                   [&]<class Cone>() { return iterate<Cone>(problem, options, settings, r); });
}

}  // namespace

const Solver& solver() {
  static const Solver entry{
      .name = "auto",
      .family = "chain",
      .title = "The default: a chain from Gauss-Seidel to interior and proximal points",
      .citation = "this project",
      .dimensions = {2, 3},
      .rolling_dimensions = {3, 5},
      .options = describe_options<Options>(),
      .max_iterations = 1'000'000,
      .solve = solve,
  };
  return entry;
}

}  // namespace fclib::automatic
