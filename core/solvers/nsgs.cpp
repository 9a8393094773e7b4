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
// Differs from the papers in: columns of W keep the velocities up to date. So a contact whose
// reaction does not change costs nothing, and the natural map costs no product with W. Settled
// contacts may be left alone for some sweeps (`freeze`). The paper's implementation does that at
// random; here it is a fixed number of sweeps. With `threads` above 1 it sweeps colour by colour
// (linalg/colouring.hpp), with u^a from the row of W, and the order of the contacts is not the
// given one.

#include <algorithm>
#include <array>
#include <cstdint>
#include <random>

#include "methods/shared_options.hpp"
#include "reduced/sweeps.hpp"
#include "solve/best_iterate.hpp"
#include "solve/by_cone.hpp"
#include "solve/schedule.hpp"

namespace fclib::nsgs {

namespace {

enum class Shuffle { no, once, always };
constexpr std::array<std::string_view, 3> shuffles{"no", "once", "always"};

struct Options : SweepOptions {
  double relaxation = 1.0;
  Shuffle shuffle = Shuffle::no;
  std::int64_t seed = 0;
  std::int64_t freeze = 0;
  double freeze_below = 1e-6;

  static constexpr auto fields() {
    using O = Options;
    return std::tuple_cat(
        sweep_fields<O>(),
        std::tuple{
            option("relaxation", &O::relaxation, "1", {1e-3, 1.999},
                   "omega in r <- omega r_local + (1 - omega) r. Above 1, r may leave the cone, "
                   "and is projected back."),
            choice("shuffle", &O::shuffle, shuffles,
                   "The order of the contacts, or of the colours with threads: as given, shuffled "
                   "once, or shuffled before every sweep."),
            option("seed", &O::seed, "1", {0}, "The seed of the random order."),
            option("freeze", &O::freeze, "sweeps", {0, 1e6},
                   "The number of sweeps for which a settled contact is left alone."),
            option("freeze_below", &O::freeze_below, "1", {0, 1},
                   "A contact is settled if the relative change of its reaction is below this.")});
  }
};

/// u = W r + q removes the rounding of the updates of u at least this often [sweeps].
constexpr std::int64_t refresh_interval = 1000;
/// ... and after each of these sweeps if there is a guess: a large one leaves much rounding.
constexpr std::array<std::int64_t, 2> first_refreshes{10, 100};

template <class Cone>
Outcome iterate(const ReducedProblem& problem, const Options& options, const Settings& settings,
                Vector& r) {
  BestIterate<Cone> best(problem, settings, r);
  Vector u(problem.m());
  problem.velocity(r, u);
  if (best.report(0, r, u)) return best.outcome(r);

  const bool guessed = (r.array() != 0).any();
  Sweeps<Cone> contacts(problem, options.threads);
  LocalStep<Cone> step = options.local_step<Cone>();
  step.relaxation = options.relaxation;
  std::mt19937_64 random(static_cast<std::uint64_t>(options.seed));
  if (options.shuffle == Shuffle::once) contacts.shuffle(random);
  // settled contacts sleep for a while: the sweep at which each wakes
  std::vector<std::int64_t> wakes(options.freeze > 0 ? problem.nc() : 0, 0);

  Schedule schedule(options.error_interval, best.tolerance());
  for (std::int64_t sweep = 1;; ++sweep) {
    if (options.shuffle == Shuffle::always) contacts.shuffle(random);
    if (options.symmetric && sweep > 1) contacts.reverse();
    contacts.sweep([&](Index a) {
      if (options.freeze == 0) {
        contacts.update(a, r, u, step);
      } else if (auto& wake = wakes[static_cast<std::size_t>(a)]; sweep >= wake) {
        const double change = contacts.update(a, r, u, step).norm();
        const double size = r.segment<Cone::dim>(Cone::dim * a).norm();
        if (change <= options.freeze_below * size) wake = sweep + 1 + options.freeze;
      }
    });

    const bool first =
        guessed && std::count(first_refreshes.begin(), first_refreshes.end(), sweep) > 0;
    if (first || sweep % refresh_interval == 0) problem.velocity(r, u);
    const std::int64_t count = sweep - best.iterations();
    if (!schedule.due(sweep)) {
      if (best.due(count) && best.glance(count, r)) return best.outcome(r, contacts.cpu_s());
      continue;
    }
    contacts.velocity(r, u);
    if (best.report(count, r, u)) return best.outcome(r, contacts.cpu_s());
    schedule.evaluated(sweep, best.last_error());
  }
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
      .spin_dimensions = {4, 6},
      .options = describe_options<Options>(),
      .max_iterations = 1'000'000,
      .solve = by_cone<Options>([]<class Cone>(auto&... all) { return iterate<Cone>(all...); }),
  };
  return entry;
}

}  // namespace fclib::nsgs
