// NSGS: nonsmooth Gauss-Seidel, one contact after another.
//
//   for each contact a:  b = u^a - W_aa r^a,  r^a <- solution of the one-contact problem (W_aa, b)
//                        u <- u + W(:, a) (r^a - r^a_old)
//
// Jean & Moreau, "Unilaterality and dry friction in the dynamics of rigid body collections" (1992);
// Jourdan, Alart & Jean, "A Gauss-Seidel like algorithm to solve frictional contact problems"
// (1998); algorithm 4 of Acary, Bremond, Huber, "On solving contact problems with Coulomb friction:
// formulations and numerical comparisons" (2018).
//
// Differs from the papers in: the velocities are kept up to date by columns, so that contacts whose
// reaction does not change cost nothing, and the natural map costs no product with W; settled
// contacts may be left alone for some sweeps (`freeze`), as in the paper's implementation, but for
// a fixed number of sweeps and not at random.

#include <algorithm>
#include <array>
#include <cstdint>
#include <numeric>
#include <random>

#include "kernels/gauss_seidel.hpp"
#include "kernels/local_step.hpp"
#include "kernels/natural_error.hpp"
#include "kernels/schedule.hpp"
#include "kernels/with_cone.hpp"
#include "solve/solver.hpp"

namespace fclib::nsgs {

namespace {

enum class Shuffle { no, once, always };
constexpr std::array<std::string_view, 3> shuffles{"no", "once", "always"};

struct Options {
  LocalSolver local_solver = LocalSolver::exact;
  double relaxation = 1.0;
  Shuffle shuffle = Shuffle::no;
  std::int64_t seed = 0;
  std::int64_t local_iterations = 10;
  double local_accuracy = 1e-14;
  bool symmetric = false;
  std::int64_t freeze = 0;
  double freeze_below = 1e-6;
  std::int64_t error_interval = 0;

  static constexpr auto fields() {
    using O = Options;
    return std::tuple{
        OptionField<O, LocalSolver>{.name = "local_solver",
                                    .member = &O::local_solver,
                                    .doc = local_solvers_doc,
                                    .choices = local_solvers},
        OptionField<O, double>{.name = "relaxation",
                               .member = &O::relaxation,
                               .unit = "1",
                               .doc = "omega in r <- omega r_local + (1 - omega) r; above 1 r may "
                                      "leave the cone and is projected back",
                               .lowest = 1e-3,
                               .highest = 1.999},
        OptionField<O, Shuffle>{.name = "shuffle",
                                .member = &O::shuffle,
                                .doc = "order of the contacts: as given, shuffled once, or "
                                       "shuffled before every sweep",
                                .choices = shuffles},
        OptionField<O, std::int64_t>{.name = "seed",
                                     .member = &O::seed,
                                     .unit = "1",
                                     .doc = "of the shuffling",
                                     .lowest = 0},
        OptionField<O, std::int64_t>{
            .name = "local_iterations",
            .member = &O::local_iterations,
            .unit = "1",
            .doc = "limit of the iterations of the projection or of Newton",
            .lowest = 1,
            .highest = 1e6},
        OptionField<O, double>{
            .name = "local_accuracy",
            .member = &O::local_accuracy,
            .unit = "1",
            .doc = "relative step at which the projection stops, relative residual of "
                   "Newton",
            .lowest = 0,
            .highest = 1},
        OptionField<O, bool>{.name = "symmetric",
                             .member = &O::symmetric,
                             .doc = "every second sweep runs backwards"},
        OptionField<O, std::int64_t>{.name = "freeze",
                                     .member = &O::freeze,
                                     .unit = "sweeps",
                                     .doc = "for which a settled contact is left alone",
                                     .lowest = 0,
                                     .highest = 1e6},
        OptionField<O, double>{.name = "freeze_below",
                               .member = &O::freeze_below,
                               .unit = "1",
                               .doc = "relative change of its reaction under which a contact is "
                                      "settled",
                               .lowest = 0,
                               .highest = 1},
        OptionField<O, std::int64_t>{
            .name = "error_interval",
            .member = &O::error_interval,
            .unit = "sweeps",
            .doc = "sweeps between evaluations of the error; 0 adapts it to the convergence",
            .lowest = 0},
    };
  }
};

void shuffle_order(std::vector<Index>& order, std::mt19937_64& random) {
  // Fisher-Yates by hand: std::shuffle differs between standard libraries
  for (std::size_t k = order.size(); k > 1; --k) std::swap(order[k - 1], order[random() % k]);
}

/// The rounding of the updates of u is taken out by u = W r + q at least this often [sweeps].
constexpr std::int64_t refresh_interval = 1000;

template <class Cone>
Outcome iterate(const Delassus& problem, const Options& options, Monitor& monitor, Vector& r) {
  using Vec = typename Cone::Vec;
  GaussSeidel<Cone> contacts(problem);
  const LocalStep<Cone> solve_local{options.local_solver, options.local_accuracy,
                                    static_cast<int>(options.local_iterations)};
  const auto step = [&](ContactProblem<Cone>& contact, const Vec& b, Vec& next) {
    const Vec old = next;
    solve_local(contact, b, next);
    if (options.relaxation != 1.0) {
      next = contact.projected.cone().project(options.relaxation * next +
                                              (1.0 - options.relaxation) * old);
    }
  };
  // contacts that are settled sleep for a while: the sweep at which each wakes
  std::vector<std::int64_t> wakes(options.freeze > 0 ? problem.nc() : 0, 0);
  std::vector<Index> order(static_cast<std::size_t>(problem.nc()));
  std::iota(order.begin(), order.end(), 0);
  std::mt19937_64 random(static_cast<std::uint64_t>(options.seed));
  if (options.shuffle == Shuffle::once) shuffle_order(order, random);

  const auto error_of = [&](const Vector& u) {
    return std::sqrt(natural_map_squared<Cone>(u, r, problem.friction)) / problem.scale;
  };

  Vector u(problem.q.size());
  problem.W.multiply_add(r, problem.q, u);
  double best_error = error_of(u);
  Vector best = r;
  if (const auto stop = monitor.report(0, best_error)) return {*stop, 0};

  Schedule schedule(options.error_interval, monitor.tolerance());
  for (std::int64_t sweep = 1;; ++sweep) {
    if (options.shuffle == Shuffle::always) shuffle_order(order, random);
    if (options.symmetric && sweep > 1) std::reverse(order.begin(), order.end());
    for (const Index a : order) {
      if (options.freeze == 0) {
        contacts.update(a, r, u, step);
      } else if (auto& wake = wakes[static_cast<std::size_t>(a)]; sweep >= wake) {
        const double change = contacts.update(a, r, u, step).norm();
        const double size = r.segment<Cone::dim>(Cone::dim * a).norm();
        if (change <= options.freeze_below * size) wake = sweep + 1 + options.freeze;
      }
    }

    if (sweep % refresh_interval == 0) problem.W.multiply_add(r, problem.q, u);
    if (schedule.due(sweep) || sweep >= monitor.max_iterations() ||
        (sweep % 16 == 0 && monitor.due())) {
      double error = error_of(u);
      if (error <= monitor.tolerance()) {
        problem.W.multiply_add(r, problem.q, u);
        error = error_of(u);
      }
      if (error <= best_error) {
        best_error = error;
        best = r;
      }
      if (const auto stop = monitor.report(sweep, error)) {
        r = best;
        return {*stop, sweep};
      }
      schedule.evaluated(sweep, error);
    }
  }
}

Outcome solve(const Delassus& problem, const OptionValues& values, const Settings& settings,
              Vector& r) {
  const auto options = parse_options<Options>(values);
  Monitor monitor(settings);
  return with_cone(problem,
                   [&]<class Cone>() { return iterate<Cone>(problem, options, monitor, r); });
}

}  // namespace

const Solver& solver() {
  static const Solver entry{
      .name = "nsgs",
      .family = "splitting",
      .title = "Nonsmooth Gauss-Seidel",
      .citation = "Jean & Moreau 1992; Jourdan, Alart & Jean 1998; Acary, Bremond & Huber 2018",
      .dimensions = {2, 3},
      .rolling_dimensions = {3, 5},
      .options = describe_options<Options>(),
      .max_iterations = 1'000'000,
      .check_options = [](const OptionValues& values) { parse_options<Options>(values); },
      .solve = solve,
  };
  return entry;
}

}  // namespace fclib::nsgs
