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
gauss-seidel                    : gauss_seidel        on=whole at_most=2               limit=5 worth=0
gauss-seidel                    : gauss_seidel        on=whole at_least=3              limit=20 worth=0
# between walls that joints hold, sweeps let reactions grow without bound
proximal newton                 : polish              jointed=0.1 from=nothing         limit=12
# bodies at rest that stick everywhere, from the guess where there is one
conjugate gradients             : conjugate_gradients at_least=20                      limit=400
# a good guess: the statuses are nearly known; on few bodies the proximal point is cheaper
proximal newton                 : polish              at_least=5 below=0.03 guessed=true bodies=fewer limit=12
newton from the guess           : semismooth_newton   at_least=5 below=0.03 guessed=true bodies=more from=best function=alart_curnier sweeps=0 patience=3 limit=12
gauss-seidel                    : gauss_seidel                                         limit=100
# large and dense, to a loose tolerance: a factorisation costs as much as hundreds of products with W
spectral gradient               : spectral_gradient   at_least=150 law=coulomb         worth=2 first_look=100
proximal newton                 : polish              below=1e-5                       limit=24
# from near what the sweeps have; then, where its path folds, from far away
interior point                  : interior_point      law=coulomb from=swept           far=4 tau=0.03 limit=60
# rolling contacts have errors in two units: where it slows down, the proximal point is near enough
interior point                  : interior_point      law=rolling from=swept           far=4 tau=0.03 limit=60 polish=1e-4
# dense heaps on which its path ends: gradients, for what the interior point has cost
spectral gradient, longer       : spectral_gradient   at_least=150 law=coulomb from=swept
gauss-seidel                    : sweep_on            law=coulomb
# near a solution, once gradients or sweeps have smoothed what the interior point has left
proximal point, near            : proximal_point      from=best below=1e-4             limit=200
# errors in two units, of which one is met: another function has other steps (a rover on stones)
newton, near                    : semismooth_newton   from=best below=1e-6 law=coulomb function=fischer_burmeister limit=30
interior point, shorter steps   : interior_point      law=coulomb from=nothing         tau=10 step_cap=0.8 delta=1e-3 limit=100
# a tight tolerance, where interior points end at rounding
proximal point, last digits     : proximal_point      from=best below=1e-8             limit=200
gauss-seidel                    : sweep_on            law=coulomb
# a proof is found at once or not at all, and spares what follows
no solution?                    : no_solution                                          limit=60
# cheap beside what follows
interior point, smoothed        : interior_point      law=coulomb from=swept           smoothing=1 step_cap=0.8 delta=1e-3 limit=100
# where it converges, it does from nothing as well; slower than the proximal point on rolling contacts
semismooth newton               : semismooth_newton   from=nothing law=coulomb         most_flops=100 limit=200
# where most bodies rest: reactions that hold them are found by convex problems. With all that creep,
# then without most of them
held bodies                     : held_bodies         at_least=100                     creep=0
held bodies                     : held_bodies         at_least=100
associated                      : associated
proximal point                  : proximal_point      from=best                        limit=200
# slow, but cheaper than the paths that follow
proximal point, longer          : proximal_point      from=best below=1e-3             limit=1200
# another width of smoothing is another path
homotopy                        : homotopy                                             smoothing=0.3 limit=1500
homotopy                        : homotopy                                             smoothing=1 limit=1500
# contacts that wedge each other: few enough for dense tableaux
pivoting                        : pivoting            at_most=20                       edges=4 tries=60
pivoting                        : pivoting            at_most=8                        edges=16 tries=40
random starts                   : random_starts       at_most=12                       tries=200
# the last resort
proximal point                  : proximal_point      from=associated                  wander=true limit=400
proximal point                  : proximal_point      from=best                        wander=true limit=800
proximal point                  : proximal_point      from=best                        wander=true limit=1600
proximal point                  : proximal_point      from=best                        wander=true limit=1200
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
