// auto: the default. It is a chain of methods, and each is cheap to leave. The first ones are fast
// and solve most problems. The last ones are slow and solve nearly all. The table below is the
// whole chain: one stage in each line, in their order. First come the stages for the whole problem,
// then those for each island of contacts (linked through W) that is not solved yet. chain/table.hpp
// explains each word of the table; chain/chain.cpp runs it.
//
// Before the chain, r = 0 is taken if nothing approaches. After the chain, if it did not solve the
// problem from a guess, it runs again from r = 0.

#include "chain/chain.hpp"

namespace fclib::automatic {

namespace {

constexpr const char* table = R"(
# name                          : method              where and from what              rules
# The comment of a row names problems that are not solved without it, or take several times as long.
# Numbers are those of tests/planted_judge.py; workshop/tuning/notes.md has the rest.
gauss-seidel                    : gauss_seidel        on=whole                         limit=20 worth=0
# bodies at rest that stick everywhere, from the guess if there is one
conjugate gradients             : conjugate_gradients at_least=20                      limit=400
# a guess (docs/results/auto-guesses.csv): sweeps if few are left (ClosedChains of `sequences`)
gauss-seidel from the guess     : gauss_seidel        guessed=true                     limit=10 left=40 worth=0
# Newton's method, if the statuses are nearly known (a stack of boxes, a rover at rest)
newton from the guess           : semismooth_newton   below=0.003 guessed=true bodies=more from=best function=alart_curnier sweeps=0 patience=3 limit=12
gauss-seidel                    : gauss_seidel                                         limit=100
# large and dense, to a loose tolerance: a factorisation costs as much as hundreds of products with W
spectral gradient               : spectral_gradient   at_least=150 law=coulomb         worth=2 first_look=100
# very many bodies, most of them at rest: one factorisation serves many steps (docs/results/walls.csv)
alternating directions          : alternating_directions at_least=5000                 worth=20 first_look=60
proximal newton                 : polish              below=1e-5                       limit=24
# a guess on bodies that are held, by one of many reactions (Gripper of `sequences`)
proximal point from the guess   : proximal_point      below=1e-3 guessed=true from=best limit=50
# from near what the sweeps have; if it slows down, the proximal point is near enough
interior point                  : interior_point      from=swept                       far=4 tau=0.03 limit=60
# dense heaps on which its path ends, or no memory for factors (ChainMail/0599 to 1e-4)
spectral gradient, longer       : spectral_gradient   at_least=150 law=coulomb from=swept
gauss-seidel                    : sweep_on            law=coulomb
# near a solution, once gradients or sweeps have smoothed what the interior point has left (large heaps:
# docs/results/auto-near-heaps.csv)
proximal point, near            : proximal_point      from=best below=1e-4             limit=200
# if the path of the first one folds: from far away
interior point, shorter steps   : interior_point      law=coulomb from=nothing         tau=10 step_cap=0.8 delta=1e-3 limit=100
# a tight tolerance, where interior points end at rounding (PeriodicBox/0995 to 1e-12)
proximal point, last digits     : proximal_point      from=best below=1e-8             limit=200
# a proof is found at once or not at all, and spares what follows (Squeezed/0000)
no solution?                    : no_solution                                          limit=60
# if it converges, it does from nothing as well (Pile/0009 to 1e-4); slower than the proximal point on
# rolling contacts (PegInHole/0033)
semismooth newton               : semismooth_newton   from=nothing law=coulomb function=fischer_burmeister most_flops=100 limit=200
# light bodies beside heavy ones, angles beside lengths: a hand whose fingers stand at their limits
# (talos_full_v2 of example-robot-data, steps 0, 4, 5, 10, 16)
own units                       : own_units           range=1e6
# if most bodies rest: reactions that hold them are found by convex problems, with all that creep
held bodies                     : held_bodies         at_least=100                     creep=0
# 101711
proximal point                  : proximal_point      from=best                        limit=200
# slow, but cheaper than the path that follows (drakehard-sap-0140)
proximal point, longer          : proximal_point      from=best below=1e-3             limit=1200
# to its end, however often it folds (LowWall/0032)
homotopy                        : homotopy                                             smoothing=0.3 limit=20000
# contacts that wedge each other: few enough for dense tableaux (103717; then 100791, 103554)
pivoting                        : pivoting            at_most=20                       edges=4 tries=60
pivoting                        : pivoting            at_most=8                        edges=16 tries=40
# 102888
random starts                   : random_starts       at_most=12                       tries=200
# the last resort (LowWall/0034)
proximal point                  : proximal_point      from=best                        wander=true limit=1600
)";

/// Parsed as the library is loaded, so that no solve pays for it.
const chain::Table own_table = chain::parse_table(table);

struct Options {
  std::int64_t threads = 1;
  double memory_limit = 0;
  std::string chain = table;

  static constexpr auto fields() {
    using O = Options;
    return std::tuple{
        option("threads", &O::threads, "threads", {1, 256},
               "The number of threads that share a large factorisation. The result is the same for "
               "any number."),
        option("memory_limit", &O::memory_limit, "GB", {0},
               "The memory that the factors of a system may take. If they need more, the chain "
               "goes on without factorisations. 0: what the machine has available."),
        text("chain", &O::chain, "The stages, one a line: NAME : METHOD key=value ...",
             [](std::string_view text) { chain::parse_table(text); }),
    };
  }
};

Outcome solve(const ReducedProblem& problem, const OptionValues& values, const Settings& settings,
              Vector& r) {
  if (values.empty()) return chain::run(problem, own_table, {}, settings, r);
  Stopwatch watch;
  const auto options = parse_options<Options>(values);
  constexpr double gigabyte = 1e9;
  const chain::Resources resources{.threads = static_cast<int>(options.threads),
                                   .memory = gigabyte * options.memory_limit};
  const bool usual = options.chain == table;
  const chain::Table given = usual ? chain::Table() : chain::parse_table(options.chain);
  const Times setup = watch.read();
  Outcome outcome = chain::run(problem, usual ? own_table : given, resources, settings, r);
  outcome.setup = setup;
  return outcome;
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
      .spin_dimensions = {4, 6},
      .options = describe_options<Options>(),
      .max_iterations = 1'000'000,
      .solve = solve,
  };
  return entry;
}

}  // namespace fclib::automatic
