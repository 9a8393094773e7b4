#include "chain/chain.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <numbers>
#include <optional>
#include <random>
#include <span>
#include <string>
#include <utility>

#include "contact/natural_squares.hpp"
#include "linalg/cpu_time.hpp"
#include "linalg/memory.hpp"
#include "methods/pivoting.hpp"
#include "methods/rolling_interior_point.hpp"
#include "reduced/gauss_seidel.hpp"
#include "reduced/no_solution.hpp"
#include "reduced/relative_error.hpp"
#include "reduced/scale.hpp"
#include "reduced/with_cone.hpp"

namespace fclib::chain {

namespace {

/// Operations of a sweep, and of a factorisation with the rest of an iteration.
double sweep_cost(const ReducedProblem& problem) {
  return sweep_operations * static_cast<double>(problem.nc()) +
         static_cast<double>(problem.W.entries());
}
double factorisation_cost(const ReducedProblem& problem, const CoupledSystem& system) {
  return iteration_operations * static_cast<double>(problem.nc()) + system.flops();
}

/// Random numbers, the same everywhere.
class Dice {
 public:
  double between(double least, double most) {
    constexpr int dropped = 11;  // bits of 64 that a double does not hold
    return least + (most - least) * std::ldexp(static_cast<double>(random_() >> dropped), -53);
  }

 private:
  std::mt19937_64 random_;
};

/// Follows the whole solve: iterations, stages, the error of the islands not being worked on.
class Tracker {
 public:
  explicit Tracker(const Settings& settings) : monitor_(settings) {}

  [[nodiscard]] double tolerance() const { return monitor_.tolerance(); }
  [[nodiscard]] std::optional<Status> stopped() const { return stopped_; }
  [[nodiscard]] std::int64_t iterations() const { return iterations_; }
  [[nodiscard]] std::vector<Stage>& stages() { return stages_; }

  /// Factors that would take so many bytes are not made, where there are so many.
  void without_factors(double bytes, double limit) {
    if (bytes <= too_large_) return;
    too_large_ = bytes;
    char text[120];
    std::snprintf(text, sizeof text,
                  "factors of %.3g GB do not fit into %.3g GB of memory: methods that factorise "
                  "were left out",
                  bytes / 1e9, limit / 1e9);
    message_ = text;
  }
  [[nodiscard]] const std::string& message() const { return message_; }

  /// There is no solution.
  void refuse() { stopped_ = Status::infeasible; }

  /// CPU time of other threads than the caller's [s].
  void add_cpu(double seconds) { others_cpu_ += seconds; }
  [[nodiscard]] double others_cpu() const { return others_cpu_; }

  /// The squared error of all contacts but those worked on now.
  void set_others(double squared) { others_ = squared; }

  /// All reactions, and the contacts of the island that is worked on now; no contacts: all of them.
  void set_island(const Vector& all, std::span<const Index> contacts, int d) {
    if (!monitor_.watched()) return;
    all_ = all;
    contacts_ = contacts;
    d_ = d;
  }

  /// Counts iterations and tells of the error that is left, with r of the island. Whether to end
  /// the stage: because everything stops, or because the iterate is not finite.
  bool report(std::int64_t iterations, double error, const Vector& r) {
    const bool first = iterations_ == 0 && !reported_;
    iterations_ += iterations;
    reported_ = true;
    const double all = std::sqrt(others_ + error * error);
    const bool finite = std::isfinite(all);
    if (!stopped_ && (iterations > 0 || first)) {
      // what has overflown is not an error to tell of, but its iterations count
      if (finite) told_ = all;
      stopped_ = monitor_.report(iterations_, told_, shown(r));
    }
    return stopped_.has_value() || !finite;
  }
  /// Iterations that may still be made.
  [[nodiscard]] std::int64_t left() const { return monitor_.max_iterations() - iterations_; }

  /// Runs a stage, which returns the factorisations that it made and whether it solved.
  template <class F>
  void stage(std::string_view name, std::string_view families, const F& run) {
    auto at = std::find_if(stages_.begin(), stages_.end(),
                           [&](const Stage& stage) { return stage.kind.name == name; });
    if (at == stages_.end()) {
      at = stages_.insert(stages_.end(), Stage{.kind = {std::string(name), std::string(families)}});
    }
    monitor_.enter(name);
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
  /// All reactions, for who looks on.
  const Vector* shown(const Vector& r) {
    if (!monitor_.watched() || contacts_.empty()) return &r;
    for (std::size_t k = 0; k < contacts_.size(); ++k) {
      const auto from = static_cast<Eigen::Index>(k) * d_;
      all_.segment(Eigen::Index{contacts_[k]} * d_, d_) = r.segment(from, d_);
    }
    return &all_;
  }

  Monitor monitor_;
  double too_large_ = 0;  // bytes of the largest factors that are not made
  std::string message_;
  double others_ = 0;
  double told_ = std::numeric_limits<double>::max();  // the last error that was finite
  double others_cpu_ = 0;
  std::int64_t iterations_ = 0;
  bool reported_ = false;
  std::optional<Status> stopped_;
  std::vector<Stage> stages_;
  Vector all_;
  std::span<const Index> contacts_;
  int d_ = 0;
};

/// [bytes] Factors that always fit.
constexpr double never_too_much = 256e6;
/// Of the available memory, what factors may take: the rest of the solve takes some too.
constexpr double spare_memory = 0.8;
/// Steps of the other methods may cost as much as so many factorisations where none are made.
constexpr double instead_of_factors = 100;

template <class Stage>
constexpr bool factorises =
    !std::is_same_v<Stage, GaussSeidelStage> && !std::is_same_v<Stage, SweepOnStage> &&
    !std::is_same_v<Stage, SpectralGradientStage> &&
    !std::is_same_v<Stage, ConjugateGradientsStage>;

template <class Cone>
class Island {
 public:
  static constexpr int D = Cone::dim;

  /// What is known of the bodies: of the whole problem, if anything, and which contacts of it the
  /// island has; none: all.
  struct KnownBodies {
    const Primal* whole = nullptr;
    std::span<const Index> contacts;
  };

  /// `proves` says whether y (nc of the island) proves that there is no solution.
  Island(const ReducedProblem& problem, const KnownBodies& bodies, const Table& table,
         const Means& means, Tracker& tracker, double tolerance, bool guessed,
         std::function<bool(const Vector&)> proves)
      : problem_(problem),
        bodies_(bodies),
        table_(table),
        means_(means),
        tracker_(tracker),
        tolerance_(tolerance),
        guessed_(guessed),
        proves_(std::move(proves)) {
    gauss_seidel_.emplace(problem);
  }

  /// From r, by the stages for the whole or for islands; the best iterate ends in r. Its error
  /// relative to the problem's scale.
  double solve(Vector& r, On on) {
    r_ = r;
    problem_.velocity(r_, u_);
    best_ = r_;
    error_ = relative_error<Cone>(problem_, u_, r_);
    if (!std::isfinite(error_)) error_ = endless;  // anything is better
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

 private:
  [[nodiscard]] bool done() const { return error_ <= tolerance_ || tracker_.stopped(); }

  // ---- the checkpoints between stages

  /// What later stages start from, as the chain comes to the first that does.
  void remember(const StageRule& rule) {
    if (swept_.size() > 0) return;
    std::visit(
        [&](const auto& method) {
          if constexpr (requires { method.from; }) {
            if (method.from == Start::swept || method.from == Start::associated) swept_ = best_;
          }
        },
        rule.method);
  }

  [[nodiscard]] bool applies(const StageRule& rule) const {
    const When& when = rule.when;
    const bool coulomb = std::is_same_v<Cone, Coulomb<D>>;
    if (problem_.nc() < when.at_least) return false;
    if (when.at_most > 0 && problem_.nc() > when.at_most) return false;
    if (when.below > 0 && !(error_ < when.below)) return false;
    if (when.guessed && !guessed_) return false;
    if ((when.law == Law::coulomb || coulomb_alone(rule.method)) && !coulomb) return false;
    if (when.law == Law::rolling && coulomb) return false;
    if (when.jointed > 0 && !(jointed() > when.jointed)) return false;
    return when.bodies == Bodies::any ||
           (when.bodies == Bodies::fewer) == CoupledSystem::bodies_are_fewer(problem_);
  }

  /// Whether there is memory for what the method factorises.
  [[nodiscard]] bool affordable(const StageRule& rule) {
    return std::visit(
        [&]<class Stage>(const Stage&) { return !factorises<Stage> || fits(system()); },
        rule.method);
  }

  bool fits(const CoupledSystem& system) {
    const double bytes = system.bytes();
    if (means_.memory == 0 && bytes < never_too_much) return true;
    const double limit = means_.memory > 0 ? means_.memory : spare_memory * available_memory();
    if (bytes <= limit) return true;
    tracker_.without_factors(bytes, limit);
    return false;
  }

  /// The largest share of a contact's mobility that bilateral constraints take: rho has what it
  /// was.
  [[nodiscard]] double jointed() const {
    double most = 0;
    for (Eigen::Index a = 0; a < problem_.rho.size(); ++a) {
      const double left = problem_.W.template diagonal_block<D>(static_cast<Index>(a)).trace() / D;
      most = std::max(most, 1 - left * problem_.rho[a]);
    }
    return most;
  }

  void enter(const StageRule& rule) {
    std::visit(
        [&](const auto& method) {
          tracker_.stage(rule.name, method.families, [&] {
            const auto before = system_ ? system_->factorisations() : 0;
            const double cpu = system_ ? system_->others_cpu() : 0;
            own_factorisations_ = 0;
            run(method);
            if (system_) tracker_.add_cpu(system_->others_cpu() - cpu);
            return std::pair(
                own_factorisations_ + (system_ ? system_->factorisations() : 0) - before,
                error_ <= tolerance_);
          });
        },
        rule.method);
  }

  [[nodiscard]] Vector start_of(Start from) const {
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

  /// Keeps r where it is the best so far. Whether to end the stage.
  bool take(std::int64_t iterations, double error, const Vector& r) {
    if (error < error_) {
      error_ = error;
      best_ = r;
    }
    return tracker_.report(iterations, error, r) || done();
  }

  /// Sweeps from the best iterate; what is kept of each contact is lost where it has overflown.
  void return_to_best() {
    r_ = best_;
    problem_.velocity(r_, u_);
    gauss_seidel_.emplace(problem_);
  }

  CoupledSystem& system() {
    if (!system_) {
      system_.emplace(problem_, CoupledSystem::Form::identity, means_.threads);
    }
    return *system_;
  }

  // ---- the methods

  void run(const GaussSeidelStage& rules) {
    const std::int64_t interval = rules.interval;
    std::int64_t limit = rules.limit;
    double last = error_;
    std::int64_t k = 0;
    while (k < limit) {
      // some are solved by the first sweep, a few contacts by some
      const bool few = problem_.nc() <= rules.few;
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
      if (rules.worth > 0 && k >= 2 * interval && k >= limit / 4) {
        const double rate = std::log(last / error) / static_cast<double>(count);
        const double left = std::log(error / tolerance_) / rate;
        if (!(rate > 0) ||
            left * sweep_cost(problem_) > rules.worth * factorisation_cost(problem_, system())) {
          return;
        }
        if (k == limit && left < rules.extension * static_cast<double>(limit)) limit += interval;
      }
      last = error;
    }
  }

  /// Steps that a stage may make, by what they cost.
  double paid_for(const Patience& rules) {
    const double factorisations = !fits(system()) ? instead_of_factors
                                  : rules.worth > 0
                                      ? rules.worth
                                      : static_cast<double>(system().factorisations());
    const double steps =
        factorisations * factorisation_cost(problem_, system()) / sweep_cost(problem_);
    return rules.worth > 0 && steps < 2.0 * static_cast<double>(rules.first_look) ? 0.0 : steps;
  }

  /// Looks at the least error since the last look, whether its rate ends within what is paid for.
  class Prospect {
   public:
    Prospect(const Patience& rules, double budget, double tolerance)
        : rules_(rules), budget_(budget), tolerance_(tolerance) {}

    /// After k steps.
    bool hopeless(std::int64_t k, double error) {
      least_ = std::min(least_, error);
      if (k < 2 * mark_ || k < rules_.first_look) return false;
      const double rate = std::log(marked_ / least_) / static_cast<double>(k - mark_);
      const double left = std::log(least_ / tolerance_) / rate;
      if (!(rate > 0) || left > rules_.slack * (budget_ - static_cast<double>(k))) return true;
      marked_ = least_;
      least_ = endless;
      mark_ = k;
      return false;
    }

   private:
    Patience rules_;
    double budget_;
    double tolerance_;
    double least_ = endless;   // error since the last look
    double marked_ = endless;  // ... and before it
    std::int64_t mark_ = 0;    // steps at the last look
  };

  void run(const SweepOnStage& rules) {
    const double budget = paid_for(rules);
    Prospect prospect(rules, budget, tolerance_);
    r_ = best_;
    problem_.velocity(r_, u_);
    for (std::int64_t k = rules.interval; static_cast<double>(k) < budget; k += rules.interval) {
      const std::int64_t count = std::min(rules.interval, tracker_.left());
      for (std::int64_t j = 0; j < count; ++j) gauss_seidel_->sweep(r_, u_);
      problem_.velocity(r_, u_);
      const double error = relative_error<Cone>(problem_, u_, r_);
      if (take(count, error, r_)) {
        if (!std::isfinite(error)) return_to_best();
        return;
      }
      if (prospect.hopeless(k, error)) return;
    }
  }

  void run(const SpectralGradientStage& rules) {
    const double budget = paid_for(rules);
    if (!(budget > 0)) return;
    Prospect prospect(rules, budget, tolerance_);
    Vector r = start_of(rules.from);
    Vector u(problem_.m());
    problem_.velocity(r, u);
    std::int64_t k = 0;
    std::int64_t since = 0;  // the last look
    spectral_gradient<Cone>(problem_, {}, r, u, [&](const Vector&) {
      if (++since < std::min(rules.interval, tracker_.left())) return false;
      double error = relative_error<Cone>(problem_, u, r);
      if (error <= tolerance_) {
        problem_.velocity(r, u);
        error = relative_error<Cone>(problem_, u, r);
      }
      k += since;
      const std::int64_t count = std::exchange(since, 0);
      return take(count, error, r) || static_cast<double>(k) > budget ||
             prospect.hopeless(k, error);
    });
  }

  void run(const ConjugateGradientsStage& rules) {
    const std::int64_t trial = rules.trial;
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
    for (std::int64_t k = 1; k <= limit; ++k) {
      problem_.W.multiply_add(direction, zero, product);
      const double curvature = direction.dot(product);
      if (!(curvature > 0)) return;
      const double length = rz / curvature;
      r += length * direction;
      residual -= length * product;
      const double size = residual.norm();
      if (k == rules.early && violation(r) > rules.outside) return;
      if (k % trial == 0) {
        // at this rate, is it done within the limit?
        const double rate = std::log(last / size) / static_cast<double>(trial);
        const double left = std::log(size / (tolerance_ * problem_.scale)) / rate;
        if (violation(r) > rules.outside || !(rate > 0) || left > static_cast<double>(limit)) {
          return;
        }
        if (tracker_.report(trial, error_, best_)) return;
        last = size;
      }
      if (size <= tolerance_ * problem_.scale) {
        Vector inside = r;
        project(inside);
        Vector u(problem_.m());
        problem_.velocity(inside, u);
        if (take(k % trial, relative_error<Cone>(problem_, u, inside), inside)) return;
        // what is left is that r is not in the cones
        if (size <= rules.exact * tolerance_ * problem_.scale) return;
      }
      precondition(residual, z);
      const double next = residual.dot(z);
      direction = z + (next / rz) * direction;
      rz = next;
    }
    if (limit < rules.limit) tracker_.report(limit % trial, error_, best_);
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

  void proximal(ProximalRules rules, Vector r) {
    rules.own_rolling_rho = true;
    ProximalPoint<Cone> method(problem_, system());
    const double error =
        method.solve(rules, tolerance_, r, [&](double at) { return tracker_.report(1, at, r); });
    take(0, error, r);
  }

  void run(const PolishStage& rules) { proximal(rules, start_of(rules.from)); }
  void run(const ProximalStage& rules) {
    ProximalRules own = rules;
    if (rules.wander) own.patience = endless;
    proximal(own, start_of(rules.from));
  }

  /// Polishes iterates as a path comes near a solution.
  class Polisher {
   public:
    Polisher(Island& island, double below, double again)
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

  void run(const InteriorPointStage& stage) {
    using Path = std::conditional_t<std::is_same_v<Cone, Coulomb<D>>, InteriorPoint<D>,
                                    RollingInteriorPoint<D == 2 ? 3 : D>>;
    InteriorPointRules rules = stage;
    if (stage.far > 0) rules.tau = std::clamp(stage.far * error_, rules.tau, 1.0);
    Path method(problem_, system());
    Polisher polish(*this, stage.polish, stage.again);
    // the last steps to a loose tolerance are its own
    const double near = tolerance_ > stage.own_accuracy ? stage.again * tolerance_ : 0;
    method.solve(rules, start_of(stage.from), [&](double error, const Vector& r) {
      if (take(1, error, r)) return true;
      if (error > near) polish(error, r);
      return done();
    });
  }

  void run(const HeldBodiesStage& rules) {
    if constexpr (std::is_same_v<Cone, Coulomb<D>>) {
      if (bodies_.whole == nullptr) return;
      const bool all = bodies_.contacts.empty();
      const Primal part = all ? Primal() : restricted(*bodies_.whole, bodies_.contacts, D);
      HeldBodies<D> method(problem_, all ? *bodies_.whole : part, system());
      Polisher polish(*this, rules.polish, rules.again);
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

  /// Around the folds of the path.
  void run(const HomotopyStage& rules) {
    Homotopy<Cone> method(problem_, system());
    Polisher polish(*this, rules.polish, rules.again);
    Vector last = best_;
    method.solve({.smoothing = rules.smoothing, .max_factorisations = rules.limit},
                 [&](double error, const Vector& r) {
                   if (take(1, error, r)) return true;
                   last = r;
                   polish(error, r);
                   return done();
                 });
    if (!done() && rules.after > 0) {
      proximal({.kappa = 100,
                .easy = 10,
                .hard = 0.2,
                .patience = endless,
                .max_factorisations = rules.after},
               last);
    }
  }

  void run(const NewtonStage& rules) {
    SemismoothNewton<Cone> newton(problem_, rules.function, means_.threads);
    if (!fits(newton.system())) return;
    if (rules.most_flops > 0 && newton.system().flops() > rules.most_flops * system().flops()) {
      return;
    }
    descend(newton, rules, rules.limit, start_of(rules.from));
    tracker_.add_cpu(newton.system().others_cpu());
    own_factorisations_ = newton.factorisations();
  }

  void descend(SemismoothNewton<Cone>& newton, const NewtonRules& rules, std::int64_t left,
               Vector r) {
    double least = std::numeric_limits<double>::infinity();
    newton.solve(rules, r, [&](double error) {
      least = std::min(least, error);
      return tracker_.report(1, error, r) || error <= tolerance_ || --left == 0;
    });
    take(0, least, r);
  }

  void run(const PivotingStage& rules) {
    const Pivoting<Cone> method(problem_, static_cast<int>(rules.edges));
    Dice dice;
    Vector r;
    Vector cover = Vector::Ones(method.size());
    for (std::int64_t k = 0; k < rules.tries && !done(); ++k) {
      const auto most = std::min(rules.pivots, tracker_.left());
      const int pivots = method.solve(cover, static_cast<int>(most), r);
      if (tracker_.report(pivots, error_, best_)) return;
      if (rounding_of_velocity(r) < rules.rounding * tolerance_) {
        proximal({.patience = endless, .max_factorisations = rules.polish}, r);
      }
      for (double& x : cover) x = std::exp(dice.between(-3, 3));
    }
  }

  /// About what rounding leaves of u where the reactions are these, relative to the scale.
  [[nodiscard]] double rounding_of_velocity(const Vector& r) const {
    const Vector weight = contact_weights(problem_);
    double size = 0;
    for (Index a = 0; a < problem_.nc(); ++a) {
      size = std::hypot(size, weight[a] * r.template segment<D>(D * a).norm());
    }
    return std::numeric_limits<double>::epsilon() * size / problem_.scale;
  }

  void run(const RandomStartsStage& rules) {
    const Vector unit = contact_weights(problem_).cwiseSqrt().cwiseInverse();
    double size = 0;  // ||q||, each contact in its own unit
    for (Index a = 0; a < problem_.nc(); ++a) {
      size = std::hypot(size, unit[a] * problem_.q.template segment<D>(D * a).norm());
    }
    SemismoothNewton<Cone> newton(problem_, ContactFunctionKind::natural_map, means_.threads);
    Dice dice;
    for (std::int64_t k = 0; k < rules.tries && !done(); ++k) {
      Vector start = Vector::Zero(problem_.m());
      for (Index a = 0; a < problem_.nc(); ++a) {
        if (dice.between(0, 3) < 1) continue;
        auto r = start.template segment<D>(D * a);
        r[0] = size * unit[a] * std::pow(10.0, dice.between(-2, 2));
        const Cone cone(problem_.friction, a);
        for (int g = 0; g < Cone::groups; ++g) {
          const double angle = dice.between(0, 2 * std::numbers::pi);
          const double share = std::min(1.0, dice.between(0, 2));
          const double radius = share * cone.coefficient(g) * r[0];
          const int at = 1 + g * Cone::group_size;
          r[at] = radius * (Cone::group_size > 1       ? std::cos(angle)
                            : angle < std::numbers::pi ? 1
                                                       : -1);
          if (Cone::group_size > 1) r[at + Cone::group_size - 1] = radius * std::sin(angle);
        }
      }
      descend(newton, {.sweeps = rules.sweeps}, rules.limit, start);
      if (!done()) proximal({.max_factorisations = rules.polish}, start);
    }
    own_factorisations_ = newton.factorisations();
  }

  void run(const NoSolutionStage& rules) {
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
        if (no_solution_bound<Cone>(problem_, y) > rules.safe_bound * usual && proves_(y)) {
          tracker_.refuse();
          return true;
        }
      }
      return tracker_.report(1, error_, best_);
    });
  }

  void run(const AssociatedStage& rules) {
    if constexpr (std::is_same_v<Cone, Coulomb<D>>) {
      InteriorPoint<D> method(problem_, system());
      Polisher polish(*this, rules.polish, rules.again);
      bool near = false;
      method.solve({.associated = true}, Vector::Zero(problem_.m()),
                   [&](double error, const Vector& r) {
                     if (take(1, error, r)) return true;
                     if (!near && method.tau() < rules.near) {
                       near = true;
                       associated_ = r;
                     }
                     if (method.tau() < rules.near && method.speed() > rules.fast) return true;
                     if (method.tau() < rules.nearer && method.speed() > rules.slow) return true;
                     polish(error, r);
                     return done();
                   });
    }
  }

  const ReducedProblem& problem_;
  KnownBodies bodies_;
  const Table& table_;
  const Means& means_;
  Tracker& tracker_;
  double tolerance_;
  bool guessed_;
  std::function<bool(const Vector&)> proves_;
  std::optional<GaussSeidel<Cone>> gauss_seidel_;
  std::optional<CoupledSystem> system_;
  Vector r_, u_, best_;
  Vector swept_, associated_;            // what stages start from
  std::int64_t own_factorisations_ = 0;  // of a stage with a system of its own
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
                      .known_r = {},
                      .known_u = {},
                      .deadline = problem.deadline};
  const auto count = static_cast<Eigen::Index>(contacts.size());
  if (problem.rho.size() > 0) part.rho = problem.rho(contacts);
  part.q.resize(d * count);
  const bool known = problem.known_r.size() > 0;
  if (known) {
    part.known_r.resize(d * count);
    part.known_u.resize(d * count);
  }
  part.friction.mu.resize(count);
  if (problem.rolling()) part.friction.mu_r.resize(count);
  for (Eigen::Index k = 0; k < count; ++k) {
    part.q.segment(d * k, d) = problem.q.segment(d * contacts[k], d);
    if (known) {
      part.known_r.segment(d * k, d) = problem.known_r.segment(d * contacts[k], d);
      part.known_u.segment(d * k, d) = problem.known_u.segment(d * contacts[k], d);
    }
    part.friction.mu[k] = problem.friction.mu[contacts[k]];
    if (problem.rolling()) part.friction.mu_r[k] = problem.friction.mu_r[contacts[k]];
  }
  return part;
}

/// The chain from r, on the whole and then on each island that is left; what it reaches ends in r.
template <class Cone>
void walk(const ReducedProblem& problem, const Table& table, const Means& means, Tracker& tracker,
          bool guessed, Vector& r) {
  constexpr int D = Cone::dim;
  const Index nc = problem.nc();
  const double tolerance = tracker.tolerance();
  tracker.set_others(0);
  tracker.set_island(r, {}, D);
  std::optional<Island<Cone>> whole;
  const auto proves = [&](const Vector& y) {
    return problem.proves_no_solution != nullptr && (*problem.proves_no_solution)(y);
  };
  using KnownBodies = typename Island<Cone>::KnownBodies;
  whole.emplace(problem, KnownBodies{problem.primal, {}}, table, means, tracker, tolerance, guessed,
                proves);
  whole->solve(r, On::whole);
  if (tracker.stopped()) return;
  const std::vector<Index> group = problem.W.components();
  const Index count = 1 + *std::max_element(group.begin(), group.end());
  if (count == 1) {
    whole->solve(r, On::islands);
    return;
  }
  whole.reset();

  std::vector<std::vector<Index>> islands(static_cast<std::size_t>(count));
  for (Index a = 0; a < nc; ++a) islands[group[a]].push_back(a);
  Vector u;
  problem.velocity(r, u);
  std::vector<NaturalSquares<double>> parts(islands.size());
  const bool scaled = problem.rho.size() > 0;
  for (Index a = 0; a < nc; ++a) {
    const Cone cone(problem.friction, a);
    const typename Cone::Vec ua = u.template segment<D>(D * a);
    const typename Cone::Vec ra = r.template segment<D>(D * a);
    parts[group[a]].add_plain(cone, ua, ra);
    if (scaled) parts[group[a]].add_scaled(cone, ua, ra, problem.rho[a]);
  }
  double sum = 0;
  std::vector<double> squared;  // errors
  for (const NaturalSquares<double>& part : parts) {
    const double error = part.error(problem.scale, problem.scaled_scale);
    squared.push_back(error * error);
    sum += squared.back();
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
    tracker.set_island(r, contacts, D);
    const auto proves_island = [&](const Vector& y) {
      Vector padded = Vector::Zero(nc);
      for (Eigen::Index j = 0; j < size; ++j) padded[contacts[static_cast<std::size_t>(j)]] = y[j];
      return proves(padded);
    };
    const KnownBodies bodies{problem.primal, contacts};
    const double error =
        Island<Cone>(part, bodies, table, means, tracker, share, guessed, proves_island)
            .solve(x, On::islands);
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
Outcome iterate(const ReducedProblem& problem, const Table& table, const Means& means,
                const Settings& settings, Vector& r) {
  constexpr int D = Cone::dim;
  const Index nc = problem.nc();
  Tracker tracker(settings);
  const double start = means.threads > 1 ? cpu_time() : 0.0;  // the clock takes 0.3 microseconds
  const auto outcome = [&] {
    Outcome result{tracker.stopped().value_or(Status::stalled), tracker.iterations(),
                   std::move(tracker.stages())};
    result.message = tracker.message();
    if (means.threads > 1) result.cpu_s = cpu_time() - start + tracker.others_cpu();
    return result;
  };
  bool separating = true;
  for (Index a = 0; a < nc && separating; ++a) separating = problem.q[D * a] >= 0;
  if (separating) {
    r.setZero();
    tracker.report(0, 0.0, r);
    return outcome();
  }

  bool guessed = (r.array() != 0).any();
  if (guessed && error_at<Cone>(problem, r) == endless) {
    r.setZero();
    guessed = false;
  }
  walk<Cone>(problem, table, means, tracker, guessed, r);
  if (guessed && !tracker.stopped() && error_at<Cone>(problem, r) > tracker.tolerance()) {
    Vector cold = Vector::Zero(problem.m());
    walk<Cone>(problem, table, means, tracker, false, cold);
    if (error_at<Cone>(problem, cold) < error_at<Cone>(problem, r)) r = cold;
  }
  return outcome();
}

}  // namespace

Outcome run(const ReducedProblem& problem, const Table& table, const Means& means,
            const Settings& settings, Vector& r) {
  return with_cone(problem,
                   [&]<class Cone>() { return iterate<Cone>(problem, table, means, settings, r); });
}

}  // namespace fclib::chain
