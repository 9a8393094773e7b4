#include "chain/stages.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <utility>

#include "chain/chain.hpp"
#include "linalg/cpu_time.hpp"
#include "linalg/memory.hpp"
#include "methods/alternating_directions.hpp"
#include "methods/homotopy.hpp"
#include "methods/pivoting.hpp"
#include "methods/product_interior_point.hpp"
#include "methods/spectral_gradient.hpp"
#include "reduced/convex_sets.hpp"
#include "reduced/de_saxce_shift.hpp"
#include "reduced/in_own_units.hpp"
#include "reduced/no_solution.hpp"
#include "reduced/relative_error.hpp"
#include "reduced/scale.hpp"

namespace fclib::chain {

namespace {

// What no table sets. workshop/tuning/constants.py tries other values of some.

// Operations: of a sweep, for each contact, besides one for each entry of W; and of a factorisation
// with its solve and the rest of an iteration, over its multiplications.
constexpr double sweep_operations = 60;
constexpr double iteration_operations = 1500;
// The time of a multiplication of a factorisation, over that of an operation of a sweep. The first
// sweeps are weighed so; what goes on later may cost more than the factorisations.
constexpr double time_of_multiplication = 0.25;

constexpr double never_too_much = 256e6;    // [bytes] Factors of this size always fit.
constexpr double spare_memory = 0.8;        // share of the available memory that factors may take
constexpr double instead_of_factors = 100;  // cost of steps [factorisations] without memory

// Gauss-Seidel
constexpr std::int64_t sweeps_per_look = 5;  // sweeps between two looks at the error
constexpr Index few_contacts = 10;           // so few are looked at after 1, 3 and 7 sweeps
constexpr double extension = 20;  // an end is in sight if at most so many limits are left
constexpr double hope = 2;  // sweeps end at so many times the last number with an end in sight

// sweeps and gradients that go on
constexpr std::int64_t steps_per_look = 10;  // steps between two looks at the error
constexpr double rate_slack = 2;             // more steps may be needed than are paid for

// conjugate gradients
constexpr std::int64_t first_cone_look = 5;       // iterations before the first look at the cones
constexpr std::int64_t steps_per_cone_look = 15;  // ... and between two looks
constexpr double most_outside = 1e-2;             // share of ||r|| that may be outside the cones
constexpr double exact_residual = 0.01;           // [tolerance] What is left is not in the cones.

// In own units the chain goes on to this part of the tolerance, if no iterate is good enough
// before.
constexpr double own_tolerance = 1e-2;

// polishing on the way
constexpr double polish_below = 1e-5;       // a polish is tried below this error
constexpr double sooner_on_two_cones = 10;  // ... so much sooner where paths lose digits (rolling)
constexpr double polish_below_on_path = 1e-4;  // ... on the path of the homotopy
constexpr double next_polish = 30;             // it is tried again if the error is so much less
constexpr double next_polish_of_rounds = 10;   // ... if one step of the path costs much
constexpr double own_accuracy = 1e-7;          // if the tolerance is looser, no polish is needed

// The associated problem ends if its velocity [||q||] does not tend to zero with tau.
constexpr double near_tau = 1e-4;
constexpr double fast_speed = 0.05;
constexpr double nearer_tau = 1e-6;
constexpr double slow_speed = 1e-3;

constexpr std::int64_t steps_after_path = 200;  // factorisations after the end of the path
constexpr double safe_bound = 1e4;  // [||q|| / mean of tr(W_aa) / d] ||r|| that a proof excludes
constexpr double proof_accuracy = 1e-10;

// pivoting
constexpr std::int64_t most_pivots = 1000;      // pivots of a try
constexpr std::int64_t polish_of_pivots = 100;  // factorisations of the polish of each try
constexpr double most_rounding = 1;             // [tolerance] on a ray reactions have no bound

// random starts
constexpr std::int64_t random_limit = 60;   // iterations of Newton
constexpr std::int64_t random_sweeps = 5;   // sweeps if Newton's method stands still
constexpr std::int64_t random_polish = 24;  // factorisations of the polish

/// Operations of a sweep, and of a factorisation with the rest of an iteration.
double sweep_cost(const ReducedProblem& problem) {
  return sweep_operations * static_cast<double>(problem.nc()) +
         static_cast<double>(problem.W.entries());
}
/// Of an iteration without its factorisation: what one costs at least, and no system is analysed.
double least_factorisation_cost(const ReducedProblem& problem) {
  return iteration_operations * static_cast<double>(problem.nc());
}
double factorisation_cost(const ReducedProblem& problem, const CoupledSystem& system) {
  return least_factorisation_cost(problem) + system.flops();
}

/// Of a solve with the factors.
double solve_cost(const CoupledSystem& system) { return 2 * system.bytes() / sizeof(double); }

/// Random numbers, the same on every machine.
class Random {
 public:
  double between(double least, double most) {
    constexpr int dropped = 11;  // bits of 64 that a double does not hold
    return least + (most - least) * std::ldexp(static_cast<double>(generator_() >> dropped), -53);
  }

 private:
  std::mt19937_64 generator_;
};

/// Looks now and then at the least error, and whether its rate reaches the tolerance within the
/// steps that are paid for.
class ConvergenceRate {
 public:
  ConvergenceRate(std::int64_t first_look, double budget, double tolerance)
      : first_look_(first_look), budget_(budget), tolerance_(tolerance) {}

  /// Call after k steps.
  bool hopeless(std::int64_t k, double error) {
    least_ = std::min(least_, error);
    if (k < 2 * mark_ || k < first_look_) return false;
    const double rate = std::log(marked_ / least_) / static_cast<double>(k - mark_);
    const double left = std::log(least_ / tolerance_) / rate;
    if (!(rate > 0) || left > rate_slack * (budget_ - static_cast<double>(k))) return true;
    marked_ = least_;
    least_ = endless;
    mark_ = k;
    return false;
  }

 private:
  std::int64_t first_look_;
  double budget_;
  double tolerance_;
  double least_ = endless;   // error since the last look
  double marked_ = endless;  // ... and before it
  std::int64_t mark_ = 0;    // steps at the last look
};

}  // namespace

template <class Cone>
Island<Cone>::Island(const ReducedProblem& problem, const Table& table, const Resources& resources,
                     Tracker& tracker, double tolerance, bool guessed,
                     std::function<bool(const Vector&)> proves)
    : problem_(problem),
      table_(table),
      resources_(resources),
      tracker_(tracker),
      tolerance_(tolerance),
      guessed_(guessed),
      proves_(std::move(proves)) {
  gauss_seidel_.emplace(problem);
}

template <class Cone>
double Island<Cone>::solve(Vector& r, On on) {
  r_ = r;
  problem_.velocity(r_, u_);
  best_ = r_;
  error_ = relative_error<Cone>(problem_, u_, r_);
  if (!std::isfinite(error_)) error_ = endless;  // any iterate is better
  tracker_.report(0, error_, r_);
  for (const StageRule& rule : table_) {
    if (done()) break;
    if (rule.when.on != on) continue;
    remember(rule);
    if (applies(rule) && affordable(rule)) enter(rule);
  }
  r = best_;
  return error_;
}

template <class Cone>
void Island<Cone>::remember(const StageRule& rule) {
  if (swept_.size() > 0) return;
  const auto from = chosen_start(rule.method);
  if (from == Start::swept || from == Start::associated) swept_ = best_;
}

template <class Cone>
bool Island<Cone>::applies(const StageRule& rule) const {
  const When& when = rule.when;
  const bool coulomb = std::is_same_v<Cone, Coulomb<D>>;
  if (problem_.nc() < when.at_least) return false;
  if (when.at_most > 0 && problem_.nc() > when.at_most) return false;
  if (when.below > 0 && !(error_ < when.below)) return false;
  if (when.guessed && !guessed_) return false;
  if ((when.law == Law::coulomb || coulomb_alone(rule.method)) && !coulomb) return false;
  if (when.law == Law::rolling && coulomb) return false;
  if (when.jointed > 0 && !(jointed() > when.jointed)) return false;
  if (when.range > 0 && !(range_of_units(problem_) > when.range)) return false;
  return when.bodies == Bodies::any ||
         (when.bodies == Bodies::fewer) == CoupledSystem::bodies_are_fewer(problem_);
}

template <class Cone>
bool Island<Cone>::affordable(const StageRule& rule) {
  return !factorises(rule.method) || fits(system().bytes());
}

template <class Cone>
bool Island<Cone>::fits(double bytes) {
  if (resources_.memory == 0 && bytes < never_too_much) return true;
  const double limit =
      resources_.memory > 0 ? resources_.memory : spare_memory * available_memory();
  if (bytes <= limit) return true;
  tracker_.without_factors(bytes, limit);
  return false;
}

template <class Cone>
double Island<Cone>::jointed() const {
  double most = 0;
  for (Eigen::Index a = 0; a < problem_.rho.size(); ++a) {
    const double left = problem_.W.template diagonal_block<D>(static_cast<Index>(a)).trace() / D;
    most = std::max(most, 1 - left * problem_.rho[a]);
  }
  return most;
}

template <class Cone>
void Island<Cone>::enter(const StageRule& rule) {
  tracker_.stage(rule.name, families_of(rule.method), [&] {
    const auto before = system_ ? system_->factorisations() : 0;
    const double cpu = system_ ? system_->others_cpu() : 0;
    own_factorisations_ = 0;
    std::visit([&](const auto& method) { run(method); }, rule.method);
    if (system_) tracker_.add_cpu(system_->others_cpu() - cpu);
    return std::pair(own_factorisations_ + (system_ ? system_->factorisations() : 0) - before,
                     error_ <= tolerance_);
  });
}

template <class Cone>
Vector Island<Cone>::start_of(Start from) const {
  switch (from) {
    case Start::nothing:
      return Vector::Zero(problem_.m());
    case Start::best:
      return best_;
    case Start::swept:
      return swept_;
    case Start::associated:
      return associated_.size() > 0 ? associated_ : swept_;
  }
  return best_;
}

template <class Cone>
bool Island<Cone>::take(std::int64_t iterations, double error, const Vector& r) {
  if (error < error_) {
    error_ = error;
    best_ = r;
  }
  return tracker_.report(iterations, error, r) || done();
}

template <class Cone>
void Island<Cone>::return_to_best() {
  r_ = best_;
  problem_.velocity(r_, u_);
  gauss_seidel_.emplace(problem_);
}

template <class Cone>
CoupledSystem& Island<Cone>::system() {
  if (!system_) {
    system_.emplace(problem_, CoupledSystem::Form::identity, resources_.threads);
  }
  return *system_;
}

template <class Cone>
bool Island<Cone>::pays(double operations, double factorisations) {
  return operations <= factorisations * least_factorisation_cost(problem_) ||
         operations <= factorisations * (least_factorisation_cost(problem_) +
                                         time_of_multiplication * system().flops());
}

template <class Cone>
void Island<Cone>::run(const GaussSeidelStage& rules) {
  const std::int64_t interval = sweeps_per_look;
  const double worth = rules.worth * std::max(1.0, -std::log10(tolerance_));
  const bool asks = rules.left > 0 || rules.worth > 0;
  std::vector<std::pair<std::int64_t, double>> looks;  // sweeps, and the error after them
  std::size_t middle = 0;                              // the last look of the first half
  std::int64_t in_sight = 0;  // sweeps at the last look with an end in sight
  const auto most_sweeps = [&] {
    return std::max(rules.limit, static_cast<std::int64_t>(hope * static_cast<double>(in_sight)));
  };
  std::int64_t k = 0;
  while (k < most_sweeps()) {
    // one sweep solves some problems; a few sweeps solve some with few contacts
    const bool few = problem_.nc() <= few_contacts;
    const std::int64_t wanted = k == 0 ? 1 : k < interval ? (few ? k + 1 : interval - 1) : interval;
    const std::int64_t count = std::min({wanted, most_sweeps() - k, tracker_.left()});
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
    looks.emplace_back(k, error);
    if (!asks || k < 2 * interval || k < rules.limit / 4) continue;
    // the error of single sweeps goes up and down
    while (2 * looks[middle + 1].first <= k) ++middle;
    const auto [before, error_before] = looks[middle];
    const double rate = std::log(error_before / error) / static_cast<double>(k - before);
    const double left = std::log(error / tolerance_) / rate;
    const double most = rules.left > 0 ? static_cast<double>(rules.left)
                                       : extension * static_cast<double>(rules.limit);
    if (rate > 0 && left <= most &&
        (rules.worth == 0 || pays(left * sweep_cost(problem_), worth))) {
      in_sight = k;
    } else if (static_cast<double>(k) >= hope * static_cast<double>(in_sight)) {
      return;
    }
  }
}

template <class Cone>
double Island<Cone>::paid_for(const Patience& rules, double cost) {
  const double factorisations = !fits(system().bytes()) ? instead_of_factors
                                : rules.worth > 0 ? rules.worth
                                                  : static_cast<double>(system().factorisations());
  const double steps = factorisations * factorisation_cost(problem_, system()) / cost;
  return rules.worth > 0 && steps < 2.0 * static_cast<double>(rules.first_look) ? 0.0 : steps;
}

template <class Cone>
void Island<Cone>::run(const SweepOnStage& rules) {
  const double budget = paid_for(rules, sweep_cost(problem_));
  ConvergenceRate rate(rules.first_look, budget, tolerance_);
  r_ = best_;
  problem_.velocity(r_, u_);
  for (std::int64_t k = steps_per_look; static_cast<double>(k) < budget; k += steps_per_look) {
    const std::int64_t count = std::min(steps_per_look, tracker_.left());
    for (std::int64_t j = 0; j < count; ++j) gauss_seidel_->sweep(r_, u_);
    problem_.velocity(r_, u_);
    const double error = relative_error<Cone>(problem_, u_, r_);
    if (take(count, error, r_)) {
      if (!std::isfinite(error)) return_to_best();
      return;
    }
    if (rate.hopeless(k, error)) return;
  }
}

template <class Cone>
void Island<Cone>::run(const SpectralGradientStage& rules) {
  const double budget = paid_for(rules, sweep_cost(problem_));
  if (!(budget > 0)) return;
  ConvergenceRate rate(rules.first_look, budget, tolerance_);
  Vector r = start_of(rules.from);
  Vector u(problem_.m());
  problem_.velocity(r, u);
  std::int64_t k = 0;
  std::int64_t since = 0;  // steps since the last look
  spectral_gradient<Cone>(problem_, {}, r, u, [&](const Vector&) {
    if (++since < std::min(steps_per_look, tracker_.left())) return false;
    double error = relative_error<Cone>(problem_, u, r);
    if (error <= tolerance_) {
      problem_.velocity(r, u);
      error = relative_error<Cone>(problem_, u, r);
    }
    k += since;
    const std::int64_t count = std::exchange(since, 0);
    return take(count, error, r) || static_cast<double>(k) > budget || rate.hopeless(k, error);
  });
}

template <class Cone>
void Island<Cone>::run(const AlternatingDirectionsStage& rules) {
  const double budget = paid_for(rules, sweep_cost(problem_) + solve_cost(system()));
  if (!(budget > 0)) return;
  ConvergenceRate rate(rules.first_look, budget, tolerance_);
  const Cones<Cone> cones(problem_.friction);
  AlternatingDirections<Cone> step(problem_, system(), {});
  Vector u(problem_.m());
  Vector shift(problem_.nc());
  const Vector start = guessed_ ? best_ : Vector(Vector::Zero(problem_.m()));
  problem_.velocity(start, u);
  de_saxce_shift<Cone>(u, problem_.friction, shift);
  if (!step.start(start, u, shift)) return;
  std::int64_t since = 0;  // steps since the last look
  for (std::int64_t k = 1; static_cast<double>(k) < budget; ++k) {
    step.x_update(shift);
    step.z_update(cones);
    step.w_update();
    step.velocity(u);
    de_saxce_shift<Cone>(u, problem_.friction, shift);
    if (++since >= std::min(steps_per_look, tracker_.left())) {
      problem_.velocity(step.z(), u);
      const double error = relative_error<Cone>(problem_, u, step.z());
      if (take(std::exchange(since, 0), error, step.z())) return;
      if (rate.hopeless(k, error)) return;
    }
    if (!step.adapt()) return;
  }
}

template <class Cone>
void Island<Cone>::run(const ConjugateGradientsStage& rules) {
  const std::int64_t trial = steps_per_cone_look;
  const std::int64_t limit = std::min(rules.limit, tracker_.left());
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
  std::int64_t told = 0;  // iterations that are counted
  const auto untold = [&](std::int64_t k) { return k - std::exchange(told, k); };
  for (std::int64_t k = 1; k <= limit; ++k) {
    problem_.W.multiply_add(direction, zero, product);
    const double curvature = direction.dot(product);
    if (!(curvature > 0)) return;
    const double length = rz / curvature;
    r += length * direction;
    residual -= length * product;
    const double size = residual.norm();
    if (k == first_cone_look && violation(r) > most_outside) return;
    if (k % trial == 0) {
      // at this rate, does it end within the limit?
      const double rate = std::log(last / size) / static_cast<double>(trial);
      const double left = std::log(size / (tolerance_ * problem_.scale)) / rate;
      if (violation(r) > most_outside || !(rate > 0) || left > static_cast<double>(limit)) {
        return;
      }
      if (tracker_.report(untold(k), error_, best_)) return;
      last = size;
    }
    if (size <= tolerance_ * problem_.scale) {
      Vector inside = r;
      project(inside);
      Vector u(problem_.m());
      problem_.velocity(inside, u);
      if (take(untold(k), relative_error<Cone>(problem_, u, inside), inside)) return;
      // the rest of the error is that r is not in the cones
      if (size <= exact_residual * tolerance_ * problem_.scale) return;
    }
    precondition(residual, z);
    const double next = residual.dot(z);
    direction = z + (next / rz) * direction;
    rz = next;
  }
  if (limit < rules.limit) tracker_.report(untold(limit), error_, best_);
}

template <class Cone>
void Island<Cone>::project(Vector& r) const {
  for (Index a = 0; a < problem_.nc(); ++a) {
    auto part = r.template segment<D>(D * a);
    part = Cone(problem_.friction, a).project(part);
  }
}

template <class Cone>
double Island<Cone>::violation(const Vector& r) const {
  Vector inside = r;
  project(inside);
  return (r - inside).norm() / r.norm();
}

template <class Cone>
void Island<Cone>::proximal(ProximalRules rules, Vector r) {
  rules.own_angular_rho = true;
  ProximalPoint<Cone> method(problem_, system());
  const double error =
      method.solve(rules, tolerance_, r, [&](double at) { return tracker_.report(1, at, r); });
  take(0, error, r);
}

template <class Cone>
void Island<Cone>::run(const ProximalStage& rules) {
  ProximalRules own = rules;
  if (rules.wander) own.patience = endless;
  proximal(own, start_of(rules.from));
}

/// Polishes iterates when a path comes near a solution.
template <class Cone>
class Island<Cone>::ProximalPolish {
 public:
  ProximalPolish(Island& island, double below, double again)
      : island_(island), next_(below), again_(again) {}
  void operator()(double error, const Vector& r) {
    if (!(error < next_)) return;
    island_.proximal(PolishStage{}, r);
    next_ = error / again_;
  }

 private:
  Island& island_;
  double next_;
  double again_;
};

template <class Cone>
void Island<Cone>::run(const InteriorPointStage& stage) {
  using Path = typename InteriorPointFor<Cone>::type;
  InteriorPointRules rules = stage;
  if (stage.far > 0) rules.tau = std::clamp(stage.far * error_, rules.tau, 1.0);
  Path method(problem_, system());
  constexpr double sooner = std::is_same_v<Cone, Coulomb<D>> ? 1 : sooner_on_two_cones;
  ProximalPolish polish(*this, sooner * stage.polish, next_polish);
  // a loose tolerance needs no polish: the path makes the last steps itself
  const double near = tolerance_ > own_accuracy ? next_polish * tolerance_ : 0;
  method.solve(rules, start_of(stage.from), [&](double error, const Vector& r) {
    if (take(1, error, r)) return true;
    if (error > near) polish(error, r);
    return done();
  });
}

template <class Cone>
void Island<Cone>::run(const HeldBodiesStage& rules) {
  if constexpr (std::is_same_v<Cone, Coulomb<D>> && D <= 3) {
    if (problem_.primal == nullptr) return;
    HeldBodies<D> method(problem_, *problem_.primal, system());
    ProximalPolish polish(*this, polish_below, next_polish_of_rounds);
    method.solve(
        rules, tolerance_,
        [&](double error, const Vector& r) {
          if (take(0, error, r)) return true;
          polish(error, r);
          return done();
        },
        [&] { return tracker_.report(1, error_, best_); });
    own_factorisations_ = method.factorisations();
  }
}

template <class Cone>
void Island<Cone>::run(const HomotopyStage& rules) {
  Homotopy<Cone> method(problem_, system());
  ProximalPolish polish(*this, polish_below_on_path, next_polish_of_rounds);
  Vector last = best_;
  method.solve({.smoothing = rules.smoothing, .max_factorisations = rules.limit},
               [&](double error, const Vector& r) {
                 if (take(1, error, r)) return true;
                 last = r;
                 polish(error, r);
                 return done();
               });
  if (!done() && steps_after_path > 0) {
    proximal({.kappa = 100,
              .easy = 10,
              .hard = 0.2,
              .patience = endless,
              .max_factorisations = steps_after_path},
             last);
  }
}

template <class Cone>
void Island<Cone>::run(const NewtonStage& rules) {
  SemismoothNewton<Cone> newton(problem_, rules.function, resources_.threads);
  if (!fits(newton.system().bytes())) return;
  if (rules.most_flops > 0 && newton.system().flops() > rules.most_flops * system().flops()) {
    return;
  }
  descend(newton, rules, rules.limit, start_of(rules.from));
  tracker_.add_cpu(newton.system().others_cpu());
  own_factorisations_ = newton.factorisations();
}

template <class Cone>
void Island<Cone>::descend(SemismoothNewton<Cone>& newton, const NewtonRules& rules,
                           std::int64_t left, Vector r) {
  double least = std::numeric_limits<double>::infinity();
  newton.solve(rules, r, [&](double error) {
    least = std::min(least, error);
    return tracker_.report(1, error, r) || error <= tolerance_ || --left == 0;
  });
  take(0, least, r);
}

template <class Cone>
void Island<Cone>::run(const PivotingStage& rules) {
  const int edges = static_cast<int>(rules.edges);
  if (!fits(Pivoting<Cone>::bytes(problem_, edges))) return;
  const Pivoting<Cone> method(problem_, edges);
  Random random;
  Vector r;
  Vector cover = Vector::Ones(method.size());
  for (std::int64_t k = 0; k < rules.tries && !done(); ++k) {
    const auto most = std::min(most_pivots, tracker_.left());
    const int pivots = method.solve(
        cover, static_cast<int>(most), [&](int made) { return tracker_.glance(made, best_); }, r);
    if (tracker_.report(pivots, error_, best_)) return;
    if (rounding_of_velocity(r) < most_rounding * tolerance_) {
      proximal({.patience = endless, .max_factorisations = polish_of_pivots}, r);
    }
    for (double& x : cover) x = std::exp(random.between(-3, 3));
  }
}

template <class Cone>
double Island<Cone>::rounding_of_velocity(const Vector& r) const {
  const Vector weight = contact_weights(problem_);
  double size = 0;
  for (Index a = 0; a < problem_.nc(); ++a) {
    size = std::hypot(size, weight[a] * r.template segment<D>(D * a).norm());
  }
  return std::numeric_limits<double>::epsilon() * size / problem_.scale;
}

template <class Cone>
void Island<Cone>::run(const RandomStartsStage& rules) {
  const Vector unit = contact_weights(problem_).cwiseSqrt().cwiseInverse();
  double size = 0;  // ||q||, with each contact in its own unit
  for (Index a = 0; a < problem_.nc(); ++a) {
    size = std::hypot(size, unit[a] * problem_.q.template segment<D>(D * a).norm());
  }
  SemismoothNewton<Cone> newton(problem_, ContactFunctionKind::natural_map, resources_.threads);
  if (!fits(newton.system().bytes())) return;
  Random random;
  for (std::int64_t k = 0; k < rules.tries && !done(); ++k) {
    if (tracker_.glance(0, best_)) break;  // a start whose factorisation fails reports nothing
    Vector start = Vector::Zero(problem_.m());
    for (Index a = 0; a < problem_.nc(); ++a) {
      if (random.between(0, 3) < 1) continue;
      auto r = start.template segment<D>(D * a);
      r[0] = size * unit[a] * std::pow(10.0, random.between(-2, 2));
      const Cone cone(problem_.friction, a);
      for_each_group<Cone>([&](auto g) {
        constexpr int at = Cone::start(g);
        constexpr int size = Cone::size(g);
        const double angle = random.between(0, 2 * std::numbers::pi);
        const double share = std::min(1.0, random.between(0, 2));
        const double radius = share * cone.coefficient(g) * r[0];
        r[at] = radius * (size > 1 ? std::cos(angle) : angle < std::numbers::pi ? 1 : -1);
        if (size > 1) r[at + size - 1] = radius * std::sin(angle);
      });
    }
    descend(newton, {.sweeps = random_sweeps}, random_limit, start);
    if (!done()) proximal({.max_factorisations = random_polish}, start);
  }
  own_factorisations_ = newton.factorisations();
}

template <class Cone>
void Island<Cone>::run(const NoSolutionStage& rules) {
  ReducedProblem frictionless = problem_;
  frictionless.friction.for_each([](Vector& coefficients) { coefficients.setZero(); });
  const double usual = problem_.q.norm() / mean_diagonal(problem_);
  CoupledSystem system(frictionless);
  ProximalPoint<Cone> method(frictionless, system);
  Vector r = Vector::Zero(problem_.m());
  Vector last = r;
  Vector step = r;
  Vector y(problem_.nc());
  const ProximalRules own{
      .easy = 100, .hard = 0.1, .patience = endless, .max_factorisations = rules.limit};
  method.solve(own, proof_accuracy, r, [&](double) {
    // the steps tend to the ray, without the part of r that stays
    step = method.iterate() - last;
    last = method.iterate();
    double largest = 0;
    for (Index a = 0; a < problem_.nc(); ++a) largest = std::max(largest, step[D * a]);
    // contacts outside the ray keep small parts; they are left out
    for (const double least : {1e-9, 1e-6, 1e-3}) {
      for (Index a = 0; a < problem_.nc(); ++a) {
        y[a] = step[D * a] > least * largest ? step[D * a] / largest : 0;
      }
      // here a ray may be rounding of what was eliminated: the data as given decides
      if (no_solution_bound<Cone>(problem_, y) > safe_bound * usual && proves_(y)) {
        tracker_.refuse();
        return true;
      }
    }
    return tracker_.report(1, error_, best_);
  });
}

template <class Cone>
void Island<Cone>::run(const AssociatedStage& /*rules*/) {
  if constexpr (std::is_same_v<Cone, Coulomb<D>>) {
    InteriorPoint<D> method(problem_, system());
    ProximalPolish polish(*this, polish_below, next_polish);
    bool near = false;
    method.solve({.associated = true}, Vector::Zero(problem_.m()),
                 [&](double error, const Vector& r) {
                   if (take(1, error, r)) return true;
                   if (!near && method.tau() < near_tau) {
                     near = true;
                     associated_ = r;
                   }
                   if (method.tau() < near_tau && method.speed() > fast_speed) return true;
                   if (method.tau() < nearer_tau && method.speed() > slow_speed) return true;
                   polish(error, r);
                   return done();
                 });
  }
}

template <class Cone>
void Island<Cone>::run(const OwnUnitsStage& rules) {
  const InOwnUnits own(problem_);
  Table before;
  for (const StageRule& rule : table_) {
    if (std::holds_alternative<OwnUnitsStage>(rule.method)) break;
    before.push_back(rule);
  }
  if (before.empty()) return;
  // it ends as soon as an iterate is good enough in the units of the problem
  Settings settings;
  settings.tolerance = own_tolerance * tolerance_;
  settings.max_iterations = tracker_.left();
  Vector u(problem_.m());
  std::int64_t told = 0;
  settings.callback = [&](const Progress& progress) {
    const Vector r = own.reactions(*progress.r);
    problem_.velocity(r, u);
    const std::int64_t count = progress.iteration - std::exchange(told, progress.iteration);
    return !take(count, relative_error<Cone>(problem_, u, r), r) && !tracker_.glance(0, best_);
  };
  Vector r = own.to_own(start_of(rules.from));
  const double start = cpu_time();
  const Outcome outcome = chain::run(own.problem(), before, resources_, settings, r);
  for (const Stage& stage : outcome.stages) own_factorisations_ += stage.factorisations;
  if (outcome.cpu_s) tracker_.add_cpu(*outcome.cpu_s - (cpu_time() - start));
  if (outcome.status == Status::infeasible) tracker_.refuse();
}

#define FCLIB_INSTANTIATE(Cone) template class Island<Cone>;
FCLIB_FOR_EACH_CONE(FCLIB_INSTANTIATE)
#undef FCLIB_INSTANTIATE

}  // namespace fclib::chain
